"""Modes of a problem, and Laplace's approximation: a Gaussian at each mode, with the curvature
there, and a test of how good it is.

Modes are found by least squares from the likeliest of many draws of the prior. Where readings are
linear in the paints' errors about the likeliest ones (`glazefit.film.errors`), modes and these
errors depend on each other and are found in turn. A second mode counts by its own volume. Where
least squares is stopped before it has settled, the mode counts as it stands, and is marked
(`Laplace.settled`). Draws from the Gaussians are weighted by the true over the Gaussian density,
the weights smoothed (Pareto-smoothed importance sampling), and drawn again by weight. Where the
tail index of the weights is 0.7 or more that fails, and with it the approximation; there the
Gaussians are left as they are and not to be trusted (Vehtari, Simpson, Gelman, Yao, Gabry, JMLR 25
(2024) 72).
"""

import functools
import warnings
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, TypeAlias

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int
from scipy.special import log_softmax

from glazejax.extras import require
from glazejax.programs import Program

from .errors import expand
from .numerics.least_squares import levenberg_marquardt
from .numerics.weighted import numbers_at
from .problem import FilmProblem, FreeDraws

TRUSTED_TAIL = 0.7

PerStart: TypeAlias = Float[np.ndarray, "blocks starts dims"]
"""Free unknowns, for each start of each block."""
ModeFlags: TypeAlias = Bool[np.ndarray, "blocks modes"]
"""What holds of which mode of each block."""
PerBlock: TypeAlias = Float[np.ndarray, "blocks"]
"""A number for each block."""
BlockFlags: TypeAlias = Bool[np.ndarray, "blocks"]
"""What holds of which block."""


class Modes(NamedTuple):
    """Ends of least squares from each start of each block, best first."""

    points: PerStart
    settled: Bool[np.ndarray, "blocks starts"]  # False where it was stopped
    height: Float[np.ndarray, "blocks starts"]  # log posterior


class Gaussians(NamedTuple):
    """A mixture of Gaussians for each block."""

    means: Float[Array | np.ndarray, "blocks parts dims"]
    roots: Float[Array | np.ndarray, "blocks parts dims dims"]
    inverses: Float[Array | np.ndarray, "blocks parts dims dims"]  # of the roots
    log_weights: Float[Array | np.ndarray, "blocks parts"]  # -inf for no part

    def draw(self, key: Array, chains: int) -> Float[Array, "chains blocks dims"]:
        """One draw for each chain and block."""
        which, noise = jax.random.split(key)
        blocks, _, dims = self.means.shape
        chosen = jax.random.categorical(which, self.log_weights, shape=(chains, blocks))
        at = jnp.arange(blocks), chosen
        steps = jax.random.normal(noise, (chains, blocks, dims))
        return self.means[at] + jnp.einsum("cbij,cbj->cbi", self.roots[at], steps)

    def draws(self, n: int, rng: np.random.Generator) -> Float[np.ndarray, "n blocks dims"]:
        """Draws of each block, (n, blocks, dims), by NumPy's random numbers."""
        blocks, parts, dims = self.means.shape
        shares = np.exp(np.asarray(self.log_weights))
        chosen = np.array([rng.choice(parts, size=n, p=share) for share in shares])
        at = np.arange(blocks)[:, None], chosen
        noise = rng.standard_normal((blocks, n, dims))
        points = self.means[at] + np.einsum("bnij,bnj->bni", self.roots[at], noise)
        return np.swapaxes(points, 0, 1)

    def log_density(self, xp: Any, free: Float[Any, "n blocks dims"]) -> Any:
        """Up to a constant, (n, blocks); `xp` is numpy or jax.numpy."""
        white = xp.einsum("bpij,nbpj->nbpi", self.inverses, free[:, :, None] - self.means)
        diagonal = xp.diagonal(self.inverses, axis1=-2, axis2=-1)
        height = self.log_weights + xp.log(diagonal).sum(axis=-1) - 0.5 * (white**2).sum(axis=-1)
        return xp.logaddexp.reduce(height, axis=-1)


@dataclass(frozen=True)
class Laplace:
    """Gaussians in the free unknowns, up to six a block.

    Attributes:
        gaussians: one at each mode, best first, with their shares of the probability.
        tail: Pareto index of the importance weights, (blocks,).
        sample: draws of the free unknowns, by weight where the index allows, (draws, blocks, dims).
        settled: whether least squares came to an end at each mode, (blocks, modes); False where
            there is none.
        effective: how many independent draws the weighted ones are worth, (blocks,).
    """

    gaussians: Gaussians
    tail: PerBlock
    sample: FreeDraws
    settled: ModeFlags
    effective: PerBlock

    @property
    def modes(self) -> Float[np.ndarray, "blocks modes dims"]:
        """Best first."""
        return np.asarray(self.gaussians.means)

    @property
    def weights(self) -> Float[np.ndarray, "blocks modes"]:
        """Share of the probability; 0 where there is no such mode."""
        return np.exp(np.asarray(self.gaussians.log_weights))

    @property
    def converged(self) -> BlockFlags:
        """True if least squares came to an end at every mode that has a part of the probability."""
        return np.all(self.settled | (self.weights == 0), axis=1)

    @property
    def trusted(self) -> BlockFlags:
        """True if the approximation is good enough for standard errors and intervals, (blocks,)."""
        return self.tail < TRUSTED_TAIL

    @property
    def many(self) -> BlockFlags:
        """True if a second mode has a hundredth of the probability or more, (blocks,)."""
        return np.sort(self.weights, axis=1)[:, -2] >= 0.01


@functools.partial(Program, fixed=("residuals", "batch"))
def _climb(
    residuals: Any, data: Any, shared: Any, starts: Float[Array, "blocks starts dims"], batch: int
) -> Any:
    """End of each start, (blocks, starts, dims), and whether it settled there, (blocks, starts)."""

    def block(pair: tuple[Any, Array]) -> tuple[Array, Array]:
        block_data, points = pair
        return levenberg_marquardt(
            lambda free: residuals(free, block_data, shared),
            points,
            rtol=1e-6,
            atol=1e-6,
            max_steps=60,
        )

    return jax.lax.map(block, (data, starts), batch_size=batch)


@functools.partial(Program, fixed=("residuals", "batch"))
def _curvature(
    residuals: Any, data: Any, shared: Any, modes: Float[Array, "blocks modes dims"], batch: int
) -> Array:
    """Hessian of minus the log-probability at each mode, (blocks, modes, dims, dims)."""

    def block(pair: tuple[Any, Array]) -> Array:
        block_data, points = pair
        return jax.vmap(
            jax.hessian(lambda free: 0.5 * jnp.sum(residuals(free, block_data, shared) ** 2))
        )(points)

    return jax.lax.map(block, (data, modes), batch_size=batch)


def solve(problem: FilmProblem, *, seed: int = 0) -> tuple[FilmProblem, Modes]:
    """The problem with its readings linear about the likeliest errors of the paints, where they are
    not linear anyway, and its modes.

    Raises:
        ValueError: JAX computes in single precision, in which what readings leave open comes out
            narrow and wrong.
    """
    if jnp.result_type(float) != jnp.float64:
        raise ValueError(
            'posteriors need double precision: write jax.config.update("jax_enable_x64", True) at '
            "the start of the program"
        )
    modes = find_modes(problem, seed=seed)
    if problem.data.expansion is None:
        return problem, modes
    film, data, shared = problem.film, problem.data, problem.shared
    # Modes are found after each linearisation, the fifth of which changes little.
    for turn in range(5):
        data = expand(film, modes.points[:, 0], data, shared, steps=8 if turn else 0)
        problem = replace(problem, data=data)
        modes = climb(problem, modes.points)
    return problem, modes


def find_modes(problem: FilmProblem, *, seed: int = 0) -> Modes:
    """Modes of each block, one from each start, best first; a start is the likeliest of many draws
    of the prior.
    """
    blocks, starts = len(problem.blocks), problem.starts
    tried = problem.prior_draws(np.random.default_rng(seed), starts * 48)
    values = problem.log_probability(np.repeat(tried[:, None], blocks, axis=1))
    best = values.reshape(starts, -1, blocks).argmax(axis=1)
    # The likeliest of each group of draws, so that the starts do not all lie in one valley.
    groups = zip(np.split(tried, starts), best, strict=True)
    return climb(problem, np.stack([group[of] for group, of in groups], axis=1))


def climb(problem: FilmProblem, first: PerStart) -> Modes:
    """Ends of least squares from some points, best first."""
    blocks, starts, _ = first.shape
    batch = max(1, problem.chunk * blocks // starts)
    climbed = _climb(problem.residuals, problem.data, problem.shared, first, min(batch, blocks))
    points, settled = map(np.asarray, climbed)
    height = problem.log_probability(np.swapaxes(points, 0, 1)).T
    order = np.argsort(-np.nan_to_num(height, nan=-np.inf), axis=1)
    at = np.arange(blocks)[:, None], order
    return Modes(points=points[at], settled=settled[at], height=height[at])


def laplace(problem: FilmProblem, solution: Modes, *, seed: int = 0) -> Laplace:
    """Laplace's approximation of every block.

    Args:
        problem: what is sampled.
        solution: its modes, as `find_modes` gives them.
        seed: of the draws.
    """
    points = solution.points
    blocks, starts, _ = points.shape
    batch = min(blocks, max(1, problem.chunk * blocks // (starts * problem.dims)))
    hessians = np.asarray(
        _curvature(problem.residuals, problem.data, problem.shared, points, batch)
    )
    # Covariances, never wider than the prior allows.
    root = np.linalg.cholesky(problem.prior_covariance)
    values, axes = np.linalg.eigh(root.T @ np.nan_to_num(hessians) @ root)
    scaled = root @ axes
    covariances = np.einsum(
        "...ij,...j,...kj->...ik", scaled, 1.0 / np.maximum(values, 1.0), scaled
    )
    chosen, real = _distinct(points, covariances, solution.height)
    at = np.arange(blocks)[:, None], chosen
    covariances = covariances[at]
    volume = solution.height[at] + 0.5 * np.linalg.slogdet(covariances)[1]
    volume = np.where(real, volume, -np.inf)
    roots = np.linalg.cholesky(covariances)
    gaussians = Gaussians(
        means=points[at],
        roots=roots,
        inverses=np.linalg.inv(roots),
        log_weights=log_softmax(volume, axis=1),
    )
    return _importance(problem, gaussians, solution.settled[at] & real, seed)


def _distinct(
    points: PerStart,
    covariances: Float[np.ndarray, "blocks starts dims dims"],
    height: Float[np.ndarray, "blocks starts"],
) -> tuple[Int[np.ndarray, "blocks modes"], ModeFlags]:
    """Numbers of the modes that differ from better ones and are not hopelessly lower, and whether
    there is one.
    """
    blocks, starts, _ = points.shape
    precision = np.linalg.inv(covariances)
    # Six modes a block are kept at most.
    index = np.zeros((blocks, 6), dtype=int)
    real = np.zeros(index.shape, dtype=bool)
    for b in range(blocks):
        chosen: list[int] = []
        for s in range(starts):
            if not np.isfinite(height[b, s]) or height[b, s] < height[b, 0] - 20.0:
                continue
            off = points[b, s] - points[b, chosen]
            # Modes nearer than two of their standard deviations are one.
            near = [d @ precision[b, k] @ d < 2.0**2 for d, k in zip(off, chosen, strict=True)]
            if not any(near) and len(chosen) < index.shape[1]:
                chosen.append(s)
        index[b, : len(chosen)], real[b, : len(chosen)] = chosen, True
    return index, real


def _importance(
    problem: FilmProblem,
    gaussians: Gaussians,
    settled: ModeFlags,
    seed: int,
) -> Laplace:
    """The Gaussians with draws from them, taken again by their importance weights, the Pareto index
    of these, and what the draws are worth.
    """
    draws = 4000
    arviz = load_arviz()
    rng = np.random.default_rng(seed + 1)
    free = gaussians.draws(draws, rng)
    log_weights = problem.log_probability(free) - gaussians.log_density(np, free)
    # A draw of no probability has no weight.
    log_weights = np.where(np.isfinite(log_weights), log_weights, log_weights.max(axis=0) - 700.0)
    # It warns of large indices, which are the answer here.
    with warnings.catch_warnings(action="ignore"):
        smooth, tail = arviz.psislw(np.ascontiguousarray(log_weights.T))
    smooth = np.reshape(smooth, (-1, draws))
    tail = np.atleast_1d(tail)
    weights = np.exp(smooth - smooth.max(axis=1, keepdims=True))
    places = (np.arange(draws) + rng.random()) / draws
    for b in np.flatnonzero(tail < TRUSTED_TAIL):
        free[:, b] = free[numbers_at(weights[b], places), b]
    return Laplace(
        gaussians=gaussians,
        tail=tail,
        sample=free,
        settled=settled,
        effective=weights.sum(axis=1) ** 2 / (weights**2).sum(axis=1),
    )


def load_arviz() -> Any:
    """ArviZ, without the announcement of its next version."""
    require("arviz")
    with warnings.catch_warnings(action="ignore", category=FutureWarning):
        import arviz
    return arviz
