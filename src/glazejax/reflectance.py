"""Glaze and instrument -> spectrum: the one place where paint meets solver."""

import jax.numpy as jnp
from jaxtyping import Array, Float

from .geometry import Bidirectional, Geometry, Hemispherical
from .media import Glaze
from .radiative.fresnel import dielectric_reflectance
from .radiative.stack import Method, stack_hemispherical_reflectance, stack_reflectance_factor


def reflectance(
    glaze: Glaze, geometry: Geometry, *, tolerance: float = 1e-6, method: Method = "ordinates"
) -> Float[Array, "*batch bands"]:
    """Reflectance spectrum of a glaze as an instrument sees it.

    Args:
        glaze: layers on a ground; thicknesses, weights and coefficients may carry leading batch axes.
        geometry: `Bidirectional` gives the reflectance factor pi L_out / E_in, `Hemispherical` the reflected
            share of the flux. With its `specular` flag, the Fresnel reflectance of the outer surface is
            added (for `Bidirectional` only where viewing equals incidence).
        tolerance: absolute error wanted; static.
        method: "ordinates", or "auxiliary" or "manyflux": the same quantity another way.

    Returns:
        (..., bands); one band if neither layers nor substrate have bands.

    Raises:
        TypeError: `geometry` is neither of the two.
        ValueError: the solver refuses `tolerance` or `method`.

    Source: paper A (Shinozawa et al. 2013), section 3.2.
    """
    albedo, thickness = glaze.albedo, glaze.optical_thickness
    n = glaze.refractive_index
    match geometry:
        case Bidirectional():
            diffuse = stack_reflectance_factor(
                albedo,
                thickness,
                glaze.substrate,
                refractive_index=n,
                cos_incidence=geometry.cos_incidence,
                cos_viewing=geometry.cos_viewing,
                tolerance=tolerance,
                method=method,
            )
            mirror = jnp.asarray(geometry.incidence) == jnp.asarray(geometry.viewing)
            mirror = mirror[..., None] if mirror.ndim else mirror
        case Hemispherical():
            diffuse = stack_hemispherical_reflectance(
                albedo,
                thickness,
                glaze.substrate,
                refractive_index=n,
                cos_incidence=geometry.cos_incidence,
                tolerance=tolerance,
                method=method,
            )
            mirror = True
        case _:
            raise TypeError(f"geometry must be Bidirectional or Hemispherical, not {type(geometry).__name__}")
    if not geometry.specular:
        return diffuse
    surface = dielectric_reflectance(jnp.asarray(geometry.cos_incidence), jnp.asarray(n))
    return diffuse + jnp.where(mirror, surface, 0.0)
