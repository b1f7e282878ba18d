"""The matrices of the auxiliary function method where every stack has a step of its own (paper A,
section 3).

`direct` is the conventional assembly: each of the Q x Q entries is its own double quadrature, over
the segment and over the directions. `decomposed_numbers` are the Q numbers of H and 2Q - 1 of U
that make the same matrix, exactly (section 4.1).
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from ..common.exponential_integrals import cone_nodes, expn
from ..common.fresnel import cos_refracted
from ..common.linalg import einsum
from ..common.quadrature import gauss

# exp(-x/mu) counts for nothing where mu is smaller than x by this factor.
_NEGLIGIBLE_DEPTH = 16.0


class Operator(NamedTuple):
    """H + U, the vectors M and M' and the number K of every stack (eqs (18), (20), (25))."""

    matrix: Float[
        Array, "stacks n n"
    ]  # [segment, node]: symmetric but for the error of a quadrature
    m: Float[Array, "n stacks"]
    m_integrated: Float[Array, "n stacks"]
    k: Float[Array, "stacks"]


def decomposed_numbers(
    step: Float[Array, "stacks"], count: Int[Array, "stacks"], most: int, refractive_index: float
) -> tuple[Array, Array, Array, Array, Array]:
    """Q numbers of H, 2Q - 1 of U and 2Q of M and M' for each stack, all exact.

    Args:
        step: dh of each stack, > 0.
        count: Q of each stack.
        most: Q_max, rows of all matrices; those beyond a stack's own have no meaning.
        refractive_index: n.

    Returns:
        First row of H, (stacks, n); U along its anti-diagonals, (stacks, 2n - 1); M and M', (n,
        stacks); K, (stacks,).
    """
    values = computed_once(lambda: _values(step, count, most, refractive_index), step)

    def numbers() -> tuple[Array, Array, Array, Array, Array]:
        e2, j1 = values[:2]
        # E_1 over a segment is a difference of E_2; over the node's own segment, on both its sides.
        toeplitz = jnp.concatenate([2.0 * (1.0 - e2[:, :1]), e2[:, :-1] - e2[:, 1:]], axis=1)
        # The surface's kernel over a segment is a difference of J_1.
        return toeplitz, j1[:, :-1] - j1[:, 1:], *_grounds(values, count)

    return computed_once(numbers, step)


def direct(
    step: Float[Array, "stacks"], count: Int[Array, "stacks"], most: int, refractive_index: float
) -> Operator:
    """H + U with every entry by its own quadrature over the segment and over mu, and M, M', K;
    arguments as of `decomposed_numbers`.

    Four Gauss nodes in the segment; in mu, where exp(-x/mu)/mu varies over decades, Gauss nodes in
    ln mu down to a sixteenth of the nearest distance, and for U the cone of refraction apart. The
    segment's own E_1 has a logarithm inside, so its two halves get nodes that crowd at the
    midpoint. M and M' are vectors already. The nodes are the fewest that leave every entry within
    1e-6 (at steps to 0.04; beyond, the error grows with the step). That is where the paper's MATLAB
    stops by default.
    """
    y, w = gauss(4)
    nodes = 14
    index = jnp.arange(most, dtype=step.dtype)

    def entries(dh: Array) -> Array:
        """All entries of one stack."""
        node = (index + 0.5) * dh

        # One direction and one point of all segments at a time: no array is larger than the matrix.
        def integrate(distance, mu: Array, weight: Array) -> Array:
            def add(k: Array, total: Array) -> Array:
                for position, share in zip(y, w, strict=True):
                    s = (index + position) * dh
                    total = total + share * dh * weight[k] * jnp.exp(
                        -distance(node, s[:, None]) / mu[k]
                    )
                return total

            return jax.lax.fori_loop(0, mu.size, add, jnp.zeros((most, most), dh.dtype))

        # H: what goes straight from segment to node, each segment's own part apart.
        smallest = 0.5 * dh / _NEGLIGIBLE_DEPTH
        matrix = integrate(lambda node, s: jnp.abs(node - s), *_grazing(1.0, smallest, nodes))
        matrix = jnp.where(np.eye(most, dtype=bool), _own(node, dh), matrix)
        # U: by way of the surface, which reflects all beyond the critical angle, and some of the
        # cone.
        if refractive_index > 1.0:
            critical = float(cos_refracted(0.0, refractive_index))
            mu, weight = _grazing(critical, smallest, nodes)
            cone, w_cone, r = (jnp.asarray(a, dh.dtype) for a in cone_nodes(refractive_index, 6))
            mu = jnp.concatenate([mu, cone])
            weight = jnp.concatenate([weight, w_cone * r / cone])
            matrix = matrix + integrate(lambda node, s: node + s, mu, weight)
        return matrix

    values = computed_once(lambda: _values(step, count, most, refractive_index), step)
    return Operator(jax.lax.map(entries, step), *_grounds(values, count))


def _own(node: Array, dh: Array) -> Float[Array, "n"]:
    """Each segment's E_1 integrated over itself: nodes crowd at the midpoint from both sides."""
    y, w = gauss(8)
    # s = +-(dh/2) y^3: in y the logarithm at the midpoint is harmless.
    offset = 0.5 * dh * np.concatenate([-(y**3), y**3])
    weight = 0.5 * dh * np.tile(3.0 * y**2 * w, 2)
    mu, w_mu = _grazing(1.0, 0.5 * dh * y.min() ** 3 / _NEGLIGIBLE_DEPTH, 32)
    distance = jnp.abs(node[:, None] - (node[:, None] + offset))
    return jnp.sum(weight * jnp.sum(w_mu * jnp.exp(-distance[..., None] / mu), axis=-1), axis=-1)


def _grazing(top: float, bottom: Array, nodes: int) -> tuple[Array, Array]:
    """Gauss nodes in ln mu from top down to bottom: mu and the weights dmu/mu."""
    y, w = gauss(nodes)
    span = jnp.maximum(jnp.log(top / bottom), 0.0)
    return top * jnp.exp(-span * y), span * w


def _values(
    step: Array, count: Array, most: int, refractive_index: float
) -> tuple[Array, Array, Array, Array]:
    """E_2 (stacks, n) and J_1 (stacks, 2n) at (k + 1/2) dh, E_3 at k dh and J_2 at h + k dh,
    (stacks, n + 1).

    J_p(x) = int_0^1 R(mu) mu^(p-1) exp(-x/mu) dmu. As h is Q dh, these also serve at h - s and h +
    s.
    """
    step = step[:, None]
    depth = count[:, None].astype(step.dtype) * step
    return (
        expn(2, (jnp.arange(most, dtype=step.dtype) + 0.5) * step),
        _reflection_integrals(1, 0.5 * step, step, 2 * most, refractive_index),
        expn(3, jnp.arange(most + 1, dtype=step.dtype) * step),
        _reflection_integrals(2, depth, step, most + 1, refractive_index),
    )


def ground(
    e2: Float[Array, "n"],
    j1: Float[Array, "m"],
    e3: Float[Array, "n+1"],
    j2: Float[Array, "n+1"],
    count: Int[Array, ""],
) -> tuple[Float[Array, "n"], Float[Array, "n"], Float[Array, ""]]:
    """M at the midpoints and integrated over the segments, and K, of one stack; exact.

    Args:
        e2, j1: E_2 and J_1 at (k + 1/2) dh, J_1 up to twice the depth.
        e3: E_3 at k dh.
        j2: J_2 at h + k dh.
        count: Q.
    """
    i = jnp.arange(e2.size)
    # h - s of node i is (Q - 1 - i + 1/2) dh, and h + s is (Q + i + 1/2) dh.
    above = jnp.maximum(count - 1 - i, 0)
    # M, eq. (18): straight from the ground, and by way of the surface.
    m = e2[above] + j1[count + i]
    # M' is a difference at the segment's two edges.
    integrated = e3[above] - e3[above + 1] + j2[:-1] - j2[1:]
    return m, integrated, 2.0 * j2[count]


def _grounds(values: tuple[Array, Array, Array, Array], count: Array) -> tuple[Array, Array, Array]:
    """`ground` of all stacks: (n, stacks) twice, and (stacks,)."""
    return jax.vmap(ground, out_axes=(1, 1, 0))(*values, count)


def _reflection_integrals(
    power: int, start: Array, step: Array, terms: int, refractive_index: float
) -> Array:
    """J_p at start + j step, both (stacks, 1), as (stacks, terms): total reflection in closed form,
    the cone by Gauss nodes.
    """
    if refractive_index == 1.0:
        return jnp.zeros((step.size, terms), step.dtype)
    critical = float(cos_refracted(0.0, refractive_index))
    depth = start + jnp.arange(terms, dtype=step.dtype) * step
    mu, weight, r = (jnp.asarray(a, step.dtype) for a in cone_nodes(refractive_index))
    # On an even grid the exponentials are products of those of every sixteenth point and of the
    # first sixteen.
    run = 16
    coarse = jnp.exp(-(step * np.arange(0.0, terms, run))[..., None] / mu)
    fine = jnp.exp(-(start + step * np.arange(float(run)))[..., None] / mu)
    cone = einsum("wak,wbk->wab", coarse * (weight * r * mu ** (power - 1)), fine)
    cone = cone.reshape(step.size, -1)[:, :terms]
    # Beyond the critical angle R = 1: mu_c^p E_(p+1)(x/mu_c).
    return cone + critical**power * expn(power + 1, depth / critical)


def computed_once(function: Callable[[], Any], positive: Array) -> Any:
    """function(), kept apart from what uses it: XLA would compile a series of 50 terms into each of
    Q^2 uses.

    A barrier does not hold on the CPU, a branch does. ``positive`` holds positive numbers.
    """
    nothing = jax.tree.map(lambda leaf: jnp.zeros(leaf.shape, leaf.dtype), jax.eval_shape(function))
    return jax.lax.cond(jnp.all(positive > 0), function, lambda: nothing)


def toeplitz_plus_hankel(
    toeplitz: Float[Array, "*stacks n"], hankel: Float[Array, "*stacks m"]
) -> Array:
    """Matrix toeplitz[|i - j|] + hankel[i + j], (*stacks, n, n); m >= 2n - 1."""
    i = np.arange(toeplitz.shape[-1])
    return toeplitz[..., np.abs(i[:, None] - i)] + hankel[..., i[:, None] + i]
