"""A glaze's reflectance at few angles, thicknesses and fractions, enough to know it at
all of them.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float
from numpy.polynomial import chebyshev

from ...chebyshev_table import SAFETY, Axis, Mirrored
from ...interpolated import interpolated
from ...paint.media import Glaze
from ..glaze.solve import with_variables
from ..glaze.table import LEAST_COSINE
from .coats import Axes
from .ground_split import Parts, factor_of, lagrange
from .lookup import NUMPY
from .surfaces import GlazeSurface, inside

# Share of the tolerance that the solver has.
SOLVER = 0.1


class Nodes(NamedTuple):
    """The parts at a few angles, as Chebyshev series over what varies."""

    surface: GlazeSurface
    wavelengths: Float[np.ndarray, "bands"]
    cosines: Float[np.ndarray, "angles"]
    """Nodes, in air."""
    axes: dict[str, Axis | Mirrored]
    """Those of "thickness" and "fraction" that vary."""
    coefficients: Float[np.ndarray, "*terms bands rows"]
    """Of `GlazeSurface.parts`."""
    tolerance: float

    def parts(self, coordinates: list[np.ndarray]) -> Parts:
        """Parts on a tensor grid of coordinates in [-1, 1]: (*grid, bands, angles, angles), ..."""
        values = self.coefficients
        for k, x in enumerate(coordinates):
            basis = chebyshev.chebvander(x, values.shape[k] - 1)
            values = np.moveaxis(np.tensordot(basis, values, (1, k)), 0, k)
        return self.surface.expand(values, self.cosines, SOLVER * self.tolerance)


class NodeSolver:
    """A glaze under a surface, asked for its parts."""

    def __init__(self, surface: GlazeSurface, glaze: Glaze, layer: int, tolerance: float):
        self.surface: GlazeSurface = surface
        self.tolerance: float = tolerance
        self._glaze, self._layer = glaze, layer

    def factor(
        self, points: dict[str, np.ndarray], cos_in: Any, cos_out: Any, ground: Any
    ) -> np.ndarray:
        """Reflectance factor (points or 1, pairs, bands); cosines and ground broadcast to that."""
        stack = {name: np.asarray(x)[..., None, :, :] for name, x in self._stack(points).items()}
        stack["substrate_reflectance"] = ground
        return self.surface.factor(stack, cos_in, cos_out, self.tolerance)

    def parts(
        self, points: dict[str, np.ndarray], cosines: np.ndarray
    ) -> Float[np.ndarray, "points bands rows"]:
        """Rows of `GlazeSurface.parts`."""
        return self.surface.parts(self._stack(points), cosines, self.tolerance)

    def _stack(self, points: dict[str, np.ndarray]) -> dict[str, Any]:
        """Arrays (points or 1, bands, layers)."""
        made = self._glaze
        if points:
            given = (
                np.asarray(points[name]) if name in points else None
                for name in ("thickness", "fraction")
            )
            made = with_variables(made, self._layer, *given)
        albedo = np.asarray(made.albedo)
        depth = np.asarray(made.optical_thickness)
        both = zip(("albedo", "optical_thickness"), np.broadcast_arrays(albedo, depth), strict=True)
        return {name: x[None] if x.ndim == 2 else x for name, x in both}


def solve_nodes(
    surface: GlazeSurface,
    glaze: Glaze,
    layer: int,
    axes: Axes,
    tolerance: float,
    most_points: int = 4000,
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
    solver = NodeSolver(surface, glaze, layer, SOLVER * tolerance)
    ranges = axes.ranges
    # The angles have this share of the tolerance, and thickness and fraction as much.
    share = 0.3 * tolerance
    cosines = surface.angles(_error_of_nodes(solver, ranges), share)
    bands = np.asarray(glaze.wavelengths, float)
    if not ranges:
        return Nodes(
            surface=surface,
            wavelengths=bands,
            cosines=cosines,
            axes={},
            coefficients=solver.parts({}, cosines)[0],
            tolerance=tolerance,
        )
    made = interpolated(
        lambda **points: solver.parts(points, cosines),
        ranges,
        tolerance=share,
        distance=lambda one, two: _distance(solver, cosines, one, two),
        most_points=most_points,
    )
    coefficients = np.asarray(made.coefficients).reshape(*made.coefficients.shape[:-1], *made.shape)
    return Nodes(
        surface=surface,
        wavelengths=bands,
        cosines=cosines,
        axes=dict(zip(made.names, made.axes, strict=True)),
        coefficients=coefficients,
        tolerance=tolerance,
    )


def _distance(
    solver: NodeSolver, cosines: np.ndarray, one: np.ndarray, two: np.ndarray
) -> np.ndarray:
    """Largest difference of the reflectance factor over black, grey and white ground, (points,)."""
    weight = error_weight(solver.surface, cosines[:, None], cosines)
    parts = [solver.surface.expand(values, cosines, solver.tolerance) for values in (one, two)]
    worst = np.zeros(len(one))
    for ground in (0.0, 0.5, 1.0):
        a, b = (_over(p, ground) for p in parts)
        worst = np.maximum(worst, np.max(np.abs(a - b) * weight, axis=(1, 2, 3)))
    return worst


def _over(parts: Parts, ground: Any) -> np.ndarray:
    """Reflectance factor (..., angles, angles) over a ground that broadcasts to it."""
    back = np.clip(parts.back, 0.0, 0.999)[..., None, None]
    return factor_of(
        parts.black, parts.through[..., :, None], parts.through[..., None, :], back, ground
    )


def over(parts: Parts, ground: Any) -> np.ndarray:
    """The same over a number or one for each band."""
    return _over(parts, np.reshape(ground, (-1, 1, 1)))


def error_weight(surface: GlazeSurface, cos_in: np.ndarray, cos_out: np.ndarray) -> np.ndarray:
    """Weight of an error: 1, or the sum of the cosines inside where that is less (an index near 1,
    both grazing).
    """
    n = surface.refractive_index
    return np.minimum(inside(NUMPY, cos_in, n) + inside(NUMPY, cos_out, n), 1.0)


def _error_of_nodes(
    solver: NodeSolver, ranges: dict[str, tuple[float, float]]
) -> Callable[[np.ndarray], float]:
    """Error of nodes of the angle, at a few thicknesses and fractions and at angles between."""
    rng = np.random.default_rng(0)
    points = {}
    for name, (low, high) in ranges.items():
        drawn = low + (high - low) * rng.uniform(0.0, 1.0, 4) ** 2
        points[name] = rng.permutation(np.concatenate([[low, high], drawn]))
    count = 12
    checks = np.clip(rng.beta(0.6, 0.6, (2, count)), LEAST_COSINE, 1.0)
    checks[:, 0] = LEAST_COSINE
    a, b = (np.concatenate([x, x]) for x in checks)
    ground = np.repeat([0.0, 1.0], count)
    truth: list[np.ndarray] = []

    def error(cosines: np.ndarray) -> float:
        if not truth:
            truth.append(solver.factor(points, a[:, None], b[:, None], ground[:, None]))
        parts = solver.surface.expand(solver.parts(points, cosines), cosines, solver.tolerance)
        found = _at_angles(solver.surface, cosines, parts, a, b, ground)
        return SAFETY * float(
            np.max(np.abs(found - truth[0]) * error_weight(solver.surface, a, b)[:, None])
        )

    return error


def _at_angles(
    surface: GlazeSurface,
    cosines: np.ndarray,
    parts: Parts,
    a: np.ndarray,
    b: np.ndarray,
    ground: np.ndarray,
) -> np.ndarray:
    """Reflectance factor (points, pairs, bands) at pairs of angles and grounds (pairs,), from the
    nodes' parts.
    """
    bases = [lagrange(2.0 * surface.coordinate(NUMPY, x) - 1.0, cosines.size) for x in (a, b)]
    rho = parts.black / surface.analytic_factor(NUMPY, cosines[:, None], cosines)
    black = np.einsum("pi,...ij,pj->...p", bases[0], rho, bases[1]) * surface.analytic_factor(
        NUMPY, a, b
    )
    tau = parts.through / surface.let_in(NUMPY, cosines)
    one, two = (
        tau @ basis.T * surface.let_in(NUMPY, x) for basis, x in zip(bases, (a, b), strict=True)
    )
    return np.moveaxis(factor_of(black, one, two, parts.back[..., None], ground), -1, -2)
