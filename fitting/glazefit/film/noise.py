"""How noisy readings are, told from their own roughness.

Spectra of paint and of cards are smooth over some tens of nanometres; an instrument's noise is not.
High differences of neighbouring bands take out what is smooth and leave noise of known size. Edges
of absorption bands leave something too, so the size is fitted with heavy tails, and it may come out
too large, which widens errors, but hardly too small.
"""

import functools
import itertools
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from numpy.lib.stride_tricks import sliding_window_view

from .films import Films, Noise

MOST = 0.02
"""Largest standard deviation that roughness is taken for; beyond, spectra have structure that is no
noise.
"""

MOST_OF_ONE = 0.1
"""The same of a single spectrum, which others cannot tell from an instrument's."""

COARSE = 12.0
"""Step in nm from which spectra of paint are rough themselves: no noise is told from them."""

_FREEDOM = 4.0
# Readings at which an estimate is held to what it may be at least: a black and a white card's.
_ENDS = (0.05, 0.9)
_FLOORS = np.geomspace(1e-4, MOST, 48)
_SHARES = np.concatenate([[0.0], np.geomspace(3e-4, MOST, 24)])
# Differences that are tried at every place of the grid.
_SOME = 20_000


def estimate_noise(films: Films, least: Noise | None = None) -> Noise:
    """Noise of an instrument from the roughness of all its readings, cards and films together.

    Args:
        films: measured.
        least: what it is at least, by default `Noise()`: errors that all bands share do not show as
            roughness.
    """
    least = least or Noise()
    if films.wavelengths.size < 2 or np.median(np.diff(films.wavelengths)) > COARSE:
        return least
    parts = [roughness(films.wavelengths, spectra) for spectra in films.readings()]
    everything = _fit_ends(parts)
    bare = _fit_ends(parts[:2])
    if everything is None:
        return least
    # Cards are smooth whatever the paint is.
    # Films so much rougher than their cards have spectra that are no smooth ones; the cards then
    # say what noise is.
    rough = bare is not None and np.mean(everything) > 3.0 * np.mean(bare)
    found = bare if rough else everything
    assert found is not None
    return _at_least(found, least)


def spectra_noise(
    wavelengths: Float[np.ndarray, "bands"],
    spectra: Float[np.ndarray, "rows bands"],
    least: Noise | None = None,
) -> Noise:
    """Noise of an instrument from the roughness of many spectra of paint.

    Args:
        wavelengths: nm, ascending.
        spectra: reflectance.
        least: what it is at least, by default `Noise()`.
    """
    least = least or Noise()
    if wavelengths.size < 2 or np.median(np.diff(wavelengths)) > COARSE:
        return least
    found = _fit_ends([roughness(wavelengths, spectra)])
    return least if found is None else _at_least(found, least)


def _at_least(found: tuple[float, float], least: Noise) -> Noise:
    """Noise from what it is at both ends."""
    dark, bright = (
        max(value, float(least.sd(np.asarray(end))))
        for value, end in zip(found, _ENDS, strict=True)
    )
    share = max((bright - dark) / (_ENDS[1] - _ENDS[0]), 0.0)
    return Noise(float(min(dark - share * _ENDS[0], MOST)), float(min(share, MOST)))


def _fit_ends(parts: Sequence[tuple[np.ndarray, np.ndarray]]) -> tuple[float, float] | None:
    """Noise at both ends that fits roughness best; None if there is none."""
    differences = np.concatenate([part[0].ravel() for part in parts])
    if not differences.size:
        return None
    level = np.concatenate([part[1].ravel() for part in parts])
    # Some from all over tell about where on the grid the best is; then all are heard, next to it.
    few = np.linspace(0, len(level) - 1, min(len(level), _SOME)).astype(int)
    costs = {
        place: _cost(differences[few], _FLOORS[place[0]] + _SHARES[place[1]] * level[few])
        for place in itertools.product(range(len(_FLOORS)), range(len(_SHARES)))
    }
    best = min(costs, key=lambda place: costs[place])
    if len(few) < len(level):
        best = _descend(best, differences, level)
    floor, share = _FLOORS[best[0]], _SHARES[best[1]]
    return floor + share * _ENDS[0], floor + share * _ENDS[1]


def _descend(
    place: tuple[int, int], differences: Float[np.ndarray, "n"], level: Float[np.ndarray, "n"]
) -> tuple[int, int]:
    """From a place on the grid of noise to the best one that neighbours lead to."""

    @functools.cache
    def cost(floor: int, share: int) -> float:
        if not (0 <= floor < len(_FLOORS) and 0 <= share < len(_SHARES)):
            return np.inf
        return _cost(differences, _FLOORS[floor] + _SHARES[share] * level)

    while True:
        floor, share = place
        around = itertools.product(range(floor - 1, floor + 2), range(share - 1, share + 2))
        best = min(around, key=lambda near: cost(*near))
        if not cost(*best) < cost(*place):
            return place
        place = best


def roughness(
    wavelengths: Float[np.ndarray, "bands"], spectra: Float[np.ndarray, "rows bands"]
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
    apart = (windows[:, :, None] - windows[:, None, :]) / (
        windows[:, -1:, None] - windows[:, :1, None]
    )
    weights = 1.0 / np.prod(np.where(np.eye(order + 1, dtype=bool), 1.0, apart), axis=2)
    weights /= np.linalg.norm(weights, axis=1, keepdims=True)
    values = sliding_window_view(spectra, order + 1, axis=1)
    return np.einsum("rwi,wi->rw", values, weights), values.mean(axis=2)


def noise_of_each(readings: Float[np.ndarray, "*n bands"]) -> Float[np.ndarray, "*n"]:
    """Standard deviation of the noise of each spectrum, where no others tell it.

    The median size of third differences along the bands, which smooth curves hardly have, at most
    `MOST_OF_ONE`; 0 for fewer than 8 bands.
    """
    if readings.shape[-1] < 8:
        return np.zeros(readings.shape[:-1])
    third = np.diff(readings, n=3, axis=-1)
    found = 1.4826 * np.median(np.abs(third), axis=-1) / np.sqrt(20.0)
    return np.minimum(found, MOST_OF_ONE)


def _cost(differences: Float[np.ndarray, "n"], sd: Float[np.ndarray, "n"]) -> float:
    """Minus the log likelihood of Student's t, whose scale is that of Gaussian noise of
    this size.
    """
    scale = _GAUSSIAN * sd
    square = (differences / scale) ** 2 / _FREEDOM
    return float(np.sum(np.log(scale) + 0.5 * (_FREEDOM + 1.0) * np.log1p(square)))


def _gaussian_scale() -> float:
    """Scale of Student's t that fits standard normal numbers best."""
    x = np.linspace(-8.0, 8.0, 4001)
    density = np.exp(-0.5 * x**2)
    density /= density.sum()
    scales = np.linspace(0.6, 1.0, 401)
    worth = [
        np.log(s) + 0.5 * (_FREEDOM + 1) * np.sum(density * np.log1p((x / s) ** 2 / _FREEDOM))
        for s in scales
    ]
    return float(scales[int(np.argmin(worth))])


_GAUSSIAN = _gaussian_scale()
