"""Smooth parameters: a function of a few numbers, computed at few points and interpolated for
millions.

`interpolated` makes a Chebyshev table of any smooth function of one to three parameters, such as
the colour of a glaze against the thickness of a coat and the share of a paint. Nodes are added,
axis by axis, until the error at points that had no part in the table is small enough; what was
computed is used again. Terms that the error does not feel are dropped at the end. The pieces are in
`chebyshev_table`.

Source: L. N. Trefethen, Approximation Theory and Approximation Practice (2013), chapters 2 to 8.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Mapping
from types import ModuleType
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.custom_derivatives import SymbolicZero
from jaxtyping import Array, DTypeLike, Float

from .chebyshev_table import (
    CURVATURES,
    SAFETY,
    Axis,
    Mirrored,
    axes_to_refine,
    best_axis,
    extrema,
    polynomials,
    series_coefficients,
    trial_line,
)
from .radiative.common.chunks import by_blocks, on_all_cores, on_cpu
from .spectra import Numbers, as_float_array, concrete, matmul

Distance = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""Error (points,) of approximate values (points, ...) against exact ones."""

MOST_AXES = 3

# A few check points, and where these are good enough, more.
_CHECKS = (32, 160)
# Numbers of one piece of points in the table's evaluation: what a core's second-level cache holds;
# on other devices only the memory counts.
_PIECE_NUMBERS = 2**17
_PIECE_ELSEWHERE = 2**26
# So many known points go to all cores at once.
_MANY = 2**16
# Up to so many channels the axes are summed one after the other; with more the products of all
# polynomials are fewer.
_FEW_CHANNELS = 8


class Interpolated(eqx.Module):
    """An interpolated function of one to three named parameters, made by `interpolated`; a pytree.

    Attributes:
        coefficients: Chebyshev coefficients, (n_1, ..., channels), the only leaf.
        names: parameters, in the order of positional arguments.
        error: estimated largest error within the ranges, in units of the distance asked for: twice
            the largest at points that had no part in the table. An estimate, no bound: what is
            narrower than the gaps between some 200 points can hide. Errors of the function itself,
            such as a solver's tolerance, are not in it.
        tolerance: what was asked for.
        evaluations: points at which the function was computed, trial and check points included.
        shape: shape of one value.
    """

    coefficients: Float[Array, "..."]
    axes: tuple[Axis | Mirrored, ...] = eqx.field(static=True)
    names: tuple[str, ...] = eqx.field(static=True)
    shape: tuple[int, ...] = eqx.field(static=True)
    error: float = eqx.field(static=True)
    tolerance: float = eqx.field(static=True)
    evaluations: int = eqx.field(static=True)

    @property
    def ranges(self) -> dict[str, tuple[float, float]]:
        """(low, high) of each parameter."""
        return {
            name: (axis.low, axis.high) for name, axis in zip(self.names, self.axes, strict=True)
        }

    @property
    def converged(self) -> bool:
        """Test whether the estimated error is within the tolerance."""
        return self.error <= self.tolerance

    def __call__(self, *values: Numbers, **named: Numbers) -> Float[Array, "..."]:
        """Interpolated values for parameters in the order of `names`, or by name; any shapes that
        broadcast.

        Differentiable by the parameters and by the coefficients, under jit, vmap and grad. Work
        goes through the processor in pieces, so that memory stays bounded. Computed in the type of
        the coefficients.

        Returns:
            (*batch, *shape).

        Raises:
            ValueError: a parameter is missing, unknown or given twice, NaN or outside its range.
                While JAX traces it, a value outside is moved to the nearest end of the range (and
                its slope is that at the end), and NaN stays NaN.
        """
        parameters = dict(zip(self.names, values, strict=False)) | named
        if len(values) + len(named) != len(self.names) or set(parameters) != set(self.names):
            asked = ", ".join(self.names)
            raise ValueError(
                f"give each parameter once ({asked}), not {len(values)} by place and "
                f"{list(named)} by name"
            )
        for name, axis in zip(self.names, self.axes, strict=True):
            _check_range(name, parameters[name], axis)
        columns = [
            as_float_array(parameters[name]).astype(self.coefficients.dtype) for name in self.names
        ]
        # In the coefficients' type, so that a table of single precision computes in it.
        batch = jnp.broadcast_shapes(*(column.shape for column in columns))
        flat = tuple(jnp.broadcast_to(column, batch).reshape(-1) for column in columns)
        values_flat = on_all_cores(
            _interpolate, flat, self.axes, least=_MANY, shared=self.coefficients
        )
        return values_flat.reshape(*batch, *self.shape)

    def astype(self, dtype: DTypeLike) -> "Interpolated":
        """The same table in another type, such as float32; rounding of some 1e-6 of a value comes
        on top of `error`.
        """
        return eqx.tree_at(lambda table: table.coefficients, self, self.coefficients.astype(dtype))

    # By identity, so that `jax.jit(table)` takes it for a function as it is.
    def __hash__(self) -> int:
        return id(self)

    def __eq__(self, other: object) -> bool:
        return self is other

    def __repr__(self) -> str:
        ranges = ", ".join(
            f"{name} {low:g} to {high:g}" for name, (low, high) in self.ranges.items()
        )
        terms = " x ".join(map(str, self.coefficients.shape[:-1]))
        missed = "" if self.converged else f", not the {self.tolerance:.2g} asked for"
        return f"Interpolated({ranges}: {terms} terms, estimated error {self.error:.2g}{missed})"


def interpolated(
    function: Callable[..., Numbers],
    ranges: Mapping[str, Numbers],
    *,
    tolerance: float = 1e-4,
    distance: Distance | None = None,
    samples: Mapping[str, Numbers] | None = None,
    most_points: int = 20000,
    block: int | None = 64,
) -> Interpolated:
    """Interpolate a smooth function of one to three parameters, with its error estimated at points
    of their own.

    Args:
        function: takes the parameters by name, each an array (points,) of NumPy, and returns
            (points, ...): a spectrum, a colour or any numbers for each point. Wrap a function of
            single numbers in `jax.vmap`. It must be smooth within the ranges: interpolate XYZ, and
            encode sRGB afterwards, since sRGB is clipped.
        ranges: (low, high) of each parameter by name, in the order of later positional arguments.
        tolerance: largest error wanted, in units of `distance`.
        distance: error of approximate values against exact ones, (points,); the largest absolute
            difference if left out.
        samples: values of each parameter that the table will be used at, each (samples,): check
            points are drawn from them. From the whole ranges if left out.
        most_points: stop refining beyond so many nodes; `Interpolated.error` then says what was
            reached.
        block: points handed to the function at a time, always as many, so that it compiles once;
            all at once if None.

    Returns:
        `Interpolated`: call it with as many values of the parameters as you like.

    Raises:
        ValueError: no parameter or more than three, a range that is empty or not finite, a
            tolerance that is not positive, samples outside the ranges, of unlike number or none,
            or a function that returns NaN (the point is named), traced values or another number of
            points. What the function itself refuses, such as a negative thickness, is passed on.
    """
    if not isinstance(ranges, Mapping):
        raise ValueError(
            f"ranges is {ranges!r}; write them by name, such as {{'thickness': (0.0, 5e-6)}}"
        )
    names = tuple(ranges)
    if not 1 <= len(names) <= MOST_AXES:
        raise ValueError(
            f"a table has 1 to {MOST_AXES} parameters, not {len(names)}: {', '.join(names)}"
        )
    if not 0 < tolerance < np.inf:
        raise ValueError(f"tolerance is {tolerance}; it must be positive, such as 1e-4")
    ends = np.array([_ends(name, ranges[name]) for name in names])
    drawn = None
    if samples is not None:
        if set(samples) != set(names):
            raise ValueError(
                f"samples are of {', '.join(samples)}, but the parameters are {', '.join(names)}"
            )
        columns = [_floats(f"samples of {name!r}", samples[name]).reshape(-1) for name in names]
        sizes = [column.size for column in columns]
        if len(set(sizes)) > 1 or 0 in sizes:
            raise ValueError(
                f"samples have {', '.join(map(str, sizes))} values of {', '.join(names)}: give "
                "each parameter as many, one at least"
            )
        for name, column, (low, high) in zip(names, columns, ends, strict=True):
            _check_range(name, column, Axis(low, high))
        drawn = np.stack(columns, axis=1)
    counter = _Counted(function, names, block)
    builder = _Builder(counter, ends, drawn, distance)
    coefficients, error = builder.refine(tolerance, most_points)
    dtype = jnp.result_type(float)
    return Interpolated(
        coefficients=jnp.asarray(coefficients, dtype),
        axes=builder.axes,
        names=names,
        shape=counter.shape,
        error=error,
        tolerance=float(tolerance),
        evaluations=counter.count,
    )


def at_points(
    function: Callable[[np.ndarray], np.ndarray],
    points: Float[np.ndarray, "points axes"],
    *,
    tolerance: float,
    distance: Distance,
) -> tuple[Float[np.ndarray, "points ..."], Interpolated]:
    """Values of a smooth function at many different points, and the table that they are from.

    Args:
        function: takes points, (some, axes), and returns (some, ...).
        points: no axis of which is constant.
        tolerance, distance: see `interpolated`.
    """
    columns = {f"axis {k}": column for k, column in enumerate(points.T)}
    table = interpolated(
        lambda **batch: function(np.stack(list(batch.values()), axis=1)),
        {name: (column.min(), column.max()) for name, column in columns.items()},
        tolerance=tolerance,
        distance=distance,
        samples=columns,
        block=None,
    )
    return np.asarray(table(**columns), float), table


def _ends(name: str, pair: Numbers) -> tuple[float, float]:
    values = _floats(f"the range of {name!r}", pair)
    if values.shape != (2,):
        raise ValueError(f"the range of {name!r} must be (low, high), not of shape {values.shape}")
    low, high = values.tolist()
    if not -np.inf < low < high < np.inf:
        raise ValueError(f"the range {low:g} to {high:g} of {name!r} must be finite and not empty")
    return low, high


def _floats(what: str, values: Numbers) -> np.ndarray:
    try:
        return np.asarray(values, float)
    except (TypeError, ValueError):
        raise ValueError(f"{what} must be known numbers, not {values!r:.60}") from None


def _check_range(name: str, values: Numbers, axis: Axis | Mirrored) -> None:
    """ValueError that names the first value outside, if the values are known."""
    numbers = concrete(values)
    if numbers is None:
        return
    if numbers.dtype.kind not in "biufV":
        raise ValueError(f"{name} is {values!r}; it must be a number or an array of them")
    # A number in a narrower type may round to just beyond the end; NaN fails either comparison.
    room = 1e-6 * (axis.high - axis.low) if numbers.dtype == np.float32 else 0.0
    inside = (numbers >= axis.low - room) & (numbers <= axis.high + room)
    if not inside.all():
        raise ValueError(
            f"{name} is {numbers[~inside][0]:g}, outside the table's range {axis.low:g} to "
            f"{axis.high:g}; build one that covers it"
        )


@functools.partial(jax.custom_jvp, nondiff_argnums=(2,))
def _interpolate(columns: tuple[Array, ...], coefficients: Array, axes: tuple) -> Array:
    """Values (points, channels) at columns (points,)."""
    return _in_pieces(
        lambda *points: (_values(axes, coefficients, points, jnp),), coefficients, columns
    )[0]


def _interpolate_jvp(axes: tuple, primals, tangents):
    """Slopes come with the values, piece by piece: nothing else is kept for a reverse pass."""
    (columns, coefficients), (d_columns, d_coefficients) = primals, tangents
    # Slopes only by the parameters that change.
    changing = [k for k, change in enumerate(d_columns) if not isinstance(change, SymbolicZero)]

    def with_slopes(*points: Array) -> tuple[Array, ...]:
        value = _values(axes, coefficients, points, jnp)
        slopes = []
        for k in changing:

            def along(column: Array, k: int = k) -> Array:
                return _values(axes, coefficients, (*points[:k], column, *points[k + 1 :]), jnp)

            slopes.append(jax.jvp(along, (points[k],), (jnp.ones_like(points[k]),))[1])
        return value, *slopes

    value, *slopes = _in_pieces(with_slopes, coefficients, columns)
    tangent = jnp.zeros_like(value)
    if not isinstance(d_coefficients, SymbolicZero):
        tangent += _interpolate(columns, d_coefficients, axes)
    for k, slope in zip(changing, slopes, strict=True):
        tangent += slope * d_columns[k][:, None]
    return value, tangent


_interpolate.defjvp(_interpolate_jvp, symbolic_zeros=True)


def _in_pieces(function: Callable, coefficients: Array, columns: tuple[Array, ...]) -> list[Array]:
    """Results (points, channels) of a function from pieces of the columns to (channels, points)."""
    count = columns[0].shape[0]
    # A point holds its polynomials, and sums that wait for all axes but the first.
    numbers_each = math.prod(coefficients.shape[1:]) + sum(coefficients.shape)
    size = max(64, (_PIECE_NUMBERS if on_cpu(*columns) else _PIECE_ELSEWHERE) // numbers_each)
    if count <= size:
        return [values.T for values in function(*columns)]
    pieces = -(-count // size)
    padded = tuple(
        jnp.pad(c, (0, -count % pieces), mode="edge").reshape(pieces, -1) for c in columns
    )
    # Points last until the end: a row of three channels is shorter than the processor's vectors.
    out = jax.lax.map(lambda points: function(*points), padded)
    return [jnp.swapaxes(values, 1, 2).reshape(-1, values.shape[1])[:count] for values in out]


def _values(axes: tuple, coefficients: Any, columns: Any, xp: ModuleType) -> Any:
    """Values (channels, points)."""
    bases = []
    for axis, column, count in zip(axes, columns, coefficients.shape, strict=False):
        bases.append(polynomials(axis.coordinate(axis.clamp(column, xp), xp), count, xp, axis=0))
    first, *further = bases
    if coefficients.shape[-1] > _FEW_CHANNELS:
        # With many channels all products of polynomials come first, then one product of matrices.
        for basis in further:
            first = (first[:, None] * basis).reshape(-1, first.shape[-1])
        further = []
    elif not further:
        # A product of so small a matrix is slow, and the polynomials need not be kept.
        return _term_by_term(coefficients[..., None], first)
    values = matmul(xp, coefficients.reshape(first.shape[0], -1).T, first)
    for basis in further:
        values = values.reshape(basis.shape[0], -1, values.shape[-1])
        values = _term_by_term(values, basis)
    return values


def _term_by_term(values: Any, basis: Any) -> Any:
    """Sum of values times polynomials, the first of which is one; not one sum over an axis: the
    compiler then vectorises along the points.
    """
    return functools.reduce(
        lambda total, k: total + values[k] * basis[k], range(1, len(basis)), values[0]
    )


class _Counted:
    """The function, and how often it was called."""

    def __init__(self, function: Callable[..., Numbers], names: tuple[str, ...], block: int | None):
        self.function, self.names, self.block = function, names, block
        self.count, self.shape = 0, ()

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """Values (points, channels) at (points, axes)."""
        count = len(points)
        self.count += count
        return by_blocks(count, self.block or count, lambda rows: self._some(points[rows]))

    def _some(self, points: np.ndarray) -> np.ndarray:
        sampled = concrete(self.function(**dict(zip(self.names, points.T.copy(), strict=True))))
        if sampled is None:
            raise ValueError(
                "the function gave values that JAX traces: build the table outside jit, use it "
                "inside"
            )
        if sampled.shape[:1] != points.shape[:1]:
            raise ValueError(
                f"the function gave shape {sampled.shape} for {len(points)} points; its first axis "
                "must be the points: wrap a function of single numbers in jax.vmap"
            )
        self.shape = sampled.shape[1:]
        values = np.asarray(sampled, float).reshape(len(points), -1)
        wrong = np.flatnonzero(~np.isfinite(values).all(axis=1))
        if wrong.size:
            point = ", ".join(
                f"{name} {x:g}" for name, x in zip(self.names, points[wrong[0]], strict=True)
            )
            raise ValueError(
                f"the function is not finite at {point}: keep the ranges to where it is"
            )
        return values


class _Builder:
    """A table in the making, in NumPy."""

    def __init__(
        self,
        function: _Counted,
        ends: np.ndarray,
        samples: np.ndarray | None,
        distance: Distance | None,
    ):
        self.function, self.samples = function, samples
        self.low, self.high = ends.T
        self.distance = distance or (
            lambda first, second: np.max(np.abs(first - second).reshape(len(first), -1), axis=-1)
        )
        self.rng = np.random.default_rng(0)
        self.axes = tuple(self._best_axis(k) for k in range(len(ends)))

    def refine(self, tolerance: float, most_points: int) -> tuple[np.ndarray, float]:
        """Coefficients and their estimated error."""
        axes = len(self.axes)
        # Chebyshev's extrema: each number of points is nested in the next.
        values = self._grid([extrema(5)] * axes)
        while True:
            coefficients = series_coefficients(values, axes)
            # Points that had no part in the table, and the function there.
            self.checks = np.zeros((0, axes))
            self.truth = np.zeros((0, values.shape[-1]))
            error = 0.0
            # Few checks find a table that is far too coarse; more of them judge a good one.
            for count in _CHECKS:
                self._add_checks(count)
                error = self._measure_error(coefficients)
                if error > tolerance:
                    break
            if error <= tolerance:
                return self._shortened(coefficients, error, tolerance)
            tails = [
                float(np.max(np.abs(np.moveaxis(coefficients, k, 0)[-2:]))) for k in range(axes)
            ]
            # Up to so many points; axes whose last coefficients are within a quarter of the largest
            # grow together.
            grow = axes_to_refine(tails, [n < 129 for n in coefficients.shape[:-1]], 0.25)
            after = math.prod(
                2 * n - 1 if g else n for n, g in zip(values.shape, grow, strict=False)
            )
            if not any(grow) or after > most_points:
                return coefficients, error
            for k, needs_nodes in enumerate(grow):
                if needs_nodes:
                    values = self._refined(values, k)

    def _shortened(
        self, coefficients: np.ndarray, error: float, tolerance: float
    ) -> tuple[np.ndarray, float]:
        """Fewer terms, as long as the error stays below: nodes double, so that half of them may be
        needless.
        """
        # Each time the term goes that the error feels least.
        shorter = [coefficients]
        while True:
            last = shorter[-1]
            tried = [
                last.take(range(n - 1), axis=k) for k, n in enumerate(last.shape[:-1]) if n > 2
            ]
            missed = [self._measure_error(short) for short in tried]
            if not tried or min(missed) > tolerance:
                break
            shorter.append(tried[int(np.argmin(missed))])
        if len(shorter) == 1:
            return coefficients, error
        # Terms were dropped by the errors at these points, so others must judge.
        self._add_checks(_CHECKS[-1])
        # Back to more terms, until the other points agree.
        while True:
            last = shorter.pop()
            error = self._measure_error(last)
            if error <= tolerance or not shorter:
                return last, error

    def _measure_error(self, coefficients: np.ndarray) -> float:
        guess = _values(self.axes, coefficients, self.checks.T, np).T
        shape = (len(self.checks), *self.function.shape)
        return SAFETY * float(
            np.max(self.distance(guess.reshape(shape), self.truth.reshape(shape)))
        )

    def _add_checks(self, count: int) -> None:
        """Compute the function at points that had no part in the table."""
        new = self._random_points(count)
        self.checks = np.concatenate([self.checks, new])
        self.truth = np.concatenate([self.truth, self.function(new)])

    def _random_points(self, count: int) -> np.ndarray:
        """Points not used before: of the samples, or half of them evenly and half as the
        nodes lie.
        """
        if self.samples is not None:
            return self.samples[self.rng.integers(0, len(self.samples), count)]
        even = self.low + self.rng.uniform(0.0, 1.0, (count // 2, self.low.size)) * (
            self.high - self.low
        )
        angles = self.rng.uniform(0.0, np.pi, (self.low.size, count // 2))
        return np.concatenate(
            [
                even,
                np.stack([a.point(np.cos(x)) for a, x in zip(self.axes, angles, strict=True)], 1),
            ]
        )

    def _grid(self, coordinates: list[np.ndarray]) -> np.ndarray:
        """Values on a tensor grid, (n_1, ..., channels)."""
        lines = [axis.point(x) for axis, x in zip(self.axes, coordinates, strict=True)]
        mesh = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1)
        return self.function(mesh.reshape(-1, len(self.axes))).reshape(*mesh.shape[:-1], -1)

    def _best_axis(self, k: int) -> Axis | Mirrored:
        """The coordinate in which polynomials of a low degree come nearest, along two lines through
        the range.
        """
        low = float(self.low[k])
        high = float(self.high[k])
        line = trial_line(low, high, both_ends=True)
        # Two lines along the axis, at a tenth and at six tenths of the other axes.
        points = np.repeat(
            (self.low + np.array([[0.1], [0.6]]) * (self.high - self.low))[:, None],
            line.size,
            axis=1,
        )
        points[..., k] = line
        values = self.function(points.reshape(-1, self.low.size)).reshape(2, line.size, -1)
        values = values.transpose(1, 0, 2).reshape(line.size, -1)
        # The plain coordinate comes first: others must be clearly better.
        axes: list[Axis | Mirrored] = [Axis(low, high)]
        for curvature in CURVATURES[1:]:
            axes += ([Axis(low, high, curvature)] if low >= 0 else []) + [
                Mirrored(low, high, curvature)
            ]
        return best_axis(axes, line, values, 8, gain=0.8)

    def _refined(self, values: np.ndarray, k: int) -> np.ndarray:
        """Twice the intervals along one axis; only the new points are computed."""
        count = 2 * values.shape[k] - 1
        coordinates = [extrema(n) for n in values.shape[:-1]]
        coordinates[k] = extrema(count)[1::2]
        new = np.moveaxis(self._grid(coordinates), k, 0)
        out = np.empty((count, *new.shape[1:]))
        # Old and new points alternate.
        out[0::2], out[1::2] = np.moveaxis(values, k, 0), new
        return np.moveaxis(out, 0, k)
