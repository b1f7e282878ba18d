"""A uniform grid of optical depth that layers do not fit: integrals over its segments, interfaces
and end exact.

Segments are as wide as the step but for the last one, which ends where the glaze ends. A source
q(s) t(s) with t constant in each segment changes by jumps only, at the segments' edges and at the
layers' interfaces, so every integral of it against a kernel's derivative is a sum over those jumps:
no segment has to hold one albedo only.

Arrays have the segment (or the layer) first, the stack second; N is the largest number of segments,
and those that a stack does not have hold no albedo.
"""

from typing import NamedTuple, TypeAlias

import jax.numpy as jnp
from jaxtyping import Array, Float, Int

PerSegment: TypeAlias = Float[Array, "n stacks"]
"""A number for each segment of each stack."""


class SegmentWeights(NamedTuple):
    """Factors of a function's values at the edges and faces of segments, which make an integral of
    its slope over each segment.
    """

    edges: PerSegment
    """At left edges, to be subtracted."""
    next_edges: PerSegment
    """At right edges."""
    faces: Float[Array, "layers stacks"]
    """At layers' lower faces."""
    held_by: Int[Array, "layers stacks"]
    """Number of the segment that holds each face."""

    def integrate(
        self,
        at_edges: Float[Array, "n stacks *cases"],
        at_faces: Float[Array, "layers stacks *cases"],
    ) -> Float[Array, "n stacks *cases"]:
        """Integrals over the segments; exact."""
        edges, next_edges, faces = (append_axes(a, at_edges) for a in self[:3])
        at_faces = faces * at_faces
        number = jnp.arange(at_edges.shape[0])[:, None]
        holds = self.held_by[:, None] == number
        at_faces = at_faces[:, None]
        within = jnp.sum(jnp.where(append_axes(holds, at_faces), at_faces, 0.0), axis=0)
        between = next_edges * _below(at_edges) - edges * at_edges
        return between + within


class Segments(NamedTuple):
    """Segments of every stack; their left edges, the layers' lower faces and the albedos
    on both.
    """

    edges: PerSegment
    """Depth of each segment's left edge."""
    faces: Float[Array, "layers stacks"]
    """Depth of each layer's lower face; the last is the ground."""
    albedo: SegmentWeights
    """Of int_segment q v' ds: the albedo at the edges, 0 where there is no segment, and how much it
    falls at each face; at the ground all of it.
    """
    scattering: PerSegment
    """int_segment q ds, exactly 0 where negligible."""
    doubled: PerSegment
    """int_segment q^2 ds over int_segment q ds."""
    averaging: SegmentWeights
    """Of the mean of v' over each segment, weighted by the albedo; unweighted where nothing
    scatters.
    """

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
        edges = index.astype(faces.dtype) * step * jnp.ones_like(faces[-1])
        # A face on an edge is in the segment below; by comparison, so that rounding cannot set the
        # two apart.
        above = jnp.sum(faces[:, None] >= edges, axis=1, dtype=count.dtype)
        holder = jnp.clip(above - 1, 0, count - 1).at[-1].set(count - 1)
        layer = jnp.sum(holder[:-1, None] < index, axis=0)
        present = index < count

        # By parts: q v at the right edge less that at the left, and at each face the albedo's drop.
        def by_albedo(q: Array) -> SegmentWeights:
            edge = jnp.where(present, jnp.take_along_axis(q, layer, axis=0), 0.0)
            falls = jnp.concatenate([q[:-1] - q[1:], q[-1:]])
            return SegmentWeights(edges=edge, next_edges=_below(edge), faces=falls, held_by=holder)

        first = by_albedo(albedo)
        scattering = first.integrate(edges, faces)
        # A segment with less scattering in it, relative to the step, holds none.
        enough = scattering > 1e-12 * step
        safe = jnp.where(enough, scattering, 1.0)
        squared = by_albedo(albedo**2).integrate(edges, faces)
        # Weighted by the albedo; by the depth alone where nothing scatters, the limit of a faint
        # albedo.
        last = index == count - 1
        width = jnp.where(last, faces[-1] - edges, step)
        share = jnp.where(
            enough,
            1.0 / safe,
            jnp.where(present & (width > 0), 1.0 / jnp.where(width > 0, width, 1.0), 0.0),
        )
        end = jnp.zeros_like(faces).at[-1].set(1.0)
        share_at_faces, enough_at_faces = (
            jnp.take_along_axis(x, holder, axis=0) for x in (share, enough)
        )
        averaging = SegmentWeights(
            edges=share * jnp.where(enough, first.edges, 1.0),
            next_edges=share * jnp.where(enough, first.next_edges, jnp.where(last, 0.0, 1.0)),
            faces=share_at_faces * jnp.where(enough_at_faces, first.faces, end),
            held_by=holder,
        )
        return cls(
            edges=edges,
            faces=faces,
            albedo=first,
            scattering=jnp.where(enough, scattering, 0.0),
            doubled=jnp.where(enough, squared / safe, 0.0),
            averaging=averaging,
        )

    def jumps(self, t: Float[Array, "n stacks *cases"]) -> tuple[Array, Array]:
        """By how much q t rises at every edge (n, stacks, *cases) and face (layers, stacks,
        *cases).
        """
        before = jnp.concatenate([jnp.zeros_like(t[:1]), t[:-1]])
        albedo = SegmentWeights(*(append_axes(a, t) for a in self.albedo))
        at_faces = jnp.take_along_axis(t, albedo.held_by, axis=0)
        return albedo.edges * (t - before), -albedo.faces * at_faces


def _below(array: Array) -> Array:
    """Values of the next segment; zero below the last."""
    return jnp.concatenate([array[1:], jnp.zeros_like(array[:1])])


def append_axes(array: Array, like: Array) -> Array:
    """Append axes of length one, so that it broadcasts against `like`."""
    return array.reshape(*array.shape, *(1,) * (like.ndim - array.ndim))
