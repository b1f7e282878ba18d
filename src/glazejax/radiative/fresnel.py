"""Reflectance of smooth dielectric interfaces for unpolarised light."""

import jax.numpy as jnp
from jaxtyping import Array, Float


def cos_refracted(cos_incidence: Float[Array, "..."], refractive_index: Float[Array, "..."]) -> Float[Array, "..."]:
    """Cosine inside a medium of index n >= 1 of a beam that comes from air.

    Snell's law, ``sin(theta_air) = n sin(theta_medium)`` (paper A, section 2). Written without the
    difference of two numbers near one, so that n = 1 returns the cosine unchanged to rounding.
    """
    cos = jnp.asarray(cos_incidence)
    n = jnp.asarray(refractive_index)
    return jnp.sqrt((n - 1.0) * (n + 1.0) + cos**2) / n


def dielectric_reflectance(
    cos_incidence: Float[Array, "..."], refractive_index: Float[Array, "..."]
) -> Float[Array, "..."]:
    """Fresnel reflectance of the smooth face of a dielectric, for unpolarised light from air.

    By reversibility this is also the reflectance from inside at the refracted angle.

    Args:
        cos_incidence: cosine of the angle of incidence in air, (...), in (0, 1].
        refractive_index: index n of the medium, (...), >= 1.

    Returns:
        Reflectance in [0, 1], (...).

    Source: Fresnel's equations; paper A, section 2 (its R(mu)).
    """
    cos_air = jnp.asarray(cos_incidence)
    n = jnp.asarray(refractive_index)
    # n * cosine in the medium; for n = 1 it equals cos_air exactly, so both amplitudes vanish.
    n_cos_medium = jnp.sqrt((n - 1.0) * (n + 1.0) + cos_air**2)
    s = (cos_air - n_cos_medium) / (cos_air + n_cos_medium)
    p = (n**2 * cos_air - n_cos_medium) / (n**2 * cos_air + n_cos_medium)
    return 0.5 * (s**2 + p**2)
