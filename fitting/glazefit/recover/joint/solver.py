"""The linear step of a joint recovery: thousands of unknowns, solved by their structure.

Readings at one band know the coefficients of that band and the shared numbers; curvature ties a
band to its two neighbours on either side, a step to one. Ordered by bands, two bands a block, the
normal equations are block tridiagonal with a border of shared unknowns, so a step costs bands x
paints^3, not (bands x paints)^3.

Columns of the Jacobian are found by differentiating along unit steps of all bands at once, and of
all films at once: a reading moves with its own only. That is one compiled program; the blocks are
then solved in NumPy, which takes milliseconds, where a compiled solver takes half a minute to
compile for every new number of films.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.linalg import get_lapack_funcs

from ...film.model.response import Response
from ...film.numerics.least_squares import Surroundings, descend
from .problem import JointProblem, JointResiduals, Unknowns, residuals


class Normal(NamedTuple):
    """Normal matrix of a joint problem: block tridiagonal in pairs of bands, with a border."""

    diagonal: Float[Array, "pairs n n"]
    lower: Float[Array, "pairs n n"]  # coupling of a pair to the one before; the first is not used
    border: Float[Array, "pairs n shared"]
    corner: Float[Array, "shared shared"]


class Factors(NamedTuple):
    """Cholesky factors of `Normal`; those on the diagonal are inverted, as they are needed so."""

    roots: Float[np.ndarray, "pairs n n"]
    below: Float[np.ndarray, "pairs n n"]  # off-diagonal blocks of the factor
    border: Float[np.ndarray, "pairs n shared"]
    corner: Float[np.ndarray, "shared shared"]


@jax.jit
def look(problem: JointProblem, response: Response, point: Unknowns) -> Surroundings[Unknowns]:
    """Cost, its gradient, and the normal matrix at a point."""
    values, along = jax.linearize(lambda y: residuals(y, (problem, response)), point)
    (gradient,) = jax.linear_transpose(along, point)(values)
    cost = 0.5 * sum(jnp.sum(block**2) for block in values)
    return Surroundings(jnp.asarray(cost), gradient, normal_matrix(along, point, problem))


class Fit(NamedTuple):
    """End of a fit: the point, the factors there, the number of steps, and whether they settled."""

    point: Unknowns
    factors: Factors
    steps: int
    settled: bool


def solve_jointly(
    problem: JointProblem,
    response: Response,
    start: Unknowns,
    first_step: float,
    max_steps: int,
    note: Callable[[int], object] = lambda steps: None,
) -> Fit:
    """Levenberg and Marquardt's least squares from a start.

    Args:
        problem, response: see `residuals`.
        start: first point.
        first_step: one over the damping of the first step.
        max_steps: that are tried.
        note: see `descend`.
    """
    descent = descend(
        lambda point: jax.tree.map(np.asarray, look(problem, response, point)),
        lambda normal, damping, gradient: solve(factorise(normal, damping), gradient),
        start,
        first_step=first_step,
        max_steps=max_steps,
        # A thousandth of a coefficient.
        tolerance=1e-3,
        note=note,
    )
    return Fit(descent.point, factorise(descent.seen.normal), descent.steps, descent.settled)


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
    inner = jnp.einsum("ibfc,jbfc->bij", by_band.data, by_band.data)
    inner = inner + jnp.einsum("ibl,jbl->bij", by_band.pull, by_band.pull)
    to_films = jnp.einsum("ibfc,ebfc->bife", by_band.data, by_film.data)
    to_rest = jnp.einsum("ibfc,pbfc->bip", by_band.data, by_rest.data)
    film_blocks = jnp.einsum("dbfc,ebfc->fde", by_film.data, by_film.data)
    film_blocks = film_blocks + jnp.einsum("dfl,efl->fde", by_film.films, by_film.films)
    between = jnp.einsum("ebfc,pbfc->fep", by_film.data, by_rest.data).reshape(films * per_film, -1)
    shared_block = jnp.einsum("pbfc,qbfc->pq", by_rest.data, by_rest.data)
    shared_block = shared_block + by_rest.paints @ by_rest.paints.T
    shared_block = shared_block + by_rest.others @ by_rest.others.T
    corner = jnp.block(
        [[jax.scipy.linalg.block_diag(*film_blocks), between], [between.T, shared_block]]
    )
    border = jnp.concatenate([to_films.reshape(bands, local, films * per_film), to_rest], axis=-1)
    return _pair_bands(inner, border, corner, _ties(problem))


def _ties(problem: JointProblem) -> Float[Array, "bands bands local"]:
    """Ties of the bands' unknowns to their like at other bands, by curvature and by steps."""
    square = problem.steepness**2
    bands = jnp.arange(len(square))
    after = bands + 1
    ties = (problem.curvature.T @ problem.curvature)[:, :, None] * problem.stiffness**2
    ties = ties.at[bands, bands].add(square).at[after, after].add(square)
    return ties.at[bands, after].add(-square).at[after, bands].add(-square)


def _pair_bands(
    inner: Float[Array, "bands m m"],
    border: Float[Array, "bands m shared"],
    corner: Float[Array, "shared shared"],
    ties: Float[Array, "bands bands m"],
) -> Normal:
    """Blocks of two bands; an odd band gets an empty partner."""
    bands, m = inner.shape[:2]
    pairs = -(-bands // 2)
    spare = 2 * pairs - bands
    inner = jnp.concatenate([inner, jnp.broadcast_to(jnp.eye(m), (spare, m, m))])
    border = jnp.pad(border, ((0, spare), (0, 0), (0, 0)))
    ties = jnp.pad(ties, ((0, spare), (0, spare), (0, 0))).reshape(pairs, 2, pairs, 2, m)
    indices = jnp.arange(pairs)

    def coupling(to: Array) -> Float[Array, "pairs 2 m 2 m"]:
        return jnp.einsum("pabi,ij->paibj", ties[indices, :, to], jnp.eye(m))

    alone = jnp.einsum("paij,ab->paibj", inner.reshape(pairs, 2, m, m), jnp.eye(2))
    return Normal(
        (alone + coupling(indices)).reshape(pairs, 2 * m, 2 * m),
        coupling(jnp.maximum(indices - 1, 0)).reshape(pairs, 2 * m, 2 * m),
        border.reshape(pairs, 2 * m, -1),
        corner,
    )


def factorise(normal: Normal, damping: float = 0.0) -> Factors:
    """Block Cholesky factorisation, pair by pair, then of the shared corner.

    Raises:
        numpy.linalg.LinAlgError: the matrix is not positive definite.
    """
    diagonal, lower, border, corner = (np.array(block) for block in normal)
    pairs, n, shared = border.shape
    diagonal[:, range(n), range(n)] += damping
    corner[range(shared), range(shared)] += damping
    roots = np.zeros_like(diagonal)
    below = np.zeros_like(lower)
    for pair in range(pairs):
        block = diagonal[pair]
        if pair:
            below[pair] = lower[pair] @ roots[pair - 1].T
            block = block - below[pair] @ below[pair].T
            border[pair] -= below[pair] @ border[pair - 1]
        roots[pair] = _inverse_root(block)
        border[pair] = roots[pair] @ border[pair]
    flat = border.reshape(-1, shared)
    return Factors(roots, below, border, _inverse_root(corner - flat.T @ flat))


def _inverse_root(matrix: Float[np.ndarray, "n n"]) -> Float[np.ndarray, "n n"]:
    """Inverse of the lower Cholesky factor.

    By LAPACK's trtri: `solve_triangular` starts threads even for eight rows, and takes a thousand
    times as long where other programs keep the cores busy.
    """
    root = np.linalg.cholesky(matrix)
    (invert,) = get_lapack_funcs(("trtri",), (root,))
    return np.tril(invert(root, lower=1)[0])


def solve(factors: Factors, vector: Unknowns) -> Unknowns:
    """Solve the normal equations for one right-hand side."""
    pairs, n, _ = factors.border.shape
    bands = np.pad(vector.bands, ((0, 2 * pairs - len(vector.bands)), (0, 0))).reshape(pairs, n)
    shared = np.concatenate([np.ravel(block) for block in vector[1:]])
    solved, common = _solve_blocks(factors, bands, shared)
    return unflatten(solved[None], common[None], vector, 0)


def _solve_blocks(
    factors: Factors,
    bands: Float[np.ndarray, "pairs n *columns"],
    shared: Float[np.ndarray, "shared *columns"],
) -> tuple[Float[np.ndarray, "pairs n *columns"], Float[np.ndarray, "shared *columns"]]:
    """Solve the normal equations, for several right-hand sides at once where there are columns."""
    forward = np.array(bands)
    for pair in range(len(forward)):
        before = factors.below[pair] @ forward[pair - 1] if pair else 0.0
        forward[pair] = factors.roots[pair] @ (forward[pair] - before)
    residual = shared - np.einsum("pns,pn...->s...", factors.border, forward)
    common = factors.corner.T @ (factors.corner @ residual)
    return _back(factors, forward - factors.border @ common), common


def covariance_times(
    factors: Factors,
    vectors: Float[np.ndarray, "bands local columns"],
    modes: Float[np.ndarray, "others bands local"],
) -> Float[np.ndarray, "bands local columns"]:
    """The whole covariance of all bands' coefficients times some vectors; never formed, as it may
    be huge.

    Args:
        factors: of the normal matrix.
        vectors: one a column.
        modes: how the last of the shared unknowns move the bands.
    """
    bands, local, columns = vectors.shape
    pairs, n, shared = factors.border.shape
    blocks = np.pad(vectors, ((0, 2 * pairs - bands), (0, 0), (0, 0))).reshape(pairs, n, columns)
    corner_side = np.zeros((shared, columns))
    corner_side[shared - len(modes) :] = np.einsum("obi,bic->oc", modes, vectors)
    solved, common = _solve_blocks(factors, blocks, corner_side)
    band_side = solved.reshape(2 * pairs, local, columns)[:bands]
    return band_side + np.einsum("obi,oc->bic", modes, common[shared - len(modes) :])


def draws(factors: Factors, like: Unknowns, count: int, seed: int = 0) -> Unknowns:
    """Deviations with the inverse normal matrix as covariance, each with a leading axis
    of draws.
    """
    rng = np.random.default_rng(seed)
    pairs, n, shared = factors.border.shape
    common = factors.corner.T @ rng.standard_normal((shared, count))
    bands = _back(factors, rng.standard_normal((pairs, n, count)) - factors.border @ common)
    return unflatten(np.moveaxis(bands, -1, 0), common.T, like)


def _back(
    factors: Factors, right_side: Float[np.ndarray, "pairs n *columns"]
) -> Float[np.ndarray, "pairs n *columns"]:
    """Solve with the transposed factor of the bands."""
    values = np.array(right_side)
    last = len(values) - 1
    for pair in range(last, -1, -1):
        after = factors.below[pair + 1].T @ values[pair + 1] if pair < last else 0.0
        values[pair] = factors.roots[pair].T @ (values[pair] - after)
    return values


def unflatten(
    bands: Float[np.ndarray, "count pairs n"],
    shared: Float[np.ndarray, "count shared"],
    like: Unknowns,
    only: int | None = None,
) -> Unknowns:
    """Unknowns from the blocks of bands and the shared numbers of several vectors, or of one."""
    count, local = like.bands.shape
    films, paints, other_values = np.split(
        shared, [like.films.size, like.films.size + like.paints.size], axis=1
    )
    blocks: list[Any] = [
        bands.reshape(len(bands), -1, local)[:, :count],
        films.reshape(-1, *like.films.shape),
        paints.reshape(-1, *like.paints.shape),
        other_values,
    ]
    unknowns = Unknowns(*blocks)
    return unknowns if only is None else jax.tree.map(lambda leaf: leaf[only], unknowns)


def shared_with_bands(
    factors: Factors, bands: int, last: int
) -> Float[np.ndarray, "last bands local"]:
    """Covariance of the last few shared unknowns with the unknowns of each band."""
    pairs, n, shared = factors.border.shape
    columns = (factors.corner.T @ factors.corner)[:, shared - last :]
    solution = _back(factors, -(factors.border @ columns))
    return np.moveaxis(solution, -1, 0).reshape(last, 2 * pairs, n // 2)[:, :bands]


def covariance(
    factors: Factors, bands: int
) -> tuple[Float[np.ndarray, "bands local local"], Float[np.ndarray, "shared shared"]]:
    """Covariance of the unknowns of each band, and of the shared ones: blocks of the inverse normal
    matrix.

    By the recursion of Takahashi, Fagan, Chin (1973) on the block factors; nothing larger than a
    pair is inverted.
    """
    pairs, n, shared = factors.border.shape
    corner = factors.corner.T @ factors.corner
    inner = np.zeros((n, n))
    spread = np.zeros((n, shared))
    blocks = np.zeros((pairs, n, n))
    for pair in range(pairs - 1, -1, -1):
        root = factors.roots[pair]
        # Rows of the inverse factor: the block's own part, what the next pair adds, what the shared
        #     ones add.
        after = factors.below[pair + 1].T if pair < pairs - 1 else np.zeros((n, n))
        gain = root.T @ after
        spread = root.T @ factors.border[pair] - gain @ spread
        inner = root.T @ root + gain @ inner @ gain.T
        blocks[pair] = inner + spread @ corner @ spread.T
    m = n // 2
    diagonal = np.stack([blocks[:, :m, :m], blocks[:, m:, m:]], axis=1).reshape(-1, m, m)
    return diagonal[:bands], corner
