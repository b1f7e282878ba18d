"""Amounts of the paints of many candidates at once, and the probability of each candidate.

Unknowns are log amounts, u_i = log a_i. What is minimised is minus the log of posterior density in
u: half the squared whitened residuals, a log-normal prior of the total, and a Dirichlet prior of
the fractions. A fixed number of damped steps (`glazefit.film.least_squares.damped_newton`) run side
by side for all candidates of a spectrum. Laplace's approximation at the minimum gives each
candidate's evidence.
"""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.special import gammaln
from jaxtyping import Array, Bool, Float, Int

from ...film.ahead import Program
from ...film.least_squares import damped_newton, inverse_small
from ...film.response import FilmResponse
from .screen import Paints

# Amounts between which a paint is sought, in units of the usual thickness; below the first it is
# not there.
LEAST = 1e-5
MOST = 60.0
_STEPS = 14
_LONGEST = 2.0

Number = Float[Array | np.ndarray, ""]


class Weights(NamedTuple):
    """Errors and prior of one spectrum, or of one candidate for it."""

    target: Float[Array | np.ndarray, "readings"]  # without the mean surface
    basis: Float[
        Array | np.ndarray, "scales components readings"
    ]  # components: as many as readings, or few that rank
    height: Float[Array | np.ndarray, "scales"]
    spread: Number
    concentration: Number
    freedom: Number  # of Student's t; 0 for Gaussian errors
    independent: Number  # readings that count as independent where errors follow Student's t


class Fitted(NamedTuple):
    """Candidates of one spectrum."""

    logs: Float[Array | np.ndarray, "sets size"]
    covariance: Float[Array | np.ndarray, "sets size size"]  # of the log amounts
    log_evidence: Float[Array | np.ndarray, "sets"]
    readings: Float[Array | np.ndarray, "sets readings"]  # without the surface


def log_prior(
    logs: Float[Array, "size"], present: Bool[Array, "size"], spread: Number, concentration: Number
) -> Float[Array, ""]:
    """Log prior density of log amounts: log-normal total of median 1, Dirichlet fractions."""
    m = present.sum(dtype=logs.dtype)
    total = jax.nn.logsumexp(logs, where=present)
    fractions = concentration * jnp.sum(jnp.where(present, logs - total, 0.0))
    fractions += gammaln(m * concentration) - m * gammaln(concentration)
    return -0.5 * (total / spread) ** 2 - jnp.log(spread * jnp.sqrt(2.0 * jnp.pi)) + fractions


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
    return gradient, hessian + jnp.diag(jnp.where(present, 0.0, 1.0).astype(logs.dtype))


Model = Callable[
    [Float[Array, "size"]], tuple[Float[Array, "readings"], Float[Array, "size readings"]]
]
"""Readings of a film from its amounts, and their slopes by the log amounts."""


def fit_one(
    model: Model,
    start: Float[Array, "size"],
    present: Bool[Array, "size"],
    weights: Weights,
    middle: int,
    steps: int | Array = _STEPS,
) -> Fitted:
    """Most probable log amounts of one candidate, and its evidence.

    Args:
        model: of the candidate.
        start: log amounts.
        present: False fills up a candidate of fewer paints.
        weights: of the spectrum.
        middle: scale of the discrepancy that is fitted with.
        steps: of Newton's method.
    """
    white = weights.basis[middle]

    def look(logs: Array) -> tuple[Array, Array, Array, Array]:
        readings, slopes = model(jnp.where(present, jnp.exp(logs), 0.0))
        off = white @ (weights.target - readings)
        slopes = slopes @ white.T
        gradient, hessian = prior_terms(logs, present, weights.spread, weights.concentration)
        cost = 0.5 * off @ off - log_prior(logs, present, weights.spread, weights.concentration)
        return cost, gradient - slopes @ off, hessian + slopes @ slopes.T, readings

    limits = float(np.log(LEAST)), float(np.log(MOST))
    logs, (_, _, hessian, readings) = damped_newton(
        look, start, limits, steps=steps, longest=_LONGEST
    )
    prior = prior_terms(logs, present, weights.spread, weights.concentration)[1]
    log_evidence, spread = _evidence(logs, present, (hessian - prior, prior), readings, weights)
    return Fitted(logs, spread, log_evidence, readings)


def _evidence(
    logs: Array, present: Array, hessian: tuple[Array, Array], readings: Array, weights: Weights
) -> tuple[Array, Array]:
    """Laplace's log evidence of one candidate, summed over the scales of the discrepancy; and the
    covariance of u.

    The misfit of a whole spectrum follows a Gaussian, or Student's t of `independent` readings in
    all: then each weighs the less the worse all are met.
    """
    off = jnp.einsum("srt,t->sr", weights.basis, weights.target - readings)
    square = jnp.sum(off**2, axis=-1)
    heavy = weights.freedom > 0
    freedom = jnp.where(heavy, weights.freedom, 1.0)
    whole = weights.freedom + weights.independent
    tail = weights.independent / off.shape[-1] * weights.height - 0.5 * whole * jnp.log1p(
        square / freedom
    )
    likelihood = jax.nn.logsumexp(jnp.where(heavy, tail, weights.height - 0.5 * square))
    data, prior_part = hessian
    share = jnp.where(heavy, whole / (freedom + jnp.min(square)), 1.0)
    spread, log_det = inverse_small(share * data + prior_part)
    prior = log_prior(logs, present, weights.spread, weights.concentration)
    volume = 0.5 * present.sum(dtype=logs.dtype) * jnp.log(2.0 * jnp.pi) - 0.5 * log_det
    return likelihood + prior + volume, spread


def coat_model(response: FilmResponse, k: Array, s: Array, ground: Array) -> Model:
    """Model of one coat of paints of these optical thicknesses, (size, bands)."""

    def model(amounts: Array) -> tuple[Array, Array]:
        readings, by_k, by_s = response.body_and_slopes(amounts @ k, amounts @ s, ground)
        slopes = amounts[:, None, None] * (k[:, None, :] * by_k + s[:, None, :] * by_s)
        return readings.reshape(-1), slopes.reshape(amounts.shape[0], -1)

    return model


@Program
@functools.partial(jax.jit, static_argnames=("middle", "steps"))
def fit_sets(
    response: FilmResponse,
    paints: Paints,
    sets: Array,
    starts: Array,
    ground: Array,
    weights: Weights,
    middle: int,
    steps: int = _STEPS,
) -> Fitted:
    """Fit candidates of one coat, as many for each spectrum.

    Args:
        response: of the instrument.
        paints: of the catalogue.
        sets: paints of each candidate, (spectra, sets, size); a negative number is none.
        starts: log amounts, (spectra, sets, size).
        ground: internal reflectance, (spectra, grounds, bands).
        weights: of each spectrum.
        middle: scale of the discrepancy that is fitted with.
        steps: of Newton's method; many where the start is far.
    """

    def one(spectrum: tuple) -> Fitted:
        sets, starts, ground, weights = spectrum

        def candidate(members: Array, start: Array) -> Fitted:
            return _fit_film(response, paints, members, start, ground, weights, middle, steps)

        return jax.vmap(candidate)(sets, starts)

    return jax.lax.map(one, (sets, starts, ground, weights))


@Program
@functools.partial(jax.jit, static_argnames="middle")
def fit_films(
    response: FilmResponse,
    paints: Paints,
    sets: Array,
    starts: Array,
    ground: Array,
    weights: Weights,
    middle: int,
    steps: Array,
) -> Fitted:
    """Fit candidates of one coat, each with a ground and weights of its own: arguments as of
    `fit_sets` without the spectra's axis, and each number of steps by the same program.
    """

    def candidate(members: Array, start: Array, ground: Array, weights: Weights) -> Fitted:
        return _fit_film(response, paints, members, start, ground, weights, middle, steps)

    return jax.vmap(candidate)(sets, starts, ground, weights)


def _fit_film(
    response: FilmResponse,
    paints: Paints,
    members: Array,
    start: Array,
    ground: Array,
    weights: Weights,
    middle: int,
    steps: int | Array,
) -> Fitted:
    """Fit one candidate of one coat."""
    model = coat_model(response, paints.absorption[members], paints.scattering[members], ground)
    return fit_one(model, start, members >= 0, weights, middle, steps)


@Program
@jax.jit
def film_slopes(
    response: FilmResponse, paints: Paints, sets: Array, logs: Array, ground: Array
) -> Float[Array, "films errors readings"]:
    """Slopes of the readings by the log of every paint's k, then s, band by band.

    Args:
        response: of the instrument.
        paints: of the catalogue.
        sets: paints of each film, (films, size); a negative number is none.
        logs: log amounts, (films, size).
        ground: internal reflectance, (films, grounds, bands).
    """

    def film(members: Array, logs: Array, ground: Array) -> Array:
        amounts = jnp.where(members >= 0, jnp.exp(logs), 0.0)[:, None]
        parts = amounts * paints.absorption[members], amounts * paints.scattering[members]
        _, by_k, by_s = response.body_and_slopes(parts[0].sum(axis=0), parts[1].sum(axis=0), ground)
        slopes = jnp.concatenate([parts[0][:, None] * by_k, parts[1][:, None] * by_s])
        return slopes.reshape(slopes.shape[0], -1)

    return jax.vmap(film)(sets, logs, ground)


def slopes_of(
    response: FilmResponse,
    paints: Paints,
    sets: Int[np.ndarray, "films size"],
    logs: Float[np.ndarray, "films size"],
    grounds: Float[np.ndarray, "spectra grounds bands"],
    row: Int[np.ndarray, "films"],
) -> Float[np.ndarray, "films errors readings"]:
    """`film_slopes` of any number of films, over the grounds of their spectra, which
    `row` numbers.
    """

    def run(n: np.ndarray) -> Array:
        return film_slopes(
            response, paints, *(jnp.asarray(a) for a in (sets[n], logs[n], grounds[row[n]]))
        )

    return by_blocks(len(sets), block_size(grounds[0].size), run)


def by_blocks(count: int, block: int, run: Callable[[Int[np.ndarray, "block"]], Any]) -> Any:
    """What `run` says of films by number, `block` at a time, as numpy arrays for all of them.

    The last block is filled up with films again: one shape, one program.
    """
    parts = []
    for first in range(0, count, block):
        rows = np.arange(first, min(first + block, count))
        parts.append(run(np.resize(rows, block)))
    return jax.tree.map(lambda *a: np.concatenate([np.asarray(one) for one in a])[:count], *parts)


def block_size(readings: int) -> int:
    """Films that are fitted at a time, so that their errors take some megabytes at most."""
    return int(np.clip(2**22 // readings**2, 4, 128))


def programs_ahead(
    films: tuple[FilmResponse, Paints],
    single: tuple[FilmResponse, Paints],
    shape: tuple[int, int],
    scales: int,
    largest: int,
    middle: int,
    both: bool,
) -> None:
    """Begin to compile what the best candidates are fitted with, while others are still looked for.

    Args:
        films, single: response and paints in double and in single precision.
        shape: grounds and bands of a spectrum.
        scales: of the discrepancy.
        largest: paints of a film, 2 at least.
        middle: scale that is fitted with.
        both: whether sets are weighed in single precision and shown in double.
    """
    readings = shape[0] * shape[1]
    count = block_size(readings)
    numbers = (count,)
    matrix = (count, scales, readings, readings)
    members = np.zeros((count, largest), np.int32)
    steps = jnp.asarray(0)
    film_slopes.ahead(*films, members, np.zeros(members.shape), np.zeros((count, *shape)))
    for kind, given in ((np.float32, single), (np.float64, films))[0 if both else 1 :]:
        sizes = ((count, readings), matrix, (count, scales), *[numbers] * 4)
        weights = Weights(*(np.broadcast_to(kind(0), size) for size in sizes))
        ground = np.zeros((count, *shape), kind)
        fit_films.ahead(
            *given, members, np.zeros(members.shape, kind), ground, weights, middle, steps
        )
