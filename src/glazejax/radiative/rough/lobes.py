"""GGX facets between two directions, and the lobe that renderers make of them.

What `surface` states keeps all energy with separable masking. The lobe of a renderer's rough
dielectric (`lobe_factor`) has facets of correlated heights, and gives back what they lose among
themselves by Turquin's factor, from the eye's side. Both are made of the same facets.

Azimuths are degrees, 0 the mirror side, as in `glazejax.geometry`; cosines are in air and above 0.
``xp`` is `numpy` or `jax.numpy`.
"""

from functools import lru_cache
from typing import Any, TypeAlias

import numpy as np
from jaxtyping import Float

from ..common.fresnel import dielectric_reflectance
from .facets import masking, visible_facets

PerDirection: TypeAlias = Float[np.ndarray, "*batch"]
"""A number for each direction, or pair of them."""

SMOOTH = 1e-4
"""Below this alpha a surface counts as a mirror."""

# Nodes of the rule over visible facets, on each piece between bends.
_NODES = (12, 12)


def cos_between(xp: Any, cos_in: Any, cos_out: Any, azimuth: Any) -> Any:
    """Cosine of the angle between the directions towards the light and the eye."""
    sines = xp.sqrt((1.0 - cos_in) * (1.0 + cos_in) * (1.0 - cos_out) * (1.0 + cos_out))
    return cos_in * cos_out - sines * xp.cos(xp.deg2rad(azimuth))


def facets_between(
    xp: Any, cos_in: Any, cos_out: Any, azimuth: Any, roughness: float
) -> tuple[Any, Any]:
    """Cosine at which light meets the facets that mirror it to the eye, and pi D, their density.

    Source: B. Walter, S. Marschner, H. Li, K. Torrance, EGSR 2007, eq (33).
    """
    # |i + o|^2 of unit vectors; at azimuth 0 the horizontal parts are against each other.
    squared = xp.maximum(2.0 + 2.0 * cos_between(xp, cos_in, cos_out, azimuth), 1e-30)
    # Squared cosine of the facets' tilt, and pi D of GGX there.
    up2 = (cos_in + cos_out) ** 2 / squared
    density = roughness**2 / (up2 * roughness**2 + xp.maximum(1.0 - up2, 0.0)) ** 2
    return xp.minimum(0.5 * xp.sqrt(squared), 1.0), density


def lobe_factor(
    mu_in: PerDirection,
    mu_out: PerDirection,
    azimuth: PerDirection,
    alpha: float,
    index: float,
) -> PerDirection:
    """Reflectance factor pi f of a rough dielectric's outer surface as renderers have it, (...); 0
    for a smooth one, which is a mirror.
    """
    if alpha < SMOOTH or index == 1.0:
        return np.zeros(mu_in.shape)
    met, density = facets_between(np, mu_in, mu_out, azimuth, alpha)
    fresnel = dielectric_reflectance(met, index)
    again = _again(fresnel, facet_albedo(mu_out, alpha))
    return density * fresnel * _both_seen(mu_in, mu_out, alpha) * again


def lobe_albedo(mu: PerDirection, alpha: float, index: float) -> PerDirection:
    """Directional albedo of `lobe_factor`, and of the mirror where the surface is smooth, (...)."""
    mu = np.asarray(mu, float)
    if index == 1.0:
        return np.zeros(mu.shape)
    if alpha < SMOOTH:
        return np.asarray(dielectric_reflectance(mu, index))
    return _albedo(mu, alpha, index)


def facet_albedo(mu: PerDirection, alpha: float) -> PerDirection:
    """Directional albedo of facets that reflect everything, once: below 1 by what goes on to other
    facets.
    """
    return _albedo(mu, alpha, None)


def _albedo(mu: PerDirection, alpha: float, index: float | None) -> PerDirection:
    values, where = np.unique(mu, return_inverse=True)
    return _albedos(tuple(values.tolist()), alpha, index)[where].reshape(np.shape(mu))


@lru_cache(maxsize=256)
def _albedos(mus: tuple[float, ...], alpha: float, index: float | None) -> np.ndarray:
    """Sums over visible facets, which reflect everything where there is no index."""
    mu = np.array(mus)[:, None]
    along, up, share = visible_facets(mu[:, 0], alpha, _NODES, None)
    met = np.clip(np.sqrt((1.0 - mu) * (1.0 + mu)) * along + mu * up, 1e-9, 1.0)
    # Cosine of where each facet sends the light; below the horizon it is lost.
    out = np.maximum(2.0 * met * up - mu, 0.0)
    # A visible facet's share holds G1 of separable masking: G2/G1 makes it that of correlated
    # heights.
    reflected = share * 4.0 * mu * out * _both_seen(out, mu, alpha) / masking(mu, alpha)
    if index is not None:
        fresnel = dielectric_reflectance(met, index)
        reflected = reflected * fresnel * _again(fresnel, _albedos(mus, alpha, None)[:, None])
    return reflected.sum(axis=1)


def _again(fresnel: Any, albedo: Any) -> Any:
    """Turquin's factor for what facets reflect to one another."""
    return 1.0 + fresnel * (1.0 - albedo) / albedo


def _both_seen(mu_in: Any, mu_out: Any, alpha: float) -> Any:
    """Smith's G2 for correlated heights, over 4 mu_in mu_out."""
    in_term = mu_out * np.sqrt(alpha**2 + (1.0 - alpha**2) * np.square(mu_in))
    out_term = mu_in * np.sqrt(alpha**2 + (1.0 - alpha**2) * np.square(mu_out))
    return 0.5 / (in_term + out_term)
