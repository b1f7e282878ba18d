"""The last steps of a recipe: Levenberg-Marquardt along the solver's own readings and slopes, many
stacks side by side.

Nothing is interpolated here. Readings come from the public solver at `recipe.model.TOLERANCE`,
slopes from its derivatives by jax, and the cost is the one that recipes are chosen by: mean squared
Delta E 2000 under the lights, and the penalty for another spectrum. A coat's thickness keeps to its
bounds by projection, so that a coat as thick as allowed is at rest there. A stack is settled when a
full step promises less than `PROMISE`: a paint that fades away changes nothing any more and keeps
no solve from its end.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from glazejax.colour import delta_e_2000

from ..film.colour_metric import lab_metric
from ..film.numerics.least_squares import Bounds, Looks, descend_within
from .model import Slots, StackModel, StackSolver, empty_slots, fill_slots, solve
from .screen import Stacks, TargetArrays

PROMISE = 1e-3
"""Settled: a full step would bring a stack nearer by less than this Delta E."""

_STEPS = 40
# Least share, as a logarithm; step of a difference quotient in L*a*b*.
_FADED = -9.0
_LAB_STEP = 0.01


class _SlotArrays(NamedTuple):
    """`recipe.model.Slots` for numpy."""

    paint: Int[np.ndarray, "n slots"]
    coat: Int[np.ndarray, "n slots"]
    used: Bool[np.ndarray, "n slots"]


class _Filled(NamedTuple):
    """Stacks as variables: which paint lies where, and targets."""

    slots: _SlotArrays
    member: Float[np.ndarray, "n coats slots"]  # 1 where a slot lies in a coat
    lab: Float[np.ndarray, "n lights 3"]
    spectrum: Float[np.ndarray, "n bands"]
    spectral: Float[np.ndarray, "n"]

    def take(self, rows: np.ndarray) -> "_Filled":
        return _Filled(
            _SlotArrays(*(values[rows] for values in self.slots)),
            *(values[rows] for values in self[1:]),
        )


def polish(model: StackModel, solver: StackSolver, aims: TargetArrays, stacks: Stacks) -> Stacks:
    """Stacks at the best amounts of their paints, as the solver itself sees them.

    Args:
        model, aims: paints and targets.
        solver: with slots for all paints of a stack.
        stacks: where to start.

    Returns:
        The stacks, none farther from its target than before, with `cost`, `steps`, `settled` and
        `before`.
    """
    if stacks.size == 0:
        return stacks
    place, point = _start(model, aims, stacks, solver.slots)
    coats = stacks.sizes.shape[1]
    low = np.full(point.shape[1], _FADED)
    high = np.zeros(point.shape[1])
    low[:coats], high[:coats] = np.asarray(model.span)

    def look(rows: np.ndarray, points: np.ndarray) -> Looks:
        return _look(model, solver, place.take(rows), points)[0]

    def normalise(rows: np.ndarray, points: np.ndarray) -> np.ndarray:
        shares = _shares(place.take(rows), points[:, coats:])
        return np.concatenate([points[:, :coats], shares], axis=1)

    seen, before = _look(model, solver, place, point)
    found = descend_within(
        look,
        point,
        seen,
        Bounds(low, high, longest=1.0),
        normalise=normalise,
        promise=PROMISE,
        max_steps=_STEPS,
    )
    sizes = empty_slots(
        Slots(*place.slots),
        place.member * _amounts(place, found.point)[0][:, None],
        stacks.sizes.shape[2],
    )
    good = np.isfinite(found.cost)
    return Stacks(
        sizes=np.where(good[:, None, None], sizes, stacks.sizes),
        target=stacks.target,
        cost=np.where(good, found.cost, stacks.cost),
        settled=found.settled,
        steps=found.steps,
        before=before,
    )


def _start(
    model: StackModel, aims: TargetArrays, stacks: Stacks, count: int
) -> tuple[_Filled, np.ndarray]:
    """Variables of stacks: logarithms of the coats' thicknesses, then those of the slots'
    shares.
    """
    places, _ = fill_slots(model, stacks.sizes, count)
    slots = _SlotArrays(*(np.asarray(values) for values in places))
    member = (
        slots.used[:, None] & (slots.coat[:, None] == np.arange(stacks.sizes.shape[1])[:, None])
    ).astype(float)
    amount = stacks.sizes[np.arange(stacks.size)[:, None], slots.coat, slots.paint]
    total = stacks.sizes.sum(axis=2)
    own = np.take_along_axis(total, slots.coat, axis=1)
    shares = np.where(
        slots.used, np.log(np.where(slots.used, amount / np.where(own > 0, own, 1.0), 1.0)), 0.0
    )
    logs = np.where(
        total > 0, np.clip(np.log(np.where(total > 0, total, 1.0)), *np.asarray(model.span)), 0.0
    )
    at = stacks.target
    aim = (np.asarray(values)[at] for values in (aims.lab, aims.spectrum, aims.spectral))
    return _Filled(slots, member, *aim), np.concatenate([logs, np.maximum(shares, _FADED)], axis=1)


def _amounts(place: _Filled, point: Float[np.ndarray, "n m"]) -> tuple[np.ndarray, np.ndarray]:
    """What each slot takes, um, and its share of its coat, (n, slots)."""
    coats = place.member.shape[1]
    share = np.where(place.slots.used, np.exp(_shares(place, point[:, coats:])), 0.0)
    return share * np.exp(np.take_along_axis(point[:, :coats], place.slots.coat, axis=1)), share


def _shares(place: _Filled, free: Float[np.ndarray, "n slots"]) -> Float[np.ndarray, "n slots"]:
    """Logarithms of shares that add up to one in each coat."""
    whole = np.einsum("ncs,ns->nc", place.member, np.exp(free))
    own = np.where(place.slots.used, np.take_along_axis(whole, place.slots.coat, axis=1), 1.0)
    return np.where(place.slots.used, free - np.log(own), 0.0)


def _look(
    model: StackModel, solver: StackSolver, place: _Filled, point: Float[np.ndarray, "n m"]
) -> tuple[Looks, Float[np.ndarray, "n"]]:
    """Cost and slopes by the solver, and the largest Delta E under the lights."""
    amount, share = _amounts(place, point)
    reading, by_amount, lab, lab_by_reading = solve(
        model, solver, Slots(*place.slots), amount, place.member.shape[1]
    )
    colours, moves = colour_misfit(lab, place.lab)
    lights = lab.shape[1]
    miss = reading - place.spectrum
    weight = np.sqrt(place.spectral)[:, None]
    residual = np.concatenate(
        [colours.reshape(len(point), -1) / np.sqrt(lights), weight * miss], axis=1
    )
    by_log = by_amount * amount[:, :, None]  # (n, slots, bands)
    by_coat = place.member @ by_log
    own = (
        np.take_along_axis(by_coat, place.slots.coat[:, :, None], axis=1)
        * place.slots.used[:, :, None]
    )
    by_point = np.concatenate([by_coat, by_log - share[:, :, None] * own], axis=1)  # (n, m, bands)
    in_colour = (moves @ lab_by_reading).reshape(len(point), 3 * lights, -1) @ np.swapaxes(
        by_point, 1, 2
    )
    slopes = np.concatenate(
        [in_colour / np.sqrt(lights), weight[:, :, None] * np.swapaxes(by_point, 1, 2)], axis=1
    )  # (n, residuals, m)
    flipped = np.swapaxes(slopes, 1, 2)
    cost = np.sum(residual**2, axis=1)
    good = np.isfinite(cost) & np.isfinite(slopes).all(axis=(1, 2))
    delta_e = np.linalg.norm(colours, axis=-1).max(axis=1)
    looks = Looks(
        cost=np.where(good, cost, np.inf),
        slope=(flipped @ residual[..., None])[..., 0],
        curvature=flipped @ slopes,
    )
    return looks, delta_e


def colour_misfit(
    lab: Float[np.ndarray, "*batch 3"], aim: Float[np.ndarray, "*batch 3"]
) -> tuple[Float[np.ndarray, "*batch 3"], Float[np.ndarray, "*batch 3 3"]]:
    """Vectors as long as the CIEDE2000 differences of colours from their aims, and their slopes by
    the colours.

    The vector points as the metric half-way between both has it, where the formula takes its
    weights.
    """
    moves = _LAB_STEP * np.concatenate([np.zeros((1, 3)), np.eye(3), -np.eye(3)])
    near = lab + moves.reshape(7, *(1,) * (lab.ndim - 1), 3)
    metric = lab_metric((near + aim) / 2)
    vector = np.einsum("...ij,...j->...i", metric, near - aim)
    length = np.linalg.norm(vector, axis=-1)
    far = length > 1e-4
    vector = (
        vector
        * np.where(far, delta_e_2000(near, aim + 0.0 * near) / np.where(far, length, 1.0), 1.0)[
            ..., None
        ]
    )
    slopes = (vector[1:4] - vector[4:]) / (2.0 * _LAB_STEP)
    return vector[0], np.moveaxis(slopes, 0, -1)
