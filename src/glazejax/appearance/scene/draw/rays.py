"""Points that each ray of a picture meets: nearest surfaces, shadows and mirror reflections,
without any spectrum.

Bounces of rays: those of the camera, then those that mirrors send on, and so on. A bounce keeps of
each point what its colour needs, which is a few cosines and which lights reach it; colours are
computed from that, for all bands at once and only where there is something to see (`shade`).
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeAlias

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from ....radiative.common.chunks import by_blocks
from ..lights import Light, ParallelLight, PointLight
from ..shapes import vector
from .intersect import Geometry, Hit, nearest, surface
from .triangles import HostVectors, dot

PerLight: TypeAlias = Float[np.ndarray, "points lights"]
"""A number a point and light."""

Indices: TypeAlias = Int[np.ndarray, "points"]
"""Numbers of things."""

PerPoint: TypeAlias = Float[np.ndarray, "points"]
"""A number a point."""

# Rays that go through the processor together, and the sizes that fewer of them are filled up to.
TILE = 2**14
_SIZES = (2**8, 2**11, TILE)

Reflects = Callable[[int, PerPoint], PerPoint]
"""From the number of a material and cosines of viewing to the most that its mirror reflection
carries; 0 for none.
"""


class Lamps(NamedTuple):
    """Positions of the light sources."""

    position: Float[np.ndarray, "lights 3"]
    """Position of a point light; unit vector towards a parallel one."""
    point: Bool[np.ndarray, "lights"]
    """Which are point lights."""


class Bounce(NamedTuple):
    """Points that rays of one bounce meet, (points,) each, in NumPy."""

    parent: Indices
    """Number of the point of the bounce before whose mirror reflection this is; of the camera's ray
    in the first.
    """
    shape: Indices
    """Number of the shape in the scene; -1 where there is nothing."""
    material: Indices
    """Number of the material; -1 where there is nothing."""
    cos_view: PerPoint
    uv: Float[np.ndarray, "points 2"]
    strength: PerLight
    """Of each light at the point: 1, or the inverse square of the distance; 0 in shadow and where
    it is behind.
    """
    cos_light: PerLight
    between: PerLight
    """Cosine between view and light."""
    position: Float[np.ndarray, "points 3"]
    """Where the point is, a little off the surface."""

    @property
    def bytes(self) -> int:
        """Memory that it takes."""
        return sum(array.nbytes for array in self)


def lamps(lights: Sequence[Light]) -> Lamps:
    """Places of the lights of a scene."""
    positions = []
    for light in lights:
        if isinstance(light, PointLight):
            positions.append(vector("position", light.position))
        elif isinstance(light, ParallelLight):
            positions.append(-vector("direction", light.direction, direction=True))
        else:
            raise ValueError("an area light has no one place: path_trace draws it")
    return Lamps(np.array(positions), np.array([isinstance(x, PointLight) for x in lights]))


@jax.jit
def _meet(geometry: Geometry, hit: Hit, sources: Lamps, origin: Array, direction: Array):
    """Bounce: points where rays arrive, before anything is in shadow.

    Returns:
        Numbers of shape and material, cosine of viewing and texture coordinates; then of each
        light, (lights, rays): strength, cosine of its fall and that between view and light, unit
        vector to it and how far it is (-1 where it is behind); then the place, and the direction in
        which a mirror there sends the ray on.
    """
    hits = jnp.isfinite(hit.distance)
    surfaces = surface(geometry, hit, origin, direction)
    # A step off the face, so that the next ray does not meet it again.
    clearance = jnp.asarray(geometry.clearance, origin.dtype)
    arrival = (
        origin + jnp.where(hits, hit.distance, 0.0)[:, None] * direction + clearance * surfaces.face
    )
    cos_view = jnp.clip(-dot(surfaces.normal, direction), 0.0, 1.0)
    # A point light lies at a place, a parallel one in a direction; (lights, rays, 3).
    is_point = sources.point[:, None]
    positions = jnp.asarray(sources.position, origin.dtype)[:, None]
    away = positions - jnp.where(is_point[..., None], arrival, 0.0)
    square = dot(away, away)
    distance = jnp.sqrt(jnp.where(square > 0, square, 1.0))
    towards = away / distance[..., None]
    cosine = jnp.clip(dot(surfaces.normal, towards), -1.0, 1.0)
    # A light behind the smooth normal or behind the face itself gives nothing.
    lit = hits & (square > 0) & (cosine > 0) & (dot(surfaces.face, towards) > 0)
    strength = jnp.where(lit, jnp.where(is_point, 1.0 / distance**2, 1.0), 0.0)
    between = jnp.clip(-dot(direction, towards), -1.0, 1.0)
    reach = jnp.where(lit, jnp.where(is_point, distance, jnp.inf), -1.0)
    # The mirror's direction.
    onward = direction + 2.0 * cos_view[:, None] * surfaces.normal
    # A smooth normal may send a ray into the face.
    into = dot(onward, surfaces.face)
    onward = onward + jnp.where(into < 0, -2.0 * into, 0.0)[:, None] * surfaces.face
    onward = onward / jnp.sqrt(dot(onward, onward))[:, None]
    shape = jnp.where(hits, jnp.asarray(geometry.order)[hit.shape], -1)
    material = jnp.where(hits, jnp.asarray(geometry.material)[hit.shape], -1)
    return (
        shape,
        material,
        cos_view,
        surfaces.uv,
        strength,
        cosine,
        between,
        towards,
        reach,
        arrival,
        onward,
    )


def trace(
    geometry: Geometry,
    sources: Lamps,
    origin: HostVectors,
    direction: HostVectors,
    *,
    reflects: Reflects,
    most_bounces: int,
) -> list[Bounce]:
    """Follow rays to what they meet, and on from mirrors.

    Args:
        geometry: shapes of the scene.
        sources: of its lights.
        origin, direction: of the rays, unit directions.
        reflects: see `Reflects`.
        most_bounces: how many mirror reflections are followed.

    Returns:
        Bounces, at least one. Their points are in the order of the rays that led there.
    """
    bounces: list[Bounce] = []
    # Rays of the camera carry all of their light.
    parent = np.arange(len(origin))
    share = np.ones(len(origin))
    while True:
        *fields, onward = _cast(geometry, sources, origin, direction)
        bounces.append(Bounce(parent, *fields))
        material = bounces[-1].material
        cos_view = bounces[-1].cos_view
        if len(bounces) > most_bounces:
            return bounces
        mirrored = np.zeros(len(material))
        for number in np.unique(material[material >= 0]):
            mine = material == number
            mirrored[mine] = reflects(int(number), cos_view[mine])
        share = share * mirrored
        # Rays that could carry less than this share of light to the eye are not followed.
        go = np.flatnonzero(share > 1e-3)
        if go.size == 0:
            return bounces
        parent = go
        share = share[go]
        origin = bounces[-1].position[go]
        direction = onward[go]


def filled_size(count: int) -> int:
    """The number that so many rays or points are filled up to."""
    return next((size for size in _SIZES if size >= count), -(-count // TILE) * TILE)


def _cast(
    geometry: Geometry, sources: Lamps, origin: np.ndarray, direction: np.ndarray
) -> tuple[np.ndarray, ...]:
    """Fields of a `Bounce` but the first, the last of them where the rays are; then the rays that
    mirrors send on. Any number of rays goes in pieces of few sizes, so that few programs are
    compiled.
    """
    float_type = jnp.result_type(float)

    def run(rows: Int[np.ndarray, "block"]) -> tuple[np.ndarray | Array, ...]:
        rays = [jnp.asarray(a[rows], float_type) for a in (origin, direction)]
        hit = nearest(geometry, *rays)
        *fields, strength, cos_light, between, towards, reach, points, onward = _meet(
            geometry.arrays, hit, sources, *rays
        )
        # A light counts where nothing stands between it and the point.
        beams = zip(towards, reach, strict=True)
        free = [nearest(geometry, points, *beam).shape < 0 for beam in beams]
        lit = jnp.where(jnp.stack(free), strength, 0.0)
        lights = [np.asarray(a).T for a in (lit, cos_light, between)]
        return *fields, *lights, points, onward

    count = len(origin)
    # Copies: bounces are kept, and not what filled them up.
    return tuple(map(np.copy, by_blocks(count, min(filled_size(count), TILE), run)))
