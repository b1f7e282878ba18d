"""More paints and more coats than can be gone through in full: the best recipes so far, with something added."""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from .bench import Bench, lab_of, readings
from .choose import packed
from .screen import Aims, Stacks, strength

# Share of a coat's strength that an added paint gets, and places between thinnest and thickest for an added coat.
_SHARE = 0.15
_PLACES = (0.15, 0.5)


def grown(bench: Bench, aims: Aims, parents: Stacks, *, max_paints: int, max_layers: int) -> Stacks:
    """Every stack with one more paint in a coat, or one more coat on top or at the bottom, and its cost by the table.

    Args:
        bench, aims: paints and targets.
        parents: stacks to add to.
        max_paints, max_layers: limits.
    """
    sizes, owners = [], []
    for row, stack in enumerate(parents.sizes):
        for child in _children(bench, stack, max_paints, max_layers):
            sizes.append(child)
            owners.append(parents.target[row])
    if not sizes:
        return parents.take(np.zeros(0, int))
    children = packed(np.stack(sizes))
    target = np.array(owners)
    reading = readings(bench, children, None)
    miss = np.asarray(lab_of(bench, jnp.asarray(reading))) - np.asarray(aims.lab)[target]
    moved = np.einsum("nlij,nlj->nli", np.asarray(aims.metric)[target], miss)
    apart = np.sum((reading - np.asarray(aims.spectrum)[target]) ** 2, axis=1)
    cost = np.sum(moved**2, axis=(1, 2)) / miss.shape[1] + np.asarray(aims.spectral)[target] * apart
    return Stacks(children, target, cost)


def _children(bench: Bench, stack: Float[np.ndarray, "coats paints"], max_paints: int, max_layers: int) -> list:
    power = strength(bench)
    low, high = np.asarray(bench.span)
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
