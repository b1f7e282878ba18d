"""A page to file: one HTML file without anything from elsewhere, from the record of an
identification.
"""

import json
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from glazejax.io.write import table_bytes, write_files

from ...page.plot import PlotAxes
from ...page.subject import TITLES, beside
from ...page.templates import fill_template
from ..result import percent
from ..search.weigh import REJECTED, UNSEEN
from .explanation import FITS, LEAST
from .record import FAMILY_SCHEMA, Record, table_of_record
from .terminal import micrometres

DRAWN = 60
"""Spots whose spectra are drawn; those of all are in the JSON."""
LISTED = 60
"""Paints of a catalogue that the page lists; those of a larger one are in the JSON."""


def write_page(filed: Record, path: Path, *, overwrite: bool = False) -> tuple[Path, Path]:
    """Write the page, and the same as CSV and JSON next to it: all three, or none.

    Returns:
        Paths of the table and of the JSON.

    Raises:
        FileExistsError: one of the three exists and `overwrite` is false; then none is written.
        ValueError: see `beside`.
    """
    table, data = beside(path)
    text = json.dumps(filed, indent=1, allow_nan=False) + "\n"
    # A spectrum a line; the strings of JSON have no line breaks.
    text = re.sub(
        r"\[\n(?:[-+\d.eE,\s]|null)*\]", lambda numbers: re.sub(r"\s+", " ", numbers[0]), text
    )
    # All is made before anything is written, so that no table accompanies an older page.
    html = "".join(page(filed, table.name, data.name)).encode("utf-8", "xmlcharrefreplace")
    cells = table_bytes(*table_of_record(filed))
    write_files({table: [cells], data: [text.encode()], path: [html]}, overwrite=overwrite)
    return table, data


def page(filed: Record, table: str, data: str) -> Iterator[str]:
    """The page, piece by piece; `table` and `data` are names of the files next to it."""
    by_family = filed["schema"] == FAMILY_SCHEMA
    # Of a spot's tables, what is printed on its page; the screen has all.
    return fill_template(
        f"identify/show/{'family_page' if by_family else 'page'}.html",
        title=f"{'Pigments' if by_family else 'Paint identification'}: {filed['title']}",
        subject={TITLES[name]: text for name, text in filed["subject"].items()},
        record=filed,
        table_name=table,
        data=data,
        most=DRAWN,
        listed=LISTED,
        fits_to_draw=fits_to_draw,
        plot_axes=plot_axes,
        micrometres=_micrometres,
        percent=percent,
        unseen=UNSEEN,
        rejected=REJECTED,
        printed_fits=3,
        printed_paints=8,
    )


def _micrometres(value: float) -> str:
    # Lengths in um beyond which an interval says no more: far below a grain of pigment, and the
    # thickest film there is.
    least = 0.001
    most = 1e4
    if value < least or value > most:
        return f"< {least:g}" if value < least else f"> {most:g}"
    if value >= 0.095:
        return micrometres(value * 1e-6)
    return np.format_float_positional(value, precision=1, fractional=False, trim="-")


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
    # Of an improbable answer no film may have been kept.
    fitted = np.array([fit["fitted"] for fit in fits], dtype=float).reshape(-1, *measured.shape)
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
