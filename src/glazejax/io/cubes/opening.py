"""The kind of image that a path is, and the reader of that kind."""

from itertools import chain
from pathlib import Path

from ..files.sniff import identify
from ..raw_cube import RawCube, whole
from ..source import open_source, refusal
from .arrays import envi_cube, npy_cube
from .stores import classic_cube, hdf5_cube, matlab_cube, zarr_cube
from .tiffs import TIFF, picture_folder, tiff_cube


def raw_cube(path: Path, dataset: str | None = None, count: int | None = None) -> RawCube:
    """Open an image of any known kind, recognised by its content.

    Args:
        path: of the file or folder.
        dataset: of a file that holds several.
        count: wavelengths, if they are known; they show which axis of an array is the wavelength.

    Raises:
        FileNotFoundError: no such file.
        OSError: the system cannot read it.
        ValueError: no image of spectra, or not a legal one.
    """
    stored = path.is_dir() and any((path / name).exists() for name in _ZARR)
    head = b""
    recognised = True
    if not path.is_dir():
        with open_source(path) as source:
            head = source.head
            recognised = head.startswith(HEADS) or identify(source) in ("envi header", "envi data")
    with whole(path):
        if stored or (head.startswith(_ZIP) and path.suffix.lower() == ".zip"):
            return zarr_cube(path, dataset, count)
        for heads, reader in _STORES.items():
            if head.startswith(heads):
                return reader(path, dataset, count)
        if dataset is not None:
            raise refusal(path, f"this kind of file has no datasets; leave {dataset!r} out")
        if path.is_dir():
            return picture_folder(path, count)
        if head.startswith(TIFF):
            return tiff_cube(path, count)
    if head.startswith(_NPY):
        return npy_cube(path, count)
    if not recognised:
        raise refusal(
            path,
            "not an image of spectra that is known: ENVI, zarr, NetCDF, HDF5, MATLAB, TIFF, .npy",
        )
    return envi_cube(path, count)


# What files of named arrays begin with.
_STORES = {
    (b"MATLAB 5",): matlab_cube,
    (b"\x89HDF\r\n", b"MATLAB 7"): hdf5_cube,
    (b"CDF\x01", b"CDF\x02"): classic_cube,
}
_NPY = b"\x93NUMPY"
_ZIP = b"PK\x03\x04"
HEADS: tuple[bytes, ...] = (*chain(*_STORES), _NPY, _ZIP, *TIFF)
"""What images of known kinds begin with, whatever files lie next to them."""
# Files that a store of zarr has.
_ZARR = ("zarr.json", ".zgroup", ".zarray", ".zmetadata")
