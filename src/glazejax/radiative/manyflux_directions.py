"""Directions for scattering that is not isotropic, and how many of them an accuracy needs.

With any phase function the field in every direction counts, not just two sums over it (`simultaneous`), so that every
node carries its own Fresnel reflectance. Nodes that crowd towards grazing suit layers of any thickness, nodes that are
spread suit many Legendre moments. Between the two the best is searched for, once for each case.
"""

import functools
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from glazejax.radiative.directions import Directions, conserve, gauss, graded_gauss
from glazejax.radiative.fresnel import dielectric_reflectance

# The largest error of the sums over directions may be this share of the tolerance.
_SHARE = 0.2
_FINE = 100
_FEWEST, _MOST = 4, 96
_DEPTHS = np.array([0.0, 0.01, 0.1, 1.0])
_CROWDING = (0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0)
_CONE_SHARES = (0.3, 0.35, 0.4, 0.5)


class Spread(NamedTuple):
    """Numbers of nodes that can leave and that are totally reflected, and how these crowd; static."""

    cone: int
    total: int
    crowding: float


@functools.lru_cache(maxsize=256)
def spread_directions(index: float, spread: Spread) -> Directions:
    """Nodes inside a medium: Gauss nodes in the cosine outside for the cone of refraction, graded ones below.

    Args:
        index: refractive index. At 1 there is one graded rule of cone + total nodes.
        spread: numbers of nodes.
    """
    if index == 1.0:
        mu, weights = graded_gauss(spread.cone + spread.total, spread.crowding)
        return Directions(mu, conserve(mu, weights), np.zeros_like(mu))
    excess = (index - 1.0) * (index + 1.0)
    outside, w_outside = gauss(spread.cone)
    mu = np.sqrt(excess + outside**2) / index
    y, w = graded_gauss(spread.total, spread.crowding)
    critical = np.sqrt(excess) / index
    cosines = np.concatenate([mu, critical * y])
    weights = np.concatenate([w_outside * outside / (index**2 * mu), critical * w])
    reflectance = np.concatenate([dielectric_reflectance(outside, index), np.ones(spread.total)])
    return Directions(cosines, conserve(cosines, weights), reflectance)


@functools.lru_cache(maxsize=256)
def fewest_directions(tolerance: float, index: float, sizes: tuple[float, ...]) -> Spread:
    """Fewest directions for an accuracy.

    Args:
        tolerance: absolute error wanted.
        index: refractive index.
        sizes: Legendre moments of the phase functions, the largest of each in absolute value.

    Raises:
        ValueError: 96 directions are not enough.
    """
    for count in range(_FEWEST, _MOST + 1, 2):
        error, spread = _best(index, count, sizes)
        if error <= _SHARE * tolerance:
            return spread
    raise ValueError(
        f"no directions found for a tolerance of {tolerance:g} with {len(sizes)} Legendre moments; "
        "ask for a coarser one or give streams, such as streams=64"
    )


def best_directions(index: float, count: int, sizes: tuple[float, ...]) -> Spread:
    """The best way to spread a number of directions."""
    return _best(index, count, sizes)[1]


@functools.lru_cache(maxsize=256)
def _best(index: float, count: int, sizes: tuple[float, ...]) -> tuple[float, Spread]:
    moments = np.array(sizes)
    exact = _exact_sums(index, sizes)
    cones = {count} if index == 1.0 else {min(max(1, round(share * count)), count - 1) for share in _CONE_SHARES}
    tried = []
    for cone in cones:
        for crowding in _CROWDING:
            spread = Spread(cone, count - cone, crowding)
            sums = scattered_sums(spread_directions(index, spread), moments)
            tried.append((float(np.max(np.abs(sums - exact))), spread))
    return min(tried)


@functools.lru_cache(maxsize=64)
def _exact_sums(index: float, sizes: tuple[float, ...]) -> np.ndarray:
    return scattered_sums(spread_directions(index, Spread(_FINE, _FINE, _CROWDING[-1])), np.array(sizes))


def scattered_sums(rule: Directions, moments: Float[np.ndarray, "terms"]) -> Float[np.ndarray, "2 depths terms terms"]:
    """Sums made by light that scatters, travels to a depth t and scatters again: all of it, and that reflected above.

    sqrt((2l + 1)(2l' + 1)) chi_l chi_l' int P_l P_l' e^(-t/mu) dmu, and the same with the surface's reflectance.
    """
    mu, weights, reflectance = (np.asarray(a) for a in rule)
    orders = np.arange(moments.size)
    polynomials = np.polynomial.legendre.legvander(mu, moments.size - 1) * np.sqrt(2 * orders + 1) * moments
    fades = np.exp(-_DEPTHS[:, None] / mu) * weights
    return np.stack([(w[:, None, :] * polynomials.T) @ polynomials for w in (fades, fades * reflectance)])
