"""Directions for scattering that is not isotropic, and how many of them an accuracy needs.

With any phase function the field in every direction counts, not just two sums over it
(`simultaneous`), so that every node carries its own Fresnel reflectance. Nodes that crowd towards
grazing suit layers of any thickness, nodes that are spread suit many Legendre moments. Between the
two the best is searched for, once for each case.
"""

import functools
from collections.abc import Callable, Iterable
from typing import NamedTuple, TypeAlias, TypeVar

import numpy as np
from jaxtyping import Float

from ..common.quadrature import Directions, Nodes, conserve, gauss, graded_gauss, split_range

Rule = TypeVar("Rule")
MomentSizes: TypeAlias = tuple[float, ...]
"""Legendre moments of the phase functions, the largest of each in absolute value."""

_CROWDING = (0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0)


class NodeSpread(NamedTuple):
    """Numbers of nodes that can leave and that are totally reflected, and how these
    crowd; static.
    """

    cone: int
    total: int
    crowding: float
    """Of the nodes that are not in the cone; negative for plain Gauss nodes."""


@functools.lru_cache(maxsize=256)
def spread_directions(index: float, spread: NodeSpread) -> Directions:
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
def fewest_directions(
    tolerance: float, index: float, sizes: MomentSizes, streams: int | None
) -> NodeSpread:
    """Fewest directions for an accuracy, or the best way to spread a number of them.

    Args:
        tolerance: absolute error wanted.
        index: refractive index.
        sizes: of the moments, see `MomentSizes`.
        streams: number of directions, if it is given.

    Raises:
        ValueError: 96 directions are not enough.
    """
    if streams is not None:
        return _best(index, streams, sizes)[1]
    spread = first_good(
        (_best(index, count, sizes) for count in range(4, 97, 2)), tolerance, len(sizes)
    )
    # Plain Gauss nodes, which keep off grazing directions, instead: with a few more of them, if
    # they are as good, layers need far fewer doublings.
    count = spread.cone + spread.total
    for larger in range(count, int(1.25 * count) + 1, 2):
        missed, plain = _best(index, larger, sizes, (-1.0,))
        if missed <= allowed_error(tolerance):
            return min(spread, plain, key=functools.partial(_work, index))
    return spread


def _work(index: float, spread: NodeSpread) -> float:
    # A matrix product of n nodes takes about n to the power of 2.3, once for each doubling.
    grazing = np.min(spread_directions(index, spread).cosines)
    return (spread.cone + spread.total) ** 2.3 * -np.log2(grazing)


def allowed_error(tolerance: float) -> float:
    """Largest error of the sums over directions, a share of an accuracy."""
    return 0.2 * tolerance


def first_good(
    rules: Iterable[tuple[float, Rule]], tolerance: float, terms: int, where: str = ""
) -> Rule:
    """The first rule, each after its error, that is good enough for an accuracy.

    Raises:
        ValueError: none is, of so many Legendre moments.
    """
    for error, rule in rules:
        if error <= allowed_error(tolerance):
            return rule
    raise ValueError(
        f"no directions found for a tolerance of {tolerance:g} with {terms} Legendre moments"
        f"{where}; ask for a coarser one or give streams, such as streams=64"
    )


def best_rule(
    rules: Iterable[Rule], sums: Callable[[Rule], np.ndarray], exact: np.ndarray
) -> tuple[float, Rule]:
    """The rule whose sums over scattered light are nearest to exact ones, after its error."""
    return min((float(np.max(np.abs(sums(rule) - exact))), rule) for rule in rules)


def _nodes(count: int, crowding: float) -> Nodes:
    return gauss(count) if crowding < 0 else graded_gauss(count, crowding)


@functools.lru_cache(maxsize=256)
def _best(
    index: float, count: int, sizes: MomentSizes, crowdings: tuple[float, ...] = _CROWDING
) -> tuple[float, NodeSpread]:
    # Shares of the nodes in the cone of refraction to try; at an index of 1 all light can leave.
    cones = (
        {count}
        if index == 1.0
        else {min(max(1, round(share * count)), count - 1) for share in (0.3, 0.35, 0.4, 0.5)}
    )
    spreads = [NodeSpread(cone, count - cone, crowding) for cone in cones for crowding in crowdings]
    return best_rule(
        spreads, functools.partial(_sums, index, sizes=sizes), _exact_sums(index, sizes)
    )


@functools.lru_cache(maxsize=64)
def _exact_sums(index: float, sizes: MomentSizes) -> np.ndarray:
    # A fine rule stands for the exact sums.
    return _sums(index, NodeSpread(100, 100, _CROWDING[-1]), sizes)


def _sums(index: float, spread: NodeSpread, sizes: MomentSizes) -> np.ndarray:
    return scattered_sums(spread_directions(index, spread), np.array(sizes))


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
    # Optical depths between the two events: near ones weigh grazing light, far ones steep light.
    depths = np.array([0.0, 0.01, 0.1, 1.0])
    fades = np.exp(-depths[:, None] / mu) * weights
    return np.stack(
        [(w[:, None, :] * polynomials.T) @ polynomials for w in (fades, fades * reflectance)]
    )
