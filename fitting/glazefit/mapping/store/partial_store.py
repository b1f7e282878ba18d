"""A view of a map's store: without what a killed run left half-written, and with its checksums
looked at.
"""

from collections.abc import AsyncIterator
from typing import Any
from zlib import crc32

import numpy as np
from jaxtyping import Int
from zarr.storage import LocalStore, WrapperStore

from .identity import NO_FILE, WORK
from .layout import BY_NAME
from .marks import Marks
from .windows import Window


class FinishedWindows(WrapperStore[LocalStore]):
    """The chunks of finished windows, each checked as it is read; zarr shows fill values elsewhere.

    Args:
        store: the map's files, for reading.
        marks: of its windows; those count as finished that have one now.
    """

    def __init__(self, store: LocalStore, marks: Marks):
        super().__init__(store)
        self._marks = marks
        self._done = marks.done()
        self._checksums: dict[Window, Int[np.ndarray, "variables"]] = {}

    def _with_store(self, store: LocalStore) -> "FinishedWindows":
        return type(self)(store, self._marks)

    async def get(self, key: str, prototype: Any, byte_range: Any = None) -> Any:
        """What is stored under a key; nothing of a window that is not finished.

        Raises:
            ValueError: a window that is damaged.
        """
        name, _, place = key.partition("/c/")
        if not place or name not in BY_NAME:
            return await super().get(key, prototype, byte_range)
        row, column = place.split("/")[:2]
        window = self._marks.window(int(row), int(column))
        if window not in self._done:
            return None
        if window not in self._checksums:
            self._checksums[window] = self._marks.get(window)["checksums"]
        found = await super().get(key, prototype)
        checksum = NO_FILE if found is None else crc32(found.to_bytes())
        self._marks.check(window, name, checksum, self._checksums[window])
        return found if byte_range is None else await super().get(key, prototype, byte_range)

    async def list_dir(self, prefix: str) -> AsyncIterator[str]:
        """Names in a folder, without that of our own work, which is no array."""
        async for name in super().list_dir(prefix):
            if name != WORK:
                yield name
