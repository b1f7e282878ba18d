"""From rough amounts of some paints to the nearest that they can come: Levenberg-Marquardt, many
stacks side by side.

The steps follow the readings' own slopes: those of the table, to choose among very many stacks, and
at last those of the solver, where nothing is interpolated. The cost is the one that recipes are
chosen by: mean squared Delta E 2000 under the lights, and the penalty for another spectrum. A
coat's thickness keeps to its bounds by projection, so that a coat as thick as allowed is at rest
there. A stack is settled when a full step promises less than a thousandth of a Delta E: a paint
that fades away changes nothing any more and keeps no solve from its end.
"""

import itertools
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import NamedTuple, TypeAlias

import numpy as np
from jaxtyping import Bool, Float, Int

from glazejax.colour import delta_e_2000

from ..film.colour_metric import lab_metric
from ..film.model.optics import Optics
from ..film.numerics.columns import take_rows
from ..film.numerics.least_squares import Bounds, Looks, descend_within
from .model import OneStack, Sizes, read
from .screen import MOST_SCREENED, PerStack, Stacks
from .targets import Indices
from .task import RecipeTask

Points: TypeAlias = Float[np.ndarray, "n unknowns"]
"""Logarithms of the coats' thicknesses, um, then those of the shares."""
PerAmount: TypeAlias = Float[np.ndarray, "n places"]
"""A number for each amount above 0 of each stack."""
Labs: TypeAlias = Float[np.ndarray, "*batch 3"]
"""L*, a*, b* of colours."""


class Amounts(NamedTuple):
    """Amounts above 0 of many stacks, and as many places as most of them have."""

    target: Indices
    place: Int[np.ndarray, "n places"]  # in the stack, of all coats' paints in one row
    member: Bool[np.ndarray, "n coats places"]  # which are there, and in which coat

    def shares(self, point: Points) -> tuple[PerAmount, PerAmount]:
        """Share that each place takes of its coat, and its size in um."""
        coats = self.member.shape[1]
        weight = self.member * np.exp(point[:, None, coats:])
        share = weight / np.maximum(weight.sum(axis=2, keepdims=True), 1e-300)
        return share.sum(axis=1), (share * np.exp(point[:, :coats, None])).sum(axis=1)

    def stacks(self, amount: PerAmount, paints: int) -> Sizes:
        """The stacks of which each place has so much, um."""
        rows, coats, _ = self.member.shape
        sizes = np.zeros((rows, coats * paints))
        np.put_along_axis(sizes, self.place, amount, axis=1)
        return sizes.reshape(rows, coats, paints)


def refinements(task: RecipeTask) -> int:
    """Number of refinements of `improve`: twice at first and for each growth, twice at the end."""
    return 2 * _growths(task) + 4


def _growths(task: RecipeTask) -> int:
    """Paints and coats that are added, one at a time, to what a first look finds."""
    extra_paints = 0 if task.glazes else max(0, task.max_paints - MOST_SCREENED)
    return extra_paints + max(0, task.max_coats - 2)


def improve(task: RecipeTask, rough: Stacks, note: Callable[[], object]) -> Stacks:
    """The best stacks that come of a first look, at their best amounts by the solver; `note` is
    called after each refinement.
    """

    def refined(stacks: Stacks, optics: Optics | None = None, max_steps: int = 40) -> Stacks:
        better = refine(task, stacks, optics, max_steps)
        note()
        return better

    # A few steps show which are worth more.
    count = 8
    stacks = refined(refined(rough, max_steps=12).best(count))
    for number in range(_growths(task)):
        # Of unmixed stacks those of one coat less are the only ones to which a coat can be added.
        last = stacks.take(np.flatnonzero(stacks.coats == number + 2)) if task.glazes else stacks
        # A few grow, into very many: most of these are dropped before a refinement.
        children = refined(grown(task, last.best(4)).best(24), max_steps=12)
        stacks = Stacks.join([stacks, refined(children.best(count))])
    pool = Stacks.join([stacks, refined(simplify(task, stacks))])
    # What the table puts first, at the best amounts by the solver itself. Unmixed stacks are of
    # more kinds.
    solved = refined(pool.best(4 if task.glazes else count), task.optics)
    return read_and_score(task, solved, task.optics)


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
        `before`.
    """
    if stacks.size == 0:
        return stacks
    amounts, point, (low, high) = start(task, stacks)
    first_look, before = look(task, amounts, point, optics, hold=hold)
    solution = descend_within(
        lambda rows, points: look(task, take_rows(amounts, rows), points, optics, hold=hold)[0],
        point,
        first_look,
        Bounds(low=low, high=high, longest=1.0),
        promise=1e-3,
        max_steps=max_steps,
    )
    return replace(
        stacks,
        sizes=amounts.stacks(amounts.shares(solution.point)[1], stacks.sizes.shape[2]),
        cost=solution.cost,
        settled=solution.settled,
        steps=solution.steps,
        before=before,
    )


def start(
    task: RecipeTask, stacks: Stacks
) -> tuple[Amounts, Points, Float[np.ndarray, "2 unknowns"]]:
    """Indices of the amounts of stacks, and the unknowns with their least and largest values:
    logarithms of the coats' thicknesses, um, then those of the shares.
    """
    rows, coats, paints = stacks.sizes.shape
    flat = stacks.sizes.reshape(rows, -1)
    # Amounts above 0 first, in the order of coats and paints.
    order = np.argsort(flat <= 0, axis=1, kind="stable")[:, : (flat > 0).sum(axis=1).max()]
    amount = np.take_along_axis(flat, order, axis=1)
    coat = order // paints
    member = (amount > 0)[:, None] & (coat[:, None] == np.arange(coats)[:, None])
    total = stacks.sizes.sum(axis=2)
    share = amount / np.maximum(np.take_along_axis(total, coat, axis=1), 1e-12)
    # Less of a paint than this, as a logarithm, is none.
    faded = -9.0
    ends = np.vstack([np.log(task.span), (faded, 0.0)])
    limits = np.repeat(ends, [coats, order.shape[1]], axis=0).T
    values = np.hstack([total, share])
    point = np.clip(np.log(np.maximum(values, 1e-12)), limits[0], limits[1])
    return Amounts(stacks.target, order, member), point, limits


def look(
    task: RecipeTask,
    amounts: Amounts,
    point: Points,
    optics: Optics | None,
    *,
    hold: bool = False,
) -> tuple[Looks, PerStack]:
    """Cost and its slopes at a point, and the largest Delta E under the lights."""
    model = task.model
    goal = take_rows(task.target_arrays, amounts.target)
    share, amount = amounts.shares(point)
    paints = len(model.absorption)
    readings = read(model, amounts.stacks(amount, paints), optics)
    # Slopes of the spectrum by the logarithms of the amounts, (n, places, bands).
    paint = amounts.place % paints
    coat = np.swapaxes(amounts.member, 1, 2)
    by_log = amount[..., None] * (
        (coat @ readings.by_absorption) * model.absorption[paint]
        + (coat @ readings.by_scattering) * model.scattering[paint]
    )
    by_coat = amounts.member @ by_log
    # A larger share of one paint is less of the others in its coat.
    by_share = by_log - share[..., None] * (coat @ by_coat)
    by_point = np.concatenate([by_coat * (not hold), by_share], axis=1).swapaxes(1, 2)
    # Residuals whose squares add up to the cost: colours under all lights, then the spectrum.
    count, lights, _ = readings.lab.shape
    colours, moves = colour_misfit(readings.lab, goal.lab)
    by_lab = (moves @ readings.lab_by_spectrum).reshape(count, 3 * lights, -1) @ by_point
    weight = np.sqrt(goal.spectral)[:, None]
    miss = weight * (readings.spectrum - goal.spectrum)
    residual = np.hstack([colours.reshape(count, -1) / np.sqrt(lights), miss])
    slopes = np.concatenate([by_lab / np.sqrt(lights), weight[..., None] * by_point], axis=1)
    flipped = np.swapaxes(slopes, 1, 2)
    looks = Looks(
        cost=np.sum(residual**2, axis=1),
        slope=(flipped @ residual[..., None])[..., 0],
        curvature=flipped @ slopes,
    )
    return looks, np.linalg.norm(colours, axis=-1).max(axis=1)


def colour_misfit(lab: Labs, target: Labs) -> tuple[Labs, Float[np.ndarray, "*batch 3 3"]]:
    """Vectors as long as the CIEDE2000 differences of colours from their targets, and their slopes
    by the colours.

    The vector points as the metric half-way between both has it, where the formula takes its
    weights.
    """
    # Of a difference quotient.
    step = 0.01
    moves = step * np.concatenate([np.zeros((1, 3)), np.eye(3), -np.eye(3)])
    near = lab + moves.reshape(7, *(1,) * (lab.ndim - 1), 3)
    vector = np.einsum("...ij,...j->...i", lab_metric((near + target) / 2), near - target)
    length = np.linalg.norm(vector, axis=-1)
    far = length > 1e-4
    longer = delta_e_2000(near, target + 0.0 * near) / np.where(far, length, 1.0)
    vector = vector * np.where(far, longer, 1.0)[..., None]
    slopes = (vector[1:4] - vector[4:]) / (2.0 * step)
    return vector[0], np.moveaxis(slopes, 0, -1)


def read_and_score(task: RecipeTask, stacks: Stacks, optics: Optics | None) -> Stacks:
    """Stacks with their cost and distance, by the solver or without `optics` by the table."""
    readings = read(task.model, stacks.sizes, optics)
    return score(task, stacks, readings.spectrum, readings.lab)


def score(
    task: RecipeTask,
    stacks: Stacks,
    spectra: Float[np.ndarray, "n bands"],
    labs: Float[np.ndarray, "n lights 3"],
) -> Stacks:
    """Stacks with their cost and distance by what they read: the cost that `look` has, without
    slopes.
    """
    goal = take_rows(task.target_arrays, stacks.target)
    delta_e = delta_e_2000(labs, goal.lab)
    miss = np.sum((spectra - goal.spectrum) ** 2, axis=1)
    return replace(
        stacks,
        cost=np.mean(delta_e**2, axis=1) + goal.spectral * miss,
        distance=delta_e.max(axis=1),
    )


def pack_coats(sizes: Sizes) -> Sizes:
    """Stacks with their empty coats last."""
    order = np.argsort(~sizes.any(axis=2), axis=1, kind="stable")
    return np.take_along_axis(sizes, order[:, :, None], axis=1)


def merge_coats(sizes: Sizes, thickest: float) -> Sizes:
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


def simplify(task: RecipeTask, stacks: Stacks) -> Stacks:
    """Stacks without the paints that are hardly in them and the coats that hardly show: fewer, to
    be refined again.
    """
    share = stacks.sizes / np.maximum(stacks.sizes.sum(axis=2, keepdims=True), 1e-12)
    # A paint that is less than this of its coat is tried without.
    sizes = np.where(share < 0.01, 0.0, stacks.sizes)
    labs = read(task.model, sizes, None).lab[:, 0]
    for coat in range(sizes.shape[1]):
        without = sizes.copy()
        without[:, coat] = 0.0
        # A coat that changes the colour less than this is tried without.
        unseen = delta_e_2000(read(task.model, without, None).lab[:, 0], labs) < 0.1
        unseen &= without.any(axis=(1, 2)) & sizes[:, coat].any(axis=1)
        sizes[unseen] = without[unseen]
    changed = np.flatnonzero(((sizes > 0) != (stacks.sizes > 0)).any(axis=(1, 2)))
    simple = merge_coats(pack_coats(sizes[changed]), task.span[1])
    return Stacks.before_refinement(simple, stacks.target[changed], stacks.cost[changed])


def grown(task: RecipeTask, parents: Stacks) -> Stacks:
    """Every stack with one more paint in a coat, or one more coat on top or at the bottom (of
    glazes between two others, too), with its cost by the table.
    """
    children = [list(enlargements(task, stack)) for stack in parents.sizes]
    target = np.repeat(parents.target, [len(offspring) for offspring in children])
    if target.size == 0:
        return parents.take(target)
    sizes = np.stack(list(itertools.chain.from_iterable(children)))
    stacks = Stacks.before_refinement(sizes, target, np.zeros(len(target)))
    return read_and_score(task, stacks, None)


def enlargements(task: RecipeTask, stack: OneStack) -> Iterator[OneStack]:
    """Stacks with one paint or one coat more, within the limits of the search."""
    power = task.model.strength
    thinnest, thickest = task.span
    present = stack.sum(axis=0) > 0
    filled = np.count_nonzero(stack.any(axis=1))
    positions = range(filled + 1) if task.glazes else (0, filled)
    for paint in range(stack.shape[1]):
        if not present[paint] and np.count_nonzero(present) >= task.max_paints:
            continue
        for coat in () if task.glazes else range(filled):
            if stack[coat, paint] > 0:
                continue
            child = stack.copy()
            # An added paint gets this share of a coat's strength.
            child[coat, paint] = 0.15 * (stack[coat] @ power) / power[paint]
            child[coat] *= stack[coat].sum() / child[coat].sum()
            yield child
        # An added coat starts thin or half-way between thinnest and thickest.
        for fraction in (0.15, 0.5) if filled < task.max_coats else ():
            coat = np.zeros(stack.shape[1])
            coat[paint] = thinnest ** (1.0 - fraction) * thickest**fraction
            for at in positions:
                # The same paint twice in a row would be one thicker coat.
                near = stack[max(at - 1, 0) : at + 1]
                if not ((near > 0) == (coat > 0)).all(axis=1).any():
                    yield np.concatenate([stack[:at], coat[None], stack[at:-1]])
