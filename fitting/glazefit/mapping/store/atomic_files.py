"""Results by key, each in a file that is there whole or not at all: what lets a killed
run go on.
"""

import errno
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np

from glazejax.whole_file import whole_file

# What the system says when a disk, or a user's share of it, is full.
_FULL = (errno.ENOSPC, errno.EDQUOT)


@contextmanager
def explain_full_disk(path: Path, consequence: Callable[[], str]) -> Iterator[None]:
    """Turn a full disk into one sentence that says what is kept."""
    try:
        yield
    except OSError as error:
        if error.errno not in _FULL:
            raise
        raise OSError(error.errno, f"the disk is full; {consequence()}", str(path)) from error


class KeyedResults:
    """A folder of results, dicts of arrays, one NPZ for each key.

    Args:
        folder: made with the first result; what a killed run left half-written does not count.
    """

    def __init__(self, folder: Path):
        self.folder = folder

    def done(self) -> set[str]:
        """Keys of all results."""
        return {path.stem for path in self.folder.glob("*.npz")}

    def put(self, key: str, result: Mapping[str, np.ndarray]) -> None:
        """Keep a result.

        Raises:
            OSError: the disk is full; nothing is left of this result then.
        """
        path = self.folder / f"{key}.npz"
        named: dict[str, Any] = dict(result)
        with explain_full_disk(
            path, lambda: "make room, then run the same again: what is finished is kept"
        ):
            self.folder.mkdir(parents=True, exist_ok=True)
            with whole_file(path) as partial, partial.open("wb") as file:
                np.savez(file, **named)

    def get(self, key: str, names: Sequence[str] | None = None) -> dict[str, np.ndarray]:
        """The result of a key, or some of its arrays.

        Raises:
            KeyError: there is none.
            ValueError: the file is damaged; without it the result is made again.
        """
        path = self.folder / f"{key}.npz"
        try:
            # Of a file that it cannot read NumPy leaves its own open.
            with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
                return {name: archive[name] for name in (archive.files if names is None else names)}
        except FileNotFoundError:
            raise KeyError(key) from None
        except (BadZipFile, EOFError, OSError, ValueError) as error:
            raise ValueError(
                f"{path} cannot be read ({error}): remove it, and the same run makes it again"
            ) from None
