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
        raise source.error(_EXPECTED)
    grids = [entry for entry in entries if entry.get("type") == "wavelengths"]
    spectra = [entry for entry in entries if "reflectance" in entry]
    if len(grids) != 1:
        raise source.error(
            f"{len(grids)} entries of wavelengths where there must be one; {_EXPECTED}"
        )
    if not spectra:
        raise source.error(f"no entry has a reflectance; {_EXPECTED}")
    wavelengths = _numbers(source, "wavelengths", grids[0].get("values"))
    names = [str(entry.get("name", "")) or f"spectrum {i + 1}" for i, entry in enumerate(spectra)]
    values = []
    for name, entry in zip(names, spectra, strict=True):
        row = _numbers(source, name, entry["reflectance"])
        if row.size != wavelengths.size:
            raise source.error(f"{name!r} has {row.size} values for {wavelengths.size} wavelengths")
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
    for index, value in enumerate(values, start=1):
        if type(value) not in (int, float):
            raise source.error(f"{name!r} holds {str(value)[:20]!r}, not a number")
        if isinstance(value, int) and abs(value) > sys.float_info.max:
            raise source.error(f"{name!r}: number {index} has {len(str(value))} digits, too large")
    return np.array(values, float)


def _text(value: Any) -> str:
    return value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)
