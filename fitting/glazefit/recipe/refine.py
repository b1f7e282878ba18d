"""From rough amounts of some paints to the nearest that they can come: Levenberg-Marquardt, many
stacks side by side.

The steps follow the readings' own slopes: those of the table, to choose among very many stacks, and
at last those of the solver, where nothing is interpolated. The cost is the one that recipes are
chosen by: mean squared Delta E 2000 under the lights, and the penalty for another spectrum. A
coat's thickness keeps to its bounds by projection, so that a coat as thick as allowed is at rest
there. A stack is settled when a full step promises less than a thousandth of a Delta E: a paint
that fades away changes nothing any more and keeps no solve from its end.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from ..film.model.optics import Optics
from ..film.numerics.least_squares import Bounds, Looks, descend_within
from .model import read
from .stacks import Stacks
from .task import RecipeTask


class Amounts(NamedTuple):
    """Amounts above 0 of many stacks, and as many places as most of them have."""

    target: Int[np.ndarray, "n"]
    coat: Int[np.ndarray, "n places"]
    paint: Int[np.ndarray, "n places"]
    member: Bool[np.ndarray, "n coats places"]  # which are there, and in which coat

    def take(self, rows: Int[np.ndarray, "m"]) -> "Amounts":
        """Those of some stacks."""
        return Amounts(*(values[rows] for values in self))

    def shares(
        self, point: Float[np.ndarray, "n unknowns"]
    ) -> tuple[Float[np.ndarray, "n places"], Float[np.ndarray, "n places"]]:
        """Share that each place takes of its coat, and its size in um."""
        coats = self.member.shape[1]
        weight = self.member.any(axis=1) * np.exp(point[:, coats:])
        coat_total = np.take_along_axis(
            (self.member @ weight[..., None])[..., 0], self.coat, axis=1
        )
        share = weight / np.where(coat_total > 0, coat_total, 1.0)
        return share, share * np.exp(np.take_along_axis(point[:, :coats], self.coat, axis=1))

    def sizes(
        self, point: Float[np.ndarray, "n unknowns"], paints: int
    ) -> Float[np.ndarray, "n coats paints"]:
        """The stacks at a point, um."""
        sizes = np.zeros((*self.member.shape[:2], paints))
        sizes[np.arange(len(sizes))[:, None], self.coat, self.paint] = self.shares(point)[1]
        return sizes


def refine(
    task: RecipeTask,
    stacks: Stacks,
    optics: Optics | None,
    max_steps: int = 40,
    *,
    hold: bool = False,
) -> Stacks:
    """Stacks at the best amounts of their paints, by the solver or without `optics` by the table.

    Args:
        task: with its paints and targets.
        stacks: where to start.
        optics: of the solver.
        max_steps: after these a stack keeps the best amounts so far.
        hold: whether coats keep their thicknesses.

    Returns:
        The stacks, none farther from its target than before, with `cost`, `steps`, `settled` and
        `before`. What did not come out as a number stays as it was.
    """
    if stacks.size == 0:
        return stacks
    amounts, point, bounds = start(task, stacks)
    first_look, before = look(task, amounts, point, optics, hold=hold)
    solution = descend_within(
        lambda rows, points: look(task, amounts.take(rows), points, optics, hold=hold)[0],
        point,
        first_look,
        bounds,
        promise=1e-3,
        max_steps=max_steps,
    )
    good = np.isfinite(solution.cost)
    sizes = amounts.sizes(solution.point, stacks.sizes.shape[2])
    return Stacks(
        sizes=np.where(good[:, None, None], sizes, stacks.sizes),
        target=stacks.target,
        cost=np.where(good, solution.cost, stacks.cost),
        settled=solution.settled & good,
        steps=solution.steps,
        before=before,
    )


def start(task: RecipeTask, stacks: Stacks) -> tuple[Amounts, Float[np.ndarray, "n m"], Bounds]:
    """Indices of the amounts of stacks, and the unknowns with their bounds: logarithms of the
    coats' thicknesses, um, then those of the shares.
    """
    rows, coats, paints = stacks.sizes.shape
    flat = stacks.sizes.reshape(rows, -1)
    # Amounts above 0 first, in the order of coats and paints.
    order = np.argsort(flat <= 0, axis=1, kind="stable")[:, : (flat > 0).sum(axis=1).max()]
    coat, paint = np.divmod(order, paints)
    amount = np.take_along_axis(flat, order, axis=1)
    member = (amount > 0)[:, None] & (coat[:, None] == np.arange(coats)[:, None])
    total = stacks.sizes.sum(axis=2)
    share = amount / np.maximum(np.take_along_axis(total, coat, axis=1), 1e-12)
    # Less of a paint than this, as a logarithm, is none.
    faded = -9.0
    low = np.repeat([task.model.span[0], faded], [coats, order.shape[1]])
    high = np.repeat([task.model.span[1], 0.0], [coats, order.shape[1]])
    values = np.concatenate([total, share], axis=1)
    point = np.clip(np.log(np.maximum(values, 1e-12)), low, high)
    return Amounts(stacks.target, coat, paint, member), point, Bounds(low, high, longest=1.0)


def look(
    task: RecipeTask,
    amounts: Amounts,
    point: Float[np.ndarray, "n m"],
    optics: Optics | None,
    *,
    hold: bool = False,
) -> tuple[Looks, Float[np.ndarray, "n"]]:
    """Cost and its slopes at a point, and the largest Delta E under the lights."""
    model = task.model
    share, amount = amounts.shares(point)
    readings = read(model, amounts.sizes(point, len(model.absorption)), optics)
    # Slopes of the spectrum by the logarithms of the amounts, (n, places, bands).
    by_log = amount[..., None] * sum(
        np.take_along_axis(by_coat, amounts.coat[..., None], axis=1)
        * np.asarray(coefficients)[amounts.paint]
        for by_coat, coefficients in (
            (readings.by_absorption, model.absorption),
            (readings.by_scattering, model.scattering),
        )
    )
    by_coat = amounts.member @ by_log
    # A larger share of one paint is less of the others in its coat.
    coat_slopes = np.take_along_axis(by_coat, amounts.coat[..., None], axis=1)
    by_point = np.concatenate(
        [by_coat * (not hold), by_log - share[..., None] * coat_slopes], axis=1
    )
    residual, slopes, delta_e = task.target_arrays.residuals(amounts.target, readings, by_point)
    flipped = np.swapaxes(slopes, 1, 2)
    cost = np.sum(residual**2, axis=1)
    good = np.isfinite(cost) & np.isfinite(slopes).all(axis=(1, 2))
    looks = Looks(
        cost=np.where(good, cost, np.inf),
        slope=(flipped @ residual[..., None])[..., 0],
        curvature=flipped @ slopes,
    )
    return looks, delta_e.max(axis=1)
