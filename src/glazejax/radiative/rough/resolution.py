"""From the accuracy asked for to the number of nodes of a rough surface; what surfaces
there are.
"""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ...spectra import concrete
from ..common.inputs import INDEX_RANGE, Numbers
from ..common.rounding import warn_user
from .basis import Size
from .body import Surface

LEAST_INDEX = 1.02
"""Below it a rough surface has no critical angle to speak of; the model's losses are no longer
those of a surface.
"""
FINEST = 1e-5
"""Smallest tolerance that is met."""

# Below this index light may graze inside, too, and takes more nodes.
_LOW = 1.2
# Worst errors of each: `python -m benchmarks.solver.rough_surface`.
_SIZES = (
    (1e-2, Size(upper=4, lower=5, crowding=2.0, incidence=20, beams=28, facets=(8, 8))),
    (1e-3, Size(upper=5, lower=8, crowding=2.0, incidence=24, beams=28, facets=(8, 8))),
    (1e-4, Size(upper=7, lower=12, crowding=2.0, incidence=32, beams=36, facets=(24, 24))),
    (1e-5, Size(upper=9, lower=20, crowding=2.5, incidence=48, beams=48, facets=(28, 28))),
)


def check_surface(roughness: Any, refractive_index: Numbers) -> float:
    """The roughness as a number, once it and the index are known to be those of a surface.

    Raises:
        ValueError: either is traced or out of range.
    """
    value = concrete(roughness)
    if value is None or value.ndim:
        raise ValueError(
            "roughness must be one known number: under jit or vmap pass it as a static "
            "argument, call once for each roughness, and take slopes by it by differences"
        )
    number = float(value)
    if not 0.0 <= number <= 1.0:
        raise ValueError(f"roughness is {number}; it must be in [0, 1], the alpha of GGX")
    # A smooth surface has no table that would be made for one known index.
    if number > 0.0:
        index = concrete(refractive_index)
        if index is None:
            raise ValueError(
                "refractive_index is traced, but a rough surface needs known numbers: under jit "
                "or vmap pass it as a static argument, and take slopes by it by differences"
            )
        low = LEAST_INDEX
        high = INDEX_RANGE[1]
        wrong = np.asarray(index)[~((index >= low) & (index <= high))]
        if wrong.size:
            raise ValueError(
                f"refractive_index holds {wrong.flat[0]}; under a rough surface it must be in "
                f"[{low:g}, {high:g}]"
            )
    return number


def resolve(index: float, roughness: float, tolerance: float) -> Surface:
    """The surface, resolved so that the error stays below the tolerance."""
    if tolerance < FINEST * (1 - 1e-9):
        warn_user(
            f"tolerance is {tolerance:g}, but {FINEST:g} is the least there is under a rough "
            "surface"
        )
    size = next((size for least, size in _SIZES if least <= tolerance * (1 + 1e-9)), _SIZES[-1][1])
    if index < _LOW:
        size = size._replace(upper=size.upper + 3, lower=size.lower + 4)
    return Surface(index, float(roughness), size)


def index_by_index(indices: np.ndarray, evaluate_one: Callable[[float], Any]) -> Any:
    """Results of a function of one index at several: arrays, or a pytree of them, against which
    the indices broadcast.

    All entries are computed for each index, those of others too: few indices are expected, and
    shapes stay as they are.
    """
    # Of no entries any index will do.
    first, *others = np.unique(indices).tolist() or [1.5]
    answer = evaluate_one(first)
    for index in others:
        answer = jax.tree.map(
            lambda new, old, here=indices == index: jnp.where(here, new, old),
            evaluate_one(index),
            answer,
        )
    return answer
