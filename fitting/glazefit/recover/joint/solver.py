"""The linear step of a joint recovery: thousands of unknowns, solved by their structure.

Readings at one band know the coefficients of that band and the shared numbers; curvature ties a
coefficient to its like one and two bands on, a step to the next. Ordered by bands, the normal
equations are a band matrix with a border of shared unknowns, so a step costs bands x paints^3, not
(bands x paints)^3.

Columns of the Jacobian are found by differentiating along unit steps of all bands at once, and of
all films at once: a reading moves with its own only. That is one compiled program; LAPACK's band
matrices do the rest, where a compiled solver takes half a minute to compile for every new number of
films.
"""

from collections.abc import Callable
from typing import NamedTuple, TypeAlias

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float
from scipy.linalg import get_lapack_funcs

from ...film.numerics.least_squares import Descent, Surroundings, descend
from .problem import JointProblem, JointResiduals, Unknowns, residuals

Vectors: TypeAlias = Float[np.ndarray, "unknowns *columns"]
"""Numbers of all unknowns in a row, or several such columns."""

_factorise_band, _solve_band = get_lapack_funcs(("pbtrf", "tbtrs"), dtype=np.float64)


class Normal(NamedTuple):
    """Normal matrix of a joint problem: a block for each band, ties between bands, and a border."""

    inner: Float[Array, "bands local local"]
    ties: Float[Array, "3 bands local"]  # of an unknown to its like, none, one and two bands on
    border: Float[Array, "bands local shared"]
    corner: Float[Array, "shared shared"]


class Factors(NamedTuple):
    """Cholesky factor of `Normal`, [L 0; border^T corner^-1]."""

    bands: Float[np.ndarray, "diagonals numbers"]  # L, a row for each diagonal, as LAPACK has it
    border: Float[np.ndarray, "numbers shared"]
    corner: Float[np.ndarray, "shared shared"]


@jax.jit
def look(problem: JointProblem, point: Unknowns) -> Surroundings:
    """Cost, its gradient, and the normal matrix at a point."""
    values, along = jax.linearize(lambda y: residuals(y, problem), point)
    (gradient,) = jax.linear_transpose(along, point)(values)
    cost = 0.5 * sum(jnp.sum(block**2) for block in values)
    return Surroundings(
        jnp.asarray(cost), ravel_pytree(gradient)[0], normal_matrix(along, point, problem)
    )


def solve_jointly(
    problem: JointProblem,
    start: Unknowns,
    first_step: float,
    max_steps: int,
    note: Callable[[int], object],
) -> tuple[Unknowns, Descent]:
    """Levenberg and Marquardt's least squares from a start: the end, and how it was reached.

    Args:
        problem: see `residuals`.
        start: first point.
        first_step: one over the damping of the first step.
        max_steps: that are tried.
        note: see `descend`.
    """
    descent = descend(
        lambda flat: jax.tree.map(np.asarray, look(problem, unflatten(flat, start))),
        lambda normal, damping, gradient: solve(factorise(normal, damping), gradient),
        np.concatenate([np.ravel(block) for block in start]),
        first_step=first_step,
        max_steps=max_steps,
        # A thousandth of a coefficient.
        tolerance=1e-3,
        note=note,
    )
    return unflatten(descent.point, start), descent


def normal_matrix(
    along: Callable[[Unknowns], JointResiduals], point: Unknowns, problem: JointProblem
) -> Normal:
    """Normal matrix from the residuals' derivative along a step."""
    zero = jax.tree.map(jnp.zeros_like, point)
    bands, local = zero.bands.shape
    films, per_film = zero.films.shape
    paints = zero.paints.size

    every_band = jnp.broadcast_to(jnp.eye(local)[:, None], (local, bands, local))
    every_film = jnp.broadcast_to(jnp.eye(per_film)[:, None], (per_film, films, per_film))
    by_band = jax.vmap(lambda step: along(zero._replace(bands=step)))(every_band)
    by_film = jax.vmap(lambda step: along(zero._replace(films=step)))(every_film)
    # Paints' gloss and the others move all readings.
    by_rest = jax.vmap(
        lambda step: along(zero._replace(paints=step[:paints], others=step[paints:]))
    )(jnp.eye(paints + zero.others.size))
    # Rows of readings: (local, bands, films, 2) and so on.
    inner = jnp.einsum("ibfc,jbfc->bij", by_band.data, by_band.data) + jnp.einsum(
        "ibl,jbl->bij", by_band.pull, by_band.pull
    )
    to_films = jnp.einsum("ibfc,ebfc->bife", by_band.data, by_film.data)
    to_rest = jnp.einsum("ibfc,pbfc->bip", by_band.data, by_rest.data)
    film_blocks = jnp.einsum("dbfc,ebfc->fde", by_film.data, by_film.data) + jnp.einsum(
        "dfl,efl->fde", by_film.films, by_film.films
    )
    between = jnp.einsum("ebfc,pbfc->fep", by_film.data, by_rest.data).reshape(films * per_film, -1)
    shared_block = (
        jnp.einsum("pbfc,qbfc->pq", by_rest.data, by_rest.data)
        + by_rest.paints @ by_rest.paints.T
        + by_rest.others @ by_rest.others.T
    )
    # Of curvature, whose rows reach over three bands, and of steps. What would tie the last bands
    # to further ones is not read.
    curved = [
        jnp.sum(problem.curvature * jnp.roll(problem.curvature, -n, axis=1), axis=0)
        for n in range(3)
    ]
    after = jnp.pad(problem.steepness**2, ((0, 1), (0, 0)))
    steps = [after + jnp.roll(after, 1, axis=0), -after, jnp.zeros_like(after)]
    return Normal(
        inner=inner,
        ties=jnp.stack(curved)[..., None] * problem.stiffness**2 + jnp.stack(steps),
        border=jnp.concatenate(
            [to_films.reshape(bands, local, films * per_film), to_rest], axis=-1
        ),
        corner=jnp.block(
            [[jax.scipy.linalg.block_diag(*film_blocks), between], [between.T, shared_block]]
        ),
    )


def factorise(normal: Normal, damping: float = 0.0) -> Factors:
    """Cholesky factorisation of the bands, then of the shared corner.

    Raises:
        numpy.linalg.LinAlgError: the matrix is not positive definite.
    """
    bands, local, shared = normal.border.shape
    diagonals = np.zeros((2 * local + 1, bands, local))
    for below in range(local):
        diagonals[below, :, : local - below] = np.diagonal(normal.inner, -below, 1, 2)
    diagonals[::local] += normal.ties
    diagonals[0] += damping
    factor, failed = _factorise_band(diagonals.reshape(len(diagonals), -1), lower=1)
    if failed:
        raise np.linalg.LinAlgError
    border, _ = _solve_band(factor, np.reshape(normal.border, (-1, shared)), uplo="L")
    corner = normal.corner + damping * np.eye(shared) - border.T @ border
    return Factors(factor, border, np.linalg.inv(np.linalg.cholesky(corner)))


def solve(factors: Factors, vectors: Vectors) -> Vectors:
    """Solve the normal equations, for several right-hand sides at once where there are columns."""
    return unwhiten(factors, whiten(factors, vectors))


def whiten(factors: Factors, vectors: Vectors) -> Vectors:
    """Solve with the factor."""
    count = len(factors.border)
    bands, _ = _solve_band(factors.bands, vectors[:count], uplo="L")
    return np.concatenate([bands, factors.corner @ (vectors[count:] - factors.border.T @ bands)])


def unwhiten(factors: Factors, vectors: Vectors) -> Vectors:
    """Solve with the transposed factor: of independent standard normal numbers it makes ones whose
    covariance is the inverse normal matrix.
    """
    count = len(factors.border)
    shared = factors.corner.T @ vectors[count:]
    target = vectors[:count] - factors.border @ shared
    bands, _ = _solve_band(factors.bands, target, uplo="L", trans="T")
    return np.concatenate([bands, shared])


def unflatten(flat: Float[np.ndarray, "*n unknowns"], like: Unknowns) -> Unknowns:
    """Unknowns of the shapes of some others, with the leading axes of their numbers in a row."""
    ends = np.cumsum([block.size for block in like])
    blocks = np.split(flat, ends[:-1], axis=-1)
    shaped = (
        piece.reshape(*flat.shape[:-1], *block.shape)
        for piece, block in zip(blocks, like, strict=True)
    )
    return Unknowns(*shaped)
