"""A uniform grid of optical depth that layers do not fit: integrals over its segments, interfaces and end exact.

Segments are as wide as the step but for the last one, which ends where the glaze ends. A source q(s) t(s) with t
constant in each segment changes by jumps only, at the segments' edges and at the layers' interfaces, so every
integral of it against a kernel's derivative is a sum over those jumps: no segment has to hold one albedo only.

Arrays have the segment (or the layer) first, the stack second; N is the largest number of segments, and those that a
stack does not have hold no albedo.
"""

import functools
from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

# Relative to the step: a segment with less scattering in it holds none.
_NEGLIGIBLE = 1e-12


class Segments(NamedTuple):
    """Segments of every stack; their left edges, the layers' lower faces and the albedos on both."""

    edges: Float[Array, "n stacks"]
    """Depth of each segment's left edge."""
    faces: Float[Array, "layers stacks"]
    """Depth of each layer's lower face; the last is the ground."""
    held_by: Int[Array, "layers stacks"]
    """Number of the segment that holds each face."""
    edge_albedo: Float[Array, "n stacks"]
    """Albedo at the left edge; 0 where there is no segment."""
    drop: Float[Array, "layers stacks"]
    """How much the albedo falls at each face; at the ground all of it."""
    scattering: Float[Array, "n stacks"]
    """int_segment q ds, exactly 0 where negligible."""
    doubled: Float[Array, "n stacks"]
    """int_segment q^2 ds over int_segment q ds."""

    @classmethod
    def make(
        cls,
        albedo: Float[Array, "layers stacks"],
        thickness: Float[Array, "layers stacks"],
        step: float | Float[Array, "stacks"],
        count: Int[Array, "stacks"],
        most: int,
    ) -> "Segments":
        """Segments of stacks whose number of segments is `count`, at most `most`."""
        faces = jnp.cumsum(thickness, axis=0)
        index = jnp.arange(most)[:, None]
        edges = index * step * jnp.ones_like(faces[-1])
        # A face on an edge is in the segment below; by comparison, so that rounding cannot set the two apart.
        above = jnp.sum(faces[:, None] >= edges, axis=1, dtype=count.dtype)
        held = jnp.clip(above - 1, 0, count - 1).at[-1].set(count - 1)
        layer = jnp.sum(held[:-1, None] < index, axis=0)
        present = index < count

        def with_albedo(q: Array) -> Segments:
            edge = jnp.where(present, jnp.take_along_axis(q, layer, axis=0), 0.0)
            drop = jnp.concatenate([q[:-1] - q[1:], q[-1:]])
            nothing = jnp.zeros_like(edge)
            return cls(edges, faces, held, edge, drop, nothing, nothing)

        first, second = with_albedo(albedo), with_albedo(albedo**2)
        scattering = first.integrate(edges, faces)
        enough = scattering > _NEGLIGIBLE * step
        safe = jnp.where(enough, scattering, 1.0)
        doubled = jnp.where(enough, second.integrate(edges, faces) / safe, 0.0)
        return first._replace(scattering=jnp.where(enough, scattering, 0.0), doubled=doubled)

    def integrate(
        self, at_edges: Float[Array, "n stacks *cases"], at_faces: Float[Array, "layers stacks *cases"]
    ) -> Float[Array, "n stacks *cases"]:
        """int_segment q v' ds of a function v known at edges and faces; exact."""
        edge, drop = append_axes(self.edge_albedo, at_edges), append_axes(self.drop, at_faces)
        left = edge * at_edges
        right = jnp.concatenate([left[1:], jnp.zeros_like(left[:1])])
        return right - left + self._spread(drop * at_faces)

    def average(
        self, at_edges: Float[Array, "n stacks *cases"], at_faces: Float[Array, "layers stacks *cases"]
    ) -> Float[Array, "n stacks *cases"]:
        """Mean of v' over each segment, weighted by the albedo; unweighted where nothing scatters."""
        positive = self.scattering > 0
        weighted = self.integrate(at_edges, at_faces) / append_axes(jnp.where(positive, self.scattering, 1.0), at_edges)
        last = self._inside(-1)
        right = jnp.concatenate([at_edges[1:], at_edges[-1:]])
        right = jnp.where(append_axes(last, at_edges), at_faces[-1], right)
        end = jnp.where(last, self.faces[-1], jnp.concatenate([self.edges[1:], self.edges[-1:]]))
        width = end - self.edges
        plain = jnp.where(
            append_axes(width > 0, at_edges),
            (right - at_edges) / append_axes(jnp.where(width > 0, width, 1.0), at_edges),
            0,
        )
        return jnp.where(append_axes(positive, at_edges), weighted, plain)

    def jumps(self, t: Float[Array, "n stacks *cases"]) -> tuple[Array, Array]:
        """By how much q t rises at every edge (n, stacks, *cases) and face (layers, stacks, *cases)."""
        before = jnp.concatenate([jnp.zeros_like(t[:1]), t[:-1]])
        return append_axes(self.edge_albedo, t) * (t - before), -append_axes(self.drop, t) * self._at_faces(t)

    def _inside(self, layer: int) -> Bool[Array, "n stacks"]:
        """Whether the segment holds the face of this layer."""
        return self.held_by[layer] == jnp.arange(self.edges.shape[0])[:, None]

    def _spread(self, at_faces: Array) -> Array:
        """Sum over the faces in each segment."""
        terms = (jnp.where(append_axes(self._inside(k), at_faces), at_faces[k], 0.0) for k in range(at_faces.shape[0]))
        return functools.reduce(jnp.add, terms)

    def _at_faces(self, t: Array) -> Array:
        """Value in the segment of each face."""
        return jnp.take_along_axis(t, append_axes(self.held_by, t), axis=0)


def append_axes(array: Array, like: Array) -> Array:
    """Append axes of length one, so that it broadcasts against `like`."""
    return array.reshape(*array.shape, *(1,) * (like.ndim - array.ndim))
