r"""Paper A's integral equation on a graded mesh: any thickness, any tolerance, no directions in the
operator.

The auxiliary function t(tau) of paper A (Shinozawa et al. 2013), eq. (21), obeys an integral
equation with exponential integrals as kernels. With the ground and the surface folded into its
kernel that is symmetric,

    A = H + U + 2 rho/(1 - rho K) M M',   (1 - A q/2) t = g + rho/(1 - rho K) T_I e^(-h/mu_0)/pi M,

so that light may as well be followed backwards from the exit: with the exit's weight V (e^(-tau/mu)
for a viewing direction, E_2 less the internal reflection for all of them), c = rho E_h/(1 - rho K)
and E_h its value for the ground,

    (1 - A q/2) psi = V/2 + c M,
    R = F [c T_I e^(-h/mu_0) + <q (pi g + rho/(1 - rho K) T_I e^(-h/mu_0) M), psi>].

A diffusely lit white stack then has a constant psi, which the mesh holds exactly: nothing is lost
at an albedo of one.

Each layer is divided into panels that shrink towards its two faces, where psi behaves as tau ln
tau, and that follow the decay length 1/kappa deep inside. In a panel psi q is a polynomial through
Gauss-Lobatto nodes, and its integrals against the kernels are exact to rounding (see `panels`).
Faces of layers are faces of panels.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from ..common.exponential_integrals import cone_nodes, critical_cosine, expn
from ..common.fresnel import cos_refracted, dielectric_reflectance
from ..common.linalg import einsum, matmul, solve_positive, transpose
from ..common.split import Split
from ..common.stack_arrays import StackArrays
from .panels import (
    PanelMesh,
    Panels,
    decay_integrals,
    kernel_integrals,
    layer_panels,
    own_integrals,
)


class CollocatedSystem(NamedTuple):
    """The collocated equation (1 - A q/2) psi = V/2 + c M and what its solution is
    multiplied by.
    """

    matrix: Array  # (batch, n, n)
    exit: Array  # (batch, n), V/2
    ground_seen: Array  # (batch, n), c M
    beam: Array  # (batch, n): q times the integrals of pi g + rho/(1 - rho K) T e^(-h/mu_0) M
    factor: Array  # (batch,), F
    single: Array  # (batch,), scattered once
    single_interpolated: Array  # (batch,), what the mesh makes of it
    ground_direct: Array  # (batch,), c T_I e^(-h/mu_0)


class _LayerSurface(NamedTuple):
    """The internal reflectance as the equation needs it."""

    cosines: Array  # (batch, nodes), in the cone
    weights: Array  # (batch, nodes), R dmu
    critical: Array  # (batch,), mu_c
    total: Array  # (batch,), mu_c below which all is reflected, 0 for an index of one


class _Grid(NamedTuple):
    """Nodes of all panels in depth, (batch, n), and the surface above them."""

    panels: Panels
    surface: _LayerSurface
    depth: Array  # (batch, n), tau
    above_ground: Array  # (batch, n), h - tau
    panel: np.ndarray  # (n,), number of a node's panel
    decays: Array  # (batch, cone, n): int e^(-s/mu) l_j(s) ds for directions mu in the cone

    def cone(self, power: int, depth: Array) -> Array:
        """The cone's part of int R mu^(power - 1) e^(-depth/mu) dmu, (batch, ...)."""
        mu = self.surface.cosines
        decay = jnp.exp(-depth.reshape(mu.shape[0], -1, 1) / mu[:, None])
        weights = self.surface.weights * mu ** (power - 1)
        return einsum("bnk,bk->bn", decay, weights).reshape(depth.shape)


class _Kernels(NamedTuple):
    """Exponential integrals of depths x, and of x/mu_c for total reflection:
    int_0^mu_c mu^(k - 2) e^(-x/mu) dmu = mu_c^(k - 1) E_k(x/mu_c).

    Integrals over panels are against each polynomial, from the panel's upper end, or from the end
    next to the node.
    """

    e2_top: Array  # (batch, n), E_2(tau)
    e2_ground: Array  # (batch, n), E_2(h - tau)
    e2_top_total: Array  # (batch, n), E_2(tau/mu_c)
    e2_ground_total: Array  # (batch, n), E_2((h + tau)/mu_c)
    e3: Array  # (batch,), E_3(h)
    e3_total: Array  # (batch,), E_3(h/mu_c)
    e3_twice_total: Array  # (batch,), E_3(2 h/mu_c)
    e1_panels: Array  # (batch, n, panels, p), int E_1(|tau - s|), from the end next to the node
    e1_panels_total: Array  # (batch, n, panels, p), int E_1((tau + s)/mu_c)
    e2_panels: Array  # (batch, panels, p), int E_2(h - s), from the lower end
    e2_panels_total: Array  # (batch, panels, p), int E_2((h + s)/mu_c)


class _GroundLight(NamedTuple):
    """Light of an evenly bright ground of brightness one in the paint."""

    nodes: Array  # (batch, n), M
    integrals: Array  # (batch, n), int M(s) l_j(s) ds
    returned: Array  # (batch,), K, that comes back to it
    reflected: Array  # (batch,), int R mu e^(-h/mu) dmu, that the surface keeps


def _columns(array: Array) -> Array:
    """(..., panels, p) -> (..., n)."""
    return array.reshape(*array.shape[:-2], -1)


def _grid(panels: Panels, refractive_index: Any) -> _Grid:
    surface = _surface(refractive_index, panels.total)
    tau = _columns(panels.top[..., None] + panels.width[..., None] * panels.rules.nodes)
    # Decays along the cone's directions, which U and M' both need over the panels.
    rates = 1.0 / surface.cosines[..., None]
    top, width = panels.top[:, None, :], panels.width[:, None, :]
    return _Grid(
        panels=panels,
        surface=surface,
        depth=tau,
        above_ground=jnp.maximum(panels.total[:, None] - tau, 0.0),
        panel=np.repeat(np.arange(panels.top.shape[1]), len(panels.rules.nodes)),
        decays=_columns(decay_integrals(rates, top, width, panels.rules)),
    )


def _kernels(grid: _Grid) -> _Kernels:
    """All of them, each kernel for both ways in one stack, so that the program holds it once."""
    top, width, _, h, rules = grid.panels
    tau = grid.depth
    bottom = top + width
    ground = h[:, None]
    critical = grid.surface.critical
    c1 = critical[:, None]
    c2 = critical[:, None, None]
    # At the nodes.
    e2 = expn(2, jnp.stack([tau, grid.above_ground, tau / c1, (ground + tau) / c1]))
    e3 = expn(3, jnp.stack([h, h / critical, 2.0 * h / critical]))
    # Over panels, by the distance of a panel's nearer end from a node, or from the ground.
    widths = jnp.stack([width, width / c1])
    node = tau[..., None]
    gap = jnp.where(_below(grid), top[:, None, :] - node, node - bottom[:, None, :])
    distance = jnp.stack([jnp.maximum(gap, 0.0), (node + top[:, None, :]) / c2])
    e1_panels = kernel_integrals(1, distance, widths[:, :, None, :], rules)
    distance = jnp.stack([jnp.maximum(ground - bottom, 0.0), (ground + top) / c1])
    e2_panels = kernel_integrals(2, distance, widths, rules)
    return _Kernels(*e2, *e3, *e1_panels, *e2_panels)


def _below(grid: _Grid) -> np.ndarray:
    """Mask (n, panels) of panels below a node's own."""
    return np.arange(grid.panels.top.shape[1]) > grid.panel[:, None]


def _straight(grid: _Grid, kernels: _Kernels) -> Array:
    """H, eq. (9): int E_1(|tau_i - s|) l_j(s) ds, (batch, n, n)."""
    _, width, _, _, rules = grid.panels
    count = width.shape[1]
    # Integrals begin at the end next to the node: for panels above it that is the lower end.
    e1 = kernels.e1_panels
    e1 = jnp.where(_below(grid)[..., None], e1, e1[..., ::-1])
    # In a node's own panel the kernel is infinite at the node.
    singular = own_integrals(width, rules)[..., None, :]
    singular = (singular * np.eye(count, dtype=width.dtype)[:, None, :, None]).reshape(e1.shape)
    is_own = np.eye(count, dtype=bool)[grid.panel][..., None]
    return _columns(jnp.where(is_own, singular, e1))


def _by_surface(grid: _Grid, kernels: _Kernels) -> Array:
    """U, eq. (17): int int_0^1 R e^(-(tau_i + s)/mu)/mu dmu l_j(s) ds, (batch, n, n)."""
    surface = grid.surface
    mu = surface.cosines
    # R = 1 beyond the critical angle; a quadrature in the cone.
    decay = jnp.exp(-grid.depth[..., None] / mu[:, None])
    cone = matmul(decay, (surface.weights / mu)[..., None] * grid.decays)
    return surface.total[:, None, None] * _columns(kernels.e1_panels_total) + cone


def _ground_light(grid: _Grid, kernels: _Kernels) -> _GroundLight:
    """M, eq. (18), and K, eq. (20)."""
    surface = grid.surface
    h = grid.panels.total
    squared = surface.total * surface.critical
    # Straight from the ground, and by way of the surface.
    nodes = kernels.e2_ground + surface.total[:, None] * kernels.e2_ground_total
    nodes += grid.cone(1, h[:, None] + grid.depth)
    integrals = kernels.e2_panels[..., ::-1] + squared[:, None, None] * kernels.e2_panels_total
    decay = surface.weights * jnp.exp(-h[:, None] / surface.cosines)
    integrals = _columns(integrals) + einsum("bk,bkn->bn", decay, grid.decays)
    returned = 2.0 * (squared * kernels.e3_twice_total + grid.cone(2, 2.0 * h))
    reflected = squared * kernels.e3_total + grid.cone(2, h)
    # Their sum is int M ds in closed form.
    exact = 0.5 - kernels.e3 + reflected - 0.5 * returned
    return _GroundLight(nodes, integrals * _rescale(integrals, exact, h), returned, reflected)


def _system(panels: Panels, light: StackArrays) -> CollocatedSystem:
    grid = _grid(panels, light.refractive_index)
    kernels = _kernels(grid)
    ground = _ground_light(grid, kernels)
    tau = grid.depth
    h = panels.total
    identity = np.eye(tau.shape[1], dtype=tau.dtype)
    open_share = light.ground / (1.0 - light.ground * ground.returned)  # rho/(1 - rho K)
    # A = H + U + 2 rho/(1 - rho K) M M'.
    operator = _straight(grid, kernels) + _by_surface(grid, kernels)
    operator += (
        (2.0 * open_share)[:, None, None] * ground.nodes[..., None] * ground.integrals[:, None]
    )
    # int R e^(-tau/mu) dmu.
    reflected_up = grid.surface.total[:, None] * kernels.e2_top_total + grid.cone(1, tau)
    # A constant is scattered exactly, so that an albedo of one loses nothing however deep the
    # layer: the diagonal takes up what the rows' sums lack.
    constant = 2.0 - kernels.e2_top - kernels.e2_ground + reflected_up
    constant -= ground.nodes - kernels.e2_ground
    constant += (
        2.0 * open_share[:, None] * ground.nodes * jnp.sum(ground.integrals, axis=-1, keepdims=True)
    )
    operator += (constant - jnp.sum(operator, axis=-1))[..., None] * identity
    q = _columns(panels.albedo)
    matrix = jnp.asarray(identity) - 0.5 * operator * q[:, None, :]
    # pi g l_j: the beam, on its refracted way, scattered for the first time.
    n = light.refractive_index
    rate = 1.0 / cos_refracted(light.cos_incidence, n)
    enter = 1.0 - dielectric_reflectance(light.cos_incidence, n)
    strength = (0.5 * enter * rate)[:, None]
    arriving = enter * jnp.exp(-rate * h)
    top, width, rules = panels.top, panels.width, panels.rules
    if light.cos_viewing is None:
        # V of all directions of view together: E_2 less what the surface reflects back.
        beam = _columns(decay_integrals(rate[:, None], top, width, rules)) * strength
        # Their sum is what the layers take out of the beam.
        beam *= _rescale(beam, -0.5 * enter * jnp.expm1(-rate * h), h)
        exit_weight = kernels.e2_top - reflected_up
        ground_weight = kernels.e3 - ground.reflected
        factor = jnp.full_like(h, 2.0)
        once = jnp.sum(q * beam * exit_weight, axis=-1)
    else:
        # V of one direction; light scattered once is the integral of both decays, exact.
        out = 1.0 / cos_refracted(light.cos_viewing, n)
        rates = jnp.stack([rate, rate + out])[..., None]
        beam, there_and_back = _columns(decay_integrals(rates, top, width, rules)) * strength
        exit_weight = jnp.exp(-out[:, None] * tau)
        ground_weight = jnp.exp(-out * h) / out
        # What leaves through the surface, eq. (32).
        factor = (1.0 - dielectric_reflectance(light.cos_viewing, n)) * out / n**2
        once = jnp.sum(q * there_and_back, axis=-1)
    # c = rho E_h/(1 - rho K).
    ground_seen = open_share * ground_weight
    return CollocatedSystem(
        matrix=matrix,
        exit=0.5 * exit_weight,
        ground_seen=ground_seen[:, None] * ground.nodes,
        beam=q * (beam + (open_share * arriving)[:, None] * ground.integrals),
        factor=factor,
        single=0.5 * once,
        single_interpolated=0.5 * jnp.sum(q * beam * exit_weight, axis=-1),
        ground_direct=ground_seen * arriving,
    )


def _rescale(weights: Array, exact: Array, depth: Array) -> Array:
    """Factor that gives weights their exact sum; where there is hardly any depth or light they have
    it anyway.
    """
    total = jnp.sum(weights, axis=-1)
    enough = (depth > 1e-3) & (total > 0)
    return jnp.where(enough, exact / jnp.where(enough, total, 1.0), 1.0)[:, None]


def _surface(refractive_index: Any, like: Array) -> _LayerSurface:
    """An index of exactly one reflects nothing, however its directions are reckoned."""
    transparent = isinstance(refractive_index, float) and refractive_index == 1
    # For an index of one any cone stands in; its share is zero.
    n = 1.5 if transparent else refractive_index
    mu, weights, r = (jnp.asarray(a, like.dtype) for a in cone_nodes(n, 1 if transparent else None))
    reflects = jnp.asarray(refractive_index, like.dtype) > 1.0
    share = jnp.broadcast_to(reflects, like.shape).astype(like.dtype)
    shape = (*like.shape, mu.shape[-1])
    critical = jnp.broadcast_to(critical_cosine(jnp.asarray(n, like.dtype)), like.shape)
    return _LayerSurface(
        jnp.broadcast_to(mu, shape), share[:, None] * weights * r, critical, share * critical
    )


class _MeshRow(NamedTuple):
    tolerance: float
    nodes: int
    points: int
    graded: tuple[
        int, int, int
    ]  # for layers up to the depths of _DEPTHS; thicker ones have the last and an interior


# Worst errors of each row: `python -m benchmarks.solver.calibrate_auxiliary`.
_ROWS = (
    _MeshRow(1e-2, 4, 8, (2, 3, 5)),
    _MeshRow(1e-3, 4, 8, (2, 3, 5)),
    _MeshRow(1e-4, 5, 9, (3, 4, 6)),
    _MeshRow(1e-5, 6, 10, (3, 4, 7)),
    _MeshRow(1e-6, 7, 12, (4, 5, 7)),
    _MeshRow(1e-7, 8, 14, (4, 5, 7)),
    _MeshRow(1e-8, 9, 16, (5, 6, 8)),
)
_DEPTHS = (2.0, 8.0, 40.0)
# The thicker the layer, the more its widest panels matter rather than its narrowest.
_RATIOS = (0.25, 0.37, 0.5)
# Below these indices beams may graze inside, too: their decay needs more and narrower panels at
# each face.
_GRAZING = ((1.01, 4), (1.1, 2))


def resolve(tolerance: float, thickest: float, lowest_index: float) -> PanelMesh:
    """Mesh that keeps the absolute error of either reflectance below the tolerance.

    Args:
        tolerance: absolute error wanted; anything below 1e-8 gets the mesh for 1e-8.
        thickest: largest optical thickness of a layer; infinite where it is not known.
        lowest_index: smallest refractive index of the batch.
    """
    row = next((row for row in _ROWS if row.tolerance <= tolerance * (1 + 1e-9)), _ROWS[-1])
    kind = min(int(np.searchsorted(_DEPTHS, thickest)), 2)
    interior = thickest > _DEPTHS[-1]
    grazing = next((panels for index, panels in _GRAZING if lowest_index < index), 0)
    # Faces of layers so thick that their interior has panels of its own need three more.
    graded = row.graded[kind] + grazing + 3 * interior
    # With so many panels, their growth matters more than the first one's width.
    ratio = max(_RATIOS[kind], 0.4) if lowest_index < _GRAZING[0][0] else _RATIOS[kind]
    return PanelMesh(
        nodes=row.nodes, points=row.points, graded=graded, ratio=ratio, interior=interior
    )


def bytes_each(mesh: PanelMesh, panels: int, itemsize: int) -> int:
    """Memory that one stack's largest arrays take, by its number of panels."""
    nodes = panels * mesh.nodes
    return itemsize * (4 * nodes**2 + 2 * nodes * panels * mesh.points)


def _stack_panels(stack: StackArrays, mesh: PanelMesh) -> Panels:
    slant = cos_refracted(stack.cos_incidence, stack.refractive_index)
    if stack.cos_viewing is not None:
        slant = jnp.minimum(slant, cos_refracted(stack.cos_viewing, stack.refractive_index))
    # Deeper is no different to rounding, but without absorption the equation would be singular.
    depth = jnp.minimum(stack.optical_thickness, 1.0 / float(jnp.finfo(stack.albedo.dtype).eps))
    return layer_panels(depth, stack.albedo, slant, mesh)


def _solve(matrix: Array, b: Array) -> Array:
    """The matrix is diagonally dominant, so no pivoting is needed; its derivatives are those of the
    solution.
    """

    def solve(_, b: Array) -> Array:
        return solve_positive(matrix, b[..., None])[..., 0]

    def solve_transposed(_, b: Array) -> Array:
        return solve_positive(transpose(matrix), b[..., None])[..., 0]

    def product(x: Array) -> Array:
        return einsum("bij,bj->bi", matrix, x)

    return jax.lax.custom_linear_solve(product, b, solve, solve_transposed)


def reflectance_on(panels: Panels, light: StackArrays) -> Array:
    """Reflectance factor, or hemispherical reflectance where there is no viewing direction,
    (batch,).

    Only the ground, the index and the cosines of ``light`` count; the panels hold the layers.
    """
    system = _system(panels, light)
    solution = _solve(system.matrix, system.exit + system.ground_seen)
    scattered = jnp.sum(system.beam * solution, axis=-1)
    # What the mesh makes of light scattered once is replaced by its exact value.
    return system.factor * (
        system.ground_direct + scattered + system.single - system.single_interpolated
    )


def reflectance(stack: StackArrays, mesh: PanelMesh) -> Array:
    """Reflectance factor, or hemispherical reflectance where the stack has no viewing direction,
    (batch,).
    """
    return reflectance_on(_stack_panels(stack, mesh), stack)


def split(stack: StackArrays, mesh: PanelMesh) -> Split:
    """The same by what the light did last, each (batch,)."""
    system = _system(_stack_panels(stack, mesh), stack)
    sources = jnp.stack([system.exit, system.ground_seen], axis=-1)
    solution = solve_positive(system.matrix, sources)
    scattered, grounded = (jnp.sum(system.beam * solution[..., i], axis=-1) for i in range(2))
    return Split(
        ground=system.factor * (system.ground_direct + grounded),
        single=system.factor * system.single,
        multiple=system.factor * (scattered - system.single_interpolated),
    )
