r"""Default solver: discrete ordinates in even-parity form for isotropically scattering layers.

    air          beam in \   / radiance out
    ------------------------------------------  smooth interface, Fresnel R(mu)
    layer 1      albedo q_1, optical thickness D_1
    layer 2      q_2, D_2                              tau down
    ///////////  Lambertian ground rho

With half-range cosines mu_i, weights w_i and radiances L+ (down), L- (up) put

    sigma = sqrt(w) mu (L+ + L-),      delta = sqrt(w) (L+ - L-) = -sigma'.

Each layer is a symmetric two-port between its faces (see `layers`). Joined, they are one symmetric
system K x = b. Beam and view load it in the same way, so with b_I of the incidence and b_F of the
viewing direction the reflectance is the stationary value of

    R = C [ G + b_F.x_I + x_F.b_I - x_F.K x_I ],      K x_I = b_I,  K x_F = b_F,

G being the paths that never meet K (single scattering in a layer, ground seen directly).
Reciprocity is then symmetry, and a derivative needs no derivative of x (see `sensitivity`).

K is eliminated from both ends at once, interface and ground, towards the middle: the two halves
share each operation. A half, once eliminated, is the relation delta = Z sigma - s at its inner face
(pointing outwards) and its part g of R.

Stacks lie side by side on the last axis of every array, so that a processor's lanes run along them.

The physics is paper A (Shinozawa et al. 2013), eqs (4)-(22), with its integrals over mu done by
quadrature.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from ..common.directions import Resolution, half_range
from ..common.fresnel import cos_refracted, dielectric_reflectance
from ..common.quadrature import Directions
from ..common.side_by_side import diagonal, inverse_positive, product, transpose
from ..common.stack_arrays import StackArrays
from .layers import Beams, Fields, LayerPorts, two_ports
from .modes import LayerModes, layer_modes

# More pairs of layers than this are eliminated in a loop, which runs a little slower but compiles
# once.
_UNROLLED = 1


class Ends(NamedTuple):
    """The two ends of the stack. Loads have a first axis: light, view."""

    interface: Array
    """(n, 1) or (n, batch): (1 - R)/((1 + R) mu), so that delta = -interface sigma"""
    interface_load: Array  # (2, n, batch)
    ground_diagonal: Array  # (n, 1) or (n, batch): 1/mu
    ground_vector: Array  # (n, 1) or (n, batch): sqrt(w)
    ground_factor: Array
    """(batch,): c = 4 rho/(1 + rho); delta = (1/mu - c sqrt(w) sqrt(w)^T) sigma - load"""
    ground_light: Array
    """(2, batch): beam on the ground, exp(-tau/mu) mu; the load is c sqrt(w) times it"""
    coupled: Array | None = None
    """(n, n): added to the diagonal `interface` where the surface is rough"""


class Order(NamedTuple):
    """From both ends inwards: bottom, top, last but one, second, ...; the middle one of an odd
    number last.
    """

    layers: np.ndarray  # (layers,), index of each layer in the stack
    mirrored: (
        np.ndarray
    )  # (layers,), whether its near face, the one towards the middle, is its bottom
    back: np.ndarray  # (layers,), where in this order each layer of the stack is, top first


def order(count: int) -> Order:
    """Order in which a number of layers is eliminated."""
    pairs = [index for step in range(count // 2) for index in (count - 1 - step, step)]
    middle = [count // 2] if count % 2 else []
    layers = np.array(pairs + middle)
    return Order(
        layers, np.array([False, True] * (count // 2) + [False] * (count % 2)), np.argsort(layers)
    )


class System(NamedTuple):
    """The ingredients of R = C [G + b_F.x_I + x_F.b_I - x_F.K x_I]. Layers in the order
    of `order`.
    """

    albedo: Array  # (layers, batch)
    thickness: Array  # (layers, batch)
    modes: LayerModes  # (layers, batch, ...)
    beams: Beams
    ports: LayerPorts
    ends: Ends
    divisor: Array
    """(batch,), 1/C. A division comes last: see `common.kernels.quotient`."""

    @property
    def order(self) -> Order:
        """Order of the layers."""
        return order(self.thickness.shape[0])


@jax.named_scope("assemble")
def assemble(stack: StackArrays, resolution: Resolution | Directions) -> System:
    """The discretised problem of each stack; directions that are given may be traced."""
    n = stack.refractive_index
    directions = resolution if isinstance(resolution, Directions) else half_range(n, resolution)
    if not isinstance(directions.cosines, np.ndarray):
        # Directions come batch first, or the same for all.
        directions = Directions(*(a.T if a.ndim == 2 else a[:, None] for a in directions))
    # Layers in pairs from the ends inwards, as they are eliminated.
    layers, mirrored, _ = order(stack.albedo.shape[1])
    albedo = stack.albedo.T[layers]
    thickness = stack.optical_thickness.T[layers]
    # Each layer by its modes, and what the beams excite in them, is a two-port.
    modes = layer_modes(albedo, directions.cosines, directions.weights)
    beams = _beams(stack, layers)
    ports = two_ports(albedo, modes.decay_squared, modes.coupling, thickness, beams, mirrored)
    # As columns, (n, 1) or (n, batch).
    columns = (a[:, None] if a.ndim == 1 else a for a in directions)
    mu, weights, r = (jnp.asarray(a, albedo.dtype) for a in columns)
    light = beams.at_ground / beams.decay
    root = jnp.sqrt(weights)
    if stack.cos_viewing is None:
        # All that leaves: the product of this load with sigma is the flux through the interface.
        leaving = jnp.broadcast_to(
            root * (1.0 - r) / (1.0 + r), (root.shape[0], thickness.shape[1])
        )
        interface_load = jnp.stack([jnp.zeros_like(leaving), leaving])
        light = jnp.concatenate([light, jnp.zeros_like(light)])
        divisor = 1.0 / (beams.transmittance[0] * beams.decay[0])
    else:
        interface_load = jnp.zeros((2, root.shape[0], thickness.shape[1]), root.dtype)
        attenuation = beams.transmittance * beams.decay
        divisor = 4.0 * n**2 / (attenuation[0] * attenuation[1])
    # A Lambertian ground couples all directions by one vector.
    ground_factor = 4.0 * stack.ground / (1.0 + stack.ground)
    ends = Ends(
        interface=(1.0 - r) / ((1.0 + r) * mu),
        interface_load=interface_load,
        ground_diagonal=1.0 / mu,
        ground_vector=root,
        ground_factor=ground_factor,
        ground_light=light,
    )
    return System(
        albedo=albedo,
        thickness=thickness,
        modes=modes,
        beams=beams,
        ports=ports,
        ends=ends,
        divisor=divisor,
    )


def _beams(stack: StackArrays, layers: np.ndarray) -> Beams:
    cosines_air = [c for c in (stack.cos_incidence, stack.cos_viewing) if c is not None]
    cosines = jnp.stack(cosines_air)
    decay = 1.0 / cos_refracted(cosines, stack.refractive_index)
    depth = jnp.cumsum(stack.optical_thickness.T, axis=0)
    # Beams are dimmed by all layers above.
    tops = jnp.concatenate([jnp.zeros_like(depth[:1]), depth[:-1]])[layers]
    transmittance = 1.0 - dielectric_reflectance(cosines, stack.refractive_index)
    return Beams(decay, transmittance, jnp.exp(-decay[:, None] * tops), jnp.exp(-decay * depth[-1]))


class _Half(NamedTuple):
    """A half of the stack as seen from its inner face: delta = Z sigma - s. Axis 0: lower, upper
    (or one of them).
    """

    impedance: Array  # (halves, n, n, batch), Z
    source: Array  # (halves, 2, n, batch), s


class _SweptLayer(NamedTuple):
    """The next layer of each half, (halves, ..., batch)."""

    vectors: Array
    scale: Array  # r = sqrt(T/D), positive for an empty layer too
    thickness: Array
    restoring: Array
    sech: Array
    near: Array
    far: Array


class _Memory(NamedTuple):
    """Memory of an eliminated layer for the way back."""

    inverse: Array  # (I + D r z r)^-1, z the half's impedance in modes
    admittance: Array  # inverse (r z r)
    source: Array  # r s, in modes, what the layer's beams drive out of its far face included
    passed: Array  # inverse (r s)


def _layers(system: System) -> _SweptLayer:
    ports = system.ports
    # In an empty layer T and D vanish together: r is 1.
    thickness = system.thickness[:, None]
    empty = thickness == 0
    scale = jnp.sqrt(jnp.where(empty, 1.0, ports.tanh) / jnp.where(empty, 1.0, thickness))
    near = ports.near
    far = ports.far
    # All exit directions together are no beam: they load no layer.
    if near.shape[1] == 1:
        near, far = (jnp.concatenate([load, jnp.zeros_like(load)], axis=1) for load in (near, far))
    return _SweptLayer(
        vectors=system.modes.vectors,
        scale=scale,
        thickness=system.thickness,
        restoring=ports.restoring,
        sech=ports.sech,
        near=near,
        far=far,
    )


def _outermost(ends: Ends, layer: _SweptLayer) -> tuple[Array, Array]:
    """Scaled impedance and source of the bare ends in the modes of the layers next to them."""
    # r Y^T Z Y r, where Z of an end is diagonal but for the ground's one vector.
    vectors = layer.vectors * layer.scale[..., None, :, :]
    shape = layer.scale.shape[1:]
    halves = layer.scale.shape[0]
    diagonals = [ends.ground_diagonal, ends.interface]
    impedances = jnp.stack([jnp.broadcast_to(d, shape) for d in diagonals[:halves]])
    projected = jnp.sum(vectors[0] * ends.ground_vector[:, None], axis=-3)
    ground = ends.ground_factor * projected
    impedance = product(transpose(vectors), impedances[..., :, None, :] * vectors)
    # The beam on the ground loads it by the same vector.
    from_ground = ends.ground_light[:, None] * ground
    coupled = ground[:, None] * projected
    # A single layer belongs to the ground's half; the interface has none next to it.
    if halves == 1:
        return impedance - coupled, from_ground[None]
    rough = jnp.zeros_like(coupled)
    if ends.coupled is not None:
        rough = product(transpose(vectors[1]), product(-ends.coupled[..., None], vectors[1]))
    from_above = product(ends.interface_load, vectors[1])
    return impedance - jnp.stack([coupled, rough]), jnp.stack([from_ground, from_above])


def _next(half: _Half, layer: _SweptLayer) -> tuple[Array, Array]:
    """Scaled impedance r Y^T Z Y r and source r Y^T s of a half in the modes of its next layer."""
    vectors = layer.vectors * layer.scale[..., None, :, :]
    return product(transpose(vectors), product(half.impedance, vectors)), product(
        half.source, vectors
    )


def _eliminate(impedance: Array, source: Array, layer: _SweptLayer) -> tuple[_Half, Array, _Memory]:
    """Take a layer into its half, given as scaled impedance and source in the layer's modes.

    Returns:
        The half with the layer in it, what that contributes to R (batch,), and what the way back
        needs.
    """
    identity = jnp.eye(impedance.shape[-2], dtype=impedance.dtype)[..., None]
    # (I + Z T)^-1 in a symmetric scaling: exact for an empty layer, and small where T is large.
    inverse = inverse_positive(identity + layer.thickness[:, None, None] * impedance)
    source += layer.scale[:, None] * layer.far
    # Vectors are no further rows of the matrices: joining them costs more than two products more.
    admittance = product(impedance, inverse)
    passed = product(source, inverse)
    # What the eliminated side adds to R: s_F.T (I + Z T)^-1 s_I.
    gain = layer.thickness[:, None] * source[:, 1] * passed[:, 0]
    through = layer.sech / layer.scale
    # Z of the half with the layer in it: lambda T + S (I + Z T)^-1 Z S.
    outward = through[:, :, None] * admittance * through[:, None] + diagonal(layer.restoring)
    back = transpose(layer.vectors)
    loads = product(layer.near + through[:, None] * passed, back)
    half = _Half(product(layer.vectors, product(outward, back)), loads)
    return half, jnp.sum(gain, axis=(0, 1)), _Memory(inverse, admittance, source, passed)


def _recover(sigma: Array, layer: _SweptLayer, memory: _Memory) -> tuple[Array, Fields]:
    """From sigma at a layer's near face (halves, 2, n, batch) to that at its far face, with the
    layer's fields.
    """
    near = product(sigma, layer.vectors)
    scale = layer.scale[:, None]
    driven = layer.sech[:, None] * near / scale
    # sigma at the far face: (I + T Z)^-1 (S y0 + T s).
    far = scale * product(driven + layer.thickness[:, None, None] * memory.source, memory.inverse)
    # f there: Z sigma - s = (I + Z T)^-1 (Z S y0 - s).
    flux = (product(driven, memory.admittance) - memory.passed) / scale
    return product(far, transpose(layer.vectors)), Fields(near, far, flux)


class SolvedFields(NamedTuple):
    """Fields of light and view everywhere."""

    fields: Fields  # (layers, 2, n, batch), layers in the order of `order`
    at_interface: Array  # (2, n, batch), sigma
    at_ground: Array  # (2, n, batch), sigma


def _in_steps(tree: Any, start: int, stop: int) -> Any:
    """Pairs of layers on an axis of their own."""
    return jax.tree.map(
        lambda x: x[2 * start : 2 * stop].reshape(stop - start, 2, *x.shape[1:]), tree
    )


def _at(tree: Any, start: int, stop: int | None = None) -> Any:
    return jax.tree.map(lambda x: x[start:stop], tree)


@jax.named_scope("eliminate")
def solve(system: System, *, with_fields: bool) -> tuple[Array, SolvedFields | None]:
    """Reflectance, and on request the fields.

    Returns:
        R (batch,) and `SolvedFields` or None.
    """
    layers = _layers(system)
    count = system.thickness.shape[0]
    pairs = count // 2
    ends = system.ends
    # What comes back with sigma zero at all faces: each layer's own part, and the beam's off the
    # ground.
    total = jnp.sum(system.ports.direct, axis=0)
    total += ends.ground_factor * ends.ground_light[0] * ends.ground_light[1]

    # Pairs from the ends inwards, then the middle one of an odd number; each step leaves what the
    # way back needs.
    first = _at(layers, 0, 2 if pairs else 1)
    half, gain, first_memory = _eliminate(*_outermost(ends, first), first)
    total += gain
    inner: tuple[_SweptLayer, _Memory] | None = None
    middle: tuple[_SweptLayer, _Memory] | None = None
    if pairs > 1:

        def step(half: _Half, layer: _SweptLayer) -> tuple[_Half, tuple[Array, _Memory]]:
            half, gain, memory = _eliminate(*_next(half, layer), layer)
            return half, (gain, memory)

        pairs_inside = _in_steps(layers, 1, pairs)
        half, (gains, memories) = jax.lax.scan(
            step, half, pairs_inside, unroll=pairs - 1 <= _UNROLLED
        )
        inner = (pairs_inside, memories)
        total += jnp.sum(gains, axis=0)
    if pairs:
        lower, upper = (_at(half, side, side + 1) for side in (0, 1))
    else:
        interface = diagonal(jnp.broadcast_to(ends.interface, layers.scale.shape[1:]))
        if ends.coupled is not None:
            interface += ends.coupled[..., None]
        lower = half
        upper = _Half(interface[None], ends.interface_load[None])
    # The middle layer of an odd number goes to the lower half.
    if pairs and count % 2:
        last = _at(layers, count - 1)
        lower, gain, memory = _eliminate(*_next(lower, last), last)
        middle = (last, memory)
        total += gain
    # Both halves meet at one face: sigma there makes their fluxes equal.
    source = (lower.source + upper.source)[0]
    sigma = product(source, inverse_positive((lower.impedance + upper.impedance)[0]))
    reflectance = (total + jnp.sum(sigma[0] * source[1], axis=0)) / system.divisor
    if not with_fields:
        return reflectance, None
    # The way back: from the middle outwards, each step recovers the fields that it eliminated.
    recovered = []
    faces = jnp.stack([sigma, sigma]) if pairs else sigma[None]
    if middle is not None:
        below, fields = _recover(sigma[None], *middle)
        faces = jnp.concatenate([below, sigma[None]])
        recovered.append(fields)
    if inner is not None:

        def back(faces: Array, eliminated: tuple[_SweptLayer, _Memory]) -> tuple[Array, Fields]:
            return _recover(faces, *eliminated)

        faces, fields = jax.lax.scan(
            back, faces, inner, reverse=True, unroll=pairs - 1 <= _UNROLLED
        )
        recovered.append(jax.tree.map(lambda x: x.reshape(-1, *x.shape[2:]), fields))
    faces, fields = _recover(faces, first, first_memory)
    fields = jax.tree.map(lambda *x: jnp.concatenate(x), fields, *recovered[::-1])
    return reflectance, SolvedFields(fields, faces[1] if pairs else sigma, faces[0])


def reflectance(stack: StackArrays, resolution: Resolution | Directions) -> Array:
    """Reflectance factor, or hemispherical reflectance where the stack has no viewing direction,
    (batch,).
    """
    return solve(assemble(stack, resolution), with_fields=False)[0]
