"""Eigenvalues of small symmetric matrices by Jacobi's rotations: no LAPACK, small eigenvalues as
exact as large ones.

Batched LAPACK calls can hang in compiled programs (`linalg`). Rotations in pairs are plain
arithmetic: n/2 of them at once, n - 1 rounds bring every pair of rows together, and some eight such
sweeps are enough.
"""

import functools

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..common.linalg import Matrices

_on_diagonal = functools.partial(jnp.diagonal, axis1=-2, axis2=-1)


def symmetric_eigen(a: Matrices) -> tuple[Float[Array, "*batch n"], Matrices]:
    """Eigenvalues in ascending order and eigenvectors (columns) of symmetric matrices; without
    derivatives.

    Args:
        a: (..., n, n), symmetric. It need not be positive definite, nor scaled.

    Source: Golub and Van Loan, Matrix Computations, 8.5; rounds as in a tournament (Brent and Luk
    1985).
    """
    n = a.shape[-1]
    if n == 1:
        return a[..., 0], jnp.ones_like(a)
    spare = n % 2
    if spare:  # a row that nothing couples to
        edge = [(0, 0)] * (a.ndim - 2)
        a = jnp.pad(a, [*edge, (0, 1), (0, 1)])
    size = n + spare
    half = size // 2
    # Pairs are rows i and i + half: all of a round are turned at once.
    order = _next_round(half)
    vectors = jnp.broadcast_to(jnp.eye(size, dtype=a.dtype), a.shape)
    enough = float(np.finfo(a.dtype).eps)

    def one_round(_, state: tuple[Array, Array]) -> tuple[Array, Array]:
        work, vectors = state
        diagonal = _on_diagonal(work)
        top = diagonal[..., :half]
        bottom = diagonal[..., half:]
        # The angle that makes each pair's element off the diagonal zero, the smaller of the two.
        coupling = _on_diagonal(work[..., :half, half:])
        gap = bottom - top
        nothing = coupling == 0
        root = jnp.abs(gap) + jnp.hypot(gap, 2.0 * coupling)
        tangent = jnp.where(gap < 0, -2.0, 2.0) * coupling / jnp.where(nothing, 1.0, root)
        cosine = 1.0 / jnp.sqrt(1.0 + tangent * tangent)
        sine = cosine * tangent
        # Both sides of the matrix are turned, and the pairs change as in a tournament.
        work = _rotate(work, cosine, sine, -2)
        work = _rotate(work, cosine, sine, -1)
        vectors = _rotate(vectors, cosine, sine, -1)
        return work[..., order, :][..., :, order], vectors[..., :, order]

    def sweep(state):
        work, vectors, _, done = state
        work, vectors = jax.lax.fori_loop(0, size - 1, one_round, (work, vectors))
        diagonal = jnp.abs(_on_diagonal(work))
        # What is left off the diagonal counts relative to its own row and column.
        scale = jnp.sqrt(diagonal[..., :, None] * diagonal[..., None, :])
        off = jnp.abs(work) * (1.0 - np.eye(size))
        return work, vectors, jnp.max(off - enough * scale), done + 1

    def goes_on(state):
        # Five times as many sweeps as are ever needed.
        return (state[2] > 0) & (state[3] < 40)

    start = (a, vectors, jnp.asarray(jnp.inf, a.dtype), 0)
    work, vectors, _, _ = jax.lax.while_loop(goes_on, sweep, start)
    # The matrix is diagonal now.
    values: Array = _on_diagonal(work)
    if spare:  # the row that was added is the eigenvector with its own last component
        padding = jnp.abs(vectors[..., -1, :]) > 0.5
        values = jnp.where(padding, jnp.inf, values)
    # Ascending; the added row is the last.
    rank = jnp.argsort(values, axis=-1)[..., :n]
    return (
        jnp.take_along_axis(values, rank, axis=-1),
        jnp.take_along_axis(vectors[..., :n, :], rank[..., None, :], axis=-1),
    )


def _rotate(matrix: Array, cosine: Array, sine: Array, axis: int) -> Array:
    """Rows (or columns) of both halves turned into each other."""
    # Pairs lie along the axis: the angle of each is the same all across it.
    across = -1 if axis == -2 else -2
    cosine, sine = (jnp.expand_dims(x, across) for x in (cosine, sine))
    first, second = jnp.split(matrix, 2, axis=axis)
    return jnp.concatenate(
        [cosine * first - sine * second, sine * first + cosine * second], axis=axis
    )


def _next_round(half: int) -> np.ndarray:
    """Order in which each place takes its row, so that all pairs meet: the first stays, the others
    go round.
    """
    order = [0, half, *range(1, half - 1), *range(half + 1, 2 * half), half - 1]
    return np.array(order[: 2 * half])  # a single pair stays as it is
