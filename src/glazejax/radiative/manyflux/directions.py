"""Directions for scattering that is not isotropic, and how many of them an accuracy needs.

With any phase function the field in every direction counts, not just two sums over it
(`simultaneous`), so that every node carries its own Fresnel reflectance. Nodes that crowd towards
grazing suit layers of any thickness, nodes that are spread suit many Legendre moments. Between the
two the best is searched for, once for each case.
"""

import functools
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ..common.quadrature import Directions, Nodes, conserve, gauss, graded_gauss, split_range

# The largest error of the sums over directions may be this share of the tolerance.
_SHARE = 0.2
_FINE = 100
_FEWEST = 4
_MOST = 96
_DEPTHS = np.array([0.0, 0.01, 0.1, 1.0])
_CROWDING = (0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0)
_CONE_SHARES = (0.3, 0.35, 0.4, 0.5)
# Plain Gauss nodes, which keep off grazing directions: with a few more of them layers need far
# fewer doublings.
_PLAIN = -1.0
_MORE = 1.25
# A matrix product of n nodes takes about n to this power.
_WORK = 2.3


class Spread(NamedTuple):
    """Numbers of nodes that can leave and that are totally reflected, and how these
    crowd; static.
    """

    cone: int
    total: int
    crowding: float
    """Of the nodes that are not in the cone; negative for plain Gauss nodes."""


@functools.lru_cache(maxsize=256)
def spread_directions(index: float, spread: Spread) -> Directions:
    """Nodes inside a medium: Gauss nodes in the cosine outside for the cone of refraction, graded
    ones below.

    Args:
        index: refractive index. At 1 there is one graded rule of cone + total nodes.
        spread: numbers of nodes.
    """
    if index == 1.0:
        mu, weights = _nodes(spread.cone + spread.total, spread.crowding)
        return Directions(mu, conserve(mu, weights), np.zeros_like(mu))
    return split_range(index, gauss(spread.cone), _nodes(spread.total, spread.crowding))


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
            return _less_work(index, spread, _SHARE * tolerance, sizes)
    raise ValueError(
        f"no directions found for a tolerance of {tolerance:g} with {len(sizes)} Legendre moments; "
        "ask for a coarser one or give streams, such as streams=64"
    )


def best_directions(index: float, count: int, sizes: tuple[float, ...]) -> Spread:
    """The best way to spread a number of directions."""
    return _best(index, count, sizes)[1]


def _less_work(index: float, found: Spread, error: float, sizes: tuple[float, ...]) -> Spread:
    """Plain nodes instead, if a few more of them are as good and take less work."""

    def work(spread: Spread) -> float:
        return sum(spread[:2]) ** _WORK * -np.log2(np.min(spread_directions(index, spread).cosines))

    count = sum(found[:2])
    for more in range(count, int(_MORE * count) + 1, 2):
        missed, plain = _best(index, more, sizes, (_PLAIN,))
        if missed <= error:
            return min(found, plain, key=work)
    return found


def _nodes(count: int, crowding: float) -> Nodes:
    return gauss(count) if crowding < 0 else graded_gauss(count, crowding)


@functools.lru_cache(maxsize=256)
def _best(
    index: float, count: int, sizes: tuple[float, ...], crowdings: tuple[float, ...] = _CROWDING
) -> tuple[float, Spread]:
    moments = np.array(sizes)
    exact = _exact_sums(index, sizes)
    cones = (
        {count}
        if index == 1.0
        else {min(max(1, round(share * count)), count - 1) for share in _CONE_SHARES}
    )
    tried = []
    for cone in cones:
        for crowding in crowdings:
            spread = Spread(cone, count - cone, crowding)
            sums = scattered_sums(spread_directions(index, spread), moments)
            tried.append((float(np.max(np.abs(sums - exact))), spread))
    return min(tried)


@functools.lru_cache(maxsize=64)
def _exact_sums(index: float, sizes: tuple[float, ...]) -> np.ndarray:
    return scattered_sums(
        spread_directions(index, Spread(_FINE, _FINE, _CROWDING[-1])), np.array(sizes)
    )


def scattered_sums(
    rule: Directions, moments: Float[np.ndarray, "terms"]
) -> Float[np.ndarray, "2 depths terms terms"]:
    """Sums made by light that scatters, travels to a depth t and scatters again: all of it, and
    that reflected above.

    sqrt((2l + 1)(2l' + 1)) chi_l chi_l' int P_l P_l' e^(-t/mu) dmu, and the same with the surface's
    reflectance.
    """
    mu, weights, reflectance = (np.asarray(a) for a in rule)
    orders = np.arange(moments.size)
    polynomials = (
        np.polynomial.legendre.legvander(mu, moments.size - 1) * np.sqrt(2 * orders + 1) * moments
    )
    fades = np.exp(-_DEPTHS[:, None] / mu) * weights
    return np.stack(
        [(w[:, None, :] * polynomials.T) @ polynomials for w in (fades, fades * reflectance)]
    )
