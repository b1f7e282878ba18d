"""Smooth dielectric interfaces for unpolarised light.

The functions take numpy or JAX arrays and answer in kind, so that tables for a fixed index are made once, in
double precision, outside the compiled program.
"""

from types import ModuleType

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float


def array_module(*arrays) -> ModuleType:
    """`jax.numpy` if any of the arrays is a JAX array (or traced), else `numpy`."""
    return jnp if any(isinstance(a, jax.Array) for a in arrays) else np


def cos_refracted(
    cos_incidence: float | Float[Array | np.ndarray, "*batch"],
    refractive_index: float | Float[Array | np.ndarray, "*batch"],
) -> Float[Array, "*batch"]:
    """Cosine inside a medium of index n >= 1 of a beam that comes from air.

    Snell's law, ``sin(theta_air) = n sin(theta_medium)`` (paper A, section 2). Written without the
    difference of two numbers near one, so that n = 1 returns the cosine unchanged to rounding.
    """
    xp = array_module(cos_incidence, refractive_index)
    n = refractive_index
    return xp.sqrt((n - 1.0) * (n + 1.0) + cos_incidence**2) / n


def dielectric_reflectance(
    cos_incidence: float | Float[Array | np.ndarray, "*batch"],
    refractive_index: float | Float[Array | np.ndarray, "*batch"],
) -> Float[Array, "*batch"]:
    """Fresnel reflectance of the smooth face of a dielectric, for unpolarised light from air.

    By reversibility this is also the reflectance from inside at the refracted angle.

    Args:
        cos_incidence: cosine of the angle of incidence in air, (...), in (0, 1].
        refractive_index: index n of the medium, (...), >= 1.

    Returns:
        Reflectance in [0, 1], (...).

    Source: Fresnel's equations; paper A, section 2 (its R(mu)).
    """
    xp = array_module(cos_incidence, refractive_index)
    n = refractive_index
    # n times the cosine in the medium; for n = 1 it equals the cosine in air exactly, so both amplitudes vanish.
    n_cos_medium = xp.sqrt((n - 1.0) * (n + 1.0) + cos_incidence**2)
    s = (cos_incidence - n_cos_medium) / (cos_incidence + n_cos_medium)
    p = (n**2 * cos_incidence - n_cos_medium) / (n**2 * cos_incidence + n_cos_medium)
    return 0.5 * (s**2 + p**2)
