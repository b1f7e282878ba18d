"""The linear step of a joint recovery: thousands of unknowns, solved by their structure.

Readings at one band know the coefficients of that band and the shared numbers; curvature ties a band to its two
neighbours on either side. Ordered by bands, two bands a block, the normal equations are block tridiagonal with a border
of shared unknowns, so a step costs bands x paints^3, not (bands x paints)^3.

Columns of the Jacobian are found by differentiating along unit steps of all bands at once, and of all films at once: a
reading moves with its own only.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import lineax as lx
from jax.scipy.linalg import cho_solve, solve_triangular
from jaxtyping import Array, Float, PyTree

from ..film.least_squares import FullRankSolver
from .joint_problem import JointResiduals, Unknowns


class Normal(NamedTuple):
    """Normal matrix of a joint problem: block tridiagonal in pairs of bands, with a border."""

    diagonal: Float[Array, "pairs n n"]
    lower: Float[Array, "pairs n n"]  # coupling of a pair to the one before; the first is not used
    border: Float[Array, "pairs n shared"]
    corner: Float[Array, "shared shared"]


class Factors(NamedTuple):
    """Cholesky factors of `Normal`."""

    roots: Float[Array, "pairs n n"]
    below: Float[Array, "pairs n n"]  # off-diagonal blocks of the factor
    border: Float[Array, "pairs n shared"]
    corner: Float[Array, "shared shared"]


class JointSteps(FullRankSolver[Any]):
    """lineax solver for the damped least-squares operator of `joint_problem.residuals`.

    Not for vmap: it factorises with LAPACK, one matrix at a time.
    """

    curvature: Float[Array, "bands bands"]  # inner product of the curvature rows
    stiffness: Float[Array, "2*paints"]

    def init(self, operator: lx.AbstractLinearOperator, options: dict[str, Any]) -> Any:
        """Build and factorise the normal matrix."""
        del options
        normal = normal_matrix(operator, self.curvature, self.stiffness)
        return factorise(normal), operator

    def compute(
        self, state: Any, vector: PyTree[Array], options: dict[str, Any]
    ) -> tuple[PyTree[Array], lx.RESULTS, dict[str, Any]]:
        """Least-squares solution for one right-hand side."""
        del options
        factors, operator = state
        (gradient,) = jax.linear_transpose(operator.mv, operator.in_structure())(vector)
        return solve(factors, gradient), lx.RESULTS.successful, {}


def normal_matrix(
    operator: lx.AbstractLinearOperator,
    curvature: Float[Array, "bands bands"],
    stiffness: Float[Array, "2*paints"],
) -> Normal:
    """Normal matrix from an operator whose output is `JointResiduals`, or that and the damping's own part."""
    zero = jax.tree.map(lambda leaf: jnp.zeros(leaf.shape, leaf.dtype), operator.in_structure())
    bands, local = zero.bands.shape
    films, each = zero.films.shape
    paints = zero.paints.size

    def along(step: Unknowns) -> tuple[JointResiduals, Unknowns]:
        out: Any = operator.mv(step)
        return (out, zero) if isinstance(out, JointResiduals) else out

    def columns(name: str, steps: Float[Array, "columns ..."]) -> tuple[JointResiduals, Unknowns]:
        return jax.vmap(lambda step: along(zero._replace(**{name: step})))(steps)

    every_band = jnp.broadcast_to(jnp.eye(local)[:, None], (local, bands, local))
    every_film = jnp.broadcast_to(jnp.eye(each)[:, None], (each, films, each))
    by_band, damped = columns("bands", every_band)
    by_film, damped_films = columns("films", every_film)
    by_paint, damped_paints = columns("paints", jnp.eye(paints).reshape(paints, *zero.paints.shape))
    by_paint_data, alone = by_paint.data, _squares(by_paint.paints) + _squares(damped_paints.paints)
    if zero.others.size:
        # Dense as the paints' are, so they go with them.
        by_other, damped_others = columns("others", jnp.eye(zero.others.size))
        by_paint_data = jnp.concatenate([by_paint_data, by_other.data])
        alone = jnp.concatenate([alone, _squares(by_other.others) + _squares(damped_others.others)])
    paints = len(alone)
    # Rows of readings: (local, bands, films, 2) and so on.
    inner = jnp.einsum("ibfc,jbfc->bij", by_band.data, by_band.data)
    pulls = jnp.einsum("ibi->bi", by_band.pull) ** 2 + jnp.einsum("ibi->bi", damped.bands) ** 2
    inner = inner + jax.vmap(jnp.diag)(pulls)

    to_films = jnp.einsum("ibfc,ebfc->bife", by_band.data, by_film.data).reshape(bands, local, films * each)
    to_paints = jnp.einsum("ibfc,pbfc->bip", by_band.data, by_paint_data)
    own = jnp.einsum("dbfc,ebfc->fde", by_film.data, by_film.data)
    expected = jnp.einsum("efe->fe", by_film.films) ** 2 + jnp.einsum("efe->fe", damped_films.films) ** 2
    own = own + jax.vmap(jnp.diag)(expected)
    between = jnp.einsum("ebfc,pbfc->fep", by_film.data, by_paint_data).reshape(films * each, paints)
    gloss = jnp.einsum("pbfc,qbfc->pq", by_paint_data, by_paint_data) + jnp.diag(alone)
    corner = jnp.block([[jax.scipy.linalg.block_diag(*own), between], [between.T, gloss]])
    return _paired(inner, jnp.concatenate([to_films, to_paints], axis=-1), corner, curvature, stiffness)


def _squares(columns: Float[Array, "n *each"]) -> Float[Array, "n"]:
    """Squares of the diagonal of as many columns as unknowns."""
    return jnp.diagonal(columns.reshape(len(columns), -1)) ** 2


def _paired(
    inner: Float[Array, "bands m m"],
    border: Float[Array, "bands m shared"],
    corner: Float[Array, "shared shared"],
    curvature: Float[Array, "bands bands"],
    stiffness: Float[Array, "m"],
) -> Normal:
    """Blocks of two bands, with the coupling by curvature; an odd band gets an empty partner."""
    bands, m = inner.shape[:2]
    pairs = -(-bands // 2)
    spare = 2 * pairs - bands
    inner = jnp.concatenate([inner, jnp.broadcast_to(jnp.eye(m), (spare, m, m))])
    border = jnp.pad(border, ((0, spare), (0, 0), (0, 0)))
    ties = jnp.pad(curvature, ((0, spare), (0, spare))).reshape(pairs, 2, pairs, 2)
    stiff = jnp.diag(stiffness**2)
    here = jnp.arange(pairs)
    before = jnp.maximum(here - 1, 0)
    diagonal = jnp.einsum("pab,ij->paibj", ties[here, :, here, :], stiff)
    diagonal = diagonal.at[:, 0, :, 0, :].add(inner[0::2]).at[:, 1, :, 1, :].add(inner[1::2])
    lower = jnp.einsum("pab,ij->paibj", ties[here, :, before, :], stiff)
    n = 2 * m
    return Normal(diagonal.reshape(pairs, n, n), lower.reshape(pairs, n, n), border.reshape(pairs, n, -1), corner)


def factorise(normal: Normal) -> Factors:
    """Block Cholesky factorisation, pair by pair, then of the shared corner."""

    def eliminate(before, blocks):
        root_before, border_before, first = before
        diagonal, lower, border = blocks
        below = jnp.where(first, 0.0, solve_triangular(root_before, lower.T, lower=True).T)
        root = jnp.linalg.cholesky(diagonal - below @ below.T)
        border = solve_triangular(root, border - below @ border_before, lower=True)
        return (root, border, jnp.asarray(False)), (root, below, border)

    n, shared = normal.border.shape[1:]
    start = (jnp.eye(n), jnp.zeros((n, shared)), jnp.asarray(True))
    _, (roots, below, border) = jax.lax.scan(eliminate, start, (normal.diagonal, normal.lower, normal.border))
    flat = border.reshape(-1, shared)
    return Factors(roots, below, border, jnp.linalg.cholesky(normal.corner - flat.T @ flat))


def solve(factors: Factors, vector: Unknowns) -> Unknowns:
    """Solve the normal equations for one right-hand side."""
    pairs, n, _ = factors.border.shape
    padded = jnp.pad(vector.bands, ((0, 2 * pairs - len(vector.bands)), (0, 0))).reshape(pairs, n)
    shared = jnp.concatenate([vector.films.ravel(), vector.paints.ravel(), vector.others])

    def down(before, blocks):
        root, below, right = blocks
        value = solve_triangular(root, right - below @ before, lower=True)
        return value, value

    _, forward = jax.lax.scan(down, jnp.zeros(n), (factors.roots, factors.below, padded))
    reduced = shared - jnp.einsum("pns,pn->s", factors.border, forward)
    common = cho_solve((factors.corner, True), reduced)
    rest = forward - factors.border @ common
    return _unflatten(_back(factors, rest), common, vector)


def draw(factors: Factors, like: Unknowns, pairs: Float[Array, "pairs n"], shared: Float[Array, "shared"]) -> Unknowns:
    """Deviation with the inverse normal matrix as covariance, from independent standard normal numbers."""
    common = solve_triangular(factors.corner, shared, lower=True, trans=1)
    return _unflatten(_back(factors, pairs - factors.border @ common), common, like)


def _back(factors: Factors, right: Float[Array, "pairs n"]) -> Float[Array, "pairs n"]:
    """Solve with the transposed factor of the bands."""

    def up(after, blocks):
        root, below_after, right = blocks
        value = solve_triangular(root, right - below_after.T @ after, lower=True, trans=1)
        return value, value

    n = right.shape[1]
    below_after = jnp.concatenate([factors.below[1:], jnp.zeros((1, n, n))])
    _, values = jax.lax.scan(up, jnp.zeros(n), (factors.roots, below_after, right), reverse=True)
    return values


def _unflatten(bands: Float[Array, "pairs n"], shared: Float[Array, "shared"], like: Unknowns) -> Unknowns:
    films, paints, others = jnp.split(shared, [like.films.size, like.films.size + like.paints.size])
    count, local = like.bands.shape
    return Unknowns(
        bands.reshape(-1, local)[:count], films.reshape(like.films.shape), paints.reshape(like.paints.shape), others
    )


def shared_with_bands(factors: Factors, bands: int, last: int) -> Float[Array, "last bands local"]:
    """Covariance of the last few shared unknowns with the unknowns of each band."""
    shared = factors.corner.shape[0]
    columns = cho_solve((factors.corner, True), jnp.eye(shared))[shared - last :]
    # One after the other: batched triangular solves can deadlock on a CPU.
    found = jax.lax.map(lambda column: _back(factors, -(factors.border @ column)), columns)
    return found.reshape(last, 2 * len(factors.roots), found.shape[-1] // 2)[:, :bands]


def covariance(factors: Factors, bands: int) -> tuple[Float[Array, "bands local local"], Float[Array, "shared shared"]]:
    """Covariance of the unknowns of each band, and of the shared ones: blocks of the inverse normal matrix.

    By the recursion of Takahashi, Fagan, Chin (1973) on the block factors; nothing larger than a pair is inverted.
    """
    _, n, shared = factors.border.shape
    corner = cho_solve((factors.corner, True), jnp.eye(shared))

    def up(after, blocks):
        inner_after, spread_after = after
        root, below_after, border = blocks
        # Rows of the inverse factor: the block's own part, what the next pair adds, what the shared ones add.
        gain = solve_triangular(root, below_after.T, lower=True, trans=1)
        spread = solve_triangular(root, border, lower=True, trans=1) - gain @ spread_after
        own = cho_solve((root, True), jnp.eye(n)) + gain @ inner_after @ gain.T
        return (own, spread), own + spread @ corner @ spread.T

    below_after = jnp.concatenate([factors.below[1:], jnp.zeros((1, n, n))])
    start = (jnp.zeros((n, n)), jnp.zeros((n, shared)))
    _, blocks = jax.lax.scan(up, start, (factors.roots, below_after, factors.border), reverse=True)
    m = n // 2
    both = jnp.stack([blocks[:, :m, :m], blocks[:, m:, m:]], axis=1).reshape(-1, m, m)
    return both[:bands], corner
