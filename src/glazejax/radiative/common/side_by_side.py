"""Small dense algebra on many matrices side by side, (..., rows, columns, batch), without pivoting.

The batch lies on the last axis, so that a processor's lanes run along it and not along rows of four
or six: inverses take half the time in double precision and a third in single. From some 16 rows on
`linalg`, batch first, is faster.
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

# From so many terms on XLA's own matrix product is faster than a sum, transposes and all: with 24
# terms 1.7 times, with 16 not yet.
_SUMMED_TERMS = 18
_SUMMED_ROWS = 5


def product(
    a: Float[Array, "*#stack l m #batch"], b: Float[Array, "*#stack m n #batch"]
) -> Float[Array, "*stack l n batch"]:
    """Matrix product: of small matrices as a sum, which XLA fuses with what surrounds it."""
    if a.shape[-2] < _SUMMED_TERMS or a.shape[-3] <= _SUMMED_ROWS:
        return jnp.sum(a[..., :, :, None, :] * b[..., None, :, :, :], axis=-3)
    first = (jnp.moveaxis(x, -1, -3) for x in (a, b))
    return jnp.moveaxis(jnp.matmul(*first, precision="highest"), -3, -1)


def transpose(a: Float[Array, "*stack n m batch"]) -> Float[Array, "*stack m n batch"]:
    """Matrix transpose."""
    return jnp.swapaxes(a, -2, -3)


def diagonal(values: Float[Array, "*stack n batch"]) -> Float[Array, "*stack n n batch"]:
    """Diagonal matrix."""
    n = values.shape[-2]
    return values[..., :, None, :] * jnp.eye(n, dtype=values.dtype)[..., None]


@jax.named_scope("inverse")
def inverse_positive(a: Float[Array, "*stack n n batch"]) -> Float[Array, "*stack n n batch"]:
    """Inverse of a symmetric positive definite matrix, by halves: Schur's complement of the upper
    left block.
    """
    n = a.shape[-2]
    if n == 1:
        return 1.0 / a
    if n == 2:
        determinant = a[..., 0, 0, :] * a[..., 1, 1, :] - a[..., 0, 1, :] * a[..., 1, 0, :]
        first = jnp.stack([a[..., 1, 1, :], -a[..., 0, 1, :]], axis=-2)
        second = jnp.stack([-a[..., 1, 0, :], a[..., 0, 0, :]], axis=-2)
        return jnp.stack([first, second], axis=-3) / determinant[..., None, None, :]
    if n == 3:
        return _inverse_of_three(a)
    half = n // 2
    # With the blocks A, B, C: A^-1, A^-1 B, and the inverse of Schur's complement C - B^T A^-1 B.
    corner = inverse_positive(a[..., :half, :half, :])
    across = product(corner, a[..., :half, half:, :])
    below = a[..., half:, half:, :] - product(a[..., half:, :half, :], across)
    complement = inverse_positive(below)
    side = -product(across, complement)
    upper = jnp.concatenate([corner - product(side, transpose(across)), side], axis=-2)
    lower = jnp.concatenate([transpose(side), complement], axis=-2)
    return jnp.concatenate([upper, lower], axis=-3)


def _inverse_of_three(a: Array) -> Array:
    """By cofactors; of the matrix's halves only the upper one is read."""
    a00, a01, a02, a11, a12, a22 = (a[..., i, j, :] for i in range(3) for j in range(i, 3))
    c00 = a11 * a22 - a12 * a12
    c01 = a02 * a12 - a01 * a22
    c02 = a01 * a12 - a02 * a11
    c11 = a00 * a22 - a02 * a02
    c12 = a01 * a02 - a00 * a12
    c22 = a00 * a11 - a01 * a01
    rows = [[c00, c01, c02], [c01, c11, c12], [c02, c12, c22]]
    cofactors = jnp.stack([jnp.stack(row, axis=-2) for row in rows], axis=-3)
    determinant = a00 * c00 + a01 * c01 + a02 * c02
    return cofactors / determinant[..., None, None, :]
