"""Evidence of a reading for each arrangement of a set of paints, whatever their amounts.

A sum over a grid of amounts. At each node the reading errs by: k and s of the library (as far as
one pure reading determines k/s), a smooth curve of the model's own, the surface, and what amounts
between two nodes would change; further by a gain, and by a share of the area in which a part of
the film is missing: a coat that lies in patches, a mixture that is not stirred well. These two are
integrated in closed form.
"""

from collections.abc import Sequence
from typing import NamedTuple, TypeAlias

import numpy as np
from jaxtyping import Bool, Float
from scipy.interpolate import make_interp_spline
from scipy.special import log_ndtr, log_softmax, logsumexp

from glazejax.spectra import Bands

from ...film.model.errors import model_correlation, paint_covariance, smooth_kernel, whitening
from ..search.fit import FilmNumbers
from ..search.options import IdentificationOptions
from ..search.refine import FilmReadings
from ..search.task import OverGrounds
from .arrangement import Arrangement, PaintNumbers, ways
from .readings import (
    LOG_AMOUNTS,
    NODES,
    CoatedFilms,
    FilmAmounts,
    GridReadings,
    grid_readings,
    node_logs,
)

PaintCurves: TypeAlias = Float[np.ndarray, "paints bands"]
"""k, s or errors of each paint over the bands."""
ReadingsAtPlaces: TypeAlias = Float[np.ndarray, "nodes block bands"]
"""Readings at each place of the finer grid, by the nodes that they are around."""
FilmsAtPlaces: TypeAlias = Float[np.ndarray, "nodes block films"]
"""A number for each film at each of these places."""
# Amounts between two nodes of the solver's grid, by the number of paints; readings between them are
# interpolated by cubic splines.
_FINER = {1: 6, 2: 4, 3: 2}
# k and s are related to the reading of a film that hides its ground as K/S = 2 k / (.75 s).
_RATIO = 2.0 / 0.75
# Errors of a reading when coats are estimated from mixtures. The model's own smooth error: standard
# deviation in reflectance, length over which it stays similar, nm, and correlation between grounds.
_AMPLITUDE = 0.02
_LENGTH = 60.0
_SHARED = 0.6
# Noise of a single band.
_NOISE = 0.003
# Standard deviations of offsets: of the surface's part, the same in all bands, and of bands beyond
# 1 micrometre, which have a detector of their own.
_OFFSET = 0.015
_SECOND_CAMERA = 0.02
# Standard deviations of the relative level -> how probable each is: an instrument that rests on the
# film, and a probe held by hand.
_GAINS = {0.04: 0.95, 0.4: 0.05}
# Standard deviation of log k in addition to what one reading leaves open.
_COEFFICIENT = 0.1
# Standard deviation of the pure paint's reading that k/s was estimated from.
_PURE_READING = 0.01
# Largest standard deviation of log k that counts.
_MOST_COEFFICIENT = 0.7
# Length over which log k errs together, nm.
_COEFFICIENT_LENGTH = 100.0
# Probability that a part of the film is missing in places, and standard deviation of the share of
# the area in which it is.
_PATCHY = 0.1
_PATCH = 0.2
# Factors of all of these together -> how probable each is.
_SCALES = {0.5: 0.25, 1.0: 0.4, 2.0: 0.25, 4.0: 0.1}
SPREAD = 0.9
"""Standard deviation of the log of a coat's thickness."""
# Share of readings whose evidence says nothing of how their paints lie: nearly twice that of the
# decided answers of `benchmarks.paintbench --coats` that were wrong while it was taken to be none.
_WORTHLESS = 0.2
# A library rarely separates k and s of a paint: each paint's scattering may also be so much
# less, with this probability.
_FAINT = 0.1
_FAINT_CHANCE = 0.2


class Evidence(NamedTuple):
    """Evidence of some films for an arrangement.

    Attributes:
        arrangement: how the paints lie.
        log: log evidence of each film.
        log_amounts: mean of the logs of the paints' amounts, in usual ones.
        covariance: of these logs.
        nearest: logs of the most probable amounts.
        readings: at these, without the outer surface's part.
    """

    arrangement: Arrangement
    log: Float[np.ndarray, "films"]
    log_amounts: FilmAmounts
    covariance: Float[np.ndarray, "films paints paints"]
    nearest: FilmAmounts
    readings: FilmReadings


class WeighedSet(NamedTuple):
    """A set of paints for some spectra over one ground, in all ways in which it may lie.

    Attributes:
        members: the paints, by number.
        rows: the spectra.
        evidence: of each way: amounts of the library as it is, readings of the library that meets
            each film best, and a log over all libraries with the prior, which `logs` tempers.
        logs: log of how probable each way is, its prior a part of it, up to what is the same for
            all sets of a spectrum.
    """

    members: PaintNumbers
    rows: FilmNumbers
    evidence: Sequence[Evidence]
    logs: Float[np.ndarray, "ways films"]

    @property
    def layered(self) -> Bool[np.ndarray, "ways"]:
        """True for ways of more than one coat."""
        return np.array([evidence.arrangement.layered for evidence in self.evidence])


def weigh_set(
    members: PaintNumbers,
    rows: FilmNumbers,
    bodies: OverGrounds,
    films: CoatedFilms,
    options: IdentificationOptions,
) -> WeighedSet:
    """All ways in which the paints of a set may lie, with amounts, gain, surface and patches
    integrated out.

    Args:
        members: the set, by number.
        rows: spectra over one ground.
        bodies: of all spectra, without the outer surface's part.
        films: of all paints, over this ground.
        options: of the search.
    """
    films = films._replace(coefficients=films.coefficients[:, list(members)])
    read = bodies[rows].reshape(len(rows), -1)
    chances = ways(len(members), options)
    summed = []
    for arrangement, chance in chances.items():
        by_library = []
        for library, share in _libraries(arrangement, films):
            evidence = weigh_arrangement(read, arrangement, library)
            by_library.append(evidence._replace(log=evidence.log + np.log(chance * share)))
        # The sum over all libraries, and readings of the best one.
        logs = np.array([evidence.log for evidence in by_library])
        readings = np.array([evidence.readings for evidence in by_library])
        best = readings[logs.argmax(axis=0), np.arange(len(rows))]
        summed.append(
            by_library[0]._replace(log=np.asarray(logsumexp(logs, axis=0)), readings=best)
        )
    # What a reading says of the ways is worth less than it says.
    logs = np.array([evidence.log for evidence in summed])
    total = np.asarray(logsumexp(logs, axis=0))
    prior = np.array(list(chances.values()))[:, None]
    tempered = (1.0 - _WORTHLESS) * np.exp(logs - total) + _WORTHLESS * (prior / prior.sum())
    return WeighedSet(members, rows, evidence=summed, logs=np.log(tempered) + total)


def _libraries(arrangement: Arrangement, films: CoatedFilms) -> list[tuple[CoatedFilms, float]]:
    """Films of the library as it is, then of libraries in which one of the paints scatters less,
    and how probable each is.

    A thin coat over a ground that shows rarely separates k from s; of a film that hides its ground
    k/s is what was read.
    """
    if films.hides:
        return [(films, 1.0)]
    out = [(films, 1.0 - _FAINT_CHANCE)]
    for paint in arrangement.paints:
        faint = films.coefficients.copy()
        faint[1, paint] *= _FAINT
        out.append((films._replace(coefficients=faint), _FAINT_CHANCE / len(arrangement.paints)))
    return out


def coefficient_sd(absorption: PaintCurves, scattering: PaintCurves) -> PaintCurves:
    """Standard deviation of log k where an opaque film gave k/s: large where that
    film is nearly black or nearly white.

    By Kubelka and Munk: R = a - sqrt(a^2 - 1), a = 1 + K/S.
    """
    ratio = _RATIO * absorption / scattering
    a = 1.0 + ratio
    # dR / d log(K/S).
    slope = ratio * (a / np.sqrt(np.maximum(a**2 - 1.0, 1e-12)) - 1.0)
    reading_sd = _PURE_READING / np.maximum(slope, 1e-4)
    return np.minimum(np.hypot(_COEFFICIENT, reading_sd), _MOST_COEFFICIENT)


def log_prior(arrangement: Arrangement) -> Float[np.ndarray, "nodes block"]:
    """Log prior probability of each place of the finer grid: each coat's thickness is
    log-normal, the fractions of its paints are uniform.
    """
    paints = arrangement.paints
    logs = _finer(node_logs(len(paints)), len(paints))
    out = np.zeros(logs.shape[:2])
    for coat in arrangement.coats:
        coat_logs = logs[..., [paints.index(paint) for paint in coat]]
        log_total = np.asarray(logsumexp(coat_logs, axis=-1))
        out -= 0.5 * (log_total / SPREAD) ** 2
        # From fractions to logs of amounts: a factor of each fraction.
        if len(coat) > 1:
            out += np.sum(coat_logs - log_total[..., None], axis=-1)
    return log_softmax(out)


def _finer(
    values: Float[np.ndarray, "nodes numbers"], count: int
) -> Float[np.ndarray, "nodes block numbers"]:
    """Values at the places of the finer grid around each node, by cubic splines.

    Args:
        values: at the nodes; they go on beyond the first and the last.
        count: of paints.
    """
    nodes = np.linspace(*LOG_AMOUNTS, NODES[count])
    offsets = (np.arange(_FINER[count]) + 0.5) / _FINER[count] - 0.5
    along = nodes[:, None] + offsets * (nodes[1] - nodes[0])
    weights = make_interp_spline(nodes, np.eye(nodes.size))(along)
    box = values.reshape(*[nodes.size] * count, -1)
    # Each amount's axis becomes two at the end: the nodes, and the places around each.
    for _ in range(count):
        box = np.tensordot(box, weights, axes=(0, 2))
    axes = range(1, 2 * count + 1)
    return box.transpose(*axes[::2], *axes[1::2], 0).reshape(len(values), -1, values.shape[1])


def weigh_arrangement(
    bodies: FilmReadings, arrangement: Arrangement, films: CoatedFilms
) -> Evidence:
    """Evidence of some readings for one arrangement.

    Args:
        bodies: readings over each ground, ground by ground, without the outer surface's part.
        arrangement: how the paints lie.
        films: of the set's paints, over these grounds.
    """
    table = grid_readings(arrangement, films)
    deviations = coefficient_sd(*films.coefficients)[list(arrangement.paints)]
    count = len(deviations)

    # Errors at each node of the coarse grid.
    covariance = _covariance(table, deviations, films.wavelengths)
    white = whitening(covariance).basis
    to_white = np.swapaxes(white, 1, 2)

    # Each place of the finer grid takes the errors of its node.
    readings = _finer(table.readings, count)
    log_likelihood = _log_likelihood(
        bodies @ to_white,
        readings @ to_white,
        [(_finer(patch, count) - readings) @ to_white for patch in table.patches],
    )
    log_likelihood += np.log(np.diagonal(white, axis1=1, axis2=2)).sum(axis=1)[:, None, None]

    posterior = (log_likelihood + log_prior(arrangement)[..., None]).reshape(-1, len(bodies))
    total = np.asarray(logsumexp(posterior, axis=0))
    share = np.exp(posterior - total)
    logs = _finer(node_logs(count), count).reshape(-1, count)
    mean = share.T @ logs
    square = np.einsum("nf,ni,nj->fij", share, logs, logs, optimize=True)
    best = np.argmax(posterior, axis=0)
    return Evidence(
        arrangement=arrangement,
        log=total,
        log_amounts=mean,
        covariance=square - mean[:, :, None] * mean[:, None, :],
        nearest=logs[best],
        readings=readings.reshape(len(logs), -1)[best],
    )


def _covariance(
    table: GridReadings, deviations: PaintCurves, wavelengths: Bands
) -> Float[np.ndarray, "nodes readings readings"]:
    """Of the readings at each node of the coarse grid, gain and patches aside."""
    count = len(deviations)
    readings = table.readings.shape[-1]
    grounds = readings // wavelengths.size
    fixed = fixed_covariance(wavelengths, grounds)
    # What errors of each paint's k cause, the same ones over each ground.
    kernel = smooth_kernel(np.tile(wavelengths, grounds), _COEFFICIENT_LENGTH)
    covariance = fixed + paint_covariance(table.slopes * np.tile(deviations, grounds), kernel)

    # What amounts between the places of the finer grid would change.
    spacing = (LOG_AMOUNTS[1] - LOG_AMOUNTS[0]) / (NODES[count] - 1)
    between = spacing / _FINER[count]
    box = table.readings.reshape(*[NODES[count]] * count, readings)
    for axis in range(count):
        change = np.gradient(box, spacing, axis=axis).reshape(-1, readings) * (0.6 * between)
        covariance += change[:, :, None] * change[:, None, :]
    return covariance


def fixed_covariance(wavelengths: Bands, grounds: int) -> Float[np.ndarray, "readings readings"]:
    """Of readings over some grounds, whatever the film: the model's own error, noise, surface."""
    bands = grounds * wavelengths.size
    fixed = _AMPLITUDE**2 * model_correlation(wavelengths, grounds, _LENGTH, _SHARED)
    fixed += _NOISE**2 * np.eye(bands) + _OFFSET**2
    # Bands beyond this, nm, are another detector's.
    beyond = np.tile(wavelengths > 1005.0, grounds)
    if beyond.any() and not beyond.all():
        fixed += _SECOND_CAMERA**2 * np.outer(beyond, beyond)
    return fixed


def _log_likelihood(
    readings: Float[np.ndarray, "nodes films bands"],
    computed: ReadingsAtPlaces,
    patches: Sequence[ReadingsAtPlaces],
) -> FilmsAtPlaces:
    """Of films at places whose errors are those of their node; readings are whitened by these.

    Args:
        readings: readings of the films.
        computed: at the places.
        patches: what a part that is missing everywhere would change.
    """
    films = np.swapaxes(readings, 1, 2)
    size = np.sum(computed**2, axis=-1)[..., None]
    across = computed @ films
    off = np.sum(readings**2, axis=-1)[:, None] - 2.0 * across + size
    along = across - size
    # Nothing is missing, or a part of one of the patches.
    missing = [(1.0 - _PATCHY if patches else 1.0, None)]
    missing += [(_PATCHY / len(patches), patch) for patch in patches]
    terms = []
    for gain, gain_weight in _GAINS.items():
        # The gain is Gaussian: its direction is taken out, and its volume counted.
        volume = 1.0 + gain**2 * size
        misfit = off - gain**2 * along**2 / volume
        for chance, patch in missing:
            length = product = np.zeros(())
            if patch is not None:
                with_gain = np.sum(patch * computed, axis=-1)[..., None]
                length = np.sum(patch**2, axis=-1)[..., None] - gain**2 * with_gain**2 / volume
                product = patch @ films - with_gain - gain**2 * with_gain * along / volume
            # All errors larger or smaller by each scale; without a patch its integral is 1.
            for scale, weight in _SCALES.items():
                better = _log_patch(length / scale**2, product / scale**2)
                log_volume = 0.5 * np.log(volume) + readings.shape[-1] * np.log(scale)
                value = -0.5 * misfit / scale**2 - log_volume + better
                terms.append(value + np.log(gain_weight * chance * weight))
    return np.asarray(logsumexp(terms, axis=0))


def _log_patch(
    length: Float[np.ndarray, "nodes block #films"], product: FilmsAtPlaces
) -> FilmsAtPlaces:
    """Log of the integral over a share above 0, half a Gaussian a priori, of how much better it
    meets a film.
    """
    precision = length + 1.0 / _PATCH**2
    mean = product / precision
    log_mass = log_ndtr(mean * np.sqrt(precision))
    return np.log(2.0 / _PATCH) + 0.5 * mean**2 * precision - 0.5 * np.log(precision) + log_mass
