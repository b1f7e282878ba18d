"""From refined stacks to what a painter can mix: rounded, and the best few that differ."""

import itertools
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from .model import OneStack, read
from .refine import read_and_score, refine, score
from .screen import Stacks, leaders
from .targets import Indices
from .task import RecipeTask

IN_GAMUT = 1.0
"""A target counts as reached below this Delta E 2000."""


def by_effort(task: RecipeTask, stacks: Stacks) -> Indices:
    """Order of stacks: in gamut first, then by distance and the price of each paint and coat."""
    price = task.simplicity * (stacks.paints + stacks.coats)
    return np.lexsort([np.sqrt(stacks.cost) + price, ~(stacks.distance < IN_GAMUT)])


def select(task: RecipeTask, stacks: Stacks, count: int) -> Stacks:
    """The best few for each target, that differ in their paints or in the order of their coats.

    A recipe that takes a simpler one and adds to it without coming nearer is left out while there
    are others.
    """
    paints = np.asarray(stacks.sizes.any(axis=1))
    coats = stacks.coats
    near = np.sqrt(stacks.cost)
    chosen: dict[int, list[int]] = {target: [] for target in np.unique(stacks.target).tolist()}
    spare = {target: [] for target in chosen}
    for row in leaders(by_effort(task, stacks), stacks.layouts, 1):
        target = int(stacks.target[row])
        embellished = any(
            not (paints[simpler] & ~paints[row]).any()
            and coats[simpler] <= coats[row]
            and near[row] > near[simpler] - task.simplicity
            for simpler in chosen[target]
        )
        if len(chosen[target]) < count:
            (spare if embellished else chosen)[target].append(row)
    rows = [[*best, *spare[target][: count - len(best)]] for target, best in chosen.items()]
    return stacks.take(list(itertools.chain.from_iterable(rows)))


def roundings(sizes: OneStack, span: tuple[float, float]) -> list[OneStack]:
    """The stacks in round numbers next to a stack: every share up or down to 0.1 % of its coat,
    every thickness to 0.1 um.

    Args:
        sizes: (coats, paints), um.
        span: thinnest and thickest coat, um.
    """
    return [
        np.stack(choice) for choice in itertools.product(*(_round_coats(c, span) for c in sizes))
    ]


def _round_coats(
    coat: Float[np.ndarray, "paints"], span: tuple[float, float]
) -> Iterator[np.ndarray]:
    total = coat.sum()
    if total == 0:
        yield coat
        return
    thicknesses = [size / 10 for size in {np.floor(10 * total), np.ceil(10 * total)}]
    # The bounds, but for rounding.
    allowed = [size for size in thicknesses if span[0] - 1e-9 <= size <= span[1] + 1e-9]
    # The largest paint takes what the others leave.
    main, *minor = sorted(np.flatnonzero(coat > 0), key=lambda paint: -coat[paint])
    thousandths = 1000 * coat[minor] / total
    ends = zip(np.floor(thousandths), np.ceil(thousandths), strict=True)
    choices = list(itertools.product(*map(set, ends)))
    for size, choice in itertools.product(sorted(allowed) or [total], choices):
        shares = np.zeros_like(coat)
        shares[minor] = np.array(choice) / 1000
        shares[main] = 1.0 - shares.sum()
        yield shares * size


def round_recipes(task: RecipeTask, exact: Stacks) -> Stacks:
    """Each recipe in the round numbers that come nearest.

    The solver reads a few of them: those that come nearest when a rounding changes a reading as it
    does by the table.
    """
    low, high = task.span
    # With a round thickness other shares are best.
    total = np.maximum(exact.sizes.sum(axis=2, keepdims=True), low)
    near = replace(exact, sizes=exact.sizes * (np.clip(total.round(1), low, high) / total))
    near = refine(task, near, task.optics, 5, hold=True)
    # Round numbers about the best amounts, and about those best at round thicknesses.
    options = [
        np.unique(np.round(roundings(best, task.span) + roundings(close, task.span), 12), axis=0)
        for best, close in zip(exact.sizes, near.sizes, strict=True)
    ]
    owner = np.repeat(np.arange(exact.size), [len(tries) for tries in options])
    rounded = replace(
        exact.take(owner), sizes=np.concatenate(options), unrounded=exact.distance[owner]
    )
    # The table says what each rounding changes; the difference to the solver's reading is added.
    by_table = read(task.model, np.concatenate([exact.sizes, rounded.sizes]), None).spectrum
    off = read(task.model, exact.sizes, task.optics).spectrum - by_table[: exact.size]
    guess = by_table[exact.size :] + off[owner]
    guessed = score(task, rounded, guess, np.asarray(task.model.lab(guess)))
    # Round numbers of a recipe that the solver reads.
    rows = sorted(leaders(by_effort(task, guessed), owner.tolist(), 4))
    solved = read_and_score(task, rounded.take(rows), task.optics)
    return solved.take(sorted(leaders(by_effort(task, solved), owner[rows].tolist(), 1)))
