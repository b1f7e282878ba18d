"""Kubelka-Munk's two fluxes: what most paint programs compute, for comparison and as a starting point.

K and S are not the k and s of radiative transfer: see `kubelka_munk_from_radiative`.
"""

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float

from .kernels import tanh_sech


def two_flux_layer(
    absorption: ArrayLike, scattering: ArrayLike
) -> tuple[Float[Array, "*batch"], Float[Array, "*batch"]]:
    """Reflectance and transmittance of a layer without surfaces, for diffuse light.

    With a = 1 + K/S and b = sqrt(a^2 - 1), R = sinh(b S d)/(a sinh + b cosh) and T = b/(a sinh + b cosh), written so
    that K = 0, S = 0 and d = 0 are nothing special and nothing overflows.

    Args:
        absorption: K d, (...), >= 0.
        scattering: S d, (...), >= 0.

    Source: paper C (Shinya et al.), equation (10); Kubelka and Munk (1931).
    """
    k, s = jnp.broadcast_arrays(jnp.asarray(absorption, float), jnp.asarray(scattering, float))
    tanh, sech = tanh_sech(k * (k + 2.0 * s), jnp.ones_like(k))
    below = 1.0 + (k + s) * tanh
    return s * tanh / below, sech / below


def two_flux_reflectance(
    absorption: ArrayLike, scattering: ArrayLike, substrate_reflectance: ArrayLike
) -> Float[Array, "*batch"]:
    """Reflectance of a layer on a ground, without surfaces, for diffuse light.

    Args:
        absorption, scattering: K d and S d, (...), >= 0.
        substrate_reflectance: (...), in [0, 1].
    """
    reflectance, transmittance = two_flux_layer(absorption, scattering)
    ground = jnp.asarray(substrate_reflectance)
    return reflectance + transmittance**2 * ground / (1.0 - reflectance * ground)


def saunderson(reflectance: ArrayLike, outer: ArrayLike = 0.04, inner: ArrayLike = 0.6) -> Float[Array, "*batch"]:
    """Reflectance in air of paint under a smooth surface, without the surface's own part.

    Args:
        reflectance: inside the paint, (...).
        outer: Fresnel reflectance of the surface for the incident light.
        inner: the same for diffuse light from inside.

    Source: Saunderson (1942).
    """
    r, outside, inside = (jnp.asarray(value) for value in (reflectance, outer, inner))
    return (1.0 - outside) * (1.0 - inside) * r / (1.0 - inside * r)


def kubelka_munk_from_radiative(absorption: ArrayLike, scattering: ArrayLike) -> tuple[Array, Array]:
    """Kubelka-Munk's K and S for k and s of radiative transfer: K = 2 k, S = 3 s/4.

    Good for isotropic scattering, diffuse light and layers that scatter far more than they absorb (Gate 1974).
    """
    k, s = jnp.asarray(absorption), jnp.asarray(scattering)
    return 2.0 * k, 0.75 * s
