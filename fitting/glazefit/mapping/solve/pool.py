"""Readings pooled with those around them that noise alone makes different.

Noise of a camera moves a dark pixel by more than one paint differs from another. A mean over
neighbours that are equal within noise keeps edges sharp (the sigma filter: Lee, Computer Vision,
Graphics, and Image Processing 24 (1983) 255).
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from ..store.chunk import PixelReadings
from .survey import Features

AROUND = [(y, x) for y in range(3) for x in range(-2, 3) if (y, x) > (0, 0)]
"""Steps (y, x) to neighbours in a square of five pixels, one of each two that are opposite."""
ALONG = [(0, x) for x in range(1, 13)]
"""As many along a line."""
REACH = 1.5
"""Distance at which spectra count as equal, in standard deviations of paint's errors."""
# Squares of distances are as often beyond this many times their mean as one normal number is beyond
# three of its standard deviations.
_TIMES = 2.0


def pooled(
    readings: PixelReadings,
    sd: PixelReadings,
    features: Features,
    shape: tuple[int, int],
    steps: Sequence[tuple[int, int]],
) -> tuple[PixelReadings, Float[np.ndarray, "pixels"]]:
    """Means over each pixel and its neighbours that are equal within noise.

    Args:
        readings: row by row; NaN where a pixel says nothing.
        sd: of their noise.
        features: by which they are compared.
        shape: rows and columns.
        steps: to the neighbours, `AROUND` or `ALONG`.

    Returns:
        The means, and how far from each the one that stands for it may be, in the unit of
        `Features`: errors of paint, and noise that is left.
    """
    from scipy.sparse import coo_array

    height, width = shape
    doubt = features.doubt(readings, sd)
    points = features(readings).reshape(height, width, -1)
    limit = (0.5 * REACH**2 + _TIMES * doubt).reshape(shape)
    numbers = np.arange(len(readings), dtype=np.int32).reshape(shape)
    pairs = [np.stack([numbers.ravel()] * 2)]
    for y, x in steps:
        if y >= height or abs(x) >= width:
            continue
        centre = np.s_[: height - y, max(0, -x) : width - max(0, x)]
        neighbour = np.s_[y:, max(0, x) : width - max(0, -x)]
        difference = points[centre] - points[neighbour]
        # Nothing is equal where a number is missing.
        equal = np.einsum("yxd,yxd->yx", difference, difference) <= limit[centre] + limit[neighbour]
        pair = np.stack([numbers[centre][equal], numbers[neighbour][equal]])
        pairs += [pair, pair[::-1]]
    rows, columns = np.hstack(pairs)
    weights = np.ones(len(rows), np.float32)
    near = coo_array((weights, (rows, columns)), shape=(len(readings),) * 2).tocsr()
    count = near.sum(axis=1)
    reach = np.sqrt(REACH**2 + _TIMES * doubt / count).astype(np.float32)
    return (near @ readings) / count[:, None], reach
