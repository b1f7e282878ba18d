"""Chebyshev tables: a slowly varying function, computed at few nodes and interpolated everywhere else.

`thickness_table` makes one of any smooth function of one to three thicknesses. A reflectance is analytic in the
thickness of each layer but for a logarithm at zero, and levels off where a layer becomes opaque. A coordinate that
crowds where a layer is thin makes few points do; it is chosen by trial along each axis. Points are added, axis by
axis, until the error at fresh check points is small enough; points already computed are used again. The tables of
`glazejax.appearance.glaze` stand on the same coordinate, polynomials and rules; `xp` is numpy or jax.numpy.

Source: L. N. Trefethen, Approximation Theory and Approximation Practice (2013), chapters 2 to 8.
"""

import functools
import math
from collections.abc import Callable, Sequence
from types import ModuleType
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from numpy.polynomial import chebyshev

Function = Callable[[Float[np.ndarray, "points axes"]], Float[np.ndarray, "points channels"]]
"""What is interpolated; it gets many points at once."""
Distance = Callable[[Float[np.ndarray, "points channels"], Float[np.ndarray, "points channels"]], np.ndarray]
"""Error (points,) of approximate values against exact ones."""

MOST_AXES = 3

# Numbers of points along an axis, each nested in the next (Chebyshev's extrema).
_FIRST, _LAST = 5, 129
# A few, and where these are good enough, more.
_CHECKS = (32, 160)
# The worst of all points lies above the worst of the check points.
SAFETY = 2.0
# Axes whose last coefficients are within this factor of the largest are refined together.
_TOGETHER = 0.25
_SCAN = 25
_SCAN_DEGREE = 8
# Largest curvatures of the coordinate that are tried: the axis, in units of the thickness where it turns logarithmic.
CURVATURES = (1.0, 10.0, 100.0, 1e3, 1e4)
# Below this part of the axis the square root turns linear, so that slopes stay finite at zero.
_SOFT = 1e-5
# Numbers of one chunk of points in the table's evaluation.
_CHUNK_NUMBERS = 2**21


class Axis(NamedTuple):
    """One axis and the coordinate in which the function is close to a polynomial; numbers, or scalars of JAX."""

    low: Any
    high: Any
    curvature: Any = 0.0
    """0 (a Python number) for the coordinate x itself; else log(1 + sqrt(curvature x/high)), its root softened at
    zero."""

    def coordinate(self, x: Any, xp: ModuleType = jnp) -> Any:
        """From [low, high] to [-1, 1]."""
        a, b = self._stretch(self.low, xp), self._stretch(self.high, xp)
        return (2.0 * self._stretch(x, xp) - a - b) / (b - a)

    def _stretch(self, x: Any, xp: ModuleType) -> Any:
        if isinstance(self.curvature, float) and self.curvature == 0.0:
            return x
        soft = _SOFT * self.high
        return xp.log1p((xp.sqrt(x + soft) - xp.sqrt(soft)) * xp.sqrt(self.curvature / self.high))

    def point(self, coordinate: np.ndarray) -> np.ndarray:
        """From [-1, 1] to [low, high], for known numbers."""
        a, b = self._stretch(self.low, np), self._stretch(self.high, np)
        x = 0.5 * (a + b + coordinate * (b - a))
        if self.curvature != 0.0:
            soft = _SOFT * self.high
            x = (np.expm1(x) * math.sqrt(self.high / self.curvature) + math.sqrt(soft)) ** 2 - soft
        return np.clip(x, self.low, self.high)

    def held(self, x: Any, xp: ModuleType = jnp) -> Any:
        """x moved into the range, with a whole slope at its ends, where `clip` would halve it."""
        return xp.where(x < self.low, self.low, xp.where(x > self.high, self.high, x))


def roots(count: int) -> Float[np.ndarray, "nodes"]:
    """Nodes of the first kind in (-1, 1), ascending: for functions that the ends of the range would embarrass."""
    return -np.cos(np.pi * (np.arange(count) + 0.5) / count)


def extrema(count: int) -> Float[np.ndarray, "nodes"]:
    """Nodes of the second kind in [-1, 1], descending; those of n are among those of 2n - 1."""
    return np.cos(np.pi * np.arange(count) / (count - 1))


@functools.cache
def coefficients_from_nodes(nodes: Callable[[int], np.ndarray], count: int) -> Float[np.ndarray, "coefficients nodes"]:
    """Matrix from values at the nodes, `roots` or `extrema`, to Chebyshev coefficients."""
    return np.linalg.inv(chebyshev.chebvander(nodes(count), count - 1))


def polynomials(x: Any, count: int, xp: ModuleType = jnp) -> Any:
    """Chebyshev polynomials T_0 to T_(count - 1) at x, (points,): (points, count)."""
    rows = [xp.ones_like(x), x]
    while len(rows) < count:
        rows.append(2.0 * x * rows[-1] - rows[-2])
    return xp.stack(rows[:count], axis=-1)


def product(first: Any, second: Any, xp: ModuleType) -> Any:
    """Matrix product in full precision, on accelerators too."""
    return np.matmul(first, second) if xp is np else xp.matmul(first, second, precision="highest")


def trial_line(low: float, high: float) -> Float[np.ndarray, "points"]:
    """Points of an axis for `best_axis`, from evenly spaced at the top to crowded near the low end."""
    return low + (high - low) * np.linspace(0.0, 1.0, _SCAN) ** 3


def best_axis(
    axes: Sequence[Axis],
    line: Float[np.ndarray, "points"],
    values: Float[np.ndarray, "points n"],
    degree: int,
    gain: float = 1.0,
) -> Axis:
    """The axis in whose coordinate polynomials of a low degree come nearest to values along a line.

    Args:
        axes: candidates, the simplest first.
        line: see `trial_line`.
        values: at its points.
        degree: of the polynomials.
        gain: a later candidate must bring the error below this share of that of the best one before it.
    """
    best, least = axes[0], np.inf
    for axis in axes:
        basis = chebyshev.chebvander(axis.coordinate(line, np), degree)
        error = np.max(np.abs(values - basis @ np.linalg.lstsq(basis, values, rcond=None)[0]))
        if error < gain * least:
            best, least = axis, error
    return best


def axes_to_refine(tails: Sequence[float], room: Sequence[bool], together: float) -> list[bool]:
    """Axes whose last coefficients (`tails`) are large, among those with room for more nodes."""
    largest = max((tail for tail, more in zip(tails, room, strict=True) if more), default=0.0)
    return [more and tail >= together * largest for tail, more in zip(tails, room, strict=True)]


def in_pieces(function: Callable[[Array], Array], points: Float[Array, "points n"], size: int) -> Array:
    """A function of one point for many, about `size` at a time, so that memory stays bounded."""
    count, many = points.shape[0], jax.vmap(function)
    if count <= max(64, size):
        return many(points)
    # Equal pieces: `lax.map(batch_size=...)` compiles the function a second time, for what is left over.
    pieces = -(-count // max(64, size))
    padded = jnp.pad(points, ((0, -count % pieces), (0, 0)), mode="edge").reshape(pieces, -1, points.shape[1])
    values = jax.lax.map(many, padded)
    return values.reshape(-1, values.shape[-1])[:count]


class ThicknessTable(eqx.Module):
    """Interpolated function; call it with points (..., axes). Made by `thickness_table`."""

    coefficients: Float[Array, "..."]
    """Chebyshev coefficients, (n_1, ..., channels)."""
    axes: tuple[Axis, ...] = eqx.field(static=True)
    error: float = eqx.field(static=True)
    """Estimated largest error, in the distance asked for."""
    evaluations: int = eqx.field(static=True)
    """Points at which the function was computed, trial and check points included."""

    def __call__(self, points: Float[Array, "*batch axes"]) -> Float[Array, "*batch channels"]:
        """Interpolated values; differentiable by the points and jit-compiled.

        Args:
            points: (..., axes), within the axes; what lies beyond is moved to their ends.

        Returns:
            (..., channels). Work goes through the processor in pieces, so that memory stays bounded.

        Raises:
            ValueError: the last axis of `points` is not the table's number of axes.
        """
        if jnp.shape(points)[-1:] != (len(self.axes),):
            raise ValueError(f"points of shape {jnp.shape(points)} do not end in the table's {len(self.axes)} axes")
        return _evaluate(self, jnp.asarray(points, self.coefficients.dtype))

    def __repr__(self) -> str:
        shape = " x ".join(map(str, self.coefficients.shape[:-1]))
        return f"ThicknessTable({shape} points, estimated error {self.error:.2g})"


@eqx.filter_jit
def _evaluate(table: ThicknessTable, points: Array) -> Array:
    size = _CHUNK_NUMBERS // (math.prod(table.coefficients.shape[1:]) + sum(table.coefficients.shape))
    flat = points.reshape(-1, points.shape[-1])
    values = in_pieces(lambda point: _interpolate(table.coefficients, table.axes, point[None], jnp)[0], flat, size)
    return values.reshape(*points.shape[:-1], table.coefficients.shape[-1])


def _interpolate(coefficients: Any, axes: tuple[Axis, ...], points: Any, xp: ModuleType) -> Any:
    """Values (points, channels). Axis after axis: with few channels quicker than the products of all polynomials."""
    values = coefficients
    for k, axis in enumerate(axes):
        basis = polynomials(axis.coordinate(axis.held(points[:, k], xp), xp), coefficients.shape[k], xp)
        if k == 0:
            values = product(basis, values.reshape(basis.shape[1], -1), xp).reshape(-1, *values.shape[1:])
        else:
            values = xp.einsum("pi,pi...->p...", basis, values)
    return values


def thickness_table(
    function: Function,
    low: Float[np.ndarray, "axes"],
    high: Float[np.ndarray, "axes"],
    tolerance: float,
    *,
    distance: Distance | None = None,
    samples: Float[np.ndarray, "samples axes"] | None = None,
    most_points: int = 20000,
) -> ThicknessTable:
    """Interpolate a function of one to three thicknesses with controlled error.

    Args:
        function: from points (points, axes) to values (points, channels), numpy; smooth within the range.
        low, high: range of each axis, (axes,), 0 <= low < high.
        tolerance: largest error wanted, in units of `distance`.
        distance: error of approximate values against exact ones, (points,); the largest absolute difference of a
            channel if left out.
        samples: points the table will be used at, (samples, axes): check points are drawn from them. From the whole
            range if left out.
        most_points: stop refining beyond so many points; the table's ``error`` then says what was reached.

    Returns:
        `ThicknessTable`. Its ``error`` is twice the largest error at check points not used before.

    Raises:
        ValueError: no axes or more than three, or a range that is empty, negative or not finite.
    """
    low, high = np.atleast_1d(np.asarray(low, float)), np.atleast_1d(np.asarray(high, float))
    if not 1 <= low.size <= MOST_AXES or low.shape != high.shape:
        raise ValueError(f"a table has 1 to {MOST_AXES} axes, not {low.size} and {high.size} ends")
    for a, b in zip(low, high, strict=True):
        if not 0 <= a < b < np.inf:
            raise ValueError(f"the range {a:g} to {b:g} of an axis must be finite, not empty and not negative")
    distance = distance or (lambda one, two: np.max(np.abs(one - two), axis=-1))
    counter = _Counted(function)
    axes = tuple(_choose_axis(counter, k, low, high) for k in range(low.size))
    rng = np.random.default_rng(0)
    values = counter.grid(axes, [extrema(_FIRST)] * len(axes))
    while True:
        coefficients = _coefficients(values)
        error = 0.0
        for checks in _CHECKS:
            if samples is None:
                points = rng.uniform(low, high, (checks, low.size))
            else:
                points = samples[rng.integers(0, len(samples), checks)]
            guess = _interpolate(coefficients, axes, points, np)
            error = max(error, SAFETY * float(np.max(distance(guess, counter(points)))))
            if error > tolerance:
                break
        tails = [float(np.max(np.abs(np.moveaxis(coefficients, k, 0)[-2:]))) for k in range(low.size)]
        grow = axes_to_refine(tails, [n < _LAST for n in coefficients.shape[:-1]], _TOGETHER)
        after = math.prod(2 * n - 1 if g else n for n, g in zip(values.shape, grow, strict=False))
        if error <= tolerance or not any(grow) or after > most_points:
            dtype = jnp.result_type(float)
            return ThicknessTable(jnp.asarray(coefficients, dtype), axes, error, counter.count)
        for k, refine in enumerate(grow):
            if refine:
                values = _refine(counter, axes, values, k)


class _Counted:
    """The function, and how often it was called."""

    def __init__(self, function: Function):
        self.function, self.count = function, 0

    def __call__(self, points: np.ndarray) -> np.ndarray:
        self.count += len(points)
        return np.asarray(self.function(points), float)

    def grid(self, axes: tuple[Axis, ...], coordinates: list[np.ndarray]) -> np.ndarray:
        """Values on a tensor grid, (n_1, ..., channels)."""
        lines = [axis.point(x) for axis, x in zip(axes, coordinates, strict=True)]
        mesh = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1)
        return self(mesh.reshape(-1, len(axes))).reshape(*mesh.shape[:-1], -1)


def _choose_axis(function: _Counted, k: int, low: np.ndarray, high: np.ndarray) -> Axis:
    """The coordinate in which polynomials of a low degree come nearest, along two lines through the range."""
    line = trial_line(low[k], high[k])
    points = np.repeat((low + np.array([[0.1], [0.6]]) * (high - low))[:, None], _SCAN, axis=1)
    points[..., k] = line
    values = function(points.reshape(-1, low.size)).reshape(2, _SCAN, -1).transpose(1, 0, 2).reshape(_SCAN, -1)
    axes = [Axis(float(low[k]), float(high[k]), curvature) for curvature in (0.0, *CURVATURES[1:])]
    return best_axis(axes, line, values, _SCAN_DEGREE, gain=0.8)


def _coefficients(values: np.ndarray) -> np.ndarray:
    """Chebyshev coefficients of values at the extrema along all axes but the last."""
    for k, count in enumerate(values.shape[:-1]):
        values = np.moveaxis(np.tensordot(coefficients_from_nodes(extrema, count), values, (1, k)), 0, k)
    return values


def _refine(function: _Counted, axes: tuple[Axis, ...], values: np.ndarray, k: int) -> np.ndarray:
    """Twice the intervals along one axis; only the new points are computed."""
    count = 2 * values.shape[k] - 1
    coordinates = [extrema(n) for n in values.shape[:-1]]
    coordinates[k] = extrema(count)[1::2]
    new = np.moveaxis(function.grid(axes, coordinates), k, 0)
    out = np.empty((count, *new.shape[1:]))
    out[0::2], out[1::2] = np.moveaxis(values, k, 0), new
    return np.moveaxis(out, 0, k)
