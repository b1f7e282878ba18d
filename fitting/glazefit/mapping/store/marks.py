"""Marks of finished windows: written last, they hold a checksum of each file of a window, and sums
over its sets.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from jaxtyping import Int

from .atomic_files import KeyedResults
from .identity import NO_FILE, WORK, Identity, file_checksum
from .layout import BY_NAME, VARIABLES, Variable
from .windows import Window, windows

_FIX = "; run the same `glazejax map` again, which maps it anew"


class Marks:
    """The marks of a map's windows.

    Args:
        path: folder of the map.
        identity: of the map; a window that another run wrote is damaged.
    """

    def __init__(self, path: Path, identity: Identity):
        self._path = path
        self._identity = identity
        self._kept = KeyedResults(path / WORK / "marks")

    def done(self) -> set[Window]:
        """The windows that have a mark."""
        marked = self._kept.done()
        every = windows(self._identity.shape, self._identity.chunk)
        return {window for window in every if str(window) in marked}

    def put(self, window: Window, sums: Mapping[str, np.ndarray]) -> None:
        """Mark a window whose files are written.

        Args:
            window: one of the map.
            sums: over its sets, see `chunk.pack`.

        Raises:
            OSError: the disk is full.
        """
        found = [file_checksum(self.file(variable, window)) for variable in VARIABLES]
        own = {"run": np.array(self._identity.run), "checksums": np.array(found, np.int64)}
        self._kept.put(str(window), {**sums, **own})

    def get(self, window: Window) -> dict[str, np.ndarray]:
        """The mark of a finished window: its sums, and ``checksums`` of its files in the order of
        `layout.VARIABLES`, `NO_FILE` where an array is all fill, of which zarr writes none.

        Raises:
            ValueError: it is damaged, or another map's.
        """
        try:
            mark = self._kept.get(str(window))
            run = mark["run"].item()
        except (KeyError, ValueError):
            raise self._damage(window, "its mark cannot be read") from None
        if run != self._identity.run:
            raise self._damage(window, "another run wrote it")
        return mark

    def check(
        self, window: Window, name: str, found: int, checksums: Int[np.ndarray, "variables"]
    ) -> None:
        """Compare a file of a finished window with its checksum.

        Args:
            window: whose file it is.
            name: of the array.
            found: checksum of the file as it is.
            checksums: of the window.

        Raises:
            ValueError: they differ.
        """
        variable = BY_NAME[name]
        if found != checksums[VARIABLES.index(variable)]:
            file = self.file(variable, window).relative_to(self._path).as_posix()
            state = "missing" if found == NO_FILE else "not as it was written"
            raise self._damage(window, f"{file} is {state}")

    def remove_damaged(self) -> list[str]:
        """Take away the marks of windows that are damaged; in words, which these were."""
        found = []
        for window in sorted(self.done()):
            try:
                checksums = self.get(window)["checksums"]
                for variable in VARIABLES:
                    checksum = file_checksum(self.file(variable, window))
                    self.check(window, variable.name, checksum, checksums)
            except ValueError as damage:
                found.append(f"{str(damage).rpartition(_FIX)[0]}, and is mapped anew")
                self._kept.remove(str(window))
        return found

    def file(self, variable: Variable, window: Window) -> Path:
        """File of an array's window; there is none where the array is all fill."""
        row = window.y0 // self._identity.chunk[0]
        column = window.x0 // self._identity.chunk[1]
        further = ["0"] * len(variable.further)
        return self._path.joinpath(variable.name, "c", str(row), str(column), *further)

    def window(self, row: int, column: int) -> Window:
        """The window of a row and a column, counted in windows."""
        shape = self._identity.shape
        chunk = self._identity.chunk
        return Window.at(row * chunk[0], column * chunk[1], shape, chunk)

    def _damage(self, window: Window, words: str) -> ValueError:
        return ValueError(f"window {window} of {self._path} is damaged ({words}){_FIX}")
