"""An image of spectra that stays on disk."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float

from ..spectra import describe_grid
from .finish import RawSpectra, finish
from .raw_cube import RawCube
from .spectra_table import Bands, Chosen, SpectraTable

# A table of more pixels than this is no table any more; 200 bands of float64 take 160 MB.
MAX_PIXELS = 100_000


@dataclass(frozen=True)
class SpectraCube:
    """Image of spectra that stays on disk: ``cube[lines, samples]`` reads what it is asked for.

    Attributes:
        file: its numbers on disk, and what it says of them.
        wavelengths: (bands,), nm, ascending.
        bands: (bands,), which of the stored bands are used, in the order of `wavelengths`.
        scale: number in the file that stands for a reflectance of 1.
        notes: sentences on what the reader changed or noticed.
        unit: ``fraction``, ``percent`` or ``scaled``, as it was in the file.
    """

    file: RawCube
    wavelengths: Bands
    bands: Chosen
    scale: float
    notes: list[str]
    unit: str

    @property
    def raw(self) -> np.ndarray:
        """(lines, samples, stored bands), memory map of the file's own numbers."""
        return self.file.data.array.transpose(self.file.order)

    @property
    def shape(self) -> tuple[int, int, int]:
        """Lines, samples (pixels a line) and bands."""
        return *self.file.shape[:2], int(self.bands.size)

    def __getitem__(self, window: Any) -> Float[np.ndarray, "*window bands"]:
        """Reflectance (fraction, float64) of a pixel or a window of lines and samples; NaN where
        data are missing.
        """
        if isinstance(window, tuple) and len(window) > 2:
            raise IndexError("a cube is indexed by lines and samples; take bands from the result")
        stored = np.asarray(self.raw[window])[..., self.bands]
        return self.file.numbers(stored, self.bands, dtype=np.float64) / self.scale

    def table(self) -> SpectraTable:
        """All pixels as a table, named ``line 1 sample 1`` and so on; pixels that lack data are
        left out, with a note.

        Raises:
            ValueError: there are more than 100 000 pixels, or all lack data.
        """
        lines, samples, _ = self.shape
        if lines * samples > MAX_PIXELS:
            raise ValueError(
                f"{self.file.path}: {lines} x {samples} pixels are too many for a table of spectra "
                f"(at most {MAX_PIXELS}); use glazejax.io.read_cube and take windows of it"
            )
        values = self[:, :].reshape(lines * samples, -1)
        names = [f"line {i + 1} sample {j + 1}" for i in range(lines) for j in range(samples)]
        raw = RawSpectra(
            wavelengths=self.wavelengths,
            names=names,
            values=values,
            format=self.file.format,
            notes=self.notes,
            scale=1.0,
            missing="drop",
            # A camera's noise and glare are what they are; one pixel must not make an image
            # unreadable.
            lowest=-np.inf,
            highest=np.inf,
        )
        return replace(finish(raw, self.file.path), unit=self.unit)

    def __repr__(self) -> str:
        lines, samples, _ = self.shape
        return f"SpectraCube({lines} lines x {samples} samples, {describe_grid(self.wavelengths)})"
