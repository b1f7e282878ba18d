"""Inverses of small matrices that need no pivoting: short programs, and derivatives that are products.

A gradient through the steps of an elimination takes JAX many times longer to compile than d(A^-1) = -A^-1 dA A^-1.
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .linalg import inverse_positive


@jax.custom_jvp
def inverse(a: Float[Array, "*batch n n"]) -> Float[Array, "*batch n n"]:
    """Inverse by Gauss and Jordan's sweep over the rows, in place, without pivoting.

    For matrices that are symmetric positive definite or, scaled by a positive vector, diagonally dominant by rows.
    """
    n = a.shape[-1]

    def sweep(j: Array, work: Array) -> Array:
        here = (jnp.arange(n) == j).astype(work.dtype)
        others = 1.0 - here
        row = jax.lax.dynamic_index_in_dim(work, j, work.ndim - 2, keepdims=False)
        column = jax.lax.dynamic_index_in_dim(work, j, work.ndim - 1, keepdims=False)
        pivot = jax.lax.dynamic_index_in_dim(row, j, row.ndim - 1)
        row = (row * others + here) / pivot
        left = here - column * others
        return work * (others[:, None] * others) + left[..., :, None] * row[..., None, :]

    return jax.lax.fori_loop(0, n, sweep, a)


@inverse.defjvp
def _inverse_jvp(primals, tangents):
    found = inverse(*primals)
    return found, _slope(found, tangents[0])


@jax.custom_jvp
def inverse_symmetric(a: Float[Array, "*batch n n"]) -> Float[Array, "*batch n n"]:
    """Inverse of a symmetric positive definite matrix: faster than `inverse`, slower to compile."""
    return inverse_positive(a)


@inverse_symmetric.defjvp
def _inverse_symmetric_jvp(primals, tangents):
    found = inverse_symmetric(*primals)
    return found, _slope(found, tangents[0])


def _slope(found: Array, change: Array) -> Array:
    return -jnp.matmul(jnp.matmul(found, change, precision="highest"), found, precision="highest")
