"""Images that are plain arrays: .npy, and ENVI with its header."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..files.read import envi_file
from ..formats.envi import EnviFile
from ..raw_cube import CubeFields, OnDisk, RawCube
from ..source import refusal
from .axes import axes_of
from .numbers import load_npy


def envi_cube(path: Path, count: int | None) -> RawCube:
    """An ENVI image, header or data named; mapped into memory, in any interleave, type and byte
    order.

    Args:
        path: of the header or the data.
        count: wavelengths, if they are known; then those of the header need not be legal.

    Raises:
        FileNotFoundError: no such file, or a header without its data.
        ValueError: the header is not legal, or the data are not as long as it promises.
    """
    envi = envi_file(path)
    if envi.is_library:
        raise envi.error("an ENVI spectral library, not an image; use read_spectra")
    wavelengths = None
    if "wavelength" in envi.header:
        try:
            wavelengths = envi.wavelengths()
        except ValueError:
            if count is None:
                raise
    return replace(envi.raw(wavelengths), **_place(envi))


def _place(envi: EnviFile) -> CubeFields:
    """Coordinates and pixel size from the header's ``map info``, ``pixel size`` and ``coordinate
    system string``.

    ``map info`` is projection, reference pixel (x, y; 1, 1 is the corner of the first pixel), its
    easting and northing, pixel size (x, y), then zone and datum, and entries ``units=`` and
    ``rotation=``.
    """
    attributes: dict[str, Any] = {}
    if system := envi.entries("coordinate system string"):
        attributes["crs_wkt"] = ",".join(system)
    info = envi.entries("map info")
    sizes = envi.entries("pixel size")
    about: dict[str, Any] = {}
    placed: CubeFields = {"attributes": attributes, "about_place": about}
    if info:
        attributes["map_info"] = ", ".join(info)
    words = dict(entry.lower().split("=", 1) for entry in (info or sizes) if "=" in entry)
    # Without a place on the map lines and samples count from the image's corner.
    corner = [1.0, 1.0, 0.0, 0.0]
    try:
        *origin, dx, dy = map(float, info[1:7] if info else [*corner, *sizes[:2]])
        turned = float(words.get("rotation", 0)) != 0
    except ValueError:
        return placed
    if len(origin) == 4 and dx > 0 and dy > 0:
        about["pixel_size"] = (dy, dx)
        about["units"] = words.get("units", "metre").strip()
        # Those of a turned image have no coordinates of the map.
        mapped = info and not turned
        x0, y0, east, north = origin if mapped else corner
        placed["x"] = east + (np.arange(envi.sizes["samples"]) + 1.5 - x0) * dx
        placed["y"] = north + (np.arange(envi.sizes["lines"]) + 1.5 - y0) * (-dy if mapped else dy)
    return placed


def npy_cube(path: Path, count: int | None) -> RawCube:
    """An array that NumPy saved, mapped into memory.

    Args:
        path: of the .npy file.
        count: bands, if they are known; they show which axis is the wavelength.

    Raises:
        ValueError: not three axes of real numbers.
    """
    array = load_npy(path)
    if array.ndim != 3 or array.dtype.kind not in "fiu":
        raise refusal(
            path,
            f"an array of shape {array.shape} and type {array.dtype}, not an image of y, x, "
            "wavelength",
        )
    return RawCube(
        path=path,
        format="NumPy array",
        data=OnDisk(load_npy, path),
        order=axes_of(array.shape, count),
        sizes=array.shape,
        dtype=array.dtype,
    )
