"""Result of both renderers: a picture as spectra or XYZ, and what of it was computed."""

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from ...spectra import Bands


@dataclass
class RenderReport:
    """Counts of what was computed, compared with every pixel, light, band and
    material in full.
    """

    rays: int = 0
    rays_full: int = 0
    pairs: int = 0
    pairs_full: int = 0
    bands: int = 0
    materials: int = 0
    materials_full: int = 0
    refined: int = 0
    pixels: int = 0
    angles: str = ""
    notes: list[str] = field(default_factory=list)

    @property
    def saved(self) -> float:
        """Share of the spectra of light and point that was not computed."""
        return 1 - self.pairs / max(self.pairs_full, 1)

    def describe(self) -> str:
        """In words, a line each."""
        lines = [
            f"rays: {self.rays} of {self.rays_full}, for {self.pixels} pixels, {self.refined} of "
            "them with several",
            f"spectra of a point under a light: {self.pairs} of {self.pairs_full}",
            f"bands: {self.bands}",
            f"materials: {self.materials} of {self.materials_full}"
            + (f"; {self.angles}" if self.angles else ""),
            f"left out: {self.saved:.0%} of the spectral work",
        ]
        return "\n".join(lines)


@dataclass(frozen=True)
class Rendered:
    """A picture as spectra, or as XYZ where spectra were not asked for; NaN where it was
    interrupted.

    Attributes:
        values: (h, w, bands), spectra: 1 is a perfect white under a light of spectrum 1; or (h, w,
            3), XYZ by the CIE 1931 observer: Y = 1 is a perfect white under a light of luminance 1.
        spectral: which of the two.
        wavelengths: (bands,), nm.
        done: share of the work that is finished; 1 unless interrupted.
        report: what was computed and what was not.
    """

    values: Float[np.ndarray, "h w channels"]
    spectral: bool
    wavelengths: Bands
    done: float
    report: RenderReport

    @property
    def radiance(self) -> Float[np.ndarray, "h w bands"]:
        """Spectra.

        Raises:
            ValueError: only XYZ was kept.
        """
        if not self.spectral:
            raise ValueError("this picture has no spectra: render it with spectral=True")
        return self.values
