"""Tiny least-squares problems in plain XLA operations: a linear solver for optimistix, and one loop
of our own.

lineax's own QR, SVD and Cholesky call LAPACK; two batched LAPACK calls in one compiled program can
hang for ever on the CPU (jaxlib 0.10, 0.11.0). A problem of two or three unknowns needs none of it.
"""

from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar

import jax
import jax.numpy as jnp
import lineax as lx
from jaxtyping import Array, Float, PyTree
from lineax.internal import pack_structures, ravel_vector, unravel_solution

from glazejax.radiative.common.linalg import matmul, solve_positive

State = TypeVar("State")


class FullRankSolver(lx.AbstractLinearSolver[State]):
    """What linear solvers of least-squares problems with as many independent columns as unknowns
    have in common.
    """

    def transpose(self, state: State, options: dict[str, Any]):
        """Not offered: the transposed problem is underdetermined."""
        raise NotImplementedError(
            f"{type(self).__name__} solves least-squares problems; it has no transpose"
        )

    def conj(self, state: State, options: dict[str, Any]) -> tuple[State, dict[str, Any]]:
        """State of the conjugate operator: the same, for real ones."""
        return state, options

    def assume_full_rank(self) -> bool:
        """Whether the solver relies on full column rank."""
        return True


class _Factors(NamedTuple):
    """Thin QR factors of an operator, or it and its normal matrix, and how its vectors
    are packed.
    """

    q: Float[Array, "rows columns"]
    r: Float[Array, "columns columns"]
    packed: Any


def orthogonalise(
    matrix: Float[Array, "rows columns"],
) -> tuple[Float[Array, "rows columns"], Float[Array, "columns columns"]]:
    """Thin QR factors by modified Gram-Schmidt, done twice, which leaves Q orthogonal to rounding.

    Args:
        matrix: (rows, columns) with rows >= columns; the loop over columns is unrolled. A column
            that depends on those before it gets a zero column in Q and a zero pivot in R.

    Source: Giraud, Langou, Rozloznik (2005), "twice is enough".
    """
    columns = matrix.shape[1]
    q = matrix
    r = jnp.eye(columns, dtype=matrix.dtype)
    for _ in range(2):
        basis = []
        step = jnp.zeros_like(r)
        for j in range(columns):
            column = q[:, j]
            for i, unit in enumerate(basis):
                share = unit @ column
                step = step.at[i, j].set(share)
                column = column - share * unit
            norm = jnp.sqrt(jnp.sum(column**2))
            step = step.at[j, j].set(norm)
            basis.append(column / jnp.where(norm > 0, norm, 1.0))
        q = jnp.stack(basis, axis=1)
        r = step @ r
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


class GramSchmidt(FullRankSolver[_Factors]):
    """Least-squares solver for tall or square operators of a few columns, without LAPACK.

    Unknowns that the operator does not determine come out as zero.

    Raises:
        ValueError: the operator has more unknowns than equations, or more than eight.
    """

    def init(self, operator: lx.AbstractLinearOperator, options: dict[str, Any]) -> _Factors:
        """Factorise."""
        del options
        rows = operator.out_size()
        columns = operator.in_size()
        if rows < columns or columns > 8:
            raise ValueError(
                f"GramSchmidt is for tall problems of up to 8 unknowns, not for {rows} x {columns}"
            )
        q, r = orthogonalise(operator.as_matrix())
        return _Factors(q, r, pack_structures(operator))

    def compute(
        self, state: _Factors, vector: PyTree[Array], options: dict[str, Any]
    ) -> tuple[PyTree[Array], lx.RESULTS, dict[str, Any]]:
        """Solve for one right-hand side."""
        del options
        solution = back_substitute(state.r, state.q.T @ ravel_vector(vector, state.packed))
        return unravel_solution(solution, state.packed), lx.RESULTS.successful, {}


class NormalEquations(FullRankSolver[_Factors]):
    """Least-squares solver for any number of columns, without LAPACK: the normal equations, by
    elimination.

    They square the condition, so columns should be of like size and well apart, as those of a
    damped step are.
    """

    def init(self, operator: lx.AbstractLinearOperator, options: dict[str, Any]) -> _Factors:
        """Multiply."""
        del options
        matrix = operator.as_matrix()
        return _Factors(matrix, matmul(matrix.T, matrix), pack_structures(operator))

    def compute(
        self, state: _Factors, vector: PyTree[Array], options: dict[str, Any]
    ) -> tuple[PyTree[Array], lx.RESULTS, dict[str, Any]]:
        """Solve for one right-hand side."""
        del options
        right = matmul(ravel_vector(vector, state.packed), state.q)
        solution = solve_positive(state.r, right[:, None])[:, 0]
        return unravel_solution(solution, state.packed), lx.RESULTS.successful, {}


def inverse_small(matrix: Float[Array, "n n"]) -> tuple[Float[Array, "n n"], Float[Array, ""]]:
    """Inverse and log determinant of a positive definite matrix of up to three rows, by Cholesky
    factors.
    """
    n = matrix.shape[-1]
    lower = [[jnp.zeros_like(matrix[0, 0])] * n for _ in range(n)]
    for i in range(n):
        for j in range(i + 1):
            rest = matrix[i, j] - sum(lower[i][p] * lower[j][p] for p in range(j))
            lower[i][j] = jnp.sqrt(jnp.maximum(rest, 1e-12)) if i == j else rest / lower[j][j]
    unit = []
    for column in range(n):
        x: list[Array] = []
        for i in range(n):
            x.append(
                ((1.0 if i == column else 0.0) - sum(lower[i][p] * x[p] for p in range(i)))
                / lower[i][i]
            )
        unit.append(jnp.stack([jnp.asarray(v) for v in x]))
    inverse = jnp.stack(unit, axis=1)
    return inverse.T @ inverse, 2.0 * sum(
        (jnp.log(lower[i][i]) for i in range(n)), jnp.zeros((), matrix.dtype)
    )


Seen = tuple[Float[Array, ""], Float[Array, "n"], Float[Array, "n n"], Any]
"""Cost, its gradient, a positive definite matrix near its Hessian, and whatever else a caller wants
back.
"""


def damped_newton(
    look: Callable[[Float[Array, "n"]], Seen],
    start: Float[Array, "n"],
    limits: tuple[float, float],
    *,
    steps: int | Array,
    longest: float,
) -> tuple[Float[Array, "n"], Seen]:
    """A fixed number of Newton steps with Levenberg's damping: the best point, and what is seen
    there.

    For very many candidates side by side, with slopes that their model knows in closed form.
    Optimistix, which finds them by differentiation and steps until the last candidate of a batch
    has settled, takes twice the time for identification (6.9 s of CPU for 3.2 s, 100 spectra among
    pairs of 24 paints).

    Args:
        look: at a point.
        start: first point.
        limits: every unknown stays between these.
        steps: how many.
        longest: step of one unknown.
    """

    def step(_: int | Array, state: tuple) -> tuple:
        here, seen, damping = state
        _, gradient, hessian, _ = seen
        damped = hessian + damping * (
            jnp.diag(jnp.diagonal(hessian)) + 1e-6 * jnp.eye(here.shape[0], dtype=here.dtype)
        )
        move = jnp.clip(-inverse_small(damped)[0] @ gradient, -longest, longest)
        tried = jnp.clip(here + move, *limits)
        new = look(tried)
        better = new[0] < seen[0]
        kept = jax.tree.map(lambda a, b: jnp.where(better, a, b), (tried, new), (here, seen))
        return (*kept, jnp.where(better, damping * 0.2, jnp.maximum(damping, 1e-3) * 6.0))

    # The first round looks at the start itself: `look` stands in the program once, which compiles
    # in half the time.
    shapes = jax.eval_shape(look, start)
    nothing = jax.tree.map(lambda a: jnp.zeros(a.shape, a.dtype), shapes)
    unseen = (
        jnp.full_like(nothing[0], jnp.inf),
        nothing[1],
        jnp.eye(start.shape[0], dtype=start.dtype),
        nothing[3],
    )
    there, seen, _ = jax.lax.fori_loop(
        0, steps + 1, step, (start, unseen, jnp.asarray(0.1, start.dtype))
    )
    return there, seen


def root_of_log1p(root: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """Square root of log(1 + x^2), smooth through x = 0: a log-determinant as a residual."""
    square = root**2
    small = square < 1e-6
    safe = jnp.where(small, 1.0, square)
    return root * jnp.where(small, 1.0 - square / 4.0, jnp.sqrt(jnp.log1p(safe) / safe))
