"""Which kind of image a path is, and the reader of that kind."""

from pathlib import Path

from ..source import opened, refusal
from .arrays import envi_cube, npy_cube
from .raw import RawCube
from .stores import classic_cube, hdf5_cube, zarr_cube
from .tiffs import tiff_cube, tiff_folder


def raw_cube(path: Path, dataset: str | None = None, count: int | None = None) -> RawCube:
    """Open an image of any kind that is known, told by its content.

    Args:
        path: of the file or folder.
        dataset: of a file that holds several.
        count: wavelengths, if they are known; they tell which axis of an array is the wavelength.

    Raises:
        FileNotFoundError: no such file.
        OSError: the system cannot read it.
        ValueError: no image of spectra, or not a legal one.
    """
    if path.is_dir():
        if any((path / name).exists() for name in _ZARR):
            return zarr_cube(path, dataset, count)
        _no_dataset(path, dataset)
        return tiff_folder(path, count)
    with opened(path) as source:
        head = source.head
    if head.startswith(b"\x89HDF\r\n"):
        return hdf5_cube(path, dataset, count)
    if head.startswith((b"CDF\x01", b"CDF\x02")):
        return classic_cube(path, dataset, count)
    if head.startswith(b"PK") and path.suffix.lower() == ".zip":
        return zarr_cube(path, dataset, count)
    _no_dataset(path, dataset)
    if head.startswith(b"\x93NUMPY"):
        return npy_cube(path, count)
    if head.startswith((b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")):
        return tiff_cube(path, count)
    return envi_cube(path)


_ZARR = ("zarr.json", ".zgroup", ".zarray", ".zmetadata")


def _no_dataset(path: Path, dataset: str | None) -> None:
    """Refuse a dataset's name where files have none."""
    if dataset is not None:
        raise refusal(path, f"this kind of file has no datasets; leave {dataset!r} out")
