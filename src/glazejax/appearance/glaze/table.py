"""Our glazes as a material: the many-layer solver's reflectance factor at any pair of angles, from
a small table.

A scene asks for millions of pairs of angles; `glaze_table` solves for a few nodes, only within the
angles and thicknesses that the scene has, and adds nodes until the error at points not used before
is below the tolerance.
`GlazeTable` interpolates between them (see `interpolation`).
"""

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer

from ...chebyshev_table import (
    CURVATURES,
    SAFETY,
    Axis,
    axes_to_refine,
    best_axis,
    coefficients_from_nodes,
    roots,
    trial_line,
)
from ...paint.media import MAX_THICKNESS, Glaze, check_glaze, check_quantity
from ...radiative.common.fresnel import cos_refracted
from ...spectra import Grid, Numbers, concrete
from .interpolation import GlazeTable, error_weight, evaluate, interior
from .solve import (
    check_layer,
    fixed_thickness,
    indices,
    on_grid,
    on_nodes,
    planned_factor,
    with_variables,
)

ALL_ANGLES = ((0.0, 90.0), (0.0, 90.0))
"""Degrees in air of incidence and viewing."""

# Numbers of nodes that are tried, for angles and thicknesses.
_ANGLE_NODES = (3, 4, 5, 6, 8, 12, 16, 24, 32)
_THICKNESS_NODES = (5, 7, 9, 12, 16, 20, 26, 34, 48, 65)
# Grazing light is checked up to here: the solver takes no cosine of zero.
LEAST_COSINE = 1e-3


def glaze_table(
    glaze: Glaze,
    wavelengths_nm: Grid,
    *,
    angles: tuple[tuple[float, float], tuple[float, float]] = ALL_ANGLES,
    thickness: Numbers | None = None,
    layer: int = 0,
    tolerance: float = 1e-3,
) -> GlazeTable:
    """Table of a glaze's reflectance factor, for the angles and thicknesses that a scene has.

    Args:
        glaze: coats on a ground, without batch axes.
        wavelengths_nm: (bands,), within the wavelengths of its paints, to which they are resampled.
        angles: ((least, largest) angle of incidence, (least, largest) angle of viewing), degrees in
            air, 0 to 90. Equal ends make an axis of one node.
        thickness: thicknesses that `layer` takes in the scene, m, in any shape, such as a map: all
            from the smallest to the largest are covered. The layer keeps its own if this is left
            out.
        layer: number of the layer that varies, 0 for the top one.
        tolerance: absolute error wanted of the reflectance factor.

    Returns:
        `GlazeTable`; its ``error`` is twice the largest error at points not used before, and says
        so if as many nodes as there may be did not reach the tolerance.

    Raises:
        ValueError: angles that are not within 0 to 90 degrees in order, a glaze with batch axes or
            values that JAX traces (use `GlazeTable.for_glaze`), no such layer, or what
            `Pigment.resample` and `Layer` refuse.
    """
    if not 0 < tolerance < 1:
        raise ValueError(f"tolerance is {tolerance}; it must lie between 0 and 1, such as 1e-3")
    check_glaze(glaze)
    if any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves(glaze)):
        raise ValueError(
            "JAX traces this glaze: build a table of a typical one outside, and call its "
            ".for_glaze here"
        )
    glaze = on_grid(glaze, wavelengths_nm)
    # A ground alone has no layer, and needs none.
    if glaze.coats or thickness is not None:
        check_layer(glaze, layer)
    incidence, viewing = angles
    builder = _TableBuilder(
        glaze=glaze,
        layer=layer,
        cosines=(_cosines("incidence", incidence), _cosines("viewing", viewing)),
        depths=_thickness_range(glaze, thickness, layer),
        # The solver gets a twentieth of it.
        tolerance=0.05 * tolerance,
    )
    # The error is measured at points that no table has as nodes.
    checks = builder.random_points()
    truth = builder.solve(checks)
    sizes = [0, 0]
    while True:
        built = builder.table(sizes)
        error = (
            SAFETY * float(np.max(builder.measure_error(built, checks, truth))) + builder.tolerance
        )
        if error <= tolerance or not builder.refine(sizes, built):
            return jax.tree.map(lambda leaf: jnp.asarray(leaf, float), built)._replace(error=error)


class _TableBuilder:
    """A table in the making, in NumPy."""

    def __init__(
        self,
        glaze: Glaze,
        layer: int,
        cosines: tuple[Axis, Axis],
        depths: Axis | None,
        tolerance: float,
    ):
        self.glaze = glaze
        self.layer = layer
        self.tolerance = tolerance
        self.varies = depths is not None
        self.index = np.asarray(indices(glaze, glaze.ground.shape[0]), float)
        # Cosines inside at the lowest index, where they span most, serve all bands.
        self.inside = float(self.index.min())
        single = float(fixed_thickness(glaze, layer)[0])
        self.ranges = (*cosines, depths or Axis(single, single))
        if self.varies:
            self.ranges = (*cosines, self._best_axis())

    def nodes(self, axis: int, count: int) -> np.ndarray:
        """Cosines, or thicknesses for axis 2, at the nodes of the coordinate; one node for an empty
        range.
        """
        span = self.ranges[axis]
        if span.low == span.high:
            return np.array([span.low if axis == 2 else max(span.low, LEAST_COSINE)])
        if axis == 2:
            return span.point(roots(count))
        # From the nodes' cosines inside back to air by Snell's law.
        ends = cos_refracted(np.array(span[:2]), self.inside)
        squared = self.inside**2 * (Axis(*ends).point(roots(count)) ** 2 - 1.0) + 1.0
        return np.sqrt(np.clip(squared, span.low**2, span.high**2))

    def random_points(self) -> np.ndarray:
        """Points within the ranges, more of them towards the ends, (3, points)."""
        rng = np.random.default_rng(0)
        points = np.stack([r.low + (r.high - r.low) * rng.beta(0.6, 0.6, 48) for r in self.ranges])
        points[:2] = np.clip(points[:2], LEAST_COSINE, 1.0)
        return points

    def solve(self, points: np.ndarray) -> np.ndarray:
        """Reflectance factor by the solver at points (3, points): (points, bands)."""
        glaze = with_variables(self.glaze, self.layer, points[2]) if self.varies else self.glaze
        return planned_factor(glaze, points[0][:, None], points[1][:, None], self.tolerance)

    def table(self, sizes: list[int]) -> GlazeTable:
        """Table with the numbers of nodes that `sizes` points to; its error is not known yet."""
        a, b = (self.nodes(axis, _ANGLE_NODES[sizes[0]]) for axis in (0, 1))
        depths = self.nodes(2, _THICKNESS_NODES[sizes[1]])
        values = on_nodes(
            self.glaze,
            cos_in=a,
            cos_out=b,
            depths=depths if self.varies else None,
            layer=self.layer,
            tolerance=self.tolerance,
            solve=planned_factor,
        )
        return GlazeTable(
            cos_in=a,
            cos_out=b,
            table=values,
            refractive_index=self.index,
            thickness=depths,
            ranges=self.ranges,
            coordinate_index=self.inside,
            error=np.nan,
        )

    def measure_error(self, built: GlazeTable, points: np.ndarray, truth: np.ndarray) -> np.ndarray:
        """Error at points, (points, bands), as `GlazeTable.error` counts it."""
        flat = interior(built, np).reshape(truth.shape[1], -1).T
        interpolated = evaluate(built, flat, points, np)
        weight = error_weight(points[0][:, None], points[1][:, None], self.index)
        return np.abs(interpolated - truth) * weight

    def refine(self, sizes: list[int], built: GlazeTable) -> bool:
        """Add nodes where the last coefficients are largest; False if there are enough already."""
        values = interior(built, np)

        def tail(axis: int) -> float:
            count = values.shape[axis]
            # The last two Chebyshev coefficients show what further nodes would add.
            last = coefficients_from_nodes(roots, count)[-2:]
            return (
                float(np.max(np.abs(np.tensordot(last, values, (1, axis))))) if count > 1 else 0.0
            )

        tails = (max(tail(1), tail(2)), tail(3))
        room = (
            sizes[0] + 1 < len(_ANGLE_NODES),
            self.varies and sizes[1] + 1 < len(_THICKNESS_NODES),
        )
        # Axes whose last coefficients are within this factor of the largest are refined together.
        grow = axes_to_refine(tails, room, 0.5)
        for k in (0, 1):
            sizes[k] += grow[k]
        return any(grow)

    def _best_axis(self) -> Axis:
        """The coordinate in which a polynomial of low degree in the thickness comes nearest, amid
        the angles.
        """
        low, high, _ = self.ranges[2]
        line = trial_line(low, high)
        # In the middle of the angles, the thickness alone varies.
        middle = [
            np.full(line.size, max(0.5 * (r.low + r.high), LEAST_COSINE)) for r in self.ranges[:2]
        ]
        axes = [Axis(low, high, curvature) for curvature in CURVATURES]
        return best_axis(axes, line, self.solve(np.stack([*middle, line])), 7)


def _cosines(name: str, pair: tuple[float, float]) -> Axis:
    """Cosines of a range of angles in degrees."""
    low, high = map(float, pair)
    if not 0.0 <= low <= high <= 90.0:
        raise ValueError(
            f"angles of {name} are {low:g} to {high:g} degrees; give (least, largest) within 0 "
            "to 90"
        )
    # Exact at both ends, where rounding would leave 6e-17.
    least = 0.0 if high == 90.0 else float(np.cos(np.deg2rad(high)))
    return Axis(least, float(np.cos(np.deg2rad(low))))


def _thickness_range(glaze: Glaze, thickness: Numbers | None, layer: int) -> Axis | None:
    """Thicknesses in m, or None if they do not vary."""
    if thickness is None:
        return None
    values = concrete(thickness)
    if values is None or values.size == 0:
        raise ValueError("thickness must be known numbers: the thicknesses of the scene, in metres")
    check_quantity("thickness", values, f"of {glaze.coats[layer].medium.name!r}")
    low = float(values.min())
    high = float(values.max())
    if high > low:
        return Axis(low, high)
    # One thickness gets a narrow range: a table has two ends.
    step = max(1e-3 * low, 1e-9)
    return Axis(low, low + step) if low + step <= MAX_THICKNESS else Axis(low - step, low)
