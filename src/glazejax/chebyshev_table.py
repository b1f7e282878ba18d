"""Elements of Chebyshev tables: nodes, polynomials, coordinates, and where more nodes are wanted.

A reflectance is analytic in the thickness of each layer but for a logarithm at zero, and levels off
where a layer becomes opaque. A coordinate that crowds where a layer is thin makes few points do; it
is chosen by trial along each axis. `glazejax.interpolated` and the tables of `glazejax.appearance`
stand on this; `xp` is numpy, jax.numpy, or (for coordinates) whatever has their functions.

Source: L. N. Trefethen, Approximation Theory and Approximation Practice (2013), chapters 2 to 8.
"""

import functools
import math
from collections.abc import Callable, Sequence
from types import ModuleType
from typing import Any, NamedTuple, TypeVar

import numpy as np
from jaxtyping import Float
from numpy.polynomial import chebyshev

# The worst of all points lies above the worst of the check points.
SAFETY = 2.0
# Largest curvatures of the coordinate that are tried: the axis, in units of the thickness where it
# turns logarithmic.
CURVATURES = (1.0, 10.0, 100.0, 1e3, 1e4)
# Below this part of the axis the square root turns linear, so that slopes stay finite at zero.
_SOFT = 1e-5


class Axis(NamedTuple):
    """One axis and the coordinate in which the function is close to a polynomial; numbers, or
    scalars of JAX.
    """

    low: Any
    high: Any
    curvature: Any = 0.0
    """0 (a Python number) for the coordinate x itself; else log(1 + sqrt(curvature x/high)), its
    root softened at zero."""

    def coordinate(self, x: Any, xp: Any) -> Any:
        """From [low, high] to [-1, 1]."""
        a = self._stretch(self.low, xp)
        b = self._stretch(self.high, xp)
        return (2.0 * self._stretch(x, xp) - a - b) / (b - a)

    def _stretch(self, x: Any, xp: Any) -> Any:
        if isinstance(self.curvature, float) and self.curvature == 0.0:
            return x
        soft = _SOFT * self.high
        return xp.log1p((xp.sqrt(x + soft) - xp.sqrt(soft)) * xp.sqrt(self.curvature / self.high))

    def point(self, coordinate: np.ndarray) -> np.ndarray:
        """From [-1, 1] to [low, high], for known numbers."""
        a = self._stretch(self.low, np)
        b = self._stretch(self.high, np)
        x = 0.5 * (a + b + coordinate * (b - a))
        # Back through the logarithm and the softened root.
        if self.curvature != 0.0:
            soft = _SOFT * self.high
            x = (np.expm1(x) * math.sqrt(self.high / self.curvature) + math.sqrt(soft)) ** 2 - soft
        return np.clip(x, self.low, self.high)

    def clamp(self, x: Any, xp: ModuleType) -> Any:
        """x moved into the range, with a whole slope at its ends, where `clip` would halve it."""
        return xp.where(x < self.low, self.low, xp.where(x > self.high, self.high, x))


class Mirrored(NamedTuple):
    """An axis that crowds towards its upper end, by the distance from it; numbers."""

    low: float
    high: float
    curvature: float

    def _from_above(self) -> Axis:
        return Axis(0.0, self.high - self.low, self.curvature)

    def coordinate(self, x: Any, xp: Any) -> Any:
        """From [low, high] to [-1, 1]."""
        return -self._from_above().coordinate(self.high - x, xp)

    def point(self, coordinate: np.ndarray) -> np.ndarray:
        """From [-1, 1] to [low, high]."""
        return np.clip(self.high - self._from_above().point(-coordinate), self.low, self.high)

    def clamp(self, x: Any, xp: ModuleType) -> Any:
        """Clamp as `Axis.clamp` does."""
        return Axis(self.low, self.high).clamp(x, xp)


_Axis = TypeVar("_Axis", bound=Axis | Mirrored)


def roots(count: int) -> Float[np.ndarray, "nodes"]:
    """Nodes of the first kind in (-1, 1), ascending: for functions that the ends of the range would
    embarrass.
    """
    return -np.cos(np.pi * (np.arange(count) + 0.5) / count)


def extrema(count: int) -> Float[np.ndarray, "nodes"]:
    """Nodes of the second kind in [-1, 1], descending; those of n are among those of 2n - 1."""
    return np.cos(np.pi * np.arange(count) / (count - 1))


@functools.cache
def coefficients_from_nodes(
    nodes: Callable[[int], np.ndarray], count: int
) -> Float[np.ndarray, "coefficients nodes"]:
    """Matrix from values at the nodes, `roots` or `extrema`, to Chebyshev coefficients."""
    return np.linalg.inv(chebyshev.chebvander(nodes(count), count - 1))


def series_coefficients(values: Float[np.ndarray, "..."], axes: int) -> Float[np.ndarray, "..."]:
    """Chebyshev coefficients of values at the extrema, along the first axes."""
    for k, count in enumerate(values.shape[:axes]):
        values = along_axis(coefficients_from_nodes(extrema, count), values, k)
    return values


def along_axis(
    matrix: Float[np.ndarray, "rows columns"], values: np.ndarray, axis: int
) -> np.ndarray:
    """The matrix times the values along one axis."""
    return np.moveaxis(np.tensordot(matrix, values, (1, axis)), 0, axis)


def polynomials(x: Any, count: int, xp: ModuleType, axis: int = -1) -> Any:
    """Chebyshev polynomials T_0 to T_(count - 1) at x, (points,): (points, count), or (count,
    points) on axis 0.
    """
    rows = [xp.ones_like(x), x]
    while len(rows) < count:
        rows.append(2.0 * x * rows[-1] - rows[-2])
    return xp.stack(rows[:count], axis=axis)


def trial_line(low: float, high: float, *, both_ends: bool = False) -> Float[np.ndarray, "points"]:
    """Points of an axis for `best_axis`, crowded near the low end, or near both."""
    u = np.linspace(0.0, 1.0, 25)
    return low + (high - low) * (
        np.where(u < 0.5, 4.0 * u**3, 1.0 - 4.0 * (1.0 - u) ** 3) if both_ends else u**3
    )


def best_axis(
    axes: Sequence[_Axis],
    line: Float[np.ndarray, "points"],
    values: Float[np.ndarray, "points n"],
    degree: int,
    gain: float = 1.0,
) -> _Axis:
    """The axis in whose coordinate polynomials of a low degree come nearest to values along a line.

    Args:
        axes: candidates, the simplest first.
        line: see `trial_line`.
        values: at its points.
        degree: of the polynomials.
        gain: a later candidate must bring the error below this share of that of the best one before
            it.
    """
    best = axes[0]
    least = np.inf
    for axis in axes:
        # Least squares, in the polynomials of this axis's coordinate.
        basis = chebyshev.chebvander(axis.coordinate(line, np), degree)
        error = np.max(np.abs(values - basis @ np.linalg.lstsq(basis, values, rcond=None)[0]))
        if error < gain * least:
            best = axis
            least = error
    return best


def axes_to_refine(tails: Sequence[float], room: Sequence[bool], together: float) -> list[bool]:
    """Axes whose last coefficients (`tails`) are large, among those with room for more nodes."""
    largest = float(np.max(tails, where=room, initial=0.0))
    return [
        has_room and tail >= together * largest for tail, has_room in zip(tails, room, strict=True)
    ]
