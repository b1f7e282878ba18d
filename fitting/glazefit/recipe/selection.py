"""From refined stacks to what a painter can mix: rounded, and the best few that differ."""

import functools
import itertools
import operator
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from .model import lab_of, read
from .refine import refine
from .stacks import Stacks, pack_coats
from .task import RecipeTask

IN_GAMUT = 1.0
"""A target counts as reached below this Delta E 2000."""


@dataclass(frozen=True, eq=False)
class Scored:
    """A stack and how near it comes to its target.

    Attributes:
        sizes: (coats, paints), what each paint takes of each coat's thickness, um.
        target: number of its target.
        reading: (bands,), what the instrument reads.
        lab: (lights, 3), its colour.
        delta_e: (lights,), Delta E 2000.
        score: root of mean squared Delta E and of the penalty for another spectrum.
        settled: whether least squares came to an end for its amounts.
        steps: of least squares by the solver.
        before: largest Delta E 2000 before these steps.
        unrounded: largest Delta E 2000 before it was rounded.
    """

    sizes: Float[np.ndarray, "coats paints"]
    target: int
    reading: Float[np.ndarray, "bands"]
    lab: Float[np.ndarray, "lights 3"]
    delta_e: Float[np.ndarray, "lights"]
    score: float
    settled: bool
    steps: int
    before: float
    unrounded: float = np.nan

    @functools.cached_property
    def paints(self) -> frozenset[int]:
        """Numbers of its paints."""
        return frozenset(np.flatnonzero(self.sizes.any(axis=0)).tolist())

    @functools.cached_property
    def coats(self) -> int:
        """Number of coats."""
        return int(self.sizes.any(axis=1).sum())

    @property
    def signature(self) -> tuple[frozenset[int], ...]:
        """Sets of paints by coat, top first."""
        return tuple(frozenset(np.flatnonzero(coat).tolist()) for coat in self.sizes if coat.any())

    @property
    def distance(self) -> float:
        """Largest Delta E 2000 under the lights asked for."""
        return float(self.delta_e.max())

    def effort(self, simplicity: float) -> tuple[bool, float]:
        """Order of recipes: in gamut first, then the score and the price of each paint and coat."""
        return not self.distance < IN_GAMUT, self.score + simplicity * (
            len(self.paints) + self.coats
        )


def score(task: RecipeTask, stacks: Stacks) -> list[list[Scored]]:
    """Stacks of each target as the solver sees them, with Delta E 2000 by colour-science."""
    return _by_target(_score(task, stacks, read(task.model, stacks.sizes, task.optics).spectrum))


def _by_target(stacks: Sequence[Scored]) -> list[list[Scored]]:
    number = operator.attrgetter("target")
    return [list(group) for _, group in itertools.groupby(sorted(stacks, key=number), number)]


def _score(task: RecipeTask, stacks: Stacks, reading: Float[np.ndarray, "n bands"]) -> list[Scored]:
    labs = np.asarray(lab_of(task.model, reading))
    delta_e, cost = task.target_arrays.distances(stacks.target, reading, labs)
    return [
        Scored(
            sizes=stacks.sizes[row],
            target=int(stacks.target[row]),
            reading=reading[row],
            lab=labs[row],
            delta_e=delta_e[row],
            score=float(np.sqrt(cost[row])),
            settled=bool(stacks.settled[row]),
            steps=int(stacks.steps[row]),
            before=float(stacks.before[row]),
        )
        for row in range(stacks.size)
    ]


def select(pool: Sequence[Scored], count: int, simplicity: float) -> list[Scored]:
    """The best few that differ in their paints or in the order of their coats.

    A recipe that takes a simpler one and adds to it without coming nearer is left out while there
    are others.
    """
    chosen: list[Scored] = []
    spare: list[Scored] = []
    signatures = set()
    for stack in sorted(pool, key=lambda stack: stack.effort(simplicity)):
        if stack.signature in signatures:
            continue
        signatures.add(stack.signature)
        embellished = any(
            simpler.paints <= stack.paints
            and simpler.coats <= stack.coats
            and stack.score > simpler.score - simplicity
            for simpler in chosen
        )
        (spare if embellished else chosen).append(stack)
        if len(chosen) == count:
            break
    return chosen + spare[: count - len(chosen)]


def roundings(
    sizes: Float[np.ndarray, "coats paints"], span: tuple[float, float]
) -> list[Float[np.ndarray, "c p"]]:
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


def round_recipes(task: RecipeTask, chosen: Sequence[Sequence[Scored]]) -> list[list[Scored]]:
    """Each recipe of each target in the round numbers that come nearest.

    The solver reads a few of them: those that come nearest when a rounding changes a reading as it
    does by the table.
    """
    exact = list(itertools.chain.from_iterable(chosen))
    low, high = np.exp(task.model.span).tolist()
    before = np.stack([stack.sizes for stack in exact])
    targets = np.array([stack.target for stack in exact])
    # With a round thickness other shares are best.
    total = np.maximum(before.sum(axis=2, keepdims=True), low)
    near = before * (np.clip(total.round(1), low, high) / total)
    near = Stacks.before_refinement(near, targets, np.zeros(len(exact)))
    near = refine(task, near, task.optics, 5, hold=True).sizes
    # Round numbers about the best amounts, and about those best at round thicknesses.
    options = [
        roundings(exact_sizes, (low, high)) + roundings(near_sizes, (low, high))
        for exact_sizes, near_sizes in zip(before, near, strict=True)
    ]
    owner = np.repeat(np.arange(len(exact)), [len(tries) for tries in options])
    sizes = pack_coats(np.stack([*itertools.chain.from_iterable(options)]))
    stacks = Stacks.before_refinement(sizes, targets[owner], np.zeros(len(owner)))
    # The table says what each rounding changes; the difference to the solver's reading is added.
    by_table = read(task.model, np.concatenate([before, sizes]), None).spectrum
    off = np.stack([stack.reading for stack in exact]) - by_table[: len(exact)]
    guess = _score(task, stacks, by_table[len(exact) :] + off[owner])

    def effort(stack: Scored) -> tuple[bool, float]:
        return stack.effort(task.simplicity)

    # Round numbers of a recipe that the solver reads.
    nearest = [
        sorted(np.flatnonzero(owner == number), key=lambda row: effort(guess[row]))[:4]
        for number in range(len(exact))
    ]
    rows = np.concatenate(nearest)
    solved = iter(
        _score(task, stacks.take(rows), read(task.model, sizes[rows], task.optics).spectrum)
    )
    return _by_target(
        [
            replace(
                min((next(solved) for _ in tries), key=effort),
                settled=stack.settled,
                steps=stack.steps,
                before=stack.before,
                unrounded=stack.distance,
            )
            for stack, tries in zip(exact, nearest, strict=True)
        ]
    )
