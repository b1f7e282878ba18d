r"""Light between layers of paint and a rough surface: the default solver's layers, closed by a
matrix.

With u = sqrt(w mu) L and tau = enters/(2 n^2 sqrt(w mu)) of a beam, light below the surface is
u_down = tau + P u_up, P being `Operators.back` scaled the same way. In the even-parity form of
`ordinates.solver` that is an impedance and a load,

    A = mu^-1/2 (I + P)^-1 (I - P) mu^-1/2,     load = 2 mu^-1/2 (I + P)^-1 tau,

and what comes out towards a direction F is again stationary: n^2 R = load_F . sigma_I - 2 tau_F .
(I + P)^-1 tau_I.
"""

import functools
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from ..common.chunks import in_chunks
from ..common.linalg import matmul
from ..common.stack_arrays import LeafNames, with_its_gradient
from ..ordinates.layers import Beams, two_ports
from ..ordinates.modes import layer_modes
from ..ordinates.sensitivity import gradient_of_layers
from ..ordinates.solver import Ends, System, order, solve
from .basis import Size
from .operators import Operators, operators

# Numbers of a chunk's matrices that stay in a processor's cache.
_CHUNK_NUMBERS = 2**15


class Surface(NamedTuple):
    """Surface, and how finely it is resolved; static."""

    refractive_index: float
    roughness: float
    size: Size

    def operators(self) -> Operators:
        """Made once and kept."""
        return operators(self.refractive_index, self.roughness, self.size)


class Lit(NamedTuple):
    """Stacks and what lights them; batch axis first, layers top first."""

    albedo: Array  # (batch, layers)
    optical_thickness: Array  # (batch, layers)
    ground: Array  # (batch,)
    enters: Array  # (batch, 2, n), `Operators.enters` of light and view
    from_ground: Array  # (batch, 2), light and view that start on the ground, as irradiances on it


class _Fixed(NamedTuple):
    """Of the surface, in double precision."""

    admits: np.ndarray  # (n, n): load = enters @ admits
    impedance: np.ndarray  # (n, n), A
    direct: np.ndarray  # (n, n): 2 tau . (I + P)^-1 tau


@functools.lru_cache(maxsize=64)
def _solver_of_surface(surface: Surface) -> _Fixed:
    rough_operators = surface.operators()
    mu = rough_operators.basis.cosines
    weights = rough_operators.basis.weights
    flux = np.sqrt(2.0 * weights * mu)
    root = np.sqrt(mu)
    # P of the module, from `Operators.back`.
    back = rough_operators.back / (flux[:, None] * flux)
    inverse = np.linalg.inv(np.eye(mu.size) + back)
    # Reciprocity makes it symmetric but for rounding.
    inverse = 0.5 * (inverse + inverse.T)
    # (I + P)^-1 (I - P) = 2 (I + P)^-1 - I.
    impedance = (2.0 * inverse - np.eye(mu.size)) / (root[:, None] * root)
    tau = np.diag(1.0 / (2.0 * np.sqrt(weights * mu)))
    return _Fixed(2.0 * tau @ inverse / root, impedance, 2.0 * tau @ inverse @ tau)


@with_its_gradient
def reflectance(lit: Lit, surface: Surface, leaf_names: LeafNames | None) -> Any:
    """n^2 times the reflectance of each stack, (batch,); see the module, and `ports` for light from
    the ground. What starts on the ground is always a constant.
    """
    layers = lit.albedo.shape[1]
    nodes = surface.size.upper + surface.size.lower
    return in_chunks(
        lambda batch: _solve(batch, surface, leaf_names),
        lit,
        max(1, _CHUNK_NUMBERS // (nodes**2 * layers)),
    )


def _solve(lit: Lit, surface: Surface, leaf_names: LeafNames | None) -> Any:
    """Value, and on request the gradient by what is wanted."""
    fixed = _solver_of_surface(surface)
    direct, admits = (jnp.asarray(a, lit.albedo.dtype) for a in (fixed.direct, fixed.admits))
    system = _assemble(lit, surface, fixed)
    value, solution = solve(system, with_fields=leaf_names is not None)
    # The term without sigma: - 2 tau_F . (I + P)^-1 tau_I.
    through_surface = matmul(lit.enters, direct)
    value -= jnp.sum(through_surface[:, 0] * lit.enters[:, 1], axis=-1)
    if leaf_names is None:
        return value
    assert solution is not None
    # Light that starts on the ground does not come from above: no layer dims it as it does a beam.
    unlit = system._replace(
        ends=system.ends._replace(ground_light=jnp.zeros_like(system.ends.ground_light))
    )
    gradient = gradient_of_layers(unlit, solution, lit.ground, leaf_names)
    if "ground" in leaf_names:
        gradient |= gradient_of_layers(system, solution, lit.ground, ("ground",))
    if "enters" in leaf_names:
        # By what enters of the light, the view's field answers, and the reverse.
        answer = matmul(jnp.moveaxis(solution.at_interface, -1, 0), admits.T) - through_surface
        gradient["enters"] = answer[:, ::-1]
    return value, gradient


def _assemble(lit: Lit, surface: Surface, fixed: _Fixed) -> System:
    nodes = surface.operators().basis
    mu = nodes.cosines
    weights = nodes.weights
    batch, count = lit.albedo.shape
    dtype = lit.albedo.dtype
    layers, mirrored, _ = order(count)
    albedo = lit.albedo.T[layers]
    thickness = lit.optical_thickness.T[layers]
    # Layers in the solver's order: from both ends to the middle.
    modes = layer_modes(albedo, mu, weights)
    nothing = jnp.zeros((2, batch), dtype)
    # No beam enters unscattered: all light begins as radiances just below the surface.
    beams = Beams(
        jnp.ones((2, batch), dtype), nothing, jnp.zeros((2, count, batch), dtype), nothing
    )
    ports = two_ports(albedo, modes.decay_squared, modes.coupling, thickness, beams, mirrored)
    # The surface drives the top layer, and couples its directions.
    load = matmul(lit.enters, jnp.asarray(fixed.admits, dtype))
    ends = Ends(
        interface=jnp.zeros((mu.size, 1), dtype),
        interface_load=jnp.moveaxis(load, 0, -1),
        ground_diagonal=jnp.asarray(1.0 / mu, dtype)[:, None],
        ground_vector=jnp.asarray(np.sqrt(weights), dtype)[:, None],
        ground_factor=4.0 * lit.ground / (1.0 + lit.ground),
        ground_light=lit.from_ground.T,
        coupled=jnp.asarray(fixed.impedance, dtype),
    )
    return System(
        albedo=albedo,
        thickness=thickness,
        modes=modes,
        beams=beams,
        ports=ports,
        ends=ends,
        divisor=jnp.ones(batch, dtype),
    )
