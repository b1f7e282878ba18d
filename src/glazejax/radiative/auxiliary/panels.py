"""Panels of a graded mesh in optical depth, and integrals of kernels over them that are exact to
rounding.

On a panel a function is the polynomial through its values at Gauss-Lobatto nodes. Those at the ends
couple panels that are far wider than a mean free path, as within a thick layer, where inner nodes
see nothing but their own panel. A kernel is integrated against the polynomial by a fixed rule whose
points crowd at the end next to the kernel's singularity where the panel is narrow, and by parts, a
finite sum of exponential integrals of rising order, where it is wide; so any width and any distance
will do.
"""

import functools
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array
from numpy.polynomial import legendre

from ..common.exponential_integrals import expn, least_argument
from ..common.linalg import einsum, matmul
from ..common.quadrature import gauss

# Panels wider than this (in mean free paths of the kernel) are integrated by parts.
_WIDE = 5.0
# Power of the grading of the fixed rule towards the singularity.
_GRADING = 3


class PanelMesh(NamedTuple):
    """Fineness of the division of layers; static."""

    nodes: int
    """Gauss nodes in a panel."""
    points: int
    """Points of the rule that integrates a kernel over a narrow panel."""
    graded: int
    """Panels that shrink towards each face of a layer."""
    ratio: float
    """Inner over outer edge of each of these."""
    interior: bool
    """Whether a layer may be thicker than those reach: nine more panels then cover its inside."""


class Rules(NamedTuple):
    """Tables of one panel, near end first; numpy."""

    nodes: np.ndarray  # (p,), on [0, 1]
    points: np.ndarray  # (m,), on [0, 1], crowded at the near end
    kernel: (
        np.ndarray
    )  # (m, p): weight of a kernel's value at a point in the integral with Lagrange polynomial j
    near: (
        np.ndarray
    )  # (p, p): derivative k of polynomial j at the near end, in units of half the width
    far: np.ndarray  # (p, p): the same at the far end
    own_points: (
        np.ndarray
    )  # (p, 2 m): distance from node i to points on either side, as a share of the width
    own_kernel: np.ndarray  # (p, 2 m, p)
    own_derivatives: np.ndarray  # (p, p, p): derivative k of polynomial j at node i


@functools.cache
def rules(count: int, points: int, dtype: np.dtype) -> Rules:
    """Tables for `count` nodes and a fixed rule of `points` points.

    Each precision has arrays of its own: JAX keeps what it made of an array by its identity.
    """
    # Gauss-Lobatto nodes on [-1, 1], ends included.
    inner = legendre.Legendre.basis(count - 1).deriv().roots()
    xi = np.r_[-1.0, np.sort(inner.real), 1.0]
    # From values at the nodes to coefficients of Legendre polynomials.
    coefficients = np.linalg.inv(legendre.legvander(xi, count - 1))  # (degree, j)

    def derivatives(x: np.ndarray) -> np.ndarray:  # (k, len(x), j)
        return np.stack(
            [legendre.legval(x, legendre.legder(coefficients, k)).T for k in range(count)]
        )

    def values(x: np.ndarray) -> np.ndarray:
        return legendre.legvander(x, count - 1) @ coefficients

    # Gauss nodes in v; x = v^3 crowds them at the near end.
    v, wv = gauss(points)
    x = v**_GRADING
    wx = wv * _GRADING * v ** (_GRADING - 1)
    ends = derivatives(np.array([-1.0, 1.0]))
    # In a node's own panel the kernel is infinite at the node: the rule runs from it to both ends.
    own_points = []
    own_kernel = []
    for node in xi:
        above = 0.5 * (1 + node)
        below = 0.5 * (1 - node)
        up = above * x
        down = below * x
        own_points.append(np.r_[up, down])
        shares = np.r_[above * wx, below * wx]
        own_kernel.append(shares[:, None] * values(np.r_[node - 2 * up, node + 2 * down]))
    tables = Rules(
        nodes=0.5 * (1 + xi),
        points=x,
        kernel=wx[:, None] * values(2 * x - 1),
        near=ends[:, 0],
        far=ends[:, 1],
        own_points=np.array(own_points),
        own_kernel=np.array(own_kernel),
        own_derivatives=np.swapaxes(derivatives(xi), 0, 1),
    )
    return Rules(*(table.astype(dtype) for table in tables))


def _orders(first: int, count: int, x: Array) -> Array:
    """E_first(x) ... E_(first + count - 1)(x), (..., count), by the upward recurrence;
    first >= 2.
    """
    value = expn(first, x)
    decay = jnp.exp(-x)
    out = [value]
    for n in range(first, first + count - 1):
        value = (decay - x * value) / n
        out.append(value)
    return jnp.stack(out, axis=-1)


def _powers(x: Array, count: int) -> Array:
    """1, x, x^2, ..., (..., count)."""
    return jnp.cumprod(
        jnp.concatenate([jnp.ones_like(x)[..., None]] + [x[..., None]] * (count - 1), axis=-1),
        axis=-1,
    )


def kernel_integrals(order: int, distance: Array, width: Array, rules: Rules) -> Array:
    """Integrals of E_order(distance + t) with each Lagrange polynomial over a panel, t from its
    near end, (..., p).
    """
    distance, width = jnp.broadcast_arrays(distance, width)
    wide = width > _WIDE
    count = len(rules.nodes)
    # Narrow: the fixed rule. The width of a wide one is replaced, so that its unused slope is
    # finite.
    narrow_width = jnp.where(wide, 1.0, width)[..., None]
    t = jnp.maximum(distance[..., None] + narrow_width * rules.points, least_argument(width.dtype))
    narrow = narrow_width * matmul(expn(order, t), rules.kernel)
    # Wide: by parts, (2/width)^k E_(order + 1 + k) times the k-th derivative, at both ends.
    wide_width = jnp.where(wide, width, _WIDE)
    scale = _powers(2.0 / wide_width, count)
    ends = scale * _orders(order + 1, count, jnp.stack([distance, distance + wide_width]))
    near = matmul(ends[0], rules.near)
    far = matmul(ends[1], rules.far)
    return jnp.where(wide[..., None], near - far, narrow)


def decay_integrals(rate: Array, top: Array, width: Array, rules: Rules) -> Array:
    """Integrals of e^(-rate tau) with each Lagrange polynomial over a panel that begins at depth
    `top`, (..., p).
    """
    rate, top, width = jnp.broadcast_arrays(rate, top, width)
    z = rate * width
    wide = z > _WIDE
    count = len(rules.nodes)
    # Narrow in decay lengths: the fixed rule.
    decay = jnp.exp(-jnp.where(wide, 1.0, z)[..., None] * rules.points)
    shares = matmul(decay, rules.kernel)
    # Wide: by parts at both ends.
    safe = jnp.where(wide, z, _WIDE)
    scale = _powers(2.0 / safe, count)
    by_parts = matmul(scale, rules.near)
    by_parts -= jnp.exp(-safe)[..., None] * matmul(scale, rules.far)
    integrals = jnp.where(wide[..., None], by_parts / safe[..., None], shares)
    return (jnp.exp(-rate * top) * width)[..., None] * integrals


def own_integrals(width: Array, rules: Rules) -> Array:
    """Integrals of E_1(|tau_i - s|) with each polynomial over the nodes' own panel, (..., p, p)."""
    wide = width > _WIDE
    count = len(rules.nodes)
    # Narrow: the rule that crowds at the node from both sides.
    narrow_width = jnp.where(wide, 1.0, width)[..., None, None]
    t = jnp.maximum(narrow_width * rules.own_points, least_argument(width.dtype))
    narrow = narrow_width * einsum("...im,imj->...ij", expn(1, t), rules.own_kernel)
    # Wide: by parts, from the node, where E_k(0) = 1/(k - 1), to both ends.
    wide_width = jnp.where(wide, width, _WIDE)[..., None]
    scale = _powers(2.0 / wide_width, count)  # (..., 1, k)
    k = np.arange(count)
    at_zero = (1.0 + (-1.0) ** k) / (k + 1)  # E_(k+2)(0) = 1/(k+1), from above and from below
    middle = einsum("...zk,ikj->...ij", scale * at_zero, rules.own_derivatives)
    ends = scale * _orders(
        2, count, jnp.stack([wide_width * (1.0 - rules.nodes), wide_width * rules.nodes])
    )
    below = matmul(ends[0], rules.far)
    above = matmul(ends[1] * (-1.0) ** k, rules.near)
    return jnp.where(wide[..., None, None], middle - below - above, narrow)


class Panels(NamedTuple):
    """A mesh in optical depth."""

    top: Array  # (batch, panels)
    width: Array  # (batch, panels)
    albedo: Array  # (batch, panels, p), at the nodes
    total: Array  # (batch,), optical thickness h of all
    rules: Any  # Rules; None while the arrays travel through a loop


# Where that has died away too, in its decay lengths, and the edges of the panels up to there.
_INTERIOR = np.array([0.4, 1.2, 3.0, 6.5, 13.0, 25.0]) / 25.0


def _half_layer(depth: Array, albedo: Array, slant: Array, mesh: PanelMesh) -> Array:
    """Edges of the panels from a face towards the middle as shares of the depth, (batch, layers,
    panels + 1); what they follow from is (batch, layers, 1).
    """
    half = 0.5 * depth
    # Depth beyond which only the slowest mode of a layer is left, in mean free paths.
    reach = jnp.minimum(half, 22.0) if mesh.interior else half
    # The first panel is narrow compared with the depth at which a grazing beam is gone.
    ratio = jnp.maximum(
        mesh.ratio ** (1 - mesh.graded), reach / jnp.maximum(2.0 * slant**2, 0.05 * slant)
    )
    steps = -np.arange(mesh.graded - 1, -1, -1) / (mesh.graded - 1)
    edges = [jnp.zeros_like(half), reach * ratio**steps]
    if mesh.interior:
        decay = jnp.sqrt(jnp.minimum(3.0 * (1.0 - albedo), 1.0))
        # There it has died away too, in its decay lengths.
        gone = jnp.minimum(half, reach + 30.0 / jnp.maximum(decay, 1e-12))
        edges.append(reach + (gone - reach) * _INTERIOR.astype(half.dtype))
    edges = jnp.concatenate(edges, axis=-1)
    # An empty layer has panels too, of no width.
    shares = 0.5 * edges / jnp.where(half > 0, half, 1.0)
    return jnp.where(half > 0, shares, np.linspace(0.0, 0.5, edges.shape[-1]))


def layer_panels(thickness: Array, layer_albedo: Array, slant: Array, mesh: PanelMesh) -> Panels:
    """Panels of homogeneous layers; their proportions are not differentiated, the result hardly
    depends on them.

    Args:
        thickness: optical thickness of the layers, top first, (batch, layers), >= 0.
        layer_albedo: their albedo, (batch, layers).
        slant: smallest cosine inside of the beams that must be resolved, (batch,).
        mesh: static.
    """
    fixed = jax.lax.stop_gradient(
        (thickness[..., None], layer_albedo[..., None], slant[:, None, None])
    )
    # The lower half mirrors the upper one: both faces are the same.
    share = _half_layer(*fixed, mesh)
    inner = share[..., 1:] - share[..., :-1]
    start = [share[..., :-1], 1.0 - share[..., :0:-1]]
    shares = [inner, inner[..., ::-1]]
    # Between the halves of a thick layer lies one more panel.
    if mesh.interior:
        start.insert(1, share[..., -1:])
        shares.insert(1, jnp.maximum(1.0 - 2.0 * share[..., -1:], 0.0))
    # From shares of the layer to depths in the stack.
    depth = jnp.cumsum(thickness, axis=-1)
    above = jnp.pad(depth[:, :-1], [(0, 0), (1, 0)])[..., None]
    top = above + thickness[..., None] * jnp.concatenate(start, axis=-1)
    width = thickness[..., None] * jnp.concatenate(shares, axis=-1)
    albedo = jnp.broadcast_to(layer_albedo[..., None, None], (*width.shape, mesh.nodes))
    stacks, layers, count = width.shape
    return Panels(
        top=top.reshape(stacks, layers * count),
        width=width.reshape(stacks, layers * count),
        albedo=albedo.reshape(stacks, layers * count, mesh.nodes),
        total=depth[:, -1],
        rules=rules(mesh.nodes, mesh.points, width.dtype),
    )


def graded_shares(mesh: PanelMesh) -> np.ndarray:
    """Edges of panels that shrink towards both faces of a film as shares of its depth, whatever its
    thickness.
    """
    half = 0.5 * np.r_[0.0, mesh.ratio ** np.arange(mesh.graded - 1, -1, -1.0)]
    return np.r_[half, 1.0 - half[-2::-1]]
