"""A page to file: one HTML file without anything from elsewhere, from the record of an
identification.
"""

import json
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from glazejax.io.write import table_bytes, write_files

from ...page.templates import fill_template
from ..result import percent
from ..search.weigh import REJECTED, UNSEEN
from .figures import FITS, draw_residuals, draw_spectra
from .record import COLUMNS, table_rows
from .terminal import micrometres

Record = Mapping[str, Any]

DRAWN = 60
"""Spots whose spectra are drawn; those of all are in the JSON."""
LISTED = 60
"""Paints of a catalogue that the page lists; those of a larger one are in the JSON."""


def beside(path: Path) -> tuple[Path, Path]:
    """The table and the JSON that are written with a page.

    Raises:
        ValueError: the page's name does not end in .html.
    """
    if path.suffix != ".html":
        raise ValueError(
            f"--report {path}: a report ends in .html, such as {path.with_suffix('.html')}"
        )
    return path.with_suffix(".csv"), path.with_suffix(".json")


def write_page(record: Record, path: Path, *, overwrite: bool = False) -> tuple[Path, Path]:
    """Write the page, and the same as CSV and JSON beside it; each is there whole or not at all.

    Returns:
        Paths of the table and of the JSON.

    Raises:
        FileExistsError: one of the three exists and `overwrite` is false; then none is written.
        ValueError: see `beside`.
    """
    table, data = beside(path)
    pieces = page(record, table.name, data.name)
    write_report(record, pieces, (COLUMNS, table_rows(record)), path, overwrite=overwrite)
    return table, data


def write_report(
    record: Record,
    pieces: Iterable[str],
    rows: tuple[Sequence[str], Iterable[Sequence[object]]],
    path: Path,
    *,
    overwrite: bool,
) -> None:
    """Write a page, its table and its JSON: all three, or none.

    Args:
        record: the JSON.
        pieces: of the page.
        rows: names of the table's columns, and its rows.
        path: of the page.
        overwrite: whether files that exist may be replaced.

    Raises:
        FileExistsError, ValueError: see `write_page`.
    """
    table, data = beside(path)
    text = json.dumps(record, indent=1, allow_nan=False) + "\n"
    # A spectrum a line; the strings of JSON have no line breaks.
    text = re.sub(r"\[\n[-+\d.eE,\s]*\]", lambda numbers: re.sub(r"\s+", " ", numbers[0]), text)
    # All is made before anything is written, so that no table stands beside an older page.
    shown = "".join(pieces).encode("utf-8", "xmlcharrefreplace")
    cells = table_bytes(*rows)
    write_files({table: [cells], data: [text.encode()], path: [shown]}, overwrite=overwrite)


def page(record: Record, table: str, data: str) -> Iterator[str]:
    """The page, piece by piece; `table` and `data` are names of the files beside it."""
    # Of a spot's tables, what is printed on its page; the screen has all.
    return fill_page(
        "page",
        record,
        table,
        data,
        _draw,
        title=f"Paint identification: {record['title']}",
        micrometres=_micrometres,
        percent=percent,
        unseen=UNSEEN,
        rejected=REJECTED,
        drawn_fits=FITS,
        printed_fits=3,
        printed_paints=8,
    )


def fill_page(
    template: str,
    record: Record,
    table: str,
    data: str,
    draw: Callable[[Record, Record], Mapping[str, Any]],
    **values: Any,
) -> Iterator[str]:
    """A page of spots, piece by piece, the first of them with their spectra.

    Args:
        template: its name in this room.
        record: of the page.
        table, data: names of the files beside it.
        draw: figures of a spot, from the record and the spot.
        values: what else the template uses.
    """
    return fill_template(
        f"identify/show/{template}.html",
        record=record,
        table_name=table,
        data=data,
        spots=_draw_spots(record, draw),
        most=DRAWN,
        listed=LISTED,
        **values,
    )


def _draw_spots(
    record: Record, draw: Callable[[Record, Record], Mapping[str, Any]]
) -> Iterator[tuple[Record, Mapping[str, Any] | None, bool]]:
    """Each spot, its figures if it has any, and whether their drawing was interrupted at it."""
    last = DRAWN
    for number, spot in enumerate(record["spots"]):
        figures = None
        interrupted = False
        try:
            if number < last:
                figures = draw(record, spot)
        except KeyboardInterrupt:
            # What takes long is drawing: an interrupt ends that, and the page is still filed.
            last = number
            interrupted = True
        yield spot, figures, interrupted


def _draw(record: Record, spot: Record) -> Mapping[str, Any]:
    grid = np.asarray(record["measurement"]["wavelengths_nm"])
    grounds = record["measurement"]["grounds"]
    best = np.asarray(spot["explanations"][0]["fitted"])
    return {
        "spectra": draw_spectra(spot, grid, grounds),
        "residuals": draw_residuals(spot, grid, grounds),
        "off": np.abs(np.asarray(spot["measured"]) - best).max(),
    }


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
