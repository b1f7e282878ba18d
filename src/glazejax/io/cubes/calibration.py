"""Raw readings to reflectance, by a white and a dark reference."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from .raw import RawCube


@dataclass(frozen=True)
class Reference:
    """Readings of a white or of no light.

    Attributes:
        frame: (1, samples or 1, stored bands), averaged over its lines; or a file with a reading
            for each pixel.
    """

    frame: Float[np.ndarray, "1 samples stored"] | RawCube

    def part(self, y: slice, x: slice, bands: Int[np.ndarray, "bands"]) -> np.ndarray:
        """Readings that belong to a window, ready to be broadcast."""
        if isinstance(self.frame, RawCube):
            values = self.frame.values(y, x, bands, mark=True)
            values[np.isinf(values)] = np.nan
            return values
        return self.frame[:, x if self.frame.shape[1] > 1 else slice(None)][..., bands]


@dataclass(frozen=True)
class Calibration:
    """White and dark references of a cube.

    Attributes:
        white: readings of the white.
        dark: readings of no light, or None if those are 0.
        own: (stored bands,), the white's own reflectance.
    """

    white: Reference
    dark: Reference | None
    own: Float[np.ndarray, "stored"]

    def apply(
        self, values: np.ndarray, y: slice, x: slice, bands: Int[np.ndarray, "bands"]
    ) -> np.ndarray:
        """Reflectance: (raw - dark) / (white - dark) times the white's own; NaN where the white is
        not above the dark.

        A saturated reading (+inf) stays +inf.
        """
        white = self.white.part(y, x, bands).astype(np.float64)
        if self.dark is not None:
            dark = self.dark.part(y, x, bands)
            white = white - dark
            values = values - dark.astype(values.dtype)
        with np.errstate(invalid="ignore", divide="ignore"):
            gain = np.where(white > 0, self.own[bands] / white, np.nan)
            return values * gain.astype(values.dtype)
