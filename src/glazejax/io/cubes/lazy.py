"""Reflectance of a window, read and worked out when xarray asks for it."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import xarray
from jaxtyping import Float, Int
from xarray.backends import BackendArray
from xarray.core.indexing import (
    ExplicitIndexer,
    IndexingSupport,
    LazilyIndexedArray,
    explicit_indexing_adapter,
)

from ..raw_cube import PerAxis, RawCube
from ..spectra_table import Bands
from .calibration import Calibration

# Numbers worked on at a time: few enough for a processor's cache, so that bands that lie apart are
# brought together there, and many enough that each piece is worth its call.
_AT_ONCE = 1 << 19


@dataclass(frozen=True, eq=False)
class CubeReading(BackendArray):
    """From the file's numbers to reflectance, as an array for xarray's indexing: it reads when its
    values are asked for.

    Attributes:
        raw: the file.
        bands: (bands, n), the stored bands of each band that is given; their mean is taken.
        window: first line, end line, first sample, end sample.
        binning: lines and samples of which the mean is taken.
        scale: value that stands for a reflectance of 1.
        calibration: white and dark, in place of the scale; or None.
    """

    raw: RawCube
    bands: Int[np.ndarray, "bands n"]
    window: tuple[int, int, int, int]
    binning: tuple[int, int]
    scale: float
    calibration: Calibration | None

    dtype: ClassVar[np.dtype[Any]] = np.dtype(np.float32)

    @property
    def shape(self) -> PerAxis:
        """Lines, samples and bands that are given; lines and samples that do not fill a bin are
        left out.
        """
        y0, y1, x0, x1 = self.window
        return (y1 - y0) // self.binning[0], (x1 - x0) // self.binning[1], len(self.bands)

    @property
    def binned(self) -> bool:
        """Return whether means are taken."""
        return self.binning != (1, 1) or self.bands.shape[1] > 1

    @property
    def marks(self) -> bool:
        """Return whether a saturated reading becomes +inf, as it has no one value."""
        return self.binned or self.calibration is not None or np.ndim(self.raw.gain) > 0

    def __getitem__(self, key: ExplicitIndexer) -> np.ndarray:
        # xarray cannot turn a slice that runs backwards over nothing.
        whole = type(key)(
            tuple(
                slice(0) if isinstance(part, slice) and not range(size)[part] else part
                for part, size in zip(key.tuple, self.shape, strict=True)
            )
        )
        return explicit_indexing_adapter(whole, self.shape, IndexingSupport.BASIC, self._window)

    def _window(self, key: tuple[int | slice, ...]) -> np.ndarray:
        """Reflectance at whole numbers, which take their axis away, and slices with positive
        steps.
        """
        slices = tuple(k if isinstance(k, slice) else slice(k, k + 1) for k in key)
        single = tuple(axis for axis, k in enumerate(key) if not isinstance(k, slice))
        return np.squeeze(self.take(slices), axis=single)

    def take(self, key: tuple[slice, ...]) -> Float[np.ndarray, "y x bands"]:
        """Reflectance of a window: a slice with a positive step along each of the dims."""
        lines, samples, bands = (
            range(size)[part] for part, size in zip(key, self.shape, strict=True)
        )
        values = np.empty((len(lines), len(samples), len(bands)), np.float32)
        if values.size:
            groups = self.bands[bands.start : bands.stop : bands.step]
            # Bands that are read together where each lies in a place of its own: one cache line of
            # float32.
            each = max(1, 16 // groups.shape[1]) if self.raw.apart else len(groups)
            for first in range(0, len(groups), each):
                few = groups[first : first + each]
                for part in self._strips(lines, len(samples) * self.binning[1] * few.size):
                    values[part, :, first : first + each] = self._strip(lines[part], samples, few)
        return values

    def _strips(self, lines: range, width: int) -> Iterator[slice]:
        """Parts of the lines that are read at a time: whole pieces of the file, and of bearable
        size.
        """
        each = self.binning[0]
        if lines.step > 1 and each > 1:
            yield from (slice(i, i + 1) for i in range(len(lines)))
            return
        piece = self.raw.piece[0]
        most = max(1, _AT_ONCE // max(width * each, 1)) * each * lines.step
        most = max(piece, most // piece * piece)
        start = 0
        while start < len(lines):
            first = self.window[0] + lines[start] * each
            # To the end of the last piece that is not too much, counted in lines of the file.
            last = (first // piece) * piece + most
            stop = max(start + 1, start + (last - first) // (each * lines.step))
            yield slice(start, min(stop, len(lines)))
            start = stop

    def _strip(
        self, lines: range, samples: range, groups: Int[np.ndarray, "bands n"]
    ) -> np.ndarray:
        """Reflectance of a few lines."""
        y0, _, x0, _ = self.window
        by, bx = self.binning
        y, ny = _span(lines, y0, by)
        x, nx = _span(samples, x0, bx)
        stored = groups.ravel()
        values = self.raw.values(y, x, stored, mark=self.marks)
        if self.calibration is not None:
            values = self.calibration.apply(values, y, x, stored)
        elif self.scale != 1.0:
            values /= values.dtype.type(self.scale)
        if not self.binned:
            return values
        values = binned_mean(values.reshape(ny, by, nx, bx, *groups.shape))
        # Bins between those that were asked for were read with them.
        return values[:, :: samples.step] if bx > 1 else values


def _span(wanted: range, start: int, each: int) -> tuple[slice, int]:
    """Lines (or samples) of the file for a range of bins, and how many bins they hold."""
    if each == 1:
        return slice(start + wanted.start, start + wanted[-1] + 1, wanted.step), len(wanted)
    return slice(start + wanted.start * each, start + (wanted[-1] + 1) * each), wanted[
        -1
    ] + 1 - wanted.start


def binned_mean(
    values: Float[np.ndarray, "ny by nx bx bands n"],
) -> Float[np.ndarray, "ny nx bands"]:
    """Means over the bins that leave NaN out; NaN where a bin has nothing else, +inf where it has a
    saturated value.
    """
    there = ~np.isnan(values)
    if there.all():
        return _sums(values, np.float64) / (values.shape[1] * values.shape[3] * values.shape[5])
    counts = _sums(there, np.float32)
    with np.errstate(invalid="ignore", divide="ignore"):
        return _sums(np.where(there, values, values.dtype.type(0)), np.float64) / counts


def _sums(values: np.ndarray, dtype: Any) -> np.ndarray:
    """Sums over the second, fourth and sixth axis; the last is short, and NumPy's own sum would
    take it one by one.
    """
    total = values[..., 0].astype(dtype)
    for k in range(1, values.shape[-1]):
        total += values[..., k]
    return total.sum((1, 3))


def as_data_array(
    reading: CubeReading, wavelengths: Bands, unit: str, notes: list[str]
) -> xarray.DataArray:
    """The lazy array that users see.

    Args:
        reading: how values are made.
        wavelengths: nm.
        unit: what the file's numbers are.
        notes: sentences on what was changed.
    """
    raw = reading.raw
    y0, _, x0, _ = reading.window
    by, bx = reading.binning
    lines, samples, _ = reading.shape
    dims = ("y", "x", "wavelength")
    about = {"units": "pixel", **raw.about_place}
    size = about.pop("pixel_size", (1.0, 1.0) if raw.y is None else None)
    places = {}
    for i, (name, stored, first, count, each) in enumerate(
        (("y", raw.y, y0, lines, by), ("x", raw.x, x0, samples, bx))
    ):
        further = {} if size is None else {"pixel_size": size[i] * each}
        # The file's own coordinates, or centres of pixels from the image's upper left corner.
        pixels = np.arange(first, first + count * each)
        centres = (pixels + 0.5 if stored is None else stored[pixels]).reshape(count, each).mean(1)
        places[name] = (name, centres, about | further)
    attributes: dict[str, Any] = {
        "long_name": "reflectance factor",
        "units": "1",
        "path": str(raw.path),
        "format": raw.format,
        "unit": unit,
        "shape_in_file": list(raw.shape),
        "window": list(reading.window),
        "binning": [by, bx, int(reading.bands.shape[1])],
        "notes": list(notes),
        **raw.attributes,
    }
    if raw.top is not None:
        # The largest stored number, rounded as all others are.
        top = raw.numbers(np.full(1, raw.top, raw.dtype), np.zeros(1, int))[0]
        attributes["saturated"] = (
            np.inf if reading.marks else float(top / np.float32(reading.scale))
        )
    array = xarray.DataArray(
        xarray.Variable(dims, LazilyIndexedArray(reading)),
        {**places, "wavelength": ("wavelength", wavelengths, {"units": "nm"})},
        name="reflectance",
        attrs=attributes,
    )
    # What the file stores together, for those who choose the size of their windows.
    sizes = zip(dims, raw.piece, attributes["binning"], strict=True)
    array.encoding["preferred_chunks"] = {
        name: max(1, -(-size // each)) for name, size, each in sizes
    }
    return array
