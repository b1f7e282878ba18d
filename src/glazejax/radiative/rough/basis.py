"""Directions inside the paint, and the polynomials that carry light between them: two panels of
Gauss nodes.

The upper panel ends at the critical angle, where a smooth surface begins to reflect all. What the
paint sends up is smooth across it, and singular where it grazes: there the lower panel's nodes
crowd.
"""

import functools
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Array, Float

from ...spectra import matmul
from ..common.fresnel import array_module, cos_refracted
from ..common.quadrature import conserve, gauss

# The upper panel reaches down to here at least, where an index near one has no critical angle to
# speak of.
LEAST_SPLIT = 0.2


class Size(NamedTuple):
    """Numbers of nodes; static."""

    upper: int
    lower: int
    crowding: float
    """c of the lower panel, mu = split (e^(c y) - 1)/(e^c - 1)."""
    incidence: int
    """Nodes of what depends on the angle in air."""
    beams: int
    """Beams a panel from inside the paint, whose reflection makes up the matrix."""
    facets: tuple[int, int]


class Basis(NamedTuple):
    """Nodes, and Lagrange's polynomials on them, panel by panel."""

    split: float
    size: Size
    cosines: Float[np.ndarray, "n"]
    """Descending."""
    weights: Float[np.ndarray, "n"]
    """With sum w = 1 and sum w mu = 1/2."""

    def values(self, cosines: Any) -> Any:
        """The polynomials at cosines (...): (..., n). Each is zero outside its own panel; beyond 0
        and 1 they go on as they end.
        """
        xp = array_module(cosines)
        upper = cosines >= self.split
        # Each panel has its own variable on [0, 1], in which its nodes are Gauss's.
        high = xp.clip((cosines - self.split) / (1.0 - self.split), 0.0, 1.0)
        scale = np.expm1(self.size.crowding)
        low = xp.log1p(xp.clip(cosines / self.split, 0.0, 1.0) * scale) / self.size.crowding
        polynomials = (lagrange(high, self.size.upper), lagrange(low, self.size.lower))
        masks = (upper[..., None], ~upper[..., None])
        return xp.concatenate(
            [xp.where(m, p, 0.0) for m, p in zip(masks, polynomials, strict=True)], axis=-1
        )


@functools.lru_cache(maxsize=64)
def basis(index: float, size: Size) -> Basis:
    """Nodes for one refractive index."""
    split = max(float(cos_refracted(0.0, index)), LEAST_SPLIT)
    x, x_weights = gauss(size.upper)
    y, y_weights = gauss(size.lower)
    c = size.crowding
    scale = np.expm1(size.crowding)
    # The lower panel's nodes crowd where light grazes; weights by the same substitution.
    cosines = np.concatenate([split + (1.0 - split) * x, split * np.expm1(c * y) / scale])
    weights = np.concatenate(
        [(1.0 - split) * x_weights, split * y_weights * c * np.exp(c * y) / scale]
    )
    return Basis(split, size, cosines, np.asarray(conserve(cosines, weights)))


def lagrange(x: Float[Array | np.ndarray, "*batch"], count: int) -> Any:
    """Lagrange's polynomials of Gauss' nodes on [0, 1] at x, (..., count), by sums of
    Legendre's.
    """
    xp = array_module(x)
    t = 2.0 * x - 1.0
    terms = [xp.ones_like(t), t]
    # Bonnet's recurrence.
    for k in range(1, count - 1):
        terms.append(((2 * k + 1) * t * terms[-1] - k * terms[-2]) / (k + 1))
    legendre = xp.stack(terms[:count], axis=-1)
    return matmul(xp, legendre, xp.asarray(_from_legendre(count), legendre.dtype))


@functools.lru_cache(maxsize=64)
def _from_legendre(count: int) -> np.ndarray:
    """Lagrange's polynomials in Legendre's, (count, count): Gauss' rule is exact for their
    products.
    """
    y, weights = gauss(count)
    at_nodes = np.polynomial.legendre.legvander(2.0 * y - 1.0, count - 1)
    # l_j = sum_k (2k + 1) w_j P_k(t_j) P_k, as the integral of P_k^2 over [0, 1] is 1/(2k + 1).
    return (2.0 * np.arange(count) + 1.0)[:, None] * (at_nodes * weights[:, None]).T
