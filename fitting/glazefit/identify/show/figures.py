"""Plots of a spot on a page: which fits are drawn, and axes that hold them."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...page.plot import PlotAxes
from .explanation import LEAST
from .record import Record

FITS = 3
"""Explanations that are drawn, at most."""


def fits_to_draw(explanations: Sequence[Record]) -> list[Record]:
    """The first explanations of a spot that are worth a line."""
    return [
        explanation
        for explanation in explanations[:FITS]
        if explanation["probability"] >= LEAST * explanations[0]["probability"]
    ]


def plot_axes(record: Record, spot: Record) -> dict[str, Any]:
    """Axes of the spectra and of what the fits leave, and that itself, (fits, grounds, bands)."""
    grid = np.asarray(record["measurement"]["wavelengths_nm"])
    measured = np.asarray(spot["measured"])
    fits = fits_to_draw(spot["explanations"])
    fitted = np.array([fit["fitted"] for fit in fits], dtype=float)
    residuals = measured - fitted
    usual = np.array(spot.get("usual_band") or 0.0, dtype=float)
    high = np.nanmax([*fitted.ravel(), *measured.ravel(), *(measured + usual).ravel()])
    off = float(np.nanmax(np.abs(residuals), initial=0.0))
    # A band that is far wider than what is left fills the plot, so that what is left can be seen.
    band = float(np.max(fits[0].get("band_90") or 0.0)) if fits else 0.0
    most = max(1.15 * off, min(1.05 * band, 5.0 * off), 0.01)
    return {
        "spectra": PlotAxes(grid=grid, low=0.0, high=max(0.01, 1.05 * float(high))),
        # Several grounds have a low plot each.
        "residuals": PlotAxes(grid=grid, low=-most, high=most, most=7 if len(measured) == 1 else 5),
        "left": residuals,
        "off": float(np.nanmax(np.abs(residuals[:1]), initial=0.0)),
    }
