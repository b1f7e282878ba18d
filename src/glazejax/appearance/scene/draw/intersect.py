"""Intersections of rays with spheres, planes, boxes and triangles, and the surface there.

All rays at once against every sphere, plane and box, in JAX; triangles by trimesh on the host
(`triangles`). All that JAX sees is arrays, so that a scene of the same make-up runs the same
compiled program.
"""

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from ..shapes import Box, Mesh, Plane, Shape, Sphere, plane_frame, rotation
from .triangles import TriangleCaster, Triangles, Vectors, dot, make_triangles, triangle_surface


class Solids(NamedTuple):
    """Shapes of one kind, each with axes of its own."""

    place: Float[np.ndarray, "solids 3"]
    """Centres, or points of endless planes."""
    frame: Float[np.ndarray, "solids 3 3"]
    """Rows: the axes, of a plane along the width, along the height, and the normal."""
    half: Float[np.ndarray, "solids 3"]
    """Half the length along each axis; infinite where a plane is endless."""


class Geometry(NamedTuple):
    """Shapes as arrays, kind by kind: first all spheres, then planes, boxes and meshes."""

    solids: tuple[Solids, Solids, Solids]
    """Spheres, planes and boxes."""
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
    meshes = [shape for shape in shapes if isinstance(shape, Mesh)]
    order = [
        k
        for kind in (Sphere, Plane, Box, Mesh)
        for k, shape in enumerate(shapes)
        if isinstance(shape, kind)
    ]
    number = {name: k for k, name in enumerate(materials)}
    spheres = _solids(
        [(s.centre, np.eye(3), np.full(3, s.radius)) for s in shapes if isinstance(s, Sphere)]
    )
    planes = _solids(
        [(p.point, plane_frame(p), _plane_half(p)) for p in shapes if isinstance(p, Plane)]
    )
    boxes = _solids(
        [
            (b.centre, rotation(b.rotation).T, np.asarray(b.size, float) / 2)
            for b in shapes
            if isinstance(b, Box)
        ]
    )
    # How far all shapes reach gives the scene's size; a plane counts by its point.
    reaches = [
        np.abs(spheres.place) + spheres.half,
        np.abs(planes.place),
        np.abs(boxes.place) + 2.0 * boxes.half,
        *(np.abs(np.asarray(m.vertices, float)) for m in meshes),
    ]
    size = np.concatenate(reaches).max(initial=1.0)
    # A ray that leaves a shape meets it again, by rounding, nearer than half of the digits.
    rounding = np.sqrt(np.finfo(jnp.result_type(float)).eps)
    triangles = make_triangles(meshes, len(order) - len(meshes)) if meshes else None
    return Geometry(
        solids=(spheres, planes, boxes),
        triangles=triangles,
        material=np.array([number[shapes[k].material] for k in order]),
        order=np.array(order),
        clearance=np.array(rounding * size),
        caster=None if triangles is None else TriangleCaster(triangles),
    )


def _solids(rows: list[tuple[Any, np.ndarray, np.ndarray]]) -> Solids:
    """Solids of their places, axes and halves."""
    return Solids(
        place=np.array([place for place, _, _ in rows], float).reshape(-1, 3),
        frame=np.array([frame for _, frame, _ in rows]).reshape(-1, 3, 3),
        half=np.array([half for _, _, half in rows], float).reshape(-1, 3),
    )


def _plane_half(plane: Plane) -> Float[np.ndarray, "3"]:
    """Half of width and height; what lies along the normal plays no part."""
    return np.full(3, np.inf) if plane.size is None else np.append(plane.size, np.inf) / 2


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
    for distances, solids in zip((_spheres, _planes, _boxes), geometry.solids, strict=True):
        if not len(solids.half):
            continue
        # Start and direction in each solid's own axes.
        start = dot((origin[:, None] - solids.place)[..., None, :], solids.frame)
        slope = dot(direction[:, None, None], solids.frame)
        met = distances(jnp.asarray(solids.half), start, slope)
        # The nearest of this kind, where it is nearer than all kinds before.
        near = jnp.min(met, axis=1)
        shape = jnp.where(near < best, before + jnp.argmin(met, axis=1), shape)
        best = jnp.minimum(near, best)
        before += len(solids.half)
    return best, shape


def _spheres(half: Array, start: Array, slope: Array) -> Array:
    """Distances to spheres, (rays, spheres); infinite where missed."""
    # Distance along the ray to the point next to the centre.
    along = -dot(start, slope)
    # The distance of the ray from the centre, rather than a difference of large squares.
    aside = start + along[..., None] * slope
    half_square = half[:, 0] ** 2 - dot(aside, aside)
    half_chord = jnp.sqrt(jnp.maximum(half_square, 0.0))
    first = along - half_chord
    second = along + half_chord
    # From inside a sphere the second crossing lies ahead.
    met = jnp.where(first > 0, first, second)
    return jnp.where((half_square >= 0) & (met > 0), met, jnp.inf)


def _planes(half: Array, start: Array, slope: Array) -> Array:
    """Distances to planes, (rays, planes); infinite where missed."""
    parallel = slope[..., 2] == 0
    met = jnp.where(parallel, -1.0, -start[..., 2] / jnp.where(parallel, 1.0, slope[..., 2]))
    # Where on the rectangle it is met; an endless plane has infinite halves.
    local = jnp.abs(start[..., :2] + met[..., None] * slope[..., :2])
    return jnp.where((met > 0) & jnp.all(local <= half[:, :2], axis=-1), met, jnp.inf)


def _boxes(half: Array, start: Array, slope: Array) -> Array:
    """Distances to boxes, (rays, boxes); infinite where missed."""
    # A box is what lies between three pairs of faces. A ray along a face gets a slope that is tiny
    # but not zero, so that no 0/0 can arise.
    slope = jnp.where(jnp.abs(slope) < 1e-30, 1e-30, slope)
    low = (-half - start) / slope
    high = (half - start) / slope
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
    kinds = (_sphere_surface, _plane_surface, _box_surface)
    for kind, solids in zip(kinds, geometry.solids, strict=True):
        count = len(solids.half)
        if count:
            which = jnp.clip(hit.shape - before, 0, count - 1)
            place, frame, half = (jnp.asarray(values)[which] for values in solids)
            local_normal, its_uv = kind(half, dot((point - place)[:, None], frame))
            # From the solid's own axes to the scene's.
            its_normal = jnp.sum(local_normal[..., None] * frame, axis=1)
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


def _sphere_surface(half: Array, local: Array) -> tuple[Array, Array]:
    """Normal in the sphere's own axes, and u and v, at points there."""
    normal = local / half
    # Longitude and latitude.
    u = 0.5 + jnp.arctan2(normal[:, 1], normal[:, 0]) / (2 * jnp.pi)
    v = 0.5 + jnp.arcsin(jnp.clip(normal[:, 2], -1.0, 1.0)) / jnp.pi
    return normal, jnp.stack([u, v], axis=-1)


def _plane_surface(half: Array, local: Array) -> tuple[Array, Array]:
    """The same of a plane, whose normal is its third axis."""
    normal = jnp.broadcast_to(jnp.array([0.0, 0.0, 1.0], local.dtype), local.shape)
    endless = ~jnp.isfinite(half)
    uv = jnp.where(endless, local, 0.5 + 0.5 * local / jnp.where(endless, 1.0, half))
    return normal, uv[:, :2]


def _box_surface(half: Array, local: Array) -> tuple[Array, Array]:
    """The same of a box."""
    local = local / half
    # The face of the axis along which the point lies farthest out.
    axis = jnp.argmax(jnp.abs(local), axis=-1)
    normal = jnp.where(jnp.arange(3) == axis[:, None], jnp.sign(local), 0.0)
    # u and v run along the two other axes.
    across = jnp.asarray([[1, 2], [0, 2], [0, 1]])[axis]
    return normal, 0.5 + 0.5 * jnp.take_along_axis(local, across, axis=1)
