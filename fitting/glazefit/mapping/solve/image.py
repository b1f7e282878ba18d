"""An image of spectra: its readings at the bands that are worked with."""

import functools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Bool

from ...film.films import Noise
from ..store.chunk import PixelReadings
from ..store.windows import Window
from .working_bands import BandReadings, WorkingBands, classify

if TYPE_CHECKING:
    import xarray

    from glazejax.io import CubeSource

# Values read at a time.
_VALUES = 2**24


@dataclass(frozen=True)
class Image:
    """An image and how its spectra are worked with; can be sent to other processes.

    Attributes:
        source: opens the image, or is it.
        bands: that are worked with.
        noise: of one reading of the image.
        mask: pixels that are used; None for all.
        saturated: reading from which the detector was full; infinite if that is not stated.
    """

    source: "CubeSource | xarray.DataArray"
    bands: WorkingBands
    noise: Noise
    mask: Bool[np.ndarray, "y x"] | None
    saturated: float

    def cube(self) -> "xarray.DataArray":
        """The lazy image."""
        from glazejax.io import CubeSource

        return _open(self.source) if isinstance(self.source, CubeSource) else self.source

    def read(self, window: Window) -> tuple[PixelReadings, np.ndarray]:
        """Readings at the working bands, and what can be done with each pixel, row by row."""
        cube = self.cube()
        readings = []
        height = max(1, _VALUES // (cube.shape[2] * window.shape[1]))
        for y in range(window.y0, window.y1, height):
            block = cube[y : min(y + height, window.y1), window.x0 : window.x1].to_numpy()
            readings.append(self.bands.means(block.reshape(-1, block.shape[-1]), self.saturated))
        spectra = np.concatenate(readings)
        use = None if self.mask is None else self.mask[window.slices].ravel()
        with np.errstate(invalid="ignore"):
            return spectra, classify(spectra, self.noise_sd(spectra), use)

    def noise_sd(self, readings: BandReadings) -> BandReadings:
        """Standard deviation of the noise of readings at the working bands."""
        return self.bands.noise_sd(readings, self.noise)


@functools.lru_cache(maxsize=4)
def _open(source: "CubeSource") -> "xarray.DataArray":
    """Once for each process."""
    return source.open()
