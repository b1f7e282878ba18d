"""CGATS text (CGATS.17, ISO 28178, IT8, ArgyllCMS): fields named after BEGIN_DATA_FORMAT, sets
after BEGIN_DATA.
"""

import math
import re
from dataclasses import dataclass, field

import numpy as np

from ..finish import RawSpectra
from ..quantity import first_quantity
from ..source import Source
from ..words import read_number, unshield_name

_CELL = re.compile(r'"([^"]*)"|(\S+)')
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


@dataclass
class _CgatsTable:
    """One table of the file: keywords, fields and sets, each set with its line."""

    keywords: dict[str, str] = field(default_factory=dict)
    fields: list[str] = field(default_factory=list)
    sets: list[tuple[int, list[str]]] = field(default_factory=list)
    ended: bool = False


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
    if not sheets or not any(sheet.fields for sheet in sheets):
        raise source.error(
            "CGATS text without fields: there is no BEGIN_DATA_FORMAT ... END_DATA_FORMAT"
        )
    sheet = next((s for s in sheets if _bands(s) or _PAIR[0] in map(str.upper, s.fields)), None)
    if sheet is None:
        fields = " ".join(sheets[0].fields[:6])
        raise source.error(
            f"CGATS text without spectra: no field such as SPECTRAL_NM_400 (there are {fields} ...)"
        )
    _check_complete(source, sheet)
    _name_pairs(source, sheet)
    bands = _bands(sheet)
    named = next((name for name in _NAMES if name in [f.upper() for f in sheet.fields]), None)
    name_at = None if named is None else [f.upper() for f in sheet.fields].index(named)
    names = []
    rows = []
    for number, (line, cells) in enumerate(sheet.sets, start=1):
        names.append(str(number) if name_at is None else unshield_name(cells[name_at]))
        rows.append([_value(source, line, sheet.fields[at], cells[at]) for at in bands])
    scale = _scale(source, sheet)
    others = [at for at in range(len(sheet.fields)) if at not in bands and at != name_at]
    attributes = {sheet.fields[at]: [cells[at] for _, cells in sheet.sets] for at in others}
    notes = (
        []
        if len(sheets) == 1
        else [f"the file has {len(sheets)} tables; the first with spectra was read"]
    )
    return RawSpectra(
        wavelengths=np.array(list(bands.values())),
        names=names,
        values=np.array(rows),
        format="CGATS text",
        notes=notes,
        quantity=_quantity(sheet),
        scale=scale,
        attributes=attributes,
    )


def _quantity(sheet: _CgatsTable) -> str:
    """Keyword that says what was measured; empty if none does."""
    titles = ("MEAS_TYPE", "MEASUREMENT_TYPE", "DEVICE_CLASS", "DISPLAY")
    said = [f'{title} "{sheet.keywords[title]}"' for title in titles if title in sheet.keywords]
    return first_quantity(said)


def _sheets(source: Source) -> list[_CgatsTable]:
    """Tables of the file; keywords above the first hold for all."""
    sheets = []
    keywords = {}
    state = "keywords"
    for number, line in enumerate(source.text().splitlines(), start=1):
        cells = [quoted or plain for quoted, plain in _CELL.findall(_without_comment(line))]
        if not cells:
            continue
        first = cells[0].upper()
        if first == "BEGIN_DATA_FORMAT":
            sheets.append(_CgatsTable(dict(keywords)))
            state = "format"
            cells = cells[1:]
        elif first == "BEGIN_DATA" and state != "data":
            if not sheets:
                raise source.error("BEGIN_DATA without BEGIN_DATA_FORMAT before it", number)
            if sheets[-1].ended:  # a further table with the same fields
                sheets.append(_CgatsTable(dict(keywords), list(sheets[-1].fields)))
            sheets[-1].keywords.update(keywords)
            state = "data"
            cells = cells[1:]
        elif first == "END_DATA_FORMAT":
            state = "keywords"
            cells = []
        elif first == "END_DATA":
            if sheets:
                sheets[-1].ended = True
            state = "keywords"
            cells = []
        if not cells:
            continue
        if state == "format":
            sheets[-1].fields += cells
        elif state == "data":
            by_tab = [cell.strip().strip('"') for cell in line.rstrip("\t").split("\t")]
            if len(cells) != len(sheets[-1].fields) == len(by_tab):
                # Names with blanks stand without quotes where tabs separate.
                cells = by_tab
            sheets[-1].sets.append((number, cells))
        elif len(cells) > 1:
            keywords[first] = cells[1]
    if sheets:
        # Below the last table a keyword can only tell of that.
        sheets[-1].keywords.update(keywords)
    return sheets


def _without_comment(line: str) -> str:
    """Line up to a # that stands at its start or after a blank, outside quotes."""
    inside = False
    for i, letter in enumerate(line):
        if letter == '"':
            inside = not inside
        elif letter == "#" and not inside and (i == 0 or line[i - 1].isspace()):
            return line[:i]
    return line


def _bands(sheet: _CgatsTable) -> dict[int, float]:
    """Wavelength of each spectral field, by its position."""
    found = {}
    for at, name in enumerate(sheet.fields):
        if match := _BAND.fullmatch(name):
            found[at] = float(match["nm"])
    return found if len(found) > 1 else {}


def _name_pairs(source: Source, sheet: _CgatsTable) -> None:
    """Put the wavelengths of pairs into the names of their values, as all other fields have them.

    Raises:
        ValueError: a wavelength without a value, or sets with other wavelengths than the first.
    """
    for at in reversed(range(len(sheet.fields))):
        if sheet.fields[at].upper() != _PAIR[0]:
            continue
        title = sheet.fields[at + 1].upper() if at + 1 < len(sheet.fields) else "no field"
        if title not in _PAIR[1:]:
            raise source.error(f"{_PAIR[0]} is followed by {title}, not by SPECTRAL_PCT or _DEC")
        for line, cells in sheet.sets:
            if cells[at] != sheet.sets[0][1][at]:
                raise source.error(
                    f"the wavelength is {cells[at][:20]} where the first set has "
                    f"{sheet.sets[0][1][at][:20]}; a table has one grid",
                    line,
                )
        wavelength = _value(source, sheet.sets[0][0], _PAIR[0], sheet.sets[0][1][at])
        if not 100 <= wavelength < 10_000:
            raise source.error(f"{wavelength:g} is no wavelength in nm", sheet.sets[0][0])
        sheet.fields[at : at + 2] = [f"{title}_{wavelength:.10g}"]
        for _, cells in sheet.sets:
            del cells[at]


def _check_complete(source: Source, sheet: _CgatsTable) -> None:
    """Refuse a file that was cut short."""
    promised = sheet.keywords.get("NUMBER_OF_SETS")
    if not sheet.ended:
        raise source.error(
            f"there is no END_DATA after {len(sheet.sets)} sets; the file was cut short"
        )
    if promised is not None and promised != str(len(sheet.sets)):
        raise source.error(
            f"NUMBER_OF_SETS promises {promised} sets, and there are {len(sheet.sets)}"
        )
    fields = sheet.keywords.get("NUMBER_OF_FIELDS")
    if fields is not None and fields != str(len(sheet.fields)):
        raise source.error(
            f"NUMBER_OF_FIELDS promises {fields} fields, and there are {len(sheet.fields)}"
        )
    if not sheet.sets:
        raise source.error("there are fields but no sets between BEGIN_DATA and END_DATA")
    for line, cells in sheet.sets:
        if len(cells) != len(sheet.fields):
            raise source.error(
                f"{len(cells)} values where there are {len(sheet.fields)} fields", line
            )


def _scale(source: Source, sheet: _CgatsTable) -> float | None:
    """Value that stands for a reflectance of 1, if the file says so."""
    norm = sheet.keywords.get("SPECTRAL_NORM")
    if norm is not None:
        scale = _value(source, None, "SPECTRAL_NORM", norm)
        if scale <= 0:
            raise source.error(f"SPECTRAL_NORM is {norm}; it must be positive")
        return scale
    units = [match["unit"] for name in sheet.fields if (match := _BAND.fullmatch(name))]
    return next((_SCALES[unit.upper()] for unit in units if unit), None)


def _value(source: Source, line: int | None, title: str, cell: str) -> float:
    """Number in a cell; a decimal comma is understood."""
    try:
        value = read_number(cell.replace(",", "."))
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise source.error(f"field {title}: {cell[:30]!r} is not a finite number", line)
    return value
