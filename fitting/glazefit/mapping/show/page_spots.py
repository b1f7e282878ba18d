"""Spectra that no paints explain, on a map's page: each may be added as a paint."""

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

import numpy as np
from jaxtyping import Float

from glazejax.colour import srgb
from glazejax.plots import hex_colour

from ...page.frame import table_html
from ..store.chunk import SetSum
from .overview import Overview
from .page_sets import share_html, spectra_svg

SPECTRA = "spots.csv"
PAINTS = "paints_with_spots.csv"
"""Files beside the page: readings, and paints for a second map."""


def spots_html(
    look: Overview, spots: Sequence[Mapping[str, Any]], grid: Float[np.ndarray, "bands"]
) -> str:
    """A table of the spots, each with what adds it to the paints; nothing if there are none.

    Args:
        look: the map.
        spots: the map's attribute ``spots``.
        grid: of their readings, nm.
    """
    if not spots:
        return ""
    names = [str(spot["name"]) for spot in spots]
    rows = ""
    for spot in spots:
        reading = np.asarray(spot["reading"], float)
        colour = _swatch(grid, reading)
        y, x = spot["place"]
        alone = SetSum(
            pixels=1, spectrum=reading, fitted=np.full(reading.shape, np.nan), square=reading**2
        )
        others = ",".join(name for name in names if name != spot["name"])
        option = f"--pigments {PAINTS}" + (f" --without {others}" if others else "")
        rows += (
            f'<tr><td><span class="swatch" style="background:{colour}" title="{colour}"></span> '
            f"{escape(str(spot['name']))}</td>"
            f'<td class="n">{share_html(spot["pixels"], look.mapped)}</td>'
            f'<td class="n">{x}, {y}</td>'
            f'<td class="spectrum">{spectra_svg(alone, grid, str(spot["name"]))}</td>'
            f"<td>Add this as a paint: <code>{escape(option)}</code></td></tr>\n"
        )
    head = (
        '<th>Spot</th><th class="n">Share of area</th><th class="n">Purest at x, y</th>'
        "<th>Reflectance</th><th>For a second map</th>"
    )
    return (
        "<h2>Spectra that no paint explains</h2>\n<p>The purest of the pixels that none of these "
        "paints explain, the farthest from the bare ground first. Some may be paints that the "
        "catalogue lacks, some mixtures of them. "
        f"<code>{PAINTS}</code> beside this page has them as paints, with the paints that were "
        "tried. Of each only k/s is told, by its reading as a film that hides the ground; s is the "
        "median of the other paints.</p>\n" + table_html(head, rows, ' id="spots"')
    )


def _swatch(grid: Float[np.ndarray, "bands"], reading: Float[np.ndarray, "bands"]) -> str:
    """Colour of a spectrum, grey where its bands give none."""
    try:
        return hex_colour(np.asarray(srgb(grid, reading)))
    except ValueError:
        return hex_colour(np.full(3, np.sqrt(reading.mean())))
