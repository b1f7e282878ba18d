"""JSON lists of spectra, as Kimera's: an entry of type ``wavelengths``, then entries with name and
reflectance.
"""

import json
import sys
from typing import Any

import numpy as np

from ..finish import RawSpectra
from ..source import Source

_EXPECTED = (
    'expected a list of {"type": "wavelengths", "values": [...]} and {"name": ..., '
    '"reflectance": [...]}'
)


def read_listing(source: Source) -> RawSpectra:
    """Read a JSON list of spectra; entries' other fields, such as components, are attributes (as
    JSON).

    Raises:
        ValueError: not JSON, of another shape, without wavelengths, or a spectrum of another
            length.
    """
    text = source.text()
    try:
        entries = json.loads(text)
    except json.JSONDecodeError as error:
        raise source.error(
            f"not legal JSON ({error.msg}); was it cut short?", error.lineno
        ) from None
    except ValueError:
        raise source.error(
            "it holds a number of thousands of digits, no wavelength or reflectance"
        ) from None
    if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
        raise source.error(f"{_EXPECTED}")
    grids = [entry for entry in entries if entry.get("type") == "wavelengths"]
    spectra = [entry for entry in entries if "reflectance" in entry]
    if len(grids) != 1:
        raise source.error(
            f"{len(grids)} entries of wavelengths where there must be one; {_EXPECTED}"
        )
    if not spectra:
        raise source.error(f"no entry has a reflectance; {_EXPECTED}")
    wavelengths = _numbers(source, "wavelengths", grids[0].get("values"))
    names = []
    values = []
    for number, entry in enumerate(spectra, start=1):
        name = str(entry.get("name", "")) or f"spectrum {number}"
        row = _numbers(source, name, entry["reflectance"])
        if row.size != wavelengths.size:
            raise source.error(f"{name!r} has {row.size} values for {wavelengths.size} wavelengths")
        names.append(name)
        values.append(row)
    titles = sorted({key for entry in spectra for key in entry} - {"name", "reflectance"})
    attributes = {title: [_text(entry.get(title, "")) for entry in spectra] for title in titles}
    return RawSpectra(
        wavelengths=wavelengths,
        names=names,
        values=np.array(values),
        format="JSON list of spectra",
        wavelength_unit=_text(grids[0].get("unit", "")),
        attributes=attributes,
    )


def _numbers(source: Source, name: str, values: Any) -> np.ndarray:
    """Row of numbers, or an error that names whose it is."""
    if not isinstance(values, list) or not values:
        raise source.error(f"{name!r} has no list of numbers")
    wrong = [
        value for value in values if isinstance(value, bool) or not isinstance(value, int | float)
    ]
    if wrong:
        raise source.error(f"{name!r} holds {str(wrong[0])[:20]!r}, not a number")
    try:
        return np.array(values, float)
    except OverflowError:
        place = next(
            i
            for i, value in enumerate(values, start=1)
            if isinstance(value, int) and abs(value) > sys.float_info.max
        )
        raise source.error(
            f"{name!r}: number {place} has {len(str(values[place - 1]))} digits, too large"
        ) from None


def _text(value: Any) -> str:
    return value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)
