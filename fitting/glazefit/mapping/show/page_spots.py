"""Spectra that no paints explain, on a map's page: each may be added as a paint."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from glazejax.plots import hex_colour

from ..store.chunk import Bands, SetSum, true_colour
from .page_sets import small_spectrum

SPECTRA = "spots.csv"
PAINTS = "paints_with_spots.csv"
"""Files next to the page: readings, and paints for a second map."""
REFERENCES = "references.csv"
"""The same of a map by family: readings as references, of which the user says the family."""


def spot_rows(spots: Sequence[Mapping[str, Any]], grid: Bands) -> Iterator[dict[str, Any]]:
    """The map's attribute ``spots`` with a colour and a small spectrum of each.

    Args:
        spots: name, pixels, place and reading of each.
        grid: of their readings, nm.
    """
    for spot in spots:
        reading = np.asarray(spot["reading"], float)
        alone = SetSum(
            pixels=1, spectrum=reading, fitted=np.full(reading.shape, np.nan), square=reading**2
        )
        yield {
            **spot,
            "colour": hex_colour(true_colour(grid, reading[None])[0] / 255),
            "spectrum": small_spectrum(alone, grid),
        }
