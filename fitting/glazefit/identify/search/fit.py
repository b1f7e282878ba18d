"""Amounts of the paints of many candidates at once, and the probability of each candidate.

Unknowns are log amounts, u_i = log a_i. What is minimised is minus the log of posterior density in
u: half the squared whitened residuals, a log-normal prior of the total, and a Dirichlet prior of
the fractions. A fixed number of damped steps (`least_squares.damped_newton`) run side
by side for all candidates of a spectrum. Laplace's approximation at the minimum gives each
candidate's evidence.
"""

import functools
import math
from typing import Any, NamedTuple, TypeAlias

import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.special import gammaln
from jaxtyping import Array, Bool, Float, Int

from glazejax.programs import Program
from glazejax.radiative.common.chunks import by_blocks

from ...film.model.errors import Whitening, whitening
from ...film.model.response import FilmResponse
from ...film.numerics.least_squares import damped_newton, inverse_small
from ...film.numerics.weighted import variance_along
from .pool import NOBODY, Pool
from .screen import grow_triples
from .table import Block, FilmTable, NearestSets, Paints
from .task import Chunk, Expected, IdentificationTask, Number

FilmNumbers: TypeAlias = Int[np.ndarray, "films"]
"""A number for each film: its own, or that of its spectrum, its errors or its group."""
FilmSets: TypeAlias = Int[np.ndarray, "films size"]
"""Paints of each film by number, negative for none."""
FilmLogs: TypeAlias = Float[np.ndarray, "films size"]
"""Log amounts of the paints of each film."""
PerPaint: TypeAlias = Float[Array, "size"]
"""A number for each paint of one film."""
# Amounts between which a paint is searched, in units of the usual thickness; below the first it is
# not there.
LEAST = 1e-5
MOST = 60.0
# Films that are ranked at a time.
_BLOCK = 512


class Weights(NamedTuple):
    """Errors and prior of one spectrum, or of one candidate for it; of several, what is expected
    is the same.
    """

    target: Float[Any, "readings"]  # without the mean surface
    # Components are as many as readings, or few that rank.
    basis: Float[Any, "components readings"]
    height: Float[Any, ""]
    expected: Expected


class Fitted(NamedTuple):
    """Candidates of one spectrum."""

    logs: Float[Any, "sets size"]
    covariance: Float[Any, "sets size size"]  # of the log amounts
    log_evidence: Float[Any, "sets"]
    readings: Float[Any, "sets readings"]  # without the surface


def rank(chunk: Chunk, table: FilmTable) -> Pool:
    """Candidates of some spectra, fitted in single precision with errors that are the same for all
    candidates of a spectrum: sets of one and of two paints, and of three that grow from the best.

    Args:
        chunk: the spectra.
        table: of films over their ground, which are looked up in it and in whose components they
            are fitted.
    """
    task = chunk.task
    near = table.nearest(chunk.target, task.effort.fitted_pairs)
    project = table.project
    errors = whitening(project @ (chunk.noise_covariance + chunk.ranking_covariance) @ project.T)
    errors = errors._replace(basis=errors.basis @ project)

    def fit(near: NearestSets) -> Fitted:
        spectra, count, size = near.sets.shape
        row = np.repeat(np.arange(spectra), count)
        sets = near.sets.reshape(-1, size)
        amounts = np.clip(near.amounts.reshape(-1, size), LEAST, MOST)
        logs = np.where(sets == NOBODY, 0.0, np.log(amounts))
        fitted = fit_all(
            chunk,
            row,
            sets,
            logs,
            errors,
            own=row,
            steps=task.effort.ranking_steps,
            block=_BLOCK,
        )
        return Fitted(*(values.reshape(spectra, count, *values.shape[1:]) for values in fitted))

    fitted = fit(near)
    pool = pool_of(task, near.sets, fitted)
    if task.max_paints < 3:
        return pool
    pairs = slice(task.paint_count, None)
    grown, new = grow_triples(
        chunk,
        table.white,
        near.sets[:, pairs],
        fitted.logs[:, pairs],
        fitted.log_evidence[:, pairs],
    )
    triples = pool_of(task, grown.sets, fit(grown))
    triples.log_weight[~new] = -np.inf
    return pool.merge(triples)


def fit_all(
    chunk: Chunk,
    row: FilmNumbers,
    sets: FilmSets,
    logs: FilmLogs,
    errors: Whitening,
    own: FilmNumbers,
    steps: int,
    block: int,
    *,
    along: bool = False,
) -> Fitted:
    """Films fitted in single precision, in which evidences are good to a thousandth, and amounts to
    a hundredth where readings hardly determine them.

    Args:
        chunk: the spectra.
        row: spectrum of each film.
        sets: its paints; a negative number is none.
        logs: log amounts to start from.
        errors: of some films or spectra.
        own: number of each film's errors among these.
        steps: of Newton's method.
        block: films that are fitted at a time.
        along: see `fit_films`.
    """
    task = chunk.task
    single = task.single
    grounds, target, basis, height, logs, expected = jax.tree.map(
        lambda a: np.asarray(a, np.float32),
        (chunk.spectra.grounds, chunk.target, *errors, logs, task.expected),
    )

    def run(n: Block) -> Fitted:
        weights = Weights(target[row[n]], basis[own[n]], height[own[n]], expected)
        start = sets[n], logs[n], grounds[row[n]]
        return fit_films(*single, *start, weights, steps=np.asarray(steps), along=np.asarray(along))

    return Fitted(*(values.astype(np.float64) for values in by_blocks(len(sets), block, run)))


def pool_of(task: IdentificationTask, sets: np.ndarray, fitted: Fitted) -> Pool:
    """Fitted candidates of one coat with room for three paints each."""
    size = sets.shape[-1]
    room = ((0, 0), (0, 0), (0, 3 - size))
    members = np.pad(sets, room, constant_values=NOBODY)
    # A place without a paint was fitted, too, and says nothing.
    logs = np.where(members == NOBODY, -np.inf, np.pad(fitted.logs, room))
    return Pool(
        members=members,
        coats=np.zeros_like(members),
        logs=logs,
        weighed=logs,
        covariance=np.pad(fitted.covariance, (*room, (0, 3 - size))),
        log_weight=fitted.log_evidence + log_set_prior(task, sets),
        readings=fitted.readings,
        adjusted=fitted.readings,
        gloss=np.zeros(sets.shape[:2]),
        condition=np.zeros(sets.shape[:2], dtype=np.int32),
    )


def log_set_prior(
    task: IdentificationTask, members: Int[np.ndarray, "*n size"]
) -> Float[np.ndarray, "*n"]:
    """Log prior probability of sets of paints; a negative number is none."""
    sizes = np.asarray(task.prior.sizes[: task.max_paints])
    sets = [math.comb(task.paint_count, n) for n in range(1, len(sizes) + 1)]
    present = members >= 0
    count = present.sum(axis=-1)
    # Alone, an extender is as good as any other paint.
    hardly = np.where(count > 1, (present & task.extenders[members]).sum(axis=-1), 0)
    # No paint at all is no explanation.
    log_chances = np.append(-np.inf, np.log(sizes / sizes.sum() / sets))
    return log_chances[count] + hardly * np.log(task.prior.extender)


@Program
def fit_films(
    response: FilmResponse,
    paints: Paints,
    sets: Array,
    starts: Array,
    ground: Array,
    weights: Weights,
    steps: Array,
    along: Array,
) -> Fitted:
    """Fit candidates of one coat, each with a ground and weights of its own.

    Args:
        response: of the instrument.
        paints: of the catalogue.
        sets: paints of each candidate, (films, size); a negative number is none.
        starts: log amounts, (films, size).
        ground: internal reflectance, (films, grounds, bands).
        weights: of each candidate.
        steps: of Newton's method; many where the start is far. One program serves any number.
        along: whether the variance of the log thickness is that of the density along it
            (`film.numerics.weighted.variance_along`), not Laplace's.
    """
    each = functools.partial(_fit_film, response, paints, steps=steps, along=along)
    axes = weights._replace(target=0, basis=0, height=0, expected=None)
    return jax.vmap(each, in_axes=(0, 0, 0, axes))(sets, starts, ground, weights)


def _fit_film(
    response: FilmResponse,
    paints: Paints,
    members: Array,
    start: Array,
    ground: Array,
    weights: Weights,
    steps: Array,
    along: Array,
) -> Fitted:
    """Most probable log amounts of one candidate, and its evidence."""
    present = members >= 0
    k = paints.absorption[members]
    s = paints.scattering[members]
    white = weights.basis
    law = weights.expected.spread, weights.expected.concentration

    def look(
        logs: Array, share: float | Array = 1.0
    ) -> tuple[Array, Array, Array, tuple[Array, Array]]:
        """`share` is how much the readings count."""
        amounts = jnp.where(present, jnp.exp(logs), 0.0)
        body, by_k, by_s = response.body_and_slopes(amounts @ k, amounts @ s, ground)
        readings = body.reshape(-1)
        slopes = amounts[:, None, None] * (k[:, None, :] * by_k + s[:, None, :] * by_s)
        off = white @ (weights.target - readings)
        # The slopes on the right: on the left XLA takes twice the time.
        slopes = (white @ slopes.reshape(amounts.shape[0], -1).T).T
        by_data = -share * slopes @ off
        of_data = share * slopes @ slopes.T
        by_prior, of_prior = prior_terms(logs, present, *law)
        cost = 0.5 * share * off @ off - log_prior(logs, present, *law)
        hessian = of_prior + of_data + jnp.diag(trace_curvature(by_data, by_prior))
        return cost, by_prior + by_data, hessian, (readings, of_data)

    limits = float(np.log(LEAST)), float(np.log(MOST))
    logs, (_, _, _, (readings, of_data)) = damped_newton(
        look, start, limits, steps=steps, longest=2.0
    )
    _, of_prior = prior_terms(logs, present, *law)
    log_evidence, share = _evidence(logs, present, (of_data, of_prior), readings, weights)
    # Errors are no smaller than stated because a film is met well.
    share = jnp.minimum(share, 1.0)
    spread, _ = inverse_small(share * of_data + of_prior)

    def by_thickness(spread: Array, logs: Array) -> tuple[Array, Array]:
        """Slopes of the log amounts by the log of the thickness, and its variance."""
        fractions = jax.nn.softmax(logs, where=present)
        with_all = spread @ fractions
        variance = fractions @ with_all
        return with_all / variance, variance

    def widened() -> Array:
        direction, variance = by_thickness(spread, logs)

        def density(step: Array) -> Array:
            at = logs + step * direction
            cost, gradient, hessian, _ = look(at, share)
            # The fractions' own step from there, by the amounts' covariance at this thickness.
            local, _ = inverse_small(hessian)
            slopes, of_thickness = by_thickness(local, at)
            others = local - of_thickness * jnp.outer(slopes, slopes)
            return 0.5 * gradient @ others @ gradient - cost

        by_density = variance_along(density, variance)
        return spread + (by_density - variance) * jnp.outer(direction, direction)

    return Fitted(logs, jax.lax.cond(along, widened, lambda: spread), log_evidence, readings)


def trace_curvature(by_data: PerPaint, by_prior: PerPaint) -> PerPaint:
    """Curvature that lets a paint go in one step to the trace at which data and prior balance.

    Where the data want less of a paint, their gradient p is positive and nearly in proportion to
    its amount e^u, and the prior holds against it with -q. Squared slopes, in proportion to e^2u,
    say nothing of p's own change: steps by them alone are far too long. Newton's step (p - q)/h
    ends where p e^step = q if h is the logarithmic mean of p and q, (p - q)/log(p/q).

    Args:
        by_data, by_prior: gradients by the log amounts.
    """
    # Gradients below this pull nowhere.
    p = jnp.maximum(by_data, 1e-12)
    q = jnp.maximum(-by_prior, 1e-12)
    ratio = jnp.log(p / q)
    # A ratio whose logarithm is this small is taken as 1.
    close = jnp.abs(ratio) < 0.01
    mean = jnp.where(close, p, (p - q) / jnp.where(close, 1.0, ratio))
    return jnp.where(by_data > 0.0, mean, 0.0)


def prior_terms(
    logs: Array, present: Array, spread: Number, concentration: Number
) -> tuple[Array, Array]:
    """Gradient of minus the log prior, and a positive part of its Hessian; 1 for a paint that is
    not there.
    """
    m = present.sum(dtype=logs.dtype)
    total = jax.nn.logsumexp(logs, where=present)
    share = jax.nn.softmax(logs, where=present)
    gradient = share * total / spread**2 - concentration * (present.astype(logs.dtype) - m * share)
    outer = jnp.outer(share, share)
    hessian = outer / spread**2 + concentration * m * (jnp.diag(share) - outer)
    return gradient, hessian + jnp.diag((~present).astype(logs.dtype))


def log_prior(
    logs: PerPaint, present: Bool[Array, "size"], spread: Number, concentration: Number
) -> Float[Array, ""]:
    """Log prior density of log amounts: log-normal total of median 1, Dirichlet fractions."""
    m = present.sum(dtype=logs.dtype)
    total = jax.nn.logsumexp(logs, where=present)
    fractions = concentration * jnp.sum(jnp.where(present, logs - total, 0.0))
    fractions += gammaln(m * concentration) - m * gammaln(concentration)
    return -0.5 * (total / spread) ** 2 - jnp.log(spread * jnp.sqrt(2.0 * jnp.pi)) + fractions


def _evidence(
    logs: Array, present: Array, hessian: tuple[Array, Array], readings: Array, weights: Weights
) -> tuple[Array, Array]:
    """Laplace's log evidence of one candidate, and by how much its misfit counts relative to a
    Gaussian's.

    The misfit of a whole spectrum follows Student's t of `independent` readings in all: each weighs
    the less the worse all are met.
    """
    off = weights.basis @ (weights.target - readings)
    square = off @ off
    expected = weights.expected
    independent = jnp.minimum(expected.independent, weights.target.size)
    freedom = expected.freedom + independent
    # What is left out of few components counts for nothing while sets are ranked.
    height = independent / off.size * weights.height
    likelihood = height - 0.5 * freedom * jnp.log1p(square / expected.freedom)
    data, prior_part = hessian
    share = freedom / (expected.freedom + square)
    _, log_det = inverse_small(share * data + prior_part)
    prior = log_prior(logs, present, expected.spread, expected.concentration)
    volume = 0.5 * present.sum(dtype=logs.dtype) * jnp.log(2.0 * jnp.pi) - 0.5 * log_det
    return likelihood + prior + volume, share
