r"""Default solver: discrete ordinates in even-parity form for isotropically scattering layers.

    air          beam in \   / radiance out
    ------------------------------------------  smooth interface, Fresnel R(mu)
    layer 1      albedo q_1, optical thickness D_1
    layer 2      q_2, D_2                              tau down
    ///////////  Lambertian ground rho

With half-range cosines mu_i, weights w_i and radiances L+ (down), L- (up) put

    sigma = sqrt(w) mu (L+ + L-),      delta = sqrt(w) (L+ - L-) = -sigma'.

In a layer sigma = Y y with y'' = lambda y - q zeta e^(-tau/mu_0) (see `modes`). Taking sigma at a layer's top
(y0) and delta at its bottom (f) as unknowns gives, with T = tanh(kappa D)/kappa and S = sech(kappa D),

    delta at the top     lambda T y0 + S f - b_s
    sigma at the bottom  S y0 - T f - b_f

a symmetric two-port whose entries stay bounded for an empty layer, an opaque one and q = 1. Joined over the layers
it is one symmetric system K x = b. Beam and view load it in the same way, so with b_I of the incidence and b_F of the
viewing direction the reflectance is the stationary value of

    R = C [ G + b_F.x_I + x_F.b_I - x_F.K x_I ],      K x_I = b_I,  K x_F = b_F,

G being the paths that never meet K (single scattering in a layer, ground seen directly). Reciprocity is then
symmetry, and a derivative needs no derivative of x: one more load, not one more program.

The physics is paper A (Shinozawa et al. 2013), eqs (4)-(22), with its integrals over mu done by quadrature.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array

from glazejax.radiative.directions import Directions, Resolution, half_range
from glazejax.radiative.fresnel import cos_refracted, dielectric_reflectance
from glazejax.radiative.kernels import decay_integral, sech_sqrt, tanhc_sqrt, two_decays
from glazejax.radiative.linalg import solve_positive
from glazejax.radiative.modes import Modes, layer_modes

# Modes slower than this take the form that is even in kappa; no beam (decay >= 1) resonates with them.
_SLOW = 0.25


class Stack(NamedTuple):
    """Everything a reflectance depends on. Batch axis first; layers top first."""

    albedo: Array  # (batch, layers)
    optical_thickness: Array  # (batch, layers)
    ground: Array  # (batch,)
    refractive_index: Any  # (batch,), or one number
    cos_incidence: Array  # (batch,), in air
    cos_viewing: Array | None  # (batch,), in air; None for the hemispherical flux


class Load(NamedTuple):
    """Right-hand side of the joined system for one beam (or for diffuse light from above)."""

    top: Array  # (batch, n), on sigma at the interface
    layer_top: Array  # (layers, batch, n), b_s in modes
    layer_bottom: Array  # (layers, batch, n), b_f in modes
    ground: Array  # (batch, n)


class Field(NamedTuple):
    """Solution x of the joined system."""

    mode_top: Array  # (layers, batch, n), y0
    mode_flux: Array  # (layers, batch, n), f
    ground: Array  # (batch, n), sigma at the ground


def _levels(modes: Modes, field: Field) -> Array:
    """Sigma at the layers' tops and at the ground, (layers + 1, batch, n)."""
    return jnp.concatenate([_apply(modes.vectors, field.mode_top), field.ground[None]])


def _dot(load: Load, field: Field, sigma: Array) -> Array:
    """b . x, (batch,)."""
    inside = jnp.sum(load.layer_top * field.mode_top + load.layer_bottom * field.mode_flux, axis=(0, -1))
    return inside + jnp.sum(load.top * sigma[0] + load.ground * sigma[-1], axis=-1)


class Medium(NamedTuple):
    """The discretised operator K."""

    modes: Modes  # (layers, batch, ...)
    tanh: Array  # (layers, batch, n), T
    root: Array  # (layers, batch, n), sqrt(T/D), positive for an empty layer too
    thickness: Array  # (layers, batch), D
    sech: Array  # (layers, batch, n), S
    interface: Array  # (n,) or (batch, n): (1 - R)/((1 + R) mu)
    ground_diagonal: Array  # (n,) or (batch, n): 1/mu
    ground_vector: Array  # (n,) or (batch, n): sqrt(w)
    ground_factor: Array  # (batch,): 4 rho/(1 + rho)


class Beam(NamedTuple):
    """A collimated direction inside the medium."""

    decay: Array  # (batch,), 1/mu inside
    transmittance: Array  # (batch,), 1 - R of the interface
    survival: Array  # (layers + 1, batch), exp(-tau/mu) at the layers' tops and at the ground


def _apply(matrix: Array, vector: Array) -> Array:
    return jnp.einsum("...ij,...j->...i", matrix, vector)


def _apply_transposed(matrix: Array, vector: Array) -> Array:
    return jnp.einsum("...ji,...j->...i", matrix, vector)


def _medium(stack: Stack, directions: Directions) -> Medium:
    albedo, thickness = stack.albedo.T, stack.optical_thickness.T
    modes = layer_modes(albedo, directions.cosines, directions.weights)
    argument = modes.decay_squared * (thickness**2)[..., None]
    mu, weights, r = (jnp.asarray(a, albedo.dtype) for a in directions)
    per_thickness = tanhc_sqrt(argument)
    return Medium(
        modes,
        thickness[..., None] * per_thickness,
        jnp.sqrt(per_thickness),
        thickness,
        sech_sqrt(argument),
        (1.0 - r) / ((1.0 + r) * mu),
        1.0 / mu,
        jnp.sqrt(weights),
        4.0 * stack.ground / (1.0 + stack.ground),
    )


def _beam(stack: Stack, cos_air: Array) -> Beam:
    decay = 1.0 / cos_refracted(cos_air, stack.refractive_index)
    depth = jnp.cumsum(stack.optical_thickness.T, axis=0)
    depth = jnp.concatenate([jnp.zeros_like(depth[:1]), depth])
    transmittance = 1.0 - dielectric_reflectance(cos_air, stack.refractive_index)
    return Beam(decay, transmittance, jnp.exp(-decay * depth))


class _Driven(NamedTuple):
    """Response of each mode to a source e^(-t/mu): integrals of the two-port's shapes against it."""

    top: Array  # int u1(t) e^(-a t) dt, with u1(0) = 1, u1'(D) = 0
    bottom: Array  # int u2(t) e^(-a t) dt, with u2(0) = 0, u2'(D) = 1


def _safe_decay(modes: Modes) -> tuple[Array, Array]:
    slow = modes.decay_squared < _SLOW
    return slow, jnp.sqrt(jnp.where(slow, 1.0, modes.decay_squared))


def _driven(medium: Medium, decay: Array, thickness: Array) -> _Driven:
    """The two integrals, by the form that is exact where the other divides 0 by 0."""
    lam, (slow, kappa) = medium.modes.decay_squared, _safe_decay(medium.modes)
    a, depth = decay[:, None], thickness[..., None]
    # Slow modes: even in kappa, regular at kappa = 0; kappa < 1/2 < 1 <= a, so no resonance.
    gone = jnp.exp(-a * depth)
    gap = jnp.where(slow, a * a - lam, 1.0)
    slow_top = (a * (1.0 - gone * medium.sech) - lam * medium.tanh) / gap
    slow_bottom = (medium.sech - gone * (1.0 + a * medium.tanh)) / gap
    # Fast modes: sums of decays, regular at kappa = a.
    fade = jnp.exp(-kappa * depth)
    norm = 1.0 + fade * fade
    together, apart = decay_integral(kappa + a, depth), two_decays(kappa, a, depth)
    fast_top = (together + fade * apart) / norm
    fast_bottom = (apart - fade * together) / (kappa * norm)
    return _Driven(jnp.where(slow, slow_top, fast_top), jnp.where(slow, slow_bottom, fast_bottom))


def _beam_load(medium: Medium, beam: Beam, driven: _Driven, albedo: Array) -> Load:
    strength = (albedo * beam.survival[:-1])[..., None] * medium.modes.coupling
    seen = medium.ground_factor * beam.survival[-1] / beam.decay
    ground = seen[:, None] * medium.ground_vector
    return Load(jnp.zeros_like(ground), strength * driven.top, -strength * driven.bottom, ground)


def _diffuse_load(medium: Medium, directions: Directions, shape: tuple[int, ...]) -> Load:
    """Load whose product with a field is the flux that leaves through the interface."""
    r = jnp.asarray(directions.reflectance, medium.tanh.dtype)
    top = jnp.broadcast_to(medium.ground_vector * (1.0 - r) / (1.0 + r), shape[1:])
    empty = jnp.zeros(shape, top.dtype)
    return Load(top, empty, empty, jnp.zeros_like(top))


def _direct(medium: Medium, one: Beam, two: Beam, driven: tuple[_Driven, _Driven], stack: Stack) -> Array:
    """G: scattered once, or more often within a layer whose faces are held at the two-port's conditions."""
    depth, albedo = stack.optical_thickness.T, stack.albedo.T
    lam, (slow, kappa) = medium.modes.decay_squared, _safe_decay(medium.modes)
    a, b, d = one.decay[:, None], two.decay[:, None], depth[..., None]
    once = decay_integral(a + b, d)
    gone = jnp.exp(-a * d)
    gap = jnp.where(slow, a * a - lam, 1.0)
    slow_again = (driven[1].top - a * gone * driven[1].bottom - once) / gap
    apart = two_decays(kappa, a, d)
    # Integral of two_decays(kappa + b, a + b, t) over the layer, divided by the larger of the two.
    kb, ab = kappa + b, a + b
    area = (decay_integral(jnp.minimum(kb, ab), d) - two_decays(kb, ab, d)) / jnp.maximum(kb, ab)
    fast_again = (area - (gone - kappa * apart) * driven[1].bottom) / (a + kappa)
    again = jnp.sum(medium.modes.coupling**2 * jnp.where(slow, slow_again, fast_again), axis=-1)
    both = one.survival * two.survival
    inside = jnp.sum(both[:-1] * albedo * (once[..., 0] + albedo * again), axis=0)
    return inside + medium.ground_factor * both[-1] / (one.decay * two.decay)


def _solve(medium: Medium, loads: tuple[Load, ...]) -> tuple[Field, ...]:
    """Solve K x = b for each load: bottom up by Riccati recursion, then top down."""
    modes = medium.modes
    batch, n = modes.decay_squared.shape[1:]

    def stacked(name: str) -> Array:
        return jnp.stack([getattr(load, name) for load in loads], axis=-1)

    diagonal = jnp.broadcast_to(medium.ground_diagonal, (batch, n))
    vector = jnp.broadcast_to(medium.ground_vector, (batch, n))
    impedance = diagonal[:, :, None] * jnp.eye(n, dtype=diagonal.dtype)
    impedance -= medium.ground_factor[:, None, None] * vector[:, :, None] * vector[:, None, :]

    identity = jnp.eye(n, dtype=diagonal.dtype)

    def up(carry, layer):
        z, s = carry
        (lam, y, _), t, root, depth, sech, b_top, b_bottom = layer
        yt = jnp.swapaxes(y, -1, -2)
        z, s = yt @ z @ y, yt @ s
        # P = (I + Z T)^-1, scaled to a symmetric matrix: exact for an empty layer, and small where T is large.
        scaled = root[..., :, None] * z * root[..., None, :]
        inverse = solve_positive(identity + depth[..., None, None] * scaled, jnp.broadcast_to(identity, z.shape))
        p = inverse * (root[..., None, :] / root[..., :, None])
        w = p @ z
        above = sech[..., :, None] * w * sech[..., None, :] + (lam * t)[..., None] * identity
        s_above = b_top + sech[..., None] * (p @ (s + z @ b_bottom))
        return (y @ above @ yt, y @ s_above), (z, p, s)

    layers = (modes, medium.tanh, medium.root, medium.thickness, medium.sech)
    loaded = (*layers, stacked("layer_top"), stacked("layer_bottom"))
    (z, s), (impedances, transfers, sources) = jax.lax.scan(up, (impedance, stacked("ground")), loaded, reverse=True)
    interface = jnp.broadcast_to(medium.interface, (batch, n))
    sigma_top = solve_positive(z + interface[..., None] * identity, s + stacked("top"))

    def down(sigma, layer):
        (_, y, _), t, sech, b_bottom, z, p, s = layer
        y0 = jnp.swapaxes(y, -1, -2) @ sigma
        below = jnp.swapaxes(p, -1, -2) @ (sech[..., None] * y0 - b_bottom + t[..., None] * s)
        return y @ below, (y0, z @ below - s)

    loaded = (modes, medium.tanh, medium.sech, stacked("layer_bottom"), impedances, transfers, sources)
    ground, (y0, f) = jax.lax.scan(down, sigma_top, loaded)
    return tuple(Field(y0[..., i], f[..., i], ground[..., i]) for i in range(len(loads)))


def _energy(medium: Medium, one: Field, two: Field, sigma_one: Array, sigma_two: Array) -> Array:
    """x_F . K x_I, the symmetric form of the joined system, (batch,)."""
    lam, y, _ = medium.modes
    t, s = medium.tanh, medium.sech
    inside = lam * t * one.mode_top * two.mode_top - t * one.mode_flux * two.mode_flux
    inside += s * (one.mode_top * two.mode_flux + one.mode_flux * two.mode_top)
    # Continuity: delta at a layer's bottom works on sigma just below it, from both sides.
    inside -= one.mode_flux * _apply_transposed(y, sigma_two[1:])
    inside -= two.mode_flux * _apply_transposed(y, sigma_one[1:])
    top = medium.interface * sigma_one[0] * sigma_two[0]
    ground = medium.ground_diagonal * one.ground * two.ground
    seen_one = jnp.sum(medium.ground_vector * one.ground, axis=-1)
    seen_two = jnp.sum(medium.ground_vector * two.ground, axis=-1)
    total = jnp.sum(inside, axis=(0, -1)) + jnp.sum(top + ground, axis=-1)
    return total - medium.ground_factor * seen_one * seen_two


class _Parts(NamedTuple):
    """The ingredients of R = C [G + b_F.x_I + x_F.b_I - x_F.K x_I]."""

    medium: Medium
    incidence: Load
    viewing: Load
    direct: Array  # (batch,), G
    factor: Array  # (batch,), C


def _parts(stack: Stack, resolution: Resolution) -> _Parts:
    n = stack.refractive_index
    directions = half_range(n, resolution)
    medium = _medium(stack, directions)
    albedo, thickness = stack.albedo.T, stack.optical_thickness.T
    beam = _beam(stack, stack.cos_incidence)
    driven = _driven(medium, beam.decay, thickness)
    incidence = _beam_load(medium, beam, driven, albedo)
    if stack.cos_viewing is None:
        viewing = _diffuse_load(medium, directions, driven.top.shape)
        return _Parts(medium, incidence, viewing, jnp.zeros_like(beam.decay), beam.transmittance * beam.decay)
    view = _beam(stack, stack.cos_viewing)
    driven_view = _driven(medium, view.decay, thickness)
    viewing = _beam_load(medium, view, driven_view, albedo)
    direct = _direct(medium, beam, view, (driven, driven_view), stack)
    factor = beam.transmittance * view.transmittance * beam.decay * view.decay / (4.0 * n**2)
    return _Parts(medium, incidence, viewing, direct, factor)


def reflectance(stack: Stack, resolution: Resolution) -> Array:
    """Reflectance factor, or hemispherical reflectance where the stack has no viewing direction, (batch,)."""
    parts = _parts(stack, resolution)
    (field,) = _solve(parts.medium, (parts.incidence,))
    sigma = _levels(parts.medium.modes, field)
    return parts.factor * (parts.direct + _dot(parts.viewing, field, sigma))


def reflectance_and_gradient(
    stack: Stack, resolution: Resolution, wanted: tuple[str, ...]
) -> tuple[Array, dict[str, Array]]:
    """Reflectance and its derivative by the wanted leaves of each stack.

    Args:
        stack: batch of stacks.
        resolution: directions, static.
        wanted: names of the leaves to differentiate by, static. What is not asked for is not computed.

    Returns:
        (batch,) and, by name, d reflectance / d leaf in the shape of the leaf.
    """
    parts = _parts(stack, resolution)
    first, second = _solve(parts.medium, (parts.incidence, parts.viewing))

    def stationary(leaves: dict[str, Array]) -> Array:
        p = _parts(stack._replace(**leaves), resolution)
        sigma_first, sigma_second = (_levels(p.medium.modes, field) for field in (first, second))
        mutual = _dot(p.viewing, first, sigma_first) + _dot(p.incidence, second, sigma_second)
        mutual -= _energy(p.medium, first, second, sigma_first, sigma_second)
        return p.factor * (p.direct + mutual)

    value, pull_back = jax.vjp(stationary, {name: getattr(stack, name) for name in wanted})
    return value, pull_back(jnp.ones_like(value))[0]


LEAST_SLOPING_INDEX = 1.0 + 1e-4
"""Nearer to one a slope by the index drowns in the quadrature's error; from here on it changes by some 2 %."""


def slope_by_index(stack: Stack, resolution: Resolution, slope: Array) -> Array:
    """The given d reflectance / d index, but taken a little above where an index is one, or almost."""

    def above() -> Array:
        lifted = jnp.maximum(stack.refractive_index, LEAST_SLOPING_INDEX)
        return reflectance_and_gradient(stack._replace(refractive_index=lifted), resolution, ("refractive_index",))[1][
            "refractive_index"
        ]

    return jax.lax.cond(jnp.any(stack.refractive_index < LEAST_SLOPING_INDEX), above, lambda: slope)
