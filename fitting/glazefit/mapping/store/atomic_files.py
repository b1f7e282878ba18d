"""Results by key, each in a file that is there whole or not at all: what lets a killed
run go on.
"""

import errno
import io
import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np

# What the system says when a disk, or a user's share of it, is full.
_FULL = (errno.ENOSPC, errno.EDQUOT)
_KEY = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,150}")
_PART = ".part"


@contextmanager
def explain_full_disk(path: Path, kept: Callable[[], str]) -> Iterator[None]:
    """Turn a full disk into one sentence that says what is kept."""
    try:
        yield
    except OSError as error:
        if error.errno not in _FULL:
            raise
        raise OSError(error.errno, f"the disk is full; {kept()}", str(path)) from error


def write_whole(path: Path, content: bytes) -> None:
    """Write a file so that, whatever happens meanwhile, it is there whole or not at all (or as it
    was before).
    """
    part = path.with_name(path.name + _PART)
    try:
        with part.open("wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        part.replace(path)
    except BaseException:
        part.unlink(missing_ok=True)
        raise
    sync(path.parent)


def sync(path: Path) -> None:
    """Have a file or folder on the disk itself, as far as the system can, so that a loss of power
    leaves it.
    """
    # Windows opens no folders, and some network drives refuse.
    with suppress(OSError):
        number = os.open(path, os.O_RDONLY)
        try:
            os.fsync(number)
        finally:
            os.close(number)


class KeyedResults:
    """A folder of results, dicts of arrays, one NPZ for each key.

    Args:
        folder: made with the first result; what a killed run left half-written does not count.
    """

    def __init__(self, folder: str | Path):
        self.folder: Path = Path(folder)

    def done(self) -> set[str]:
        """Keys of all results."""
        return {path.name.removesuffix(".npz") for path in self.folder.glob("*.npz")}

    def put(self, key: str, result: Mapping[str, np.ndarray]) -> None:
        """Keep a result.

        Raises:
            ValueError: a key that cannot name a file, or an array of Python objects.
            OSError: the disk is full; nothing is left of this result then.
        """
        if objects := [name for name, array in result.items() if np.asarray(array).dtype.hasobject]:
            raise ValueError(
                f"{objects[0]!r} of the result {key!r} is an array of Python objects; keep numbers"
            )
        file = io.BytesIO()
        named: dict[str, Any] = dict(result)
        np.savez(file, **named)
        path = self._path(key)
        with explain_full_disk(
            path, lambda: "make room, then run the same again: what is finished is kept"
        ):
            self.folder.mkdir(parents=True, exist_ok=True)
            write_whole(path, file.getvalue())

    def get(self, key: str, names: Sequence[str] | None = None) -> dict[str, np.ndarray]:
        """The result of a key, or some of its arrays.

        Raises:
            KeyError: there is none.
            ValueError: the file is damaged; without it the result is made anew.
        """
        path = self._path(key)
        try:
            # Of a file that it cannot read NumPy leaves its own open.
            with path.open("rb") as file, np.load(file, allow_pickle=False) as kept:
                return {name: kept[name] for name in (kept.files if names is None else names)}
        except FileNotFoundError:
            raise KeyError(key) from None
        except (BadZipFile, EOFError, OSError, ValueError) as error:
            raise ValueError(
                f"{path} cannot be read ({error}): remove it, and the same run makes it anew"
            ) from None

    def remove(self, key: str) -> None:
        """Take a result away."""
        self._path(key).unlink(missing_ok=True)

    def _path(self, key: str) -> Path:
        if not _KEY.fullmatch(key):
            raise ValueError(
                f"the key {key!r} cannot name a file; use letters, digits, '_', '.' and '-'"
            )
        return self.folder / f"{key}.npz"
