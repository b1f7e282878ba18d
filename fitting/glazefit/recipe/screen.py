"""First look at all sets of paints: which of them come near a target at all, and from where to
refine them.

One coat of up to three paints, and two coats with up to three paints between them, are gone through
in full, on a coarse grid of proportions and thicknesses. A coat is three numbers a band
(`FilmResponse.numbers`), so that a stack of two is a few multiplications; the lower coat counts as
the Lambertian ground that would read the same when bare. One coat lies over one of no thickness.
"""

import functools
import itertools
from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, Shaped

from glazejax.programs import Program
from glazejax.progress import Progress, counted, no_progress
from glazejax.radiative.common.chunks import pieces_of
from glazejax.radiative.common.threads import in_threads

from ..film.model.response import over_ground
from ..film.numerics.columns import Columns, take_rows
from .model import Sizes, StackModel
from .targets import Indices, TargetArrays
from .task import RecipeTask

PerStack: TypeAlias = Float[np.ndarray, "n"]
MOST_SCREENED = 3
"""Most paints in a recipe that is found here; more are added to these
(`glazefit.recipe.refine.grown`).
"""


@dataclass(frozen=True)
class Stacks(Columns):
    """Stacks that may become recipes, (n,)."""

    sizes: Sizes  # what each paint takes of each coat's thickness, um
    target: Indices
    cost: PerStack  # squared distance: mean squared Delta E, and that of the spectrum
    distance: PerStack  # largest Delta E 2000 under the lights; NaN before `score`
    settled: Bool[np.ndarray, "n"]  # whether the last least squares came to an end
    steps: Indices  # of the last least squares
    before: PerStack  # largest Delta E 2000 before these steps; NaN without them
    unrounded: PerStack  # and before the stack was rounded

    @classmethod
    def before_refinement(cls, sizes: np.ndarray, target: np.ndarray, cost: np.ndarray) -> "Stacks":
        """Stacks that no least squares has seen."""
        unknown = np.full(len(target), np.nan)
        return cls(
            sizes=sizes,
            target=target,
            cost=cost,
            distance=unknown,
            settled=np.zeros(len(target), bool),
            steps=np.zeros(len(target), int),
            before=unknown,
            unrounded=unknown,
        )

    @property
    def size(self) -> int:
        """Number of stacks."""
        return len(self.target)

    @property
    def coats(self) -> Indices:
        """Number of coats that are there."""
        return self.sizes.any(axis=2).sum(axis=1)

    @property
    def paints(self) -> Indices:
        """Number of different paints."""
        return self.sizes.any(axis=1).sum(axis=1)

    @property
    def layouts(self) -> list[tuple[int, bytes]]:
        """Target and paints by coat, the same for stacks that differ in their amounts only."""
        inside = self.sizes > 0
        return [(int(t), coats.tobytes()) for t, coats in zip(self.target, inside, strict=True)]

    def best(self, count: int) -> "Stacks":
        """The `count` of least cost for each target, by number of coats and paints; of stacks with
        the same paints in the same coats only the best.
        """
        kinds = np.column_stack([self.target, self.coats, self.paints])
        alone = leaders(np.argsort(self.cost, kind="stable"), self.layouts, 1)
        return self.take(leaders(alone, [tuple(kind) for kind in kinds.tolist()], count))


def leaders(order: Iterable[int], groups: Sequence[Hashable], count: int) -> list[int]:
    """Rows of an order that are among the first `count` of their group."""
    ranks: Counter[Hashable] = Counter()
    chosen = []
    for row in order:
        ranks[groups[row]] += 1
        if ranks[groups[row]] <= count:
            chosen.append(row)
    return chosen


class Coats(NamedTuple):
    """Coats, each of one set of paints in one proportion."""

    paints: Any  # Int (coats, 3), filled up by paint 0, of which there is nothing then
    amounts: Any  # Float (coats, thicknesses, 3), um


def screen(
    task: RecipeTask, keep: tuple[int, ...] = (3, 24, 40), progress: Progress = no_progress
) -> Stacks:
    """The best sets of paints of a kind for each target, each at its best point of the grid; of a
    kind, which has so many coats and so many paints, `keep[paints - 1]` are kept.

    `progress` is called after each block of coats.
    """
    count = 1 if task.glazes else min(task.max_paints, MOST_SCREENED)
    coats = {n: coats_of(task, n) for n in range(1, count + 1)}
    nothing = Coats(np.zeros((1, 3), int), np.zeros((1, 1, 3)))
    pairs = [(coats[n], nothing, keep[n - 1]) for n in coats]
    for n, m in itertools.product(coats, repeat=2) if task.max_coats > 1 else ():
        # The wide grid of three paints in a coat is for single coats.
        if n + m <= MOST_SCREENED:
            pairs.append((coats[n], coats[m], keep[n + m - 1]))
    total = sum(len(_blocks(top, bottom)) for top, bottom, _ in pairs)
    note = counted(progress, total, "looking through all sets of paints")
    return Stacks.join([_nearest(task, *pair, note) for pair in pairs]).best(keep[-1])


def coats_of(task: RecipeTask, n: int) -> Coats:
    """Coats of every set of n paints, on the grid of proportions and thicknesses."""
    sets = np.array(list(itertools.combinations(range(len(task.pigments)), n)))
    # Range of the logarithm of a paint's share over another's, when both are weighted by their
    # strength.
    wide = 4.5
    thinnest, thickest = task.span
    thickness = np.geomspace(thinnest, thickest, 4 if n > 1 else 8).reshape(-1, 4)
    if n == 1:
        # A paint alone has more thicknesses: the thinner and the thicker half.
        logs = np.zeros((2, 1))
    elif n == 2:
        logs = np.linspace(-wide, wide, 7)[:, None] * [0.5, -0.5]
    else:
        # Points that fill the plane of the two ratios evenly: multiples of the powers of the root
        # of x^3 = x + 1, from a point of the seed's (M. Roberts 2018).
        ratios = np.random.default_rng(task.seed).random(2)
        ratios = (ratios + np.arange(20)[:, None] * 1.32471795724474602596 ** -np.arange(1, 3)) % 1
        logs = np.pad(2.0 * wide * (ratios - 0.5), ((0, 0), (0, 1)))
    shares = np.exp(logs) / task.model.strength[sets][:, None, :]
    shares /= shares.sum(axis=-1, keepdims=True)
    amounts = shares[:, :, None, :] * thickness[..., None]
    spare = MOST_SCREENED - n
    return Coats(
        np.pad(np.repeat(sets, len(logs), axis=0), ((0, 0), (0, spare))),
        np.pad(amounts.reshape(-1, 4, n), ((0, 0), (0, 0), (0, spare))),
    )


def _nearest(
    task: RecipeTask, top: Coats, bottom: Coats, keep: int, note: Callable[[], object]
) -> Stacks:
    """The best sets of some coats over others, for each target; `note` is called after each
    block.
    """
    count = len(task.model.absorption)
    # Least cost of each coat over each other coat, and the thicknesses of both where it is.
    cost = np.empty((len(top.paints), len(bottom.paints), len(task.targets)), np.float32)
    point = np.empty(cost.shape, np.int8)
    # Coats over nothing are looked at some at a time.
    together = 32 if len(bottom.paints) == 1 else 1

    def look(block: tuple[np.ndarray, np.ndarray]) -> None:
        rows, columns = block
        at = np.ix_(rows, columns)
        pair = take_rows(top, rows), take_rows(bottom, columns)
        cost[at], point[at] = _distances(task.model, task.target_arrays, *pair, together=together)
        note()

    in_threads(look, _blocks(top, bottom))
    upper, lower = (spread(coats.paints, coats.amounts[:, 0] > 0, count) for coats in (top, bottom))
    # Not the same paint over itself, and no more paints than allowed.
    sensible = ((upper[:, None] | lower).sum(axis=2) <= task.max_paints) & (
        upper[:, None] != lower
    ).any(axis=2)
    cost[~sensible] = np.inf
    # A number for each set of paints over another.
    digits = count ** np.arange(MOST_SCREENED)
    above = top.paints @ digits
    below = bottom.paints @ digits
    sets = (above[:, None] * count**MOST_SCREENED + below).ravel()
    flat = cost.reshape(-1, cost.shape[-1])
    stacks = []
    for target in range(flat.shape[1]):
        order = np.argsort(flat[:, target])
        order = order[np.isfinite(flat[order, target])]
        # Of every two sets the best of their proportions.
        once = order[np.sort(np.unique(sets[order], return_index=True)[1])[:keep]]
        rows, columns = np.divmod(once, len(lower))
        points = np.divmod(point[rows, columns, target], bottom.amounts.shape[1])
        sizes = np.zeros((len(once), task.max_coats, count))
        sizes[:, 0] = spread(top.paints[rows], top.amounts[rows, points[0]], count)
        if task.max_coats > 1:
            sizes[:, 1] = spread(bottom.paints[columns], bottom.amounts[columns, points[1]], count)
        numbers = np.full(len(once), target)
        stacks.append(Stacks.before_refinement(sizes, numbers, flat[once, target]))
    return Stacks.join(stacks)


def spread(
    paints: Int[np.ndarray, "n 3"], amounts: np.ndarray, count: int
) -> Shaped[np.ndarray, "n paints"]:
    """Amounts, (n, 3), as columns of all paints: sums, or of booleans whether any is true."""
    columns = np.zeros((len(paints), count), amounts.dtype)
    np.add.at(columns, (np.arange(len(paints))[:, None], paints), amounts)
    return columns


def _blocks(top: Coats, bottom: Coats) -> list[tuple[np.ndarray, np.ndarray]]:
    """Upper and lower coats that are looked at together: as many each time, so that one program
    serves all. The last blocks are filled up with coats that were there before.
    """

    def parts(coats: Coats, size: int) -> list[np.ndarray]:
        return [np.resize(rows, size) for rows in pieces_of(np.arange(len(coats.paints)), size)]

    height, width = (640, 1) if len(bottom.paints) == 1 else (40, 40)
    return list(itertools.product(parts(top, height), parts(bottom, width)))


@functools.partial(Program, fixed=("together",))
def _distances(
    model: StackModel, targets: TargetArrays, top: Coats, bottom: Coats, *, together: int
) -> tuple[Float[Array, "upper lower targets"], Int[Array, "upper lower targets"]]:
    def optical(coats: Coats) -> tuple[Array, Array]:
        amounts = jnp.asarray(coats.amounts)
        return amounts @ model.absorption[coats.paints], amounts @ model.scattering[coats.paints]

    below = model.internal(model.film.body(*optical(bottom), model.ground))
    ground = jnp.swapaxes(below, 0, 1)  # (thicknesses, lower, bands)

    def of_one(coat: Coats) -> tuple[Array, Array]:
        numbers = (values[:, None, None, :] for values in model.film.numbers(*optical(coat)))
        reading = over_ground(*numbers, ground=ground) + model.surface
        # (thicknesses, those of the lower, lower, targets)
        cost = _small_distances(model, targets, reading)
        cost = cost.reshape(-1, *cost.shape[2:])
        return cost.min(axis=0), cost.argmin(axis=0)

    return jax.lax.map(of_one, top, batch_size=together)


def _small_distances(
    model: StackModel, targets: TargetArrays, reading: Float[Array, "*batch bands"]
) -> Float[Array, "*batch targets"]:
    """Cost of readings for every target, by the colour difference of small steps."""
    miss = model.lab(reading)[..., None, :, :] - targets.lab
    differences = jnp.einsum("tlij,...tlj->...tli", targets.metric, miss)
    colour = jnp.sum(differences**2, axis=(-1, -2)) / targets.lab.shape[1]
    cross = jnp.tensordot(reading, targets.spectrum.T, axes=1)
    spectral = (
        jnp.sum(reading**2, axis=-1)[..., None]
        - 2.0 * cross
        + jnp.sum(targets.spectrum**2, axis=-1)
    )
    return colour + targets.spectral * jnp.maximum(spectral, 0.0)
