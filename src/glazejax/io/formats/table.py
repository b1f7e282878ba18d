"""Text tables of spectra, wide or long; every error is one line that names file, line and
column.
"""

import bisect
import csv
import io
import math
import re
from array import array
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from ...spectra import validate_wavelengths
from ..finish import MAX_NOISE, SPECTROMETER, RawSpectra
from ..quantity import nanometres
from ..source import Source, shorten
from ..words import read_number, unshield_name
from .above import (
    END,
    WAVELENGTH_TITLE,
    BandTitle,
    band,
    delimiter_of,
    is_data,
    lines_above,
    not_read,
    numbers_of,
)

_WAVENUMBER_TITLE = re.compile(
    r"^(wave\s*numbers?|wellenzahl|nombres? d.onde|\W*(1/cm|cm\^?[-⁻][1¹]))", re.IGNORECASE
)
_VALUE_TITLE = re.compile(r"^(reflectance|refl\b|r\b|%r\b|value|intensity)", re.IGNORECASE)
_NAME_TITLE = re.compile(r"^(name|sample|id\b|paint|pigment|patch|label|spectrum)", re.IGNORECASE)
_UNIT = re.compile(r"#\s*unit:?\s*(fraction|percent)\s*$", re.IGNORECASE)
_LAYOUTS = (
    "expected 'Name,400,410,...' with a sample a row, or 'wavelength,sample,...' with a sample a "
    "column"
)
# Without the blanks before it: by the thousand they would take hours to search.
_NANOMETRES = re.compile(r"\[?\(?nm\)?\]?$", re.IGNORECASE)
_NAMES = {"name", "data name", "sample name", "sample", "sample id"}
_SPECULAR = {
    "SCI": "specular component included, d:8",
    "SPIN": "specular component included, d:8",
    "SCE": "specular component excluded, de:8",
    "SPEX": "specular component excluded, de:8",
}
_KIND_TITLE = re.compile(r"SCI\W*SCE|specular", re.IGNORECASE)
_KINDS = {"\t": "TSV", ",": "CSV", ";": "semicolon-separated", " ": "blank-separated"}
# What a table may hold: 2 GB of numbers, and names of as many spectra.
_MAX_VALUES = 1 << 28
_MAX_SPECTRA = 5_000_000
_MAX_BANDS = 500_000
_PART = 1 << 18


@dataclass(frozen=True)
class _Cells:
    """Table of which the header is known; the lines below it are read while they are asked for."""

    source: Source
    delimiter: str
    header_line: int
    header: list[str]
    lines: Iterator[tuple[int, str]]

    def error(self, line: int, complaint: str) -> ValueError:
        return self.source.error(complaint, line)

    def split(self, line: int, text: str) -> list[str]:
        """Cells of a line, as many as the header has."""
        row = _split(self, line, text)
        while len(row) > len(self.header) and not row[-1]:
            row.pop()
        if len(row) != len(self.header):
            count = f"{len(row)} cell{'s' if len(row) != 1 else ''}"
            # 12,5 is two cells where commas separate.
            decimal = (
                self.delimiter == "," and len(row) > len(self.header) and re.search(r"\d,\d", text)
            )
            hint = (
                "; if commas are decimal points, separate the cells by semicolons or tabs"
                if decimal
                else ""
            )
            raise self.error(line, f"{count} where the header has {len(self.header)}{hint}")
        return row

    def quick(self, text: str) -> tuple[str, array] | None:
        """First cell and numbers of a line that is legal and simple.

        None for the slow way, which says what is wrong.
        """
        # Python reads 1_0 and other scripts' digits, which no instrument writes.
        values = text.partition(self.delimiter)[2]
        if '"' in text or "_" in values or not values.isascii():
            return None
        cells = _plain(text, self.delimiter)
        while len(cells) > len(self.header) and not cells[-1].strip():
            cells.pop()
        if len(cells) != len(self.header):
            return None
        first = cells.pop(0).strip()
        if self.delimiter != "," and "," in text:
            cells = [cell.replace(",", ".") for cell in cells]
        try:
            row = array("d", map(float, cells))
        except ValueError:
            return None
        return (first, row) if min(row) >= 0 and math.isfinite(sum(row)) else None


def read_table(source: Source) -> RawSpectra:
    """Read reflectance spectra from a text table.

    Three layouts are told apart by their header: wide, ``Name,400,410,...`` with a sample a row;
    long,
    ``wavelength,sample A,sample B,...`` with a sample a column; and longest,
    ``name,wavelength,reflectance`` with a value a row. Cells are separated by tabs, commas,
    semicolons or blanks; wavelengths may carry "nm"; a decimal comma is understood unless commas
    separate; empty lines and lines that start with # are skipped, but
    ``# unit: fraction`` or ``# unit: percent`` on the first line declares what values are.

    The file is read line by line: beside the numbers themselves (8 bytes each) it takes only names.

    Raises:
        ValueError: the file is empty, not text, has no wavelengths in its header, wavelengths that
            do not ascend, a ragged row, a cell that is not a finite number, a value below -0.01, or
            two samples of one name; or it holds more than 268 million values. The message is one
            line and says where.
    """
    cells, scale = _read_header(source)
    first = next(cells.lines, None)
    if first is None:
        raise source.error("there is a header but no data below it")
    attributes: dict[str, list[str]] = {}
    if (order := _triples(cells)) is not None:
        names, wavelengths, values = _read_triples(cells, first, *order)
        layout = "a value a row"
    elif _is_long(cells, first):
        names, wavelengths, values = _read_long(cells, first)
        layout = "a sample a column"
    else:
        samples = _only_bands(cells, first, attributes)
        names, wavelengths, values = _read_wide(samples, next(samples.lines))
        layout = "a sample a row"
    kind = f"{_KINDS[cells.delimiter]} table, {layout}"
    return RawSpectra(
        wavelengths=wavelengths,
        names=names,
        values=values,
        format=kind,
        notes=source.notes,
        scale=scale,
        attributes=attributes,
        by_hand=True,
    )


def _read_header(source: Source) -> tuple[_Cells, float | None]:
    """Table with its header, and the value that stands for a reflectance of 1 if its first line
    says so.
    """
    scale = None
    lines = source.lines()
    above, _ = lines_above(source)
    if above:
        source.notes.append(not_read(above))
    for number, line in lines:
        if number == 1 and (said := _UNIT.match(line)):
            scale = {"fraction": 1.0, "percent": 100.0}[said[1].lower()]
        if number > above and is_data(line):
            break
    else:
        raise source.error("the file is empty")
    below = ((number, line) for number, line in lines if is_data(line))
    cells = _Cells(
        source=source, delimiter=delimiter_of(line), header_line=number, header=[], lines=below
    )
    cells.header.extend(_split(cells, number, line))
    while cells.header and not cells.header[-1]:
        cells.header.pop()
    if len(cells.header) < 2:
        raise cells.error(number, f"the header has one column only; {_LAYOUTS}")
    return cells, scale


def _split(cells: _Cells, number: int, line: str) -> list[str]:
    """Cells of a line, without the blanks around them."""
    if '"' not in line:
        return [cell.strip() for cell in _plain(line, cells.delimiter)]
    blanks = cells.delimiter == " "
    if blanks:
        line = line.strip().replace("\t", " ")
    try:
        row = next(csv.reader([line], delimiter=cells.delimiter, skipinitialspace=True), [])
    except csv.Error as error:
        raise cells.error(number, f"{error}; is a quotation mark left open?") from None
    row = [cell.strip() for cell in row]
    return [cell for cell in row if cell] if blanks else row


def _plain(line: str, delimiter: str) -> list[str]:
    """Cells of a line without quotes, with the blanks around them unless blanks separate."""
    if delimiter != " ":
        return line.split(delimiter)
    return [cell for cell in line.replace("\t", " ").split(" ") if cell.strip()]


def _number(cell: str, delimiter: str) -> float | None:
    """Number in a cell, or None; NaN and infinity count as none here."""
    if delimiter != ",":
        cell = cell.replace(",", ".")
    try:
        value = read_number(cell)
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def _wavelength(cell: str, delimiter: str) -> float | None:
    """Wavelength in a cell, which may carry its unit, or None."""
    return _number(_NANOMETRES.sub("", cell).rstrip(), delimiter)


def _band_of(cells: _Cells, title: str) -> BandTitle | None:
    """Band of a column by its title, or None; samples of a table that begins with wavelengths may
    be called R100.
    """
    value = _wavelength(title, cells.delimiter)
    if value is not None:
        return BandTitle(value, "")
    return None if WAVELENGTH_TITLE.match(cells.header[0]) else band(title)


def _is_long(cells: _Cells, first: tuple[int, str]) -> bool:
    """Whether samples are columns; refuses a header that names wavelengths in neither way."""
    titles = [_band_of(cells, title) for title in cells.header[1:]]
    numeric = [found.wavelength for found in titles if found is not None]
    if len(numeric) == len(titles) and _number(cells.header[0], cells.delimiter) is not None:
        raise cells.error(
            cells.header_line,
            f"numbers only, where a header should be; put one above, such as 'nm,name'; {_LAYOUTS}",
        )
    leading = _wavelength(cells.split(*first)[0], cells.delimiter)
    titled = bool(WAVELENGTH_TITLE.match(cells.header[0])) and leading is not None
    # Samples may be numbered 1, 2, 3; a wavelength in nm has three digits at least.
    if 2 * len(numeric) > len(titles) and not (titled and max(numeric) < 100):
        return False
    if titled and titles:
        return True
    # Colours may stand beside few bands.
    if len(numeric) > 1 and min(numeric) >= 100:
        return False
    if _WAVENUMBER_TITLE.match(cells.header[0]):
        raise cells.error(
            cells.header_line,
            f"{cells.header[0]!r} are wavenumbers; write wavelengths in nm, which are 1e7 / (1/cm)",
        )
    raise cells.error(cells.header_line, f"no wavelengths in the header; {_LAYOUTS}")


def _check_grid(cells: _Cells, wavelengths: Sequence[float]) -> Float[np.ndarray, "bands"]:
    """Legal grid, or an error that names the file; one that descends is legal."""
    grid = np.asarray(wavelengths)
    try:
        if np.all(np.diff(grid) < 0):
            return validate_wavelengths(grid[::-1])[::-1]
        return validate_wavelengths(grid)
    except ValueError as error:
        raise cells.source.error(error) from None


def _value(cells: _Cells, line: int, name: str, column: str, cell: str) -> float:
    """Reflectance in a cell, or an error that says where."""
    value = _number(cell, cells.delimiter)
    if value is None:
        problem = (
            "the cell is empty; fill it, or leave its wavelength or sample out"
            if not cell
            else f"{cell!r} is not a finite number"
        )
        raise cells.error(line, f"sample {name!r}, column {column!r}: {problem}")
    if value < -MAX_NOISE:
        raise cells.error(
            line,
            f"sample {name!r}, column {column!r}: reflectance {cell} is negative; if that is "
            "noise, write 0",
        )
    return value


def _read_rows(
    cells: _Cells,
    first: tuple[int, str],
    start: Callable[[int, str], object],
    titles: Sequence[str],
    *,
    wide: bool,
) -> Float[np.ndarray, "rows columns"]:
    """Numbers right of the first column.

    Args:
        cells: the table.
        first: number and text of the line below its header.
        start: takes the number and the first cell of each line, and refuses what is wrong with it.
        titles: what the errors call the columns.
        wide: whether the first cell names the sample; else the column does.
    """
    values = array("d")
    for number, text in _with_first(first, cells.lines):
        quick = cells.quick(text)
        if quick is None:
            name, *row = cells.split(number, text)
            start(number, name)
            values.extend(
                _value(cells, number, name if wide else title, title, cell)
                for title, cell in zip(titles, row, strict=True)
            )
        else:
            start(number, quick[0])
            values.extend(quick[1])
        if len(values) > _MAX_VALUES:
            raise cells.error(number, f"more than {_MAX_VALUES} values so far; split the table")
    return np.frombuffer(values).reshape(-1, len(titles))


def _with_first(
    first: tuple[int, str], rest: Iterator[tuple[int, str]]
) -> Iterator[tuple[int, str]]:
    yield first
    yield from rest


def _only_bands(cells: _Cells, first: tuple[int, str], attributes: dict[str, list[str]]) -> _Cells:
    """Table of names and bands alone; it begins with the line that was read already.

    What stands beside the bands, such as L*a*b*, fills the attributes. Bands with the specular
    component (SCI) and without (SCE) become rows of their own, NAME SCI and NAME SCE.

    Raises:
        ValueError: a title that begins as a number is no wavelength, or the bands with the specular
            component are others than those without.
    """
    header = cells.header
    bands: dict[str, dict[int, float]] = {}
    others: list[int] = []
    for i, title in enumerate(header):
        found = _band_of(cells, title) if i else None
        if found is not None:
            bands.setdefault(found.specular, {})[i] = found.wavelength
        elif i and (not title or title[0].isdigit()):
            raise cells.error(cells.header_line, f"column {title!r} is not a wavelength in nm")
        else:
            others.append(i)
    one, *more = bands.items()
    for specular, grid in more:
        if list(grid.values()) != list(one[1].values()):
            raise cells.error(
                cells.header_line,
                f"bands of {specular or 'no name'} are others than those of {one[0] or 'no name'}; "
                "export both at the same wavelengths",
            )
    lines = _with_first(first, cells.lines)
    if len(others) == 1 and not more:
        if one[0]:
            cells.source.notes.append(f"all bands are taken as {_SPECULAR[one[0]]}")
        return replace(cells, lines=lines)
    named = [i for i in others if header[i].lower() in _NAMES]
    name_at = named[0] if named else 0
    others.remove(name_at)
    # A column may say of each line which kind of reading it is.
    kind_at = next((i for i in others if _KIND_TITLE.search(header[i])), None)
    if others:
        titles = shorten(", ".join(header[i] for i in others))
        cells.source.notes.append(
            f"columns that are no bands are kept beside the spectra: {titles}"
        )
    if more:
        words = ", ".join(f"NAME {word} ({_SPECULAR[word]})" for word in bands if word)
        cells.source.notes.append(f"each line gives a spectrum for each kind of reading: {words}")
    columns: list[list[str]] = [attributes.setdefault(header[i], []) for i in others]

    def rows() -> Iterator[tuple[int, str]]:
        for number, text in lines:
            row = cells.split(number, text)
            for word, at in bands.items():
                for column, i in zip(columns, others, strict=True):
                    column.append(row[i])
                kind = word if more else "" if kind_at is None else row[kind_at]
                name = f"{row[name_at]} {kind}".strip() if row[name_at] else ""
                yield number, _join_by_tabs([name, *(row[i] for i in at)])

    return replace(
        cells,
        delimiter="\t",
        header=[header[name_at], *(header[i] for i in one[1])],
        lines=rows(),
    )


def _join_by_tabs(row: Sequence[str]) -> str:
    text = io.StringIO()
    csv.writer(text, delimiter="\t", lineterminator="").writerow(row)
    return text.getvalue()


def _read_wide(
    cells: _Cells, first: tuple[int, str]
) -> tuple[list[str], Float[np.ndarray, "bands"], Float[np.ndarray, "rows bands"]]:
    """Names, wavelengths and values of a table with a sample a row."""
    found = [_band_of(cells, title) for title in cells.header[1:]]
    grid = _check_grid(cells, [each.wavelength for each in found if each is not None])
    names: list[str] = []
    # 16 bytes a name instead of the 150 of a dictionary.
    lines = array("q")
    hashes = array("q")

    def start(number: int, name: str) -> None:
        if not name or len(names) == _MAX_SPECTRA:
            wrong = (
                "a sample has no name"
                if not name
                else f"more than {_MAX_SPECTRA} samples so far; split the table"
            )
            raise cells.error(number, wrong)
        names.append(unshield_name(name))
        lines.append(number)
        hashes.append(hash(name))

    values = _read_rows(cells, first, start, cells.header[1:], wide=True)
    ordered = np.sort(np.frombuffer(hashes, np.int64))
    if (ordered[1:] == ordered[:-1]).any():
        seen: dict[str, int] = {}
        for number, name in zip(lines, names, strict=True):
            _check_name(cells, number, name, seen)
            seen[name] = number
    return names, grid, values


def _read_long(
    cells: _Cells, first: tuple[int, str]
) -> tuple[list[str], Float[np.ndarray, "bands"], Float[np.ndarray, "rows bands"]]:
    """Names, wavelengths and values of a table with a sample a column."""
    lines: dict[str, int] = {}
    for name in cells.header[1:]:
        _check_name(cells, cells.header_line, name, lines)
        lines[name] = cells.header_line
    names = [unshield_name(name) for name in lines]
    wavelengths = array("d")

    def start(number: int, cell: str) -> None:
        wavelength = _wavelength(cell, cells.delimiter)
        if wavelength is None:
            raise cells.error(
                number, f"column {cells.header[0]!r}: {cell!r} is not a wavelength in nm"
            )
        wavelengths.append(wavelength)

    values = _read_rows(cells, first, start, names, wide=False)
    return names, _check_grid(cells, wavelengths), values.T


def _check_name(cells: _Cells, line: int, name: str, seen: dict[str, int]) -> None:
    """Refuse a sample without a name, or with one that has been used."""
    if not name:
        raise cells.error(line, "a sample has no name")
    if name in seen:
        raise cells.error(
            line, f"sample {name!r} is already on line {seen[name]}; names must differ"
        )


def _triples(cells: _Cells) -> tuple[int, int, int] | None:
    """Columns of name, wavelength and value in a table of a value a row, or None if it is another
    layout.
    """
    if len(cells.header) != 3:
        return None
    titled = [i for i, title in enumerate(cells.header) if WAVELENGTH_TITLE.match(title)]
    valued = [i for i, title in enumerate(cells.header) if _VALUE_TITLE.match(title)]
    named = [i for i, title in enumerate(cells.header) if _NAME_TITLE.match(title)]
    if len(titled) == len(valued) == len(named) == 1 and len({*titled, *valued, *named}) == 3:
        return named[0], titled[0], valued[0]
    return None


def _read_triples(
    cells: _Cells, first: tuple[int, str], name_at: int, wavelength_at: int, value_at: int
) -> tuple[list[str], Float[np.ndarray, "bands"], Float[np.ndarray, "rows bands"]]:
    """Names, wavelengths and values of a table with a value a row; all samples must have the same
    wavelengths.
    """
    rows: dict[str, int] = {}
    columns: dict[float, int] = {}
    column_at: dict[str, int] = {}  # by its text, which need not be parsed again
    row_of = array("i")
    column_of = array("i")
    values = array("d")
    breaks: list[
        tuple[int, int]
    ] = []  # a value and its line, wherever that is not the line after the value before
    for number, text in _with_first(first, cells.lines):
        row = cells.split(number, text)
        name = row[name_at]
        title = row[wavelength_at]
        if not name:
            raise cells.error(number, "a sample has no name")
        if title not in column_at:
            wavelength = _wavelength(title, cells.delimiter)
            if wavelength is None:
                raise cells.error(
                    number,
                    f"column {cells.header[wavelength_at]!r}: {title!r} is not a wavelength in nm",
                )
            column_at[title] = columns.setdefault(wavelength, len(columns))
        if not breaks or number - breaks[-1][1] != len(values) - breaks[-1][0]:
            breaks.append((len(values), number))
        row_of.append(rows.setdefault(name, len(rows)))
        column_of.append(column_at[title])
        values.append(_value(cells, number, name, cells.header[value_at], row[value_at]))
        if len(rows) > _MAX_SPECTRA or len(columns) > _MAX_BANDS or len(values) > _MAX_VALUES:
            raise cells.error(
                number, "more samples, wavelengths or values so far than a table may hold; split it"
            )
    names = [unshield_name(name) for name in rows]
    grid = _check_grid(cells, sorted(columns))
    # Columns in the order of their wavelengths, not of the file.
    rank = np.argsort(np.argsort(np.fromiter(columns, float)))
    at_row = np.frombuffer(row_of, np.int32)
    at_column = np.frombuffer(column_of, np.int32)
    # Filled in parts, as whole arrays of places would take more room than the table.
    parts = [slice(i, i + _PART) for i in range(0, len(values), _PART)]
    if len(names) * grid.size == len(values):
        table = np.empty((len(names), grid.size))
        seen = np.zeros((len(names), grid.size), bool)
        for part in parts:
            seen[at_row[part], rank[at_column[part]]] = True
            table[at_row[part], rank[at_column[part]]] = values[part]
        if seen.all():
            return names, grid, table
    places = at_row.astype(np.int64) * grid.size + rank[at_column]
    order = np.argsort(places, kind="stable")
    again = order[1:][np.diff(places[order]) == 0]
    if again.size:
        place = int(again.min())
        start, line = breaks[bisect.bisect_right(breaks, place, key=lambda pair: pair[0]) - 1]
        title = f"{grid[rank[at_column[place]]]:g}"
        raise cells.error(
            line + place - start,
            f"sample {names[at_row[place]]!r} has a value at {title} nm already",
        )
    row = int(np.argmax(np.bincount(at_row) < grid.size))
    missing = np.delete(grid, rank[at_column[at_row == row]])[0]
    raise cells.source.error(
        f"sample {names[row]!r} has no value at {missing:g} nm, where others have one"
    )


def read_columns(source: Source) -> RawSpectra:
    """Read columns of numbers without a header, as spectrometers write them: wavelengths in nm,
    then a spectrum each.

    Raises:
        ValueError: no rows, a row of another length, a cell that is not a number, or first columns
            that are no wavelengths.
    """
    numbers = array("d")
    width = 0
    above, _ = lines_above(source)
    # Only comments may be in another encoding, and they are skipped.
    for number, line in source.lines(damaged="replace"):
        if END.match(line):
            break
        if number <= above or not is_data(line):
            continue
        cells = numbers_of(line)
        try:
            row = array("d", map(read_number, cells))
        except ValueError:
            raise source.error(f"{line.strip()[:40]!r} are not numbers only", number) from None
        width = width or len(row)
        if len(row) != width:
            raise source.error(f"{len(row)} cells where the first row has {width}", number)
        numbers.extend(row)
        if len(numbers) > _MAX_VALUES:
            raise source.error(f"more than {_MAX_VALUES} values so far; split the file", number)
    if not width:
        raise source.error(
            "no numbers below this line; was the file cut short? export it again", above
        )
    table = np.frombuffer(numbers).reshape(-1, width)
    try:
        wavelengths, notes = nanometres(table[:, 0], None)
    except ValueError as error:
        raise source.error(f"first column: {error}; {_LAYOUTS}") from None
    steps = np.diff(wavelengths)
    if not (wavelengths.min() >= 100 and (np.all(steps > 0) or np.all(steps < 0))):
        raise source.error(
            f"numbers only, and the first column does not run through wavelengths; {_LAYOUTS}"
        )
    if above:
        notes.append(not_read(above))
    if width == 2:
        names = [source.path.stem]
        notes.append("there is no header: the spectrum is named as its file")
    else:
        names = [f"column {i}" for i in range(2, width + 1)]
        notes.append("there is no header: spectra are named by their column")
    raw = RawSpectra(
        wavelengths=wavelengths,
        names=names,
        values=table[:, 1:].T,
        format="columns of numbers without a header",
        notes=notes,
    )
    # Lines above are a spectrometer's; without them, a person may have made the file.
    return replace(raw, lit=SPECTROMETER) if above else raw
