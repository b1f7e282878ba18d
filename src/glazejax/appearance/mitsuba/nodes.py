"""A glaze's reflectance at few angles, thicknesses and fractions, enough to know it at all of them.

The ground enters in closed form: with R0 over black, T the light that reaches a black ground and S what the stack
throws back to the ground, R = R0 + g T T/(1 - g S) for any Lambertian ground g. Three levels of the ground give all.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from numpy.polynomial import chebyshev

from ...chebyshev_table import SAFETY, Axis, Mirrored, coefficients_from_nodes, roots
from ...interpolated import interpolated
from ...paint.media import Glaze
from .coats import Axes, varied
from .lookup import NUMPY
from .surfaces import Surface, inside, known_part

# Numbers of angles that are tried.
_ANGLE_NODES = (4, 5, 6, 8, 10, 12, 16, 24, 32)
_TRIALS, _CHECKS = 6, 12
# Shares of the tolerance: for the solver, for the angles and for thickness and fraction.
_SOLVER, _ANGLES, _AXES = 0.05, 0.3, 0.3
# Light that reaches the ground and comes back, below which what the ground sees is not known, and does not matter.
_FAINT = 1e-10
_LEAST_COSINE = 1e-3


class Parts(NamedTuple):
    """What makes up the reflectance factor over any ground."""

    black: Float[np.ndarray, "*batch"]
    """R0, over a black ground."""
    through: Float[np.ndarray, "*batch"]
    """T of one direction, that reaches a black ground."""
    back: Float[np.ndarray, "*batch"]
    """S, thrown back to the ground."""


class Nodes(NamedTuple):
    """The parts at a few angles, as Chebyshev series over what varies."""

    surface: Surface
    wavelengths: Float[np.ndarray, "bands"]
    cosines: Float[np.ndarray, "angles"]
    """Nodes, in air."""
    axes: dict[str, Axis | Mirrored]
    """Those of "thickness" and "fraction" that vary."""
    coefficients: Float[np.ndarray, "*terms bands parts"]
    """Parts: pairs of angles (the upper triangle) of R0, then T of each angle, then S."""
    tolerance: float

    def parts(self, coordinates: list[np.ndarray], slopes: tuple[int, ...] = ()) -> Parts:
        """Parts on a tensor grid of coordinates in [-1, 1], or their derivatives along some axes by the coordinate.

        Returns:
            black (*grid, bands, angles, angles), through (*grid, bands, angles), back (*grid, bands).
        """
        values = self.coefficients
        for k, x in enumerate(coordinates):
            count = values.shape[k]
            series = np.eye(count)
            if k in slopes:
                series = chebyshev.chebder(series, axis=0) if count > 1 else 0.0 * series
            basis = chebyshev.chebvander(x, len(series) - 1) @ series
            values = np.moveaxis(np.tensordot(basis, values, (1, k)), 0, k)
        return split(values, self.cosines.size)


def split(values: Float[np.ndarray, "*batch parts"], angles: int) -> Parts:
    """Parts from one row."""
    rows, columns = np.triu_indices(angles)
    black = np.empty((*values.shape[:-1], angles, angles))
    black[..., rows, columns] = black[..., columns, rows] = values[..., : rows.size]
    return Parts(black, values[..., rows.size : -1], values[..., -1])


def factor_of(black, through_in, through_out, back, ground):
    """R0 + g T T/(1 - g S)."""
    return black + ground * through_in * through_out / (1.0 - ground * back)


class Solver:
    """A glaze under a surface, asked for its parts."""

    def __init__(self, surface: Surface, glaze: Glaze, layer: int, tolerance: float):
        self.surface, self.glaze, self.layer, self.tolerance = surface, glaze, layer, tolerance

    def factor(self, points: dict[str, np.ndarray], cos_in: np.ndarray, cos_out: np.ndarray, ground) -> np.ndarray:
        """Reflectance factor (points, pairs, bands); cosines and ground (..., pairs, 1) or (..., pairs, bands)."""
        glaze = self.glaze
        if points:
            given = {name: np.asarray(x)[:, None] for name, x in points.items()}
            glaze = varied(glaze, self.layer, given.get("thickness"), given.get("fraction"))
        stack = {
            "albedo": glaze.albedo,
            "optical_thickness": glaze.optical_thickness,
            "substrate_reflectance": ground,
        }
        found = self.surface.factor(stack, cos_in, cos_out, self.tolerance)
        return np.asarray(found, float).reshape(-1, *np.shape(found)[-2:])

    def parts(self, points: dict[str, np.ndarray], cosines: np.ndarray) -> Float[np.ndarray, "points bands parts"]:
        """R0 of all pairs, T of all angles, and S."""
        n = cosines.size
        rows, columns = np.triu_indices(n)
        # The last angle is the steepest, which lets most light through.
        first = np.concatenate([rows, np.arange(n), [n - 1]])
        second = np.concatenate([columns, np.arange(n), [n - 1]])
        ground = np.concatenate([np.zeros(rows.size), np.ones(n), [0.5]])[:, None]
        found = self.factor(points, cosines[first][:, None], cosines[second][:, None], ground)
        black = found[:, : rows.size]
        diagonal = black[:, rows == columns]
        full = np.maximum(found[:, rows.size : -1] - diagonal, 0.0)
        half = found[:, -1] - diagonal[:, -1]
        steepest = full[:, -1]
        known = steepest > _FAINT
        # From T T/(1 - S) and .5 T T/(1 - .5 S).
        ratio = np.where(known, half, 0.4) / np.where(known, steepest, 1.0)
        back = np.where(known, np.clip((1.0 - 2.0 * ratio) / (1.0 - ratio), 0.0, 1.0), np.nan)
        back = _filled(back)
        through = np.sqrt(full * (1.0 - back)[:, None])
        return np.moveaxis(np.concatenate([black, through, back[:, None]], axis=1), 1, 2)


def _filled(back: Float[np.ndarray, "points bands"]) -> Float[np.ndarray, "points bands"]:
    """S where it is not known: that of the next point, since it hardly changes where little light gets through."""
    for band in back.T:
        known = np.flatnonzero(np.isfinite(band))
        unknown = np.flatnonzero(~np.isfinite(band))
        if unknown.size:
            near = known[np.abs(known[None] - unknown[:, None]).argmin(axis=1)] if known.size else None
            band[unknown] = 0.0 if near is None else band[near]
    return back


def solve_nodes(
    surface: Surface, glaze: Glaze, layer: int, axes: Axes, tolerance: float, most_points: int = 4000
) -> Nodes:
    """Few angles, thicknesses and fractions that give all others within the tolerance.

    Args:
        surface: above.
        glaze: of `read_coats`.
        layer: the coat that varies.
        axes: what varies.
        tolerance: absolute error wanted of the reflectance factor, for any ground.
        most_points: thicknesses and fractions that are computed at most.
    """
    solver = Solver(surface, glaze, layer, _SOLVER * tolerance)
    ranges = axes.ranges
    cosines = _angles(solver, ranges, _ANGLES * tolerance)
    bands = np.asarray(glaze.wavelengths, float)
    if not ranges:
        return Nodes(surface, bands, cosines, {}, solver.parts({}, cosines)[0], tolerance)
    known = surface, cosines
    made = interpolated(
        lambda **points: solver.parts(points, cosines),
        ranges,
        tolerance=_AXES * tolerance,
        distance=lambda one, two: _distance(*known, one, two),
        most_points=most_points,
    )
    coefficients = np.asarray(made.coefficients).reshape(*made.coefficients.shape[:-1], *made.shape)
    return Nodes(surface, bands, cosines, dict(zip(made.names, made.axes, strict=True)), coefficients, tolerance)


def _distance(surface: Surface, cosines: np.ndarray, one: np.ndarray, two: np.ndarray) -> np.ndarray:
    """Largest difference of the reflectance factor over black, grey and white ground, (points,)."""
    weight = bounded(surface, cosines[:, None], cosines)
    parts = [split(values, cosines.size) for values in (one, two)]
    worst = np.zeros(len(one))
    for ground in (0.0, 0.5, 1.0):
        a, b = (
            factor_of(
                p.black,
                p.through[..., :, None],
                p.through[..., None, :],
                np.clip(p.back, 0.0, 0.999)[..., None, None],
                ground,
            )
            for p in parts
        )
        worst = np.maximum(worst, np.max(np.abs(a - b) * weight, axis=(1, 2, 3)))
    return worst


def bounded(surface: Surface, cos_in: np.ndarray, cos_out: np.ndarray) -> np.ndarray:
    """Weight of an error: 1, or the sum of the cosines inside where that is less (an index near 1, both grazing)."""
    n = surface.refractive_index
    return np.minimum(inside(NUMPY, cos_in, n) + inside(NUMPY, cos_out, n), 1.0)


def lagrange(x: np.ndarray, count: int) -> Float[np.ndarray, "points nodes"]:
    """Lagrange's polynomials of the roots at x in [-1, 1]."""
    return chebyshev.chebvander(x, count - 1) @ coefficients_from_nodes(roots, count)


def angle_nodes(surface: Surface, count: int) -> Float[np.ndarray, "nodes"]:
    """Cosines in air of the nodes, steepest last."""
    return surface.cosine(0.5 * (roots(count) + 1.0))


def _angles(solver: Solver, ranges: dict[str, tuple[float, float]], tolerance: float) -> np.ndarray:
    """As many angles as it takes, judged at a few thicknesses and fractions and at angles between."""
    rng = np.random.default_rng(0)
    draw: Callable[[float, float], np.ndarray] = lambda low, high: np.concatenate(  # noqa: E731
        [[low, high], low + (high - low) * rng.uniform(0.0, 1.0, _TRIALS - 2) ** 2]
    )
    points = {name: rng.permutation(draw(*span)) for name, span in ranges.items()}
    checks = np.clip(rng.beta(0.6, 0.6, (2, _CHECKS)), _LEAST_COSINE, 1.0)
    checks[:, 0] = _LEAST_COSINE
    a, b = (np.concatenate([x, x]) for x in checks)
    ground = np.repeat([0.0, 1.0], _CHECKS)
    truth = solver.factor(points, a[:, None], b[:, None], ground[:, None])
    weight = (bounded(solver.surface, a, b))[:, None]
    cosines = np.zeros(0)
    for count in _ANGLE_NODES:
        cosines = angle_nodes(solver.surface, count)
        parts = split(solver.parts(points, cosines), count)
        found = at_angles(solver.surface, cosines, parts, a, b, ground)
        if SAFETY * np.max(np.abs(found - truth) * weight) <= tolerance:
            break
    return cosines


def at_angles(surface: Surface, cosines: np.ndarray, parts: Parts, a: np.ndarray, b: np.ndarray, ground: np.ndarray):
    """Reflectance factor (points, pairs, bands) at pairs of angles and grounds (pairs,), from the nodes' parts."""
    bases = [lagrange(2.0 * surface.coordinate(NUMPY, x) - 1.0, cosines.size) for x in (a, b)]
    rho = parts.black / known_part(NUMPY, surface, cosines[:, None], cosines)
    black = np.einsum("pi,...ij,pj->...p", bases[0], rho, bases[1]) * known_part(NUMPY, surface, a, b)
    tau = parts.through / surface.transmittance(NUMPY, cosines)
    one, two = (tau @ basis.T * surface.transmittance(NUMPY, x) for basis, x in zip(bases, (a, b), strict=True))
    return np.moveaxis(factor_of(black, one, two, parts.back[..., None], ground), -1, -2)
