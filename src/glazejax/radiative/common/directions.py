"""Half-range quadratures fitted to the interface: which directions inside the medium are followed.

Only directions inside the medium matter to the operator. For an index that is a plain number they come from one rule
over the whole half range (`simultaneous`). An index that is an array, traced or differentiated by, gets a rule split
at the critical angle. Those inside the cone of refraction can leave; they are Gauss nodes in the cosine OUTSIDE, which
removes the square-root singularity of the internal reflectance at the critical angle. The rest are totally reflected;
there the field varies as exp(-depth/mu), so their nodes crowd towards grazing directions.
"""

import functools
from typing import NamedTuple

import jax
import numpy as np
from jaxtyping import Array, Float

from .fresnel import array_module, dielectric_reflectance
from .simultaneous import simultaneous_rule


class Resolution(NamedTuple):
    """How many nodes each part of the half range gets, cone + total in all; static."""

    cone: int
    """Nodes that can leave, in the outside cosine."""
    total: int
    """Totally reflected nodes; 0 only for an index of exactly one."""
    crowded: bool = False
    """Whether the cone's nodes crowd towards grazing too: needed as the index nears one."""
    crowding: float | None = None
    """If given: one rule for the whole half range with this crowding, whose conditions `cone` and `total` count."""


class Directions(NamedTuple):
    """Nodes inside the medium, cosines descending. A leading batch axis appears where n varies."""

    cosines: Array | np.ndarray  # (..., n), mu in (0, 1]
    weights: Array | np.ndarray  # (..., n), sum w = 1, sum w mu = 1/2
    reflectance: Array | np.ndarray  # (..., n), internal Fresnel reflectance R(mu)


# Crowding c of n = 2, 3, ... graded nodes that makes the largest error of int_0^1 x e^(-D/x) dx over all D, the
# slowest integral of a thin layer, smallest (`python -m benchmarks.calibrate_directions` prints the search).
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


@functools.lru_cache(maxsize=128)
def gauss(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Gauss-Legendre nodes (descending) and weights on [0, 1]; not to be written to."""
    y, w = np.polynomial.legendre.leggauss(count)
    return 0.5 * (1.0 - y), 0.5 * w


def graded_gauss(count: int, crowding: float | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Gauss nodes (descending) and weights on [0, 1] under x = (e^(c y^2) - 1)/(e^c - 1).

    Near zero x goes as y^2, so nodes crowd at grazing directions; towards one they spread out less than under y^2.
    ``crowding`` is c, by default the best one for the count.
    """
    y, w = gauss(count)
    c = _CROWDING[min(max(count, 2) - 2, len(_CROWDING) - 1)] if crowding is None else crowding
    if c == 0:
        return y**2, w * 2.0 * y
    scale = np.expm1(c)
    return np.expm1(c * y**2) / scale, w * 2.0 * c * y * np.exp(c * y**2) / scale


def half_range(refractive_index: float | Float[Array, "*batch"], resolution: Resolution) -> Directions:
    """Directions for media of index n under a smooth interface to air.

    Args:
        refractive_index: n >= 1, a number (the result is then numpy, double precision) or a JAX array (...), by
            which the result can be differentiated.
        resolution: node counts, static.

    Returns:
        `Directions`, arrays (..., cone + total).

    Raises:
        ValueError: a rule for the whole half range where the index is an array, or where there is no such rule.
    """
    if resolution.crowding is not None:
        return _whole_range(refractive_index, resolution)
    xp = array_module(refractive_index)
    n = refractive_index[..., None] if isinstance(refractive_index, jax.Array) else np.float64(refractive_index)
    outside, w_outside = graded_gauss(resolution.cone) if resolution.crowded else gauss(resolution.cone)
    excess = (n - 1.0) * (n + 1.0)
    if resolution.total:
        # At n = 1 the totally reflected part is empty; a sliver keeps 1/mu finite where n is an array.
        excess = xp.maximum(excess, 1e-18 if excess.dtype == np.float64 else 1e-11)
    cosines = xp.sqrt(excess + outside**2) / n
    weights = w_outside * outside / (n * n * cosines)
    reflectance = dielectric_reflectance(outside, n)
    if resolution.total:
        critical = xp.sqrt(excess) / n
        y, w = graded_gauss(resolution.total)
        cosines = xp.concatenate([cosines, critical * y], axis=-1)
        weights = xp.concatenate([weights, critical * w], axis=-1)
        beyond = xp.where(n > 1.0, 1.0, 0.0) * xp.ones(resolution.total)
        reflectance = xp.concatenate([reflectance, beyond], axis=-1)
    return Directions(cosines, conserve(cosines, weights), reflectance)


@functools.lru_cache(maxsize=64)
def _whole_range_of(index: float, resolution: Resolution) -> Directions:
    assert resolution.crowding is not None
    found = simultaneous_rule(index, resolution.total, resolution.cone, resolution.crowding)
    if found is None:
        raise ValueError(f"there are no directions for the whole half range of index {index:g} with {resolution}")
    return Directions(found.cosines, conserve(found.cosines, found.weights), found.reflectance)


def _whole_range(refractive_index: float | Float[Array, "*batch"], resolution: Resolution) -> Directions:
    if isinstance(refractive_index, jax.Array):
        raise ValueError("directions for the whole half range need an index that is a number; it is an array here")
    return _whole_range_of(float(refractive_index), resolution)


def conserve(
    cosines: Float[Array | np.ndarray, "*batch n"], weights: Float[Array | np.ndarray, "*batch n"]
) -> Float[Array | np.ndarray, "*batch n"]:
    """Weights with sum w = 1 and sum w mu = 1/2 exactly, by the smallest relative change.

    Without it an albedo of one would lose energy.
    """

    def moment(power):
        return array_module(weights).sum(weights * cosines**power, axis=-1)

    m0, m1, m2 = moment(0), moment(1), moment(2)
    miss0, miss1 = 1.0 - m0, 0.5 - m1
    determinant = m0 * m2 - m1 * m1
    constant = (miss0 * m2 - miss1 * m1) / determinant
    linear = (miss1 * m0 - miss0 * m1) / determinant
    return weights * (1.0 + constant[..., None] + linear[..., None] * cosines)
