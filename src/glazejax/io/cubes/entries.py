"""Choice among many named arrays: the image, its wavelengths, and what their attributes mean."""

import base64
import binascii
import struct
from collections.abc import Callable, Mapping, Sequence
from math import prod
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from ..quantity import first_quantity, meaning
from ..raw_cube import CubeFields, OnDisk, RawCube
from ..source import refusal
from ..spectra_table import list_names
from .axes import axes_of

_SPECTRAL = (
    "wavelength",
    "wavelengths",
    "wl",
    "wvl",
    "lambda",
    "band_center",
    "center_wavelength",
    "centre_wavelength",
)


class FolderEntry(NamedTuple):
    """One array of a file."""

    name: str  # path in the file; empty for what is none of the user's
    array: Any
    attributes: Mapping[str, Any] = MappingProxyType({})
    dims: tuple[str | None, ...] = ()  # names of the axes, where they have some
    chunks: tuple[int, ...] = (1, 1, 1)  # what the file stores together

    @property
    def shape(self) -> tuple[int, ...]:
        """Sizes of its axes."""
        return tuple(self.array.shape)

    @property
    def dtype(self) -> np.dtype[Any]:
        """Type of its numbers."""
        return self.array.dtype

    @property
    def last(self) -> str:
        """Its own name, without the groups it is in."""
        return self.name.rsplit("/", 1)[-1]

    @property
    def group(self) -> str:
        """The groups it is in."""
        return self.name.rpartition("/")[0]


def describe(
    path: Path,
    format: str,
    entries: Sequence[FolderEntry],
    dataset: str | None,
    count: int | None,
    opener: Callable[[Path, str], Any],
    *,
    reverse: bool = False,
) -> RawCube:
    """The image among the arrays of a file.

    Args:
        path: for the errors.
        format: what the file is.
        entries: its arrays.
        dataset: name of the image's array, if the user said it.
        count: wavelengths, if the user gave them.
        opener: function that opens the array of a name, called when it is needed.
        reverse: whether the file has the axes in reverse.

    Raises:
        ValueError: no array of that name, several that can be meant, or wavelengths that are not
            legal.
    """
    image = _image(path, entries, dataset, count)
    stated, wavelength_unit = _wavelengths_of(image, entries)
    wavelengths = np.ravel(stated).astype(float)
    step = -1 if reverse else 1
    order = axes_of(image.shape[::step], count or wavelengths.size or None, image.dims[::step])
    if reverse:
        order = (2 - order[0], 2 - order[1], 2 - order[2])
    bands = image.shape[order[2]]
    spatial: CubeFields = {}
    y, x = (_coordinates(image, axis, entries) for axis in order[:2])
    if y is not None and x is not None:
        lines, samples = (np.asarray(place.array[...], float) for place in (y, x))
        unit = _text(x.attributes.get("units")) or _text(y.attributes.get("units"))
        spatial = {
            "y": lines,
            "x": samples,
            "about_place": {
                "units": unit or "as in the file",
                "pixel_size": tuple(
                    float(abs(steps.mean())) if steps.size else 1.0
                    for steps in map(np.diff, (lines, samples))
                ),
            },
        }
    return RawCube(
        path=path,
        format=format,
        data=OnDisk(opener, path, image.name),
        order=order,
        sizes=image.shape,
        dtype=image.dtype,
        chunks=image.chunks,
        wavelengths=wavelengths if wavelengths.size == bands else None,
        wavelength_unit=wavelength_unit,
        good=_good(image, entries, bands),
        **_meaning(path, image),
        **spatial,
    )


def _image(
    path: Path, entries: Sequence[FolderEntry], dataset: str | None, count: int | None
) -> FolderEntry:
    """The array that is meant."""
    cubes = [
        entry
        for entry in entries
        if len(entry.shape) == 3 and entry.dtype.kind in "fiu" and 0 not in entry.shape
    ]
    arrays = list_names([f"{entry.name or '(the array itself)'} {entry.shape}" for entry in cubes])
    if dataset is not None:
        wanted = dataset.strip("/")
        chosen = [entry for entry in cubes if entry.name == wanted] or [
            e for e in cubes if e.last == wanted
        ]
        if len(chosen) == 1:
            return chosen[0]
        if chosen:
            raise refusal(
                path,
                f"{dataset!r} is the name of {len(chosen)} arrays: say which with its groups: "
                f"{arrays}",
            )
        have = f"there are {arrays}" if cubes else "there is none"
        raise refusal(path, f"no dataset {dataset!r} with three axes of numbers; {have}")
    if not cubes:
        raise refusal(path, "no image of spectra: no array has three axes of numbers")
    for narrowed in (
        cubes,
        [entry for entry in cubes if count in entry.shape],
        [entry for entry in cubes if np.size(_wavelengths_of(entry, entries)[0])],
        [entry for entry in cubes if "reflectance" in entry.last.lower()],
    ):
        if len(narrowed) == 1:
            return narrowed[0]
    raise refusal(path, f"{len(cubes)} arrays can be meant, choose a dataset: {arrays}")


def _wavelengths_of(image: FolderEntry, entries: Sequence[FolderEntry]) -> tuple[Any, str]:
    """Wavelengths of an image and their unit: an array named so that is as long as one of its axes,
    or an attribute; no wavelengths where there is neither.
    """
    named = [
        entry
        for entry in entries
        # MATLAB has rows or columns for lists.
        if entry.shape
        and max(entry.shape) in image.shape
        and max(entry.shape) == prod(entry.shape)
        and entry.dtype.kind in "fiu"
        and entry.last.lower().startswith(_SPECTRAL)
    ]
    if named:
        # The nearest: in the image's own group, then below it, then anywhere.
        named.sort(
            key=lambda entry: (entry.group != image.group, not entry.group.startswith(image.group))
        )
        return named[0].array[...], _unit(named[0].attributes)
    for title, value in image.attributes.items():
        if title.lower() in _SPECTRAL and np.ndim(value) == 1 and len(value) in image.shape:
            return value, _text(image.attributes.get("wavelength_units"))
    return (), ""


def _coordinates(
    image: FolderEntry, axis: int, entries: Sequence[FolderEntry]
) -> FolderEntry | None:
    """Coordinates along an axis: the array of the axis' name."""
    name = str(dict(enumerate(image.dims)).get(axis) or "").strip("/")
    fitting = {
        entry.name: entry
        for entry in entries
        if name and entry.shape == (image.shape[axis],) and entry.dtype.kind in "fiu"
    }
    return fitting.get(name) or fitting.get(f"{image.group}/{name}".strip("/"))


def _good(image: FolderEntry, entries: Sequence[FolderEntry], count: int) -> np.ndarray | None:
    """Bands that no list of bad bands names."""
    lists: list[Any] = [
        entry.array for entry in entries if entry.last.lower() in ("bbl", "good_wavelengths")
    ]
    for marks in (*lists, image.attributes.get("bbl", 0)):
        if np.shape(marks) == (count,) and np.any(marks):
            return np.flatnonzero(marks)
    return None


def _meaning(path: Path, image: FolderEntry) -> CubeFields:
    """Quantity, gain, offset, scale and marks of missing data by the conventions of CF, and by the
    names that others use.
    """
    attributes = image.attributes
    values = {
        title: _number(path, title, value)
        for title, value in attributes.items()
        if title in (*_MISSING, "scale_factor", "add_offset", "Scale_Factor")
    }
    ignore = {values[title] for title in _MISSING if title in values}
    unit = _unit(attributes)
    said = [unit, *(_text(attributes.get(title)) for title in ("long_name", "standard_name"))]
    return {
        "quantity": first_quantity([*said, image.last]),
        "gain": values.get("scale_factor", 1.0),
        "offset": values.get("add_offset", 0.0),
        "scale": values.get("Scale_Factor", 1.0 if unit == "1" else meaning(unit).scale),
        "ignore": tuple(sorted(value for value in ignore if np.isfinite(value))),
    }


_MISSING = ("_FillValue", "missing_value", "Data_Ignore_Value")


def _number(path: Path, title: str, value: Any) -> float:
    """A number of an attribute: alone, in an array of one, or in base64, as xarray writes marks
    into zarr 3.
    """
    try:
        if isinstance(value, str | bytes):
            return float(struct.unpack("<d", base64.standard_b64decode(value))[0])
        return float(np.ravel(value)[0])
    except (ValueError, TypeError, IndexError, binascii.Error, struct.error):
        raise refusal(path, f"attribute {title!r} is {value!r}, not a number") from None


def _unit(attributes: Mapping[str, Any]) -> str:
    return next(
        (_text(value) for title, value in attributes.items() if title.lower() in ("units", "unit")),
        "",
    )


def _text(value: Any) -> str:
    """An attribute as text."""
    if isinstance(value, np.ndarray) and value.size == 1:
        value = value.ravel()[0]
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value or "")
