"""JSON lists of spectra, as Kimera's: an entry of type ``wavelengths``, then entries with name and reflectance."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from ..finish import RawSpectra, nanometres
from ..sniff import decode

_EXPECTED = 'expected a list of {"type": "wavelengths", "values": [...]} and {"name": ..., "reflectance": [...]}'


def read_listing(path: Path) -> RawSpectra:
    """Read a JSON list of spectra; entries' other fields, such as components, are attributes (as JSON).

    Raises:
        ValueError: not JSON, of another shape, without wavelengths, or a spectrum of another length.
    """
    try:
        entries = json.loads(decode(path))
    except json.JSONDecodeError as error:
        raise ValueError(f"{path}, line {error.lineno}: not legal JSON ({error.msg}); was it cut short?") from None
    if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
        raise ValueError(f"{path}: {_EXPECTED}")
    grids = [entry for entry in entries if entry.get("type") == "wavelengths"]
    spectra = [entry for entry in entries if "reflectance" in entry]
    if len(grids) != 1:
        raise ValueError(f"{path}: {len(grids)} entries of wavelengths where there must be one; {_EXPECTED}")
    if not spectra:
        raise ValueError(f"{path}: no entry has a reflectance; {_EXPECTED}")
    grid = _numbers(path, "wavelengths", grids[0].get("values"))
    try:
        wavelengths, notes = nanometres(grid, _text(grids[0].get("unit", "")))
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    names, values = [], []
    for number, entry in enumerate(spectra, start=1):
        name = str(entry.get("name", "")) or f"spectrum {number}"
        row = _numbers(path, name, entry["reflectance"])
        if row.size != wavelengths.size:
            raise ValueError(f"{path}: {name!r} has {row.size} values for {wavelengths.size} wavelengths")
        names.append(name)
        values.append(row)
    titles = sorted({key for entry in spectra for key in entry} - {"name", "reflectance"})
    attributes = {title: [_text(entry.get(title, "")) for entry in spectra] for title in titles}
    return RawSpectra(wavelengths, names, np.array(values), "JSON list of spectra", notes, attributes=attributes)


def _numbers(path: Path, name: str, values: Any) -> np.ndarray:
    """Row of numbers, or an error that names whose it is."""
    if not isinstance(values, list) or not values:
        raise ValueError(f"{path}: {name!r} has no list of numbers")
    wrong = [value for value in values if isinstance(value, bool) or not isinstance(value, int | float)]
    if wrong:
        raise ValueError(f"{path}: {name!r} holds {str(wrong[0])[:20]!r}, not a number")
    return np.array(values, float)


def _text(value: Any) -> str:
    return value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)
