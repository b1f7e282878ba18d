"""Raw readings to reflectance, by white and dark references: opened, held against the cube,
averaged where they are frames of a line camera.
"""

import contextlib
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import numpy as np
from jaxtyping import Float

from ...spectra import resample, same_grid
from ..files.sample import read_sample
from ..files.sniff import header_beside
from ..raw_cube import RawCube
from ..source import refusal
from ..spectra_table import Chosen, Stored
from .numbers import column, load_npy
from .opening import raw_cube

# Readings of a white or of no light: (1, samples or 1, stored bands), averaged over lines; or a
# file with a reading for each pixel.
Reference: TypeAlias = Float[np.ndarray, "1 samples stored"] | RawCube


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
    own: Stored

    def apply(self, values: np.ndarray, y: slice, x: slice, bands: Chosen) -> np.ndarray:
        """Reflectance: (raw - dark) / (white - dark) times the white's own; NaN where the white is
        not above the dark.

        A saturated reading (+inf) stays +inf.
        """
        white = _part(self.white, y, x, bands).astype(np.float64)
        if self.dark is not None:
            dark = _part(self.dark, y, x, bands)
            white = white - dark
            values = values - dark.astype(values.dtype)
        with np.errstate(invalid="ignore", divide="ignore"):
            gain = np.where(white > 0, self.own[bands] / white, np.nan)
            return values * gain.astype(values.dtype)


def _part(reference: Reference, y: slice, x: slice, bands: Chosen) -> np.ndarray:
    """Readings that belong to a window, ready to be broadcast."""
    if isinstance(reference, RawCube):
        values = reference.values(y, x, bands, mark=True)
        values[np.isinf(values)] = np.nan
        return values
    return reference[:, x if reference.shape[1] > 1 else slice(None)][..., bands]


def calibration(
    cube: RawCube,
    wavelengths: Stored,
    white: str | Path,
    dark: str | Path | None,
    own: float | str | Path,
    notes: list[str],
) -> Calibration:
    """Calibration of a cube.

    Args:
        cube: what is to be calibrated.
        wavelengths: of its stored bands, nm, in the file's order.
        white: reading of the white.
        dark: reading of no light, or None for 0.
        own: the white's own reflectance.
        notes: what was noticed is added.

    Raises:
        FileNotFoundError: no such file.
        ValueError: a reference has another size or other wavelengths than the cube, or the white's
            own reflectance is not positive or does not reach over the cube's wavelengths.
    """
    return Calibration(
        _reference(cube, wavelengths, Path(white), "white", notes),
        None if dark is None else _reference(cube, wavelengths, Path(dark), "dark", notes),
        _own(wavelengths, own),
    )


def _own(wavelengths: Stored, own: float | str | Path) -> Stored:
    """The white's own reflectance at each stored band."""
    if not isinstance(own, str | Path):
        if not (np.isfinite(own) and 0 < own <= 2):
            raise ValueError(
                f"the white's own reflectance is {own:g}; it must lie above 0 and be a fraction"
            )
        return np.full(wavelengths.size, float(own))
    table = read_sample(str(own), argument="white_reflectance")
    grid, back = np.unique(wavelengths, return_inverse=True)
    try:
        values = np.asarray(resample(table.wavelengths, table.reflectance[0], grid))
    except ValueError as error:
        raise refusal(own, f"the white's own reflectance: {error}") from None
    return values[back]


def _reference(
    cube: RawCube, wavelengths: Stored, path: Path, what: str, notes: list[str]
) -> Reference:
    """A white or dark: one spectrum, a frame averaged over its lines, or a reading for
    each pixel.
    """
    lines, samples, count = cube.shape
    if (spectrum := _spectrum(path)) is not None:
        if spectrum.size != count:
            raise refusal(
                path,
                f"the {what} reference has {spectrum.size} readings; the cube has {count} bands",
            )
        return spectrum.reshape(1, 1, -1)
    frame = raw_cube(path, count=count)
    height, width, stored = frame.shape
    if stored != count:
        raise refusal(path, f"the {what} reference has {stored} bands; the cube has {count}")
    # What the user corrects of the cube, a reference of its camera states as the cube does.
    grids = [wavelengths]
    with contextlib.suppress(ValueError):
        grids.append(cube.nanometres()[0])
    # Where the reference does not say, or not legally, it is the cube's camera.
    other = False
    with contextlib.suppress(ValueError):
        stated = frame.nanometres()[0]
        other = not any(same_grid(stated, grid) for grid in grids)
    if other:
        raise refusal(path, f"the {what} reference has other wavelengths than the cube")
    if (height, width) == (lines, samples) and lines > 1:
        return frame
    if width not in (1, samples):
        raise refusal(
            path,
            f"the {what} reference is {height} lines x {width} samples; the cube is {lines} x "
            f"{samples}: give a frame of the same width, one of the same size, or one spectrum",
        )
    if height > 1:
        notes.append(f"the {what} reference is the mean of its {height} lines")
    return _average_lines(frame)


def _spectrum(path: Path) -> Stored | None:
    """Readings of a text file or of a .npy file of one axis; None if the file is an image."""
    kind = path.suffix.lower()
    text = kind in (".txt", ".csv", ".dat") and header_beside(path) is None
    return column(path) if text or (kind == ".npy" and load_npy(path).ndim == 1) else None


def _average_lines(frame: RawCube) -> Float[np.ndarray, "1 samples stored"]:
    """Mean over the lines; saturated and missing readings are left out."""
    lines, samples, count = frame.shape
    total = np.zeros((2, samples, count))
    step = max(frame.piece[0], 64)
    for start in range(0, lines, step):
        values = frame.values(
            slice(start, min(lines, start + step)), slice(0, samples), np.arange(count), mark=True
        )
        there = np.isfinite(values)
        total += [np.where(there, values, 0.0).sum(axis=0, dtype=np.float64), there.sum(axis=0)]
    with np.errstate(invalid="ignore", divide="ignore"):
        return total[:1] / total[1]
