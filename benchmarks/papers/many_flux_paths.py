"""Paper C, figure 5: the lobe of light that comes back, beside paths by chance; the time of both at
equal error.
"""

import time
from typing import NamedTuple

import numpy as np

PATHS = 100_000
"""A direction of incidence, as in the paper."""
DIRECTIONS = 303
"""Directions of incidence in the paper."""
BANDS, SECTORS = 13, 24
"""Cells of equal solid angle over the hemisphere: 312, nearly the paper's number."""
ALBEDO, G, THICKNESS, INCIDENCE = 0.8, 0.5, 1.0, 45.0


class Comparison(NamedTuple):
    """Both programs' lobes and times."""

    cosines: np.ndarray  # (bands,) centres
    azimuth: np.ndarray  # (sectors,) centres, degrees
    paths: np.ndarray  # (bands, sectors), reflectance factor
    paths_error: float  # rms of the standard errors over the rms of the factor
    ours: np.ndarray
    ours_error: float
    paths_seconds: float  # for one direction of incidence
    ours_seconds: float  # for all
    tolerance: float


def compare() -> Comparison:
    """Run both."""
    from tests.oracles.monte_carlo import Indexed, simulate_fluxes

    from glazejax.radiative.common.phase import henyey_greenstein
    from glazejax.radiative.manyflux.reflectance import brdf_table

    cosines = (np.arange(BANDS) + 0.5)[::-1] / BANDS
    azimuth = (np.arange(SECTORS) + 0.5) * 360.0 / SECTORS
    one = np.array([ALBEDO]), np.array([THICKNESS]), np.array([G])
    paint = Indexed(*one, np.array([1.0]), 1.0)
    exits: list = []
    start = time.perf_counter()
    simulate_fluxes(paint, float(np.cos(np.deg2rad(INCIDENCE))), PATHS, exits=exits)
    seconds = time.perf_counter() - start
    weight = np.concatenate([w for w, _ in exits])
    direction = np.concatenate([d for _, d in exits])
    band = np.minimum((-direction[:, 2] * BANDS).astype(int), BANDS - 1)
    sector = np.floor(
        np.rad2deg(np.arctan2(direction[:, 1], direction[:, 0])) % 360.0 * SECTORS / 360.0
    ).astype(int)
    cell = (BANDS - 1 - band) * SECTORS + sector % SECTORS
    # pi L/E of a cell: its share of the flux over that of a white Lambertian ground.
    white = np.repeat(2.0 * cosines / BANDS / SECTORS, SECTORS)
    shape, size = (BANDS, SECTORS), BANDS * SECTORS
    factor = np.bincount(cell, weight, size) / PATHS / white
    spread = (
        np.sqrt(np.bincount(cell, weight**2, size) / PATHS - (factor * white) ** 2)
        / np.sqrt(PATHS)
        / white
    )

    def table(tolerance: float, lit: np.ndarray) -> np.ndarray:
        found = brdf_table(
            one[0],
            one[1],
            0.0,
            phase=henyey_greenstein(G),
            refractive_index=1.0,
            cos_incidence=lit,
            cos_viewing=cosines,
            azimuth=azimuth,
            tolerance=tolerance,
        )
        return np.pi * np.asarray(found)

    lit = np.cos(np.deg2rad([INCIDENCE]))
    fine = table(1e-7, lit)[:, 0]
    level = float(np.sqrt(np.mean(fine**2)))
    paths_error = float(np.sqrt(np.mean(spread**2))) / level
    # The coarsest that is no worse than the paths. All directions of incidence are the bands'
    # cosines: turning the plane of incidence changes nothing.
    tolerance, error = 0.3, np.inf
    while error > paths_error:
        tolerance /= 2
        error = float(np.sqrt(np.mean((table(tolerance, lit)[:, 0] - fine) ** 2))) / level
    table(tolerance, cosines)
    runs = []
    for _ in range(5):
        start = time.perf_counter()
        table(tolerance, cosines)
        runs.append(time.perf_counter() - start)
    return Comparison(
        cosines,
        azimuth,
        factor.reshape(shape),
        paths_error,
        fine,
        error,
        seconds,
        min(runs),
        tolerance,
    )
