"""A view of a map's store: without what a killed run left half-written, and with its checksums
looked at.
"""

from collections.abc import Callable
from typing import Any

from zarr.storage import LocalStore, WrapperStore


class FinishedWindows(WrapperStore[LocalStore]):
    """The chunks of finished windows, each checked as it is read; zarr shows fill values elsewhere.

    Args:
        store: the map's files, for reading.
        lacks: whether a key is that of a chunk whose window is not finished.
        check: refuses what is stored under a key if it is damaged.
    """

    def __init__(
        self,
        store: LocalStore,
        lacks: Callable[[str], bool],
        check: Callable[[str, bytes | None], None],
    ):
        super().__init__(store)
        self._lacks = lacks
        self._check = check

    def _with_store(self, store: LocalStore) -> "FinishedWindows":
        return type(self)(store, self._lacks, self._check)

    async def get(self, key: str, prototype: Any, byte_range: Any = None) -> Any:
        """The bytes stored under a key; nothing of a window that is not finished.

        Raises:
            ValueError: a window that is damaged.
        """
        # It is asked first: a window may be finished while it is read.
        if self._lacks(key):
            return None
        content = await super().get(key, prototype, byte_range)
        self._check(key, None if content is None else content.to_bytes())
        return content
