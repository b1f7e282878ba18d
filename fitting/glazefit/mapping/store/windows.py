"""Windows of an image: the pieces in which it is read, solved and stored."""

from collections.abc import Sequence
from math import ceil, prod
from typing import NamedTuple, Self

# What Python, JAX and its programs take before the first pixel is read.
BASE = 600 * 2**20


class Window(NamedTuple):
    """The pixels of rows y0 to y1 - 1 and columns x0 to x1 - 1."""

    y0: int
    y1: int
    x0: int
    x1: int

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.y1 - self.y0, self.x1 - self.x0

    @property
    def pixels(self) -> int:
        """Number of pixels."""
        return prod(self.shape)

    @property
    def slices(self) -> tuple[slice, slice]:
        """Of arrays that are (y, x, ...)."""
        return slice(self.y0, self.y1), slice(self.x0, self.x1)

    def __str__(self) -> str:
        """The window as a word that can name a file."""
        return f"y{self.y0}-{self.y1}_x{self.x0}-{self.x1}"

    @classmethod
    def at(cls, y: int, x: int, shape: Sequence[int], chunk: Sequence[int]) -> Self:
        """The window of an image's windows that begins at a pixel."""
        return cls(y, min(y + chunk[0], shape[0]), x, min(x + chunk[1], shape[1]))


def windows(shape: Sequence[int], chunk: Sequence[int]) -> list[Window]:
    """All windows of an image, row by row; those at the lower and right edge may be smaller.

    Args:
        shape: rows and columns of the image.
        chunk: rows and columns of a window.
    """
    return [
        Window.at(y, x, shape, chunk)
        for y in range(0, shape[0], chunk[0])
        for x in range(0, shape[1], chunk[1])
    ]


def chunk_shape(
    shape: Sequence[int], bands: int, bytes_per_value: float, memory: int, *, base: int = BASE
) -> tuple[int, int]:
    """Rows and columns of the windows that an image is worked through in, so that memory stays
    below a bound.

    Args:
        shape: rows and columns of the image.
        bands: readings of a pixel.
        bytes_per_value: what a reading takes while its window is solved, all copies and results
            counted.
        memory: bound of the whole process, bytes.
        base: what the process takes before the first window.

    Raises:
        ValueError: the image is empty, or the bound leaves no room for a window of 16 x 16 pixels.
    """
    if min(shape) < 1 or bands < 1:
        raise ValueError(
            f"an image of {shape[0]} x {shape[1]} pixels and {bands} bands has nothing to map"
        )
    pixel = bands * bytes_per_value
    # Smaller pieces are mostly overhead.
    needed = base + pixel * 16**2
    if memory < needed:
        raise ValueError(
            f"the memory bound is {_mebibytes(memory)}; with {bands} bands it must be at least "
            f"{_mebibytes(needed)}, such as 2GiB"
        )
    # Larger pieces lose more to an interrupt and are no faster; of a small image there are twenty.
    twentieth = int((prod(shape) / 20) ** 0.5)
    side = min(256, max(16, twentieth), int(((memory - base) / pixel) ** 0.5))
    # Windows of one size, as far as the image allows: no thin strip remains at its edges.
    rows, columns = (ceil(length / ceil(length / side)) for length in shape)
    return rows, columns


def _mebibytes(size: float) -> str:
    return f"{ceil(size / 2**20)} MiB"
