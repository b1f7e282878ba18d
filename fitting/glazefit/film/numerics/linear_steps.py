"""Steps of least squares side by side: a damped linear problem, solved in plain operations, and how
its damping changes.
"""

from typing import TypeAlias

import jax.numpy as jnp
from jaxtyping import Array, Float

from glazejax.radiative.common.linalg import matmul, solve_positive

# After a good step the next may be so many times as long, after one that failed a quarter: Gould,
# Orban, Sartenaer, Toint (2005), as optimistix has it.
LONGER = 3.5
SHORTER = 0.25

PerVariable: TypeAlias = Float[Array, "n m"]
"""A number for each unknown of each problem, in JAX."""
PerRow: TypeAlias = Float[Array, "n rows"]
"""A number for each residual of each problem."""
SlopeMatrices: TypeAlias = Float[Array, "n rows m"]
"""Slopes of each problem's residuals by its unknowns."""


def damped_solution(
    matrix: SlopeMatrices, target: PerRow, damping: Float[Array, "n"]
) -> PerVariable:
    """x of least |A x - b|^2 + damping |x|^2, side by side; in plain operations, for a few unknowns
    each.

    Modified Gram-Schmidt of A, the damping's rows and b together, as stable as Householder's QR.

    Source: A. Bjorck, BIT 7 (1967) 1.
    """
    count = matrix.shape[2]
    below = jnp.sqrt(damping)[:, None, None] * jnp.eye(count, count + 1, dtype=matrix.dtype)
    remainder = jnp.concatenate(
        [jnp.concatenate([matrix, target[..., None]], axis=2), below], axis=1
    )
    rows = []
    for _ in range(count):
        column = remainder[..., 0]
        remainder = remainder[..., 1:]
        norm = jnp.sqrt(jnp.sum(column**2, axis=1))
        unit = column / jnp.where(norm > 0, norm, 1.0)[:, None]
        row = jnp.sum(unit[..., None] * remainder, axis=1)
        remainder = remainder - unit[..., None] * row[:, None, :]
        rows.append((norm, row))
    # From the last unknown up; the last column of a row is what b has of its direction.
    solution: list[Array] = []
    for norm, row in reversed(rows):
        substituted = sum(
            (row[:, i] * value for i, value in enumerate(solution)), jnp.zeros_like(norm)
        )
        value = (row[:, -1] - substituted) / jnp.where(norm > 0, norm, 1.0)
        # A column of nothing says nothing of its unknown.
        solution = [value * (norm > 0).astype(value.dtype), *solution]
    return jnp.stack(solution, axis=1)


def normal_solution(
    matrix: SlopeMatrices, target: PerRow, damping: Float[Array, "n"]
) -> PerVariable:
    """Solve as `damped_solution`, for any number of unknowns: the normal equations, by elimination.

    They square the condition, so columns should be of like size and well apart, as those of a
    damped step are.
    """
    flipped = jnp.swapaxes(matrix, 1, 2)
    square = matmul(flipped, matrix) + damping[:, None, None] * jnp.eye(
        matrix.shape[2], dtype=matrix.dtype
    )
    return solve_positive(square, matmul(flipped, target[..., None]))[..., 0]
