"""Readings of all sources on one grid, and what methods compare of them: angles, slopes of -log R
and of Kubelka-Munk's K/S.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float

from glazefit.film.shared_bands import running_mean

GRID = np.arange(380.0, 1701.0, 5.0)
"""Wavelengths on which spectra are compared, nm."""
WHOLE = (415.0, 985.0)
VISIBLE = (415.0, 700.0)
"""Ranges of the tasks, nm: where most sources have bands, and what an eye sees."""
RANGES = {
    "pigment": WHOLE,
    "pigment_visible": VISIBLE,
    "pigment_400": (400.0, 700.0),
    "pigment_380": (380.0, 700.0),
    "pigment_swir": (415.0, 1700.0),
}
"""Task -> bands that are read."""
REACHED = {"pigment_400": 400.0, "pigment_380": 380.0, "pigment_swir": 1690.0}
"""Task -> band that a source must have read to take part: without it the task is another one's."""

# Golden's surface correction: the surface's part in a reading, and its reflectance from inside.
_OUTER, _INNER = 0.03, 0.65
_DARKEST = 0.004
_BRIGHTEST = 0.995


def on_grid(
    wavelengths: Float[np.ndarray, "bands"],
    readings: Float[np.ndarray, "samples bands"],
    grid: Float[np.ndarray, "points"] = GRID,
) -> Float[np.ndarray, "samples points"]:
    """Readings averaged over steps of the grid where they are finer than it, and interpolated where
    they are not; NaN beyond their ends.
    """
    step = float(np.median(np.diff(grid)))
    fine = float(np.median(np.diff(wavelengths))) < 0.7 * step
    out = np.full((len(readings), grid.size), np.nan)
    inside = (grid >= wavelengths[0] - 1e-6) & (grid <= wavelengths[-1] + 1e-6)
    for row, values in enumerate(readings):
        seen = np.isfinite(values)
        if seen.sum() < 3:
            continue
        if fine:
            values = running_mean(wavelengths[seen], values[seen], step)
            out[row, inside] = np.interp(grid[inside], wavelengths[seen], values)
        else:
            out[row, inside] = np.interp(grid[inside], wavelengths[seen], values[seen])
    return out


def within(
    limits: tuple[float, float], grid: Float[np.ndarray, "points"] = GRID
) -> Bool[np.ndarray, "points"]:
    """Which points lie within two wavelengths."""
    return (grid >= limits[0]) & (grid <= limits[1])


def bounded(readings: Float[np.ndarray, "*n bands"]) -> Float[np.ndarray, "*n bands"]:
    """Readings whose brightest band is at most a white's: the level of a reading is not known to
    better than that where a probe was held by hand.
    """
    top = np.nanmax(readings, axis=-1, keepdims=True)
    return np.clip(readings * np.minimum(1.0, _BRIGHTEST / top), _DARKEST, _BRIGHTEST)


def absorbance(readings: Float[np.ndarray, "*n bands"]) -> Float[np.ndarray, "*n bands"]:
    """-log R."""
    return -np.log(bounded(readings))


def log_ratio(readings: Float[np.ndarray, "*n bands"]) -> Float[np.ndarray, "*n bands"]:
    """log K/S of a film that hides its ground, by Kubelka-Munk."""
    return np.log(hiding_ratio(bounded(readings)))


def hiding_ratio(reflectance: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
    """K/S of a film that hides its ground, from its reflectance inside, by Kubelka-Munk."""
    return (1.0 - reflectance) ** 2 / (2.0 * reflectance)


def hiding_reflectance(ratio: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
    """Reflectance inside of a film that hides its ground, from its K/S."""
    return 1.0 + ratio - np.sqrt(ratio**2 + 2.0 * ratio)


def slopes(values: Float[np.ndarray, "*n bands"]) -> Float[np.ndarray, "*n less"]:
    """Differences of neighbouring bands after a running mean over three; shorter by three."""
    smooth = (values[..., :-2] + values[..., 1:-1] + values[..., 2:]) / 3.0
    return np.diff(smooth, axis=-1)


def cosine_distance(
    one: Float[np.ndarray, "n bands"], other: Float[np.ndarray, "m bands"], least: int = 30
) -> Float[np.ndarray, "n m"]:
    """One minus the cosine between rows, over the bands that both have (NaN elsewhere).

    Infinite where they share fewer than `least` bands.
    """
    seen = np.isfinite(one)
    seen_other = np.isfinite(other)
    if seen.all() and seen_other.all() and one.shape[1] >= least:
        # Without a gap one product says all.
        product = _unit(one) @ _unit(other).T
        return np.subtract(1.0, product, out=product)
    a = np.where(seen, one, 0.0)
    b = np.where(seen_other, other, 0.0)
    product = a @ b.T
    norms = np.sqrt((a**2 @ seen_other.T) * (seen @ (b**2).T))
    shared = seen.astype(float) @ seen_other.T.astype(float)
    distance = 1.0 - product / np.maximum(norms, 1e-12)
    return np.where(shared >= least, distance, np.inf)


def _unit(rows: Float[np.ndarray, "n bands"]) -> Float[np.ndarray, "n bands"]:
    """Rows over their length."""
    return rows / np.maximum(np.linalg.norm(rows, axis=1, keepdims=True), 1e-12)


def thick_film_reading(
    absorption: Float[np.ndarray, "*n"], scattering: Float[np.ndarray, "*n"]
) -> Float[np.ndarray, "*n"]:
    """Reading of a film that hides its ground, from Kubelka-Munk's K and S, under the surface
    correction that Golden's numbers were made with (Saunderson, k1 = .03, k2 = .65).
    """
    inside = hiding_reflectance(absorption / scattering)
    return _OUTER + (1.0 - _OUTER) * (1.0 - _INNER) * inside / (1.0 - _INNER * inside)


def finite_columns(tables: Sequence[Float[np.ndarray, "n bands"]]) -> Bool[np.ndarray, "bands"]:
    """Bands that every row of every table has."""
    return np.all([np.isfinite(table).all(axis=0) for table in tables], axis=0)


def complete_rows(readings: Float[np.ndarray, "n bands"]) -> Bool[np.ndarray, "n"]:
    """Rows without a missing band."""
    return np.asarray(np.isfinite(readings).all(axis=1))
