"""From films over black and white to absorption and scattering, at every wavelength.

Each band of each film is a problem of its own: two readings, two unknowns. All of them are solved
side by side in one compiled program, Levenberg and Marquardt's steps
(`film.numerics.least_squares`) on the table of films (`FilmResponse`, exact to 1e-5), in chunks of
films so that progress shows and an interrupt keeps what is finished.

The unknowns are log(k d) and log(s d), held between bounds by a sigmoid. Two films over the same
cards can have two solutions, so the fit starts from the two best local minima on a grid
(`FilmResponse`) and keeps the better.

Where a film is opaque only k/s is known. There s d is drawn to its neighbours
(`neighbours_scattering`) and k d follows from the ratio; the band is flagged.
"""

from collections.abc import Iterator
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from glazejax.geometry import resolve_instrument
from glazejax.programs import Program
from glazejax.radiative.common.linalg import inverse_positive

from ..film.films import (
    CardReadings,
    Films,
    Instrument,
    InstrumentLike,
    Noise,
    card_readings,
    cards,
)
from ..film.gloss import estimate_gloss
from ..film.model.body import HIGHEST, LOWEST
from ..film.model.response import FilmResponse, film_response
from ..film.noise import estimate_noise
from ..film.numerics.least_squares import levenberg_marquardt
from .result import Recovery, told_apart

CHUNK = 8
"""Films a chunk."""

_BOUNDS = np.log(np.array([LOWEST, HIGHEST]))


class ScatteringPrior(NamedTuple):
    """Prior of log(s d): its mean and one over its standard deviation (0 for nothing)."""

    mean: Float[Array, "*bands"]
    weight: Float[Array, "*bands"]


class BandStart(NamedTuple):
    """Start of the fit of one band."""

    logs: Float[Array, "*bands 2 2"]  # two points, log k d and log s d
    weights: Float[Array, "*bands 2"]  # of the residuals
    least_scattering: Float[Array, "*bands"]  # smallest log(s d) that the data allow


class Estimate(NamedTuple):
    """Solution of every band."""

    optical: Float[Array, "*bands 2"]  # k d and s d
    covariance: Float[Array, "*bands 2 2"]
    fitted: Float[Array, "*bands 2"]  # without the surface's part
    misfit: Float[Array, "*bands"]  # sum of squared residuals, in standard deviations
    converged: Bool[Array, "*bands"]
    ambiguous: Bool[Array, "*bands"]  # the other start led to another solution as good
    least_scattering: Float[Array, "*bands"]


def _bound(free: Float[Array, "*n 2"]) -> Float[Array, "*n 2"]:
    """Log optical thicknesses from free parameters; the slope is 1 in the middle of the range."""
    low, high = jnp.asarray(_BOUNDS, free.dtype)
    return low + (high - low) * jax.nn.sigmoid(4.0 * free / (high - low))


def _free(logs: Float[Array, "*n 2"]) -> Float[Array, "*n 2"]:
    low, high = jnp.asarray(_BOUNDS, logs.dtype)
    share = jnp.clip((logs - low) / (high - low), 1e-3, 1 - 1e-3)
    return (high - low) / 4.0 * (jnp.log(share) - jnp.log1p(-share))


def starts(data: CardReadings, response: FilmResponse, prior: ScatteringPrior) -> BandStart:
    """Starting points of one band: the two lowest local minima of a grid (the lowest twice if there
    is one only).

    Between neighbouring values of k d residuals are interpolated, since the valley of equal k/s is
    narrow.
    """
    # So dense in k d and in s d that no minimum is missed.
    log_absorption, log_scattering = (
        jnp.asarray(np.linspace(np.log(low), np.log(0.8 * high), points), data.reflectance.dtype)
        for low, high, points in zip((1e-5, 1e-4), HIGHEST, (80, 44), strict=True)
    )
    black, gain, back = response.numbers(
        *jnp.meshgrid(jnp.exp(log_absorption), jnp.exp(log_scattering), indexing="ij")
    )
    ground = data.ground[:, None, None]
    transmitted = gain / (1.0 - back * ground)
    # A card's own error reaches the reading through the film.
    through = transmitted / (1.0 - back * ground)
    variance = data.sd[:, None, None] ** 2 + data.ground_sd[:, None, None] ** 2 * through**2
    residual = (black + ground * transmitted - data.reflectance[:, None, None]) / jnp.sqrt(variance)
    lower = residual[:, :-1]
    step = jnp.diff(residual, axis=1)
    share = jnp.clip(
        -jnp.sum(lower * step, axis=0) / jnp.clip(jnp.sum(step**2, axis=0), 1e-30), 0.0, 1.0
    )
    cost = jnp.sum((lower + share * step) ** 2, axis=0)
    least = log_scattering[jnp.argmax(jnp.min(cost, axis=0) <= cost.min() + 4.0)]

    cost = cost + (prior.weight * (log_scattering - prior.mean)) ** 2
    walled = jnp.pad(cost, 1, constant_values=jnp.inf)
    rows, columns = cost.shape
    around = jnp.stack([walled[i : i + rows, j : j + columns] for i in range(3) for j in range(3)])
    minima = jnp.where(cost <= around.min(axis=0), cost, jnp.inf).ravel()
    first = jnp.argmin(cost)
    second = jnp.argmin(minima.at[first].set(jnp.inf))
    second = jnp.where(jnp.isfinite(minima[second]), second, first)
    # A band whose s is given may be so dark that k has no upper limit: then the smallest that will
    # do.
    enough = jnp.argmax((cost <= cost.min() + 4.0).any(axis=1)) * columns
    enough += jnp.argmin(cost[enough // columns])
    first = jnp.where(prior.weight > 0, enough, first)
    row, column = jnp.divmod(jnp.stack([first, second]), columns)
    at = log_absorption[row] + share[row, column] * (log_absorption[1] - log_absorption[0])
    points = jnp.stack([at, log_scattering[column]], axis=-1)
    return BandStart(points, 1.0 / jnp.sqrt(variance[:, row[0], column[0]]), least)


def _polish(
    start: Float[Array, "n 2"],
    data: CardReadings,
    weights: Float[Array, "n 2"],
    prior: ScatteringPrior,
    response: FilmResponse,
) -> tuple[Float[Array, "n 2"], Bool[Array, "n"]]:
    """Least squares of bands, each from one start: log optical thicknesses, and whether they
    converged.

    A weak pull to the start settles directions that the data leave open; it moves a value that they
    determine to half its size by less than a hundredth of its error.
    """

    def residuals(
        free: Array, start: Array, data: CardReadings, weights: Array, prior: ScatteringPrior
    ) -> Float[Array, "rows"]:
        informed = prior.weight > 0
        # In standard deviations per unit of log k d or log s d.
        pull = jnp.stack([jnp.where(informed, 0.2, 0.05), jnp.where(informed, prior.weight, 0.05)])
        centre = jnp.stack([start[0], jnp.where(informed, prior.mean, start[1])])
        logs = _bound(free)
        k, s = jnp.exp(logs)
        misfit = (response.body(k, s, data.ground) - data.reflectance) * weights
        return jnp.concatenate([misfit, pull * (logs - centre)])

    arguments = (start, data, weights, prior)
    free, settled = levenberg_marquardt(
        residuals, _free(start), *arguments, rtol=1e-4, atol=1e-3, max_steps=20
    )
    return _bound(free), settled


def _spread(
    optical: Float[Array, "n 2"], data: CardReadings, response: FilmResponse
) -> tuple[Float[Array, "n 2"], Float[Array, "n 2 2"]]:
    """Fitted readings, and the covariance of k d and s d that the noise of all four readings
    causes.

    Inverse of the Fisher information, J^T W J, plus a vague prior: a value is known to 1
    + 5 times itself, so that what the data leave open comes out large, not infinite.
    """

    def total(optical: Array, ground: Array) -> tuple[Array, Array]:
        value = response.body(optical[..., 0], optical[..., 1], ground)
        return value.sum(), value

    # One reverse pass gives every slope: bands and cards are independent.
    pairs = jnp.broadcast_to(optical[:, None, :], (*optical.shape, 2))
    (_, value), (jacobian, through) = jax.value_and_grad(total, argnums=(0, 1), has_aux=True)(
        pairs, data.ground
    )
    variance = data.sd**2 + (data.ground_sd * through) ** 2
    scaled = jacobian / jnp.sqrt(variance)[..., None]
    fisher = (
        jnp.einsum("nci,ncj->nij", scaled, scaled)
        + jnp.eye(2) / (1.0 + 5.0 * optical[:, :, None]) ** 2
    )
    return value, inverse_positive(fisher)


@Program
def solve(data: CardReadings, response: FilmResponse, prior: ScatteringPrior) -> Estimate:
    """Solve every band of a batch, (n,), side by side."""
    start = jax.vmap(starts, in_axes=(0, None, 0))(data, response, prior)
    # Both starts of a band are bands of their own until the better one is chosen.
    twice = jax.tree.map(lambda a: jnp.repeat(a, 2, axis=0), (data, start.weights, prior))
    doubled, weights, priors = twice
    logs, converged = _polish(start.logs.reshape(-1, 2), doubled, weights, priors, response)
    optical = jnp.exp(logs)
    fitted, covariance = _spread(optical, doubled, response)
    misfit = jnp.sum(((fitted - doubled.reflectance) * weights) ** 2, axis=-1)
    cost = (misfit + (priors.weight * (logs[:, 1] - priors.mean)) ** 2).reshape(-1, 2)
    # The first unless the second is better by more than rounding.
    best = jnp.where(cost[:, 1] < cost[:, 0] - 0.01, 1, 0)
    pair = logs.reshape(-1, 2, 2)
    distinct = (jnp.abs(pair[:, 1] - pair[:, 0]) > 0.3) & (
        jnp.abs(jnp.exp(pair[:, 1]) - jnp.exp(pair[:, 0])) > 0.01
    )
    ambiguous = distinct.any(axis=1) & (jnp.abs(cost[:, 1] - cost[:, 0]) < 4.0)

    def choose(values: Array) -> Array:
        pairs = values.reshape(-1, 2, *values.shape[1:])
        return jnp.take_along_axis(pairs, best.reshape(-1, *[1] * (pairs.ndim - 1)), axis=1)[:, 0]

    return Estimate(
        optical=choose(optical),
        covariance=choose(covariance),
        fitted=choose(fitted),
        misfit=choose(misfit),
        converged=choose(converged),
        ambiguous=ambiguous,
        least_scattering=start.least_scattering,
    )


def pose(
    films: Films, gloss: Float[np.ndarray, "films"], instrument: Instrument, noise: Noise
) -> CardReadings:
    """Problems of all bands of some films, (films * bands,), without the surface's part."""
    card_data = card_readings(films, instrument, noise)
    surface = (gloss * instrument.seen_surface)[:, None, None]
    body = card_data._replace(reflectance=card_data.reflectance - surface)
    return CardReadings(*(jnp.asarray(values.reshape(-1, 2)) for values in body))


def recover_films(
    films: Films,
    *,
    instrument: InstrumentLike | None = None,
    noise: Noise | None = None,
    chunk: int = CHUNK,
) -> Recovery:
    """Absorption and scattering of paint films, as optical thicknesses k d and s d.

    Args:
        films: measured over a black and a white card.
        instrument: its geometry; by default d:8 with the specular part, refractive index 1.5.
        noise: of a reading; by default estimated from the readings' roughness
            (`glazefit.film.noise.estimate_noise`).
        chunk: films solved at a time.

    Raises:
        ValueError: a card that its own surface or a perfect diffuser contradicts (see
            `glazefit.film.films.cards`), or a film that lacks a reading.
    """
    return Recovery.join(
        list(recover_chunks(films, instrument=instrument, noise=noise, chunk=chunk))
    )


def recover_chunks(
    films: Films,
    *,
    instrument: InstrumentLike | None = None,
    noise: Noise | None = None,
    chunk: int = CHUNK,
) -> Iterator[Recovery]:
    """Recover as `recover_films` does, a few films at a time, so that progress can be shown and an
    interrupt loses little.
    """
    if len(films) == 0:
        raise ValueError("there are no films to recover")
    if not films.complete:
        raise ValueError(
            "film by film, every film needs readings over both cards, and both cards bare: fit "
            "jointly"
        )
    instrument = resolve_instrument(instrument)
    noise = noise or estimate_noise(films)
    cards(films, instrument, noise)  # refuse bad cards before the first chunk
    for first in range(0, len(films), chunk):
        yield _recover_chunk(films.take(slice(first, first + chunk)), instrument, noise, chunk)


def _recover_chunk(films: Films, instrument: Instrument, noise: Noise, chunk: int) -> Recovery:
    count = len(films)
    bands = films.wavelengths.size
    gloss = estimate_gloss(films, instrument, noise)
    # The last chunk is filled up, so that one compiled program serves all.
    spare = (chunk - count) * bands
    data = jax.tree.map(
        lambda a: jnp.pad(a, ((0, spare), (0, 0)), mode="edge"),
        pose(films, gloss, instrument, noise),
    )
    size = chunk * bands
    nothing = ScatteringPrior(jnp.zeros(size), jnp.zeros(size))
    response = film_response(instrument)
    free = solve(data, response, nothing)
    # Where the noise leaves k and s apart, and one solution, both are known.
    contrast = np.asarray(
        (free.fitted[:, 1] - free.fitted[:, 0]) / jnp.linalg.norm(data.sd, axis=1)
    )
    distinct = told_apart(np.asarray(free.optical), np.asarray(free.covariance), contrast)
    identifiable = (distinct & ~np.asarray(free.ambiguous)).reshape(-1, bands)
    # Elsewhere s follows the known bands next to it, and k the ratio.
    mean, weight = neighbours_scattering(
        films.wavelengths,
        np.log(np.asarray(free.optical[:, 1])).reshape(-1, bands),
        identifiable,
        np.asarray(free.least_scattering).reshape(-1, bands),
    )
    prior = ScatteringPrior(jnp.asarray(mean.ravel()), jnp.asarray(weight.ravel()))
    drawn = free if identifiable[:count].all() else solve(data, response, prior)
    chosen = jax.tree.map(
        lambda a, b: np.where(identifiable.ravel().reshape(-1, *[1] * (a.ndim - 1)), a, b),
        free,
        drawn,
    )

    def cut_bands(values: np.ndarray) -> np.ndarray:
        return values.reshape(-1, bands, *values.shape[1:])[:count]

    surface = (gloss * instrument.seen_surface)[:, None]
    return Recovery(
        films=films,
        absorption=cut_bands(chosen.optical[:, 0]),
        scattering=cut_bands(chosen.optical[:, 1]),
        covariance=cut_bands(chosen.covariance),
        identifiable=identifiable[:count],
        gloss=gloss,
        fitted_black=cut_bands(chosen.fitted[:, 0]) + surface,
        fitted_white=cut_bands(chosen.fitted[:, 1]) + surface,
        misfit=cut_bands(chosen.misfit),
        converged=cut_bands(chosen.converged),
        ambiguous=cut_bands(np.asarray(free.ambiguous)),
    )


def neighbours_scattering(
    wavelengths: Float[np.ndarray, "bands"],
    log_scattering: Float[np.ndarray, "films bands"],
    identifiable: Bool[np.ndarray, "films bands"],
    least: Float[np.ndarray, "films bands"],
) -> tuple[Float[np.ndarray, "films bands"], Float[np.ndarray, "films bands"]]:
    """Mean and weight of a prior on log(s d): nothing at known bands, continuity with them
    elsewhere.

    Between known bands log(s d) is interpolated, beyond them continued as a constant, and never
    less than the data allow. A film without any known band gets one value, the least that all its
    bands allow: as thin as it can be.

    Args:
        wavelengths: (bands,), nm.
        log_scattering: log(s d) as fitted, (films, bands).
        identifiable: whether k and s are both determined, (films, bands).
        least: smallest log(s d) that the data allow, (films, bands).
    """
    mean = np.zeros_like(log_scattering)
    for row in range(len(mean)):
        anchors = identifiable[row]
        if anchors.any():
            line = np.interp(wavelengths, wavelengths[anchors], log_scattering[row, anchors])
            mean[row] = np.maximum(line, least[row])
        else:
            mean[row] = least[row].max()
    # A factor of e: it holds where the data are silent, and yields where they speak.
    return mean, np.where(identifiable, 0.0, 1.0)
