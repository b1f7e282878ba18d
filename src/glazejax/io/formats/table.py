"""Text tables of spectra, wide or long; every error is one line that names file, line and
column.
"""

import csv
import itertools
import math
import re
from array import array
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import reduce
from operator import itemgetter

import numpy as np
from jaxtyping import Float

from ...spectra import describe_grid, validate_wavelengths
from ..finish import DETECTED, SPECTROMETER, RawSpectra, detectors_overlap, different
from ..quantity import (
    MODES,
    READING,
    REFLECTANCE,
    first_quantity,
    has_meaning,
    is_no_name,
    length_unit,
    meaning,
)
from ..source import NumberedLine, Source, naming, shorten
from ..spectra_table import Bands, Rows
from ..words import finite_number, is_number, unshield_name
from .above import (
    WAVELENGTH_TITLE,
    BandTitle,
    band,
    data_lines,
    delimiter_of,
    delimiter_of_numbers,
    find_table,
    is_wavelength_title,
    plain_cells,
)

_VALUE_TITLE = re.compile(r"^(reflectance|refl\b|r\b|%r\b|value|intensity)", re.IGNORECASE)
_NAME_TITLE = re.compile(r"^(name|sample|id\b|paint|pigment|patch|label|spectrum)", re.IGNORECASE)
# Lines above a table, or comments, that say what its values are.
_KEYWORD = re.compile(
    r"\W*(?:[xy]\W*(?:units?|axis)|(?:(?:data|photometric|meas\w*|mess|processing|spectrum|display|"
    r"ordinate)\W*)?(?:units?|modus|mode|type)|measurement|quantity|ordinate)[\s:=,;\"]+(.+)",
    re.IGNORECASE,
)
_LAYOUTS = (
    "expected 'Name,400,410,...' with a sample a row, or 'wavelength,sample,...' with a sample a "
    "column"
)
# Without the blanks before it: by the thousand they would take hours to search.
_NANOMETRES = re.compile(r"\[?\(?nm\)?\]?$", re.IGNORECASE)
# What spectra run over that is no wavelength.
_NO_WAVELENGTH = re.compile(r"\bfrequen|\b[tgm]?hz\b|\benerg|\bev\b", re.IGNORECASE)
_NAMES = {"name", "data name", "sample name", "sample", "sample id"}
_KIND_TITLE = re.compile(r"SCI\W*SCE|specular", re.IGNORECASE)
# Letters by which software calls what an instrument reads.
_LETTERS = {"d": "dark", "r": "reference", "s": "sample", "p": "processed"}
_KINDS = {"\t": "TSV", ",": "CSV", ";": "semicolon-separated", " ": "blank-separated"}
# What a table may hold: 2 GB of numbers, and names of as many spectra.
_MAX_VALUES = 1 << 28
_MAX_SPECTRA = 5_000_000


@dataclass(frozen=True)
class _Cells:
    """Table of which the header is known; the lines below it are read while they are asked for.

    Attributes:
        source: the file.
        delimiter: between cells.
        header_line: number of the last line of titles, or of the last line above the numbers.
        titles: cells of each line of titles; none where numbers begin at once.
        header: titles of each column, joined.
        lines: numbers and texts of the lines below.
        said: what a line above says of the values.
        declared: whether a comment says so, and titles are names.
        short: whether cells may lack at the end of a line.
        blanks: whether cells may be empty.
        percent: a place for each cell that has a sign of percent.
    """

    source: Source
    delimiter: str
    header_line: int
    titles: list[list[str]]
    header: list[str]
    lines: Iterator[NumberedLine]
    said: str
    declared: bool
    short: bool = False
    blanks: bool = False
    percent: list[int] = field(default_factory=list)

    def error(self, complaint: str, line: int | None = None) -> ValueError:
        """Error that says what is wrong, on which line; by default that of the titles."""
        return self.source.error(complaint, self.header_line if line is None else line)

    def split(self, line: int, text: str) -> list[str]:
        """Cells of a line, with the blanks around them where that is sooner."""
        row = (
            _split(self.source, self.delimiter, line, text)
            if '"' in text
            else plain_cells(text, self.delimiter)
        )
        width = len(self.header)
        while len(row) > width and not row[-1].strip():
            row.pop()
        count = len(row)
        if self.short and self.delimiter != " ":
            row += [""] * (width - count)
        if len(row) != width:
            words = f"{count} cell{'s' if count != 1 else ''}"
            # 12,5 is two cells where commas separate.
            decimal = self.delimiter == "," and count > width and re.search(r"\d,\d", text)
            hint = "; if commas are decimal points, separate the cells by semicolons or tabs"
            first = "header" if self.titles else "first row"
            raise self.error(
                f"{words} where the {first} has {width}{hint if decimal else ''}", line
            )
        return row

    def number(self, cell: str) -> float | None:
        """Number in a cell, or None; NaN and infinity count as none here."""
        # Where commas separate, one in a cell stood in quotes.
        return finite_number(cell.replace(",", ".").strip())

    def wavelength(self, cell: str) -> float | None:
        """Wavelength in a cell, which may carry its unit, or None."""
        return self.number(_NANOMETRES.sub("", cell))


def read_table(source: Source) -> RawSpectra:
    """Read reflectance spectra from a text table.

    Layouts are distinguished by their header: wide, ``Name,400,410,...`` with a sample a row; long,
    ``wavelength,sample A,sample B,...`` with a sample a column; and longest,
    ``name,wavelength,reflectance`` with a value a row. Below any line of titles, or none, three
    rows of numbers of which a column runs through wavelengths make a long table. A row of units may
    stand below the titles; a further column of wavelengths begins further spectra; columns without
    numbers, and what an instrument reads in addition to reflectance, are left out. Cells are
    separated by tabs, commas, semicolons or blanks; wavelengths may carry "nm" and values "%"; a
    decimal comma is understood unless commas separate; empty lines and lines that start with # are
    skipped, but lines above such as ``# unit: percent`` or ``YUNITS %R`` say what values are.

    The file is read line by line: except for the numbers themselves (8 bytes each) it takes only
    names.

    Raises:
        ValueError: the file is empty, not text, has no wavelengths in its header, wavelengths that
            do not ascend, a ragged row, a cell that is not a finite number, or two samples of one
            name; or it holds more than 268 million values. The message is one line and says where.
    """
    cells, first = _open_table(source)
    row = [cell.strip() for cell in cells.split(*first)]
    attributes: dict[str, list[str]] = {}
    if (order := _triples(cells)) is not None:
        names, wavelengths, values = _read_triples(cells, *order)
        layout = "a value a row"
        unit = length_unit(cells.header[order[1]])
        title = cells.header[order[2]]
    elif _is_wide(cells, row):
        names, wavelengths, values = _read_wide(cells, attributes)
        layout = "a sample a row"
        # R400% without its wavelength; or a column such as Unit.
        said = [re.sub(r"\d{3,4}(nm)?", " ", cells.header[-1]), cells.header[0]]
        said += [_stated(f"{title}: {column[0]}") for title, column in attributes.items()]
        title = next(filter(has_meaning, said), "")
        unit = length_unit(cells.header[0]) or "nm" * ("nm" in cells.header[-1].lower())
    else:
        grids, columns = _choose_columns(cells)
        columns, title = _reflectances(cells, columns)
        names = _column_names(cells, columns)
        wavelengths, values = _read_long(cells, grids, dict(zip(columns, names, strict=True)))
        if meaning(title).scale == 100.0:
            _check_percent(cells, columns, values)
        layout = "a sample a column"
        unit = next((unit for row in cells.titles if (unit := length_unit(row[grids[0]]))), "")
    titled = bool(cells.titles)
    return RawSpectra(
        wavelengths=wavelengths,
        names=names,
        values=values,
        format=f"{_KINDS[cells.delimiter]} table, {layout}"
        if titled
        else "columns of numbers without a header",
        notes=source.notes,
        wavelength_unit=unit,
        quantity=first_quantity((title, cells.said)),
        scale=100.0 if cells.percent else meaning(title).scale or meaning(cells.said).scale,
        attributes=attributes,
        # Lines above are a spectrometer's; without them, a person may have made the file.
        lit=DETECTED if titled or not cells.header_line else SPECTROMETER,
    )


def _check_percent(cells: _Cells, columns: Sequence[int], values: Rows) -> None:
    """Refuse a column that does not state percent, next to one that does, and is hardly of paint
    in percent.
    """
    for column, sample in zip(columns, values, strict=True):
        name = cells.header[column]
        most = np.fmax.reduce(sample)
        if name and meaning(name).scale is None and most <= 1.0:
            raise cells.error(
                f"other titles state percent; {name!r} states nothing and is {most:g} at most: "
                "write % in all titles, and all values in percent",
            )


def _open_table(source: Source) -> tuple[_Cells, NumberedLine]:
    """Table with its header, and the first line below it with its number."""
    layout = find_table(source)
    if layout.above:
        lines_above = f"{layout.above} lines above the table are not read"
        source.notes.append(lines_above if layout.above > 1 else "line 1 is not read")
    lines = source.lines(above=layout.above)
    data = data_lines(itertools.islice(lines, layout.above, None))
    titles = list(itertools.islice(data, layout.titles))
    first = next(data, None)
    above = titles[-1][0] if titles else layout.above
    if first is None and not titles:
        cut = "no numbers below this line; was the file cut short? export it again"
        raise source.error(cut if layout.above else "the file is empty", layout.above or None)
    keywords = [
        (words, line.startswith("#"))
        for line in source.first_lines[: titles[0][0] - 1 if titles else above]
        if has_meaning(words := _stated(line))
    ]
    number, row = first or (above, "")
    delimiter = delimiter_of(titles[-1][1]) if titles else delimiter_of_numbers(row)
    numbers = _split(source, delimiter, number, row)
    while numbers and not numbers[-1]:
        numbers.pop()
    rows = [_split(source, delimiter, *title) for title in titles] or [[""] * len(numbers)]
    # Titles may be empty at the end where numbers stand below, as of merged cells.
    while titles and len(rows[-1]) > len(numbers) and not rows[-1][-1]:
        rows[-1].pop()
    if len(alone := source.first_lines[above:][:3]) == 3 and all(map(is_number, alone)):
        raise source.error(
            "one number a line: their wavelengths stand in a file of their own; write both into "
            "one table, wavelengths first"
        )
    width = len(rows[-1])
    if width < 2:
        raise source.error(f"the header has one column only; {_LAYOUTS}", above)
    if first is None:
        raise source.error("there is a header but no data below it")
    # A title above several columns stands at the first of them.
    rows[:-1] = [
        list(itertools.accumulate((row + [""] * width)[:width], lambda left, own: own or left))
        for row in rows[:-1]
    ]
    # In brackets, as 'black' and '%' say no unit together, and 'spot 1' and '%R' say 1 %.
    units = [
        [f"[{cell.strip('[]')}]" if has_meaning(cell) else cell for cell in row] for row in rows[1:]
    ]
    cells = _Cells(
        source=source,
        delimiter=delimiter,
        header_line=above,
        titles=rows if titles else [],
        header=[" ".join(filter(None, column)) for column in zip(rows[0], *units, strict=True)],
        lines=itertools.chain([first], data),
        said=keywords[-1][0] if keywords else "",
        declared=any(declared for _, declared in keywords),
    )
    return cells, first


def _stated(line: str) -> str:
    """Words that a line above a table may say of its values: a unit alone, or behind a keyword."""
    keyword = _KEYWORD.match(line[:200])
    return keyword[1].strip() if keyword else line.strip() if is_no_name(line) else ""


def _split(source: Source, delimiter: str, number: int, line: str) -> list[str]:
    """Cells of a line, without the blanks around them."""
    if '"' not in line:
        return [cell.strip() for cell in plain_cells(line, delimiter)]
    blanks = delimiter == " "
    if blanks:
        line = line.strip().replace("\t", " ")
    try:
        row = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])
    except csv.Error as error:
        raise source.error(f"{error}; is a quotation mark left open?", number) from None
    row = [cell.strip() for cell in row]
    return [cell for cell in row if cell] if blanks else row


def _band_of(cells: _Cells, title: str) -> BandTitle | None:
    """Band of a column by its title, or None; samples of a table that begins with wavelengths may
    be called R100.
    """
    value = cells.wavelength(title)
    if value is not None:
        return BandTitle(value, "")
    return None if WAVELENGTH_TITLE.match(cells.header[0]) else band(title)


def _columns(cells: _Cells) -> list[list[float]]:
    """Numbers of each column in the first rows; none at all where the head of the file ends
    above.
    """
    lines = enumerate(cells.source.first_lines[cells.header_line :], start=cells.header_line + 1)
    rows = [
        _split(cells.source, cells.delimiter, *line)
        for line in itertools.islice(data_lines(lines), 30)
    ]
    return [
        [
            value
            for row in rows
            if i < len(row) and (value := cells.wavelength(row[i].removesuffix("%"))) is not None
        ]
        for i in range(len(cells.header))
        if rows
    ]


def _runs(values: list[float]) -> bool:
    """Return whether numbers run through wavelengths in nm."""
    steps = np.diff(values)
    return len(values) > 2 and min(values) >= 100 and bool((steps > 0).all() or (steps < 0).all())


def _run_below(cells: _Cells, titles: list[float], grid: int | None) -> bool:
    """Return whether wavelengths run down a column, of a table with titles that are numbers.

    Args:
        cells: the table.
        titles: those that are numbers.
        grid: column that is titled wavelengths; None where none is, and the first is meant.

    Raises:
        ValueError: a column is titled wavelengths, and both may be.
    """
    columns = _columns(cells)
    at = grid or 0
    below = columns[at] if columns else []
    if not _runs(below) or _NAME_TITLE.match(cells.header[0]):
        return False
    if not _runs(titles) or grid is None:
        return not _runs(titles)
    # Instruments read in even steps; samples may be counted, in steps of 1.
    even, even_titles = (
        bool(abs(steps[0]) != 1 and np.ptp(steps) == 0) for steps in map(np.diff, (below, titles))
    )
    if even == even_titles:
        raise cells.error(
            f"the titles {', '.join(cells.header[at + 1 : at + 4])} and the column below "
            f"{cells.header[at]!r} may both be wavelengths; call samples by words, such as "
            f"'paint {cells.header[at + 1]}', or the column of their names Name",
        )
    return even


def _is_wide(cells: _Cells, row: list[str]) -> bool:
    """Return whether samples are rows: titles are bands, and do not number samples."""
    titles = [_band_of(cells, title) for title in cells.header[1:]]
    numeric = [band.wavelength for band in titles if band is not None]
    if not numeric:
        return False
    if len(numeric) == len(titles) and cells.number(cells.header[0]) is not None:
        raise cells.error(
            f"numbers only, where a header should be; put one above, such as 'nm,name'; {_LAYOUTS}",
        )
    below = (
        i
        for i, (title, cell) in enumerate(zip(cells.titles[-1], row, strict=False))
        if is_wavelength_title(title) and cells.wavelength(cell) is not None
    )
    grid = next(below, None)
    titled = grid is not None
    # A mean or a blank may stand next to numbered samples.
    if (titled or len(numeric) == len(titles)) and _run_below(cells, numeric, grid):
        return False
    # Samples may be numbered 1, 2, 3; a wavelength in nm has three digits at least. Colours may
    # stand next to few bands.
    if 2 * len(numeric) > len(titles):
        return not titled or max(numeric) >= 100
    return not titled and len(numeric) > 1 and min(numeric) >= 100


def _no_wavelength(title: str) -> str:
    how = (
        ", or call the column 'wavelength' and say --unit 1/cm"
        if "wavenumber" in title.lower()
        else ""
    )
    return f"{title!r} is no wavelength; write wavelengths in nm{how}"


def _choose_columns(cells: _Cells) -> tuple[list[int], list[int]]:
    """Columns of wavelengths, and of numbers next to them.

    Wavelengths are the first column so titled, else the first that runs through them. A further
    one begins further spectra.
    """
    notes = cells.source.notes
    width = len(cells.header)
    numbers = _columns(cells)
    barred = [
        i
        for i, title in enumerate(cells.header)
        if (length_unit(title) == "1/cm" or _NO_WAVELENGTH.search(title))
        and meaning(title).quantity in ("", "a Raman spectrum")
    ]
    runs = [i for i in range(width) if i not in barred and numbers and _runs(numbers[i])]
    titled = [i for i in range(width) if any(is_wavelength_title(row[i]) for row in cells.titles)]
    in_um = numbers and not cells.titles and [0.1] < numbers[0][:1] < numbers[0][1:2] < [100.0]
    if numbers and not (titled or runs or in_um):
        wrong = f"numbers only, and the first column does not run through wavelengths; {_LAYOUTS}"
        if barred:
            wrong = _no_wavelength(cells.header[barred[0]])
        elif cells.titles:
            wrong = f"no wavelengths in the header; {_LAYOUTS}"
        raise cells.source.error(wrong, cells.header_line or None)
    grid = next(iter([*titled, *runs]), 0)
    if _NO_WAVELENGTH.search(cells.header[grid]):
        raise cells.error(_no_wavelength(cells.header[grid]))
    right = [i for i in range(grid + 1, width) if i not in barred and (not numbers or numbers[i])]
    again = [i for i in right if i in titled and _holds_wavelengths(cells, numbers, grid, i)]
    further = [i for i in right if i in again or (i in runs and numbers[i] == numbers[grid])]
    if {*right} == {*further}:
        # A lamp's power may run as its wavelengths do.
        further = again
    columns = sorted({*right}.difference(further))
    if not columns:
        raise cells.error("no column of numbers but the wavelengths")
    grids = [grid, *further]
    left = sorted({*range(width)}.difference(grids, columns))
    before = [i for i in left if i < grid and i not in barred and numbers and numbers[i]]
    last = cells.titles[-1] if cells.titles else cells.header
    for reason, unread in (
        ("left of the wavelengths, and not read", before),
        ("left out, as they hold no spectra", [i for i in left if i not in before]),
    ):
        if unread:
            titles = shorten(", ".join(last[i] or f"column {i + 1}" for i in unread))
            notes.append(f"{reason}: {titles}")
    return grids, columns


def _holds_wavelengths(cells: _Cells, numbers: list[list[float]], grid: int, i: int) -> bool:
    """Return whether a further column with a title of wavelengths holds wavelengths.

    A sample may be called Wave blue: its title goes on, and its numbers begin elsewhere.
    """
    titles = [row[i] for row in cells.titles]
    if any(length_unit(title) or WAVELENGTH_TITLE.fullmatch(title) for title in titles):
        return True
    if not (numbers and numbers[grid]):
        return True
    start = numbers[grid][0]
    return start / 3 < numbers[i][0] < 3 * start


def _reflectances(cells: _Cells, columns: list[int]) -> tuple[list[int], str]:
    """Columns of reflectance of those of a table, and the title that says what they are.

    Where there is reflectance nothing else is read. Where there is none, what says nothing is; else
    all that is of another quantity, which is refused unless the user says that it is reflectance.
    """
    words = [re.split(r"[\[(]", title)[0].strip().lower() for title in cells.header]
    if set(words) >= set(_LETTERS):
        words = [_LETTERS.get(word, word) for word in words]
    said = {i: meaning(cells.header[i]).quantity for i in columns}
    readings = [i for i in columns if READING.fullmatch(words[i]) and said[i] != REFLECTANCE]
    computed = [i for i in columns if words[i] == "processed"]
    if cells.declared:
        return columns, ""
    if any(said.values()) or computed or (len(readings) == len(columns) > 1 and "dark" in words):
        said |= dict.fromkeys(readings, "counts") | dict.fromkeys(computed, REFLECTANCE)
    others = [quantity for quantity in said.values() if quantity != "counts"]
    best = next(one for one in (REFLECTANCE, "", *others, "counts") if one in said.values())
    # A title that says nothing is a sample's name, if all others say reflectance.
    same_quantity = {*said.values()} <= {REFLECTANCE, ""}
    kept = columns if same_quantity else [i for i in columns if said[i] == best]
    if len(kept) < len(columns):
        left = ", ".join(cells.header[i] for i in sorted({*columns}.difference(kept)))
        taken = ", ".join(cells.header[i] for i in kept)
        cells.source.notes.append(shorten(f"taken as reflectance: {taken}; left out: {left}"))
    scales = {meaning(cells.header[i]).scale for i in kept} - {None}
    if len(scales) > 1:
        raise cells.error("percent and fraction are mixed in the titles; bring all to one unit")
    title = next(filter(has_meaning, (cells.header[i] for i in kept)), "")
    return kept, title or (f"{cells.header[kept[0]]} (counts)" if best == "counts" else "")


def _column_names(cells: _Cells, columns: list[int]) -> list[str]:
    """Names of the spectra in some columns: their titles. Those without one are called as the one
    before, and where titles name quantities only as the file.
    """
    notes = cells.source.notes
    stem = cells.source.path.stem
    if not cells.titles:
        alone = len(columns) == 1
        notes.append(
            "there is no header: the spectrum is named as its file"
            if alone
            else "there is no header: spectra are named by their column"
        )
        return [stem] if alone else [f"column {i + 1}" for i in columns]
    titled = [
        " ".join(row[i] for row in cells.titles if cells.declared or not is_no_name(row[i]))
        for i in columns
    ]
    if not any(titled):
        modes = [meaning(cells.header[i]).mode for i in columns]
        return different([f"{stem} {mode}".strip() for mode in modes], notes)
    lines: dict[str, int] = {}
    names: list[str] = []
    for i, name in zip(columns, titled, strict=True):
        name = name or cells.header[i]
        if name or not names:
            # Of several lines of titles one cell may stand above several columns.
            _check_name(cells, cells.header_line, name, lines if len(cells.titles) == 1 else {})
        names.append(unshield_name(name) or names[-1])
    return different(names, notes)


def _check_grid(cells: _Cells, grid: Bands) -> Bands:
    """Legal grid, or an error that names the file; one that descends is legal, or one of detectors
    that overlap.
    """
    with naming(cells.source.path):
        # Those in micrometres or metres are recognised by their unit, or later.
        if grid.size and 0 < grid.min() <= grid.max() < 100:
            validate_wavelengths(np.sort(grid * (1e9 if grid.max() < 1e-4 else 1e3)))
            return grid
        if np.all(np.diff(grid) < 0):
            return validate_wavelengths(grid[::-1])[::-1]
        return grid if detectors_overlap(grid) else validate_wavelengths(grid)


def _value(
    cells: _Cells, line: int, name: str, column: str, cell: str, *, wavelength: bool
) -> float:
    """Wavelength or reflectance in a cell, or an error that says where."""
    if not cell and cells.blanks:
        return math.nan
    value = cells.wavelength(cell) if wavelength else cells.number(cell.removesuffix("%"))
    if value is None:
        problem = f"{cell!r} is not a {'wavelength in nm' if wavelength else 'finite number'}"
        if not wavelength:
            problem += "; write one, or leave out its sample"
        if not (cell or wavelength):
            problem = "the cell is empty; fill it, or leave its wavelength or sample out"
        sample = "" if wavelength else f"sample {name!r}, "
        raise cells.error(f"{sample}column {column!r}: {problem}", line)
    if cell.endswith("%"):
        cells.percent.append(line)
    return value


def _plain_numbers(words: Sequence[str]) -> array | None:
    """Numbers in cells that hold nothing else; None for the slow way, which says what is wrong."""
    try:
        values = array("d", map(float, words))
    except ValueError:
        return None
    return values if math.isfinite(sum(values)) else None


def _read_rows(
    cells: _Cells,
    texts: Sequence[int],
    numbers: Sequence[int],
    *,
    grids: Sequence[int] = (),
    names: Mapping[int, str] | None = None,
    most: int = _MAX_VALUES,
) -> tuple[array, list[list[str]], Float[np.ndarray, "rows columns"]]:
    """Numbers of the lines below a header; texts in some of their columns, and numbers in others.

    Args:
        cells: the table.
        texts: columns of texts, those of names first.
        numbers: columns of numbers.
        grids: those of the numbers that are wavelengths.
        names: sample of each other one, where columns are samples.
        most: lines that may be read.
    """
    run = range(numbers[0], numbers[-1] + 1)
    # A slice is taken sooner than one cell after another, and of one cell is a list, too.
    in_turn = [*numbers] == [*run]
    pick = itemgetter(slice(run.start, run.stop)) if in_turn else itemgetter(*numbers)
    named = 0 not in numbers
    lines = array("q")
    columns: list[list[str]] = [[] for _ in texts]
    values = array("d")
    for line, text in cells.lines:
        row = cells.split(line, text)
        for i, column in zip(texts, columns, strict=True):
            word = row[i].strip()
            if not word and i == texts[0]:
                raise cells.error("a sample has no name", line)
            # The same name need not be held again.
            column.append(column[-1] if lines and column[-1] == word else word)
        # Python reads 1_0 and other scripts' digits, which no instrument writes.
        checked = text.partition(cells.delimiter)[2] if named else text
        plain = checked.isascii() and "_" not in checked
        words = pick(row)
        if cells.delimiter != "," and "," in text:
            words = [word.replace(",", ".") for word in words]
        quick = _plain_numbers(words) if plain else None
        if quick is not None:
            values.extend(quick)
        else:
            row = [cell.strip() for cell in row]
            for i in numbers:
                title = cells.header[i]
                if i in grids:
                    cell = "", title or str(i + 1)
                elif names is None:
                    cell = row[texts[0]], title
                else:
                    cell = names[i], row[grids[0]]
                values.append(_value(cells, line, *cell, row[i], wavelength=i in grids))
        lines.append(line)
        if len(values) > _MAX_VALUES or len(lines) > most:
            raise cells.error(
                f"more than {most} samples or {_MAX_VALUES} values so far; split the table", line
            )
    table = np.frombuffer(values).reshape(-1, len(numbers))
    if cells.percent:
        # Asked before bands are dropped that not all spectra have; empty cells are NaN.
        filled = ~np.isnan(table[:, [i not in grids for i in numbers]])
        if len(cells.percent) != np.count_nonzero(filled):
            raise cells.source.error(
                "some cells are in percent, with %, and some are not; write all alike"
            )
    return lines, columns, table


def _read_wide(cells: _Cells, attributes: dict[str, list[str]]) -> tuple[list[str], Bands, Rows]:
    """Names, wavelengths and values of a table with a sample a row.

    Other columns than bands, such as L*a*b*, fill the attributes. Bands with the specular
    component (SCI) and without (SCE) become rows of their own, NAME SCI and NAME SCE.

    Raises:
        ValueError: a title that begins as a number is no wavelength, or the bands with the specular
            component are others than those without.
    """
    header = cells.header
    notes = cells.source.notes
    bands: dict[str, dict[int, float]] = {}
    others: list[int] = []
    for i, title in enumerate(header):
        column_band = _band_of(cells, title) if i else None
        if column_band is not None:
            bands.setdefault(column_band.specular, {})[i] = column_band.wavelength
        elif i and not title:
            notes.append(f"column {i + 1} has no title and is left out")
        elif i and title[0].isdigit():
            raise cells.error(f"column {title!r} is not a wavelength in nm")
        else:
            others.append(i)
    one, *more = bands.items()
    for specular, at in more:
        if list(at.values()) != list(one[1].values()):
            raise cells.error(
                f"bands of {specular or 'no name'} are others than those of {one[0] or 'no name'}; "
                "export both at the same wavelengths",
            )
    grid = _check_grid(cells, np.array([*one[1].values()]))
    name_at = next((i for i in others if header[i].lower() in _NAMES), 0)
    others.remove(name_at)
    # A column may say of each line which kind of reading it is.
    kind_at = next((i for i in others if _KIND_TITLE.search(header[i])), None)
    if others:
        other_titles = shorten(", ".join(header[i] for i in others))
        notes.append(f"columns that are no bands are kept with the spectra: {other_titles}")
    if more:
        words = ", ".join(f"NAME {word} ({MODES[word]})" for word in bands if word)
        notes.append(f"each line gives a spectrum for each kind of reading: {words}")
    elif one[0] and not others:
        notes.append(f"all bands are taken as {MODES[one[0]]}")
    numbers = [i for at in bands.values() for i in at]
    cells = replace(cells, short=not others and len(numbers) + 1 < len(header))
    lines, (names, *texts), values = _read_rows(
        cells, [name_at, *others], numbers, most=_MAX_SPECTRA
    )
    kinds = [*bands] if more else [""]
    for i, column in zip(others, texts, strict=True):
        attributes[header[i]] = [word for word in column for _ in kinds]
    if kind_at is not None and not more:
        names = [" ".join(pair) for pair in zip(names, attributes[header[kind_at]], strict=True)]
    names = [unshield_name(f"{name} {kind}" if kind else name) for name in names for kind in kinds]
    if len(set(names)) < len(names):
        line_of: dict[str, int] = {}
        for number, name in zip(np.repeat(lines, len(kinds)).tolist(), names, strict=True):
            _check_name(cells, number, name, line_of)
    return names, grid, values.reshape(-1, grid.size)


def _read_long(cells: _Cells, grids: list[int], names: dict[int, str]) -> tuple[Bands, Rows]:
    """Wavelengths and values of a table with a sample a column.

    Args:
        cells: the table.
        grids: columns of wavelengths.
        names: of the samples, by their columns.
    """
    numbers = [grids[0], *names, *grids[1:]]
    blanks = len(grids) > 1
    short = sorted(numbers) != [*range(len(cells.header))]
    lines = _to_text(cells, grids[0])
    cells = replace(cells, lines=lines, blanks=blanks, short=short)
    _, _, table = _read_rows(cells, (), numbers, grids=grids, names=names)
    values = table.T[1 : len(names) + 1]
    if not blanks:
        return _check_grid(cells, table[:, 0]), values
    # Some spectra may be shorter: empty cells below them.
    columns = [table.T[0], *table.T[len(names) + 1 :]]
    checked = [_check_grid(cells, column[~np.isnan(column)]) for column in columns]
    common = reduce(np.intersect1d, checked)
    if common.size < 2:
        raise cells.source.error(
            "columns of wavelengths have none in common; export spectra at the same wavelengths, "
            "or in files of their own"
        )
    if any(grid.size > common.size for grid in checked):
        cells.source.notes.append(f"spectra share {describe_grid(common)}, and are read there")
    spectra = []
    for at, column in zip(names, values, strict=True):
        which = sum(start < at for start in grids) - 1
        order = np.argsort(checked[which])
        rows = order[np.searchsorted(checked[which], common, sorter=order)]
        spectra.append(column[~np.isnan(columns[which])][rows])
    return common, np.array(spectra)


def _to_text(cells: _Cells, grid: int) -> Iterator[NumberedLine]:
    """Lines of a table with a sample a column, up to a text where wavelengths are below an empty
    line: means and the like stand there.
    """
    before = cells.header_line
    for number, text in cells.lines:
        if number > before + 1 and before > cells.header_line:
            row = _split(cells.source, cells.delimiter, number, text)
            if grid >= len(row) or cells.wavelength(row[grid]) is None:
                cells.source.notes.append(
                    f"the table ends above line {number}: {shorten(text.strip()[:40])}"
                )
                return
        before = number
        yield number, text


def _check_name(cells: _Cells, line: int, name: str, line_of: dict[str, int]) -> None:
    """Refuse a sample without a name, or with one of those before, whose lines are kept."""
    if not name:
        raise cells.error("a sample has no name", line)
    if name in line_of:
        raise cells.error(
            f"sample {name!r} is already on line {line_of[name]}; names must differ", line
        )
    line_of[name] = line


def _triples(cells: _Cells) -> list[int] | None:
    """Columns of name, wavelength and value in a table of a value a row, or None if it is another
    layout.
    """
    kinds = (_NAME_TITLE, WAVELENGTH_TITLE, _VALUE_TITLE)
    places = [[i for i, title in enumerate(cells.header) if kind.match(title)] for kind in kinds]
    order = [i for at in places for i in at]
    one_each = all(len(at) == 1 for at in places) and sorted(order) == [0, 1, 2]
    return order if one_each and len(cells.header) == 3 else None


def _read_triples(
    cells: _Cells, name_at: int, wavelength_at: int, value_at: int
) -> tuple[list[str], Bands, Rows]:
    """Names, wavelengths and values of a table with a value a row; all samples must have the same
    wavelengths.
    """
    lines, (words,), table = _read_rows(
        cells, [name_at], [wavelength_at, value_at], grids=[wavelength_at]
    )
    rows = {name: i for i, name in enumerate(dict.fromkeys(words))}
    names = [unshield_name(name) for name in rows]
    grid = _check_grid(cells, np.unique(table[:, 0]))
    # Places in the table of a sample a row, of which each must be taken once.
    cell = np.array([rows[name] for name in words]) * grid.size + np.searchsorted(grid, table[:, 0])
    order = np.argsort(cell, kind="stable")
    again = order[1:][np.diff(cell[order]) == 0]
    gap = int(np.append(cell[order] != np.arange(cell.size), True).argmax())
    row, band = divmod(int(cell[again.min()]) if again.size else gap, grid.size)
    if again.size:
        raise cells.error(
            f"sample {names[row]!r} has a value at {grid[band]:g} nm already", lines[again.min()]
        )
    if row < len(names):
        raise cells.source.error(
            f"sample {names[row]!r} has no value at {grid[band]:g} nm, where others have one"
        )
    return names, grid, table[order, 1].reshape(-1, grid.size)
