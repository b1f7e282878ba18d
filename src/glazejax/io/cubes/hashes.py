"""A quick hash of an image, and its time of change: enough to see that it is not the one that was
mapped, without reading all of it.
"""

import hashlib
import random
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from itertools import accumulate
from pathlib import Path

from ..files.sniff import header_beside
from ..source import explain_errors, open_source
from .opening import HEADS

_END = 1 << 20
# Blocks between the ends.
_BLOCK = 1 << 16
# Data up to this size are hashed whole, and so is each header or file of metadata.
_SMALL = 1 << 21


def quick_source_hash(path: str | Path) -> str:
    """SHA-256 of names and sizes, of headers and metadata, and of samples of the numbers: the first
    and last MiB, and a block of 64 KiB from each of 128 equal parts between them (of up to 2 MiB,
    all).

    The files of a folder count as one after another. A copy has the same hash wherever it lies.
    What changed between the samples is not noticed: see `time_of_change`.

    Raises:
        FileNotFoundError: no such file.
        OSError: the system cannot read it.
    """
    path = Path(path)
    digest = hashlib.sha256()
    with explain_errors(path):
        metadata, data = _parts(path)
        for file in [*metadata, *data]:
            name = f"{file.relative_to(path).as_posix()} " if path.is_dir() else ""
            digest.update(f"{name}{file.stat().st_size}\n".encode())
        for files in (*([file] for file in metadata), data):
            for piece in _samples(files):
                digest.update(piece)
    return digest.hexdigest()


def time_of_change(path: str | Path) -> int:
    """When an image was last written: the latest time of its files, ns since 1970.

    Raises:
        FileNotFoundError: no such file.
        OSError: the system cannot read it.
    """
    path = Path(path)
    with explain_errors(path):
        metadata, data = _parts(path)
        return max((file.stat().st_mtime_ns for file in [*metadata, *data]), default=0)


def _parts(path: Path) -> tuple[list[Path], list[Path]]:
    """Files of an image: headers and metadata, and its numbers."""
    if path.is_dir():
        files = sorted(file for file in path.rglob("*") if file.is_file())
        metadata = [file for file in files if file.suffix == ".json" or file.name.startswith(".z")]
        return metadata, [file for file in files if file not in set(metadata)]
    with open_source(path) as source:
        # A header next to an image of another kind belongs to other data.
        other = source.head.startswith(HEADS)
    if path.suffix.lower() == ".hdr" or (not other and header_beside(path) is not None):
        from ..files.read import envi_file

        envi = envi_file(path)
        return [envi.path], [envi.data]
    return [], [path]


def _samples(files: Sequence[Path]) -> Iterator[bytes]:
    """Pieces of files that count as one after another; always the same ones of the same sizes."""
    starts = [0, *accumulate(file.stat().st_size for file in files)]
    size = starts[-1]
    if size <= _SMALL:
        places = [(0, size)]
    else:
        # Places that repeat at one distance would meet the same lines in every band.
        chance = random.Random(size)
        count = 128
        stretch = (size - 2 * _END) / count
        between = [int(_END + (n + chance.random()) * stretch) for n in range(count)]
        places = [(0, _END), *((start, _BLOCK) for start in between), (size - _END, _END)]
    for start, length in places:
        end = min(start + length, size)
        while start < end:
            number = bisect_right(starts, start) - 1
            upto = min(end, starts[number + 1])
            with files[number].open("rb") as file:
                file.seek(start - starts[number])
                yield file.read(upto - start)
            start = upto
