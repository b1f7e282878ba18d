"""Amounts of the paints of many candidates at once, and the probability of each candidate.

Unknowns are log amounts, u_i = log a_i. What is minimised is minus the log of posterior density in u: half the squared
whitened residuals, a log-normal prior of the total, and a Dirichlet prior of the fractions. Gauss-Newton steps with
Levenberg's damping, a fixed number of them, run side by side for all candidates of a spectrum; at most three unknowns,
so that the linear algebra is written out. Laplace's approximation at the minimum gives each candidate's evidence.
"""

import functools
from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax.scipy.special import gammaln
from jaxtyping import Array, Float

from .candidates import Paints
from .response import FilmResponse

# Amounts between which a paint is sought, in units of the usual thickness; below the first it is not there.
LEAST, MOST = 1e-5, 60.0
_STEPS = 14
_LONGEST = 2.0


class Weights(NamedTuple):
    """Errors and prior of one spectrum."""

    target: Float[Array, "readings"]  # without the mean surface
    whitening: Float[Array, "scales readings readings"]
    height: Float[Array, "scales"]  # log of the Gaussian's height, and of the scale's weight
    spread: Float[Array, ""]
    concentration: Float[Array, ""]


class Fitted(NamedTuple):
    """Candidates of one spectrum."""

    logs: Float[Array, "sets size"]
    covariance: Float[Array, "sets size size"]  # of the log amounts
    log_evidence: Float[Array, "sets"]
    readings: Float[Array, "sets readings"]  # without the surface


def solve_small(matrix: Float[Array, "n n"], rhs: Float[Array, "n"]) -> Float[Array, "n"]:
    """Solve a positive definite system of up to three unknowns."""
    return inverse_small(matrix)[0] @ rhs


def inverse_small(matrix: Float[Array, "n n"]) -> tuple[Float[Array, "n n"], Float[Array, ""]]:
    """Inverse and log determinant of a positive definite matrix of up to three rows, by Cholesky factors."""
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
            x.append(((1.0 if i == column else 0.0) - sum(lower[i][p] * x[p] for p in range(i))) / lower[i][i])
        unit.append(jnp.stack([jnp.asarray(v) for v in x]))
    inverse = jnp.stack(unit, axis=1)
    return inverse.T @ inverse, 2.0 * sum((jnp.log(lower[i][i]) for i in range(n)), jnp.zeros(()))


def log_prior(logs: Float[Array, "size"], spread: Array, concentration: Array) -> Float[Array, ""]:
    """Log prior density of log amounts: log-normal total of median 1, Dirichlet fractions."""
    m = logs.shape[0]
    total = jax.nn.logsumexp(logs)
    fractions = concentration * jnp.sum(logs - total) + gammaln(m * concentration) - m * gammaln(concentration)
    return -0.5 * (total / spread) ** 2 - jnp.log(spread * jnp.sqrt(2.0 * jnp.pi)) + fractions


def _prior_terms(logs: Array, spread: Array, concentration: Array) -> tuple[Array, Array]:
    """Gradient of minus the log prior, and a positive part of its Hessian."""
    m = logs.shape[0]
    total, share = jax.nn.logsumexp(logs), jax.nn.softmax(logs)
    gradient = share * total / spread**2 - concentration * (1.0 - m * share)
    outer = jnp.outer(share, share)
    return gradient, outer / spread**2 + concentration * m * (jnp.diag(share) - outer)


Model = Callable[[Float[Array, "size"]], tuple[Float[Array, "readings"], Float[Array, "size readings"]]]
"""Readings of a film from its log amounts, and their slopes."""


def fit_one(model: Model, start: Float[Array, "size"], weights: Weights, middle: int) -> tuple[Array, Array, Array]:
    """Most probable log amounts of one candidate.

    Args:
        model: of the candidate.
        start: log amounts.
        weights: of the spectrum.
        middle: scale of the discrepancy that is fitted with.

    Returns:
        Log amounts, the Hessian of minus the log posterior there, and the readings.
    """
    white = weights.whitening[middle]

    def look(logs: Array) -> tuple[Array, Array, Array, Array]:
        readings, slopes = model(logs)
        off, slopes = white @ (weights.target - readings), slopes @ white.T
        gradient, hessian = _prior_terms(logs, weights.spread, weights.concentration)
        cost = 0.5 * off @ off - log_prior(logs, weights.spread, weights.concentration)
        return cost, gradient - slopes @ off, hessian + slopes @ slopes.T, readings

    def step(_: int, state: tuple) -> tuple:
        logs, seen, damping = state
        _, gradient, hessian, _ = seen
        damped = hessian + damping * (jnp.diag(jnp.diagonal(hessian)) + 1e-6 * jnp.eye(logs.shape[0]))
        move = jnp.clip(-solve_small(damped, gradient), -_LONGEST, _LONGEST)
        tried = jnp.clip(logs + move, jnp.log(LEAST), jnp.log(MOST))
        new = look(tried)
        better = new[0] < seen[0]
        kept = jax.tree.map(lambda a, b: jnp.where(better, a, b), (tried, new), (logs, seen))
        return (*kept, jnp.where(better, damping * 0.2, jnp.maximum(damping, 1e-3) * 6.0))

    state = (start, look(start), jnp.asarray(0.02, start.dtype))
    logs, (_, _, hessian, readings), _ = jax.lax.fori_loop(0, _STEPS, step, state)
    return logs, hessian, readings


def evidence(logs: Array, hessian: Array, readings: Array, weights: Weights) -> tuple[Array, Array]:
    """Laplace's log evidence of one candidate, summed over the scales of the discrepancy; and the covariance of u."""
    spread, log_det = inverse_small(hessian)
    off = jnp.einsum("srt,t->sr", weights.whitening, weights.target - readings)
    likelihood = jax.nn.logsumexp(weights.height - 0.5 * jnp.sum(off**2, axis=-1))
    prior = log_prior(logs, weights.spread, weights.concentration)
    volume = 0.5 * logs.shape[0] * jnp.log(2.0 * jnp.pi) - 0.5 * log_det
    return likelihood + prior + volume, spread


@functools.partial(jax.jit, static_argnames="middle")
def fit_sets(
    response: FilmResponse, paints: Paints, sets: Array, starts: Array, ground: Array, weights: Weights, middle: int
) -> Fitted:
    """Fit candidates of one coat.

    Args:
        response: of the instrument.
        paints: of the catalogue.
        sets: paints of each candidate, (spectra, sets, size).
        starts: log amounts, (spectra, sets, size).
        ground: internal reflectance, (spectra, grounds, bands).
        weights: of each spectrum.
        middle: scale of the discrepancy that is fitted with.
    """

    def one(spectrum: tuple) -> Fitted:
        sets, starts, ground, weights = spectrum

        def candidate(members: Array, start: Array) -> Fitted:
            k, s = paints.absorption[members], paints.scattering[members]

            def model(logs: Array) -> tuple[Array, Array]:
                amounts = jnp.exp(logs)
                films, unit = (amounts @ k, amounts @ s), jnp.ones_like(k[0])
                seen = functools.partial(response.body, ground=ground)
                readings, by_k = jax.jvp(seen, films, (unit, jnp.zeros_like(unit)))
                _, by_s = jax.jvp(seen, films, (jnp.zeros_like(unit), unit))
                slopes = amounts[:, None, None] * (k[:, None, :] * by_k + s[:, None, :] * by_s)
                return readings.reshape(-1), slopes.reshape(amounts.shape[0], -1)

            logs, hessian, readings = fit_one(model, start, weights, middle)
            log_evidence, spread = evidence(logs, hessian, readings, weights)
            return Fitted(logs, spread, log_evidence, readings)

        return jax.vmap(candidate)(sets, starts)

    return jax.lax.map(one, (sets, starts, ground, weights))
