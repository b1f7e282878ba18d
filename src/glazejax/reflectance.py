"""Glaze and instrument -> spectrum: the one place where paint meets solver."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .geometry import Geometry, Hemispherical, Instrument, geometry_of
from .paint.media import Glaze, check_glaze, stack_of
from .radiative.common.fresnel import dielectric_reflectance
from .radiative.stack import (
    Method,
    stack_hemispherical_reflectance,
    stack_reflectance_factor,
)


def reflectance(
    glaze: Glaze,
    instrument: Instrument | Geometry | str,
    *,
    tolerance: float = 1e-6,
    method: Method | None = None,
) -> Float[Array, "*batch bands"]:
    """Reflectance spectrum of a glaze as an instrument sees it.

    Args:
        glaze: coats on a ground; thicknesses, weights and coefficients may carry leading batch
            axes.
        instrument: a geometry, its words, such as ``"45:0"`` or ``"d:8"``, or an `Instrument`, of
            which the geometry counts: the index is the glaze's. `Bidirectional` gives the
            reflectance factor pi L_out / E_in, `Hemispherical` the reflected share of the flux.
            With its `specular` flag, the Fresnel reflectance of the outer surface is added (for
            `Bidirectional` only where viewing equals incidence).
        tolerance: absolute error wanted; static.
        method: "ordinates", or "auxiliary" or "manyflux": the same quantity another way. By default
            the first, or "manyflux" where a paint has a phase function: only it can follow that.

    Returns:
        (..., bands); one band if neither coats nor ground have bands.

    Raises:
        TypeError: `instrument` is none of these, or `glaze` is no Glaze.
        ValueError: words that name no geometry, the solver refuses `tolerance` or `method`, or a
            glaze with phase functions has an index that varies or is traced.

    Example:
        >>> from glazejax import Bidirectional, Layer, catalogue
        >>> blue = catalogue.load()["CobaltBlue"]
        >>> spectrum = reflectance(Glaze([Layer(blue, 1e-6)], 0.9), Bidirectional(45, 0))
        >>> spectrum.shape, round(float(spectrum[0]), 2)
        ((31,), 0.56)

    Source: paper A (Shinozawa et al. 2013), section 3.2.
    """
    check_glaze(glaze)
    geometry = geometry_of(instrument)
    phase = glaze.phase
    if phase is not None and method not in (None, "manyflux"):
        raise ValueError(
            f"method {method!r} takes isotropic scattering only; a paint here has a phase function"
        )
    n = glaze.refractive_index
    stack = stack_of(glaze)
    options: dict[str, Any] = {"refractive_index": n, "tolerance": tolerance}
    # Only the many-flux solver follows a phase function.
    options |= {"method": method or "ordinates"} if phase is None else {"phase": phase}
    options["cos_incidence"] = geometry.cos_incidence
    if phase is None:
        factor = stack_reflectance_factor
        hemispherical = stack_hemispherical_reflectance
    else:
        from .radiative.manyflux.reflectance import (
            manyflux_hemispherical_reflectance as hemispherical,
        )
        from .radiative.manyflux.reflectance import manyflux_reflectance_factor as factor
    if isinstance(geometry, Hemispherical):
        diffuse = hemispherical(*stack, **options)
    else:
        if phase is not None:
            azimuth = jnp.asarray(geometry.azimuth)
            # Angles of a batch broadcast against the bands.
            options["azimuth"] = azimuth[..., None] if azimuth.ndim else azimuth
        diffuse = factor(*stack, cos_viewing=geometry.cos_viewing, **options)
        turns = np.shape(geometry.azimuth)
        if phase is None and turns:
            # The same at every azimuth, but each has its entry.
            shape = np.broadcast_shapes(diffuse.shape, (*turns, 1))
            diffuse = jnp.broadcast_to(diffuse, shape)
    if not geometry.specular:
        return diffuse
    # What the outer surface mirrors is no part of the stack's reflectance.
    surface: Array = dielectric_reflectance(jnp.asarray(geometry.cos_incidence), jnp.asarray(n))
    return diffuse + jnp.where(geometry.sees_surface, surface, 0.0)
