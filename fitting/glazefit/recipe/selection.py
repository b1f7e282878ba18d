"""From refined stacks to what a painter can mix: simplified, rounded, and the best few
that differ.
"""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from glazejax.colour import delta_e_2000

from .model import StackModel, StackSolver, lab_of, readings
from .screen import Stacks, TargetArrays

IN_GAMUT = 1.0
"""A target counts as reached below this Delta E 2000."""

SHARE_STEP = 0.001
THICKNESS_STEP = 0.1
"""Shares of a coat are rounded to 0.1 %, thicknesses to 0.1 um."""


@dataclass(frozen=True)
class Scored:
    """A stack and how near it comes to its target.

    Attributes:
        sizes: (coats, paints), what each paint takes of each coat's thickness, um.
        reading: (bands,), what the instrument reads.
        delta_e: (lights,), Delta E 2000.
        score: root of mean squared Delta E and of the penalty for another spectrum.
        settled: whether least squares came to an end for its amounts.
        steps: of least squares by the solver.
        before: largest Delta E 2000 before these steps.
    """

    sizes: Float[np.ndarray, "coats paints"]
    reading: Float[np.ndarray, "bands"]
    delta_e: Float[np.ndarray, "lights"]
    score: float
    settled: bool
    steps: int = 0
    before: float = np.nan
    paints: frozenset[int] = field(init=False)
    coats: int = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(
            self, "paints", frozenset(np.flatnonzero(self.sizes.sum(axis=0) > 0).tolist())
        )
        object.__setattr__(self, "coats", int((self.sizes.sum(axis=1) > 0).sum()))

    @property
    def signature(self) -> tuple[frozenset[int], ...]:
        """Which paints lie in which coat, top first."""
        return tuple(
            frozenset(np.flatnonzero(coat > 0).tolist()) for coat in self.sizes if coat.any()
        )

    @property
    def distance(self) -> float:
        """Largest Delta E 2000 under the lights asked for."""
        return float(self.delta_e.max())

    def effort(self, simplicity: float) -> tuple[bool, float]:
        """What recipes are ordered by: in gamut first, then the score and the price of every paint
        and coat.
        """
        return not self.distance < IN_GAMUT, self.score + simplicity * (
            len(self.paints) + self.coats
        )


def score(
    model: StackModel, solver: StackSolver, aims: TargetArrays, stacks: Stacks
) -> list[Scored]:
    """Stacks as the solver sees them, with Delta E 2000 by colour-science."""
    return _score(model, aims, stacks, readings(model, stacks.sizes, solver))


def _score(
    model: StackModel, aims: TargetArrays, stacks: Stacks, reading: Float[np.ndarray, "n bands"]
) -> list[Scored]:
    reached = np.asarray(lab_of(model, reading))
    delta_e = delta_e_2000(reached, np.asarray(aims.lab)[stacks.target])
    miss = reading - np.asarray(aims.spectrum)[stacks.target]
    spectral = np.asarray(aims.spectral)[stacks.target] * np.sum(miss**2, axis=-1)
    total = np.sqrt(np.mean(delta_e**2, axis=-1) + spectral)
    plain = (values.tolist() for values in (total, stacks.settled, stacks.steps, stacks.before))
    rows = zip(stacks.sizes, reading, delta_e, *plain, strict=True)
    return [Scored(*row) for row in rows]


def simplify(model: StackModel, stacks: Stacks) -> Stacks:
    """Stacks without the paints that are hardly in them and the coats that hardly show: fewer, to
    be refined again.
    """
    share = stacks.sizes / np.maximum(stacks.sizes.sum(axis=2, keepdims=True), 1e-12)
    # A paint that is less than this of its coat is tried without.
    sizes = np.where(share < 0.01, 0.0, stacks.sizes)
    whole = _first_lab(model, sizes)
    for coat in range(sizes.shape[1]):
        without = sizes.copy()
        without[:, coat] = 0.0
        # A coat that changes the colour less than this is tried without.
        unseen = delta_e_2000(_first_lab(model, without), whole) < 0.1
        unseen &= without.any(axis=(1, 2)) & sizes[:, coat].any(axis=1)
        sizes[unseen] = without[unseen]
    changed = np.flatnonzero(((sizes > 0) != (stacks.sizes > 0)).any(axis=(1, 2)))
    simple = merge_coats(pack_coats(sizes[changed]), float(np.exp(np.asarray(model.span)[1])))
    return Stacks.before_refinement(simple, stacks.target[changed], stacks.cost[changed])


def merge_coats(
    sizes: Float[np.ndarray, "n coats paints"], thickest: float
) -> Float[np.ndarray, "n coats paints"]:
    """Stacks where neighbours of one and the same paint are one coat, if that is no thicker than
    allowed, um.
    """
    sizes = sizes.copy()
    for stack in sizes:
        for upper, lower in itertools.pairwise(stack):
            alone = (upper > 0).sum() == 1 and np.array_equal(upper > 0, lower > 0)
            if alone and upper.sum() + lower.sum() <= thickest:
                lower += upper
                upper[:] = 0.0
    return pack_coats(sizes)


def _first_lab(
    model: StackModel, sizes: Float[np.ndarray, "n coats paints"]
) -> Float[np.ndarray, "n 3"]:
    return np.asarray(lab_of(model, readings(model, sizes, None)))[:, 0]


def pack_coats(sizes: Float[np.ndarray, "n coats paints"]) -> Float[np.ndarray, "n coats paints"]:
    """Stacks with their empty coats last."""
    order = np.argsort(~sizes.any(axis=2), axis=1, kind="stable")
    return np.take_along_axis(sizes, order[:, :, None], axis=1)


def select(pool: Sequence[Scored], count: int, simplicity: float) -> list[Scored]:
    """The best few that differ in their paints or in the order of their coats.

    A recipe that takes a simpler one and adds to it without coming nearer is left out while there
    are others.
    """
    chosen: list[Scored] = []
    spare: list[Scored] = []
    seen = set()
    for one in sorted(pool, key=lambda one: one.effort(simplicity)):
        if one.signature in seen:
            continue
        seen.add(one.signature)
        embellished = any(
            other.paints <= one.paints
            and other.coats <= one.coats
            and one.score > other.score - simplicity
            for other in chosen
        )
        (spare if embellished else chosen).append(one)
        if len(chosen) == count:
            break
    return chosen + spare[: count - len(chosen)]


def roundings(
    sizes: Float[np.ndarray, "coats paints"], span: tuple[float, float]
) -> list[Float[np.ndarray, "c p"]]:
    """The stacks in round numbers next to a stack: every share and thickness up or down.

    Args:
        sizes: (coats, paints), um.
        span: thinnest and thickest coat, um.
    """
    thickness = sizes.sum(axis=1)
    per_coat = [
        list(_round_coats(coat, total, span)) for coat, total in zip(sizes, thickness, strict=True)
    ]
    return [np.stack(choice) for choice in itertools.product(*per_coat)]


def _round_coats(
    coat: Float[np.ndarray, "paints"], total: float, span: tuple[float, float]
) -> Iterator[np.ndarray]:
    if total == 0:
        yield coat
        return
    low = np.floor(total / THICKNESS_STEP)
    high = np.ceil(total / THICKNESS_STEP)
    slack = 1e-9
    round_sizes = {
        n * THICKNESS_STEP
        for n in (low, high)
        if span[0] - slack <= n * THICKNESS_STEP <= span[1] + slack
    }
    present = np.flatnonzero(coat > 0)
    main = present[np.argmax(coat[present])]
    others = [paint for paint in present if paint != main]
    for size in sorted(round_sizes) or [total]:
        ends = [
            (np.floor(coat[p] / total / SHARE_STEP), np.ceil(coat[p] / total / SHARE_STEP))
            for p in others
        ]
        for choice in itertools.product(*(sorted(set(pair)) for pair in ends)):
            shares = np.zeros_like(coat)
            shares[others] = np.array(choice) * SHARE_STEP
            shares[main] = 1.0 - shares.sum()
            yield shares * size


def round_recipes(
    model: StackModel,
    solver: StackSolver,
    aims: TargetArrays,
    chosen: Sequence[tuple[int, Scored]],
    simplicity: float,
) -> list[Scored]:
    """Each recipe, given with its target, in the round numbers that come nearest.

    The solver reads a few of them: those that come nearest when a rounding changes a reading as it
    does by the table.
    """
    low, high = np.exp(np.asarray(model.span)).tolist()
    options = [roundings(one.sizes, (low, high)) for _, one in chosen]
    owner = np.repeat(np.arange(len(chosen)), [len(tries) for tries in options])
    targets = np.array([target for target, _ in chosen])[owner]
    flat = Stacks.before_refinement(
        pack_coats(np.stack([sizes for tries in options for sizes in tries])),
        targets,
        np.zeros(len(targets)),
    )
    own = np.stack([one.reading for _, one in chosen]) - readings(
        model, np.stack([o.sizes for _, o in chosen]), None
    )
    guess = _score(model, aims, flat, readings(model, flat.sizes, None) + own[owner])
    # Round numbers of a recipe that the solver reads.
    nearest = [
        sorted(
            np.flatnonzero(owner == number).tolist(), key=lambda row: guess[row].effort(simplicity)
        )[:4]
        for number in range(len(chosen))
    ]
    results = iter(
        score(
            model, solver, aims, flat.take(np.array([row for rows in nearest for row in rows], int))
        )
    )
    return [
        min((next(results) for _ in rows), key=lambda one: one.effort(simplicity))
        for rows in nearest
    ]
