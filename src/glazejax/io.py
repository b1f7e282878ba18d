"""Tables of spectra in, tables of results out; every error is one line that names file, line and column."""

import csv
import io
import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from jaxtyping import Float

from .spectra import as_fraction, describe_grid, validate_wavelengths

_WAVELENGTH_TITLE = re.compile(r"^(wave\s*length|wl\b|wvl?\b|lambda|λ|nm\b|\[?nm\]?$)", re.IGNORECASE)
_LAYOUTS = "expected 'Name,400,410,...' with a sample a row, or 'wavelength,sample,...' with a sample a column"
_NANOMETRES = re.compile(r"\s*\[?\(?nm\)?\]?$", re.IGNORECASE)


@dataclass(frozen=True)
class SpectraTable:
    """Measured spectra that share a grid.

    Attributes:
        wavelengths: (bands,), nm, ascending.
        names: one a row, all different.
        reflectance: (rows, bands), fraction.
        notes: sentences on what the reader changed or noticed.
    """

    wavelengths: Float[np.ndarray, "bands"]
    names: tuple[str, ...]
    reflectance: Float[np.ndarray, "rows bands"]
    notes: list[str] = field(default_factory=list)

    def __len__(self) -> int:
        return len(self.names)

    def __getitem__(self, name: str) -> Float[np.ndarray, "bands"]:
        """Spectrum of one sample; KeyError if there is none of that name."""
        if name not in self.names:
            raise KeyError(f"no spectrum is called {name!r}")
        return self.reflectance[self.names.index(name)]

    def __repr__(self) -> str:
        return f"SpectraTable({len(self)} spectra, {describe_grid(self.wavelengths)})"


@dataclass(frozen=True)
class _Cells:
    """Table cut into cells: the header, and each row with its line number."""

    path: Path
    delimiter: str
    header_line: int
    header: list[str]
    rows: list[tuple[int, list[str]]]

    def error(self, line: int, complaint: str) -> ValueError:
        return ValueError(f"{self.path}, line {line}: {complaint}")


def read_spectra(path: str | Path) -> SpectraTable:
    """Read reflectance spectra from a text table.

    Two layouts are told apart by their header: wide, ``Name,400,410,...`` with a sample a row, and long,
    ``wavelength,sample A,sample B,...`` with a sample a column. Cells are separated by tabs, commas,
    semicolons or blanks; wavelengths may carry "nm"; a decimal comma is understood unless commas
    separate; empty lines and lines that start with # are skipped. Values are fractions or percent (see
    `glazejax.spectra.as_fraction`).

    Raises:
        FileNotFoundError: no such file.
        ValueError: the file is empty, not text, has no wavelengths in its header, wavelengths that do not
            ascend, a ragged row, a cell that is not a finite number, a negative value, percent mixed with
            fractions, or two samples of one name. The message is one line and says where.
    """
    cells = _read_cells(Path(path))
    if not cells.rows:
        raise ValueError(f"{cells.path}: there is a header but no data below it")
    names, wavelengths, values = _read_long(cells) if _is_long(cells) else _read_wide(cells)
    try:
        fraction, note = as_fraction(values, names)
    except ValueError as error:
        raise ValueError(f"{cells.path}: {error}") from None
    return SpectraTable(wavelengths, tuple(names), fraction, [] if note is None else [note])


def _read_cells(path: Path) -> _Cells:
    """Cut a text file into cells, all rows as long as the header."""
    if not path.exists():
        raise FileNotFoundError(f"{path}: there is no such file")
    if path.is_dir():
        raise ValueError(f"{path}: this is a folder, not a table of spectra")
    try:
        text = path.read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ValueError(f"{path}: not UTF-8 text (byte {error.start}); export the table as UTF-8 CSV") from None
    if "\0" in text:
        raise ValueError(f"{path}: not a text file; export the table as UTF-8 CSV")
    lines = [
        (number, line)
        for number, line in enumerate(text.splitlines(), start=1)
        if line.strip(" \t,;") and not line.lstrip().startswith("#")
    ]
    if not lines:
        raise ValueError(f"{path}: the file is empty")
    delimiter = _sniff(lines[0][1])
    header = _split(lines[0][1], delimiter)
    while header and not header[-1]:
        header.pop()
    if len(header) < 2:
        raise ValueError(f"{path}, line {lines[0][0]}: the header has one column only; {_LAYOUTS}")
    cells = _Cells(path, delimiter, lines[0][0], header, [])
    for number, line in lines[1:]:
        row = _split(line, delimiter)
        while len(row) > len(header) and not row[-1]:
            row.pop()
        if len(row) != len(header):
            raise cells.error(number, f"{len(row)} cells where the header has {len(header)}")
        cells.rows.append((number, row))
    return cells


def _sniff(header: str) -> str:
    """Delimiter of a header line; a blank if there is no better one."""
    # Outside quotes only, so that a quoted title may hold a comma.
    bare = re.sub(r'"[^"]*"', "", header)
    counts = {delimiter: bare.count(delimiter) for delimiter in "\t;,"}
    best = max(counts, key=lambda delimiter: counts[delimiter])
    return best if counts[best] else " "


def _split(line: str, delimiter: str) -> list[str]:
    """Cells of a line, without the blanks around them."""
    if delimiter == " ":
        line, skip = line.strip().replace("\t", " "), True
    else:
        skip = False
    reader = csv.reader([line], delimiter=delimiter, skipinitialspace=True)
    cells = [cell.strip() for cell in next(reader, [])]
    return [cell for cell in cells if cell] if skip else cells


def _number(cell: str, delimiter: str) -> float | None:
    """Number in a cell, or None; NaN and infinity count as none here."""
    if delimiter != ",":
        cell = cell.replace(",", ".")
    try:
        value = float(cell)
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def _wavelength(cell: str, delimiter: str) -> float | None:
    """Wavelength in a cell, which may carry its unit, or None."""
    return _number(_NANOMETRES.sub("", cell), delimiter)


def _is_long(cells: _Cells) -> bool:
    """Whether samples are columns; refuses a header that names wavelengths in neither way."""
    titles = [_wavelength(cell, cells.delimiter) for cell in cells.header[1:]]
    numeric = [value for value in titles if value is not None]
    if len(numeric) == len(titles) and _number(cells.header[0], cells.delimiter) is not None:
        raise cells.error(cells.header_line, f"numbers only, where a header should be; {_LAYOUTS}")
    column = [_wavelength(row[0], cells.delimiter) for _, row in cells.rows]
    titled = bool(_WAVELENGTH_TITLE.match(cells.header[0])) and all(value is not None for value in column[:1])
    # Samples may be numbered 1, 2, 3; a wavelength in nm has three digits at least.
    if 2 * len(numeric) > len(titles) and not (titled and max(numeric) < 100):
        return False
    if titled and titles:
        return True
    raise cells.error(cells.header_line, f"no wavelengths in the header; {_LAYOUTS}")


def _check_grid(cells: _Cells, wavelengths: Sequence[float]) -> Float[np.ndarray, "bands"]:
    """Legal grid, or an error that names the file."""
    try:
        return validate_wavelengths(np.asarray(wavelengths))
    except ValueError as error:
        raise ValueError(f"{cells.path}: {error}") from None


def _value(cells: _Cells, line: int, name: str, column: str, cell: str) -> float:
    """Reflectance in a cell, or an error that says where."""
    value = _number(cell, cells.delimiter)
    if value is None:
        problem = "the cell is empty" if not cell else f"{cell!r} is not a finite number"
        raise cells.error(line, f"sample {name!r}, column {column!r}: {problem}")
    if value < 0:
        raise cells.error(line, f"sample {name!r}, column {column!r}: reflectance {cell} is negative")
    return value


def _read_wide(
    cells: _Cells,
) -> tuple[list[str], Float[np.ndarray, "bands"], Float[np.ndarray, "rows bands"]]:
    """Names, wavelengths and values of a table with a sample a row."""
    wavelengths = []
    for title in cells.header[1:]:
        value = _wavelength(title, cells.delimiter)
        if value is None:
            raise cells.error(cells.header_line, f"column {title!r} is not a wavelength in nm")
        wavelengths.append(value)
    grid = _check_grid(cells, wavelengths)
    lines: dict[str, int] = {}
    values = []
    for line, (name, *row) in cells.rows:
        _check_name(cells, line, name, lines)
        lines[name] = line
        values.append(
            [_value(cells, line, name, title, cell) for title, cell in zip(cells.header[1:], row, strict=True)]
        )
    return list(lines), grid, np.array(values)


def _read_long(
    cells: _Cells,
) -> tuple[list[str], Float[np.ndarray, "bands"], Float[np.ndarray, "rows bands"]]:
    """Names, wavelengths and values of a table with a sample a column."""
    lines: dict[str, int] = {}
    for name in cells.header[1:]:
        _check_name(cells, cells.header_line, name, lines)
        lines[name] = cells.header_line
    names = list(lines)
    wavelengths, values = [], []
    for line, (first, *row) in cells.rows:
        wavelength = _wavelength(first, cells.delimiter)
        if wavelength is None:
            raise cells.error(line, f"column {cells.header[0]!r}: {first!r} is not a wavelength in nm")
        wavelengths.append(wavelength)
        values.append([_value(cells, line, name, name, cell) for name, cell in zip(names, row, strict=True)])
    return names, _check_grid(cells, wavelengths), np.array(values).T


def _check_name(cells: _Cells, line: int, name: str, seen: dict[str, int]) -> None:
    """Refuse a sample without a name, or with one that has been used."""
    if not name:
        raise cells.error(line, "a sample has no name")
    if name in seen:
        raise cells.error(line, f"sample {name!r} is already on line {seen[name]}; names must differ")


def write_table(
    path: str | Path, header: Sequence[str], rows: Iterable[Sequence[object]], *, overwrite: bool = False
) -> None:
    """Write a table as CSV, or tab separated if the name ends in .tsv.

    Nothing is written unless every row fits the header.

    Args:
        path: file to write; its folder must exist.
        header: titles of the columns.
        rows: cells of each row; numbers are written so that they read back exactly.
        overwrite: whether a file that exists may be replaced.

    Raises:
        FileExistsError: the file exists and `overwrite` is false.
        FileNotFoundError: its folder does not exist.
        ValueError: a row has another number of cells than the header.
    """
    path = Path(path)
    if not path.parent.is_dir():
        raise FileNotFoundError(f"{path}: the folder {path.parent} does not exist")
    if path.exists() and not overwrite:
        raise FileExistsError(f"{path} exists; choose another name, or replace it with --overwrite")
    text = io.StringIO()
    writer = csv.writer(text, delimiter="\t" if path.suffix.lower() == ".tsv" else ",", lineterminator="\n")
    writer.writerow(header)
    for number, row in enumerate(rows, start=1):
        if len(row) != len(header):
            raise ValueError(f"{path}: row {number} has {len(row)} cells where the header has {len(header)}")
        writer.writerow([_plain(cell) for cell in row])
    path.write_text(text.getvalue(), encoding="utf-8")


def _plain(cell: object) -> object:
    """Array scalars as Python's own, which print all their digits whatever NumPy's print options are."""
    if not hasattr(cell, "dtype"):
        return cell
    scalar = np.asarray(cell)[()]
    # The shortest number that reads back as this one, in its own precision.
    return float(np.format_float_scientific(scalar)) if isinstance(scalar, np.floating) else scalar.item()
