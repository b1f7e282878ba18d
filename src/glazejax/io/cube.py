"""An image of spectra that stays on disk."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from ..spectra import describe_grid
from .finish import RawSpectra, finish
from .spectra_table import SpectraTable

# A table of more pixels than this is no table any more; 200 bands of float64 take 160 MB.
MAX_PIXELS = 100_000
# What files leave in place of missing data without a word; no reading is so far below 0.
USUAL_MARK = -9999.0
MARK_WORDS = (
    "-9999, which no reading is, was taken for missing data, though the file does not say so"
)


@dataclass(frozen=True)
class SpectraCube:
    """Image of spectra that stays on disk: ``cube[lines, samples]`` reads what it is asked for.

    Attributes:
        wavelengths: (bands,), nm, ascending.
        raw: (lines, samples, stored bands), memory map of the file's own numbers.
        bands: (bands,), which of the stored bands are used, in the order of `wavelengths`.
        scale: number in the file that stands for a reflectance of 1.
        ignore: number that marks missing data, or None.
        notes: sentences on what the reader changed or noticed.
        format: what the file was.
        unit: ``fraction``, ``percent`` or ``scaled``, as it was in the file.
        path: file that holds the numbers.
    """

    wavelengths: Float[np.ndarray, "bands"]
    raw: np.ndarray
    bands: Int[np.ndarray, "bands"]
    scale: float
    ignore: float | None
    notes: list[str]
    format: str
    unit: str
    path: Path

    @property
    def shape(self) -> tuple[int, int, int]:
        """Lines, samples (pixels a line) and bands."""
        return int(self.raw.shape[0]), int(self.raw.shape[1]), int(self.bands.size)

    def __getitem__(self, window: Any) -> Float[np.ndarray, "*window bands"]:
        """Reflectance (fraction, float64) of a pixel or a window of lines and samples; NaN where
        data are missing.
        """
        if isinstance(window, tuple) and len(window) > 2:
            raise IndexError("a cube is indexed by lines and samples; take bands from the result")
        raw = np.asarray(self.raw[window])[..., self.bands]
        return with_gaps(raw, self.ignore) / self.scale

    def table(self) -> SpectraTable:
        """All pixels as a table, named ``line 1 sample 1`` and so on; pixels that lack data are
        left out, with a note.

        Raises:
            ValueError: there are more than 100 000 pixels, or all lack data.
        """
        lines, samples, _ = self.shape
        if lines * samples > MAX_PIXELS:
            raise ValueError(
                f"{self.path}: {lines} x {samples} pixels are too many for a table of spectra (at "
                f"most {MAX_PIXELS}); use glazejax.io.read_cube and take windows of it"
            )
        values = self[:, :].reshape(lines * samples, -1)
        names = [f"line {i + 1} sample {j + 1}" for i in range(lines) for j in range(samples)]
        raw = RawSpectra(
            wavelengths=self.wavelengths,
            names=names,
            values=values,
            format=self.format,
            notes=self.notes,
            scale=1.0,
            missing="drop",
            # A camera's noise and glare are what they are; one pixel must not make an image
            # unreadable.
            lowest=-np.inf,
            highest=np.inf,
        )
        return replace(finish(raw, self.path), unit=self.unit)

    def __repr__(self) -> str:
        lines, samples, _ = self.shape
        return f"SpectraCube({lines} lines x {samples} samples, {describe_grid(self.wavelengths)})"


def with_gaps(raw: np.ndarray, ignore: float | None) -> Float[np.ndarray, "..."]:
    """Numbers of a file as float64, NaN where they are the mark of missing data."""
    with np.errstate(invalid="ignore"):  # NaN of a kind that signals
        values = raw.astype(np.float64)
    if ignore is not None:
        values[is_mark(raw, ignore)] = np.nan
    return values


def can_hold_mark(dtype: np.dtype[Any]) -> bool:
    """Whether numbers of a type can be `USUAL_MARK`."""
    return dtype.kind in "fi" and dtype.itemsize > 1


def is_mark(raw: np.ndarray, mark: float) -> Bool[np.ndarray, "..."]:
    """Where numbers of a file are its mark of missing data; one such as -1.23e34 is rounded as the
    data are.
    """
    return raw == (raw.dtype.type(mark) if raw.dtype.kind == "f" else mark)
