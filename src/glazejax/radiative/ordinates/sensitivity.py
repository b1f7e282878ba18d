"""Derivatives of the ordinates' reflectance, and its split, from the fields of light and view.

R = C [G + b_F.x_I + x_F.b_I - x_F.K x_I] is stationary in both fields, so only its ingredients are
differentiated, at fixed fields. By albedo, thickness and ground that is done in closed form, mode
by mode; by the index and the cosines, which are rarely wanted, JAX does it.
"""

from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array

from ..common.directions import Resolution, half_range
from ..common.kernels import decay_integral
from ..common.side_by_side import product, transpose
from ..common.split import Split
from ..common.stack_arrays import LeafNames, StackArrays, ValueAndGradient
from .layers import Fields, layer_energy, load_work, two_ports
from .modes import turning
from .solver import SolvedFields, System, assemble, solve


def reflectance_and_gradient(
    stack: StackArrays, resolution: Resolution, leaf_names: LeafNames
) -> ValueAndGradient:
    """Reflectance and its derivative by the wanted leaves of each stack.

    Args:
        stack: batch of stacks.
        resolution: directions, static.
        leaf_names: names of the leaves to differentiate by, static. What is not asked for is not
            computed.

    Returns:
        (batch,) and, by name, d reflectance / d leaf in the shape of the leaf.
    """
    system = assemble(stack, resolution)
    value, solution = solve(system, with_fields=True)
    assert solution is not None
    gradient = gradient_of_layers(system, solution, stack.ground, leaf_names)
    for name in [name for name in leaf_names if name not in gradient]:

        def stationary(leaf: Array, name: str = name) -> Array:
            shifted = stack._replace(**{name: leaf})
            directions = half_range(
                _resolved_index(shifted.refractive_index, resolution), resolution
            )
            return _stationary(assemble(shifted, directions), solution, system.modes.vectors)

        # One number a stack: a single forward derivative, a smaller program than a reverse one.
        leaf = getattr(stack, name)
        gradient[name] = jax.jvp(stationary, (leaf,), (jnp.ones_like(leaf),))[1]
        # Directions that do not follow the interface's rise get its slope in closed form.
        if name == "refractive_index" and resolution.reach is not None:
            unresolved = _excess(leaf) < resolution.resolves()
            gradient[name] += jnp.where(
                unresolved, _onset(stack, system, solution) / system.divisor, 0.0
            )
    return value, gradient


def gradient_of_layers(
    system: System, solution: SolvedFields, ground: Array, leaf_names: LeafNames
) -> dict[str, Array]:
    """Derivative of a solved system by those of albedo, optical_thickness and ground that are
    wanted.

    It is that of the fields alone: how light comes in, and what the surface does, is held.
    """
    gradient = {}
    if "albedo" in leaf_names:
        slope = _by_albedo(system, solution.fields)
        gradient["albedo"] = (slope / system.divisor)[system.order.back].T
    if "optical_thickness" in leaf_names:
        gradient["optical_thickness"] = (_by_thickness(system, solution) / system.divisor).T
    if "ground" in leaf_names:
        # The ground's matrix and the beam's load on it share the factor 4 rho/(1 + rho).
        by_factor = jnp.prod(
            _diffuse_on_ground(system, solution) + system.ends.ground_light, axis=0
        )
        gradient["ground"] = 4.0 * by_factor / ((1.0 + ground) ** 2 * system.divisor)
    return gradient


def _excess(index: Array) -> Array:
    return (index - 1.0) * (index + 1.0)


def _resolved_index(index: Any, resolution: Resolution) -> Any:
    """The index, by which directions must not be differentiated where they do not follow the
    interface's rise.
    """
    if resolution.reach is None or not isinstance(index, jax.Array):
        return index
    return jnp.where(_excess(index) < resolution.resolves(), jax.lax.stop_gradient(index), index)


# Flux of a radiance of one that the interface sends back, over pi (n^2 - 1), as n nears one: all
# that is totally reflected, 1/2, and the rest, int_0^inf e^(-4 t) sinh(t) cosh(t) dt = 1/12; times
# d(n^2 - 1)/dn = 2.
_ONSET = 2.0 * (1.0 / 2.0 + 1.0 / 12.0)


def _onset(stack: StackArrays, system: System, solution: SolvedFields) -> Array:
    """Addition by the interface, per unit of the index as that leaves one, but for the factor C,
    (batch,).

    It then sends back what grazes it from inside, and nothing else to first order: cosines up to
    sqrt(n^2 - 1). All of that light comes from just below and ends there. So its share of R is the
    product of the light's grazing radiance and the view's; of the flux that leaves, as much is also
    lost.
    """
    # The first layer that is not empty, or the ground, shines as its source does.
    filled = stack.optical_thickness > 0
    first = jnp.take_along_axis(stack.albedo, jnp.argmax(filled, axis=1)[:, None], axis=1)[:, 0]
    ends = system.ends
    scattered = jnp.sum(ends.ground_vector * ends.ground_diagonal * solution.at_interface, axis=-2)
    beams = jnp.array([1.0, 1.0 if stack.cos_viewing is not None else 0.0], scattered.dtype)
    from_layer = 0.5 * first * (scattered + beams[:, None])
    lit = _diffuse_on_ground(system, solution) + ends.ground_light
    from_ground = 0.5 * ends.ground_factor * lit
    light, view = jnp.where(jnp.any(filled, axis=1), from_layer, from_ground)
    escape = 1.0 if stack.cos_viewing is None else 0.0
    return _ONSET * light * (2.0 * view - escape)


def _diffuse_on_ground(system: System, solution: SolvedFields) -> Array:
    """sqrt(w) . sigma at the ground, to which its diffuse load is proportional, (2, batch)."""
    return jnp.sum(system.ends.ground_vector * solution.at_ground, axis=-2)


def _by_albedo(system: System, fields: Fields) -> Array:
    """By each layer's albedo, in the system's order, (layers, batch), but for the factor C."""
    modes = system.modes
    mirrored = system.order.mirrored

    def energy(q, lam, coupling, near, far):
        ports = two_ports(q, lam, coupling, system.thickness, system.beams, mirrored)
        return layer_energy(ports, Fields(near, far, fields.flux))

    # As the albedo grows the modes turn: coupling and sigma, which is held in directions, with
    # them.
    rows = product(
        jnp.concatenate([modes.coupling[:, None], fields.near, fields.far], axis=1), turning(modes)
    )
    point = (system.albedo, modes.decay_squared, modes.coupling, fields.near, fields.far)
    # d lambda/dq = -zeta^2; f is held in modes.
    change = (
        jnp.ones_like(system.albedo),
        -(modes.coupling**2),
        rows[:, 0],
        rows[:, 1:3],
        rows[:, 3:],
    )
    return jax.jvp(energy, point, change)[1]


def _slab(system: System, fields: Fields) -> Array:
    """Addition by a thin slab of a layer's own medium at its far face, per thickness, in the
    system's order, (layers, batch), but for the factor C.

    The dimming of what lies below the slab is not in it.
    """
    beams = system.beams
    ports = system.ports
    mirrored = system.order.mirrored
    # Beams at the slab: at the layer's bottom, or, if it is mirrored, at its top.
    below = beams.survival * jnp.where(
        mirrored[:, None], 1.0, jnp.exp(-beams.decay[:, None] * system.thickness)
    )
    # With one beam only the field of the light is driven by one; that of the view is diffuse
    # everywhere.
    driven = jnp.pad(ports.far, [(0, 0), (0, 2 - ports.far.shape[1]), (0, 0), (0, 0)])
    (u0, u1), (f0, f1) = (jnp.moveaxis(field, 1, 0) for field in (fields.far, fields.flux + driven))
    # z . sigma is all light that meets a scatterer there, of light and of view.
    first = jnp.sum(system.modes.coupling * u0, axis=-2)
    second = jnp.sum(system.modes.coupling * u1, axis=-2)
    # Scattered from the beam to the view's field, from the light's field to the viewing beam, and
    # from one beam to the other.
    lit = below[0] * second + (
        below[1] * first + below[0] * below[1] if below.shape[0] == 2 else 0.0
    )
    return system.albedo * lit - jnp.sum(system.modes.decay_squared * u0 * u1 - f0 * f1, axis=-2)


def _by_thickness(system: System, solution: SolvedFields) -> Array:
    """By each layer's thickness, top layer first, (layers, batch), but for the factor C."""
    _, mirrored, back = system.order
    # A slab at a layer's far face dims the beams for all that lies below it.
    decay = system.beams.decay
    beams = decay.shape[0]
    works = jnp.sum(load_work(system.ports, solution.fields) * decay, axis=1)
    works += jnp.sum(decay, axis=0) * system.ports.direct
    # So it dims the beams that reach the ground.
    diffuse = _diffuse_on_ground(system, solution)
    light = system.ends.ground_light[:beams]
    partner = diffuse[::-1] if beams == 2 else diffuse[1:]
    ground = jnp.sum(decay * light * partner, axis=0)
    ground += jnp.sum(decay, axis=0) * jnp.prod(system.ends.ground_light, axis=0)
    works = jnp.concatenate([works[back], (system.ends.ground_factor * ground)[None]])
    # Each layer's slab counts with all that is dimmed below it.
    from_here_down = jnp.cumsum(works[::-1], axis=0)[::-1]
    upside_down = mirrored[back][:, None]
    slab = _slab(system, solution.fields)[back]
    return slab - jnp.where(upside_down, from_here_down[:-1], from_here_down[1:])


def _stationary(system: System, solution: SolvedFields, vectors: Array) -> Array:
    """R of a system at the fields of another, whose modes' vectors are given, (batch,).

    Sigma is held in directions, delta at the layers' far faces in modes.
    """
    # From the modes of the other system to directions, and into the modes of this one.
    near, far = (
        product(product(modes, transpose(vectors)), system.modes.vectors)
        for modes in (solution.fields.near, solution.fields.far)
    )
    fields = Fields(near, far, solution.fields.flux)
    # The layers' part, at fields that their own modes need not solve.
    energy = layer_energy(system.ports, fields)
    ends = system.ends
    top = solution.at_interface
    bottom = solution.at_ground
    total = jnp.sum(energy, axis=0) + jnp.sum(ends.interface_load * top[::-1], axis=(0, 1))
    # The ends' part: the surface and the ground.
    total -= jnp.sum(
        ends.interface * top[0] * top[1] + ends.ground_diagonal * bottom[0] * bottom[1], axis=0
    )
    on_ground = _diffuse_on_ground(system, solution) + ends.ground_light
    return (total + ends.ground_factor * jnp.prod(on_ground, axis=0)) / system.divisor


def split(stack: StackArrays, resolution: Resolution) -> Split:
    """Reflectance by the last event before the light leaves; see `Split`. Each (batch,)."""
    system = assemble(stack, resolution)
    value, solution = solve(system, with_fields=True)
    assert solution is not None
    ends = system.ends
    beams = system.beams
    lit = _diffuse_on_ground(system, solution)[0] + ends.ground_light[0]
    if stack.cos_viewing is not None:
        single = jnp.sum(system.ports.once, axis=0) / system.divisor
        ground = ends.ground_factor * lit * ends.ground_light[1] / system.divisor
        return Split(ground, single, value - ground - single)
    # Every exit direction: the radiances at the surface, weighted with what passes it.
    decay = ends.ground_diagonal
    # (1 - R)/(1 + R), and with it 1 - R.
    admitted = ends.interface / decay
    transmittance = 2.0 * admitted / (1.0 + admitted)
    top_down = system.order.back
    thickness = system.thickness[top_down][:, None]
    depth = jnp.concatenate([jnp.zeros_like(thickness[:1]), jnp.cumsum(thickness, axis=0)])
    # From the ground straight out, through all layers.
    passing = ends.ground_vector**2 / decay * transmittance
    up = 0.5 * ends.ground_factor * lit
    ground = up * jnp.sum(passing * jnp.exp(-depth[-1] * decay), axis=0) / system.divisor
    # What one scattering sends up, seen through the layers above it.
    visible = jnp.exp(-depth[:-1] * decay) * decay
    visible *= decay_integral(beams.decay[0] + decay, thickness)
    source = 0.5 * system.albedo[top_down] * beams.survival[0][top_down]
    single = jnp.sum(source[:, None] * visible * passing, axis=(0, 1)) / system.divisor
    return Split(ground, single, value - ground - single)
