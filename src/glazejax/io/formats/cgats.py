"""CGATS text (CGATS.17, ISO 28178, IT8, ArgyllCMS): fields named after BEGIN_DATA_FORMAT, sets
after BEGIN_DATA.
"""

import re
from dataclasses import dataclass, field

import numpy as np

from ..finish import RawSpectra
from ..quantity import first_quantity
from ..source import Source
from ..words import finite_number, unshield_name

_CELL = re.compile(r'"([^"]*)"|(\S+)')
# A # at the start or after a blank, outside quotes, and what follows it.
_COMMENT = re.compile(r'("[^"]*(?:"|$))|(?<!\S)#.*')
# SPECTRAL_NM_380, SPECTRAL_NM380, SPECTRAL_380, SPEC_380, R_380, nm380, 380nm, 380; with the unit
# said SPECTRAL_PCT_380, SPECTRAL_DEC380
_BAND = re.compile(
    r"(?:spectral|spec|r|refl)?_?(?P<unit>pct|percent|dec)?_?(?:nm)?_?"
    r"(?P<nm>\d{3,4}(?:\.\d+)?)_?(?:nm)?",
    re.IGNORECASE,
)
_SCALES = {"PCT": 100.0, "PERCENT": 100.0, "DEC": 1.0}
# The standard's own form: a field of wavelengths before each field of values.
_PAIR = ("SPECTRAL_NM", "SPECTRAL_PCT", "SPECTRAL_DEC")
_NAMES = ("SAMPLE_NAME", "SAMPLENAME", "NAME", "SAMPLE_LOC", "SAMPLE_ID", "SAMPLEID", "STRING")
# Keywords that say what was measured.
_SAYING = re.compile(r"MEAS\w*_(TYPE|MODE)|DEVICE_CLASS|DISPLAY\w*|LUMINANCE\w*")


@dataclass
class _CgatsTable:
    """One table of the file: keywords, fields and sets, each set with its line."""

    source: Source
    keywords: dict[str, str]
    fields: list[str] = field(default_factory=list)
    sets: list[tuple[int, list[str]]] = field(default_factory=list)
    ended: bool = False

    def bands(self) -> dict[int, float]:
        """Wavelength of each spectral field, by its position."""
        matches = enumerate(map(_BAND.fullmatch, self.fields))
        wavelengths = {at: float(match["nm"]) for at, match in matches if match}
        return wavelengths if len(wavelengths) > 1 else {}

    def number(self, title: str, cell: str, line: int | None = None) -> float:
        """Number in a cell; a decimal comma is understood."""
        value = finite_number(cell.replace(",", "."))
        if value is None:
            raise self.source.error(f"field {title}: {cell[:30]!r} is not a finite number", line)
        return value


def read_cgats(source: Source) -> RawSpectra:
    """Read the first table of a CGATS file that has spectra.

    Bands are fields such as ``SPECTRAL_NM_380``, ``SPEC_380`` or, in percent, ``SPECTRAL_PCT_380``;
    or pairs of fields ``SPECTRAL_NM SPECTRAL_PCT``, whose wavelengths stand in the sets.
    SPECTRAL_NORM says what value stands for a reflectance of 1. Names come from SAMPLE_NAME, else
    SAMPLE_ID; the other fields are attributes.

    Raises:
        ValueError: no BEGIN_DATA_FORMAT, no END_DATA (a file cut short), no spectral fields, a set
            of another length than the fields, another number of sets than the file promises, or a
            value that is no number.
    """
    sheets = _sheets(source)
    if not any(sheet.fields for sheet in sheets):
        raise source.error(
            "CGATS text without fields: there is no BEGIN_DATA_FORMAT ... END_DATA_FORMAT"
        )
    sheet = next((s for s in sheets if s.bands() or _PAIR[0] in map(str.upper, s.fields)), None)
    if sheet is None:
        fields = " ".join(sheets[0].fields[:6])
        raise source.error(
            f"CGATS text without spectra: no field such as SPECTRAL_NM_400 (there are {fields} ...)"
        )
    _check_complete(sheet)
    _name_pairs(sheet)
    bands = sheet.bands()
    titles = [title.upper() for title in sheet.fields]
    name_at = next((titles.index(name) for name in _NAMES if name in titles), None)
    others = [at for at in range(len(titles)) if at not in bands and at != name_at]
    said = [f'{title} "{word}"' for title, word in sheet.keywords.items() if _SAYING.match(title)]
    return RawSpectra(
        wavelengths=np.array(list(bands.values())),
        names=[
            str(number) if name_at is None else unshield_name(cells[name_at])
            for number, (_, cells) in enumerate(sheet.sets, start=1)
        ],
        values=np.array(
            [
                [sheet.number(sheet.fields[at], cells[at], line) for at in bands]
                for line, cells in sheet.sets
            ]
        ),
        format="CGATS text",
        notes=[f"the file has {len(sheets)} tables; the first with spectra was read"]
        * (len(sheets) > 1),
        quantity=first_quantity(said),
        scale=_scale(sheet),
        attributes={sheet.fields[at]: [cells[at] for _, cells in sheet.sets] for at in others},
    )


def _sheets(source: Source) -> list[_CgatsTable]:
    """Tables of the file; keywords above the first hold for all."""
    sheets: list[_CgatsTable] = []
    keywords: dict[str, str] = {}
    state = "keywords"
    for number, line in enumerate(source.text().splitlines(), start=1):
        cells = [quoted or plain for quoted, plain in _CELL.findall(_COMMENT.sub(r"\1", line))]
        first = cells[0].upper() if cells else ""
        if first == "BEGIN_DATA_FORMAT":
            sheets.append(_CgatsTable(source, dict(keywords)))
            state = "format"
            del cells[0]
        elif first == "BEGIN_DATA" and state != "data":
            if not sheets:
                raise source.error("BEGIN_DATA without BEGIN_DATA_FORMAT before it", number)
            if sheets[-1].ended:  # a further table with the same fields
                sheets.append(_CgatsTable(source, {}, list(sheets[-1].fields)))
            sheets[-1].keywords.update(keywords)
            state = "data"
            del cells[0]
        elif first in ("END_DATA_FORMAT", "END_DATA"):
            if sheets and first == "END_DATA":
                sheets[-1].ended = True
            state = "keywords"
            continue
        if state == "format":
            sheets[-1].fields += cells
        elif state == "data" and cells:
            by_tab = [cell.strip().strip('"') for cell in line.rstrip("\t").split("\t")]
            # Names with blanks stand without quotes where tabs separate.
            tabs = len(cells) != len(sheets[-1].fields) == len(by_tab)
            sheets[-1].sets.append((number, by_tab if tabs else cells))
        elif len(cells) > 1:
            keywords[first] = cells[1]
    if sheets:
        # Below the last table a keyword can only be about that.
        sheets[-1].keywords.update(keywords)
    return sheets


def _name_pairs(sheet: _CgatsTable) -> None:
    """Put the wavelengths of pairs into the names of their values, as all other fields have them.

    Raises:
        ValueError: a wavelength without a value, or sets with other wavelengths than the first.
    """
    error = sheet.source.error
    top, one = sheet.sets[0]
    for at in reversed(range(len(sheet.fields))):
        if sheet.fields[at].upper() != _PAIR[0]:
            continue
        title = "".join(sheet.fields[at + 1 : at + 2]).upper() or "no field"
        if title not in _PAIR[1:]:
            raise error(f"{_PAIR[0]} is followed by {title}, not by SPECTRAL_PCT or _DEC")
        for line, cells in sheet.sets:
            if cells[at] != one[at]:
                raise error(
                    f"the wavelength is {cells[at][:20]} where the first set has {one[at][:20]}; a "
                    "table has one grid",
                    line,
                )
        wavelength = sheet.number(_PAIR[0], one[at], top)
        if not 100 <= wavelength < 10_000:
            raise error(f"{wavelength:g} is no wavelength in nm", top)
        sheet.fields[at : at + 2] = [f"{title}_{wavelength:.10g}"]
        for _, cells in sheet.sets:
            del cells[at]


def _check_complete(sheet: _CgatsTable) -> None:
    """Refuse a file that was cut short."""
    error = sheet.source.error
    if not sheet.ended:
        raise error(f"there is no END_DATA after {len(sheet.sets)} sets; the file was cut short")
    for what, things in (("SETS", sheet.sets), ("FIELDS", sheet.fields)):
        title = f"NUMBER_OF_{what}"
        promised = sheet.keywords.get(title, str(len(things)))
        if promised != str(len(things)):
            raise error(f"{title} promises {promised} {what.lower()}, and there are {len(things)}")
    if not sheet.sets:
        raise error("there are fields but no sets between BEGIN_DATA and END_DATA")
    for line, cells in sheet.sets:
        if len(cells) != len(sheet.fields):
            raise error(f"{len(cells)} values where there are {len(sheet.fields)} fields", line)


def _scale(sheet: _CgatsTable) -> float | None:
    """Value that stands for a reflectance of 1, if the file says so."""
    norm = sheet.keywords.get("SPECTRAL_NORM")
    if norm is not None:
        scale = sheet.number("SPECTRAL_NORM", norm)
        if scale <= 0:
            raise sheet.source.error(f"SPECTRAL_NORM is {norm}; it must be positive")
        return scale
    units = [match["unit"] for match in map(_BAND.fullmatch, sheet.fields) if match]
    return next((_SCALES[unit.upper()] for unit in units if unit), None)
