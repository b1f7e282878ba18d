"""Laplace's approximation: a Gaussian at each mode, with the curvature there, and a test of how
good it is.

Modes are found by least squares from the likeliest of many draws of the prior; a second mode counts
by its own volume. Where least squares is stopped before it has settled, the mode counts as it
stands, and is marked (`Laplace.settled`). Draws from the Gaussians are weighted by the true over
the Gaussian density, the weights smoothed (Pareto-smoothed importance sampling), and drawn again by
weight. Where the tail index of the weights is 0.7 or more that fails, and with it the
approximation; there the Gaussians are left as they are and not to be trusted (Vehtari, Simpson,
Gelman, Yao, Gabry, JMLR 25 (2024) 72).
"""

import functools
import warnings
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int
from scipy.special import logsumexp

from glazejax.programs import Program

from ..film.numerics.least_squares import damped_solution, levenberg_marquardt, normal_solution
from .arviz import load_arviz
from .problem import Problem

TRUSTED_TAIL = 0.7


class Modes(NamedTuple):
    """Where least squares led from each start of each block, best first."""

    points: Float[np.ndarray, "blocks starts dims"]
    settled: Bool[np.ndarray, "blocks starts"]  # False where it was stopped


@dataclass(frozen=True)
class Laplace:
    """Gaussians in the free unknowns, up to six a block.

    Attributes:
        modes: best first, (blocks, modes, dims).
        covariances: (blocks, modes, dims, dims).
        weights: share of the probability, (blocks, modes); 0 where there is no such mode.
        tail: Pareto index of the importance weights, (blocks,).
        sample: draws of the free unknowns, by weight where the index allows, (draws, blocks, dims).
        settled: whether least squares came to an end at each mode, (blocks, modes); False where
            there is none.
        effective: how many independent draws the weighted ones are worth, (blocks,).
    """

    modes: Float[np.ndarray, "blocks modes dims"]
    covariances: Float[np.ndarray, "blocks modes dims dims"]
    weights: Float[np.ndarray, "blocks modes"]
    tail: Float[np.ndarray, "blocks"]
    sample: Float[np.ndarray, "draws blocks dims"]
    settled: Bool[np.ndarray, "blocks modes"]
    effective: Float[np.ndarray, "blocks"] | float = np.nan

    @property
    def converged(self) -> Bool[np.ndarray, "blocks"]:
        """Whether least squares came to an end at every mode that has a part of the probability."""
        return np.all(self.settled | (self.weights == 0), axis=1)

    @property
    def trusted(self) -> np.ndarray:
        """Whether the approximation is good enough for standard errors and intervals, (blocks,)."""
        return self.tail < TRUSTED_TAIL

    @property
    def many(self) -> np.ndarray:
        """Whether a second mode has a hundredth of the probability or more, (blocks,)."""
        return np.sort(self.weights, axis=1)[:, -2] >= 0.01

    def draws(self, n: int, rng: np.random.Generator) -> Float[np.ndarray, "n blocks dims"]:
        """Draws of the free unknowns from the Gaussians."""
        blocks, modes, dims = self.modes.shape
        chosen = np.array([rng.choice(modes, size=n, p=w) for w in self.weights])
        roots = np.linalg.cholesky(self.covariances)
        rows = np.arange(blocks)[:, None]
        noise = np.einsum(
            "bnij,bnj->bni", roots[rows, chosen], rng.standard_normal((blocks, n, dims))
        )
        return np.swapaxes(np.asarray(self.modes[rows, chosen] + noise), 0, 1)

    def log_density(
        self, free: Float[np.ndarray, "n blocks dims"]
    ) -> Float[np.ndarray, "n blocks"]:
        """Log-density of the Gaussians, up to a constant."""
        precision = np.linalg.inv(self.covariances)
        off = free[:, :, None, :] - self.modes
        square = np.einsum("nbmi,bmij,nbmj->nbm", off, precision, off)
        logdet = np.linalg.slogdet(self.covariances)[1]
        with np.errstate(divide="ignore"):
            return np.asarray(logsumexp(np.log(self.weights) - 0.5 * (square + logdet), axis=-1))


@functools.partial(Program, fixed=("residuals", "batch"))
def _climb(
    residuals: Any, data: Any, shared: Any, starts: Float[Array, "blocks starts dims"], batch: int
) -> Any:
    """Where each start leads, (blocks, starts, dims), and whether it settled there, (blocks,
    starts).
    """

    def block(both: tuple[Any, Array]) -> tuple[Array, Array]:
        one, points = both
        return levenberg_marquardt(
            lambda free: residuals(free, one, shared),
            points,
            rtol=1e-6,
            atol=1e-6,
            max_steps=60,
            # The first is unrolled: for few unknowns.
            damped=damped_solution if points.shape[-1] <= 7 else normal_solution,
        )

    return jax.lax.map(block, (data, starts), batch_size=batch)


@functools.partial(Program, fixed=("residuals", "batch"))
def _curvature(
    residuals: Any, data: Any, shared: Any, modes: Float[Array, "blocks modes dims"], batch: int
) -> Array:
    """Hessian of minus the log-probability at each mode, (blocks, modes, dims, dims)."""

    def block(both: tuple[Any, Array]) -> Array:
        one, points = both
        return jax.vmap(jax.hessian(lambda free: 0.5 * jnp.sum(residuals(free, one, shared) ** 2)))(
            points
        )

    return jax.lax.map(block, (data, modes), batch_size=batch)


def find_modes(problem: Problem, *, starts: int = 8, seed: int = 0) -> Modes:
    """Where each start of each block ends, best first; a start is the likeliest of many draws of
    the prior.
    """
    return climb(problem, _starts(problem, starts, seed))


def climb(problem: Problem, first: Float[np.ndarray, "blocks starts dims"]) -> Modes:
    """Where least squares leads from some points, best first."""
    blocks, starts, _ = first.shape
    batch = max(1, problem.chunk * blocks // starts)
    climbed = _climb(problem.residuals, problem.data, problem.shared, first, min(batch, blocks))
    found, settled = (np.asarray(a) for a in climbed)
    height = problem.log_probability(np.swapaxes(found, 0, 1)).T
    order = np.argsort(-np.nan_to_num(height, nan=-np.inf), axis=1)
    return Modes(
        np.take_along_axis(found, order[..., None], axis=1),
        np.take_along_axis(settled, order, axis=1),
    )


def _starts(problem: Problem, starts: int, seed: int) -> Float[np.ndarray, "blocks starts dims"]:
    """The likeliest of each group of draws, so that the starts do not all lie in one valley."""
    blocks = len(problem.blocks)
    tried = problem.prior_draws(np.random.default_rng(seed), starts * 48)
    values = problem.log_probability(np.repeat(tried[:, None], blocks, axis=1))
    best = values.reshape(starts, -1, blocks).argmax(axis=1)
    return np.stack([group[of] for group, of in zip(np.split(tried, starts), best, strict=True)], 1)


def laplace(problem: Problem, found: Modes, *, seed: int = 0, draws: int = 4000) -> Laplace:
    """Laplace's approximation of every block.

    Args:
        problem: what is sampled.
        found: its modes, as `find_modes` gives them.
        seed: of the draws.
        draws: how many are weighted and kept.
    """
    points = found.points
    blocks, starts, _ = points.shape
    batch = min(blocks, max(1, problem.chunk * blocks // (starts * problem.dims)))
    hessians = np.asarray(
        _curvature(problem.residuals, problem.data, problem.shared, points, batch)
    )
    covariances = _inverse(hessians, problem.prior_covariance)
    height = problem.log_probability(np.swapaxes(points, 0, 1)).T
    chosen, real = _distinct(points, covariances, height)
    modes = np.take_along_axis(points, chosen[..., None], axis=1)
    covariances = np.take_along_axis(covariances, chosen[..., None, None], axis=1)
    volume = np.take_along_axis(height, chosen, axis=1) + 0.5 * np.linalg.slogdet(covariances)[1]
    volume = np.where(real, volume, -np.inf)
    settled = np.take_along_axis(found.settled, chosen, axis=1) & real
    weights = np.exp(volume - logsumexp(volume, axis=1, keepdims=True))
    nothing = np.empty((0, blocks, problem.dims))
    first = Laplace(
        modes=modes,
        covariances=covariances,
        weights=weights,
        tail=np.full(blocks, np.nan),
        sample=nothing,
        settled=settled,
    )
    tail, sample, effective = _importance(problem, first, draws, seed)
    return replace(first, tail=tail, sample=sample, effective=effective)


def _distinct(
    found: Float[np.ndarray, "blocks starts dims"],
    covariances: Float[np.ndarray, "blocks starts dims dims"],
    height: Float[np.ndarray, "blocks starts"],
) -> tuple[Int[np.ndarray, "blocks modes"], Bool[np.ndarray, "blocks modes"]]:
    """Numbers of the modes that differ from better ones and are not hopelessly lower, and whether
    there is one.
    """
    blocks, starts, _ = found.shape
    precision = np.linalg.inv(covariances)
    # Six modes a block are kept at most.
    index = np.zeros((blocks, 6), dtype=int)
    real = np.zeros(index.shape, dtype=bool)
    for b in range(blocks):
        kept: list[int] = []
        for s in range(starts):
            if not np.isfinite(height[b, s]) or height[b, s] < height[b, 0] - 20.0:
                continue
            off = found[b, s] - found[b, kept]
            # Modes nearer than two of their standard deviations are one.
            near = [d @ precision[b, k] @ d < 2.0**2 for d, k in zip(off, kept, strict=True)]
            if not any(near) and len(kept) < index.shape[1]:
                kept.append(s)
        index[b, : len(kept)], real[b, : len(kept)] = kept, True
    return index, real


def _inverse(hessians: np.ndarray, prior: np.ndarray) -> np.ndarray:
    """Covariances, never wider than the prior allows."""
    root = np.linalg.cholesky(prior)
    values, axes = np.linalg.eigh(root.T @ np.nan_to_num(hessians) @ root)
    scaled = root @ axes
    return np.einsum("...ij,...j,...kj->...ik", scaled, 1.0 / np.maximum(values, 1.0), scaled)


def _importance(
    problem: Problem, gaussian: Laplace, draws: int, seed: int
) -> tuple[
    Float[np.ndarray, "blocks"],
    Float[np.ndarray, "draws blocks dims"],
    Float[np.ndarray, "blocks"],
]:
    """Pareto index of the importance weights of draws from the Gaussians, the draws taken again by
    weight, and what they are worth.
    """
    arviz = load_arviz()
    rng = np.random.default_rng(seed + 1)
    free = gaussian.draws(draws, rng)
    log_weights = problem.log_probability(free) - gaussian.log_density(free)
    # A draw of no probability has no weight.
    log_weights = np.where(np.isfinite(log_weights), log_weights, log_weights.max(axis=0) - 700.0)
    with warnings.catch_warnings():
        # It warns of large indices, which are the answer here.
        warnings.simplefilter("ignore")
        smooth, tail = arviz.psislw(np.ascontiguousarray(log_weights.T))
    smooth = np.asarray(smooth).reshape(-1, draws)
    tail = np.atleast_1d(np.asarray(tail))
    # Evenly spaced places in the summed weights: less noise than independent draws.
    places = (np.arange(draws) + rng.random()) / draws
    for b in np.flatnonzero(tail < TRUSTED_TAIL):
        summed = np.cumsum(np.exp(smooth[b] - smooth[b].max()))
        free[:, b] = free[np.searchsorted(summed / summed[-1], places), b]
    weights = np.exp(smooth - smooth.max(axis=1, keepdims=True))
    effective = weights.sum(axis=1) ** 2 / (weights**2).sum(axis=1)
    return tail, free, effective
