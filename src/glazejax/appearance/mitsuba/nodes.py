"""A glaze's reflectance at few angles, thicknesses and fractions, enough to know it at
all of them.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from jaxtyping import Float
from numpy.polynomial import chebyshev

from ...chebyshev_table import SAFETY, Axis, Mirrored, along_axis, extrema
from ...interpolated import interpolated
from ...paint.media import Glaze
from ..glaze.interpolation import error_weight, lagrange
from ..glaze.solve import with_variables
from ..glaze.table import LEAST_COSINE
from .ground_split import GroundTerms, factor_of
from .lookup import NUMPY
from .rough import Rough
from .smooth import Smooth
from .surfaces import ErrorOfNodes, Layers

GlazeSurface: TypeAlias = Smooth | Rough
"""What lies above a body."""

Ranges: TypeAlias = dict[str, tuple[float, float]]
"""Least and largest value of what varies, "thickness" in m and "fraction"."""

Points: TypeAlias = dict[str, np.ndarray]
"""Values of what varies, (points,) each."""

# Share of the tolerance that the solver has.
SOLVER = 0.1
# Thicknesses and fractions that are computed at most.
_MOST_POINTS = 4000


class Nodes(NamedTuple):
    """The terms at a few angles, as Chebyshev series over what varies."""

    solver: "NodeSolver"
    cosines: Float[np.ndarray, "angles"]
    """Nodes, in air."""
    axes: dict[str, Axis | Mirrored]
    """Those of "thickness" and "fraction" that vary."""
    coefficients: Float[np.ndarray, "*terms bands rows"]
    """Of the surface's `terms`."""

    def terms(self) -> GroundTerms:
        """Terms on a tensor grid of Chebyshev's extrema, enough for products of the series: (*grid,
        bands, angles, angles), ...
        """
        values = self.coefficients
        for k, count in enumerate(values.shape[: len(self.axes)]):
            basis = chebyshev.chebvander(extrema(2 * count - 1), count - 1)
            values = along_axis(basis, values, k)
        return self.solver.expand(values, self.cosines)


@dataclass(frozen=True)
class NodeSolver:
    """A glaze under a surface, asked for its terms.

    Attributes:
        surface: above.
        glaze: on even wavelengths (`read_coats`).
        layer: number of the coat that varies, 0 on top.
        tolerance: absolute error wanted of the table's reflectance factor, for any ground; the
            solver has a share of it.
    """

    surface: GlazeSurface
    glaze: Glaze
    layer: int
    tolerance: float

    def factor(self, points: Points, cos_in: Any, cos_out: Any, ground: Any) -> np.ndarray:
        """Reflectance factor (points or 1, pairs, bands); cosines and ground broadcast to that."""
        layers = [x[..., None, :, :] for x in self._layers(points)]
        return self.surface.factor(layers, ground, cos_in, cos_out, SOLVER * self.tolerance)

    def terms(self, points: Points, cosines: np.ndarray) -> Float[np.ndarray, "points bands rows"]:
        """Rows of the surface's `terms`."""
        return self.surface.terms(self._layers(points), cosines, SOLVER * self.tolerance)

    def expand(self, values: np.ndarray, cosines: np.ndarray) -> GroundTerms:
        """Terms at the angles from sums of those rows."""
        return self.surface.expand(values, cosines, SOLVER * self.tolerance)

    def _layers(self, points: Points) -> Layers:
        """Albedo and optical thickness of the layers at points, (points or 1, bands, layers)."""
        glaze = self.glaze
        if points:
            glaze = with_variables(
                glaze, self.layer, points.get("thickness"), points.get("fraction")
            )
        # Where the thickness alone varies the albedo has no axis of points; where nothing varies
        # there is one point.
        layers = np.broadcast_arrays(glaze.albedo, glaze.optical_thickness)
        return [x.reshape(-1, *x.shape[-2:]) for x in layers]


def solve_nodes(solver: NodeSolver, ranges: Ranges) -> Nodes:
    """Few angles, thicknesses and fractions that give all others within the tolerance.

    Args:
        solver: of the glaze.
        ranges: of what varies.
    """
    # The angles have this share of the tolerance, and thickness and fraction as much.
    share = 0.3 * solver.tolerance
    cosines = solver.surface.angles(_error_of_nodes(solver, ranges), share)
    axes = {}
    if ranges:
        interpolant = interpolated(
            lambda **points: solver.terms(points, cosines),
            ranges,
            tolerance=share,
            distance=lambda coarse, fine: _distance(solver, cosines, coarse, fine),
            most_points=_MOST_POINTS,
        )
        axes = dict(zip(interpolant.names, interpolant.axes, strict=True))
        terms = interpolant.coefficients.shape[:-1]
        coefficients = np.asarray(interpolant.coefficients).reshape(*terms, *interpolant.shape)
    else:
        coefficients = solver.terms({}, cosines)[0]
    return Nodes(solver=solver, cosines=cosines, axes=axes, coefficients=coefficients)


def _distance(
    solver: NodeSolver, cosines: np.ndarray, coarse: np.ndarray, fine: np.ndarray
) -> np.ndarray:
    """Largest difference of the reflectance factor over black, grey and white ground, (points,)."""
    weight = error_weight(cosines[:, None], cosines, solver.surface.refractive_index)
    terms = [solver.expand(values, cosines) for values in (coarse, fine)]
    # R0, T and S count differently over each of these.
    largest = np.zeros(len(coarse))
    for ground in (0.0, 0.5, 1.0):
        a, b = (over(p, ground) for p in terms)
        largest = np.maximum(largest, np.max(np.abs(a - b) * weight, axis=(1, 2, 3)))
    return largest


def over(terms: GroundTerms, ground: Any) -> np.ndarray:
    """Reflectance factor (..., bands, angles, angles) over a ground: a number, or one
    for each band.
    """
    back = np.clip(terms.back, 0.0, 0.999)[..., None, None]
    return factor_of(
        terms.black,
        terms.through[..., :, None],
        terms.through[..., None, :],
        back,
        np.reshape(ground, (-1, 1, 1)),
    )


def _error_of_nodes(solver: NodeSolver, ranges: Ranges) -> ErrorOfNodes:
    """Error of nodes of the angle, at a few thicknesses and fractions and at angles between."""
    surface = solver.surface
    rng = np.random.default_rng(0)
    points = {}
    # Both ends of each range, and points that crowd towards its lower one.
    for name, (low, high) in ranges.items():
        drawn = low + (high - low) * rng.uniform(0.0, 1.0, 4) ** 2
        points[name] = rng.permutation(np.concatenate([[low, high], drawn]))
    count = 12
    checks = np.clip(rng.beta(0.6, 0.6, (2, count)), LEAST_COSINE, 1.0)
    # In the first check both directions graze.
    checks[:, 0] = LEAST_COSINE
    # Each pair of angles over a black and over a white ground.
    a, b = (np.concatenate([x, x]) for x in checks)
    ground = np.repeat([0.0, 1.0], count)
    truth: list[np.ndarray] = []

    def error(cosines: np.ndarray) -> float:
        # Solved when the first nodes are judged, and kept for the others.
        if not truth:
            truth.append(solver.factor(points, a[:, None], b[:, None], ground[:, None]))
        terms = solver.expand(solver.terms(points, cosines), cosines)
        # What is known in closed form is taken off before the interpolation and put back after it.
        bases = [lagrange(2.0 * surface.coordinate(NUMPY, x) - 1.0, cosines.size) for x in (a, b)]
        rho = terms.black / surface.analytic_factor(NUMPY, cosines[:, None], cosines)
        black = np.einsum("pi,...ij,pj->...p", bases[0], rho, bases[1])
        black *= surface.analytic_factor(NUMPY, a, b)
        tau = terms.through / surface.let_in(NUMPY, cosines)
        through_in, through_out = (
            tau @ basis.T * surface.let_in(NUMPY, x) for basis, x in zip(bases, (a, b), strict=True)
        )
        factor = factor_of(black, through_in, through_out, terms.back[..., None], ground)
        weight = error_weight(a, b, surface.refractive_index)
        # From (points, bands, pairs) to the truth's (points, pairs, bands).
        missed = np.abs(np.moveaxis(factor, -1, -2) - truth[0])
        return SAFETY * float(np.max(missed * weight[:, None]))

    return error
