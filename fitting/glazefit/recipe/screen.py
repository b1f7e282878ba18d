"""First look at all sets of paints: which of them come near a target at all, and from where to
refine them.

One coat of up to three paints, and two coats with up to three paints between them, are gone through
in full, on a coarse grid of proportions and thicknesses. A coat is three numbers a band
(`FilmResponse.numbers`), so that a stack of two is a few multiplications; the lower coat counts as
the Lambertian ground that would read the same when bare.
"""

import itertools
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from glazejax.programs import Program
from glazejax.radiative.common.threads import in_threads

from ..film.numerics.blocks import by_blocks
from .model import StackModel, internal, lab_of
from .sobol import scrambled_sobol

MOST_SCREENED = 3
"""Most paints in a recipe that is found here; more are added to these
(`glazefit.recipe.refine.grown`).
"""

# Range of the logarithm of a paint's share over another's, when both are weighted by their
# strength.
_RANGE = 4.5
_POINTS = {1: (1, 8), 2: (7, 4), 3: (20, 4)}  # proportions and thicknesses, by the number of paints
# Points that are looked at together where two coats are, a divisor of those of a set; and pieces of
# so many points, above and below, always as many.
_TOGETHER = 4
_PIECES = 40


class TargetArrays(NamedTuple):
    """Targets as arrays."""

    lab: Float[Array | np.ndarray, "targets lights 3"]
    metric: Float[
        Array | np.ndarray, "targets lights 3 3"
    ]  # metric @ (Lab - lab) is as long as the colour difference
    spectrum: Float[Array | np.ndarray, "targets bands"]
    spectral: Float[
        Array | np.ndarray, "targets"
    ]  # weight of a difference in reflectance, summed squares over the bands


Keep = Callable[[int, int], int]
"""How many to keep, from the number of coats and of paints."""


class Stacks(NamedTuple):
    """What may become a recipe, (n,)."""

    sizes: Float[np.ndarray, "n coats paints"]  # what each paint takes of each coat's thickness, um
    target: Int[np.ndarray, "n"]
    cost: Float[np.ndarray, "n"]  # squared distance
    settled: Bool[
        np.ndarray, "n"
    ]  # whether the last least squares came to an end; False before the first
    steps: Int[np.ndarray, "n"]  # of the solver's own least squares
    before: Float[
        np.ndarray, "n"
    ]  # largest Delta E 2000 by the solver before these steps; NaN without them

    @classmethod
    def before_refinement(cls, sizes: np.ndarray, target: np.ndarray, cost: np.ndarray) -> "Stacks":
        """Stacks that no least squares has seen."""
        none = len(target)
        return cls(
            sizes=sizes,
            target=target,
            cost=cost,
            settled=np.zeros(none, bool),
            steps=np.zeros(none, int),
            before=np.full(none, np.nan),
        )

    @property
    def size(self) -> int:
        """How many there are."""
        return len(self.target)

    @property
    def coats(self) -> Int[np.ndarray, "n"]:
        """Number of coats that are there."""
        return (self.sizes.sum(axis=2) > 0).sum(axis=1)

    @property
    def paints(self) -> Int[np.ndarray, "n"]:
        """Number of different paints."""
        return (self.sizes.sum(axis=1) > 0).sum(axis=1)

    def take(self, rows: Int[np.ndarray, "m"]) -> "Stacks":
        """Some of them."""
        return Stacks(*(values[rows] for values in self))

    def best(self, keep: Keep) -> "Stacks":
        """The `keep(coats, paints)` of least cost for each target, by number of coats and
        paints.
        """
        kinds = np.stack([self.target, self.coats, self.paints], axis=1)
        order = np.lexsort((self.cost, *kinds.T[::-1]))
        chosen = []
        seen = 0
        last = None
        for row in order:
            kind = tuple(kinds[row].tolist())
            seen = seen + 1 if kind == last else 1
            last = kind
            if seen <= keep(*kind[1:]):
                chosen.append(row)
        return self.take(np.array(chosen, int))

    @staticmethod
    def join(parts: "Sequence[Stacks]") -> "Stacks":
        """All of several."""
        return Stacks(*(np.concatenate(values) for values in zip(*parts, strict=True)))


class _Coats(NamedTuple):
    """Coats of the same number of paints: sets of paints times points of a grid."""

    paints: Any  # Int (sets, paints), NumPy's or JAX's
    amounts: Any  # Float (sets, points, paints), um

    def take(self, rows: Int[np.ndarray, "m"]) -> "_Coats":
        return _Coats(self.paints[rows], self.amounts[rows])


def squared_distance(
    model: StackModel, aims: TargetArrays, reading: Float[Array, "*batch bands"]
) -> Float[Array, "*batch targets"]:
    """Squared distance of readings to every target: colour under all lights (mean), and
    spectrum.
    """
    miss = lab_of(model, reading)[..., None, :, :] - aims.lab
    moved = jnp.einsum("tlij,...tlj->...tli", aims.metric, miss)
    colour = jnp.sum(moved**2, axis=(-1, -2)) / aims.lab.shape[1]
    cross = jnp.tensordot(reading, aims.spectrum.T, axes=1)
    spectral = (
        jnp.sum(reading**2, axis=-1)[..., None] - 2.0 * cross + jnp.sum(aims.spectrum**2, axis=-1)
    )
    return colour + aims.spectral * jnp.maximum(spectral, 0.0)


def screen(
    model: StackModel,
    aims: TargetArrays,
    *,
    max_paints: int,
    max_coats: int,
    keep: Keep,
    seed: int,
    mixed: bool = True,
) -> Stacks:
    """The best sets of paints for each target, each at its best point of the grid.

    Args:
        model, aims: paints and targets.
        max_paints, max_coats: limits; what goes beyond three paints or two layers is not looked at
            here.
        keep: how many sets a target keeps, from numbers of layers and of paints.
        seed: of the grid of three paints' proportions.
        mixed: whether a coat may hold more than one paint.
    """
    count = min(max_paints, MOST_SCREENED, model.absorption.shape[0]) if mixed else 1
    coats = {n: _coats(model, n, seed) for n in range(1, count + 1)}
    found = []
    for batch, (cost, best) in zip(
        coats.values(), _of_one_coat(model, aims, list(coats.values())), strict=True
    ):
        found.append(_one_coat_stacks(model, batch, cost, best, keep, max_coats))
    for n, m in itertools.product(coats, repeat=2) if max_coats >= 2 else ():
        # The wide grid of three paints in a coat is for single coats.
        if n + m > MOST_SCREENED:
            continue
        top, bottom = coats[n], coats[m]
        cost, best = _of_two_coats(model, aims, top, bottom)
        cost[~_sensible(top.paints, bottom.paints, max_paints)] = np.inf
        found.append(_two_coat_stacks(model, (top, bottom), cost, best, keep, max_coats))
    return Stacks.join(found).best(keep)


def _join(kinds: Sequence[_Coats]) -> _Coats:
    """Coats of different numbers of paints, one below the other: filled up by none of a paint and
    by first points.
    """
    points, width = (max(coats.amounts.shape[axis] for coats in kinds) for axis in (1, 2))
    amounts = []
    for coats in kinds:
        wide = np.pad(coats.amounts, ((0, 0), (0, 0), (0, width - coats.amounts.shape[2])))
        again = np.zeros(points - wide.shape[1], int)
        amounts.append(np.concatenate([wide, wide[:, again]], axis=1))
    paints = [np.pad(coats.paints, ((0, 0), (0, width - coats.paints.shape[1]))) for coats in kinds]
    return _Coats(np.concatenate(paints), np.concatenate(amounts))


def _of_one_coat(
    model: StackModel, aims: TargetArrays, kinds: Sequence[_Coats]
) -> list[tuple[Float[np.ndarray, "sets targets"], Int[np.ndarray, "sets targets"]]]:
    """Least cost of each set of each kind, and the point where it is, by one program."""
    everything = _join(kinds)
    # So many sets are looked at in one call, always as many.
    cost, best = by_blocks(
        len(everything.paints), 192, lambda rows: _one_coat(model, aims, everything.take(rows))
    )
    ends = np.cumsum([len(coats.paints) for coats in kinds])[:-1]
    return list(zip(np.split(cost, ends), np.split(best, ends), strict=True))


def _of_two_coats(
    model: StackModel, aims: TargetArrays, top: _Coats, bottom: _Coats
) -> tuple[
    Float[np.ndarray, "sets others targets"],
    Int[np.ndarray, "sets others targets"],
]:
    """Least cost of each set over each other set, and the point of both grids where it is.

    Sets are cut into pieces of a few points and looked at a square of pieces at a time, so that one
    program serves sets of one paint and of two, over either.
    """
    above = _cut(top)
    below = _cut(bottom)
    cost = np.empty((len(above.paints), len(below.paints), len(aims.spectral)))
    point = np.empty(cost.shape, int)

    def look(corner: tuple[int, int]) -> None:
        rows, columns = (
            np.arange(first, first + _PIECES).clip(max=len(pieces.paints) - 1)
            for first, pieces in zip(corner, (above, below), strict=True)
        )
        found = _two_coats(model, aims, above.take(rows), below.take(columns))
        # Where a square reaches beyond the last piece, that one is written again.
        cost[np.ix_(rows, columns)], point[np.ix_(rows, columns)] = found

    rows = range(0, len(above.paints), _PIECES)
    in_threads(look, list(itertools.product(rows, range(0, len(below.paints), _PIECES))))
    # From a point of two pieces to one of both grids.
    pieces = len(above.paints) // len(top.paints), len(below.paints) // len(bottom.paints)
    of_top, of_bottom = np.divmod(point, _TOGETHER)
    of_top += _TOGETHER * (np.arange(len(above.paints)) % pieces[0])[:, None, None]
    of_bottom += _TOGETHER * (np.arange(len(below.paints)) % pieces[1])[:, None]
    point = of_top * bottom.amounts.shape[1] + of_bottom
    # Of each two sets the best of their pieces.
    both = len(top.paints), pieces[0], len(bottom.paints), pieces[1], len(aims.spectral)
    cost, point = (
        values.reshape(both).swapaxes(1, 2).reshape(both[0], both[2], -1, both[4])
        for values in (cost, point)
    )
    best = np.argmin(cost, axis=2)[:, :, None]
    cost, point = (np.take_along_axis(v, best, axis=2)[:, :, 0] for v in (cost, point))
    return cost, point


def _cut(coats: _Coats) -> _Coats:
    """Sets with a few points each, of the same set below each other, filled up to two paints by
    none of the first.
    """
    count, points, width = coats.amounts.shape
    amounts = coats.amounts.reshape(count * points // _TOGETHER, _TOGETHER, width)
    paints = np.repeat(coats.paints, points // _TOGETHER, axis=0)
    room = ((0, 0), (0, 2 - width))
    return _Coats(np.pad(paints, room), np.pad(amounts, ((0, 0), *room)))


def strength(model: StackModel) -> Float[np.ndarray, "paints"]:
    """How much a little of each paint shows, 1/um: by its absorption, or by its scattering where it
    is pale.
    """
    return np.mean(np.asarray(model.absorption) + 0.1 * np.asarray(model.scattering), axis=1) + 1e-9


def _coats(model: StackModel, n: int, seed: int) -> _Coats:
    paints = np.array(list(itertools.combinations(range(model.absorption.shape[0]), n)))
    proportions, depths = _POINTS[n]
    if n == 1:
        logs = np.zeros((1, 1))
    elif n == 2:
        logs = np.linspace(-_RANGE, _RANGE, proportions)[:, None] * [0.5, -0.5]
    else:
        # Sobol points in the plane of the two ratios; a power of two is what they are made for.
        points = scrambled_sobol(5, seed)[:proportions]
        logs = np.concatenate([2.0 * _RANGE * (points - 0.5), np.zeros((proportions, 1))], axis=1)
    shares = np.exp(logs) / strength(model)[paints][:, None, :]
    shares /= shares.sum(axis=-1, keepdims=True)
    low, high = np.asarray(model.span)
    thickness = np.exp(np.linspace(low, high, depths))
    amounts = shares[:, :, None, :] * thickness[:, None]
    return _Coats(paints, amounts.reshape(len(paints), -1, n))


def _optical(
    model: StackModel, coats: _Coats
) -> tuple[Float[Array, "... bands"], Float[Array, "... bands"]]:
    """k d and s d of coats."""
    amounts = jnp.asarray(coats.amounts)
    return amounts @ model.absorption[coats.paints], amounts @ model.scattering[coats.paints]


@Program
def _one_coat(
    model: StackModel, aims: TargetArrays, coats: _Coats
) -> tuple[Float[Array, "sets targets"], Int[Array, "sets targets"]]:
    """Least cost of each set, and the point where it is."""

    def of_one(coat: _Coats) -> tuple[Array, Array]:
        cost = squared_distance(
            model, aims, model.film.body(*_optical(model, coat), model.ground) + model.surface
        )
        return cost.min(axis=0), cost.argmin(axis=0)

    # A remainder would be compiled as a second program.
    return jax.lax.map(of_one, coats, batch_size=8)


@Program
def _two_coats(
    model: StackModel, aims: TargetArrays, top: _Coats, bottom: _Coats
) -> tuple[Float[Array, "sets others targets"], Int[Array, "sets others targets"]]:
    """Least cost of each piece over each other piece, and the point of both where it is."""
    below = internal(model, model.film.body(*_optical(model, bottom), model.ground))
    ground = jnp.swapaxes(below, 0, 1)  # (points, others, bands)

    def of_one(coat: _Coats) -> tuple[Array, Array]:
        black, gain, back = (
            values[:, None, None, :] for values in model.film.numbers(*_optical(model, coat))
        )
        reading = black + gain * ground / (1.0 - back * ground) + model.surface
        cost = squared_distance(
            model, aims, reading
        )  # (points, points of the lower, others, targets)
        cost = cost.reshape(-1, *cost.shape[2:])
        return cost.min(axis=0), cost.argmin(axis=0)

    return jax.lax.map(of_one, top)


def _sensible(top: np.ndarray, bottom: np.ndarray, max_paints: int) -> np.ndarray:
    """Which sets may lie over which: not the same paint over itself, and no more paints than
    allowed.
    """
    upper, lower = ([set(paints) for paints in sets.tolist()] for sets in (top, bottom))
    return np.array([[a != b and len(a | b) <= max_paints for b in lower] for a in upper])


def _one_coat_stacks(
    model: StackModel,
    coats: _Coats,
    cost: np.ndarray,
    best: np.ndarray,
    keep: Keep,
    max_coats: int,
) -> Stacks:
    rows, targets = _lowest(cost, keep(1, coats.paints.shape[1]))
    sizes = np.zeros((rows.size, max_coats, model.absorption.shape[0]))
    _lay(sizes, 0, coats, rows, best[rows, targets])
    return Stacks.before_refinement(sizes, targets, cost[rows, targets])


def _two_coat_stacks(
    model: StackModel,
    coats: tuple[_Coats, _Coats],
    cost: Float[np.ndarray, "sets others targets"],
    best: Int[np.ndarray, "sets others targets"],
    keep: Keep,
    max_coats: int,
) -> Stacks:
    top, bottom = coats
    points = bottom.amounts.shape[1]
    many = len(bottom.paints)
    flat = cost.reshape(-1, cost.shape[-1])
    rows, targets = _lowest(flat, keep(2, top.paints.shape[1] + bottom.paints.shape[1]))
    upper, lower = np.divmod(rows, many)
    first, second = np.divmod(best[upper, lower, targets], points)
    sizes = np.zeros((rows.size, max_coats, model.absorption.shape[0]))
    _lay(sizes, 0, top, upper, first)
    _lay(sizes, 1, bottom, lower, second)
    return Stacks.before_refinement(sizes, targets, flat[rows, targets])


def _lowest(cost: Float[np.ndarray, "sets targets"], count: int) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns of the lowest `count` costs of each target, where they are finite."""
    rows = np.argsort(cost, axis=0)[:count]
    columns = np.broadcast_to(np.arange(cost.shape[1]), rows.shape)
    good = np.isfinite(cost[rows, columns])
    return rows[good], columns[good]


def _lay(sizes: np.ndarray, coat: int, coats: _Coats, rows: np.ndarray, points: np.ndarray) -> None:
    """Write coats, by set and point of the grid, into an array of stacks."""
    at = np.arange(len(sizes))[:, None]
    sizes[at, coat, coats.paints[rows]] = coats.amounts[rows, points]
