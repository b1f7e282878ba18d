"""The two lobes that OpenPBR is made of: the rough diffuse body EON, and a rough dielectric's
reflection.

Azimuths are degrees, 0 the mirror side, as in `glazejax.geometry`; cosines are in air and above 0.
"""

from functools import lru_cache

import numpy as np
from jaxtyping import Float

from ...radiative.common.fresnel import dielectric_reflectance
from ...radiative.common.quadrature import gauss

SMOOTH = 1e-4
"""Below this alpha a surface counts as a mirror."""

_FUJII = 0.5 - 2.0 / (3.0 * np.pi)
_FUJII_MEAN = 2.0 / 3.0 - 28.0 / (15.0 * np.pi)
# Below this roughness the body is Lambert's to rounding, and what is given back would be 0/0.
_LAMBERT = 1e-6
# Points of the integration over visible normals, along both of its coordinates.
_NORMALS = 48


def diffuse_factor(
    colour: Float[np.ndarray, "3"],
    roughness: float,
    mu_in: Float[np.ndarray, "*batch"],
    mu_out: Float[np.ndarray, "*batch"],
    azimuth: Float[np.ndarray, "*batch"],
) -> Float[np.ndarray, "*batch 3"]:
    """Reflectance factor of the body: EON, Fujii's Oren-Nayar lobe with what it loses given back,
    (..., 3).

    Args:
        colour: (3,), its albedo where all light comes from all sides.
        roughness: 0 is Lambert's body.
        mu_in, mu_out, azimuth: see the module.

    Source: Portsmouth, Kutz, Hill, EON (2024); OpenPBR 1.1, "Glossy-diffuse".
    """
    if roughness < _LAMBERT:
        return np.broadcast_to(colour, (*mu_in.shape, 3))
    between = _cos_between(mu_in, mu_out, azimuth)
    s = between - mu_in * mu_out
    s_over_t = np.where(s > 0, s / np.maximum(mu_in, mu_out), s)
    single = (1.0 + roughness * s_over_t) / (1.0 + _FUJII * roughness)
    mean = (1.0 + _FUJII_MEAN * roughness) / (1.0 + _FUJII * roughness)
    missing = (
        (1.0 - _fujii_albedo(mu_in, roughness))
        * (1.0 - _fujii_albedo(mu_out, roughness))
        / (1.0 - mean)
    )
    more = colour**2 * mean / (1.0 - colour * (1.0 - mean))
    return single[..., None] * colour + missing[..., None] * more


def _fujii_albedo(mu: Float[np.ndarray, "*batch"], roughness: float) -> Float[np.ndarray, "*batch"]:
    """Directional albedo of the white lobe without what is given back."""
    sine = np.sqrt(np.maximum(0.0, 1.0 - mu**2))
    lobe = sine * (np.arccos(np.clip(mu, -1, 1)) - sine * mu) + 2.0 / 3.0 * (
        sine / mu * (1.0 - sine**3) - sine
    )
    return (1.0 + roughness * lobe / np.pi) / (1.0 + _FUJII * roughness)


def lobe_factor(
    mu_in: Float[np.ndarray, "*batch"],
    mu_out: Float[np.ndarray, "*batch"],
    azimuth: Float[np.ndarray, "*batch"],
    alpha: float,
    index: float,
) -> Float[np.ndarray, "*batch"]:
    """Reflectance factor pi f of a rough dielectric's outer surface, (...); 0 for a smooth one,
    which is a mirror.

    GGX facets, heights correlated (Smith), Fresnel's equations at the facet, and what facets lose
    among themselves given back by Turquin's factor, from the eye's side.
    """
    if alpha < SMOOTH or index == 1.0:
        return np.zeros(mu_in.shape)
    # The half vector of two unit vectors: its length is 2 cos(half the angle between them).
    facing = np.sqrt(np.maximum(0.5 * (1.0 + _cos_between(mu_in, mu_out, azimuth)), 1e-12))
    half = np.minimum((mu_in + mu_out) / (2.0 * facing), 1.0)
    density = alpha**2 / (np.pi * ((alpha**2 - 1.0) * half**2 + 1.0) ** 2)
    fresnel = dielectric_reflectance(facing, index)
    kept = facet_albedo(mu_out, alpha)
    return (
        np.pi
        * density
        * fresnel
        * _both_seen(mu_in, mu_out, alpha)
        * (1.0 + fresnel * (1.0 - kept) / kept)
    )


def lobe_albedo(
    mu: Float[np.ndarray, "*batch"], alpha: float, index: float
) -> Float[np.ndarray, "*batch"]:
    """Directional albedo of `lobe_factor`, and of the mirror where the surface is smooth, (...)."""
    mu = np.asarray(mu, float)
    if index == 1.0:
        return np.zeros(mu.shape)
    if alpha < SMOOTH:
        return np.asarray(dielectric_reflectance(mu, index))
    return _integrate(mu, alpha, index)


def facet_albedo(mu: Float[np.ndarray, "*batch"], alpha: float) -> Float[np.ndarray, "*batch"]:
    """Directional albedo of facets that reflect everything, once: below 1 by what goes on to other
    facets.
    """
    return _integrate(mu, alpha, None)


def _integrate(
    mu: Float[np.ndarray, "*batch"], alpha: float, index: float | None
) -> Float[np.ndarray, "*batch"]:
    values, where = np.unique(mu, return_inverse=True)
    table = np.array([_one_albedo(float(value), alpha, index) for value in values])
    return table[where].reshape(np.shape(mu))


@lru_cache(maxsize=4096)
def _one_albedo(mu: float, alpha: float, index: float | None) -> float:
    """Integral over visible normals, of facets that reflect everything where there is no index.

    Source of the map: J. Dupuy, A. Benyoub, Sampling visible GGX normals with spherical caps
    (2023).
    """
    share, weights = gauss(_NORMALS)
    # The lobe is even in the azimuth: half of it is enough.
    turn = np.pi * (np.arange(_NORMALS) + 0.5) / _NORMALS
    sine = np.sqrt(1.0 - mu**2)
    # The viewing direction where the ellipsoid of facets is stretched to a hemisphere.
    stretched = np.hypot(alpha * sine, mu)
    view_x = alpha * sine / stretched
    view_z = mu / stretched
    # Points of the spherical cap; each plus the view is a visible normal, on the hemisphere.
    z = (1.0 - share) * (1.0 + view_z) - view_z
    ring = np.sqrt(np.maximum(0.0, 1.0 - z**2))
    x = ring[:, None] * np.cos(turn) + view_x
    y = ring[:, None] * np.sin(turn)
    height = z[:, None] + view_z
    # Back to facets of the surface, of unit length.
    x = alpha * x
    y = alpha * y
    length = np.sqrt(x**2 + y**2 + height**2)
    facing = np.clip((x * sine + height * mu) / length, 1e-9, 1.0)
    # Cosine of where each facet sends the light; below the horizon it is lost.
    out = 2.0 * facing * height / length - mu
    seen = np.where(
        out > 0,
        _both_seen(np.maximum(out, 1e-9), mu, alpha) * 4.0 * mu * np.maximum(out, 1e-9),
        0.0,
    )
    seen = seen / _one_seen(mu, alpha)
    # With Fresnel's reflectance, and what is reflected again between facets.
    if index is not None:
        fresnel = np.asarray(dielectric_reflectance(facing, index))
        kept = _one_albedo(mu, alpha, None)
        seen = seen * fresnel * (1.0 + fresnel * (1.0 - kept) / kept)
    return float(weights @ seen.mean(axis=1))


def _one_seen(mu: float, alpha: float) -> float:
    """Share of facets that are not hidden from one direction, Smith's G1."""
    return 2.0 * mu / (mu + float(np.sqrt(alpha**2 + (1.0 - alpha**2) * mu**2)))


def _both_seen(mu_in, mu_out, alpha: float):
    """Smith's G2 for correlated heights, over 4 mu_in mu_out."""
    one = mu_out * np.sqrt(alpha**2 + (1.0 - alpha**2) * np.square(mu_in))
    other = mu_in * np.sqrt(alpha**2 + (1.0 - alpha**2) * np.square(mu_out))
    return 0.5 / (one + other)


def _cos_between(
    mu_in: Float[np.ndarray, "*batch"],
    mu_out: Float[np.ndarray, "*batch"],
    azimuth: Float[np.ndarray, "*batch"],
) -> Float[np.ndarray, "*batch"]:
    """Cosine of the angle between the directions towards the light and the eye."""
    sines = np.sqrt(np.maximum(0.0, 1.0 - mu_in**2)) * np.sqrt(np.maximum(0.0, 1.0 - mu_out**2))
    return mu_in * mu_out - sines * np.cos(np.deg2rad(azimuth))
