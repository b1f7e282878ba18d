"""What an image does not say, told from few pixels: its mark of missing data, and its unit."""

from dataclasses import replace
from typing import Unpack

import numpy as np
from jaxtyping import Int

from .finish import DELETED, unit_of
from .quantity import Stated, check_reflectance, read_units
from .raw_cube import RawCube
from .source import refusal

# Tiles of so many lines and samples, and so many of them across the image.
_TILE = 32
_ACROSS = 4
# What files leave in place of missing data without a word; no reading is so far below 0.
USUAL_MARK = -9999.0
# Above so many numbers in a piece of the file only one tile is looked at.
_LARGE = 1 << 22


def bright(raw: RawCube, bands: Int[np.ndarray, "bands"]) -> float | None:
    """Value that 99 % of pixels stay below, in the brightest of a few bands; None if none of them
    has data.

    Tiles are looked at, not scattered pixels: a file that stores pieces is read by pieces.
    """
    lines, samples, _ = raw.shape
    bands = np.unique(bands[np.linspace(0, bands.size - 1, min(16, bands.size)).astype(int)])
    across = 1 if np.prod(raw.piece) > _LARGE else _ACROSS
    found = []
    for i in range(across):
        for j in range(across):
            y = _tile(lines, i, across)
            x = _tile(samples, j, across)
            values = raw.values(y, x, bands).reshape(-1, bands.size)
            found.append(values[np.isfinite(values).any(axis=1)])
    pixels = np.concatenate(found)
    if not len(pixels):
        return None
    return float(np.quantile(np.where(np.isfinite(pixels), pixels, -np.inf).max(axis=1), 0.99))


def with_usual_mark(raw: RawCube, notes: list[str]) -> RawCube:
    """An image that declares no mark of missing data, with the one that files use without a word.

    A note says so if the mark is found in one band of the same tiles or of the corners.
    """
    if raw.ignore or raw.dtype.kind not in "fi" or raw.dtype.itemsize == 1:
        return raw
    lines, samples, _ = raw.shape
    places = [
        (_tile(lines, i, _ACROSS), _tile(samples, j, _ACROSS))
        for i in range(_ACROSS)
        for j in range(_ACROSS)
    ]
    edges = [[slice(0, 1), slice(size - 1, size)] for size in (lines, samples)]
    places += [(y, x) for y in edges[0] for x in edges[1]]
    parts = np.concatenate([raw.block(y, x, np.zeros(1, int)).ravel() for y, x in places])
    deleted = float(np.nanmin(parts, initial=0))
    mark = deleted if deleted < DELETED else USUAL_MARK
    if (parts == mark).any():
        notes.append(
            f"{mark:g}, which no reading is, was taken for missing data, though the file does not "
            "say so"
        )
    return replace(raw, ignore=(USUAL_MARK,))


def scale_of(
    raw: RawCube,
    bands: Int[np.ndarray, "bands"],
    notes: list[str],
    cure: str,
    **stated: Unpack[Stated],
) -> tuple[float, str]:
    """Value that stands for a reflectance of 1, and the unit's name, from what is said or from a
    look at pixels.

    Args:
        raw: the image.
        bands: stored bands that are used.
        notes: what was noticed is added.
        cure: what to do where nothing says the scale.
        stated: what the user says, before the file.

    Raises:
        ValueError: another quantity than reflectance; the scale is not said and the numbers are
            whole, or neither fractions nor percent; or they are much above 1 by it.
    """
    try:
        check_reflectance(raw.quantity, stated.get("quantity"))
    except ValueError as error:
        raise refusal(raw.path, error) from None
    given = stated.get("scale") or read_units(stated.get("unit"))[1]
    declared = given or raw.scale
    if given is not None and raw.scale not in (None, given):
        notes.append(
            f"the file says that {raw.scale:g} is a reflectance of 1; {given:g} was given and is "
            "used"
        )
    level = bright(raw, bands)
    if declared is None and level is None:
        raise refusal(
            raw.path, "no pixel that was looked at has data: give the scale, 1 for fractions"
        )
    if declared is None and raw.dtype.kind in "iu" and not raw.converts:
        raise refusal(
            raw.path,
            f"whole numbers up to {level:g} are a camera's counts where no scale is said, neither "
            f"fraction nor percent: {cure}",
        )
    try:
        scale, unit, remarks = unit_of(
            0.0 if level is None else level / (declared or 1.0), declared, cure
        )
    except ValueError as error:
        raise refusal(raw.path, error) from None
    notes.extend(remarks)
    return scale, unit


def _tile(size: int, number: int, across: int) -> slice:
    """A short run of lines or samples, in the middle of the given one of so many equal parts."""
    start = max(0, int((number + 0.5) / across * size) - _TILE // 2)
    start = min(start, max(0, size - _TILE))
    return slice(start, min(size, start + _TILE))
