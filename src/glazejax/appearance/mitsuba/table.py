"""The body of a glaze as a table that a renderer can look up at any angles, wavelength, thickness
and fraction.

All of a glaze's reflectances, whatever the wavelength or thickness, are close to sums of a few
shapes over the two angles. The table keeps the shapes (symmetric in the angles, so that reciprocity
is exact), and how much of each there is at every wavelength, thickness and fraction. Its error is
measured at points of its own, through the same lookup that renders.
"""

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float
from numpy.polynomial import chebyshev

from ...chebyshev_table import SAFETY, Axis, Mirrored, along_axis, series_coefficients
from ...radiative.common.quadrature import gauss
from ...spectra import Bands
from ..glaze.interpolation import error_weight, lagrange
from ..glaze.table import LEAST_COSINE
from . import lookup
from .ground_split import factor_of
from .lookup import NUMPY, Arithmetic, Place, WeightedNodes
from .nodes import (
    SOLVER,
    GlazeSurface,
    Nodes,
    NodeSolver,
    Ranges,
    over,
    solve_nodes,
)

_ANGLES = (33, 65, 129, 257)
_LINE = (9, 17, 33, 65, 129)
# Fields of a body that a renderer keeps on its device.
TABLES = ("pairs", "pair_weights", "lines", "line_weights", "mean_weights", "albedo_shapes")


@dataclass(frozen=True)
class Body:
    """Light from below the surface: reflectance factor pi L_out / E_in, by lookup.

    Not `glazejax.interpolated`: two angles, wavelength, thickness and fraction are five axes, where
    that takes three, and Dr.Jit has to look it up. With the fewest nodes that are tried here, 33
    an angle and 9 of a thickness, polynomials would take 9801 products for each band.

    Tables are arrays of NumPy as made, and whatever `Arithmetic.packet` takes on a device.

    Attributes:
        surface: above.
        wavelengths: (bands,), nm, at even distances. In between values are linear, beyond the ends
            those of the ends.
        axes: what varies, in this order.
        counts: nodes along each axis.
        angles: nodes along an angle.
        pairs: shapes over two angles, (angles, angles, packets, 4), float32.
        pair_weights: of them, (nodes, bands, 2^axes, packets, 4).
        lines: shapes of the light that gets to the ground, (angles, packets, 4); None where the
            ground is in `pairs`.
        line_weights: of them, (nodes, bands, 2^axes, packets + 1, 4); the first of the last packet
            is S.
        mean_weights: `pair_weights` over the mean ground, mean of the bands, (nodes, 2^axes,
            packets, 4).
        albedo_shapes: `pairs` over all directions of the second angle, without `let_in`, (angles,
            packets, 4).
        packets: of the shapes over two angles, and of those over one (0 without).
        error: estimated largest absolute error of the reflectance factor in a band, for any ground.
    """

    surface: GlazeSurface
    wavelengths: Bands
    axes: dict[str, Axis | Mirrored]
    counts: tuple[int, ...]
    angles: int
    pairs: Any
    pair_weights: Any
    lines: Any
    line_weights: Any
    mean_weights: Any
    albedo_shapes: Any
    packets: tuple[int, int]
    error: float = np.nan

    @property
    def bands(self) -> int:
        """Rows of wavelengths."""
        return self.wavelengths.size

    @property
    def bytes(self) -> int:
        """Memory of the tables."""
        tables = (getattr(self, name) for name in TABLES)
        return sum(table.nbytes for table in tables if table is not None)

    def __repr__(self) -> str:
        axes = "".join(f", {n} {name}" for n, name in zip(self.counts, self.axes, strict=True))
        return (
            f"Body({self.bands} bands, {4 * self.pairs.shape[2]} shapes of {self.angles} "
            f"angles{axes}, {self.bytes / 1e6:.2g} MB, estimated error {self.error:.2g})"
        )


def nodes_at(ops: Arithmetic, body: Body, varying: dict[str, Any]) -> WeightedNodes:
    """Nodes and weights of `lookup` for the values of the body's axes."""
    axis_spots = []
    for (name, axis), count in zip(body.axes.items(), body.counts, strict=True):
        along = axis.coordinate(ops.clip(varying[name], axis.low, axis.high), ops)
        axis_spots.append(lookup.place(ops, 0.5 * (along + 1.0), count))
    return lookup.nodes_and_weights(axis_spots, body.counts)


def angle_at(ops: Arithmetic, body: Body, cosine: Any) -> Place:
    """Cell of a cosine in air."""
    return lookup.place(ops, body.surface.coordinate(ops, cosine), body.angles)


def body_table(
    solver: NodeSolver, ranges: Ranges, ground: Bands | None, mean_ground: float
) -> Body:
    """Table of a glaze under a surface.

    Args:
        solver: of the glaze, with the tolerance of the table.
        ranges: what varies of its coat, and from where to where.
        ground: reflectance of the ground in each band, put into the table; None for any ground,
            given at each lookup.
        mean_ground: about what the ground then reflects, for choosing directions.

    Returns:
        `Body`, whose `error` says what was reached.
    """
    finer = solver
    best = None
    for _ in range(3):
        body = _compress(solve_nodes(finer, ranges), ground, mean_ground)
        error = _error(body, solver, ground) + SOLVER * solver.tolerance
        if best is None or error < best.error:
            best = replace(body, error=error)
        if error <= solver.tolerance:
            break
        # Errors of the nodes and of the table's own interpolation add up: the next nodes are finer.
        finer = replace(finer, tolerance=finer.tolerance / 4.0)
    assert best is not None
    return best


class PointWeights(NamedTuple):
    """Weights of a point of the surface at each wavelength, whatever the angles."""

    pairs: list[list[Any]]
    """Weights of the shapes over two angles, in packets."""
    lines: list[list[Any]] | None
    """Weights of those of the light that reaches the ground, the first number of the last
    packet S.
    """
    ground: list[Any] | None
    """Reflectance of the ground."""


def at_point(
    ops: Arithmetic,
    body: Body,
    varying: dict[str, Any],
    wavelengths: list[Any],
    ground: list[Any] | None,
) -> PointWeights:
    """The part of the lookup that angles do not change.

    Args:
        ops: arithmetic of all that follows; the body's tables must be of its kind.
        body: of `body_table`.
        varying: values of the body's axes.
        wavelengths: nm.
        ground: its reflectance at each of the wavelengths; None for a body that has its own.
    """
    nodes = nodes_at(ops, body, varying)
    low = float(body.wavelengths[0])
    high = float(body.wavelengths[-1])
    bands = [lookup.place(ops, (nm - low) / (high - low), body.bands) for nm in wavelengths]

    def of_all(weights: Any, packets: int) -> list[list[Any]]:
        return [
            lookup.spectral_sum(ops, weights, nodes, packets, band, body.bands) for band in bands
        ]

    lines = None if body.lines is None else of_all(body.line_weights, body.packets[1] + 1)
    return PointWeights(of_all(body.pair_weights, body.packets[0]), lines, ground)


def reflectance_factor(
    ops: Arithmetic, body: Body, point: PointWeights, cos_in: Any, cos_out: Any
) -> list[Any]:
    """Reflectance factor of the body at each wavelength of `at_point`; cosines in air, above 0."""
    a = angle_at(ops, body, cos_in)
    b = angle_at(ops, body, cos_out)
    shapes = lookup.pair_sum(ops, body.pairs, a, b, body.angles, body.packets[0])
    analytic = body.surface.analytic_factor(ops, cos_in, cos_out)
    values = [_dots(ops, shapes, weights) * analytic for weights in point.pairs]
    # The ground is given: light goes to and fro between it and the body.
    if point.lines is not None and point.ground is not None:
        line_in, line_out = (
            lookup.line_sum(ops, body.lines, angle, body.packets[1]) for angle in (a, b)
        )
        let_in = body.surface.let_in(ops, cos_in) * body.surface.let_in(ops, cos_out)
        for k, ((*weights, last), ground) in enumerate(zip(point.lines, point.ground, strict=True)):
            through = _dots(ops, line_in, weights) * _dots(ops, line_out, weights) * let_in
            values[k] = factor_of(values[k], through, 1.0, last[0], ground)
    return [ops.maximum(value, 0.0) for value in values]


def mean_albedo(ops: Arithmetic, body: Body, cos_in: Any, varying: dict[str, Any]) -> Any:
    """Share of light from one direction that the body gives back, mean of the bands, over the mean
    ground.
    """
    shapes = lookup.line_sum(ops, body.albedo_shapes, angle_at(ops, body, cos_in), body.packets[0])
    weights = lookup.node_sum(ops, body.mean_weights, nodes_at(ops, body, varying), body.packets[0])
    return ops.clip(_dots(ops, shapes, weights) * body.surface.let_in(ops, cos_in), 0.0, 1.0)


def _dots(ops: Arithmetic, first: list[Any], second: list[Any]) -> Any:
    return sum(ops.dot(a, b) for a, b in zip(first, second, strict=True))


def _compress(nodes: Nodes, ground: np.ndarray | None, mean_ground: float) -> Body:
    """Shapes and their weights, from the solver's nodes."""
    surface = nodes.solver.surface
    n = nodes.cosines.size
    analytic = surface.analytic_factor(NUMPY, nodes.cosines[:, None], nodes.cosines) * np.ones(
        (n, n)
    )
    terms = nodes.terms()
    # Over a black ground where it is not known; over the mean ground, mean of the bands, for
    # choosing directions.
    level, mean = (0.0, mean_ground) if ground is None else (ground, ground)
    rows = (*terms.through.shape[:-1], -1)
    exact = (over(terms, level) / analytic).reshape(rows)
    dim = (over(terms, mean) / analytic).reshape(rows).mean(axis=-2, keepdims=True)
    # Shares of the tolerance: shapes left out, distances between angles and between nodes.
    left_out = 0.1 * nodes.solver.tolerance
    limit = 0.05 * nodes.solver.tolerance
    shapes, onto = _basis([exact, dim], analytic.ravel(), left_out)
    axes = len(nodes.axes)
    weights = series_coefficients(exact @ onto, axes)
    means = series_coefficients(dim @ onto, axes)
    squares = shapes.reshape(-1, n, n)
    # Symmetric to the last digit.
    squares = 0.5 * (squares + np.swapaxes(squares, 1, 2))
    count = _angle_count(squares, analytic, weights, limit)
    to_grid = lagrange(np.linspace(-1.0, 1.0, count), n)
    lines = through = None
    if ground is None:
        # T over what is known of it, and S, have series of their own.
        tall = surface.let_in(NUMPY, nodes.cosines) * np.ones(n)
        tau = terms.through / tall
        across, onto_lines = _basis([tau], tall, left_out)
        lines = _pack(to_grid @ across.T)
        channels = np.concatenate([_pad(tau @ onto_lines), terms.back[..., None]], axis=-1)
        through = series_coefficients(channels, axes)
    # All kept series must do between the nodes; what the ground sees counts more, as light goes
    # back and forth.
    peak = np.max(analytic) * np.max(np.abs(shapes), axis=-1)
    varying = [weights * peak] if through is None else [weights * peak, through]
    counts = tuple(max(_line_count(series, k, limit) for series in varying) for k in range(axes))
    # Each shape over all directions of the second angle gives its albedo.
    cosines, measure = gauss(64)
    measure = 2.0 * measure * cosines
    onto_sphere = lagrange(2.0 * surface.coordinate(NUMPY, cosines) - 1.0, n) * measure[:, None]
    # Without what it lets in, which is not straight between nodes where light grazes.
    steps = np.maximum(surface.cosine(np.linspace(0.0, 1.0, count)), 1e-6)
    remainder = surface.analytic_factor(NUMPY, steps[:, None], cosines) / surface.let_in(
        NUMPY, steps[:, None]
    )
    sphere = (remainder * np.ones((count, cosines.size))) @ onto_sphere
    albedo = np.einsum("ai,aj,kij->ak", to_grid, sphere, squares)
    pairs = np.einsum("ai,bj,kij->abk", to_grid, to_grid, squares)
    return Body(
        surface=surface,
        wavelengths=nodes.solver.glaze.wavelengths,
        axes=nodes.axes,
        counts=counts,
        angles=count,
        pairs=_pack(0.5 * (pairs + np.swapaxes(pairs, 0, 1))),
        pair_weights=_hermite_packets(weights, counts),
        lines=lines,
        line_weights=None if through is None else _hermite_packets(through, counts),
        mean_weights=_hermite_packets(means, counts),
        albedo_shapes=_pack(albedo),
        packets=(len(shapes) // 4, 0 if lines is None else lines.shape[-2]),
    )


def _basis(
    rows: list[np.ndarray], weights: np.ndarray, tolerance: float
) -> tuple[np.ndarray, np.ndarray]:
    """Few shapes (shapes, channels) whose sums come near to all rows, and the matrix onto them
    (channels, shapes).
    """
    # Times the known factor, so that the tolerance is one of the reflectance factor.
    weighed = np.concatenate([values.reshape(-1, weights.size) for values in rows]) * weights
    # The matrix of all pairs of angles is large; a glaze that nothing varies has a few rows, one a
    # band.
    fewer_rows = len(weighed) < weights.size
    vectors = (
        np.linalg.svd(weighed, full_matrices=False)[2].T
        if fewer_rows
        else np.linalg.eigh(weighed.T @ weighed)[1][:, ::-1]
    )
    vectors = _pad(vectors)
    leading = vectors
    # Whole packets of shapes, until every row is met.
    for count in range(4, vectors.shape[1] + 1, 4):
        leading = vectors[:, :count]
        if np.max(np.abs(weighed - (weighed @ leading) @ leading.T)) <= tolerance:
            break
    return leading.T / weights, leading * weights[:, None]


def _angle_count(
    squares: np.ndarray, analytic: np.ndarray, weights: np.ndarray, tolerance: float
) -> int:
    """Nodes of an angle, between which shapes are close to straight."""
    n = squares.shape[-1]
    size = np.abs(weights).reshape(-1, weights.shape[-1]).max(axis=0) * analytic.max()
    for count in _ANGLES:
        nodes = np.linspace(-1.0, 1.0, count)
        ends = lagrange(nodes, n)
        # A straight line misses most in the middle between two nodes.
        middle = lagrange(0.5 * (nodes[1:] + nodes[:-1]), n)
        off = np.einsum("ai,kij->kaj", middle - 0.5 * (ends[1:] + ends[:-1]), squares)
        if np.max(np.abs(off).max(axis=(1, 2)) * size) <= tolerance:
            return count
    return _ANGLES[-1]


def _line_count(series: np.ndarray, k: int, tolerance: float) -> int:
    """Nodes of one axis, between which Hermite's cubics are close enough."""
    series = np.moveaxis(series, k, 0).reshape(series.shape[k], -1)
    for count in _LINE:
        x = np.linspace(-1.0, 1.0, count)
        values, slopes = _values_and_slopes(x, len(series))
        value = values @ series
        slope = slopes @ series
        middle = chebyshev.chebvander(0.5 * (x[1:] + x[:-1]), len(series) - 1) @ series
        # The cubic in the middle of a cell, from values and slopes at its ends.
        guess = 0.5 * (value[1:] + value[:-1]) + (slope[:-1] - slope[1:]) / 8.0
        if np.max(np.abs(guess - middle)) <= tolerance:
            return count
    return _LINE[-1]


def _values_and_slopes(
    x: Float[np.ndarray, "points"], terms: int
) -> tuple[Float[np.ndarray, "points terms"], Float[np.ndarray, "points terms"]]:
    """Matrices from Chebyshev coefficients to values, and to slopes in cells, at even points."""
    down = chebyshev.chebder(np.eye(terms))
    slopes = chebyshev.chebvander(x, len(down) - 1) @ down
    return chebyshev.chebvander(x, terms - 1), slopes * (x[1] - x[0])


def _hermite_packets(series: np.ndarray, counts: tuple[int, ...]) -> np.ndarray:
    """Values and slopes (in cells) on even grids, (nodes, bands, 2^axes, packets, 4), from series
    (*terms, bands, ..).
    """
    numbers = [series]
    for k, count in enumerate(counts):
        matrices = _values_and_slopes(np.linspace(-1.0, 1.0, count), series.shape[k])
        # Each axis doubles the numbers: values, and slopes along it.
        numbers = [along_axis(matrix, values, k) for values in numbers for matrix in matrices]
    stacked = np.stack(numbers, axis=-2)
    return _pack(stacked.reshape(-1, *stacked.shape[-3:]))


def _pad(values: np.ndarray) -> np.ndarray:
    """A multiple of four channels, by zeros."""
    return np.pad(values, [(0, 0)] * (values.ndim - 1) + [(0, -values.shape[-1] % 4)])


def _pack(values: np.ndarray) -> np.ndarray:
    """Channels in packets of four, float32."""
    padded = _pad(values)
    return np.ascontiguousarray(padded.reshape(*padded.shape[:-1], -1, 4), np.float32)


def _error(body: Body, solver: NodeSolver, ground: np.ndarray | None) -> float:
    """Largest error at points not used before, times the safety of all tables."""
    rng = np.random.default_rng(1)
    count = 96
    a, b = np.clip(rng.beta(0.6, 0.6, (2, count)), LEAST_COSINE, 1.0)
    # One check has both directions grazing, another one of them.
    a[:2] = b[:1] = LEAST_COSINE
    # Half of them evenly, half as the coordinate crowds.
    points = {}
    for name, axis in body.axes.items():
        even = rng.uniform(axis.low, axis.high, count)
        points[name] = np.where(
            rng.random(count) < 0.5, even, axis.point(rng.uniform(-1.0, 1.0, count))
        )
    drawn = rng.random(count)
    # One stack for all checks, or one for each.
    wide = (slice(None), None, None) if points else (slice(None), None)
    ground_values = drawn[wide] if ground is None else ground
    truth = solver.factor(points, a[wide], b[wide], ground_values).reshape(count, -1)
    waves = [np.full(count, w) for w in body.wavelengths]
    point_ground = None if ground is not None else [drawn] * body.bands
    point = at_point(NUMPY, body, points, waves, point_ground)
    factor = np.stack(reflectance_factor(NUMPY, body, point, a, b), axis=-1)
    weight = error_weight(a, b, body.surface.refractive_index)
    return SAFETY * float(np.max(np.abs(factor - truth) * weight[:, None]))
