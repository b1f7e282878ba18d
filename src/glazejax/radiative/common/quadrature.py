"""Quadrature over the half range: Gauss nodes, plain or crowded, and rules split at the critical
angle.
"""

import functools
from typing import Any, NamedTuple, TypeAlias

import jax
import numpy as np
from jaxtyping import Array, Float

from .fresnel import array_module, dielectric_reflectance

Nodes: TypeAlias = tuple[Float[np.ndarray, "n"], Float[np.ndarray, "n"]]
"""Nodes and weights on [0, 1]."""
PerNode: TypeAlias = Float[Array | np.ndarray, "*batch n"]
"""A number a node, NumPy's where the index is a number."""


class Directions(NamedTuple):
    """Nodes inside the medium, cosines descending. A leading batch axis appears where n varies."""

    cosines: PerNode  # (..., n), mu in (0, 1]
    weights: PerNode  # (..., n), sum w = 1, sum w mu = 1/2
    reflectance: PerNode  # (..., n), internal Fresnel reflectance R(mu)


# Crowding c of n = 2, 3, ... graded nodes that makes the largest error of int_0^1 x e^(-D/x) dx
# over all D, the slowest integral of a thin layer, smallest (`python -m
# benchmarks.solver.calibrate_directions` prints the search). fmt: off
_CROWDING = (
    0.0,
    0.3,
    0.6,
    1.1,
    1.4,
    1.7,
    2.0,
    2.2,
    2.4,
    2.6,
    2.8,
    3.0,
    3.1,
    3.3,
    3.5,
    3.6,
    3.8,
    3.9,
    4.1,
    4.2,
    4.4,
    4.5,
    4.6,
)
# fmt: on


@functools.lru_cache(maxsize=128)
def gauss(count: int) -> Nodes:
    """Gauss-Legendre nodes (descending) and weights on [0, 1]; not to be written to."""
    y, w = np.polynomial.legendre.leggauss(count)
    return 0.5 * (1.0 - y), 0.5 * w


def gauss_crowded_at_ends(count: int) -> Nodes:
    """Gauss nodes (descending) and weights on [0, 1] under x = y^2 (3 - 2 y)."""
    y, w = gauss(count)
    return y * y * (3.0 - 2.0 * y), w * 6.0 * y * (1.0 - y)


def graded_gauss(count: int, crowding: float | None = None) -> Nodes:
    """Gauss nodes (descending) and weights on [0, 1] under x = (e^(c y^2) - 1)/(e^c - 1).

    Near zero x goes as y^2, so nodes crowd at grazing directions; towards one they spread out less
    than under y^2.
    ``crowding`` is c, by default the best one for the count.
    """
    y, w = gauss(count)
    c = _CROWDING[min(max(count, 2) - 2, len(_CROWDING) - 1)] if crowding is None else crowding
    if c == 0:
        return y**2, w * 2.0 * y
    scale = np.expm1(c)
    return np.expm1(c * y**2) / scale, w * 2.0 * c * y * np.exp(c * y**2) / scale


def split_range(
    refractive_index: float | Float[Array, "*batch"],
    outside: Nodes,
    below: tuple[Float[np.ndarray, "m"], Float[np.ndarray, "m"]] | None,
    reach: float | None = None,
) -> Directions:
    """Rule for the whole half range in a medium, split at the critical angle.

    Args:
        refractive_index: n >= 1, a number (the result is then numpy) or a JAX array (...).
        outside: nodes in the cosine outside, for the directions that can leave.
        below: nodes in the cosine inside over that of the critical angle, for the others; None
            leaves these out.
        reach: if given, ``outside`` counts in the variable of `_along_the_rise` instead, over at
            most this range.
    """
    xp = array_module(refractive_index)
    n = (
        refractive_index[..., None]
        if isinstance(refractive_index, jax.Array)
        else np.float64(refractive_index)
    )
    excess = (n - 1.0) * (n + 1.0)
    if below is not None or reach is not None:
        # At n = 1 the totally reflected part is empty; a sliver keeps 1/mu finite where n is an
        # array.
        excess = xp.maximum(excess, 1e-18 if excess.dtype == np.float64 else 1e-11)
    cos_outside, w_outside = outside if reach is None else _along_the_rise(excess, outside, reach)
    # Snell's law: the cosine inside of each outside, and the weight of its interval there.
    cosines = xp.sqrt(excess + cos_outside**2) / n
    weights = w_outside * cos_outside / (n * n * cosines)
    reflectance = dielectric_reflectance(cos_outside, n)
    if below is not None:
        # Beyond the critical angle all light is reflected, but for an index of one.
        critical = xp.sqrt(excess) / n
        cosines = xp.concatenate([cosines, critical * below[0]], axis=-1)
        weights = xp.concatenate([weights, critical * below[1]], axis=-1)
        beyond = xp.where(n > 1.0, 1.0, 0.0) * xp.ones(below[0].size)
        reflectance = xp.concatenate([reflectance, beyond], axis=-1)
    if reach is None:
        return Directions(cosines, conserve(cosines, weights), reflectance)
    return Directions(
        cosines, _conserve_at_grazing(cosines, weights, 2.0 * np.exp(-reach)), reflectance
    )


def _along_the_rise(excess: Any, nodes: Nodes, reach: float) -> tuple[Any, Any]:
    """Cosines outside and their weights, evenly spread where the internal reflectance rises.

    With c = s sinh(t), s^2 = n^2 - 1, Fresnel's amplitude of one polarisation is -exp(-2 t),
    exactly, and the other is as smooth, however near n is to one. The whole cone is t in [0,
    arsinh(1/s)]; ``reach`` bounds it.

    Args:
        excess: n^2 - 1, (..., 1) or a number, > 0.
        nodes: nodes and weights on [0, 1].
        reach: longest range of t. An index with arsinh(1/s) beyond it rises between the last node
            and grazing.
    """
    xp = array_module(excess)
    span = xp.minimum(xp.arcsinh(1.0 / xp.sqrt(excess)), excess.dtype.type(reach))
    y, weights = (column.astype(excess.dtype) for column in nodes)
    scale = xp.sinh(span)
    return xp.sinh(span * y) / scale, weights * span * xp.cosh(span * y) / scale


def _conserve_at_grazing(cosines: Any, weights: Any, grazing: float) -> Any:
    """Weights with sum w = 1 and sum w mu = 1/2, what is missing of the first put where light
    grazes.

    A rise that falls between the nodes costs the first sum what it has no business to take from
    other directions.
    ``grazing`` is the cosine about which it is.
    """
    xp = array_module(weights)
    # Two unknowns for two sums: a factor of all weights, and an addition that dies out above
    # `grazing`.
    grazing_weights = weights / (1.0 + (cosines / grazing) ** 2)
    total = xp.sum(weights, axis=-1, keepdims=True)
    flux = xp.sum(weights * cosines, axis=-1, keepdims=True)
    grazing_total = xp.sum(grazing_weights, axis=-1, keepdims=True)
    grazing_flux = xp.sum(grazing_weights * cosines, axis=-1, keepdims=True)
    determinant = grazing_total * flux - grazing_flux * total
    added = ((1.0 - total) * flux - (0.5 - flux) * total) / determinant
    scaled = ((0.5 - flux) * grazing_total - (1.0 - total) * grazing_flux) / determinant
    return weights * (1.0 + scaled) + grazing_weights * added


def conserve(cosines: PerNode, weights: PerNode) -> PerNode:
    """Weights with sum w = 1 and sum w mu = 1/2 exactly, by the smallest relative change.

    Without it an albedo of one would lose energy.
    """

    def moment(power):
        return array_module(weights).sum(weights * cosines**power, axis=-1)

    m0 = moment(0)
    m1 = moment(1)
    m2 = moment(2)
    miss0 = 1.0 - m0
    miss1 = 0.5 - m1
    determinant = m0 * m2 - m1 * m1
    # w (1 + a + b mu), with a and b by the two conditions.
    constant = (miss0 * m2 - miss1 * m1) / determinant
    linear = (miss1 * m0 - miss0 * m1) / determinant
    return weights * (1.0 + constant[..., None] + linear[..., None] * cosines)
