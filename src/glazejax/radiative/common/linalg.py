"""Small dense algebra in plain XLA operations, for matrices that need no pivoting; batch first.

Batches of matrices with up to some 16 rows are faster side by side: `side_by_side`.

No LAPACK: two batched LAPACK calls in one compiled program can hang for ever on the CPU (jaxlib
0.10, 0.11.0). Up to some 40 rows halving the matrix is three times faster than eliminating row by
row, which carries the whole batch through memory once a row.
"""

from collections.abc import Callable
from typing import TypeAlias

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

Matrices: TypeAlias = Float[Array, "*batch n n"]
"""Square matrices, batch first."""

# Up to so many terms, or with so few rows, a product written as a sum, which XLA fuses with what
# surrounds it, beats a call of its matrix product: twice for six terms, not at all for eight; with
# ten the call is 1.5 times as fast.
_FUSED_TERMS = 8
_FUSED_ROWS = 5


def product(
    a: Float[Array, "*#batch l m"], b: Float[Array, "*#batch m n"]
) -> Float[Array, "*batch l n"]:
    """Matrix product of many small matrices."""
    if a.shape[-1] <= _FUSED_TERMS or a.shape[-2] <= _FUSED_ROWS:
        return jnp.sum(a[..., :, :, None] * b[..., None, :, :], axis=-2)
    return matmul(a, b)


def matmul(
    a: Float[Array, "... m"], b: Float[Array | np.ndarray, "... m n"]
) -> Float[Array, "... n"]:
    """Matrix product, or a row times a matrix, in full precision on an accelerator too."""
    return jnp.matmul(a, b, precision="highest")


def einsum(subscripts: str, *arrays: Float[Array | np.ndarray, "..."]) -> Float[Array, "..."]:
    """Einstein's sum, in full precision on an accelerator too."""
    return jnp.einsum(subscripts, *arrays, precision="highest")


def transpose(a: Float[Array, "*batch n m"]) -> Float[Array, "*batch m n"]:
    """Matrix transpose."""
    return jnp.swapaxes(a, -1, -2)


@jax.named_scope("inverse")
def inverse_positive(a: Matrices) -> Matrices:
    """Inverse of a symmetric positive definite matrix, by halves: Schur's complement of the upper
    left block.
    """
    n = a.shape[-1]
    if n == 1:
        return 1.0 / a
    if n == 2:
        determinant = a[..., 0, 0] * a[..., 1, 1] - a[..., 0, 1] * a[..., 1, 0]
        first = jnp.stack([a[..., 1, 1], -a[..., 0, 1]], axis=-1)
        second = jnp.stack([-a[..., 1, 0], a[..., 0, 0]], axis=-1)
        return jnp.stack([first, second], axis=-2) / determinant[..., None, None]
    half = n // 2
    # With the blocks A, B, C: A^-1, A^-1 B, and the inverse of Schur's complement C - B^T A^-1 B.
    corner = inverse_positive(a[..., :half, :half])
    across = product(corner, a[..., :half, half:])
    complement = inverse_positive(a[..., half:, half:] - product(a[..., half:, :half], across))
    side = -product(across, complement)
    upper = jnp.concatenate([corner - product(side, transpose(across)), side], axis=-1)
    return jnp.concatenate(
        [upper, jnp.concatenate([transpose(side), complement], axis=-1)], axis=-2
    )


def _with_slope(inverse: Callable[[Array], Array]) -> Callable[[Array], Array]:
    """Adds d(A^-1) = -A^-1 dA A^-1: the derivative of an elimination's steps takes JAX many times
    longer to compile.
    """
    differentiable = jax.custom_jvp(inverse)

    def slope(primals: tuple[Array], tangents: tuple[Array]) -> tuple[Array, Array]:
        inverted = differentiable(*primals)
        return inverted, -matmul(matmul(inverted, tangents[0]), inverted)

    differentiable.defjvp(slope)
    return differentiable


@_with_slope
def inverse_symmetric(a: Matrices) -> Matrices:
    """`inverse_positive` with a derivative that is a product: faster than `inverse`, slower to
    compile.
    """
    return inverse_positive(a)


@_with_slope
def inverse(a: Matrices) -> Matrices:
    """Inverse by Gauss and Jordan's sweep over the rows, in place, without pivoting; its derivative
    is a product.

    For matrices that are symmetric positive definite or, scaled by a positive vector, diagonally
    dominant by rows.
    """
    n = a.shape[-1]

    def sweep(j: Array, work: Array) -> Array:
        row = jax.lax.dynamic_index_in_dim(work, j, work.ndim - 2, keepdims=False)
        column = jax.lax.dynamic_index_in_dim(work, j, work.ndim - 1, keepdims=False)
        pivot = jax.lax.dynamic_index_in_dim(row, j, row.ndim - 1)
        return _swept(work, row, column, pivot, (jnp.arange(n) == j).astype(work.dtype))

    return jax.lax.fori_loop(0, n, sweep, a)


_BLOCK = 4


def solve_positive(a: Matrices, b: Float[Array, "*batch n m"]) -> Float[Array, "*batch n m"]:
    """Solve A x = b for a symmetric positive definite or diagonally dominant A.

    Blocked Gauss-Jordan elimination without pivoting. A loop over blocks rather than unrolled
    blocks: it runs as fast and compiles several times faster.
    """
    n = a.shape[-1]
    spare = -n % _BLOCK
    if spare:  # Filled up with an identity that nothing couples to.
        edge = [(0, 0)] * (a.ndim - 2)
        a = jnp.pad(a, [*edge, (0, spare), (0, spare)]) + jnp.diag(
            jnp.arange(n + spare) >= n
        ).astype(a.dtype)
        b = jnp.pad(b, [*edge, (0, spare), (0, 0)])
    axis = a.ndim - 2

    def eliminate(block: Array, work: Array) -> Array:
        start = block * _BLOCK
        rows = jax.lax.dynamic_slice_in_dim(work, start, _BLOCK, axis)
        columns = jax.lax.dynamic_slice_in_dim(work, start, _BLOCK, axis + 1)
        # The block's rows over its pivot block; then they are taken off all others.
        rows = product(
            _small_inverse(jax.lax.dynamic_slice_in_dim(rows, start, _BLOCK, axis + 1)), rows
        )
        return jax.lax.dynamic_update_slice_in_dim(work - product(columns, rows), rows, start, axis)

    work = jnp.concatenate([a, b], axis=-1)
    return jax.lax.fori_loop(0, (n + spare) // _BLOCK, eliminate, work)[..., :n, n + spare :]


def _small_inverse(a: Array) -> Array:
    """Inverse of a few rows by Gauss-Jordan elimination, one fused step a pivot."""
    identity = np.eye(a.shape[-1], dtype=a.dtype)
    for j in range(a.shape[-1]):
        a = _swept(a, a[..., j, :], a[..., :, j], a[..., j, j, None], identity[j])
    return a


def _swept(
    a: Array, row: Array, column: Array, pivot: Array, at_pivot: Array | np.ndarray
) -> Array:
    """A after Gauss and Jordan's step, in place, on the row and column of a pivot; ``at_pivot`` is
    1 at its number.
    """
    off_pivot = 1.0 - at_pivot
    row = (row * off_pivot + at_pivot) / pivot
    column_factor = at_pivot - column * off_pivot
    return a * (off_pivot[:, None] * off_pivot) + column_factor[..., :, None] * row[..., None, :]
