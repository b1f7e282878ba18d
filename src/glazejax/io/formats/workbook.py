"""Excel workbooks (.xlsx) through openpyxl: a sheet is read as a table of text."""

import csv
import io
import warnings
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

from ...extras import advice
from ...names import nearest_names
from ..finish import RawSpectra
from ..source import HEAD, Source, is_there
from .above import lines_above
from .table import read_columns, read_table

_ENDINGS = (".xlsx", ".xlsm")
# What the sheets may unpack to, and the cells of one.
_MOST_BYTES = 1 << 28
_MOST_CELLS = 5_000_000


def split_sheet(path: Path) -> tuple[Path, str]:
    """File and sheet of ``FILE.xlsx:SHEET``; the sheet is empty where none is named."""
    file, colon, sheet = str(path).rpartition(":")
    if colon and Path(file).suffix.lower() in _ENDINGS and not is_there(path) and is_there(file):
        return Path(file), sheet
    return path, ""


class _Sheet(Source):
    """Cells of a sheet, as a source of lines; line 5 is row 5."""

    def __init__(self, source: Source, rows: list[str]):
        self.path = source.path
        self.notes = source.notes
        self.head = "\n".join(rows).encode()[:HEAD]
        self._rows = rows

    def lines(self, *, damaged: str = "strict") -> Iterator[tuple[int, str]]:
        yield from enumerate(self._rows, start=1)


def read_workbook(source: Source, sheet: str = "") -> RawSpectra:
    """Read reflectance spectra from a sheet of a workbook, as `read_table` reads text.

    Formulas count as the values that were saved with them.

    Args:
        source: the workbook.
        sheet: its name; left out, the first.

    Raises:
        ValueError: openpyxl is missing, it is no workbook or not a whole one, has no such sheet,
            is too large, or the sheet is no legal table.
    """
    try:
        openpyxl = import_module("openpyxl")
    except ImportError:
        raise source.error(f"an Excel workbook: {advice('openpyxl')}") from None
    content = io.BytesIO(source.content())
    with _whole(source), zipfile.ZipFile(content) as archive:
        size = sum(entry.file_size for entry in archive.infolist())
    if size > _MOST_BYTES:
        raise source.error("larger than is read of a workbook; export the sheet as UTF-8 CSV")
    with _whole(source):
        book = openpyxl.load_workbook(content, read_only=True, data_only=True)
        names = [page.title for page in book.worksheets]
    if not names:
        raise source.error("the workbook has no sheet of cells")
    if sheet and sheet not in names:
        near = nearest_names(sheet, names) or names[:6]
        raise source.error(f"there is no sheet {sheet!r}; there are {', '.join(near)}")
    name = sheet or names[0]
    with _whole(source):
        rows = _rows(book.worksheets[names.index(name)])
    if rows is None:
        raise source.error(f"more than {_MOST_CELLS} cells; export the sheet as UTF-8 CSV")
    if len(names) > 1:
        source.notes.append(f"sheet {name!r} was read; there are {', '.join(names[:6])}")
    page = _Sheet(source, rows)
    raw = (read_columns if lines_above(page)[1] else read_table)(page)
    return replace(raw, format=raw.format.replace("TSV table", "Excel workbook"))


@contextmanager
def _whole(source: Source) -> Iterator[None]:
    """What openpyxl, zipfile and their XML say of a damaged file, in one sentence; their warnings
    are of what is not read here.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    except Exception as error:
        raise source.error(
            "not a whole Excel workbook (.xlsx), or another zip archive "
            f"({type(error).__name__}); export the table as UTF-8 CSV"
        ) from None


def _rows(page: Any) -> list[str] | None:
    """Rows of a sheet, separated by tabs; None if there are too many cells."""
    # A sheet may claim any size.
    page.reset_dimensions()
    rows = []
    count = 0
    for row in page.iter_rows(values_only=True):
        count += len(row) + 1
        if count > _MOST_CELLS:
            return None
        words = ["" if cell is None else " ".join(str(cell).split()) for cell in row]
        while words and not words[-1]:
            words.pop()
        text = io.StringIO()
        csv.writer(text, delimiter="\t", lineterminator="").writerow(words)
        rows.append(text.getvalue() if words else "")
    return rows
