"""Workbooks of spreadsheets (.xlsx, .xls, .ods): a sheet is read as a table of text."""

import csv
import io
import zipfile
from collections.abc import Iterator
from dataclasses import replace
from importlib.util import find_spec

from ...extras import advice
from ...names import nearest_names
from ..finish import RawSpectra
from ..source import HEAD, NumberedLine, Source
from .above import find_table
from .cells import MOST_CELLS, read_cells
from .table import read_table

# What the sheets may unpack to.
_MOST_BYTES = 1 << 28


class _Sheet(Source):
    """Cells of a sheet, as a source of lines; line 5 is row 5."""

    def __init__(self, source: Source, cells: list[list[str]]):
        self.path = source.path
        self.notes = source.notes
        width = max(map(len, cells), default=0)
        self._rows = [_line([*row, *[""] * (width - len(row))] if row else row) for row in cells]
        self.head = "\n".join(self._rows).encode()[:HEAD]
        self.is_cut = len(self.head) == HEAD

    def lines(self, *, above: int = 0) -> Iterator[NumberedLine]:
        yield from enumerate(self._rows, start=1)


def read_workbook(source: Source, sheet: str = "") -> RawSpectra:
    """Read reflectance spectra from a sheet of a workbook, as `read_table` reads text.

    Formulas count as the values that were saved with them.

    Args:
        source: the workbook.
        sheet: its name; left out, the first that holds a table of spectra.

    Raises:
        ValueError: python-calamine is missing, it is no workbook or not a whole one, has no such
            sheet, is too large, or the sheet is no legal table.
    """
    if find_spec("python_calamine") is None:
        raise source.error(f"a workbook: {advice('python_calamine')}")
    content = source.content()
    try:
        size = _size(content)
        names, cells = ([], None) if size > _MOST_BYTES else read_cells(content, sheet)
    except (ValueError, zipfile.BadZipFile, NotImplementedError):
        raise source.error(
            "not a whole workbook (.xlsx, .xls, .ods), one of far too many cells, or another "
            "archive or Office file; export the table as UTF-8 CSV"
        ) from None
    if size > _MOST_BYTES:
        raise source.error("larger than is read of a workbook; export the sheet as UTF-8 CSV")
    if not names:
        raise source.error("the workbook has no sheet of cells")
    if sheet and sheet not in names:
        near = nearest_names(sheet, names) or names[:6]
        raise source.error(f"there is no sheet {sheet!r}; there are {', '.join(near)}")
    if cells is None:
        raise source.error(f"more than {MOST_CELLS} cells; export the sheet as UTF-8 CSV")
    page = _Sheet(source, cells)
    if len(names) > 1:
        listed = ", ".join(names[:6])
        others = [] if sheet else names[1:]
        sheet = sheet or names[0]
        # The first sheet may be on the samples or the instrument.
        while others and not find_table(page).sure:
            sheet = others.pop(0)
            page = _Sheet(source, read_cells(content, sheet)[1] or [])
            if not others and not find_table(page).sure:
                raise source.error(f"no sheet holds a table of spectra; there are {listed}")
        source.notes.append(f"sheet {sheet!r} was read; there are {listed}")
    raw = read_table(page)
    return replace(raw, format=raw.format.replace("TSV table", "workbook"))


def _size(content: bytes) -> int:
    """Bytes that a workbook unpacks to; an old one is not packed."""
    if not content.startswith(b"PK"):
        return len(content)
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        return sum(entry.file_size for entry in archive.infolist())


def _line(words: list[str]) -> str:
    """A row, separated by tabs."""
    text = io.StringIO()
    csv.writer(text, delimiter="\t", lineterminator="").writerow(words)
    return text.getvalue() if words else ""
