"""A slowly varying function of one to three thicknesses, computed at few points and interpolated everywhere else.

Tensor Chebyshev interpolation: the reflectance of a stack, or any smooth function of it, is analytic in the
thickness of each layer but for a logarithm at zero, and levels off where a layer becomes opaque. A coordinate that
crowds where a layer is thin makes few points do; it is chosen by trial along each axis. Points are added, axis by
axis, until the error at fresh check points is small enough; points already computed are used again.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

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
_SAFETY = 2.0
# Axes whose last coefficients are within this factor of the largest are refined together.
_TOGETHER = 0.25
_SCAN = 25
_SCAN_DEGREE = 8
# Largest curvatures of the coordinate that are tried: the axis, in units of the thickness where it turns logarithmic.
_CURVATURES = (0.0, 10.0, 100.0, 1e3, 1e4)
# Below this part of the axis the square root turns linear, so that slopes stay finite at zero.
_SOFT = 1e-5
# Numbers of one chunk of points in the table's evaluation.
_CHUNK_NUMBERS = 2**21


class Axis(NamedTuple):
    """One axis and the coordinate in which the function is close to a polynomial."""

    low: float
    high: float
    curvature: float
    """0 for the coordinate x itself; else log(1 + sqrt(curvature x/high)), its root softened at zero."""

    def coordinate(self, x, xp=jnp):
        """From [low, high] to [-1, 1]."""
        a, b = self._stretch(self.low, np), self._stretch(self.high, np)
        return (2.0 * self._stretch(x, xp) - a - b) / (b - a)

    def _stretch(self, x, xp):
        if self.curvature == 0.0:
            return x
        soft = _SOFT * self.high
        root = (xp.sqrt(x + soft) - math.sqrt(soft)) * math.sqrt(self.curvature / self.high)
        return xp.log1p(root)

    def point(self, coordinate: np.ndarray) -> np.ndarray:
        """From [-1, 1] to [low, high]."""
        a, b = self._stretch(self.low, np), self._stretch(self.high, np)
        stretched = 0.5 * (a + b + coordinate * (b - a))
        if self.curvature != 0.0:
            soft = _SOFT * self.high
            root = np.expm1(stretched) * math.sqrt(self.high / self.curvature) + math.sqrt(soft)
            stretched = root**2 - soft
        return np.clip(stretched, self.low, self.high)


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
    def one(chunk: Array) -> Array:
        values = table.coefficients
        for k, axis in enumerate(table.axes):
            x = axis.coordinate(jnp.clip(chunk[:, k], axis.low, axis.high))
            basis = _basis(x, table.coefficients.shape[k])
            if k == 0:
                values = (basis @ values.reshape(basis.shape[1], -1)).reshape(-1, *values.shape[1:])
            else:
                values = jnp.einsum("pi,pi...->p...", basis, values)
        return values

    flat = points.reshape(-1, points.shape[-1])
    chunk = max(64, _CHUNK_NUMBERS // (math.prod(table.coefficients.shape[1:]) + sum(table.coefficients.shape)))
    pieces = max(1, -(-flat.shape[0] // chunk))
    size = -(-flat.shape[0] // pieces)
    padded = jnp.pad(flat, ((0, pieces * size - flat.shape[0]), (0, 0)), mode="edge") if flat.size else flat
    out = jax.lax.map(one, padded.reshape(pieces, size, -1)).reshape(pieces * size, -1)
    return out[: flat.shape[0]].reshape(*points.shape[:-1], -1)


def _basis(x: Array, count: int) -> Array:
    """Chebyshev polynomials T_0 to T_(count - 1), (points, count)."""
    rows = [jnp.ones_like(x), x]
    while len(rows) < count:
        rows.append(2.0 * x * rows[-1] - rows[-2])
    return jnp.stack(rows[:count], axis=1)


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

    Source: L. N. Trefethen, Approximation Theory and Approximation Practice (2013), chapters 2 to 8.
    """
    low, high = np.atleast_1d(np.asarray(low, float)), np.atleast_1d(np.asarray(high, float))
    if not 1 <= low.size <= MOST_AXES or low.shape != high.shape:
        raise ValueError(f"a table has 1 to {MOST_AXES} axes, not {low.size} and {high.size} ends")
    for a, b in zip(low, high, strict=True):
        if not 0 <= a < b < np.inf:
            raise ValueError(f"the range {a:g} to {b:g} of an axis must be finite, not empty and not negative")
    distance = distance or (lambda one, two: np.max(np.abs(one - two), axis=-1))
    counter = _Counted(function)
    axes = tuple(_best_axis(counter, k, low, high) for k in range(low.size))
    rng = np.random.default_rng(0)
    values = counter.grid(axes, [_extrema(_FIRST)] * len(axes))
    while True:
        coefficients = _coefficients(values)
        error = 0.0
        for checks in _CHECKS:
            if samples is None:
                points = rng.uniform(low, high, (checks, low.size))
            else:
                points = samples[rng.integers(0, len(samples), checks)]
            guess = _interpolate(coefficients, axes, points)
            error = max(error, _SAFETY * float(np.max(distance(guess, counter(points)))))
            if error > tolerance:
                break
        grow = _axes_to_refine(coefficients)
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


def _best_axis(function: _Counted, k: int, low: np.ndarray, high: np.ndarray) -> Axis:
    """The coordinate in which polynomials of a low degree come nearest, along two lines through the range."""
    # From evenly spaced at the top to crowded near zero.
    line = low[k] + (high[k] - low[k]) * np.linspace(0.0, 1.0, _SCAN) ** 3
    points = np.repeat((low + np.array([[0.1], [0.6]]) * (high - low))[:, None], _SCAN, axis=1)
    points[..., k] = line
    values = function(points.reshape(-1, low.size)).reshape(2, _SCAN, -1).transpose(1, 0, 2).reshape(_SCAN, -1)
    best, least = None, np.inf
    for curvature in _CURVATURES:
        axis = Axis(float(low[k]), float(high[k]), curvature)
        basis = chebyshev.chebvander(axis.coordinate(line, np), _SCAN_DEGREE)
        miss = np.max(np.abs(values - basis @ np.linalg.lstsq(basis, values, rcond=None)[0]))
        if best is None or miss < 0.8 * least:  # the simpler coordinate unless another one is clearly better
            best, least = axis, miss
    assert best is not None
    return best


def _extrema(count: int) -> np.ndarray:
    return np.cos(np.pi * np.arange(count) / (count - 1))


def _coefficients(values: np.ndarray) -> np.ndarray:
    """Chebyshev coefficients of values at the extrema along all axes but the last."""
    for k in range(values.ndim - 1):
        n = values.shape[k] - 1
        transform = np.cos(np.pi * np.outer(np.arange(n + 1), np.arange(n + 1)) / n) * (2.0 / n)
        transform[:, [0, -1]] *= 0.5
        transform[[0, -1]] *= 0.5
        values = np.moveaxis(np.tensordot(transform, values, (1, k)), 0, k)
    return values


def _interpolate(coefficients: np.ndarray, axes: tuple[Axis, ...], points: np.ndarray) -> np.ndarray:
    """As the table does it, in double precision."""
    counts = coefficients.shape[:-1]
    bases = [chebyshev.chebvander(a.coordinate(x, np), n - 1) for a, x, n in zip(axes, points.T, counts, strict=True)]
    values = np.tensordot(bases[0], coefficients, 1)
    for basis in bases[1:]:
        values = np.einsum("pi,pi...->p...", basis, values)
    return values


def _axes_to_refine(coefficients: np.ndarray) -> list[bool]:
    """Axes whose last coefficients are large, among those that may still grow."""
    axes = range(coefficients.ndim - 1)
    tails = [np.max(np.abs(np.moveaxis(coefficients, k, 0)[-2:])) for k in axes]
    may = [coefficients.shape[k] < _LAST for k in axes]
    largest = max((tail for tail, ok in zip(tails, may, strict=True) if ok), default=0.0)
    return [ok and tail >= _TOGETHER * largest for tail, ok in zip(tails, may, strict=True)]


def _refine(function: _Counted, axes: tuple[Axis, ...], values: np.ndarray, k: int) -> np.ndarray:
    """Twice the intervals along one axis; only the new points are computed."""
    count = 2 * values.shape[k] - 1
    coordinates = [_extrema(n) for n in values.shape[:-1]]
    coordinates[k] = _extrema(count)[1::2]
    new = np.moveaxis(function.grid(axes, coordinates), k, 0)
    out = np.empty((count, *new.shape[1:]))
    out[0::2], out[1::2] = np.moveaxis(values, k, 0), new
    return np.moveaxis(out, 0, k)
