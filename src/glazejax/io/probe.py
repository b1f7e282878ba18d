"""Facts that an image does not state, estimated from few pixels: its mark of missing data, and its
unit.
"""

from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from typing import Unpack

import numpy as np

from ..spectra import MAX_DECLARED, scale_by_size
from .finish import DELETED, UNITS, USUAL_MARK
from .quantity import Stated, check_reflectance, read_units
from .raw_cube import RawCube
from .source import naming
from .spectra_table import Chosen

# Tiles of so many lines and samples, and so many of them across the image.
_TILE = 32
_ACROSS = 4
# Above so many numbers in a piece of the file only one tile is looked at.
_LARGE = 1 << 22


def bright(raw: RawCube, bands: Chosen) -> float | None:
    """Value that 99 % of pixels stay below, in the brightest of a few bands; None if none of them
    has data.

    Tiles are looked at, not scattered pixels: a file that stores pieces is read by pieces.
    """
    bands = np.unique(bands[np.linspace(0, bands.size - 1, min(16, bands.size)).astype(int)])
    across = 1 if np.prod(raw.piece) > _LARGE else _ACROSS
    tiles = _tiles(raw, across)
    pixels = np.concatenate([raw.values(y, x, bands).reshape(-1, bands.size) for y, x in tiles])
    peaks = np.where(np.isfinite(pixels), pixels, -np.inf).max(axis=1)
    peaks = peaks[peaks > -np.inf]
    return float(np.quantile(peaks, 0.99)) if peaks.size else None


def with_usual_mark(raw: RawCube) -> RawCube:
    """An image that declares no mark of missing data, with the one that files use without a word.

    A note says so if the mark is found in one band of the same tiles or of the corners.
    """
    if raw.ignore or raw.dtype.kind not in "fi" or raw.dtype.itemsize == 1:
        return raw
    edges = [[slice(0, 1), slice(size - 1, size)] for size in raw.shape[:2]]
    places = [*_tiles(raw, _ACROSS), *product(*edges)]
    parts = np.concatenate([raw.block(y, x, np.zeros(1, int)).ravel() for y, x in places])
    deleted = float(np.nanmin(parts, initial=0))
    mark = deleted if deleted < DELETED else USUAL_MARK
    notes = raw.notes
    if (parts == mark).any():
        notes += (
            f"{mark:g}, which no reading is, was taken for missing data, though the file does not "
            "say so",
        )
    return replace(raw, ignore=(USUAL_MARK,), notes=notes)


def scale_of(
    raw: RawCube,
    bands: Chosen,
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
    with naming(raw.path):
        check_reflectance(raw.quantity, stated)
        _, wanted = read_units(stated)
        if wanted is not None and raw.scale not in (None, wanted):
            notes.append(
                f"the file says that {raw.scale:g} is a reflectance of 1; {wanted:g} was given and "
                "is used"
            )
        level = bright(raw, bands)
        if scale := wanted or raw.scale:
            reached = (level or 0.0) / scale
            if reached > MAX_DECLARED:
                raise ValueError(
                    f"pixels reach a reflectance of {reached:g} by the reflectance scale factor "
                    f"{scale:g}"
                )
        elif level is None:
            raise ValueError(
                "no pixel that was looked at has data: give the scale, 1 for fractions"
            )
        elif raw.dtype.kind in "iu" and not raw.converts:
            raise ValueError(
                f"whole numbers up to {level:g} are a camera's counts where no scale is said, "
                f"neither fraction nor percent: {cure}"
            )
        else:
            peak = np.array([level])
            scale = scale_by_size(peak[None], peak, ["the brightest pixels"], notes, cure)
    if scale != 1.0:
        notes.append(
            "values are in percent; divided by 100" if scale == 100.0 else f"divided by {scale:g}"
        )
    return scale, UNITS.get(scale, "scaled")


def _tiles(raw: RawCube, across: int) -> Iterator[tuple[slice, ...]]:
    """Lines and samples of short runs, in the middle of so many equal parts of either."""
    runs: list[list[slice]] = []
    for size in raw.shape[:2]:
        middles = ((np.arange(across) + 0.5) / across * size).astype(int) - _TILE // 2
        starts = np.clip(middles, 0, max(0, size - _TILE)).tolist()
        runs.append([slice(start, min(size, start + _TILE)) for start in starts])
    return product(*runs)
