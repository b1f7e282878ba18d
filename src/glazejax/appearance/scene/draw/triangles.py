"""Rays against the triangles of meshes: trimesh names the triangle, and the distance follows in
double precision.

trimesh asks Embree where embreex is installed, and searches itself otherwise, much slower. Embree
counts in single
precision: a ray may be said to meet the triangle that it starts from, and then looks again from a
little further on.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple, TypeAlias, overload

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from ....extras import advice
from ..mesh import import_trimesh
from ..shapes import Mesh

Vectors: TypeAlias = Float[Array, "rays 3"]
"""A vector a ray."""

HostVectors: TypeAlias = Float[np.ndarray, "rays 3"]
"""A vector a ray, in NumPy."""


@overload
def dot(first: np.ndarray, second: np.ndarray) -> np.ndarray: ...
@overload
def dot(first: Array, second: Array | np.ndarray) -> Array: ...
def dot(first: Any, second: Any) -> Any:
    """Scalar products of vectors, (..., 3), in NumPy or JAX."""
    return (first * second).sum(axis=-1)


class Triangles(NamedTuple):
    """Triangles of all meshes."""

    corners: Float[np.ndarray, "triangles 3 3"]
    """Points, corner by corner."""
    normals: Float[np.ndarray, "triangles 3 3"]
    """At the three corners; unit vectors."""
    face: Float[np.ndarray, "triangles 3"]
    """Unit normal of the triangle itself; 0 where it has no area."""
    uv: Float[np.ndarray, "triangles 3 2"]
    shape: Int[np.ndarray, "triangles"]
    """Number of the mesh among all shapes."""


def make_triangles(meshes: Sequence[Mesh], before: int) -> Triangles:
    """Arrays of all triangles.

    Args:
        meshes: at least one.
        before: number of shapes that come before the first mesh.
    """

    def of_corners(values: list[np.ndarray | None], width: int) -> np.ndarray:
        """Numbers of each triangle's corners; zeros for a mesh that has none."""
        return np.concatenate(
            [
                np.zeros((len(mesh.faces), 3, width))
                if numbers is None
                else np.asarray(numbers, float)[np.asarray(mesh.faces)]
                for mesh, numbers in zip(meshes, values, strict=True)
            ]
        )

    corners = of_corners([mesh.vertices for mesh in meshes], 3)
    smooth = of_corners([mesh.normals for mesh in meshes], 3)
    face = _unit(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    # A corner without a normal of its own has the face's.
    has_own = np.linalg.norm(smooth, axis=-1, keepdims=True) > 0
    return Triangles(
        corners=corners,
        normals=np.where(has_own, _unit(smooth), face[:, None]),
        face=face,
        uv=of_corners([mesh.uv for mesh in meshes], 2),
        shape=before + np.repeat(np.arange(len(meshes)), [len(mesh.faces) for mesh in meshes]),
    )


def _unit(vectors: Float[np.ndarray, "*vectors 3"]) -> Float[np.ndarray, "*vectors 3"]:
    """Vectors of length 1; what has no length stays."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(length > 0, length, 1.0)


class TriangleCaster:
    """Finds the nearest of many triangles for rays; works on the host, outside JAX.

    Raises:
        ValueError: trimesh is not there, or neither of the engines that it casts rays with.
    """

    def __init__(self, triangles: Triangles):
        trimesh = import_trimesh()
        self._triangles = triangles
        points = triangles.corners.reshape(-1, 3)
        # About their middle, where single precision has most of its digits.
        self._middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
        points = points - self._middle
        self._radius = 1.001 * float(np.linalg.norm(points, axis=1).max())
        self._engine = trimesh.Trimesh(
            points, np.arange(len(points)).reshape(-1, 3), process=False
        ).ray
        try:
            self._engine.intersects_first(np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]]))
        except ImportError:
            raise ValueError(advice("embreex")) from None

    def nearest(
        self,
        origin: HostVectors,
        direction: HostVectors,
        limit: Float[np.ndarray, "rays"],
    ) -> tuple[Float[np.ndarray, "rays"], Int[np.ndarray, "rays"], HostVectors]:
        """Distance and number of the nearest triangle nearer than the limit, and the weights of its
        corners at that point; the limit, -1 and 0 where there is none.
        """
        best = limit.copy()
        triangle = np.full(len(limit), -1)
        weights = np.zeros(origin.shape)
        # From where rays enter the sphere around all meshes: single precision is fine there.
        offset = origin - self._middle
        # Distance to the middle of the ray's way through that sphere, and half of this way.
        middle = -dot(offset, direction)
        aside = offset + middle[:, None] * direction
        half = np.sqrt(np.maximum(self._radius**2 - dot(aside, aside), 0.0))
        start = np.maximum(middle - half, 0.0)
        going = np.flatnonzero((half > 0) & (middle + half > 0) & (start < limit))
        # What is found but does not lie ahead is where the ray comes from: start farther on.
        # First step away from a triangle that a ray is wrongly said to meet, in radii of all
        # meshes; each next is doubled.
        step = 1e-6 * self._radius
        while going.size:
            candidate = self._engine.intersects_first(
                offset[going] + start[going, None] * direction[going], direction[going]
            )
            going = going[candidate >= 0]
            candidate = candidate[candidate >= 0]
            distance, shares, ahead = self._meet(candidate, origin[going], direction[going])
            near = ahead & (distance < limit[going])
            best[going[near]] = distance[near]
            triangle[going[near]] = candidate[near]
            weights[going[near]] = shares[near]
            going = going[~ahead]
            start[going] += step
            step *= 2
        return best, triangle, weights

    def _meet(
        self, which: np.ndarray, origin: np.ndarray, direction: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Distances of a triangle for each ray, weights of its corners there, (rays, 3), and
        whether it lies ahead.

        Source: T. Möller, B. Trumbore, Journal of Graphics Tools 2 (1997) 21.
        """
        corners = self._triangles.corners[which]
        edge1 = corners[:, 1] - corners[:, 0]
        edge2 = corners[:, 2] - corners[:, 0]
        offset = origin - corners[:, 0]
        across = np.cross(direction, edge2)
        normal_to_offset = np.cross(offset, edge1)
        with np.errstate(divide="ignore", invalid="ignore"):
            scale = 1.0 / dot(edge1, across)
            u = scale * dot(offset, across)
            v = scale * dot(direction, normal_to_offset)
            ahead = ~(scale * dot(edge2, normal_to_offset) <= 0)
        # Rounding may put the point a little outside, and far outside where the triangle is seen
        # edge-on.
        u, v = (np.clip(np.nan_to_num(weight), 0.0, 1.0) for weight in (u, v))
        weights = np.stack([1.0 - u - v, u, v], axis=1)
        # In double precision, by the point on the triangle.
        distance = dot(_at_weights(weights, corners) - origin, direction)
        return distance, weights, ahead & (distance > 0)


def triangle_surface(
    triangles: Triangles, number: Int[Array, "rays"], weights: Vectors
) -> tuple[Vectors, Vectors, Float[Array, "rays 2"]]:
    """Smooth normal, normal of the face and texture coordinates where the corners of triangles have
    these weights.
    """
    corners = jax.tree.map(lambda values: jnp.asarray(values)[number], triangles)
    normal = _at_weights(weights, corners.normals)
    length = jnp.sqrt(dot(normal, normal))[:, None]
    normal = jnp.where(length > 0, normal / jnp.where(length > 0, length, 1.0), corners.face)
    return normal, corners.face, _at_weights(weights, corners.uv)


def _at_weights(weights: Any, corners: Any) -> Any:
    """What three corners have, (rays, 3, ...), where they have weights, (rays, 3)."""
    return (weights[..., None] * corners).sum(axis=1)
