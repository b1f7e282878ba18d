"""The many-flux solver as a method of the two reflectances of a stack, for isotropic scattering.

It shares the choice of interface and ground with the default solver, but neither the modes nor the
elimination, so that each checks the other. Its dozen modules, which nobody else needs, are imported
when it is asked.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp
from jaxtyping import Array

from ..common.directions import resolve
from ..common.inputs import smallest_cosine
from ..common.rounding import Rounding
from ..common.solver import Request, Solver
from ..common.stack_arrays import StackArrays

if TYPE_CHECKING:
    from .effort import FluxEffort

# Bytes of one chunk's matrices: with all that is made of them they should stay in a core's
# second-level cache.
_CHUNK_BYTES = 2**20

ROUNDING: dict[str, Rounding] = {
    "doubling": Rounding(per_depth=6e-6, deepest=2e3),
    # On one processor errors grew with the depth, to .4 at 1e5; on another, with other rounding in
    # its sums, with the square of the depth, to 30.
    "modes": Rounding(per_depth=2e-8, deepest=2.5e5, power=2.0),
}
"""By the solution of `manyflux.effort.Solution`."""


class ManyFlux(Solver):
    """Layer operators by doubling; see `manyflux.solve`."""

    finest: float = 1e-10
    rounding: Rounding | None = ROUNDING["doubling"]
    splits: bool = False

    def resolve(self, request: Request) -> tuple[FluxEffort, int]:
        """Directions and doublings, and how many stacks go through at a time.

        An optical thickness that is traced may be up to 1e6, and a cosine down to 1e-4.
        """
        from .effort import choose_effort, effort_for_indices

        least = smallest_cosine(request.cos_incidence, request.cos_viewing)
        if request.fixed_index is None:
            directions = resolve(request.tolerance, *request.indices)
            effort = effort_for_indices(
                directions, *request.indices, request.optical_thickness, least
            )
        else:
            effort = choose_effort(
                tolerance=request.tolerance,
                media=request.fixed_index,
                moments=None,
                terms=1,
                optical_thickness=request.optical_thickness,
                least_cosine=least,
                streams=None,
                azimuthal=False,
            )
        bytes_each = 4 * request.layers * (effort.width + 1) ** 2 * request.itemsize
        return effort, request.stacks_within(_CHUNK_BYTES, bytes_each)

    def reflectance(self, stack: StackArrays, resolution: FluxEffort) -> Array:
        """Either reflectance of each stack, (batch,)."""
        from .solve import Layers, hemispherical_reflectance, reflectance_factor

        def one(
            q: Array,
            d: Array,
            ground: Array,
            index: Any,
            cos_incidence: Array,
            cos_viewing: Array | None,
        ) -> Array:
            # Isotropic scattering is one Legendre moment, and the same at every azimuth.
            layers = Layers(q, d, jnp.ones((q.size, 1), q.dtype), ground)
            if cos_viewing is None:
                return hemispherical_reflectance(layers, index, cos_incidence[None], resolution)[0]
            azimuth = jnp.zeros(1, q.dtype)
            factor = reflectance_factor(
                layers, index, cos_viewing[None], cos_incidence[None], azimuth, resolution
            )
            return factor[0, 0, 0]

        index_axis = 0 if isinstance(stack.refractive_index, jax.Array) else None
        return jax.vmap(one, in_axes=(0, 0, 0, index_axis, 0, 0))(*stack)
