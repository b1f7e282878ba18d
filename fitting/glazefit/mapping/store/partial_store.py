"""A view of a map's store: without what a killed run left half-written, and with its checksums
looked at.
"""

from typing import Any

from zarr.storage import LocalStore, WrapperStore

from .chunks import Chunks


class FinishedWindows(WrapperStore[LocalStore]):
    """The chunks of finished windows, each checked as it is read; zarr shows fill values elsewhere.

    Args:
        store: the map's files, for reading.
        chunks: where its windows lie among them.
    """

    def __init__(self, store: LocalStore, chunks: Chunks):
        super().__init__(store)
        self._chunks = chunks

    def _with_store(self, store: LocalStore) -> "FinishedWindows":
        return type(self)(store, self._chunks)

    async def get(self, key: str, prototype: Any, byte_range: Any = None) -> Any:
        """The bytes stored under a key; nothing of a window that is not finished.

        Raises:
            ValueError: a window that is damaged.
        """
        window = self._chunks.window(key)
        if window is None:
            return await super().get(key, prototype, byte_range)
        # It is asked first: a window may be finished while it is read.
        if not self._chunks.complete and not self._chunks.is_done(window):
            return None
        content = await super().get(key, prototype, byte_range)
        self._chunks.check(window, key, None if content is None else content.to_bytes())
        return content
