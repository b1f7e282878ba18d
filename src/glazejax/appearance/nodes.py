"""Polynomials through Chebyshev's nodes, and the coordinates in which a glaze's reflectance is close to one.

Small helpers of `glaze_material`. Nodes are those of the first kind, ascending, so that the ends of a range, where the
solver may refuse a cosine of zero, are not among them.
"""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

# Below this part of the axis its square root turns linear, so that slopes stay finite at zero.
_SOFT = 1e-5


class Range(NamedTuple):
    """One axis of a table; all fields are numbers or scalars of JAX."""

    low: Array | float
    high: Array | float
    curvature: Array | float = 1.0
    """Of the thickness axis, see `stretch`; not used for cosines."""


def unit_nodes(count: int) -> Float[np.ndarray, "nodes"]:
    """First-kind nodes on [0, 1], ascending."""
    return 0.5 * (1.0 - np.cos(np.pi * (np.arange(count) + 0.5) / count))


def lagrange(x: Array, low: Array, high: Array, count: int) -> Float[Array, "points nodes"]:
    """Lagrange's polynomials of Chebyshev's first-kind nodes between `low` and `high`, ascending, at x (points,)."""
    if count == 1:
        return jnp.ones((*x.shape, 1), x.dtype)
    # By sums of Chebyshev polynomials: no division, so slopes are right at the nodes as well.
    rows = [jnp.ones_like(x), (2.0 * x - low - high) / (high - low)]
    while len(rows) < count:
        rows.append(2.0 * rows[1] * rows[-1] - rows[-2])
    transform = jnp.asarray(coefficients_from_nodes(count), x.dtype)
    return jnp.matmul(jnp.stack(rows, axis=-1), transform, precision="highest")


def coefficients_from_nodes(count: int) -> Float[np.ndarray, "coefficients nodes"]:
    """Chebyshev coefficients of values at the first-kind nodes, ascending."""
    angles = np.pi * (np.arange(count) + 0.5) / count
    matrix = np.cos(np.outer(np.arange(count), np.pi - angles)) * (2.0 / count)
    matrix[0] *= 0.5
    return matrix


def stretch(depth, span: Range, xp=jnp):
    """Coordinate in which the reflectance is nearly a polynomial: log(1 + sqrt(curvature d/high)), softened at 0."""
    soft = _SOFT * span.high
    root = (xp.sqrt(depth + soft) - xp.sqrt(soft)) * xp.sqrt(span.curvature / span.high)
    return xp.log1p(root)


def unstretch(low: float, high: float, share: np.ndarray, span: Range) -> np.ndarray:
    """Thicknesses at shares 0 to 1 of the stretched axis."""
    soft = _SOFT * float(span.high)
    root = np.expm1(low + share * (high - low)) * np.sqrt(float(span.high) / float(span.curvature)) + np.sqrt(soft)
    return root**2 - soft
