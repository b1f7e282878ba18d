"""The linear step of a joint recovery: thousands of unknowns, solved by their structure.

Readings at one band know the coefficients of that band and the shared numbers; curvature ties a
coefficient to its like one and two bands on, a step to the next. Ordered by bands, the normal
equations are a band matrix with a border of shared unknowns, so a step costs bands x paints^3, not
(bands x paints)^3.

Columns of the Jacobian are found by differentiating along unit steps of all bands at once, and of
all films at once: a reading moves with its own only. That is one compiled program; LAPACK's band
matrices do the rest, where a compiled solver takes half a minute to compile for every new number of
films.

The covariance that a fit leaves in k and s of all paints at all wavelengths is known by the same
factors. The whole of it, of thousands of coefficients, is never formed. Draws from it would do too,
but a few hundred say a small paint's errors no better than to a fifth.
"""

import functools
from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeAlias

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float
from scipy.linalg import cholesky_banded, get_lapack_funcs

from ...film.model.errors import principal_modes
from ...film.numerics.least_squares import Descent, Surroundings, descend
from ...film.numerics.weighted import variance_along
from .problem import JointProblem, JointResiduals, Unknowns, residuals, totals

Vectors: TypeAlias = Float[np.ndarray, "unknowns *columns"]
"""Numbers of all unknowns in a row, or several such columns."""

(_solve_band,) = get_lapack_funcs(("tbtrs",), dtype=np.float64)


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
    cost = 0.5 * sum(jnp.sum(block**2) for block in jax.tree.leaves(values))
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


@jax.jit
def _log_density(
    problem: JointProblem, point: Unknowns, slope: Unknowns, step: Float[Array, ""]
) -> Float[Array, ""]:
    """Log posterior density up to a constant, a step from a point along a slope."""
    moved = jax.tree.map(lambda start, by_step: start + step * by_step, point, slope)
    values = residuals(moved, problem)
    return jnp.asarray(-0.5 * sum(jnp.sum(block**2) for block in jax.tree.leaves(values)))


def normal_matrix(
    along: Callable[[Unknowns], JointResiduals], point: Unknowns, problem: JointProblem
) -> Normal:
    """Normal matrix from the residuals' derivative along a step."""
    zero = jax.tree.map(jnp.zeros_like, point)
    bands, local = zero.bands.shape
    films, per_film = zero.films.shape
    paints = zero.paints.size

    # Of readings, along one unknown of all bands and of all films at once: (local, bands, films, 2)
    # and so on.
    by_band = jax.vmap(lambda unit: along(zero._replace(bands=zero.bands + unit)).data)(
        jnp.eye(local)
    )
    by_film = jax.vmap(lambda unit: along(zero._replace(films=zero.films + unit)).data)(
        jnp.eye(per_film)
    )
    # Paints' gloss and the others move all readings.
    by_rest = jax.vmap(
        lambda step: along(zero._replace(paints=step[:paints], others=step[paints:])).data
    )(jnp.eye(paints + zero.others.size))
    # In a prior each unknown has a row of its own.
    prior = along(jax.tree.map(jnp.ones_like, point)).prior
    inner = jnp.einsum("ibfc,jbfc->bij", by_band, by_band)
    to_films = jnp.einsum("ibfc,ebfc->bife", by_band, by_film)
    to_rest = jnp.einsum("ibfc,pbfc->bip", by_band, by_rest)
    film_blocks = jnp.einsum("dbfc,ebfc->fde", by_film, by_film)
    between = jnp.einsum("ebfc,pbfc->fep", by_film, by_rest).reshape(films * per_film, -1)
    rest = jnp.einsum("pbfc,qbfc->pq", by_rest, by_rest)
    corner = jnp.block([[jax.scipy.linalg.block_diag(*film_blocks), between], [between.T, rest]])
    shared_prior, _ = ravel_pytree(prior[1:])
    # Of curvature, whose rows reach over three bands, and of steps. What would tie the last bands
    # to further ones is not read.
    curved = [
        jnp.sum(problem.curvature * jnp.roll(problem.curvature, -n, axis=1), axis=0)
        for n in range(3)
    ]
    after = jnp.pad(problem.steepness**2, ((0, 1), (0, 0)))
    steps = [after + jnp.roll(after, 1, axis=0), -after, jnp.zeros_like(after)]
    return Normal(
        inner=inner + prior.bands[..., None] ** 2 * jnp.eye(local),
        ties=jnp.stack(curved)[..., None] * problem.stiffness**2 + jnp.stack(steps),
        border=jnp.concatenate(
            [to_films.reshape(bands, local, films * per_film), to_rest], axis=-1
        ),
        corner=corner + jnp.diag(shared_prior**2),
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
    factor = cholesky_banded(diagonals.reshape(len(diagonals), -1), lower=True, check_finite=False)
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


class JointCovariance(NamedTuple):
    """Laplace's covariance of all unknowns as they are (`totals`).

    Attributes:
        factors: of the normal matrix, of the deviations.
        modes: how what all bands share moves all unknowns in addition.
        others: number of the unknowns' `others`, which are the last.
    """

    factors: Factors
    modes: Float[np.ndarray, "shared unknowns"]
    others: int

    @classmethod
    def of(cls, problem: JointProblem, factors: Factors) -> "JointCovariance":
        """At the solution of a problem."""
        count, shared = factors.border.shape
        films, per_film = problem.scale.films.shape
        thickness = problem.thickness_modes
        modes = np.zeros((shared, count + shared))
        first = shared - len(thickness)
        modes[first:, :count] = np.reshape(problem.band_modes, (len(thickness), count))
        modes[first:, count : count + films * per_film : per_film] = thickness
        return cls(factors, modes, len(thickness))

    @property
    def of_shared(self) -> Float[np.ndarray, "shared shared"]:
        """Covariance of what all bands share."""
        count, shared = self.factors.border.shape
        root = self.factors.corner @ (np.eye(shared) + self.modes[:, count:])
        return root.T @ root

    def of_bands(self, bands: int) -> Float[np.ndarray, "bands local local"]:
        """Covariance of each band's unknowns."""
        diagonals, border, corner = self.factors
        local = len(border) // bands
        blocks = []
        for first in range(0, len(border), local):
            # Columns of the inverse factor are nought at the bands before.
            rest = Factors(diagonals[:, first:], border[first:], corner)
            here = np.eye(len(rest.border), local)
            white = whiten(rest, np.concatenate([here, self.modes[:, first : first + local]]))
            blocks.append(white.T @ white)
        return np.stack(blocks)

    def times(
        self, vectors: Float[np.ndarray, "unknowns columns"]
    ) -> Float[np.ndarray, "unknowns columns"]:
        """The covariance times some vectors, which may be none."""
        # Of no columns LAPACK's wrapper writes where it must not (scipy 1.17).
        if not vectors.shape[1]:
            return vectors
        count = len(self.factors.border)
        shared = vectors[count:] + self.modes @ vectors
        solved = solve(self.factors, np.concatenate([vectors[:count], shared]))
        return solved + self.modes.T @ solved[count:]

    def regress(
        self, numbers: Sequence[int]
    ) -> tuple[Float[np.ndarray, "known numbers"], Float[np.ndarray, "known numbers"]]:
        """Slopes of the bands' unknowns by some of the `others`, and their covariance with them."""
        size = self.modes.shape[1]
        rows = size - self.others + np.array(numbers, dtype=int)
        columns = self.times(np.equal.outer(np.arange(size), rows).astype(float))
        across = columns[: len(self.factors.border)].T
        return np.linalg.inv(columns[rows]) @ across, across

    def draw(self, best: Unknowns, count: int) -> Unknowns:
        """Draws about the solution, each with a leading axis of draws."""
        rng = np.random.default_rng(0)
        bands, shared = self.factors.border.shape
        noise = [rng.standard_normal((numbers, count)) for numbers in (shared, bands)]
        off = unwhiten(self.factors, np.concatenate(noise[::-1]))
        off = off + self.modes.T @ off[bands:]
        return jax.tree.map(np.add, best, unflatten(off.T, best))

    def largest(
        self, size: Float[np.ndarray, "*shape"], count: int, known: Sequence[int] = ()
    ) -> Float[np.ndarray, "modes *shape"]:
        """The largest modes of the coefficients' errors (`principal_modes`), largest first, by
        subspace iteration.

        Args:
            size: factor of each coefficient's error, (bands, local), 0 for those that do not
                matter.
            count: of the modes; there are no more than coefficients.
            known: numbers of the `others` whose values are taken as known.
        """
        slopes, across = self.regress(known)
        scale = size.reshape(-1, 1)

        def times(basis: Float[np.ndarray, "numbers columns"]) -> np.ndarray:
            scaled = basis * scale
            wide = np.pad(scaled, ((0, len(self.modes)), (0, 0)))
            return (self.times(wide)[: len(basis)] - slopes.T @ (across @ scaled)) * scale

        # With so many vectors more than are wanted, and the covariance applied so often, the last
        # modes are good to some per cent.
        columns = min(count + 16, size.size)
        basis = np.random.default_rng(0).standard_normal((size.size, columns))
        for _ in range(8):
            basis, _ = np.linalg.qr(times(basis))
        modes = principal_modes(basis.T @ times(basis))[-count:] @ basis.T
        return modes[::-1].reshape(-1, *size.shape)


def thickness_variances(
    problem: JointProblem, unknowns: Unknowns, covariance: JointCovariance
) -> Float[np.ndarray, "films"]:
    """Variance of each film's log thickness at a solution: Laplace's, or that by the density where
    readings leave much of what was expected open.
    """
    films, per_film = problem.scale.films.shape
    variances = np.diagonal(covariance.of_shared)[: films * per_film : per_film].copy()
    # Where a tenth is left open the density along the thickness is a Gaussian.
    much_open = np.flatnonzero(variances > 0.1 * problem.scale.films[:, 0] ** 2)
    flat = np.concatenate([np.ravel(block) for block in unknowns])
    rows = problem.mean.bands.size + per_film * much_open
    columns = covariance.times(np.equal.outer(np.arange(flat.size), rows).astype(float))
    best = totals(unknowns, problem, sign=-1.0)
    for film, column in zip(much_open, columns.T, strict=True):
        # All else as is expected of a film whose log thickness is larger by 1.
        moved = unflatten(flat + column / variances[film], unknowns)
        slope = jax.tree.map(np.subtract, totals(moved, problem, sign=-1.0), best)
        variances[film] = variance_along(
            functools.partial(_log_density, problem, best, slope), variances[film]
        )
    return variances
