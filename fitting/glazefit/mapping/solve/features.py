"""Numbers by which spectra are compared: representatives of many, and means over those that noise
alone makes different.

Noise of a camera moves a dark pixel by more than one paint differs from another. A mean over
neighbours that are equal within noise keeps edges sharp (the sigma filter: Lee, Computer Vision,
Graphics, and Image Processing 24 (1983) 255).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from jaxtyping import Float, Int

from glazejax.progress import Progress, no_progress
from glazejax.radiative.common.threads import cores

from ...identify.search.pool import PerSpectrum
from ..store.chunk import PixelReadings

SpectraReadings: TypeAlias = Float[np.ndarray, "spectra bands"]
"""Readings of spectra at the working bands: measured, fitted, or their standard deviations."""
SpectraFeatures: TypeAlias = Float[np.ndarray, "spectra directions"]
"""Numbers by which spectra are compared (`Features`)."""
# Representatives of an image at least and at most.
REPRESENTATIVES = (256, 4000)
AROUND = [(y, x) for y in range(3) for x in range(-2, 3) if (y, x) > (0, 0)]
"""Steps (y, x) to neighbours in a square of five pixels, one of each two that are opposite."""
ALONG = [(0, x) for x in range(1, 13)]
"""As many along a line."""
REACH = 1.5
"""Distance at which spectra count as equal, in standard deviations of paint's errors."""
# Squares of distances are as often beyond this many times their mean as one normal number is beyond
# three of its standard deviations.
_TIMES = 2.0


@dataclass(frozen=True)
class Features:
    """Numbers by which spectra are compared: differences of 1 are as large as the errors of paint.

    Attributes:
        middle: of the logarithms of the sample's readings, (bands,).
        directions: from the bands to the numbers, (directions, bands).
    """

    middle: Float[np.ndarray, "bands"]
    directions: Float[np.ndarray, "directions bands"]

    @classmethod
    def of(cls, sample: SpectraReadings, *, brightness: bool = True) -> "Features":
        """Those in which the spectra of a sample differ most.

        Args:
            sample: of the spectra.
            brightness: an equal change of all bands counts in each of them; else it counts once, as
                light and relief make it.
        """
        logs = _logs(sample)
        middle = logs.mean(axis=0)
        bands = len(middle)
        even = np.eye(bands) - (0.0 if brightness else (1.0 - bands**-0.5) / bands)
        off = (logs - middle) @ even
        vectors = np.linalg.eigh(off.T @ off)[1][:, ::-1]
        # Directions in which spectra are compared.
        return cls(middle, np.ascontiguousarray(vectors[:, :16].T @ even))

    def __call__(self, readings: SpectraReadings) -> SpectraFeatures:
        """Features of spectra, single precision."""
        return ((_logs(readings) - self.middle) @ self.directions.T).astype(np.float32)

    def doubt(self, readings: SpectraReadings, sd: SpectraReadings) -> PerSpectrum:
        """Mean square of the distance by which noise moves spectra.

        Args:
            readings: of the spectra.
            sd: of their noise.
        """
        slopes = 1.0 / (_SHARE * (np.maximum(readings, 0.0) + _BLACK))
        return (sd * slopes) ** 2 @ (self.directions**2).sum(axis=0).astype(readings.dtype)


# Readings vary by this share where paints do (`ModelError`), and near black by this.
_SHARE = _BLACK = 0.03


def _logs(readings: np.ndarray) -> np.ndarray:
    return np.log(np.maximum(readings, 0.0) + _BLACK) / _SHARE


def nearest(
    features: SpectraFeatures,
    centres: Float[np.ndarray, "centres directions"],
) -> tuple[Int[np.ndarray, "spectra"], PerSpectrum]:
    """Number of the nearest centre of each spectrum, and how far it is."""
    from scipy.spatial import KDTree

    # Spectra of paint differ in few directions: a tree looks at some twenty centres of thousands.
    distance, which = KDTree(centres).query(features, workers=cores())
    return np.asarray(which), distance.astype(np.float32)


def spread_out(
    features: SpectraFeatures,
    most: int,
    reach: "float | Float[np.ndarray, 'spectra']",
    progress: Progress = no_progress,
) -> Int[np.ndarray, "chosen"]:
    """Spectra near which all others lie: each next one is the farthest from those before (Gonzalez
    1985).

    Args:
        features: of the spectra.
        most: spectra at most.
        reach: no more are taken once all others lie within this, or each within its own.
        progress: called with spectra taken and their largest number.

    Returns:
        Numbers of the spectra.
    """
    chosen = [int(np.argmax(np.sum((features - features.mean(axis=0)) ** 2, axis=1)))]
    squares = np.sum((features - features[chosen[0]]) ** 2, axis=1)
    most = min(most, len(features))
    while len(chosen) < most and (beyond := squares / reach**2).max() > 1.0:
        progress(len(chosen), most, "surveying")
        chosen.append(int(np.argmax(beyond)))
        squares = np.minimum(squares, np.sum((features - features[chosen[-1]]) ** 2, axis=1))
    return np.asarray(chosen)


def usual_number(pixels: int) -> int:
    """Representatives of an image of so many pixels, where memory has room: one for 40."""
    return int(np.clip(pixels // 40, *REPRESENTATIVES))


def choose_representatives(
    features: Features,
    sample: SpectraReadings,
    most: int,
    reach: "float | Float[np.ndarray, 'spectra']",
    progress: Progress = no_progress,
) -> tuple[Float[np.ndarray, "representatives bands"], float]:
    """Representatives of a sample of spectra: spread out, then moved to the middles of what they
    stand for.

    Args:
        features: by which spectra are compared.
        sample: readings of good pixels.
        most: representatives at most.
        reach: wanted distance of every spectrum to its representative, in standard deviations of
            paint's errors, or of each.
        progress: called as they are chosen.

    Returns:
        Their readings, and how many times its reach a spectrum lies from its representative at
        most.
    """
    progress(0, 1, "surveying")
    points = features(sample)
    chosen = spread_out(points, most, reach, progress)
    centres = points[chosen]
    which, distance = nearest(points, centres)
    # Rounds of Lloyd's algorithm.
    for _ in range(3):
        centres = group_means(points, which).astype(np.float32)
        which, distance = nearest(points, centres)
    progress(len(chosen), len(chosen), "surveying")
    return group_means(sample, which), float((distance / reach).max())


def group_means(
    values: Float[np.ndarray, "spectra n"], which: Int[np.ndarray, "spectra"]
) -> Float[np.ndarray, "groups n"]:
    """Means of the spectra of each number that occurs."""
    count = np.bincount(which)
    occupied = count > 0
    sums = np.column_stack([np.bincount(which, weights=column) for column in values.T])
    return sums[occupied] / count[occupied, None]


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
