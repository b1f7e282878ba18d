"""From films over black and white to absorption and scattering, at every wavelength.

Each band of each film is a film of its own of one coat of unknown paint (`film.forward`): two
readings, two unknowns, log(k d) and log(s d). All of them are solved side by side in one compiled
program, Levenberg and Marquardt's steps on readings over their errors (`film.errors`), in chunks of
films so that progress shows and an interrupt keeps what is finished.

Two films over the same cards can have two solutions, so the fit starts from the two best local
minima on a grid (`FilmResponse`) and keeps the better.

Where a film is opaque only k/s is known. There s d is drawn to its neighbours
(`neighbours_scattering`) and k d follows from the ratio; the band is flagged.
"""

import functools
from collections.abc import Iterator
from typing import NamedTuple, TypeAlias

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from glazejax.geometry import resolve_instrument
from glazejax.programs import Program
from glazejax.radiative.common.linalg import inverse_positive
from glazejax.spectra import Bands

from ...film.errors import ScaledReadings
from ...film.films import CardReadings, Films, Instrument, InstrumentLike, Noise, card_readings
from ...film.forward import OPAQUE_THICKNESS, Film, FilmData, FilmShared, pose_each_band
from ...film.gloss import estimate_gloss
from ...film.noise import estimate_noise
from ...film.numerics.least_squares import levenberg_marquardt
from .result import FilmFlags, FilmSpectra, PerFilm, Recovery, told_apart

CHUNK = 8
"""Films a chunk."""
ExpectedScattering: TypeAlias = Float[Array | np.ndarray, "*bands"]
"""Log(s d) expected at each band, with a standard deviation of 1; NaN for nothing."""


class BandStart(NamedTuple):
    """Start of the fit of one band."""

    logs: Float[Array, "*bands 2 2"]  # two points, log k d and log s d
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


def starts(
    scaled: ScaledReadings, data: FilmData, shared: FilmShared, expected: ExpectedScattering
) -> BandStart:
    """Starting points of one band: the two lowest local minima of a grid (the lowest twice if there
    is one only).

    Between neighbouring values of k d residuals are interpolated, since the valley of equal k/s is
    narrow.
    """
    # So dense in k d and in s d that no minimum is missed.
    log_absorption, log_scattering = (
        jnp.asarray(np.linspace(np.log(low), np.log(0.8 * high), points), data.sd.dtype)
        for low, high, points in zip((1e-5, 1e-4), OPAQUE_THICKNESS, (80, 44), strict=True)
    )
    nodes = jnp.stack(jnp.meshgrid(log_absorption, log_scattering, indexing="ij"), axis=-1)
    residual = jax.vmap(jax.vmap(lambda logs: scaled(logs, data, shared)))(nodes)
    lower = residual[:-1]
    step = jnp.diff(residual, axis=0)
    share = jnp.clip(
        -jnp.sum(lower * step, axis=-1) / jnp.clip(jnp.sum(step**2, axis=-1), 1e-30), 0.0, 1.0
    )
    cost = jnp.sum((lower + share[..., None] * step) ** 2, axis=-1)
    least = log_scattering[jnp.argmax(jnp.min(cost, axis=0) <= cost.min() + 4.0)]

    # Nothing expected, no pull.
    cost = cost + jnp.where(jnp.isnan(expected), 0.0, log_scattering - expected) ** 2
    columns = cost.shape[1]
    around = jax.lax.reduce_window(cost, jnp.inf, jax.lax.min, (3, 3), (1, 1), "SAME")
    minima = jnp.where(cost <= around, cost, jnp.inf).ravel()
    first = jnp.argmin(cost)
    second = jnp.argmin(minima.at[first].set(jnp.inf))
    second = jnp.where(jnp.isfinite(minima[second]), second, first)
    # A band whose s is given may be so dark that k has no upper limit: then the smallest that will
    # do.
    enough = jnp.argmax((cost <= cost.min() + 4.0).any(axis=1)) * columns
    enough += jnp.argmin(cost[enough // columns])
    first = jnp.where(jnp.isnan(expected), first, enough)
    row, column = jnp.divmod(jnp.stack([first, second]), columns)
    at = log_absorption[row] + share[row, column] * (log_absorption[1] - log_absorption[0])
    points = jnp.stack([at, log_scattering[column]], axis=-1)
    return BandStart(points, least)


@functools.partial(Program, fixed=("film",))
def solve(film: Film, data: FilmData, shared: FilmShared, expected: ExpectedScattering) -> Estimate:
    """Solve every band of a batch, (n,), side by side.

    A weak pull to the start settles directions that the data leave open; it moves a value that they
    determine to half its size by less than a hundredth of its error.

    The covariance is the inverse of the Fisher information, J^T W J, plus a vague prior: a value is
    known to 1 + 5 times itself, so that what the data leave open comes out large, not infinite.
    """
    scaled = ScaledReadings(film)
    start = jax.vmap(lambda data, expected: starts(scaled, data, shared, expected))(data, expected)

    def residuals(
        logs: Array, start: Array, data: FilmData, expected: Array
    ) -> Float[Array, "rows"]:
        nothing = jnp.isnan(expected)
        # In standard deviations per unit of log k d or log s d.
        pull = jnp.where(nothing, 0.05, np.array([0.2, 1.0]))
        centre = jnp.stack([start[0], jnp.where(nothing, start[1], expected)])
        return jnp.concatenate([scaled(logs, data, shared), pull * (logs - centre)])

    # Both starts of a band are bands of their own until the better one is chosen.
    doubled, both_expected = jax.tree.map(lambda a: jnp.repeat(a, 2, axis=0), (data, expected))
    first = start.logs.reshape(-1, 2)
    ends, converged = levenberg_marquardt(
        residuals, first, first, doubled, both_expected, rtol=1e-4, atol=1e-3, max_steps=20
    )
    misfit = jnp.sum(jax.vmap(scaled, in_axes=(0, 0, None))(ends, doubled, shared) ** 2, axis=1)
    # Nothing expected, no pull.
    off = jnp.nan_to_num(ends[:, 1] - both_expected)
    cost = (misfit + off**2).reshape(-1, 2)
    # The first unless the second is better by more than rounding.
    best = jnp.where(cost[:, 1] < cost[:, 0] - 0.01, 1, 0)
    pair = ends.reshape(-1, 2, 2)
    distinct = (jnp.abs(jnp.diff(pair, axis=1)) > 0.3) & (
        jnp.abs(jnp.diff(jnp.exp(pair), axis=1)) > 0.01
    )

    def choose(values: Array) -> Array:
        return values.reshape(-1, 2, *values.shape[1:])[jnp.arange(len(best)), best]

    logs = choose(ends)
    optical = jnp.exp(logs)
    # A film beyond hides its ground, and only k/s counts.
    beyond = jnp.max(optical / np.array(OPAQUE_THICKNESS), axis=-1, keepdims=True)
    optical = optical / jnp.maximum(beyond, 1.0)
    slopes = jax.vmap(scaled.slopes, in_axes=(0, 0, None))(logs, data, shared) / optical[:, None]
    fisher = jnp.einsum("nci,ncj->nij", slopes, slopes)
    return Estimate(
        optical=optical,
        covariance=inverse_positive(fisher + jnp.eye(2) / (1.0 + 5.0 * optical[:, :, None]) ** 2),
        fitted=jax.vmap(film.read, in_axes=(0, 0, None))(logs, data, shared)[:, 0],
        misfit=choose(misfit),
        converged=choose(converged),
        ambiguous=distinct.any(axis=(1, 2)) & (jnp.abs(cost[:, 1] - cost[:, 0]) < 4.0),
        least_scattering=start.least_scattering,
    )


def pose(
    films: Films, gloss: PerFilm, instrument: Instrument, noise: Noise
) -> tuple[Film, FilmData, FilmShared]:
    """Problems of all bands of some films, (films * bands,), without the surface's part; unknown
    are log k d and log s d.
    """
    card_data = card_readings(films, instrument, noise)
    surface = (gloss * instrument.seen_surface)[:, None, None]
    body = card_data._replace(reflectance=card_data.reflectance - surface)
    by_band = CardReadings(*(values.reshape(-1, 2) for values in body))
    return pose_each_band(instrument, 0.0, np.eye(2), by_band)


def recover_films(
    films: Films,
    *,
    instrument: InstrumentLike | None = None,
    noise: Noise | None = None,
) -> Recovery:
    """Absorption and scattering of paint films, as optical thicknesses k d and s d.

    Args:
        films: measured over a black and a white card.
        instrument: its geometry; by default d:8 with the specular part, refractive index 1.5.
        noise: of a reading; by default estimated from the readings' roughness
            (`glazefit.film.noise.estimate_noise`).

    Raises:
        ValueError: a card that its own surface or a perfect diffuser contradicts (see
            `glazefit.film.films.card_readings`), or a film that lacks a reading.
    """
    return Recovery.join(films, list(recover_chunks(films, instrument=instrument, noise=noise)))


def recover_chunks(
    films: Films,
    *,
    instrument: InstrumentLike | None = None,
    noise: Noise | None = None,
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
    card_readings(films, instrument, noise)  # refuse bad cards before the first chunk
    for first in range(0, len(films), CHUNK):
        yield _recover_chunk(films.take(slice(first, first + CHUNK)), instrument, noise)


def _recover_chunk(films: Films, instrument: Instrument, noise: Noise) -> Recovery:
    count = len(films)
    bands = films.wavelengths.size
    gloss = estimate_gloss(films, instrument, noise)
    size = CHUNK * bands
    film, data, shared = pose(films, gloss, instrument, noise)
    # The last chunk is filled up, so that one compiled program serves all.
    rows = np.minimum(np.arange(size), count * bands - 1)
    data = jax.tree.map(lambda values: values[rows], data)

    def by_film(values: Array) -> np.ndarray:
        return np.reshape(values, (CHUNK, bands, *values.shape[1:]))[:count]

    free = chosen = jax.tree.map(by_film, solve(film, data, shared, np.full(size, np.nan)))
    # Where the noise leaves k and s apart, and one solution, both are known.
    noise_sd = np.linalg.norm(by_film(data.sd)[:, :, 0], axis=2)
    contrast = (free.fitted[..., 1] - free.fitted[..., 0]) / noise_sd
    identifiable = told_apart(free.optical, free.covariance, contrast) & ~free.ambiguous
    # Elsewhere s follows the known bands next to it, and k the ratio. Of known bands nothing is
    # expected, so that they end where they did.
    if not identifiable.all():
        expected = neighbours_scattering(
            films.wavelengths,
            np.log(free.optical[..., 1]),
            identifiable,
            free.least_scattering,
        )
        chosen = jax.tree.map(by_film, solve(film, data, shared, expected.ravel()[rows]))
    surface = (gloss * instrument.seen_surface)[:, None]
    return Recovery(
        films=films,
        absorption=chosen.optical[..., 0],
        scattering=chosen.optical[..., 1],
        covariance=chosen.covariance,
        identifiable=identifiable,
        gloss=gloss,
        fitted_black=chosen.fitted[..., 0] + surface,
        fitted_white=chosen.fitted[..., 1] + surface,
        misfit=chosen.misfit,
        converged=chosen.converged,
        ambiguous=free.ambiguous,
    )


def neighbours_scattering(
    wavelengths: Bands,
    log_scattering: FilmSpectra,
    identifiable: FilmFlags,
    least: FilmSpectra,
) -> FilmSpectra:
    """Log(s d) expected where it is not known, by continuity with the known bands; NaN at these.

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
    # To a factor of e: it holds where the data are silent, and yields where they speak.
    return np.where(identifiable, np.nan, mean)
