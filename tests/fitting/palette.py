"""Made-up paints with smooth spectra: a white, a black, a red, a yellow and a blue; and films."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from glazefit import Films
from glazejax import Pigment

GRID = np.arange(400.0, 701.0, 20.0)


def _edge(centre: float, width: float = 25.0) -> np.ndarray:
    return 1.0 / (1.0 + np.exp((GRID - centre) / width))


_COEFFICIENTS = {
    "White": (200.0 + 2000.0 * _edge(400.0, 10.0), 2e5),
    "Black": (np.full(GRID.size, 4e5), 2e4),
    "Red": (1e3 + 2e5 * _edge(580.0), 6e4),
    "Yellow": (5e2 + 1.5e5 * _edge(490.0), 9e4),
    "Blue": (2e3 + 2e5 * np.exp(-(((GRID - 600.0) / 70.0) ** 2)), 3e4),
}
PALETTE = [
    Pigment(name, GRID, absorption, np.full(GRID.size, scattering))
    for name, (absorption, scattering) in _COEFFICIENTS.items()
]


def optical_depths(paints: Sequence[Pigment], amounts: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """k d and s d of films, each (films, bands), by the amount of each paint in m, (films, paints)."""
    known = np.array([[paint.absorption, paint.scattering] for paint in paints])
    absorption, scattering = np.einsum("...p,pcb->c...b", np.asarray(amounts), known)
    return absorption, scattering


def raise_readings(films: Films, by: float | np.ndarray) -> Films:
    """The films, with readings of the paint so much higher over either card."""
    return replace(films, over_black=films.over_black + by, over_white=films.over_white + by)
