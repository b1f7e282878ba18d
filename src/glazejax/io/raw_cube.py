"""Base of every kind of file: its own numbers on disk, and what it says of them."""

import mmap
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from operator import itemgetter
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from jaxtyping import Float

from .finish import DELETED
from .quantity import nanometres
from .source import explain_errors, naming, refusal, show_path
from .spectra_table import Chosen, Stored

PerAxis: TypeAlias = tuple[int, int, int]
"""A number of each axis of an image: y, x and wavelength."""

CubeFields: TypeAlias = dict[str, Any]
"""Some fields of a `RawCube`, by their names."""

# Bytes of a mapped file that are let go together.
_MAPPED = 1 << 26
# What the system maps around a byte that is read.
_AROUND = 1 << 16


@contextmanager
def whole(path: Path) -> Iterator[None]:
    """Errors of other packages about a damaged file, each in its own way, as one sentence that
    names the file.

    Raises:
        ValueError: whatever they raised, but for what the system says and for a package that is
            missing.
    """
    with explain_errors(path):
        try:
            yield
        except ImportError:
            raise
        except MemoryError:
            raise refusal(
                path,
                "what is asked for does not fit into this machine's memory; is the file whole?",
            ) from None
        except Exception as error:
            named = isinstance(error, ValueError | OSError) and show_path(path) in str(error)
            if named or (isinstance(error, OSError) and error.strerror is not None):
                raise
            raise refusal(path, f"cannot be read; is the file whole? {error}") from error


class OnDisk:
    """Array of a file, opened when it is first read from, and again in every process that it is
    sent to.

    Threads may read at one time: what is mapped has no position in the file, and h5py, zarr and
    tifffile lock their own.

    Args:
        opener: function that opens it; it must be found by its name, so that it can be sent.
        arguments: of the opener.
    """

    def __init__(self, opener: Callable[..., Any], *arguments: Any):
        self._opener = opener
        self._arguments = arguments
        self._array: Any = None
        self._maps: list[mmap.mmap] = []
        self._mapped = 0
        self._opening = threading.Lock()

    @property
    def array(self) -> Any:
        """The open array: something with a shape and a dtype that slices are taken from."""
        with self._opening:
            if self._array is None:
                array = self._opener(*self._arguments)
                self._maps = _maps(array)
                self._array = array
        return self._array

    def __getitem__(self, key: tuple[slice, ...]) -> np.ndarray:
        return np.asarray(self.array[key])

    def used(self, count: int) -> None:
        """Says that so many bytes were read and are not needed any more.

        Pages of a mapped file count as this process' memory until they are let go; the system keeps
        them at hand.
        """
        self._mapped += count
        if self._mapped > _MAPPED and hasattr(mmap, "MADV_DONTNEED"):
            self._mapped = 0
            for mapped in self._maps:
                mapped.madvise(mmap.MADV_DONTNEED)

    def __reduce__(self) -> tuple[Any, ...]:
        return OnDisk, (self._opener, *self._arguments)


def _maps(array: Any) -> list[mmap.mmap]:
    """Maps of files into memory that an array, or an array of arrays, lies in."""
    if hasattr(array, "planes"):
        return [mapped for plane in array.planes for mapped in _maps(plane)]
    while isinstance(array, np.ndarray):
        array = array.base
    return [array] if isinstance(array, mmap.mmap) else []


@dataclass(frozen=True)
class RawCube:
    """An image as a reader found it: nothing is scaled, sorted or left out.

    Attributes:
        path: file, for the errors.
        format: what it is.
        data: its numbers, in the file's order of axes.
        order: which axis of `data` is y, which x, which the wavelength.
        sizes: of the axes of `data`.
        dtype: of the numbers.
        chunks: what the file stores together, along the axes of `data`; 1 where any window can be
            read as it is.
        wavelengths: (stored bands,), as the file has them; None where it has none.
        wavelength_unit: as the file states it; empty where it does not.
        quantity: what the file says of the values, such as ``radiance``; empty where it says
            nothing.
        good: the stored bands that are not marked as bad.
        gain: a stored number times this plus `offset` is the value; a number, or (stored bands,).
        offset: see `gain`.
        scale: value that stands for a reflectance of 1, if the file says so.
        ignore: stored numbers that mark missing data.
        notes: what the reader noticed.
        y: (lines,), the file's own coordinates, or None.
        x: (samples,), likewise.
        about_place: attributes of both coordinates: ``units``, ``pixel_size``.
        attributes: what else is worth keeping, such as ``crs_wkt``.
    """

    path: Path
    format: str
    data: OnDisk
    order: PerAxis
    sizes: tuple[int, ...]
    dtype: np.dtype[Any]
    chunks: tuple[int, ...] = (1, 1, 1)
    wavelengths: Stored | None = None
    wavelength_unit: str = ""
    quantity: str = ""
    good: Chosen | None = None
    gain: float | Stored = 1.0
    offset: float | Stored = 0.0
    scale: float | None = None
    ignore: tuple[float, ...] = ()
    notes: tuple[str, ...] = ()
    y: Float[np.ndarray, "lines"] | None = None
    x: Float[np.ndarray, "samples"] | None = None
    about_place: Mapping[str, Any] = field(default_factory=dict)
    attributes: Mapping[str, Any] = field(default_factory=dict)

    @property
    def shape(self) -> PerAxis:
        """Lines, samples, stored bands."""
        return itemgetter(*self.order)(self.sizes)

    @property
    def piece(self) -> PerAxis:
        """Lines, samples, bands that the file stores together."""
        return itemgetter(*self.order)(self.chunks)

    @property
    def top(self) -> float | None:
        """Stored number of a saturated reading: the largest of an integer type of a detector; None
        for floats.
        """
        if self.dtype.kind not in "iu" or self.dtype.itemsize > 2:
            return None
        top = float(np.iinfo(self.dtype).max)
        return None if top in self.ignore else top

    @property
    def apart(self) -> bool:
        """Return whether each band is stored as an image of its own."""
        return self.order[2] == 0 and self.piece[2] == 1

    @property
    def converts(self) -> bool:
        """Return whether the file says how its numbers become values."""
        return np.ndim(self.gain) + np.ndim(self.offset) > 0 or (self.gain, self.offset) != (
            1.0,
            0.0,
        )

    def nanometres(self, unit: str = "") -> tuple[Stored, list[str]]:
        """Wavelengths in nm, in the file's order, and notes.

        Args:
            unit: what the user says that they are in, before the file.

        Raises:
            ValueError: there are none, or they are not legal.
        """
        if self.wavelengths is None:
            raise refusal(
                self.path,
                f"no wavelengths for {self.shape[2]} bands; give them (wavelengths=, "
                "--wavelengths: a list, or a file of nm)",
            )
        with naming(self.path):
            return nanometres(self.wavelengths, unit or self.wavelength_unit)

    def block(self, y: slice, x: slice, bands: Chosen) -> np.ndarray:
        """Stored numbers, (y, x, bands), in the file's type; a view of the file where it is mapped
        into memory.

        Raises:
            ValueError: the file is damaged there.
        """
        first = int(bands.min())
        run = slice(first, int(bands.max()) + 1)
        keys: list[slice] = [slice(None)] * 3
        for axis, key in zip(self.order, (y, x, run), strict=True):
            keys[axis] = key
        with whole(self.path):
            stored = self.data[tuple(keys)].transpose(self.order)
        if bands.size == run.stop - first and bool((np.diff(bands) == 1).all()):
            return stored
        return stored[..., bands - first]

    def values(self, y: slice, x: slice, bands: Chosen, *, mark: bool = False) -> np.ndarray:
        """Values (stored numbers by gain and offset) as floats that hold them; NaN where data are
        missing.

        Args:
            y: lines.
            x: samples.
            bands: stored bands.
            mark: whether saturated readings become +inf.
        """
        values = self.numbers(self.block(y, x, bands), bands, mark=mark)
        # At most whole lines of all bands, and what is mapped around each.
        self.data.used(
            len(values) * self.shape[1] * self.shape[2] * self.dtype.itemsize + bands.size * _AROUND
        )
        return values

    def numbers(
        self,
        stored: np.ndarray,
        bands: Chosen,
        *,
        mark: bool = False,
        dtype: Any = np.float32,
    ) -> Float[np.ndarray, "... bands"]:
        """Values of stored numbers, (..., bands); NaN where data are missing.

        Args:
            stored: in the file's type.
            bands: which of the stored bands they are.
            mark: whether saturated readings become +inf.
            dtype: of the values, at least; they are of one that holds all numbers of the file.
        """
        # float32 holds all numbers of 16 bits; the larger types take float64.
        with np.errstate(invalid="ignore"):  # NaN of a kind that signals
            values = stored.astype(np.result_type(self.dtype.newbyteorder("="), dtype))
        if self.dtype.kind == "f":
            values[values < DELETED] = np.nan
        for number in self.ignore:
            # One such as -1.23e34 is rounded as the data are.
            mark_stored = stored.dtype.type(number) if self.dtype.kind == "f" else number
            values[stored == mark_stored] = np.nan
        if mark and self.top is not None:
            values[stored == self.top] = np.inf
        if self.converts:
            values *= _of(self.gain, bands)
            values += _of(self.offset, bands)
        return values


def _of(number: Any, bands: Chosen) -> Any:
    """A gain or offset of some bands, where each has its own."""
    return number[bands] if np.ndim(number) else number
