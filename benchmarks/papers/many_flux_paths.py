"""Paper C, figure 5: the lobe of light that comes back, by many fluxes and by random paths."""

from typing import Any

import numpy as np

PATHS = 100_000
"""A direction of incidence, as in the paper."""
DIRECTIONS = 303
"""Directions of incidence in the paper."""
BANDS, SECTORS = 13, 24
"""Cells of equal solid angle over the hemisphere: 312, nearly the paper's number."""
ALBEDO, G, THICKNESS, INCIDENCE = 0.8, 0.5, 1.0, 45.0
COSINES = (np.arange(BANDS) + 0.5)[::-1] / BANDS
AZIMUTH = (np.arange(SECTORS) + 0.5) * 360.0 / SECTORS
"""Middles of the cells, degrees."""


def lobe_by_paths(cosine: float, paths: int, seed: int = 0) -> np.ndarray:
    """Reflectance factor of the cells, (bands, sectors), for light of one direction."""
    from tests.oracles.monte_carlo import Indexed, simulate_fluxes

    paint = Indexed(np.array([ALBEDO]), np.array([THICKNESS]), np.array([G]), np.array([1.0]), 1.0)
    exits: list = []
    simulate_fluxes(paint, cosine, paths, seed=seed, exits=exits)
    weight, (x, y, z) = (np.concatenate(column, axis=-1) for column in zip(*exits, strict=True))
    band = np.minimum((-z * BANDS).astype(int), BANDS - 1)
    turned = np.rad2deg(np.arctan2(y, x)) % 360.0
    cell = (BANDS - 1 - band) * SECTORS + (turned * SECTORS / 360.0).astype(int) % SECTORS
    # pi L/E of a cell: its share of the flux over that of a white Lambertian ground.
    white = np.repeat(2.0 * COSINES / BANDS / SECTORS, SECTORS)
    return (np.bincount(cell, weight, white.size) / paths / white).reshape(BANDS, SECTORS)


def lobe_by_fluxes(cosines: np.ndarray, azimuth: np.ndarray, **effort: Any) -> np.ndarray:
    """The same by many fluxes for all incidences, (bands, incidences, azimuths)."""
    from glazejax.radiative.common.phase import henyey_greenstein
    from glazejax.radiative.manyflux.reflectance import brdf_table

    found = brdf_table(
        [ALBEDO],
        [THICKNESS],
        0.0,
        phase=henyey_greenstein(G),
        refractive_index=1.0,
        cos_incidence=cosines,
        cos_viewing=COSINES,
        azimuth=azimuth,
        **effort,
    )
    return np.pi * np.asarray(found)


def off(found: np.ndarray, wanted: np.ndarray) -> float:
    """Root mean square difference over the root mean square."""
    return float(np.sqrt(np.mean((found - wanted) ** 2) / np.mean(wanted**2)))
