"""The one entry to images of spectra: from a path and what the user says of it to a lazy
`xarray.DataArray`.
"""

import contextlib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Int

from ...extras import require
from ...spectra import describe_grid, lie_between, same_grid, validate_wavelengths
from ..finish import in_order
from ..probe import scale_of, with_usual_mark
from ..quantity import Stated, read_units
from ..raw_cube import RawCube
from ..source import naming, refusal
from ..spectra_table import Bands, Stored
from .calibration import calibration
from .numbers import read_numbers
from .opening import raw_cube

if TYPE_CHECKING:
    import xarray


@dataclass(frozen=True)
class CubeSource:
    """An image of spectra and how it is to be read; can be sent to other processes, which open the
    file themselves.

    Attributes:
        path: ENVI header or data, a zarr store, NetCDF, HDF5 or MATLAB, TIFF, a folder of TIFFs or
            PNGs, or .npy.
        wavelengths: nm, one a stored band, where the file has none; numbers or a text file of
            numbers.
        dataset: of a zarr, NetCDF or HDF5 file; left out, the one array that can be meant.
        white: reading of a white: a cube of the same size, a frame of the same width (averaged over
            its lines), or one spectrum. With it reflectance is (raw - dark) / (white - dark) times
            `white_reflectance`, NaN where the white is not above the dark; `scale` and a unit of
            values are then refused.
        dark: reading of no light, of the same kinds.
        white_reflectance: the white's own reflectance, a number or a file of one spectrum; needs
            `white`.
        quantity: ``reflectance``, where that is what the values are, whatever the file calls them.
        unit: what the file does not say, or says wrongly: ``nm``, ``um``, ``1/cm`` of wavelengths,
            ``percent`` or ``fraction`` of values, or one of each, ``1/cm percent``.
        scale: value that stands for a reflectance of 1, where the file does not say.
        window: first line, end line, first sample, end sample; counted from 0, ends not included.
        binning: lines, samples and bands of which the mean is taken; what does not fill a bin is
            left out.
        bands: nm, first and last wavelength that are used.
    """

    path: Path
    wavelengths: tuple[float, ...] | str | Path | None = None
    dataset: str | None = None
    white: str | Path | None = None
    dark: str | Path | None = None
    white_reflectance: float | str | Path = 1.0
    quantity: str | None = None
    unit: str | None = None
    scale: float | None = None
    window: tuple[int, int, int, int] | None = None
    binning: tuple[int, int, int] = (1, 1, 1)
    bands: tuple[float, float] | None = None

    def open(self) -> "xarray.DataArray":
        """The image as one lazy array of reflectance factors; see `open_cube`."""
        return open_cube(**vars(self))


def open_cube(
    path: str | Path,
    *,
    wavelengths: Any = None,
    dataset: str | None = None,
    white: str | Path | None = None,
    dark: str | Path | None = None,
    white_reflectance: float | str | Path = 1.0,
    quantity: str | None = None,
    unit: str | None = None,
    scale: float | None = None,
    window: tuple[int, int, int, int] | None = None,
    binning: tuple[int, int, int] = (1, 1, 1),
    bands: tuple[float, float] | None = None,
) -> "xarray.DataArray":
    """Open an image of spectra without reading it, as one lazy array with dims y, x and wavelength.

    Values are reflectance factors as fractions, float32, NaN where data are missing; they are read
    when they are asked for (``cube.isel(y=slice(0, 256)).values``), and only the part that is asked
    for. Wavelengths are nm and ascend; bands that the file marks as bad are left out. Coordinates y
    and x are the file's own, or centres of pixels (0.5, 1.5, ... of the whole image), and say their
    unit and pixel size where the file does.

    ``attrs`` has ``saturated``: a value at or above it is a detector's upper end. That is the
    largest number of an 8 or 16 bit integer type by the scale; where the cube is calibrated or
    binned, a reading at the largest number becomes
    +inf, and so does every bin that holds one. Further ``notes`` (sentences on what was changed),
    ``path``, ``format``,
    ``unit`` (of the file), ``shape_in_file``, ``window`` and ``binning``.

    The arguments are those of `CubeSource`, which says what they are; wavelengths may be any
    sequence of numbers.

    Raises:
        FileNotFoundError: no such file.
        OSError: the system cannot read it.
        ValueError: the file is not legal, or does not fit what is asked for; one line that says
        how to correct it. ModuleNotFoundError: a package of the extra ``cube`` is missing.
    """
    require("xarray")
    stated = Stated(quantity=quantity, unit=unit, scale=scale)
    length, value = read_units(stated)
    _check_options(white, dark, white_reflectance, value, binning)
    listed = None if wavelengths is None else read_numbers(wavelengths, length)
    raw = raw_cube(Path(path), dataset, None if listed is None else listed.size)
    raw = with_usual_mark(raw)
    notes = list(raw.notes)
    stored = _stored_wavelengths(raw, listed, length, notes)
    grid, groups = _grid(raw, stored, bands, binning[2], notes)
    lines_and_samples = _window(raw, window, binning, notes)
    value_of_one = 1.0
    unit_read = "raw"
    calibrated = None
    if white is not None:
        calibrated = calibration(raw, stored, white, dark, white_reflectance, notes)
    else:
        cure = "give the scale (scale=10000, --scale 10000), or a white reference"
        value_of_one, unit_read = scale_of(raw, groups.ravel(), notes, cure, **stated)
    from .lazy import CubeReading, as_data_array

    reading = CubeReading(
        raw=raw,
        bands=groups,
        window=lines_and_samples,
        binning=(binning[0], binning[1]),
        scale=value_of_one,
        calibration=calibrated,
    )
    return as_data_array(reading, grid, unit_read, notes)


def _check_options(
    white: str | Path | None,
    dark: str | Path | None,
    white_reflectance: float | str | Path,
    scale: float | None,
    binning: tuple[int, int, int],
) -> None:
    """Refuse options that contradict each other or mean nothing; the scale may be that of a
    unit.
    """
    if dark is not None and white is None:
        raise ValueError("a dark reference alone calibrates nothing; give a white one too")
    if white is None and white_reflectance != 1.0:
        raise ValueError(
            "the white's own reflectance alone calibrates nothing; give a white reference too"
        )
    if white is not None and scale is not None:
        raise ValueError(
            "give a scale or unit of values, or a white reference, not both: the white says what a "
            "reflectance of 1 is"
        )
    if len(binning) != 3 or min(binning) < 1:
        raise ValueError(
            f"binning is {binning}; it must be three whole numbers from 1 on: y, x, wavelength"
        )


def _stored_wavelengths(raw: RawCube, given: Stored | None, unit: str, notes: list[str]) -> Stored:
    """Wavelengths of the stored bands, nm, in the file's order."""
    if given is None:
        wavelengths, remarks = raw.nanometres(unit)
        notes += remarks
        return wavelengths
    count = raw.shape[2]
    if given.size != count:
        raise refusal(raw.path, f"{given.size} wavelengths were given for {count} bands")
    with contextlib.suppress(ValueError):
        if not same_grid(raw.nanometres(unit)[0], given):
            notes.append("the wavelengths that were given are used, not the file's own")
    return given


def _grid(
    raw: RawCube,
    stored: Stored,
    limits: tuple[float, float] | None,
    each: int,
    notes: list[str],
) -> tuple[Bands, Int[np.ndarray, "bands n"]]:
    """Wavelengths that are given, ascending, and the stored bands that each is the mean of."""
    grid, bands = in_order(stored, raw.good, notes)
    new = np.concatenate([[True], np.diff(grid) > 0])
    if not new.all():
        again = ", ".join(f"{value:g}" for value in np.unique(grid[~new])[:3])
        notes.append(f"{int((~new).sum())} bands repeat a wavelength ({again} nm) and are left out")
        grid = grid[new]
        bands = bands[new]
    with naming(raw.path):
        validate_wavelengths(grid)
    if limits is not None:
        first, last = limits
        inside = lie_between(grid, first, last)
        if not inside.any():
            raise refusal(
                raw.path,
                f"no band lies from {first:g} to {last:g} nm; the image has {describe_grid(grid)}",
            )
        grid = grid[inside]
        bands = bands[inside]
    if each > grid.size:
        raise refusal(
            raw.path, f"bins of {each} bands are larger than the {grid.size} bands that there are"
        )
    whole = grid.size // each * each
    if whole < grid.size:
        notes.append(f"{grid.size - whole} bands at the red end do not fill a bin and are left out")
    return grid[:whole].reshape(-1, each).mean(1), bands[:whole].reshape(-1, each)


def _window(
    raw: RawCube,
    window: tuple[int, int, int, int] | None,
    binning: tuple[int, int, int],
    notes: list[str],
) -> tuple[int, int, int, int]:
    """First and end line and sample, checked."""
    lines, samples, _ = raw.shape
    y0, y1, x0, x1 = (0, lines, 0, samples) if window is None else window
    if not (0 <= y0 < y1 <= lines and 0 <= x0 < x1 <= samples):
        raise refusal(
            raw.path,
            f"the window of lines {y0}:{y1} and samples {x0}:{x1} does not lie in the image of "
            f"{lines} lines x {samples} samples",
        )
    for size, each, what in ((y1 - y0, binning[0], "lines"), (x1 - x0, binning[1], "samples")):
        if each > size:
            raise refusal(
                raw.path, f"bins of {each} {what} are larger than the {size} {what} that there are"
            )
        if size % each:
            notes.append(f"{size % each} {what} at the end do not fill a bin and are left out")
    return y0, y1, x0, x1
