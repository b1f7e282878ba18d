"""From a rough stack to the nearest that the same paints can come: Levenberg-Marquardt, many stacks
side by side.

A stack whose solve stops before it has settled keeps its amounts, and is marked so
(`Stacks.settled`).

The table's model of a stack (`recipe.model.quick_reading`) is exact for one coat and differs a
little from the solver for several: enough to choose by. The last steps are the solver's own
(`recipe.polish`).
"""

import functools
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from glazejax.programs import Program

from ..film.numerics.blocks import by_blocks
from ..film.numerics.least_squares import levenberg_marquardt
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
from .selection import pack_coats

_STEPS = 12
# Stacks refined at a time, always as many, so that one program serves all.
_CHUNK = 128
# Costs computed at a time.
_COSTS = 1024
# Places between thinnest and thickest for an added coat.
_PLACES = (0.15, 0.5)


def refine(model: StackModel, aims: TargetArrays, stacks: Stacks, slots: int) -> Stacks:
    """Stacks at their best amounts by the table, with their cost there.

    Args:
        model, aims: paints and targets.
        stacks: where to start.
        slots: at least as many as a stack has paints, counted in each coat.
    """
    if stacks.size == 0:
        return stacks
    places, starts = fill_slots(model, stacks.sizes, slots)
    known = TargetArrays(*map(np.asarray, aims))

    def run(rows: Int[np.ndarray, "block"]) -> Any:
        batch = Slots(*(values[rows] for values in places))
        # Each candidate carries its target, so that the program does not depend on how many there
        # are.
        at = stacks.target[rows]
        aim = TargetArrays(*(values[at] for values in known))
        return _solve(model, batch, starts[rows], aim, coats=stacks.sizes.shape[1])

    amount, cost, settled = by_blocks(stacks.size, _CHUNK, run)
    sizes = empty_slots(places, amount, stacks.sizes.shape[2])
    # What did not come out as a number stays as it was before.
    good = np.isfinite(cost) & np.isfinite(sizes).all(axis=(1, 2))
    sizes = np.where(good[:, None, None], sizes, stacks.sizes)
    cost = np.where(good, cost, stacks.cost)
    return stacks._replace(sizes=sizes, cost=cost, settled=settled & good)


def refine_ahead(model: StackModel, aims: TargetArrays, slots: int, coats: int) -> None:
    """Begin to compile what `refine` of stacks of so many coats runs."""
    none = np.zeros((_CHUNK, slots), int)
    aim = TargetArrays(*(np.zeros((_CHUNK, *values.shape[1:])) for values in aims))
    _solve.ahead(model, Slots(none, none, none > 0), np.zeros(none.shape), aim, coats=coats)


@functools.partial(Program, fixed=("coats",))
def _solve(
    model: StackModel,
    slots: Slots,
    starts: Float[Array | np.ndarray, "n slots"],
    aims: TargetArrays,
    *,
    coats: int,
) -> tuple[Float[Array, "n coats slots"], Float[Array, "n"], Bool[Array, "n"]]:
    """Amounts in um, cost, and whether the solver settled, of candidates with an aim each."""
    lights = aims.lab.shape[1]

    def misfit(logs: Array, slots: Slots, aim: TargetArrays) -> Array:
        share = amounts(model, slots, logs, coats)
        absorption = model.absorption[slots.paint]
        scattering = model.scattering[slots.paint]
        reading = quick_reading(model, share @ absorption, share @ scattering)
        miss = jnp.einsum("lij,lj->li", aim.metric, lab_of(model, reading) - aim.lab)
        return jnp.concatenate(
            [miss.ravel() / np.sqrt(lights), jnp.sqrt(aim.spectral) * (reading - aim.spectrum)]
        )

    def residuals(logs: Array, slots: Slots, aim: TargetArrays, start: Array) -> Array:
        # A weak pull to the start settles what the target leaves open.
        return jnp.concatenate([misfit(logs, slots, aim), 0.01 * (logs - start)])

    given = (slots, aims, starts)
    logs, settled = levenberg_marquardt(
        residuals, jnp.asarray(starts), *given, rtol=1e-3, atol=1e-3, max_steps=_STEPS
    )
    cost = jnp.sum(jax.vmap(misfit)(logs, slots, aims) ** 2, axis=1)
    return (
        jax.vmap(lambda slots, logs: amounts(model, slots, logs, coats))(slots, logs),
        cost,
        settled,
    )


def grown(
    model: StackModel,
    aims: TargetArrays,
    parents: Stacks,
    *,
    max_paints: int,
    max_coats: int,
    mixed: bool = True,
) -> Stacks:
    """Every stack with one more paint in a coat, or one more coat on top or at the bottom, and its
    cost by the table.

    Args:
        model, aims: paints and targets.
        parents: stacks to add to.
        max_paints, max_coats: limits.
        mixed: whether a coat may hold more than one paint; if not, a coat is added between two
            others too.
    """
    sizes = []
    owners = []
    for row, stack in enumerate(parents.sizes):
        for child in _children(model, stack, max_paints, max_coats, mixed):
            sizes.append(child)
            owners.append(parents.target[row])
    if not sizes:
        return parents.take(np.zeros(0, int))
    children = pack_coats(np.stack(sizes))
    target = np.array(owners)
    reading = readings(model, children, None)

    def to_own_target(rows: Int[np.ndarray, "block"]) -> np.ndarray:
        to_all = np.asarray(_distances(model, aims, reading[rows]))
        return to_all[np.arange(_COSTS), target[rows]]

    return Stacks.before_refinement(children, target, by_blocks(len(target), _COSTS, to_own_target))


_distances = jax.jit(squared_distance)


def _children(
    model: StackModel,
    stack: Float[np.ndarray, "coats paints"],
    max_paints: int,
    max_coats: int,
    mixed: bool,
) -> list:
    power = strength(model)
    low, high = np.asarray(model.span)
    inside = stack.sum(axis=0) > 0
    filled = int((stack.sum(axis=1) > 0).sum())
    children = []
    for paint in range(stack.shape[1]):
        if not inside[paint] and inside.sum() >= max_paints:
            continue
        for coat in range(filled) if mixed else ():
            if stack[coat, paint] > 0:
                continue
            child = stack.copy()
            total = stack[coat].sum()
            # An added paint gets this share of a coat's strength.
            child[coat, paint] = 0.15 * (stack[coat] @ power) / power[paint]
            child[coat] *= total / child[coat].sum()
            children.append(child)
        if filled < max_coats:
            for place in _PLACES:
                coat = np.zeros(stack.shape[1])
                coat[paint] = np.exp(low + place * (high - low))
                # The same paint twice in a row would be one thicker coat.
                children += [
                    np.concatenate([stack[:at], coat[None], stack[at:-1]])
                    for at in ((0, filled) if mixed else range(filled + 1))
                    if not any(_only(other, paint) for other in stack[max(at - 1, 0) : at + 1])
                ]
    return children


def _only(coat: Float[np.ndarray, "paints"], paint: int) -> bool:
    """Whether a coat is of this paint and of no other."""
    return bool(coat[paint] > 0 and (coat > 0).sum() == 1)
