"""Noise of readings, estimated from their own roughness.

Spectra of paint and of cards are smooth over some tens of nanometres; an instrument's noise is not.
High differences of neighbouring bands take out what is smooth and leave noise of known size. Edges
of absorption bands leave something too, so the size is fitted with heavy tails, and it may come out
too large, which widens errors, but hardly too small.
"""

import itertools
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from numpy.lib.stride_tricks import sliding_window_view

from glazejax.io.spectra_table import Rows
from glazejax.spectra import Bands

from .films import Films, Noise

MOST = 0.02
"""Largest standard deviation that roughness is taken for; beyond, spectra have structure that is no
noise.
"""

# Readings at which an estimate is held to what it may be at least: a black and a white card's.
_ENDS = (0.05, 0.9)


def estimate_noise(films: Films) -> Noise:
    """Noise of an instrument from the roughness of all its readings, cards and films together;
    `Noise()` at least: errors that all bands share do not show as roughness.
    """
    readings = films.readings()
    everything = _fit_ends(films.wavelengths, readings)
    # Cards are smooth whatever the paint is.
    bare = _fit_ends(films.wavelengths, readings[:2])
    # Films so much rougher than their cards have spectra that are no smooth ones; the cards then
    # say what noise is.
    if everything and bare and np.mean(everything) > 3.0 * np.mean(bare):
        return _at_least(bare)
    return _at_least(everything)


def spectra_noise(wavelengths: Bands, spectra: Rows) -> Noise:
    """Noise of an instrument from the roughness of many spectra of paint.

    Args:
        wavelengths: nm, ascending.
        spectra: reflectance.
    """
    return _at_least(_fit_ends(wavelengths, [spectra]))


def _at_least(estimate: tuple[float, float] | None) -> Noise:
    """Noise from what it is at both ends; `Noise()` where that is not known."""
    if estimate is None:
        return Noise()
    dark, bright = np.maximum(estimate, Noise().sd(np.array(_ENDS)))
    share = max((bright - dark) / (_ENDS[1] - _ENDS[0]), 0.0)
    return Noise(float(min(dark - share * _ENDS[0], MOST)), float(min(share, MOST)))


def _fit_ends(wavelengths: Bands, spectra: Sequence[Rows]) -> tuple[float, float] | None:
    """Noise at both ends that fits roughness best; None if there is none, or bands lie 12 nm apart
    or more: spectra of paint are then rough themselves.
    """
    if wavelengths.size < 2 or np.median(np.diff(wavelengths)) > 12.0:
        return None
    pairs = np.hstack([np.reshape(roughness(wavelengths, rows), (2, -1)) for rows in spectra])
    if not pairs.size:
        return None
    # So many spectra give the noise to a hundredth, and steps of the search are a tenth.
    count = pairs.shape[1]
    chosen = np.linspace(0, count - 1, min(count, 20_000)).astype(int)
    differences, reflectance = pairs[:, chosen]
    # Noise is no less below black.
    reflectance = np.maximum(reflectance, 0.0)

    def cost(noise: tuple[float, float]) -> float:
        """Minus the log likelihood of Student's t with 4 degrees of freedom, whose scale is that of
        Gaussian noise of this size.
        """
        # Scale of such a t that fits standard normal numbers best.
        scale = 0.831 * (noise[0] + noise[1] * reflectance)
        square = (differences / scale) ** 2 / 4.0
        return float(np.sum(np.log(scale) + 2.5 * np.log1p(square)))

    floors = np.geomspace(1e-4, MOST, 48)
    shares = np.r_[0.0, np.geomspace(3e-4, MOST, 24)]
    floor, share = min(itertools.product(floors, shares), key=cost)
    return floor + share * _ENDS[0], floor + share * _ENDS[1]


def roughness(
    wavelengths: Bands, spectra: Rows
) -> tuple[Float[np.ndarray, "rows windows"], Float[np.ndarray, "rows windows"]]:
    """Divided differences of spectra, as large as the noise of one reading, and the mean reading of
    each window.

    Independent noise of standard deviation sd gives differences of standard deviation sd;
    polynomials of a degree below the difference's order give none.
    """
    order = min(6, wavelengths.size - 2)
    if order < 2 or not len(spectra):
        return np.zeros((len(spectra), 0)), np.zeros((len(spectra), 0))
    windows = sliding_window_view(wavelengths, order + 1)
    differences = (windows[:, :, None] - windows[:, None, :]) / (
        windows[:, -1:, None] - windows[:, :1, None]
    )
    weights = 1.0 / np.prod(np.where(np.eye(order + 1, dtype=bool), 1.0, differences), axis=2)
    weights /= np.linalg.norm(weights, axis=1, keepdims=True)
    values = sliding_window_view(spectra, order + 1, axis=1)
    return np.einsum("rwi,wi->rw", values, weights), values.mean(axis=2)


def noise_of_each(readings: Float[np.ndarray, "*n bands"]) -> Float[np.ndarray, "*n"]:
    """Standard deviation of the noise of each spectrum, by itself alone.

    The median size of third differences along the bands, which smooth curves hardly have, at most
    .1; 0 for fewer than 8 bands.
    """
    if readings.shape[-1] < 8:
        return np.zeros(readings.shape[:-1])
    third = np.diff(readings, n=3, axis=-1)
    sd = 1.4826 * np.median(np.abs(third), axis=-1) / np.sqrt(20.0)
    return np.minimum(sd, 0.1)
