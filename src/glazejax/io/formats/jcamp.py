"""JCAMP-DX (4.24 and 5): one or many spectra as text, decoded by the package jcamp."""

import contextlib
import io
from pathlib import Path
from typing import Any

import numpy as np

from ..finish import RawSpectra, nanometres
from ..sniff import decode

_REFLECTANCE = {"reflectance": None, "%reflectance": 100.0, "percent reflectance": 100.0, "reflectance %": 100.0}


def read_jcamp(path: Path) -> RawSpectra:
    """Read the reflectance spectra of a JCAMP-DX file; blocks, linked or merely one after another, are rows.

    X may be in nanometres, micrometres or 1/cm. Y must be reflectance, as a fraction or percent.

    Raises:
        ValueError: a block without ##END= (a file cut short), without data, damaged, in absorbance or another unit,
            or on other wavelengths than the first.
    """
    found = [_spectrum(path, number, block) for number, block in enumerate(_blocks(path), start=1)]
    if not found:
        raise ValueError(f"{path}: JCAMP-DX without data: no ##XYDATA= or ##XYPOINTS=")
    names, grids, values, scales, notes = zip(*found, strict=True)
    for name, grid in zip(names, grids, strict=True):
        if grid.shape != grids[0].shape or not np.allclose(grid, grids[0], rtol=1e-9):
            raise ValueError(
                f"{path}: block {name!r} is on other wavelengths than {names[0]!r}; a table has one grid: split it"
            )
    if len(set(scales)) > 1:
        raise ValueError(f"{path}: some blocks are in percent and some in fractions; bring all to one unit")
    return RawSpectra(grids[0], names, np.array(values), "JCAMP-DX", notes[0], scales[0])


def _blocks(path: Path) -> list[list[str]]:
    """Lines of each block that has data; wrappers that only link blocks are passed over."""
    blocks, block = [], None
    for number, line in enumerate(decode(path).splitlines(), start=1):
        label = line.lstrip().upper().replace(" ", "")
        if label.startswith("##TITLE="):
            if block is not None and _has_data(block):
                raise ValueError(f"{path}, line {number}: a block begins before the one above has its ##END=")
            block = []
        if block is None:
            continue
        block.append(line.lstrip() + "\n")
        if label.startswith("##END="):
            if _has_data(block):
                blocks.append(block)
            block = None
    if block is not None and _has_data(block):
        raise ValueError(f"{path}: the last block has no ##END=; the file was cut short")
    return blocks


def _has_data(block: list[str]) -> bool:
    return any(line.upper().replace(" ", "").startswith(("##XYDATA=", "##XYPOINTS=")) for line in block)


def _spectrum(path: Path, number: int, block: list[str]) -> tuple[str, np.ndarray, np.ndarray, float | None, list[str]]:
    """Name, wavelengths, values, scale and notes of a block."""
    import jcamp

    said = io.StringIO()
    try:
        # The package reports damage by printing it.
        with contextlib.redirect_stdout(said):
            data: dict[str, Any] = jcamp.read(block)
        x, y = np.asarray(data["x"], float), np.asarray(data["y"], float)
    except Exception as error:
        raise ValueError(f"{path}: block {number} is damaged: {type(error).__name__}: {error}") from None
    name = str(data.get("title", "")).strip() or f"block {number}"
    complaints = said.getvalue().strip().splitlines()
    if x.size != y.size:
        raise ValueError(f"{path}: {name!r} promises {x.size} points and holds {y.size}; the file was cut short")
    if complaints:
        raise ValueError(f"{path}: {name!r} is damaged: {complaints[0]}")
    if x.size == 0:
        raise ValueError(f"{path}: {name!r} holds no points")
    unit = str(data.get("yunits", "")).strip().lower()
    if unit not in _REFLECTANCE:
        raise ValueError(f"{path}: {name!r} is in {data.get('yunits', 'no unit')!r}; only reflectance can be read")
    try:
        wavelengths, notes = nanometres(x, str(data.get("xunits", "")))
    except ValueError as error:
        raise ValueError(f"{path}: {name!r}: {error}") from None
    return name, wavelengths, y, _REFLECTANCE[unit], notes
