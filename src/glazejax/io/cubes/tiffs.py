"""Images in TIFF: one file with a page a band (or all bands in each pixel), or a folder with a file
a band.
"""

import contextlib
import re
import weakref
from pathlib import Path
from typing import Any

import numpy as np

from ...extras import require
from ..raw_cube import CubeFields, OnDisk, RawCube, whole
from ..source import refusal
from ..spectra_table import Stored, list_names
from .axes import axes_of

TIFF = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
"""What a TIFF begins with; + is BigTIFF."""

_NM = re.compile(r"(?<![\d.])(\d{3,4}(?:\.\d+)?)[ _]?nm", re.IGNORECASE)
_DIGITS = re.compile(r"\d+(?:\.\d+)?")


class Planes:
    """Bands that lie apart, each an image of its own, as one array (band, y, x)."""

    def __init__(self, planes: list[Any]):
        self.planes = planes

    def __getitem__(self, key: tuple[slice, slice, slice]) -> np.ndarray:
        bands, y, x = key
        return np.stack([np.asarray(plane[y, x]) for plane in self.planes[bands]])


def tiff_cube(path: Path, count: int | None) -> RawCube:
    """A TIFF of several bands; windows are read where the file allows it, else whole tiles, strips
    or pages.

    Raises:
        ValueError: not an image of several bands of one size and type.
    """
    require("tifffile")
    import tifffile

    with tifffile.TiffFile(path) as file:
        series = file.series[0]
        wavelengths = _wavelengths_of_metadata(file)
        place = _place(file)
        if len(series.shape) == 3:
            order = axes_of(series.shape, count, series.axes)
            count = int(series.shape[order[2]])
            dtype = series.dtype
            layout: CubeFields = {
                "data": OnDisk(_array, path, None),
                "order": order,
                "sizes": tuple(map(int, series.shape)),
                "chunks": getattr(_array(path, None), "chunks", (1, 1, 1)),
            }
        else:
            count = len(file.pages)
            sizes = sorted({(page.shape, page.dtype) for page in file.pages}, key=str)
            (shape, dtype), *others = sizes
            if others or len(shape) != 2 or count < 2:
                kinds = list_names([f"{shape} {dtype}" for shape, dtype in sizes])
                raise refusal(
                    path,
                    f"not an image of several bands of one size and type: {count} pages of {kinds}",
                )
            layout = _layout_of_planes(shape, [(path, number) for number in range(count)])
    if wavelengths is not None and wavelengths.size != count:
        wavelengths = None
    return RawCube(
        path=path,
        format="TIFF",
        dtype=_check_type(path, dtype),
        wavelengths=wavelengths,
        **layout,
        **place,
    )


def _layout_of_planes(size: tuple[int, ...], places: list[tuple[Path, int | None]]) -> CubeFields:
    """Fields of a `RawCube` of which each band is a file, or a page of one."""
    return {
        "data": OnDisk(_planes, *places),
        "order": (1, 2, 0),
        "sizes": (len(places), *size),
        "chunks": (1, *getattr(_array(*places[0]), "chunks", (1, 1))),
    }


class Png:
    """A PNG, read as a whole whenever a part is asked for."""

    def __init__(self, path: Path):
        require("PIL")
        from PIL import Image

        self.path = path
        with Image.open(path) as image:
            grey = _GREY.get(image.mode)
            self.chunks: tuple[int, ...] = (image.height, image.width)
            bands = () if grey else (len(image.getbands()),)
            self.shape: tuple[int, ...] = (*self.chunks, *bands)
            self.dtype: np.dtype[Any] = np.dtype(grey or "u1")

    def __getitem__(self, key: tuple[slice, slice]) -> np.ndarray:
        from PIL import Image

        with Image.open(self.path) as image:
            return np.asarray(image)[key].astype(self.dtype)


# Modes of Pillow whose pixels are one number; 16 bits may come as 32.
_GREY = {"L": "u1", "I": "u2", "I;16": "u2", "I;16B": "u2"}


def picture_folder(path: Path, count: int | None) -> RawCube:
    """A folder with a picture a band, all TIFF or all grey PNG, wavelengths in their names
    (``band_450nm.tif``) or given in the order of the names.

    Raises:
        ValueError: no such picture there, or they differ in size or type.
    """
    require("tifffile")
    import tifffile

    # band2 stands before band10.
    ordered = sorted(
        path.iterdir(),
        key=lambda file: re.sub(r"\d+", lambda number: number[0].zfill(20), file.name),
    )
    for endings in ((".tif", ".tiff"), (".png",)):
        files = [file for file in ordered if file.suffix.lower() in endings]
        if files:
            break
    else:
        raise refusal(path, "a folder without an image: no zarr store, and no TIFF or PNG in it")
    wavelengths = (
        None if count is not None else _wavelengths_of_names([file.stem for file in files])
    )
    place: CubeFields = {}
    sizes: list[tuple[tuple[int, ...], Any]] = []
    for file in files:
        with whole(file):
            if file.suffix.lower() == ".png":
                picture = Png(file)
            else:
                with tifffile.TiffFile(file) as tiff:
                    picture = tiff.series[0]
                    place = place or _place(tiff)
            size = (tuple(picture.shape), picture.dtype)
            sizes.append(size)
            if len(size[0]) != 2 or size != sizes[0]:
                first = " ".join(map(str, sizes[0]))
                raise refusal(file, f"{size[0]} {size[1]} where {files[0].name} has {first}")
    size, dtype = sizes[0]
    if wavelengths is not None:
        order = np.argsort(wavelengths, kind="stable")
        files = [files[i] for i in order]
        wavelengths = wavelengths[order]
    return RawCube(
        path=path,
        format="folder of pictures",
        dtype=_check_type(path, dtype),
        wavelengths=wavelengths,
        wavelength_unit="nm",
        **_layout_of_planes(size, [(file, None) for file in files]),
        **place,
    )


def _check_type(path: Path, dtype: Any) -> np.dtype[Any]:
    """The type of a file's numbers, if they can be readings."""
    if dtype is None or dtype.kind not in "fiu":
        raise refusal(path, f"numbers of type {dtype}, not readings")
    return dtype


def _array(path: Path, page: int | None) -> Any:
    """The first series (or one page) of a file: mapped into memory, or as tiles or strips that are
    read singly.
    """
    import tifffile

    if path.suffix.lower() == ".png":
        return Png(path)
    try:
        return tifffile.memmap(path, page=page, mode="r")
    except ValueError:
        import zarr

        # The store needs the file open, and nothing else closes it.
        file = tifffile.TiffFile(path)
        store = file.aszarr(key=page) if page is not None else file.aszarr(series=0, level=0)
        array = zarr.open(store, mode="r")
        weakref.finalize(array, file.close)
        return array


def _planes(*places: tuple[Path, int | None]) -> Planes:
    return Planes([_array(*place) for place in places])


def _wavelengths_of_metadata(file: Any) -> Stored | None:
    """Wavelengths that a file says itself: in tifffile's or ImageJ's metadata, or with
    each page.
    """
    for metadata in [*(file.shaped_metadata or ()), file.imagej_metadata or {}]:
        for title in ("wavelengths", "wavelength", "Wavelengths", "Wavelength"):
            value = metadata.get(title)
            if isinstance(value, list | tuple) and {*map(type, value)} <= {int, float}:
                return np.asarray(value, float)
    tags = [getattr(page, "tags", None) for page in file.pages]
    # Of a page its name and its description.
    texts = [f"{each.valueof(285)} {each.valueof(270)}" if each else "" for each in tags]
    matches = [{*_NM.findall(text)} for text in texts]
    if any(len(each) != 1 for each in matches):
        return None
    return np.array([float(each.pop()) for each in matches])


def _wavelengths_of_names(names: list[str]) -> Stored | None:
    """Wavelengths in the names of files: the number before ``nm``, else the last that can be one in
    all names.
    """
    matches = [_NM.findall(name) for name in names]
    if all(matches):
        return np.array([float(each[-1]) for each in matches])
    last = np.array([float([0, *_DIGITS.findall(name)][-1]) for name in names])
    # Wavelengths that a bare number in a file's name can be, nm.
    return last if last.min() >= 200.0 and last.max() <= 2600.0 else None


def _place(file: Any) -> CubeFields:
    """Coordinates of a GeoTIFF, and GDAL's mark of missing data."""
    page = file.pages[0]
    tags = page.tags
    placed: CubeFields = {}
    with contextlib.suppress(ValueError):
        placed["ignore"] = (float(str(tags.valueof(42113)).strip("\0 ")),)
    scale = tags.valueof(33550)
    tie = tags.valueof(33922)
    if scale is None or tie is None or len(tie) != 6:
        return placed
    point = int((file.geotiff_metadata or {}).get("GTRasterTypeGeoKey", 1)) == 2
    half = 0.0 if point else 0.5
    placed["x"] = tie[3] + (np.arange(page.imagewidth) + half - tie[0]) * scale[0]
    placed["y"] = tie[4] - (np.arange(page.imagelength) + half - tie[1]) * scale[1]
    placed["about_place"] = {
        "units": "as in the file",
        "pixel_size": (float(scale[1]), float(scale[0])),
    }
    return placed
