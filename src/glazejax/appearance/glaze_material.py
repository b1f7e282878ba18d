"""Our glazes as a material: the many-layer solver's reflectance factor at any pair of angles, from a small table.

A scene asks for millions of pairs of angles, but the reflectance factor changes slowly with them. Divided by what the
surface lets in and out, T(mu_I) T(mu_F), it is an analytic function of the cosines INSIDE the paint, which span little
(0.75 to 1 for n = 1.5); so a few Chebyshev nodes an axis do, and light that grazes the surface vanishes as it should.
The table covers only the angles that the scene has; a map of thicknesses adds an axis. Nodes are added until the error
at points not used before is below the tolerance.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float

from ..media import Glaze, Layer
from ..radiative.fresnel import cos_refracted, dielectric_reflectance
from ..radiative.stack import stack_reflectance_factor
from ..spectra import Grid, Numbers, as_array, as_float_array, concrete, resample, validate_wavelengths
from .nodes import Range, coefficients_from_nodes, lagrange, stretch, unit_nodes, unstretch

ALL_ANGLES = ((0.0, 90.0), (0.0, 90.0))

# Numbers of nodes that are tried, for angles and thicknesses.
_ANGLE_NODES = (3, 4, 6, 8, 12, 16, 24, 32)
_THICKNESS_NODES = (5, 9, 17, 33, 65)
# The solver gets this share of the tolerance.
_SOLVER_SHARE = 0.05
_CHECKS = 48
# The worst of all points lies above the worst of the check points.
_SAFETY = 2.0
# Curvatures of the thickness axis, see `stretch`: nearly a square root, to logarithmic.
_CURVATURES = (1.0, 10.0, 100.0, 1e3, 1e4)
# Numbers held at once by the interpolation.
_CHUNK_NUMBERS = 2**22


class GlazeTable(NamedTuple):
    """Reflectance factor of a glaze between angles; made by `glaze_table`.

    A pytree of arrays: it passes through jit, vmap and grad.
    """

    cos_in: Float[Array, "in"]
    """Nodes, cosines of incidence in air."""
    cos_out: Float[Array, "out"]
    """Nodes, cosines of viewing in air."""
    table: Float[Array, "bands in out thickness"]
    """Reflectance factor pi L_out / E_in at the nodes, without the specular part. The last axis has one entry if the
    thickness does not vary."""
    refractive_index: Float[Array, "bands"]
    thickness: Float[Array, "thickness"]
    """Nodes, m; one entry, the layer's thickness (0 for a glaze without layers), if it does not vary."""
    ranges: tuple[Range, Range, Range]
    """Angles (as cosines in air) and thicknesses that the table is for."""
    index: Array | float
    """Index that sets the coordinates of the angles."""
    error: Array | float
    """Estimated largest absolute error of the reflectance factor within the ranges."""

    def reflectance_factor(
        self, cos_in: Numbers, cos_out: Numbers, thickness: Numbers | None = None
    ) -> Float[Array, "*batch bands"]:
        """Reflectance factor pi L_out / E_in, without the specular part.

        Args:
            cos_in, cos_out: cosines of the angles of incidence and viewing in air, (...).
            thickness: of the layer that varies, m, (...); only for a table with thicknesses.

        Returns:
            (..., bands), to `error`, and smooth. What lies outside the ranges is moved to their ends. Work goes
            through the processor in pieces, so that memory stays bounded.

        Raises:
            ValueError: a thickness is missing, or given for a table without.
        """
        varies = self.thickness.shape[0] > 1
        if varies and thickness is None:
            raise ValueError("this glaze's thickness varies: give thickness, in metres, for every point")
        if not varies and thickness is not None:
            raise ValueError("this glaze's thickness is fixed: leave thickness out, or build it with glaze_table's own")
        depth = self.thickness[0] if thickness is None else thickness
        a, b, d = jnp.broadcast_arrays(as_float_array(cos_in), as_float_array(cos_out), as_float_array(depth))
        return _interpolate(self, a, b, d)

    def mirror(self, cos_in: Numbers) -> Float[Array, "*batch bands"]:
        """Fresnel reflectance of the outer surface, (..., bands): what a mirror reflection carries.

        Args:
            cos_in: cosine of the angle of incidence in air, (...); below 0 it counts as 0.
        """
        cosine = jnp.clip(as_float_array(cos_in), 0.0, 1.0)
        return dielectric_reflectance(cosine[..., None], self.refractive_index)

    def refilled(self, glaze: Glaze, wavelengths_nm: Grid, *, layer: int = 0, tolerance: float = 1e-6) -> "GlazeTable":
        """The same nodes for another glaze, which JAX may trace: gradients by its paints and thicknesses.

        The error is not estimated again, so keep to glazes near the one the table was made for.

        Args:
            glaze, wavelengths_nm, layer: as for `glaze_table`. Where the thickness does not vary, it is the glaze's.
            tolerance: of the solver.
        """
        glaze = _on_grid(glaze, wavelengths_nm)
        varies = self.thickness.shape[0] > 1
        depths = self.thickness if varies else _fixed_thickness(glaze, layer)
        fixed = Range(depths[0], depths[0])
        return self._replace(
            table=_solve(glaze, self.cos_in, self.cos_out, depths if varies else None, layer, tolerance),
            thickness=depths,
            ranges=self.ranges if varies else (*self.ranges[:2], fixed),
            refractive_index=_indices(glaze, self.refractive_index.shape[0]),
        )

    def __repr__(self) -> str:
        bands, incidence, viewing, depths = self.table.shape
        sizes = f"{incidence} x {viewing} angles" + (f" x {depths} thicknesses" if depths > 1 else "")
        error = "traced" if isinstance(self.error, Tracer) else f"{float(self.error):.1g}"
        return f"GlazeTable({bands} bands, {sizes}, estimated error {error})"


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
        glaze: layers on a ground, without batch axes.
        wavelengths_nm: (bands,), within the wavelengths of its paints, to which they are resampled.
        angles: ((least, largest) angle of incidence, (least, largest) angle of viewing), degrees in air, 0 to 90.
            Equal ends make an axis of one node.
        thickness: thicknesses that `layer` takes in the scene, m, in any shape, such as a map: all from the smallest
            to the largest are covered. The layer keeps its own if this is left out.
        layer: number of the layer that varies, 0 for the top one.
        tolerance: absolute error wanted of the reflectance factor.

    Returns:
        `GlazeTable`; its ``error`` is twice the largest error at points not used before.

    Raises:
        ValueError: angles that are not within 0 to 90 degrees in order, a glaze with batch axes or values that JAX
            traces (use `GlazeTable.refilled`), no such layer, or what `Pigment.resample` and `Layer` refuse.
    """
    if not 0 < tolerance < 1:
        raise ValueError(f"tolerance is {tolerance}; it must lie between 0 and 1, such as 1e-3")
    if any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves(glaze)):
        raise ValueError("JAX traces this glaze: build a table of a typical one outside, and call its .refilled here")
    glaze = _on_grid(glaze, wavelengths_nm)
    bands = len(validate_wavelengths(wavelengths_nm))
    depths = _thickness_range(glaze, thickness, layer)
    incidence, viewing = (_cosines(name, pair) for name, pair in zip(("incidence", "viewing"), angles, strict=True))
    index = _indices(glaze, bands)
    axes = _Axes((incidence, viewing), depths, float(jnp.min(index)))
    solver = _SOLVER_SHARE * tolerance
    solved = _Solved(glaze, layer, depths is not None, solver)
    if depths is not None:
        axes = axes.with_curvature(_best_curvature(axes, solved))
    checks = axes.random(np.random.default_rng(0), _CHECKS)
    truth = solved.points(checks)
    sizes = [0, 0]
    while True:
        built = axes.table(sizes, solved, index)
        found = built.reflectance_factor(*checks[:2], None if depths is None else checks[2])
        error = _SAFETY * float(jnp.max(jnp.abs(found - truth))) + solver
        if error <= tolerance or not axes.refine(sizes, built):
            return built._replace(error=error)


class _Axes:
    """Ranges of the axes, their coordinates and nodes, in NumPy."""

    def __init__(self, cosines, depths, index, curvature=1.0):
        self.cosines, self.depths, self.index, self.curvature = cosines, depths, index, curvature

    def with_curvature(self, curvature: float) -> "_Axes":
        return _Axes(self.cosines, self.depths, self.index, curvature)

    def ranges(self, fixed: float) -> tuple[Range, Range, Range]:
        low, high = self.depths or (fixed, fixed)
        first, second = (Range(*pair) for pair in self.cosines)
        return first, second, Range(low, high, self.curvature)

    def nodes(self, axis: int, count: int) -> np.ndarray:
        """Cosines, or thicknesses for axis 2, at the Chebyshev nodes of the coordinate; one node for an empty range."""
        low, high = self.depths if axis == 2 else self.cosines[axis]
        if low == high:
            return np.array([low])
        u = unit_nodes(count)
        if axis == 2:
            span = Range(low, high, self.curvature)
            return np.clip(unstretch(stretch(low, span, np), stretch(high, span, np), u, span), low, high)
        inner = cos_refracted(np.array([low, high]), self.index)
        squared = self.index**2 * ((inner[0] + u * (inner[1] - inner[0])) ** 2 - 1.0) + 1.0
        return np.sqrt(np.clip(squared, max(low**2, 1e-12), high**2))

    def random(self, rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Points to check: within the ranges, more of them towards the ends."""

        def between(low: float, high: float) -> np.ndarray:
            return low + (high - low) * rng.beta(0.6, 0.6, count)

        a, b = (np.clip(between(*pair), 1e-3, 1.0) for pair in self.cosines)
        low, high = self.depths or (0.0, 0.0)
        return a, b, between(low, high)

    def table(self, sizes: list[int], solved: "_Solved", index: Array) -> GlazeTable:
        """Table with numbers of nodes that `sizes` points to, without its error."""
        a, b = (self.nodes(axis, _ANGLE_NODES[sizes[0]]) for axis in (0, 1))
        depths = None if self.depths is None else self.nodes(2, _THICKNESS_NODES[sizes[1]])
        kept = solved.fixed if depths is None else jnp.asarray(depths, index.dtype)
        a, b = jnp.asarray(a, index.dtype), jnp.asarray(b, index.dtype)
        values = solved.grid(a, b, depths)
        return GlazeTable(a, b, values, index, kept, self.ranges(float(solved.fixed[0])), self.index, np.nan)

    def refine(self, sizes: list[int], built: GlazeTable) -> bool:
        """Add nodes where the last coefficients are largest; False if there are enough already."""
        tails = _tails(built)
        room = [sizes[0] + 1 < len(_ANGLE_NODES), self.depths is not None and sizes[1] + 1 < len(_THICKNESS_NODES)]
        largest = max((tail for tail, more in zip(tails, room, strict=True) if more), default=0.0)
        grow = [k for k in (0, 1) if room[k] and tails[k] >= 0.25 * largest]
        for k in grow:
            sizes[k] += 1
        return bool(grow)


class _Solved:
    """What the solver says of the glaze at nodes and at check points."""

    def __init__(self, glaze: Glaze, layer: int, varies: bool, tolerance: float):
        self.glaze, self.layer, self.varies, self.tolerance = glaze, layer, varies, tolerance
        self.fixed = _fixed_thickness(glaze, layer)

    def grid(self, cos_in, cos_out, depths) -> Float[Array, "bands in out thickness"]:
        return _solve(self.glaze, cos_in, cos_out, depths, self.layer, self.tolerance)

    def points(self, points: tuple[np.ndarray, np.ndarray, np.ndarray]) -> Float[Array, "points bands"]:
        glaze = _thickened(self.glaze, self.layer, points[2]) if self.varies else self.glaze
        return _factor(glaze, points[0][:, None], points[1][:, None], self.tolerance)


def _solve(
    glaze: Glaze, cos_in: Array, cos_out: Array, depths: Numbers | None, layer: int, tolerance: float
) -> Float[Array, "bands in out thickness"]:
    """Reflectance factor on the tensor grid of nodes."""
    glaze = glaze if depths is None else _thickened(glaze, layer, depths)
    a, b = (jnp.asarray(c) for c in (cos_in, cos_out))
    values = _factor(glaze, a[:, None, None, None], b[:, None, None], tolerance)
    return jnp.moveaxis(values, -1, 0)


def _factor(glaze: Glaze, cos_in: Numbers, cos_out: Numbers, tolerance: float) -> Float[Array, "*batch bands"]:
    """The solver's reflectance factor, with all bands even if the glaze has none of its own."""
    return stack_reflectance_factor(
        glaze.albedo,
        glaze.optical_thickness,
        glaze.substrate,
        refractive_index=glaze.refractive_index,
        cos_incidence=cos_in,
        cos_viewing=cos_out,
        tolerance=tolerance,
    )


def _interpolate(table: GlazeTable, cos_in: Array, cos_out: Array, depth: Array) -> Float[Array, "*batch bands"]:
    """Sum over nodes of Lagrange's polynomials times what the surface lets through, in pieces."""
    bands, nodes = table.table.shape[0], int(np.prod(table.table.shape[1:]))
    index = table.refractive_index
    flat = _inside(table).reshape(bands, nodes).T

    def one(points: Array) -> Array:
        a, b = (jnp.clip(points[k], r.low, r.high) for k, r in enumerate(table.ranges[:2]))
        along = [_angle_weights(table, axis, c) for axis, c in enumerate((a, b))]
        product = (along[0][:, :, None] * along[1][:, None, :]).reshape(points.shape[1], -1)
        if table.thickness.shape[0] > 1:
            third = _thickness_weights(table, points[2])
            product = (product[:, :, None] * third[:, None, :]).reshape(points.shape[1], -1)
        lit = [1.0 - dielectric_reflectance(c[:, None], index) for c in (a, b)]
        return jnp.matmul(product, flat, precision="highest") * lit[0] * lit[1]

    points = jnp.stack([cos_in.ravel(), cos_out.ravel(), depth.ravel()])
    count = points.shape[1]
    chunk = max(64, _CHUNK_NUMBERS // (nodes + 4 * bands))
    if count <= chunk:
        values = one(points)
    else:
        pieces = -(-count // chunk)
        size = -(-count // pieces)
        padded = jnp.pad(points, ((0, 0), (0, pieces * size - count)), mode="edge")
        values = jax.lax.map(one, jnp.moveaxis(padded.reshape(3, pieces, size), 1, 0)).reshape(-1, bands)[:count]
    return values.reshape(*cos_in.shape, bands)


def _inside(table: GlazeTable) -> Float[Array, "bands in out thickness"]:
    """The table without what the surface takes away: slowly varying, and not zero at grazing angles."""
    through = [1.0 - dielectric_reflectance(c, table.refractive_index[:, None]) for c in (table.cos_in, table.cos_out)]
    return table.table / (through[0][:, :, None, None] * through[1][:, None, :, None])


def _angle_weights(table: GlazeTable, axis: int, cosine: Array) -> Float[Array, "points nodes"]:
    """Lagrange's polynomials of the nodes at cosines within the range."""
    nodes, span = (table.cos_in, table.cos_out)[axis], table.ranges[axis]
    ends = [cos_refracted(jnp.asarray(end, cosine.dtype), table.index) for end in (span.low, span.high)]
    return lagrange(cos_refracted(cosine, table.index), ends[0], ends[1], nodes.shape[0])


def _thickness_weights(table: GlazeTable, depth: Array) -> Float[Array, "points nodes"]:
    """Lagrange's polynomials of the thickness nodes."""
    span = table.ranges[2]
    ends = [stretch(jnp.asarray(end, depth.dtype), span) for end in (span.low, span.high)]
    x = stretch(jnp.clip(depth, span.low, span.high), span)
    return lagrange(x, ends[0], ends[1], table.thickness.shape[0])


def _tails(built: GlazeTable) -> tuple[float, float]:
    """Largest of the last two coefficients along the angles and along the thickness."""
    values = np.asarray(_inside(built))

    def tail(axis: int) -> float:
        count = values.shape[axis]
        if count == 1:
            return 0.0
        return float(np.max(np.abs(np.tensordot(coefficients_from_nodes(count)[-2:], values, (1, axis)))))

    return max(tail(1), tail(2)), tail(3)


def _best_curvature(axes: _Axes, solved: _Solved) -> float:
    """Curvature for which a polynomial of low degree in the thickness comes nearest, at the middle of the angles."""
    low, high = axes.depths
    line = low + (high - low) * np.linspace(0.0, 1.0, 25) ** 3
    middle = [np.full(line.size, 0.5 * (pair[0] + pair[1])) for pair in axes.cosines]
    values = np.asarray(solved.points((middle[0], middle[1], line)))
    misses = []
    for curvature in _CURVATURES:
        span = Range(low, high, curvature)
        ends = stretch(np.array([low, high]), span, np)
        x = (2.0 * stretch(line, span, np) - ends.sum()) / (ends[1] - ends[0])
        basis = np.polynomial.chebyshev.chebvander(x, 7)
        misses.append(np.max(np.abs(values - basis @ np.linalg.lstsq(basis, values, rcond=None)[0])))
    return _CURVATURES[int(np.argmin(misses))]


def _cosines(name: str, pair: tuple[float, float]) -> tuple[float, float]:
    """(least, largest) cosine of a range of angles in degrees."""
    low, high = (float(angle) for angle in pair)
    if not 0.0 <= low <= high <= 90.0:
        raise ValueError(f"angles of {name} are {low:g} to {high:g} degrees; give (least, largest) within 0 to 90")
    # Exact at both ends, where rounding would leave 6e-17.
    return (0.0 if high == 90.0 else float(np.cos(np.deg2rad(high)))), float(np.cos(np.deg2rad(low)))


def _thickness_range(glaze: Glaze, thickness: Numbers | None, layer: int) -> tuple[float, float] | None:
    """(least, largest) thickness, or None if it does not vary."""
    if thickness is None:
        return None
    if not 0 <= layer < len(glaze.layers):
        raise ValueError(f"layer is {layer}, but the glaze has {len(glaze.layers)} layers, the top one is number 0")
    values = concrete(thickness)
    if values is None or values.size == 0:
        raise ValueError("thickness must be known numbers: the thicknesses of the scene, in metres")
    Layer(glaze.layers[layer].medium, values)  # refuses what is negative, not finite or not in metres
    low, high = float(values.min()), float(values.max())
    return (low, high) if high > low else (low, low + max(1e-3 * low, 1e-9))


def _thickened(glaze: Glaze, layer: int, depths: Numbers) -> Glaze:
    """The glaze with other thicknesses of one layer, (points,)."""
    layers = list(glaze.layers)
    layers[layer] = Layer(layers[layer].medium, depths)
    return Glaze(layers, glaze.substrate, glaze.refractive_index)


def _fixed_thickness(glaze: Glaze, layer: int) -> Float[Array, "1"]:
    """Thickness of the layer as it is; 0 for a glaze without layers."""
    return glaze.layers[layer].thickness.reshape(1) if glaze.layers else jnp.zeros(1)


def _indices(glaze: Glaze, bands: int) -> Float[Array, "bands"]:
    """Refractive index of each band."""
    return jnp.broadcast_to(as_float_array(glaze.refractive_index), (bands,))


def _on_grid(glaze: Glaze, wavelengths_nm: Grid) -> Glaze:
    """The glaze on the wavelengths of the scene, its substrate with one value for each."""
    new = validate_wavelengths(wavelengths_nm)
    if any(layer.thickness.ndim for layer in glaze.layers) or glaze.albedo.ndim > 2 or glaze.substrate.ndim > 1:
        raise ValueError("a material is one glaze, without batch axes; give a map of thicknesses as thickness")
    old = glaze.wavelengths if glaze.layers else new

    def at(values: Numbers) -> Numbers:
        array = as_array(values)
        return array if array.ndim == 0 or array.shape[-1] == 1 else resample(old, array, new)

    layers = [Layer(layer.medium.resample(new), layer.thickness) for layer in glaze.layers]
    substrate = jnp.broadcast_to(as_float_array(at(glaze.substrate)), new.shape)
    index = glaze.refractive_index
    return Glaze(layers, substrate, index if isinstance(index, float) else at(index))
