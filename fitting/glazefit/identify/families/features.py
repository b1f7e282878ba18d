"""Features that are compared of two spectra of paint from different hands: slopes of -log R and of
log K/S, and the level of the brightest band.

Level, gloss and slope of a reading vary between instruments by more than a pigment's own bands do;
how much of a difference they make is learnt (`metric.py`), not assumed. A spectrum is compared in
two views, as it was read and with its gloss brought to one level. Slopes keep what differs
between pigments: where a band lies and how steep it is. -log R is the natural scale of a thin coat
over a bright ground, log K/S (Kubelka-Munk's remission function) of one that hides its ground.
"""

from typing import TypeAlias

import numpy as np
from jaxtyping import Float

from glazejax import colour
from glazejax.spectra import Bands

Reflectances: TypeAlias = Float[np.ndarray, "*n bands"]
"""Reflectance factors over the bands, of any number of spectra."""
SpectrumFeatures: TypeAlias = Float[np.ndarray, "*n features"]
"""What is compared of spectra (`features`)."""
DARKEST = 0.008
"""What is darker is the surface's reflection or noise."""
# Added to K/S, whose log would make much of how bright a white was read: that of 93 %. Of exemplars
# it is hardly known where they are brighter.
_LEAST_RATIO = 0.003
# What an outer surface adds to a reading at most (index 1.5: 4 %), and what is left in the view
# of one gloss: with less, the noise of a dark paint would pass for its shape.
_MOST_GLOSS, _ONE_GLOSS = 0.05, 0.02
# Slopes of this length together are hardly a shape: a white's or a black's.
_FLAT = 0.1
# Neighbouring bands further apart than this many usual steps have a gap between them.
_GAP = 1.7


def bounded(readings: Reflectances) -> Reflectances:
    """Readings from the darkest on; a spectrum that is brighter than white anywhere is scaled down
    to it.
    """
    return np.maximum(readings / np.maximum(readings.max(axis=-1, keepdims=True), 1.0), DARKEST)


def views(wavelengths: Bands, readings: Reflectances) -> tuple[SpectrumFeatures, SpectrumFeatures]:
    """Features of readings as they are, and with the gloss of all brought to one level.

    Args and shapes as for `features`.
    """
    return features(wavelengths, readings), features(wavelengths, with_one_gloss(readings))


def surface_in(readings: Float[np.ndarray, "n bands"], surface: float) -> Float[np.ndarray, "n"]:
    """Reflectance that a smooth surface, which reflects so much, adds to each reading: that, or
    what its darkest bands leave for it, as of a matte paint or of an instrument other than the
    stated one.
    """
    # The mean of three bands, so that one noisy band does not decide.
    return np.clip(np.sort(readings, axis=1)[:, :3].mean(axis=1), 0.0, surface)


def with_one_gloss(readings: Reflectances) -> Reflectances:
    """Readings less as much as an outer surface may have added to all bands, so that a dark
    paint is the same to an instrument that sees the surface and to one that does not.
    """
    gloss = np.minimum(readings.min(axis=-1, keepdims=True), _MOST_GLOSS)
    return readings - gloss + _ONE_GLOSS


def colours(
    wavelengths: Bands, readings: Float[np.ndarray, "n bands"]
) -> Float[np.ndarray, "n 3"] | None:
    """Colours with one gloss under D65 in a space of nearly equal steps: CIELAB with its chroma
    compressed as CIE94 weighs it; None where less than most of the visible range was read.

    Args and shapes as for `features`.
    """
    if wavelengths[0] > 430.0 or wavelengths[-1] < 680.0:
        return None
    grid = np.arange(400.0, 701.0, 10.0)
    body = with_one_gloss(readings)
    visible = np.stack([np.interp(grid, wavelengths, row) for row in body])
    lab = np.asarray(colour.lab(grid, np.clip(visible, 0.0, 1.0)))
    chroma = np.hypot(lab[:, 1:2], lab[:, 2:])
    # The integral of CIE94's 1 / (1 + .045 C): steps of chroma as they are seen.
    smaller = np.log1p(0.045 * chroma) / (0.045 * np.maximum(chroma, 1e-9))
    return np.concatenate([lab[:, :1], smaller * lab[:, 1:]], axis=1)


def features(wavelengths: Bands, readings: Reflectances) -> SpectrumFeatures:
    """Slopes of -log R, then of log K/S, each between neighbouring bands; the same brought to one
    length, which a tint and a thin coat leave as it is; last -log R of the brightest band.

    Args:
        wavelengths: (bands,), nm, ascending; there may be gaps.
        readings: reflectance factors, (..., bands).
    """
    values = bounded(readings)
    step = np.diff(wavelengths)
    near = step <= _GAP * np.median(step)
    absorbance = -np.log(values)
    # (1 - R)^2 / 2 R, Kubelka and Munk's K/S of a film that hides its ground.
    ratio = np.log((1.0 - values) ** 2 / (2.0 * values) + _LEAST_RATIO)
    slopes = [np.diff(curve, axis=-1)[..., near] for curve in (absorbance, ratio)]
    # Of one length, but that slopes without any shape stay small.
    shapes = [
        slope / np.sqrt(np.sum(slope**2, axis=-1, keepdims=True) + _FLAT**2) for slope in slopes
    ]
    return np.concatenate([*slopes, *shapes, absorbance.min(axis=-1, keepdims=True)], axis=-1)


def at_brightness_of(reading: Bands, film: Bands) -> tuple[Bands, float]:
    """A computed film at the gloss and brightness of a reading, at the bands that are compared, and
    what its brightness was multiplied by.

    Args:
        reading: reflectance factors.
        film: the same; where it is not known, NaN or held as at the last band that is.
    """
    finite = np.flatnonzero(np.isfinite(film))
    changes = np.flatnonzero(np.diff(film[finite]))
    compared = finite[changes[0] : changes[-1] + 2] if changes.size else finite
    # Both as the search compares them, their gloss at one level.
    body = with_one_gloss(reading[compared])
    film_body = with_one_gloss(film[compared])
    scale = float(body @ film_body / (film_body @ film_body))
    out = np.full(film.shape, np.nan)
    out[compared] = reading[compared] - body + scale * film_body
    return out, scale


def relative_misfit(reading: Bands, film: Bands) -> Bands:
    """A reading less a film at its gloss and brightness, in shares of the reading's brightest band
    above its gloss; args as for `at_brightness_of`.
    """
    return (reading - at_brightness_of(reading, film)[0]) / brightest(reading)


def brightest(reading: Bands) -> float:
    """Unit of a reading's misfits: its brightest band, its gloss at one level."""
    return float(with_one_gloss(reading).max())
