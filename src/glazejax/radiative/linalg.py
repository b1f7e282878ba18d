"""Small dense algebra in plain XLA operations, for matrices that need no pivoting.

No LAPACK: two batched LAPACK calls in one compiled program can hang for ever on the CPU (jaxlib 0.10, 0.11.0),
and at these sizes (up to some 40 rows) blocked elimination by matrix products is faster anyway.
"""

import jax.numpy as jnp
from jaxtyping import Array, Float

_BLOCK = 4


def solve_positive(a: Float[Array, "*batch n n"], b: Float[Array, "*batch n m"]) -> Float[Array, "*batch n m"]:
    """Solve A x = b for a symmetric positive definite A (or one that a diagonal scaling makes so).

    Blocked Gauss-Jordan elimination without pivoting.
    """
    n = a.shape[-1]
    work = jnp.concatenate([a, b], axis=-1)
    for start in range(0, n, _BLOCK):
        block = slice(start, min(start + _BLOCK, n))
        # Columns to the left of the block are finished: they hold the identity and are not carried along.
        rows = work[..., block, :]
        width = rows.shape[-2]
        for j in range(width):
            pivot_row = rows[..., j, :] / rows[..., j, j, None]
            column = rows[..., :, j]
            updated = rows - column[..., :, None] * pivot_row[..., None, :]
            rows = updated.at[..., j, :].set(pivot_row)
        reduced = work - work[..., :, :width] @ rows
        work = reduced.at[..., block, :].set(rows)[..., width:]
    return work
