"""From a rough stack to the nearest that the same paints can come: Levenberg-Marquardt, many stacks side by side.

A stack whose solve stops before it has settled keeps its amounts, and is marked so (`Stacks.settled`).

The table's model of a stack (`recipe.model.quick_reading`) is exact for one coat and differs a little from the solver
for several. For those, what it misses is added to it as a constant, and found anew after each pass: a few passes end
where the solver itself meets the target, and nothing but the table has to be differentiated.
"""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Bool, Float

from glazejax.colour import delta_e_2000

from ..film.least_squares import GramSchmidt
from ..film.optics import Optics
from .choose import packed
from .model import (
    Slots,
    StackModel,
    amounts,
    empty_slots,
    fill_slots,
    lab_of,
    quick_reading,
    readings,
)
from .screen import Stacks, TargetArrays, squared_distance, strength

# A weak pull to the start settles what the target leaves open.
_PULL = 0.01
_STEPS, _PASSES = 12, 3
# Stacks refined at a time, always as many, so that one program serves all.
_CHUNK = 128
# Share of a coat's strength that an added paint gets, and places between thinnest and thickest for an added coat.
_SHARE = 0.15
_PLACES = (0.15, 0.5)
_LM = optx.LevenbergMarquardt(rtol=1e-3, atol=1e-3, linear_solver=GramSchmidt())


def colour_metric(lab: Float[np.ndarray, "*batch 3"]) -> Float[np.ndarray, "*batch 3 3"]:
    """Matrix M such that ``M @ step`` is as long as the CIEDE2000 difference of a small step around a colour.

    The squared difference of six small steps, by colour-science, gives the quadratic form; M is its Cholesky factor.
    """
    size = 0.02
    unit = size * np.eye(3)
    lab = np.asarray(lab, float)

    def squared(move: Float[np.ndarray, "3"]) -> np.ndarray:
        # Symmetric around the colour: the formula takes its weights at the mean of both.
        return (delta_e_2000(lab - move / 2, lab + move / 2) / size) ** 2

    form = np.zeros((*lab.shape[:-1], 3, 3))
    for i in range(3):
        form[..., i, i] = squared(unit[i])
    for i, j in ((0, 1), (0, 2), (1, 2)):
        both = (squared(unit[i] + unit[j]) - form[..., i, i] - form[..., j, j]) / 2
        form[..., i, j] = form[..., j, i] = both
    return np.swapaxes(np.linalg.cholesky(form + 1e-9 * np.eye(3)), -1, -2)


def refine(model: StackModel, aims: TargetArrays, stacks: Stacks, slots: int) -> Stacks:
    """Stacks at their best amounts by the table, with their cost there.

    Args:
        model, aims: paints and targets.
        stacks: where to start.
        slots: at least as many as a stack has paints, counted in each coat.
    """
    missed = np.zeros((stacks.size, model.ground.size))
    return _refine(model, aims, stacks, slots, missed, np.asarray(aims.metric)[stacks.target])


def refine_solved(model: StackModel, optics: Optics, aims: TargetArrays, stacks: Stacks, slots: int) -> Stacks:
    """Stacks, refined by the table before, at their best amounts as the solver sees them."""
    aimed = np.asarray(aims.lab)[stacks.target]
    for _ in range(_PASSES):
        solved = readings(model, stacks.sizes, optics)
        missed = solved - readings(model, stacks.sizes, None)
        # CIEDE2000 takes its weights half-way between two colours: known by now, and for a target out of reach far
        # from its own.
        metric = colour_metric((np.asarray(lab_of(model, jnp.asarray(solved))) + aimed) / 2)
        stacks = _refine(model, aims, stacks, slots, missed, metric)
    return stacks


def _refine(
    model: StackModel,
    aims: TargetArrays,
    stacks: Stacks,
    slots: int,
    missed: Float[np.ndarray, "n bands"],
    metric: Float[np.ndarray, "n lights 3 3"],
) -> Stacks:
    """Stacks at their best amounts, where the reading is that of the table and what it missed."""
    if stacks.size == 0:
        return stacks
    places, starts = fill_slots(model, stacks.sizes, slots)
    done = []
    for first in range(0, stacks.size, _CHUNK):
        rows = np.arange(first, first + _CHUNK).clip(max=stacks.size - 1)
        some = Slots(*(values[rows] for values in places))
        # Each candidate carries its target, so that the program does not depend on how many there are.
        at = stacks.target[rows]
        aim = TargetArrays(aims.lab[at], jnp.asarray(metric[rows]), aims.spectrum[at], aims.spectral[at])
        start, offset = jnp.asarray(starts[rows]), jnp.asarray(missed[rows])
        solved = _solve(model, some, start, aim, offset, coats=stacks.sizes.shape[1])
        done.append([np.asarray(values)[: stacks.size - first] for values in solved])
    amount, cost, settled = (np.concatenate(values) for values in zip(*done, strict=True))
    sizes = empty_slots(places, amount, stacks.sizes.shape[2])
    # What did not come out as a number stays as it was before.
    good = np.isfinite(cost) & np.isfinite(sizes).all(axis=(1, 2))
    sizes, cost = np.where(good[:, None, None], sizes, stacks.sizes), np.where(good, cost, stacks.cost)
    return Stacks(sizes, stacks.target, cost, settled & good)


@functools.partial(jax.jit, static_argnames="coats")
def _solve(
    model: StackModel,
    slots: Slots,
    starts: Float[Array, "n slots"],
    aims: TargetArrays,
    missed: Float[Array, "n bands"],
    *,
    coats: int,
) -> tuple[Float[Array, "n coats slots"], Float[Array, "n"], Bool[Array, "n"]]:
    """Amounts in um, cost, and whether the solver settled, of candidates with an aim each."""
    lights = aims.lab.shape[1]

    def one(slots: Slots, start: Array, aim: TargetArrays, missed: Array) -> tuple[Array, Array, Array]:
        weight = jnp.sqrt(aim.spectral)
        absorption, scattering = model.absorption[slots.paint], model.scattering[slots.paint]

        def misfit(logs: Array) -> Array:
            share = amounts(model, slots, logs, coats)
            reading = quick_reading(model, share @ absorption, share @ scattering) + missed
            miss = jnp.einsum("lij,lj->li", aim.metric, lab_of(model, reading) - aim.lab)
            return jnp.concatenate([miss.ravel() / np.sqrt(lights), weight * (reading - aim.spectrum)])

        def residuals(logs: Array, _: None) -> Array:
            return jnp.concatenate([misfit(logs), _PULL * (logs - start)])

        solution = optx.least_squares(residuals, _LM, start, max_steps=_STEPS, throw=False)
        settled = solution.result == optx.RESULTS.successful
        return amounts(model, slots, solution.value, coats), jnp.sum(misfit(solution.value) ** 2), settled

    return jax.vmap(one)(slots, starts, aims, missed)


def grown(model: StackModel, aims: TargetArrays, parents: Stacks, *, max_paints: int, max_layers: int) -> Stacks:
    """Every stack with one more paint in a coat, or one more coat on top or at the bottom, and its cost by the table.

    Args:
        model, aims: paints and targets.
        parents: stacks to add to.
        max_paints, max_layers: limits.
    """
    sizes, owners = [], []
    for row, stack in enumerate(parents.sizes):
        for child in _children(model, stack, max_paints, max_layers):
            sizes.append(child)
            owners.append(parents.target[row])
    if not sizes:
        return parents.take(np.zeros(0, int))
    children = packed(np.stack(sizes))
    target = np.array(owners)
    to_all = squared_distance(model, aims, jnp.asarray(readings(model, children, None)))
    return Stacks.unrefined(children, target, np.asarray(to_all)[np.arange(len(target)), target])


def _children(model: StackModel, stack: Float[np.ndarray, "coats paints"], max_paints: int, max_layers: int) -> list:
    power = strength(model)
    low, high = np.asarray(model.span)
    inside = stack.sum(axis=0) > 0
    filled = int((stack.sum(axis=1) > 0).sum())
    children = []
    for paint in range(stack.shape[1]):
        if not inside[paint] and inside.sum() >= max_paints:
            continue
        for coat in range(filled):
            if stack[coat, paint] > 0:
                continue
            child, total = stack.copy(), stack[coat].sum()
            child[coat, paint] = _SHARE * (stack[coat] @ power) / power[paint]
            child[coat] *= total / child[coat].sum()
            children.append(child)
        if filled < max_layers:
            for place in _PLACES:
                coat = np.zeros(stack.shape[1])
                coat[paint] = np.exp(low + place * (high - low))
                upper = np.concatenate([coat[None], stack[:filled], stack[filled + 1 :]])
                lower = np.concatenate([stack[:filled], coat[None], stack[filled + 1 :]])
                # The same paint twice in a row would be one thicker coat.
                children += [
                    new
                    for new, other in ((upper, stack[0]), (lower, stack[filled - 1]))
                    if (other > 0).sum() > 1 or other[paint] == 0
                ]
    return children
