"""Intersections of rays with spheres, planes, boxes and triangles, and the surface there.

All rays at once against every sphere, plane and box, in JAX; triangles by trimesh on the host
(`triangles`). All that JAX sees is arrays, so that a scene of the same make-up runs the same
compiled program.
"""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from ..shapes import Box, Mesh, Plane, Shape, Sphere, plane_frame, rotation
from .triangles import TriangleCaster, Triangles, Vectors, dot, make_triangles, triangle_surface


class Geometry(NamedTuple):
    """Shapes as arrays, kind by kind: first all spheres, then planes, boxes and meshes."""

    centres: Float[np.ndarray, "spheres 3"]
    radii: Float[np.ndarray, "spheres"]
    points: Float[np.ndarray, "planes 3"]
    frames: Float[np.ndarray, "planes 3 3"]
    """Rows: along the width, along the height, normal."""
    halves: Float[np.ndarray, "planes 2"]
    """Half of width and height; infinite where the plane is endless."""
    middles: Float[np.ndarray, "boxes 3"]
    sides: Float[np.ndarray, "boxes 3"]
    """Half the length of each side."""
    turns: Float[np.ndarray, "boxes 3 3"]
    """Rows: the box's own axes."""
    triangles: Triangles | None
    material: Int[np.ndarray, "shapes"]
    """Number of the material of each shape, in the order of the kinds."""
    order: Int[np.ndarray, "shapes"]
    """Number of each shape in the scene."""
    clearance: Float[np.ndarray, ""]
    """How far from a surface a new ray starts."""
    caster: TriangleCaster | None
    """Finds triangles; no array."""

    @property
    def arrays(self) -> "Geometry":
        """Arrays of it that JAX may see."""
        return self._replace(caster=None)


class Hit(NamedTuple):
    """The nearest surface of each ray."""

    distance: Float[Array, "rays"]
    """Infinite where the ray meets nothing."""
    shape: Int[Array, "rays"]
    """Number in the order of `Geometry`; -1 where the ray meets nothing."""
    triangle: Int[Array, "rays"]
    """Number of the triangle of a mesh; 0 for other shapes."""
    weights: Vectors
    """Of the triangle's corners; 0 for other shapes."""


class SurfacePoints(NamedTuple):
    """Points where rays meet surfaces."""

    normal: Vectors
    """Unit normal on the side of the ray, smooth where a mesh has normals."""
    face: Vectors
    """The same of the true face."""
    uv: Float[Array, "rays 2"]


def make_geometry(shapes: Sequence[Shape], materials: Iterable[str]) -> Geometry:
    """Arrays of shapes, for the ray caster.

    Args:
        shapes: of a scene.
        materials: names of its materials, in the order of their numbers.

    Raises:
        ValueError: there is a mesh, but no trimesh.
    """
    spheres = [shape for shape in shapes if isinstance(shape, Sphere)]
    planes = [shape for shape in shapes if isinstance(shape, Plane)]
    boxes = [shape for shape in shapes if isinstance(shape, Box)]
    meshes = [shape for shape in shapes if isinstance(shape, Mesh)]
    order = [
        k
        for kind in (Sphere, Plane, Box, Mesh)
        for k, shape in enumerate(shapes)
        if isinstance(shape, kind)
    ]
    number = {name: k for k, name in enumerate(materials)}
    before = len(order) - len(meshes)
    centres = _rows([s.centre for s in spheres], 3)
    radii = np.array([s.radius for s in spheres], float)
    points = _rows([p.point for p in planes], 3)
    middles = _rows([b.centre for b in boxes], 3)
    sides = _rows([b.size for b in boxes], 3) / 2
    # How far all shapes reach gives the scene's size; an endless plane counts by its point.
    reaches = [
        np.abs(centres) + radii[:, None],
        np.abs(points),
        np.abs(middles) + 2.0 * sides,
        *(np.abs(np.asarray(m.vertices, float)) for m in meshes),
    ]
    size = np.concatenate(reaches).max(initial=1.0)
    # A ray that leaves a shape meets it again, by rounding, nearer than half of the digits.
    rounding = np.sqrt(np.finfo(jnp.result_type(float)).eps)
    triangles = make_triangles(meshes, before) if meshes else None
    return Geometry(
        centres=centres,
        radii=radii,
        points=points,
        frames=np.array([plane_frame(p) for p in planes]).reshape(-1, 3, 3),
        halves=np.array(
            [(np.inf, np.inf) if p.size is None else np.array(p.size) / 2 for p in planes]
        ).reshape(-1, 2),
        middles=middles,
        sides=sides,
        turns=np.array([rotation(b.rotation).T for b in boxes]).reshape(-1, 3, 3),
        triangles=triangles,
        material=np.array([number[shapes[k].material] for k in order]),
        order=np.array(order),
        clearance=np.array(rounding * size),
        caster=None if triangles is None else TriangleCaster(triangles),
    )


def _rows(values: list, width: int) -> np.ndarray:
    return np.array(values, float).reshape(-1, width)


def nearest(
    geometry: Geometry,
    origin: Vectors,
    direction: Vectors,
    limit: Float[Array, "rays"] | None = None,
) -> Hit:
    """The nearest surface that each ray meets.

    Args:
        geometry: shapes.
        origin, direction: of the rays, (rays, 3); directions of length 1.
        limit: (rays,), the distance up to which to look; endless if left out. A ray whose limit is
            not above 0 meets nothing.
    """
    if limit is None:
        limit = jnp.full(origin.shape[0], jnp.inf, origin.dtype)
    best, shape = _nearest_solid(geometry.arrays, origin, direction, limit)
    number = np.zeros(origin.shape[0], np.int32)
    weights = np.zeros(origin.shape)
    if geometry.caster is not None and geometry.triangles is not None:
        # Triangles only as far as the nearest solid.
        rays = (np.array(a, float) for a in (origin, direction, best))
        best, triangle, weights = geometry.caster.nearest(*rays)
        number = np.maximum(triangle, 0)
        shape = np.where(triangle >= 0, geometry.triangles.shape[number], shape)
    return Hit(
        distance=jnp.where(shape < 0, jnp.inf, best),
        shape=jnp.asarray(shape),
        triangle=jnp.asarray(number),
        weights=jnp.asarray(weights, origin.dtype),
    )


@jax.jit
def _nearest_solid(
    geometry: Geometry, origin: Array, direction: Array, limit: Array
) -> tuple[Array, Array]:
    """Distance and number of the nearest sphere, plane or box; the limit and -1 where there is
    none.
    """
    best = limit
    shape = jnp.full(limit.shape, -1)
    before = 0
    for distances, count in (
        (_spheres, len(geometry.radii)),
        (_planes, len(geometry.points)),
        (_boxes, len(geometry.sides)),
    ):
        if not count:
            continue
        met = distances(geometry, origin, direction)
        # The nearest of this kind, where it is nearer than all kinds before.
        near = jnp.min(met, axis=1)
        shape = jnp.where(near < best, before + jnp.argmin(met, axis=1), shape)
        best = jnp.minimum(near, best)
        before += count
    return best, shape


def _spheres(geometry: Geometry, origin: Array, direction: Array) -> Array:
    """Distances to spheres, (rays, spheres); infinite where missed."""
    between = jnp.subtract(geometry.centres, origin[:, None])
    # Distance along the ray to the point next to the centre.
    along = dot(between, direction[:, None])
    # The distance of the ray from the centre, rather than a difference of large squares.
    aside = between - along[..., None] * direction[:, None]
    half_square = geometry.radii**2 - dot(aside, aside)
    half = jnp.sqrt(jnp.maximum(half_square, 0.0))
    first = along - half
    second = along + half
    # From inside a sphere the second crossing lies ahead.
    met = jnp.where(first > 0, first, second)
    return jnp.where((half_square >= 0) & (met > 0), met, jnp.inf)


def _planes(geometry: Geometry, origin: Array, direction: Array) -> Array:
    """Distances to planes, (rays, planes); infinite where missed."""
    # Start and direction in each plane's own axes, the third along its normal.
    offset = jnp.einsum("rpk,pak->rpa", origin[:, None] - geometry.points, geometry.frames)
    slope = jnp.einsum("rk,pak->rpa", direction, geometry.frames)
    parallel = slope[..., 2] == 0
    met = jnp.where(parallel, -1.0, -offset[..., 2] / jnp.where(parallel, 1.0, slope[..., 2]))
    # Where on the rectangle it is met; an endless plane has infinite halves.
    local = jnp.abs(offset[..., :2] + met[..., None] * slope[..., :2])
    return jnp.where((met > 0) & jnp.all(local <= geometry.halves, axis=-1), met, jnp.inf)


def _boxes(geometry: Geometry, origin: Array, direction: Array) -> Array:
    """Distances to boxes, (rays, boxes); infinite where missed."""
    # In the box's own axes it is what lies between three pairs of faces.
    start = jnp.einsum("rbk,bak->rba", origin[:, None] - geometry.middles, geometry.turns)
    slope = jnp.einsum("rk,bak->rba", direction, geometry.turns)
    # A ray along a face gets a slope that is tiny but not zero, so that no 0/0 can arise.
    slope = jnp.where(jnp.abs(slope) < 1e-30, 1e-30, slope)
    low = (-geometry.sides - start) / slope
    high = (geometry.sides - start) / slope
    # Inside all three pairs at once: from the last entry to the first exit.
    enter = jnp.max(jnp.minimum(low, high), axis=-1)
    leave = jnp.min(jnp.maximum(low, high), axis=-1)
    met = jnp.where(enter > 0, enter, leave)
    return jnp.where((enter <= leave) & (met > 0), met, jnp.inf)


def surface(geometry: Geometry, hit: Hit, origin: Array, direction: Array) -> SurfacePoints:
    """Normals and texture coordinates of hits; meaningless where nothing is met."""
    # A ray without a hit gets its own start: no meaning, but finite numbers.
    point = origin + jnp.where(jnp.isfinite(hit.distance), hit.distance, 0.0)[:, None] * direction
    normal = jnp.broadcast_to(-direction, point.shape)
    uv = jnp.zeros((*point.shape[:1], 2), point.dtype)
    face = normal
    before = 0
    parts = []
    for kind, count in (
        (_sphere_surface, len(geometry.radii)),
        (_plane_surface, len(geometry.points)),
        (_box_surface, len(geometry.sides)),
    ):
        if count:
            its_normal, its_uv = kind(geometry, point, jnp.clip(hit.shape - before, 0, count - 1))
            parts.append((before, its_normal, its_normal, its_uv))
            before += count
    if geometry.triangles is not None:
        # Triangles come last.
        parts.append((before, *triangle_surface(geometry.triangles, hit.triangle, hit.weights)))
    # Each kind writes over those before it.
    for first, its_normal, its_face, its_uv in parts:
        mine = (hit.shape >= first)[:, None]
        normal = jnp.where(mine, its_normal, normal)
        face = jnp.where(mine, its_face, face)
        uv = jnp.where(mine, its_uv, uv)
    # The face looks towards the eye, and the smooth normal with the face.
    face = jnp.where(dot(face, direction)[:, None] > 0, -face, face)
    normal = jnp.where(dot(face, normal)[:, None] < 0, -normal, normal)
    return SurfacePoints(normal, face, uv)


def _sphere_surface(geometry: Geometry, point: Array, which: Array) -> tuple[Array, Array]:
    normal = (point - jnp.asarray(geometry.centres)[which]) / jnp.asarray(geometry.radii)[
        which, None
    ]
    # Longitude and latitude.
    u = 0.5 + jnp.arctan2(normal[:, 1], normal[:, 0]) / (2 * jnp.pi)
    v = 0.5 + jnp.arcsin(jnp.clip(normal[:, 2], -1.0, 1.0)) / jnp.pi
    return normal, jnp.stack([u, v], axis=-1)


def _plane_surface(geometry: Geometry, point: Array, which: Array) -> tuple[Array, Array]:
    frame = jnp.asarray(geometry.frames)[which]
    local = jnp.einsum("rk,rak->ra", point - jnp.asarray(geometry.points)[which], frame[:, :2])
    half = jnp.asarray(geometry.halves)[which]
    endless = ~jnp.isfinite(half)
    return frame[:, 2], jnp.where(endless, local, 0.5 + 0.5 * local / jnp.where(endless, 1.0, half))


def _box_surface(geometry: Geometry, point: Array, which: Array) -> tuple[Array, Array]:
    turn = jnp.asarray(geometry.turns)[which]
    local = jnp.einsum("rk,rak->ra", point - jnp.asarray(geometry.middles)[which], turn)
    local = local / jnp.asarray(geometry.sides)[which]
    # The face of the axis along which the point lies farthest out.
    axis = jnp.argmax(jnp.abs(local), axis=-1)
    sign = jnp.sign(jnp.take_along_axis(local, axis[:, None], axis=1))
    normal = sign * jnp.take_along_axis(turn, axis[:, None, None], axis=1)[:, 0]
    # u and v run along the two other axes.
    across = jnp.asarray([[1, 2], [0, 2], [0, 1]])[axis]
    return normal, 0.5 + 0.5 * jnp.take_along_axis(local, across, axis=1)
