"""The matrices of the auxiliary function method where every stack has a step of its own (paper A, section 3).

`direct` is the conventional assembly: each of the Q x Q entries is its own double quadrature, over the segment and
over the directions. `decomposed` makes the same matrix from Q numbers of H and 2Q - 1 of U, exactly (section 4.1).
"""

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from glazejax.radiative.directions import gauss
from glazejax.radiative.exponential_integrals import cone_nodes, expn, internal_reflection_integral

# Nodes of the direct quadrature, the fewest that leave every entry within 1e-6 (at steps to 0.04; beyond, the error
# grows with the step). That is where the paper's MATLAB stops by default.
_SEGMENT_NODES = 4
_GRAZING_NODES = 14
_CONE_NODES = 6
_OWN_SEGMENT_NODES = 8
_OWN_GRAZING_NODES = 32
# exp(-x/mu) counts for nothing where mu is smaller than x by this factor.
_NEGLIGIBLE_DEPTH = 16.0


class Operator(NamedTuple):
    """H + U, the vectors M and M' and the number K of every stack (eqs (18), (20), (25))."""

    matrix: Float[Array, "stacks n n"]
    m: Float[Array, "n stacks"]
    m_integrated: Float[Array, "n stacks"]
    k: Float[Array, "stacks"]


def decomposed(
    step: Float[Array, "stacks"], depth: Float[Array, "stacks"], most: int, refractive_index: float
) -> Operator:
    """From Q + (2Q - 1) + 2Q numbers for each stack, all exact.

    Args:
        step: dh of each stack, > 0.
        depth: h, a multiple of it.
        most: Q for all stacks; rows and columns beyond a stack's own have no meaning.
        refractive_index: n.
    """
    e2 = expn(2, (jnp.arange(most) + 0.5) * step[:, None])
    toeplitz = jnp.concatenate([2.0 * (1.0 - e2[:, :1]), e2[:, :-1] - e2[:, 1:]], axis=1)
    j1 = internal_reflection_integral(1, (jnp.arange(2 * most) + 0.5) * step[:, None], refractive_index)
    matrix = toeplitz_plus_hankel(toeplitz, j1[:, :-1] - j1[:, 1:])
    return Operator(matrix, *ground_vectors(step, depth, most, refractive_index))


def direct(step: Float[Array, "stacks"], depth: Float[Array, "stacks"], most: int, refractive_index: float) -> Operator:
    """The same, every entry of H + U by its own quadrature over the segment and over mu.

    Four Gauss nodes in the segment; in mu, where exp(-x/mu)/mu varies over decades, Gauss nodes in ln mu down to a
    sixteenth of the nearest distance, and for U the cone of refraction apart. The segment's own E_1 has a logarithm
    inside, so its two halves get nodes that crowd at the midpoint. M and M' are vectors already.
    """
    y, w = gauss(_SEGMENT_NODES)
    index = jnp.arange(most)

    def entries(dh: Array) -> Array:
        """All entries of one stack."""
        node = (index + 0.5) * dh

        def integrated(distance, mu: Array, weight: Array) -> Array:
            def add(k: Array, total: Array) -> Array:
                for position, share in zip(y, w, strict=True):
                    s = (index + position) * dh
                    total = total + share * dh * weight[k] * jnp.exp(-distance(node[:, None], s) / mu[k])
                return total

            return jax.lax.fori_loop(0, mu.size, add, jnp.zeros((most, most), dh.dtype))

        smallest = 0.5 * dh / _NEGLIGIBLE_DEPTH
        matrix = integrated(lambda node, s: jnp.abs(node - s), *_grazing(1.0, smallest, _GRAZING_NODES))
        matrix = jnp.where(np.eye(most, dtype=bool), _own(node, dh)[:, None], matrix)
        if refractive_index > 1.0:
            critical = math.sqrt(1.0 - 1.0 / refractive_index**2)
            mu, weight = _grazing(critical, smallest, _GRAZING_NODES)
            cone, w_cone, r = (jnp.asarray(a, dh.dtype) for a in cone_nodes(refractive_index, _CONE_NODES))
            mu, weight = jnp.concatenate([mu, cone]), jnp.concatenate([weight, w_cone * r / cone])
            matrix = matrix + integrated(lambda node, s: node + s, mu, weight)
        return matrix

    return Operator(jax.lax.map(entries, step), *ground_vectors(step, depth, most, refractive_index))


def _own(node: Array, dh: Array) -> Float[Array, "n"]:
    """Each segment's E_1 integrated over itself: nodes crowd at the midpoint from both sides."""
    y, w = gauss(_OWN_SEGMENT_NODES)
    offset, weight = 0.5 * dh * np.concatenate([-(y**3), y**3]), 0.5 * dh * np.tile(3.0 * y**2 * w, 2)
    mu, w_mu = _grazing(1.0, 0.5 * dh * y.min() ** 3 / _NEGLIGIBLE_DEPTH, _OWN_GRAZING_NODES)
    distance = jnp.abs(node[:, None] - (node[:, None] + offset))
    return jnp.sum(weight * jnp.sum(w_mu * jnp.exp(-distance[..., None] / mu), axis=-1), axis=-1)


def _grazing(top: float, bottom: Array, nodes: int) -> tuple[Array, Array]:
    """Gauss nodes in ln mu from top down to bottom: mu and the weights dmu/mu."""
    y, w = gauss(nodes)
    span = jnp.maximum(jnp.log(top / bottom), 0.0)
    return top * jnp.exp(-span * y), span * w


def ground_vectors(
    step: Float[Array, "stacks"], depth: Float[Array, "stacks"], most: int, refractive_index: float
) -> tuple[Array, Array, Array]:
    """M at the midpoints and integrated over the segments, (n, stacks), and K, (stacks,); exact."""
    edges = jnp.arange(most + 1)[:, None] * step
    middle = edges[:-1] + 0.5 * step

    def reflected(power: int, x: Array) -> Array:
        return internal_reflection_integral(power, x, refractive_index)

    m = expn(2, jnp.abs(depth - middle)) + reflected(1, depth + middle)
    antiderivative = expn(3, jnp.abs(depth - edges)) - reflected(2, depth + edges)
    return m, antiderivative[1:] - antiderivative[:-1], 2.0 * reflected(2, 2.0 * depth)


def toeplitz_plus_hankel(toeplitz: Float[Array, "*stacks n"], hankel: Float[Array, "*stacks m"]) -> Array:
    """Matrix toeplitz[|i - j|] + hankel[i + j], (*stacks, n, n); m >= 2n - 1."""
    i = np.arange(toeplitz.shape[-1])
    return toeplitz[..., np.abs(i[:, None] - i)] + hankel[..., i[:, None] + i]
