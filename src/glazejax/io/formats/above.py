"""Search for the beginning of the table in a text file as an instrument's software exports it:
below its own lines on the instrument, the date and the like.

Titles of bands are recognised here, too, as software writes them: ``400``, ``400 nm``,
``R 400 nm``, ``SPECTRAL_NM400``, ``SCI_400nm``, ``400nm(SCE)``.
"""

import re
from collections.abc import Iterable, Iterator
from itertools import pairwise, takewhile
from typing import NamedTuple

from ..quantity import MODES, has_meaning, is_no_name, length_unit
from ..source import NumberedLine, Source
from ..words import is_number, read_number

# In the languages whose spreadsheets write such tables, too.
WAVELENGTH_TITLE = re.compile(
    r"^(wave\s*length|wave\b|wl\b|wvl?\b|lambda|λ|nm\b|\[?nm\]?$|wellenl(ä|ae?)nge|longueurs? "
    r"d.onde|lunghezz[ae] d.onda|"
    r"longitud(es)? de onda|comprimentos? de "
    r"onda|golflengte|v(å|aa?)gl(ä|ae?)ngd|bølgel(æ|ae)ngde|długość fali)",
    re.IGNORECASE,
)
_UNIT = r"[\[(]?(?:nm)?[\])]?"
_SPECULAR = "|".join(MODES)
_BAND = re.compile(
    rf"(?:(?P<before>{_SPECULAR})|spec(?:tral)?(?:_pct|_dec)?|refl\w*|%?r%?|%t|abs\w*|k/s)?[\s_.:-]*"
    rf"{_UNIT}[\s_.:-]*"
    rf"(?P<nm>\d{{3,4}}(?:[.,]\d+)?)\s*{_UNIT}[\s_-]*[\[(]?(?P<after>{_SPECULAR})?[\])]?"
    r"(?:[\s,_]*[\[(]?%[\])]?)?",
    re.IGNORECASE,
)
# Rows of numbers below each other that make a table without a header.
_ROWS = 3
# A row of numbers, in which decimal commas may outnumber what separates.
_DECIMAL = re.compile(r"\s*[\d.,]+\s*[;\t]")
_END_OF_ELEMENT = re.compile(r"</[A-Za-z][\w.:-]*>")
# A first line of more cells is a header, not a line on the instrument.
_FEW = 4


class BandTitle(NamedTuple):
    """Meaning of a column's title: its wavelength in nm, and whether the specular component is in
    it (SCI, SCE, SPIN, SPEX; empty where it does not say).
    """

    wavelength: float
    specular: str


def band(title: str) -> BandTitle | None:
    """Band of a column by its title, or None if the title names none."""
    title = title.strip()
    # No longer title names a band; blanks by the thousand in one would take hours to match.
    match = _BAND.fullmatch(title) if len(title) <= 100 else None
    if match is None:
        return None
    word = match["before"] or match["after"] or ""
    return BandTitle(read_number(match["nm"].replace(",", ".")), word.upper())


class TablePlace(NamedTuple):
    """Position of a table in a file.

    Attributes:
        above: how many lines stand above its titles, or its numbers.
        titles: how many lines of titles it has; none where numbers begin at once.
        sure: whether it is one; else the first line of data is taken for its header, and its reader
            says what that lacks.
    """

    above: int
    titles: int
    sure: bool


def find_table(source: Source) -> TablePlace:
    """Find the table of a file.

    A header is a line with two wavelengths or more, or with a title of wavelengths, and numbers
    below; or any line of titles above three rows of numbers, which need none. Where a header has
    units alone, the line above it is one as well.

    Raises:
        ValueError: a row of numbers, as long as the table's, or the rest of an XML file stands
            above it.
    """
    layout = _place(source.first_lines)
    _check_above(source, layout.above)
    return layout


def _place(lines: list[str]) -> TablePlace:
    """The same of a file's first lines."""
    # More lines than this above its table no software writes.
    most = 200
    begun = next((i for i, line in enumerate(lines[:most], start=1) if _is_mark(line)), 0)
    data = [*data_lines(enumerate(lines[begun:], start=begun + 1))]
    texts = [line for _, line in data[: most + _ROWS]]
    if not texts:
        return TablePlace(begun, int(not begun), False)
    k, titled, sure = _first(texts)
    if begun and not sure:
        return TablePlace(begun, 0, True)
    start = k
    while titled and start and _are_titles(texts[start - 1], texts[start]):
        start -= 1
    above = data[start][0] - 1 if start else begun
    return TablePlace(above, k + 1 - start if titled else 0, sure)


def _first(texts: list[str]) -> tuple[int, bool, bool]:
    """Find which line is the header or the first of the numbers, whether it is a header, and
    whether that is sure.
    """
    # A header on the first line is looked at no further, however wrong the line below it is.
    if _names_bands(texts[0]) and len(_cells(texts[0])) > _FEW:
        return 0, True, True
    headers = [
        (len(_cells(line)), -k)
        for k, (line, below) in enumerate(pairwise(texts))
        if _is_header(line, below)
    ]
    if headers:
        # Two numbers of the instrument's own may look like bands: the widest is the header.
        return -max(headers)[1], True, True
    for k, line in enumerate(texts[: len(texts) - _ROWS + 1]):
        if _are_numbers(texts[k : k + _ROWS]):
            titled = k > 0 and _may_be_titles(texts[k - 1], line)
            return k - titled, titled, True
    return 0, True, False


def _check_above(source: Source, start: int) -> None:
    """Refuse rows of the table that stand above its header, and what shows that it is no table."""
    lines = source.first_lines
    if any(map(_END_OF_ELEMENT.search, lines[:start])):
        raise source.error(
            "it looks like XML, such as CxF, whose beginning is missing; export it again"
        )
    width = len(_cells(next(filter(_is_data, lines[start:]), "")))
    for number, line in enumerate(lines[:start], start=1):
        if not _is_data(line):
            continue
        first, *others = _cells(line)
        # Two or three numbers may be the instrument's own.
        is_row = _is_value(first) or width > _FEW
        if is_row and 1 + len(others) == width and all(map(_is_value, others)):
            raise source.error(
                f"a row of the table stands above its beginning on line {start + 1}; move it down",
                number,
            )


def data_lines(lines: Iterable[NumberedLine]) -> Iterator[NumberedLine]:
    """Numbered lines that are neither blank nor comments, up to a mark that ends the numbers."""
    before = takewhile(lambda pair: not _is_mark(pair[1]), lines)
    return (pair for pair in before if _is_data(pair[1]))


def _is_data(line: str) -> bool:
    return bool(line.strip(" \t,;")) and not line.lstrip().startswith("#")


def delimiter_of(header: str) -> str:
    """Delimiter of a header line; a blank if there is no better one."""
    # Outside quotes only, so that a quoted title may hold a comma.
    bare = re.sub(r'"[^"]*"', "", header)
    counts = {delimiter: bare.count(delimiter) for delimiter in "\t;,"}
    best = max(counts, key=lambda delimiter: counts[delimiter])
    return best if counts[best] else " "


def delimiter_of_numbers(line: str) -> str:
    """Delimiter of a line of numbers, in which a comma may be the decimal point: a semicolon, tab
    or blank, else a comma.
    """
    for delimiter in ";\t":
        if delimiter in line:
            return delimiter
    return " " if len(line.split()) > 1 and not re.search(r",\s", line) else ","


def _is_mark(line: str) -> bool:
    """Return whether a line begins or ends the numbers, as ``>>>>>Begin ...<<<<<`` does."""
    return ">>>" in line and "<<<" in line


def is_wavelength_title(title: str) -> bool:
    """Return whether a title is that of wavelengths, or a unit of them that is no single letter."""
    unit = title.strip("[]() .")
    return bool(WAVELENGTH_TITLE.match(title)) or (
        unit[1:].isalpha() and length_unit(unit) in ("nm", "um", "angstrom")
    )


def _cells(line: str) -> list[str]:
    """Cells of a line that may be a header, without quotes."""
    delimiter = delimiter_of_numbers(line) if _DECIMAL.match(line) else delimiter_of(line)
    return [cell.strip().strip('"').strip() for cell in plain_cells(line, delimiter)]


def plain_cells(line: str, delimiter: str) -> list[str]:
    """Cells of a line without quotes, with the blanks around them unless blanks separate."""
    if delimiter != " ":
        return line.split(delimiter)
    return [cell for cell in line.replace("\t", " ").split(" ") if cell.strip()]


def _names_bands(line: str) -> bool:
    """Return whether a line's first cell is a word, and two others are bands in order."""
    first, *others = _cells(line)
    bands = [wavelength for title in others if (wavelength := band(title)) is not None]
    if is_number(first) or len(bands) < 2:
        return False
    steps = [b.wavelength - a.wavelength for a, b in pairwise(bands) if a.specular == b.specular]
    return all(step > 0 for step in steps) or all(step < 0 for step in steps)


def _is_header(line: str, below: str) -> bool:
    """Return whether a line names bands or wavelengths, and the line below it has values for
    them.
    """
    titles = _cells(line)
    values = _cells(below)
    # Spreadsheets leave out empty cells at the end.
    if len(titles) < 2 or len(values) > len(titles):
        return False
    grid = next((i for i, title in enumerate(titles) if is_wavelength_title(title)), None)
    if grid is not None:
        return grid < len(values) and _is_value(values[grid])
    return (
        len(titles) == len(values)
        and _names_bands(line)
        and all(
            _is_value(value) for title, value in zip(titles, values, strict=True) if band(title)
        )
    )


def _may_be_titles(line: str, below: str) -> bool:
    """Return whether a line above numbers may be their header."""
    titles = _cells(line)
    if any(map(is_wavelength_title, titles)):
        return True
    same = delimiter_of(line) == delimiter_of_numbers(below)
    return same and len(titles) == len(_cells(below))


def _are_titles(line: str, below: str) -> bool:
    """Return whether a line holds the titles of a line of units or numbers: it names wavelengths,
    or leaves them out where that names them, or names what each wavelength column begins.
    """
    titles = _cells(line)
    units = _cells(below)
    if not 1 < len(titles) <= len(units) or delimiter_of(line) != delimiter_of(below):
        return False
    grids = [i for i, unit in enumerate(units) if is_wavelength_title(unit)]
    others = [unit for i, unit in enumerate(units) if unit and i not in grids]
    named = next((i for i, title in enumerate(titles) if is_wavelength_title(title)), None)
    if named is None:
        begins = len(grids) > 1 or (grids and not "".join(titles[grids[0] : grids[0] + 1]))
    else:
        begins = named in grids or not units[named]
    return bool(begins) and all(
        is_no_name(unit) or is_number(unit) or has_meaning(unit) for unit in others
    )


def _is_value(cell: str) -> bool:
    return is_number(cell.replace(",", ".").removesuffix("%"))


def _are_numbers(lines: list[str]) -> bool:
    """Return whether lines are rows as long as each other that begin with a number, and have
    others.
    """
    rows = [plain_cells(line, delimiter_of_numbers(line)) for line in lines]
    return all(
        len(row) == len(rows[0])
        and _is_value(row[0])
        and 2 * sum(map(_is_value, row)) >= max(4, len(row))
        for row in rows
    )
