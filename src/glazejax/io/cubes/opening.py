"""Which kind of image a path is, and the reader of that kind."""

from pathlib import Path

from ..source import opened, refusal
from .arrays import envi_cube, npy_cube
from .raw import RawCube


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
    with opened(path) as source:
        head = source.head
    if dataset is not None:
        raise refusal(path, f"has no datasets; leave out {dataset!r}")
    if head.startswith(b"\x93NUMPY"):
        return npy_cube(path, count)
    return envi_cube(path)
