"""Survey of an image: a sample of its pixels, and representatives near all of them."""

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from jaxtyping import Float, Int

from glazejax.progress import Progress, no_progress
from glazejax.radiative.common.threads import cores

from ...identify.search.pool import PerSpectrum

SpectraReadings: TypeAlias = Float[np.ndarray, "spectra bands"]
"""Readings of spectra at the working bands: measured, fitted, or their standard deviations."""
SpectraFeatures: TypeAlias = Float[np.ndarray, "spectra directions"]
"""Numbers by which spectra are compared (`Features`)."""


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


def survey(
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
