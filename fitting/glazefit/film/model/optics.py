"""An instrument in plain numbers, which compiled programs take as constants, and what coats reflect
by the solver.
"""

import functools
from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float

from glazejax import Bidirectional
from glazejax.geometry import Geometry, Instrument, resolve_instrument
from glazejax.radiative.common.inputs import concrete
from glazejax.radiative.stack import stack_hemispherical_reflectance, stack_reflectance_factor


class Optics(NamedTuple):
    """Cosines in air and refractive index; without a cosine of viewing, a sphere."""

    cos_incidence: float
    cos_viewing: float | None
    refractive_index: float

    @classmethod
    def of(cls, instrument: Instrument | Geometry | str) -> "Optics":
        """Plain numbers of an instrument (see `glazejax.geometry.resolve_instrument`).

        Raises:
            ValueError: several angles of a kind, or one that is traced.
        """
        seen_by = resolve_instrument(instrument)
        geometry = seen_by.geometry
        viewing = _number(geometry.cos_viewing) if isinstance(geometry, Bidirectional) else None
        return cls(_number(geometry.cos_incidence), viewing, float(seen_by.refractive_index))

    def body(
        self,
        absorption: Float[Array, "*#batch coats"],
        scattering: Float[Array, "*#batch coats"],
        ground: Float[Array, "*#batch"],
        tolerance: float,
    ) -> Float[Array, "*batch"]:
        """Reflectance of coats on a Lambertian ground, without the outer surface's part.

        Args:
            absorption, scattering: optical thicknesses k d and s d, top first, >= 0; both 0 for a
                coat that is absent.
            ground: internal reflectance.
            tolerance: of the solver.
        """
        depth = absorption + scattering
        absent = depth <= 0
        albedo = jnp.where(absent, 0.0, scattering) / jnp.where(absent, 1.0, depth)
        solver = stack_hemispherical_reflectance
        if self.cos_viewing is not None:
            solver = functools.partial(stack_reflectance_factor, cos_viewing=self.cos_viewing)
        return solver(
            albedo,
            depth,
            ground,
            refractive_index=self.refractive_index,
            cos_incidence=self.cos_incidence,
            tolerance=tolerance,
        )


def _number(cosine: ArrayLike) -> float:
    value = concrete(cosine)
    if value is None:
        raise ValueError(
            "a film's table is made for one pair of angles: give them as numbers, not as what JAX "
            "traces"
        )
    return float(value)
