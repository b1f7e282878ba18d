"""Tables of results out; a file that exists is replaced only if asked for."""

import csv
import io
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path

import numpy as np

from ..whole_file import whole_file
from .outputs import check_output
from .source import naming
from .words import shield_name


def write_table(
    path: str | Path,
    header: Sequence[str],
    rows: Iterable[Sequence[object]],
    *,
    overwrite: bool = False,
) -> None:
    """Write a table as CSV, or tab separated if the name ends in .tsv.

    Nothing is written unless every row fits the header.

    Args:
        path: file to write; its folder must exist.
        header: titles of the columns.
        rows: cells of each row; numbers are written so that they read back exactly, texts that
            begin with = + - or @ with an apostrophe before them.
        overwrite: whether a file that exists may be replaced.

    Raises:
        FileExistsError: the file exists and `overwrite` is false.
        FileNotFoundError: its folder does not exist.
        IsADirectoryError: it is a folder.
        ValueError: a row has another number of cells than the header.
    """
    path = check_output(path, overwrite=overwrite)
    with naming(path):
        content = table_bytes(
            header, rows, delimiter="\t" if path.suffix.lower() == ".tsv" else ","
        )
    with whole_file(path) as temporary:
        temporary.write_bytes(content)


def table_bytes(
    header: Sequence[str], rows: Iterable[Sequence[object]], *, delimiter: str = ","
) -> bytes:
    """A table as `write_table` writes it.

    Raises:
        ValueError: a row has another number of cells than the header.
    """
    text = io.StringIO()
    write_row = row_writer(text, delimiter)
    write_row([_plain(title) for title in header])
    for number, row in enumerate(rows, start=1):
        if len(row) != len(header):
            raise ValueError(
                f"row {number} has {len(row)} cells where the header has {len(header)}"
            )
        write_row([_plain(cell) for cell in row])
    return text.getvalue().encode("utf-8")


def row_writer(text: io.StringIO, delimiter: str = ",") -> Callable[[Sequence[object]], None]:
    """A function that adds a row of cells to a table's text, so that it is read as one.

    Args:
        text: what it is added to.
        delimiter: between cells.
    """
    plain, quoted = (
        csv.writer(text, delimiter=delimiter, lineterminator="\n", quoting=quoting)
        for quoting in (csv.QUOTE_MINIMAL, csv.QUOTE_ALL)
    )

    def write_row(cells: Sequence[object]) -> None:
        # A line that begins with # is a comment, one that begins with a quotation mark is not.
        (quoted if cells and str(cells[0]).startswith("#") else plain).writerow(cells)

    return write_row


def _plain(cell: object) -> object:
    """Array scalars as Python's own, which print all their digits whatever NumPy's print options
    are; texts that no spreadsheet takes for a formula.
    """
    if isinstance(cell, str):
        return shield_name(cell)
    if not hasattr(cell, "dtype"):
        return cell
    scalar = np.asarray(cell)[()]
    # The shortest number that reads back as this one, in its own precision.
    return (
        float(np.format_float_scientific(scalar))
        if isinstance(scalar, np.floating)
        else scalar.item()
    )


def write_files(files: Mapping[Path, Iterable[bytes]], *, overwrite: bool = False) -> None:
    """Write all files or, if one may not or cannot be written, none; a file is there whole or not
    at all. What is no file, such as a pipe or a link, is written as it comes.

    Args:
        files: content of each, in pieces.
        overwrite: whether files that exist may be replaced.

    Raises:
        FileExistsError, FileNotFoundError, IsADirectoryError: see
            `glazejax.io.outputs.check_output`.
    """
    for path in files:
        check_output(path, overwrite=overwrite)
    with ExitStack() as stack:
        # None takes its name before all are written.
        for path, pieces in files.items():
            written = stack.enter_context(whole_file(path))
            with written.open("wb") as file:
                file.writelines(pieces)
