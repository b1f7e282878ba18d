"""How bright an image is, told from few pixels."""

import numpy as np
from jaxtyping import Int

from .raw import RawCube

# Tiles of so many lines and samples, and so many of them across the image.
_TILE = 32
_ACROSS = 4
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


def holds(raw: RawCube, mark: float) -> bool:
    """Whether a stored number is found in one band of the same tiles or of the corners."""
    lines, samples, _ = raw.shape
    places = [
        (_tile(lines, i, _ACROSS), _tile(samples, j, _ACROSS))
        for i in range(_ACROSS)
        for j in range(_ACROSS)
    ]
    edges = [[slice(0, 1), slice(size - 1, size)] for size in (lines, samples)]
    places += [(y, x) for y in edges[0] for x in edges[1]]
    band = np.zeros(1, int)
    return any((raw.block(y, x, band) == mark).any() for y, x in places)


def _tile(size: int, number: int, across: int) -> slice:
    """A short run of lines or samples, in the middle of the given one of so many equal parts."""
    start = max(0, int((number + 0.5) / across * size) - _TILE // 2)
    start = min(start, max(0, size - _TILE))
    return slice(start, min(size, start + _TILE))
