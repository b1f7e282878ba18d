"""Polynomials through Chebyshev's nodes, and the coordinate in which a glaze's reflectance is close to one.

Small helpers of the glaze tables; `xp` is numpy or jax.numpy. Nodes are those of the first kind, ascending, so that
the ends of a range, where the solver may refuse a cosine of zero, are not among them.
"""

from types import ModuleType
from typing import Any, NamedTuple

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


def lagrange(x: Any, low: Any, high: Any, count: int, xp: ModuleType) -> Any:
    """Lagrange's polynomials of `count` nodes between `low` and `high` at x, (points,): (points, nodes)."""
    if count == 1:
        return xp.ones((*x.shape, 1), x.dtype)
    # By sums of Chebyshev polynomials: no division, so slopes are right at the nodes as well.
    rows = [xp.ones_like(x), (2.0 * x - low - high) / (high - low)]
    while len(rows) < count:
        rows.append(2.0 * rows[1] * rows[-1] - rows[-2])
    return product(xp.stack(rows, axis=-1), xp.asarray(coefficients_from_nodes(count), x.dtype), xp)


def product(first: Any, second: Any, xp: ModuleType) -> Any:
    """Matrix product in full precision, on accelerators too."""
    return np.matmul(first, second) if xp is np else xp.matmul(first, second, precision="highest")


def coefficients_from_nodes(count: int) -> Float[np.ndarray, "coefficients nodes"]:
    """Matrix from values at the nodes to Chebyshev coefficients."""
    angles = np.pi * (np.arange(count) + 0.5) / count
    matrix = np.cos(np.outer(np.arange(count), np.pi - angles)) * (2.0 / count)
    matrix[0] *= 0.5
    return matrix


def held(x: Any, span: Range, xp: ModuleType) -> Any:
    """x, moved to the ends of the range from beyond; unlike clip, with its full slope at the ends themselves."""
    return xp.where(x < span.low, span.low, xp.where(x > span.high, span.high, x))


def stretch(depth: Any, span: Range, xp: ModuleType) -> Any:
    """Coordinate in which the reflectance is nearly a polynomial: log(1 + sqrt(curvature d/high)), softened at 0."""
    soft = _SOFT * span.high
    root = (xp.sqrt(depth + soft) - xp.sqrt(soft)) * xp.sqrt(span.curvature / span.high)
    return xp.log1p(root)


def unstretch(low: float, high: float, share: np.ndarray, span: Range) -> np.ndarray:
    """Thicknesses at shares 0 to 1 of the stretched axis."""
    soft = _SOFT * float(span.high)
    root = np.expm1(low + share * (high - low)) * np.sqrt(float(span.high) / float(span.curvature)) + np.sqrt(soft)
    return root**2 - soft
