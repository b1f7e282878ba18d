"""Text tables of spectra, wide or long; every error is one line that names file, line and column."""

import csv
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from ...spectra import validate_wavelengths
from ..finish import RawSpectra, nanometres
from ..sniff import decode

_WAVELENGTH_TITLE = re.compile(r"^(wave\s*length|wl\b|wvl?\b|lambda|λ|nm\b|\[?nm\]?$)", re.IGNORECASE)
_VALUE_TITLE = re.compile(r"^(reflectance|refl\b|r\b|%r\b|value|intensity)", re.IGNORECASE)
_NAME_TITLE = re.compile(r"^(name|sample|id\b|paint|pigment|patch|label|spectrum)", re.IGNORECASE)
_LAYOUTS = "expected 'Name,400,410,...' with a sample a row, or 'wavelength,sample,...' with a sample a column"
_NANOMETRES = re.compile(r"\s*\[?\(?nm\)?\]?$", re.IGNORECASE)


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


def read_table(path: Path) -> RawSpectra:
    """Read reflectance spectra from a text table.

    Three layouts are told apart by their header: wide, ``Name,400,410,...`` with a sample a row; long,
    ``wavelength,sample A,sample B,...`` with a sample a column; and longest, ``name,wavelength,reflectance``
    with a value a row. Cells are separated by tabs, commas, semicolons or blanks; wavelengths may carry "nm"; a
    decimal comma is understood unless commas separate; empty lines and lines that start with # are skipped, but
    ``# unit: fraction`` or ``# unit: percent`` on the first line declares what values are.

    Raises:
        ValueError: the file is empty, not text, has no wavelengths in its header, wavelengths that do not
            ascend, a ragged row, a cell that is not a finite number, a negative value, or two samples of one
            name. The message is one line and says where.
    """
    cells = _read_cells(path)
    if not cells.rows:
        raise ValueError(f"{cells.path}: there is a header but no data below it")
    scale = _declared_scale(path)
    kind = {"\t": "TSV", ",": "CSV", ";": "semicolon-separated", " ": "blank-separated"}[cells.delimiter]
    if (order := _triples(cells)) is not None:
        names, wavelengths, values = _read_triples(cells, *order)
        return RawSpectra(wavelengths, names, values, f"{kind} table, a value a row", scale=scale, by_hand=True)
    if _is_long(cells):
        names, wavelengths, values = _read_long(cells)
        return RawSpectra(wavelengths, names, values, f"{kind} table, a sample a column", scale=scale, by_hand=True)
    names, wavelengths, values = _read_wide(cells)
    return RawSpectra(wavelengths, names, values, f"{kind} table, a sample a row", scale=scale, by_hand=True)


def _declared_scale(path: Path) -> float | None:
    """Value that stands for a reflectance of 1, if the first line is a comment that says so."""
    with path.open(encoding="utf-8-sig") as file:
        said = re.match(r"#\s*unit:?\s*(fraction|percent)\s*$", file.readline(), re.IGNORECASE)
    return None if said is None else {"fraction": 1.0, "percent": 100.0}[said[1].lower()]


def _read_cells(path: Path) -> _Cells:
    """Cut a text file into cells, all rows as long as the header."""
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


def _triples(cells: _Cells) -> tuple[int, int, int] | None:
    """Columns of name, wavelength and value in a table of a value a row, or None if it is another layout."""
    if len(cells.header) != 3:
        return None
    titled = [i for i, title in enumerate(cells.header) if _WAVELENGTH_TITLE.match(title)]
    valued = [i for i, title in enumerate(cells.header) if _VALUE_TITLE.match(title)]
    named = [i for i, title in enumerate(cells.header) if _NAME_TITLE.match(title)]
    if len(titled) == len(valued) == len(named) == 1 and len({*titled, *valued, *named}) == 3:
        return named[0], titled[0], valued[0]
    return None


def _read_triples(
    cells: _Cells, name_at: int, wavelength_at: int, value_at: int
) -> tuple[list[str], Float[np.ndarray, "bands"], Float[np.ndarray, "rows bands"]]:
    """Names, wavelengths and values of a table with a value a row; all samples must have the same wavelengths."""
    spectra: dict[str, dict[float, float]] = {}
    for line, row in cells.rows:
        name, title = row[name_at], row[wavelength_at]
        wavelength = _wavelength(title, cells.delimiter)
        if not name:
            raise cells.error(line, "a sample has no name")
        if wavelength is None:
            raise cells.error(line, f"column {cells.header[wavelength_at]!r}: {title!r} is not a wavelength in nm")
        spectrum = spectra.setdefault(name, {})
        if wavelength in spectrum:
            raise cells.error(line, f"sample {name!r} has a value at {title} nm already")
        spectrum[wavelength] = _value(cells, line, name, cells.header[value_at], row[value_at])
    grid = _check_grid(cells, sorted({w for spectrum in spectra.values() for w in spectrum}))
    for name, spectrum in spectra.items():
        if len(spectrum) != grid.size:
            missing = next(w for w in grid if w not in spectrum)
            raise ValueError(f"{cells.path}: sample {name!r} has no value at {missing:g} nm, where others have one")
    return list(spectra), grid, np.array([[spectrum[w] for w in grid] for spectrum in spectra.values()])


def read_columns(path: Path) -> RawSpectra:
    """Read columns of numbers without a header, as spectrometers write them: wavelengths in nm, then a spectrum each.

    Raises:
        ValueError: a row of another length, a cell that is not a number, or first columns that are no wavelengths.
    """
    rows: list[list[float]] = []
    for number, line in enumerate(decode(path).splitlines(), start=1):
        cells = line.split()
        if not cells or cells[0].startswith("#"):
            continue
        try:
            rows.append([float(cell) for cell in cells])
        except ValueError:
            raise ValueError(f"{path}, line {number}: {line.strip()[:40]!r} are not numbers only") from None
        if len(rows[-1]) != len(rows[0]):
            raise ValueError(f"{path}, line {number}: {len(rows[-1])} cells where the first row has {len(rows[0])}")
    table = np.array(rows)
    try:
        wavelengths, notes = nanometres(table[:, 0], None)
    except ValueError as error:
        raise ValueError(f"{path}: first column: {error}; {_LAYOUTS}") from None
    steps = np.diff(wavelengths)
    if not (wavelengths.min() >= 100 and (np.all(steps > 0) or np.all(steps < 0))):
        raise ValueError(f"{path}: numbers only, and the first column does not run through wavelengths; {_LAYOUTS}")
    names = [f"column {i}" for i in range(2, table.shape[1] + 1)]
    notes.append("there is no header: spectra are named by their column")
    return RawSpectra(wavelengths, names, table[:, 1:].T, "columns of numbers without a header", notes)
