"""The many-flux solver as one of the methods of the two reflectances of a stack, for isotropic
scattering.

It shares the choice of interface and ground with the default solver, but neither the modes nor the
elimination, so that each checks the other.
"""

from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array

from ..common.directions import resolve
from ..common.inputs import Numbers, concrete, smallest_cosine
from ..common.stack_arrays import Stack
from .effort import THICKEST, Effort, choose_effort, effort_for_indices
from .solve import Layers, hemispherical_reflectance, reflectance_factor


def resolve_effort(
    tolerance: float,
    indices: tuple[float, float],
    fixed: float | None,
    optical_thickness: Numbers,
    *cosines: Numbers | None,
) -> Effort:
    """Directions and doublings for stacks.

    Args:
        tolerance: absolute error wanted.
        indices: smallest and largest refractive index.
        fixed: the index, where it is one number.
        optical_thickness: (..., layers); up to 1e6 where it is traced.
        cosines: of incidence and viewing; down to 1e-4 where they are traced.
    """
    known = concrete(optical_thickness)
    thickest = THICKEST if known is None else float(known.max(initial=0.0))
    least = smallest_cosine(*cosines)
    if fixed is None:
        return effort_for_indices(resolve(tolerance, *indices), *indices, thickest, least)
    return choose_effort(tolerance, fixed, None, 1, thickest, least, None, azimuthal=False)


def bytes_each(effort: Effort, layers: int, itemsize: int) -> int:
    """Memory that one stack's matrices take."""
    return 4 * layers * (effort.width + 1) ** 2 * itemsize


def reflectance(stack: Stack, effort: Effort) -> Array:
    """Either reflectance of each stack, (batch,)."""

    def one(q: Array, d: Array, ground: Array, index: Any, lit: Array, seen: Array | None) -> Array:
        layers = Layers(q, d, jnp.ones((q.size, 1), q.dtype), ground)
        if seen is None:
            return hemispherical_reflectance(layers, index, lit[None], effort)[0]
        return reflectance_factor(
            layers, index, seen[None], lit[None], jnp.zeros(1, q.dtype), effort
        )[0, 0, 0]

    axes = (0, 0, 0, 0 if isinstance(stack.refractive_index, jax.Array) else None, 0)
    seen = None if stack.cos_viewing is None else 0
    return jax.vmap(one, in_axes=(*axes, seen))(*stack)


def reflectance_and_gradient(
    stack: Stack, effort: Effort, wanted: tuple[str, ...]
) -> tuple[Array, dict[str, Array]]:
    """Reflectance, (batch,), and its derivative by the wanted leaves, each in the shape of the
    leaf.
    """

    def value(leaves: dict[str, Array]) -> Array:
        return reflectance(stack._replace(**leaves), effort)

    found, back = jax.vjp(value, {name: getattr(stack, name) for name in wanted})
    return found, back(jnp.ones_like(found))[0]
