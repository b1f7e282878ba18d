"""Where the table begins in a text file as an instrument's software exports it: below its own lines
on the instrument, the date and the like.

Titles of bands are told here, too, as software writes them: ``400``, ``400 nm``, ``R 400 nm``,
``SPECTRAL_NM400``, ``SCI_400nm``, ``400nm(SCE)``.
"""

import re
from itertools import pairwise
from typing import NamedTuple

from ..source import Source
from ..words import is_number, read_number

# In the languages whose spreadsheets write such tables, too.
WAVELENGTH_TITLE = re.compile(
    r"^(wave\s*length|wl\b|wvl?\b|lambda|λ|nm\b|\[?nm\]?$|wellenl(ä|ae?)nge|longueurs? "
    r"d.onde|lunghezz[ae] d.onda|"
    r"longitud(es)? de onda|comprimentos? de "
    r"onda|golflengte|v(å|aa?)gl(ä|ae?)ngd|bølgel(æ|ae)ngde|długość fali)",
    re.IGNORECASE,
)
_UNIT = r"[\[(]?(?:nm)?[\])]?"
_SPECULAR = r"SC[IE]|SPIN|SPEX"
_BAND = re.compile(
    rf"(?:(?P<before>{_SPECULAR})|spectral|spec|refl\w*|%?r)?[\s_.:-]*{_UNIT}[\s_.:-]*"
    rf"(?P<nm>\d{{3,4}}(?:[.,]\d+)?)\s*{_UNIT}[\s_-]*[\[(]?(?P<after>{_SPECULAR})?[\])]?"
    r"(?:\s*[\[(]?%[\])]?)?",
    re.IGNORECASE,
)
# Ocean Optics' OceanView, SpectraSuite and OOIBase32.
_BEGIN = re.compile(r">{3,}\s*Begin\b.*Spectral Data\s*<{3,}", re.IGNORECASE)
END = re.compile(r">{3,}\s*End\b.*Spectral Data\s*<{3,}", re.IGNORECASE)
_END_OF_ELEMENT = re.compile(r"</[A-Za-z][\w.:-]*>")
# A first line of more cells is a header, not a line on the instrument.
_FEW = 4


class BandTitle(NamedTuple):
    """What a column's title says: its wavelength in nm, and whether the specular component is in
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


def lines_above(source: Source) -> tuple[int, bool]:
    """How many lines of a file stand above its table, and whether numbers without a header follow.

    A header is a line with two wavelengths or more, or whose first title is that of wavelengths,
    and numbers below. Where there is none, the first line of data is one; its reader says what it
    lacks.

    Raises:
        ValueError: a row of numbers, as long as the table's, or the rest of an XML file stands
            above it.
    """
    start, numbers = _start(source.first_lines)
    _check_above(source, start)
    return start, numbers


def _start(lines: list[str]) -> tuple[int, bool]:
    """The same of a file's first lines."""
    # More lines than this above its table no software writes.
    most = 200
    for number, line in enumerate(lines[:most], start=1):
        if _BEGIN.fullmatch(line.strip()):
            return number, True
    # Rows of numbers below each other that make a table without a header.
    rows = 3
    data = [(i, line) for i, line in enumerate(lines) if is_data(line)][: most + rows]
    if not data:
        return 0, False
    # A header on the first line is looked at no further, however wrong the line below it is.
    if _names_bands(data[0][1]) and len(_cells(data[0][1])) > _FEW:
        return 0, False
    headers = [
        (len(_cells(line)), -i)
        for (i, line), (_, below) in pairwise(data)
        if _is_header(line, below)
    ]
    if headers:
        # Two numbers of the instrument's own may look like bands: the widest is the header.
        start = -max(headers)[1]
        return (0 if start == data[0][0] else start), False
    for k, (i, line) in enumerate(data):
        if k + rows <= len(data) and _are_numbers([row for _, row in data[k : k + rows]]):
            # A line of titles above is a header that lacks something: its reader says what.
            if k and _may_be_titles(data[k - 1][1], line):
                return (data[k - 1][0] if k > 1 else 0), False
            return (i if k else 0), True
    return 0, False


def _check_above(source: Source, start: int) -> None:
    """Refuse rows of the table that stand above its header, and what shows that it is no table."""
    lines = source.first_lines
    if any(map(_END_OF_ELEMENT.search, lines[:start])):
        raise source.error(
            "it looks like XML, such as CxF, whose beginning is missing; export it again"
        )
    table = next((line for line in lines[start:] if is_data(line)), "")
    width = len(_cells(table))
    for number, line in enumerate(lines[:start], start=1):
        if not is_data(line):
            continue
        first, *others = _cells(line)
        # Two or three numbers may be the instrument's own.
        is_row = _is_value(first) or width > _FEW
        if is_row and 1 + len(others) == width and all(map(_is_value, others)):
            raise source.error(
                f"a row of the table stands above its beginning on line {start + 1}; move it down",
                number,
            )


def not_read(above: int) -> str:
    """Note on lines above a table."""
    return f"{above} lines above the table are not read" if above > 1 else "line 1 is not read"


def is_data(line: str) -> bool:
    """Whether a line is neither blank nor a comment."""
    return bool(line.strip(" \t,;")) and not line.lstrip().startswith("#")


def delimiter_of(header: str) -> str:
    """Delimiter of a header line; a blank if there is no better one."""
    # Outside quotes only, so that a quoted title may hold a comma.
    bare = re.sub(r'"[^"]*"', "", header)
    counts = {delimiter: bare.count(delimiter) for delimiter in "\t;,"}
    best = max(counts, key=lambda delimiter: counts[delimiter])
    return best if counts[best] else " "


def numbers_of(line: str) -> list[str]:
    """Cells of a line of numbers without a header, decimal commas as points: separated by
    semicolons, tabs or blanks, else by commas.
    """
    if ";" in line:
        cells = line.split(";")
    elif len(line.split()) > 1 and not re.search(r",\s", line):
        cells = line.split()
    else:
        return [cell.strip() for cell in line.rstrip(" \t,").split(",")]
    return [cell.strip().replace(",", ".") for cell in cells if cell.strip()]


def _cells(line: str) -> list[str]:
    """Cells of a line that may be a header, without quotes."""
    delimiter = delimiter_of(line)
    cells = line.split() if delimiter == " " else line.split(delimiter)
    return [cell.strip().strip('"').strip() for cell in cells]


def _names_bands(line: str) -> bool:
    """Whether a line's first cell is a word, and two others are bands in order."""
    first, *others = _cells(line)
    bands = [found for title in others if (found := band(title)) is not None]
    if is_number(first) or len(bands) < 2:
        return False
    steps = [b.wavelength - a.wavelength for a, b in pairwise(bands) if a.specular == b.specular]
    return all(step > 0 for step in steps) or all(step < 0 for step in steps)


def _is_header(line: str, below: str) -> bool:
    """Whether a line names bands or wavelengths, and the line below it has values for them."""
    titles, values = _cells(line), _cells(below)
    if len(titles) < 2 or len(titles) != len(values):
        return False
    if WAVELENGTH_TITLE.match(titles[0]):
        return _is_value(values[0])
    return _names_bands(line) and all(
        _is_value(value) for title, value in zip(titles, values, strict=True) if band(title)
    )


def _may_be_titles(line: str, below: str) -> bool:
    """Whether a line above numbers may be their header."""
    titles = _cells(line)
    if WAVELENGTH_TITLE.match(titles[0]):
        return True
    return delimiter_of(line) == delimiter_of(below) and len(titles) == len(_cells(below))


def _is_value(cell: str) -> bool:
    return is_number(cell.replace(",", "."))


def _are_numbers(lines: list[str]) -> bool:
    """Whether lines are rows of numbers, as long as each other, that begin with a wavelength."""
    rows = [numbers_of(line) for line in lines]
    return all(len(row) == len(rows[0]) >= 2 and all(map(is_number, row)) for row in rows)
