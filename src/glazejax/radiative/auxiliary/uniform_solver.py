"""The compiled part of the auxiliary function method on a uniform grid; `uniform` explains it.

Arrays have the segment first, then the stack, then axes of angles or, in linear systems, of cases.
"""

import functools
from collections.abc import Callable
from typing import Literal, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from ..common.exponential_integrals import expn, internal_reflection_integral
from ..common.fresnel import cos_refracted, dielectric_reflectance
from ..common.kernels import decay_integral
from ..common.linalg import matmul
from ..common.split import Split
from . import assembly, structured
from .contraction import solve_contraction
from .segments import Segments, append_axes

Variant = Literal["direct", "decomposed", "fixed_step"]
"""How the matrix comes about."""
Product = Literal["auto", "matrix", "matrices", "fft"]
"""How it acts: stack after stack, for all at once, or by its Toeplitz and Hankel numbers; "auto" is
the fastest.
"""


class GridSettings(NamedTuple):
    """Settings fixed when the program is compiled."""

    variant: Variant
    corrected: bool
    refractive_index: float
    step: float
    most: int = 0
    """Segments that the program has room for; 0 while this is not known."""
    product: Product = "matrix"


class Batch(NamedTuple):
    """Stacks, first axis; cosines have axes of angles behind it, each of length one where they do
    not vary.
    """

    albedo: Float[Array, "stacks layers"]
    thickness: Float[Array, "stacks layers"]
    ground: Float[Array, "stacks"]
    cos_incidence: Float[Array, "stacks *angles"]
    cos_viewing: Float[Array, "stacks *angles"]


@functools.partial(jax.jit, static_argnums=3)
def solve(
    batch: Batch, count: Int[Array, "stacks"], vectors: tuple, settings: GridSettings
) -> Split:
    """Parts of the reflectance factor, (stacks, *angles).

    Args:
        batch: stacks.
        count: Q of each, at most `settings.most`.
        vectors: with a fixed step, corrected: E_3 and J_2 at the edges (`KernelTable`'s e3, j2); as
            printed: H and U, e2, j1, e3, j2; else none.
        settings: static.
    """
    vectors = jax.tree.map(lambda v: jnp.asarray(v, batch.albedo.dtype), vectors)
    if settings.variant == "fixed_step" and settings.corrected:
        return _galerkin(batch, count, vectors, settings)
    if settings.variant == "fixed_step" or settings.product != "matrix":
        return _collocation(batch, count, vectors, settings)

    def one(stack_and_count: tuple[Batch, Array]) -> Split:
        alone, its_count = jax.tree.map(lambda leaf: leaf[None], stack_and_count)
        return jax.tree.map(lambda leaf: leaf[0], _collocation(alone, its_count, vectors, settings))

    # One after the other: a stack's own matrix then stays in the cache through assembly and
    # solution.
    return jax.lax.map(one, (batch, count))


class _Beam(NamedTuple):
    """A direction (stacks, *angles): its cosine inside, the transmittance of the surface, and
    exp(-h/mu).
    """

    cosine: Array
    transmittance: Array
    decay: Array

    @classmethod
    def make(cls, cos_air: Array, index: float, depth: Array) -> "_Beam":
        cosine = cos_refracted(cos_air, index)
        return cls(
            cosine,
            1.0 - dielectric_reflectance(cos_air, index),
            jnp.exp(-append_axes(depth, cosine) / cosine),
        )

    def antiderivative(self, depth: Array) -> Array:
        """Of exp(-s/mu) at depths (k, stacks), (k, stacks, *angles)."""
        s = append_axes(depth, self.cosine[None])
        return -self.cosine * jnp.exp(-s / self.cosine)


def _galerkin(batch: Batch, count: Array, vectors: tuple, settings: GridSettings) -> Split:
    """Fixed step, corrected; see the module."""
    segments = Segments.make(batch.albedo.T, batch.thickness.T, settings.step, count, settings.most)
    edges = segments.edges
    faces = segments.faces
    depth = faces[-1]

    # The source jumps at these depths only: edges of segments and faces of layers.
    depths = jnp.concatenate([edges, faces])

    def kernel(face: Array) -> Array:
        # J_2(s + s') - E_3(|s - s'|), the kernel after both integrations by parts (see `uniform`).
        reflected = internal_reflection_integral(2, face + depths, settings.refractive_index)
        # Not abs, whose slope at zero is neither side's: a face on an edge is in the segment below
        # it.
        return reflected - expn(3, jnp.where(face >= depths, face - depths, depths - face))

    # (layers, n + layers, stacks)
    to_all = assembly.computed_once(lambda: jax.lax.map(kernel, faces), 1.0 + depth)
    to_faces = to_all[:, : settings.most]
    among_faces = to_all[:, settings.most :]
    among_edges = _product(-vectors[0], vectors[1], settings)

    def apply(t: Array) -> Array:
        # Jumps of q t act on all edges and faces.
        at_edges, at_faces = segments.jumps(t)
        field_edges = among_edges(at_edges)
        field_edges += jnp.sum(to_faces[..., None] * at_faces[:, None], axis=0)
        field_faces = jnp.sum(to_faces[..., None] * at_edges, axis=1)
        field_faces += jnp.sum(among_faces[..., None] * at_faces, axis=1)
        # 2 int z z' ds of the integration by parts is on the diagonal.
        return segments.doubled[..., None] * t - 0.5 * segments.averaging.integrate(
            field_edges, field_faces
        )

    incident = _Beam.make(batch.cos_incidence, settings.refractive_index, depth)
    viewing = _Beam.make(batch.cos_viewing, settings.refractive_index, depth)
    into, out = (
        (beam.antiderivative(edges), beam.antiderivative(faces)) for beam in (incident, viewing)
    )
    # W+/(2 pi mu_0) at the top, eq. (4).
    strength = incident.transmittance / (2.0 * jnp.pi * incident.cosine)
    # M, the light that an evenly bright ground sends: the kernel's column at the ground.
    once = strength * segments.averaging.integrate(*into)  # g
    from_ground = -segments.averaging.integrate(to_faces[-1], among_faces[-1])
    scattered, from_ground = _solve(apply, segments.scattering, once, from_ground)
    visible = segments.albedo.integrate(*out)
    # Light of the beam that the layers scatter to the ground; of the ground's own, what they
    # scatter back to it.
    lit = segments.albedo.integrate(*into)
    reaching = strength * jnp.sum(append_axes(from_ground, lit) * lit, axis=0)
    back = jnp.sum(-segments.albedo.integrate(to_faces[-1], among_faces[-1]) * from_ground, axis=0)
    k = 2.0 * among_faces[-1, -1] + 1.0  # 2 J_2(2h): the kernel there is J_2(2h) - E_3(0)
    return _parts(
        batch,
        incident,
        viewing,
        settings.refractive_index,
        reaching=reaching,
        returned=k + back,
        visible=visible,
        scattered=scattered,
        from_ground=from_ground,
        single=strength * _scattered_once(batch, incident, viewing),
    )


def _collocation(batch: Batch, count: Array, vectors: tuple, settings: GridSettings) -> Split:
    """Eqs (23)-(34): midpoints; each stack's own step, or the fixed one as printed."""
    index = settings.refractive_index
    depth = jnp.sum(batch.thickness, axis=1)
    present = depth > 0
    present_segments = jnp.where(present, count, 0)  # Q
    # The operator H + U, M at the nodes and over the segments, and K.
    if settings.variant == "fixed_step":
        step = jnp.full_like(depth, settings.step)
        depth = present_segments.astype(step.dtype) * step
        toeplitz, hankel, *ground_vectors = vectors
        times = _product(toeplitz, hankel, settings)
        m, m_integrated, k = _tabulated_grounds(ground_vectors, present_segments, settings.most)
    else:
        step = jnp.where(present, depth / count.astype(depth.dtype), settings.step)
        of_stacks = (step, present_segments, settings.most, index)
        if settings.variant == "direct":
            matrix, m, m_integrated, k = assembly.direct(*of_stacks)
            times = functools.partial(_alone, matrix[0])
        else:
            toeplitz, hankel, m, m_integrated, k = assembly.decomposed_numbers(*of_stacks)
            times = _product(toeplitz, hankel, settings)

    # The beam's light in each segment, and how much of each segment is seen.
    incident, viewing = (
        _Beam.make(c, index, depth) for c in (batch.cos_incidence, batch.cos_viewing)
    )
    strength = incident.transmittance / (2.0 * jnp.pi * incident.cosine)
    edges = jnp.arange(settings.most + 1, dtype=depth.dtype)[:, None] * step
    if settings.corrected:
        # Means over a segment, in which an interface may lie.
        segments = Segments.make(batch.albedo.T, batch.thickness.T, step, count, settings.most)
        albedo = jnp.where(present, segments.scattering / step, 0.0)

        into, out = (
            (beam.antiderivative(segments.edges), beam.antiderivative(segments.faces))
            for beam in (incident, viewing)
        )
        visible = segments.albedo.integrate(*out)
        once = strength * segments.averaging.integrate(*into)
        single = strength * _scattered_once(batch, incident, viewing)
    else:
        # As printed: each segment is what its midpoint is.
        middle = edges[:-1] + 0.5 * step
        layer = jnp.sum(jnp.cumsum(batch.thickness, axis=1).T[:-1, None] <= middle, axis=0)
        albedo = jnp.take_along_axis(batch.albedo.T, layer, axis=0)
        albedo = jnp.where(jnp.arange(settings.most)[:, None] < present_segments, albedo, 0.0)
        visible = viewing.antiderivative(edges)
        visible = append_axes(albedo, visible) * (visible[1:] - visible[:-1])
        once = strength * jnp.exp(-append_axes(middle, incident.cosine[None]) / incident.cosine)
        single = 0.5 * jnp.sum(visible * once, axis=0)

    def scatter(t: Array) -> Array:
        """1/2 (H + U) P t."""
        return 0.5 * times(albedo[..., None] * t)

    scattered, from_ground = _solve(scatter, albedo, once, m)
    # Scattered light that reaches the ground: of the beam, and of the ground itself.
    reaching = jnp.sum(append_axes(m_integrated * albedo, once) * (once + scattered), axis=0)
    back = jnp.sum(m_integrated * albedo * from_ground, axis=0)
    return _parts(
        batch,
        incident,
        viewing,
        index,
        reaching=reaching,
        returned=k + back,
        visible=visible,
        scattered=scattered,
        from_ground=from_ground,
        single=single,
    )


def _solve(apply, weight: Array, once: Array, ground: Array) -> tuple[Array, Array]:
    """Auxiliary function f of the beam's light (n, stacks, *angles) and of an evenly bright
    ground's (n, stacks).

    Both without the ground's further reflections, which are a number for each stack. ``once`` is g;
    t = f + g is what the equation is solved for.
    """
    sources = jnp.concatenate([once.reshape(*once.shape[:2], -1), ground[..., None]], axis=-1)
    fields = solve_contraction(apply, weight[..., None], sources)
    return fields[..., :-1].reshape(once.shape) - once, fields[..., -1]


def _product(toeplitz: Array, hankel: Array, settings: GridSettings) -> Callable[[Array], Array]:
    """x -> (H + U) x of (n, stacks, cases), from numbers that stacks share, (n,), or of their own,
    (stacks, n).
    """
    if settings.product == "fft":
        return functools.partial(structured.times, structured.spectra(toeplitz, hankel))
    matrix = assembly.toeplitz_plus_hankel(toeplitz, hankel)
    if matrix.ndim == 2:
        return lambda x: matmul(matrix, x.reshape(settings.most, -1)).reshape(x.shape)
    if settings.product == "matrix":
        return functools.partial(_alone, matrix[0])
    return lambda x: jnp.swapaxes(matmul(matrix, jnp.swapaxes(x, 0, 1)), 0, 1)


def _alone(matrix: Array, x: Array) -> Array:
    """(H + U) x of one stack, (n, 1, cases), from its matrix, which is symmetric."""
    rows = x[:, 0].T
    # A few rows one by one, which XLA does several times faster on the CPU than together.
    together = len(rows) > 3
    product = matmul(rows, matrix) if together else jnp.stack([matmul(row, matrix) for row in rows])
    return product.T[:, None]


def _tabulated_grounds(tables: list[Array], count: Array, most: int) -> tuple[Array, Array, Array]:
    """M, M' and K by the table: h is a multiple of the step, so that all depths in them
    are, too.
    """
    e2, j1, e3, j2 = tables

    def of_stack(count: Array) -> tuple[Array, Array, Array]:
        return assembly.ground(e2, j1, e3, j2[count + jnp.arange(most + 1)], count)

    return jax.vmap(of_stack, out_axes=(1, 1, 0))(count)


def _scattered_once(batch: Batch, incident: _Beam, viewing: _Beam) -> Array:
    """1/2 int q exp(-s/mu_0) exp(-s/mu) ds, exact."""
    rate = (1.0 / incident.cosine + 1.0 / viewing.cosine)[:, None]
    # Each layer in closed form, dimmed on both ways by what lies above it.
    top = jnp.cumsum(batch.thickness, axis=1) - batch.thickness
    q, above, d = (append_axes(a, rate) for a in (batch.albedo, top, batch.thickness))
    return 0.5 * jnp.sum(q * jnp.exp(-above * rate) * decay_integral(rate, d), axis=1)


def _parts(
    batch: Batch,
    incident: _Beam,
    viewing: _Beam,
    index: float,
    *,
    reaching: Array,
    returned: Array,
    visible: Array,
    scattered: Array,
    from_ground: Array,
    single: Array,
) -> Split:
    """Radiance below the surface, by eq. (32), as parts of the reflectance factor.

    Light of the beam and light of an evenly bright ground; the ground's brightness B closes the
    circle of what it sends up and gets back.

    Args:
        batch: stacks.
        incident, viewing: beams.
        index: refractive index.
        reaching: radiance of the beam's scattered light at the ground, (stacks, *angles).
        returned: share of the ground's light that comes back to it, (stacks,).
        visible: share of each segment's light that is seen, (n, stacks, *angles).
        scattered, from_ground: of `_solve`.
        single: radiance of light scattered once, (stacks, *angles).
    """
    not_returned = append_axes(1.0 - batch.ground * returned, incident.cosine)
    # B, eq. (34), and the ground's radiance, rho B/pi.
    arriving = (incident.transmittance * incident.decay + jnp.pi * reaching) / not_returned
    leaving = append_axes(batch.ground, arriving) / jnp.pi * arriving
    multiple = jnp.sum(visible * scattered, axis=0) + leaving * jnp.sum(
        visible * append_axes(from_ground, visible), axis=0
    )
    factor = jnp.pi / index**2 * viewing.transmittance / viewing.cosine
    radiances = (leaving * viewing.cosine * viewing.decay, single, 0.5 * multiple)
    shape = jnp.broadcast_shapes(*(radiance.shape for radiance in radiances))
    return Split(*(jnp.broadcast_to(factor * radiance, shape) for radiance in radiances))
