"""Tiny linear least-squares problems for optimistix, in plain XLA operations.

lineax's own QR, SVD and Cholesky call LAPACK; two batched LAPACK calls in one compiled program can hang for ever
on the CPU (jaxlib 0.10, 0.11.0). A problem of two or three unknowns needs none of it.
"""

import math
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import lineax as lx
from jaxtyping import Array, Float, PyTree


class _Factors(NamedTuple):
    """Thin QR factors of an operator (of its transpose if `wide`), and the structures to unpack into."""

    q: Float[Array, "rows columns"]
    r: Float[Array, "columns columns"]
    operator: lx.AbstractLinearOperator


def orthogonalise(
    matrix: Float[Array, "rows columns"],
) -> tuple[Float[Array, "rows columns"], Float[Array, "columns columns"]]:
    """Thin QR factors by modified Gram-Schmidt, done twice, which leaves Q orthogonal to rounding.

    Args:
        matrix: (rows, columns) with rows >= columns; the loop over columns is unrolled. A column that depends on
            those before it gets a zero column in Q and a zero pivot in R.

    Source: Giraud, Langou, Rozloznik (2005), "twice is enough".
    """
    columns = matrix.shape[1]
    q, r = matrix, jnp.eye(columns, dtype=matrix.dtype)
    for _ in range(2):
        basis, step = [], jnp.zeros_like(r)
        for j in range(columns):
            column = q[:, j]
            for i, unit in enumerate(basis):
                share = unit @ column
                step = step.at[i, j].set(share)
                column = column - share * unit
            norm = jnp.sqrt(jnp.sum(column**2))
            step = step.at[j, j].set(norm)
            basis.append(column / jnp.where(norm > 0, norm, 1.0))
        q, r = jnp.stack(basis, axis=1), step @ r
    return q, r


def back_substitute(r: Float[Array, "n n"], b: Float[Array, "n"]) -> Float[Array, "n"]:
    """Solve R x = b for an upper triangular R; unknowns of zero pivots are set to zero."""
    n = b.shape[0]
    x = jnp.zeros_like(b)
    for j in reversed(range(n)):
        pivot = r[j, j]
        value = (b[j] - r[j] @ x) / jnp.where(pivot == 0, 1.0, pivot)
        x = x.at[j].set(jnp.where(pivot == 0, 0.0, value))
    return x


class GramSchmidt(lx.AbstractLinearSolver[_Factors]):
    """Least-squares solver for tall or square operators of a few columns, without LAPACK.

    Unknowns that the operator does not determine come out as zero.

    Raises:
        ValueError: the operator has more unknowns than equations, or more than eight.
    """

    def init(self, operator: lx.AbstractLinearOperator, options: dict[str, Any]) -> _Factors:
        """Factorise."""
        del options
        rows, columns = operator.out_size(), operator.in_size()
        if rows < columns or columns > 8:
            raise ValueError(f"GramSchmidt is for tall problems of up to 8 unknowns, not for {rows} x {columns}")
        q, r = orthogonalise(operator.as_matrix())
        return _Factors(q, r, operator)

    def compute(
        self, state: _Factors, vector: PyTree[Array], options: dict[str, Any]
    ) -> tuple[PyTree[Array], lx.RESULTS, dict[str, Any]]:
        """Solve for one right-hand side."""
        del options
        flat = jnp.concatenate([leaf.reshape(-1) for leaf in jax.tree.leaves(vector)])
        solution = back_substitute(state.r, state.q.T @ flat)
        return _unflatten(solution, state.operator.in_structure()), lx.RESULTS.successful, {}

    def transpose(self, state: _Factors, options: dict[str, Any]):
        """Not offered: the transposed problem is underdetermined."""
        raise NotImplementedError("GramSchmidt solves least-squares problems; it has no transpose")

    def conj(self, state: _Factors, options: dict[str, Any]) -> tuple[_Factors, dict[str, Any]]:
        """Factors of the conjugate operator: the same, for real ones."""
        return state, options

    def assume_full_rank(self) -> bool:
        """Whether the solver relies on full column rank."""
        return True


def _unflatten(flat: Float[Array, "n"], structure: PyTree[jax.ShapeDtypeStruct]) -> PyTree[Array]:
    leaves, treedef = jax.tree.flatten(structure)
    out, start = [], 0
    for leaf in leaves:
        size = math.prod(leaf.shape)
        out.append(flat[start : start + size].reshape(leaf.shape))
        start += size
    return jax.tree.unflatten(treedef, out)
