"""A view of a map's store: without what a killed run left half-written, and with its checksums
looked at.
"""

from typing import TYPE_CHECKING, Any

from zarr.storage import LocalStore, WrapperStore

if TYPE_CHECKING:
    from .store import MapStore


class FinishedWindows(WrapperStore[LocalStore]):
    """The chunks of finished windows, each checked as it is read; zarr shows fill values elsewhere.

    Args:
        store: the map's files, for reading.
        of_map: which of its windows are finished, and what they should hold.
    """

    def __init__(self, store: LocalStore, of_map: "MapStore"):
        super().__init__(store)
        self._map = of_map

    def _with_store(self, store: LocalStore) -> "FinishedWindows":
        return type(self)(store, self._map)

    async def get(self, key: str, prototype: Any, byte_range: Any = None) -> Any:
        """The bytes stored under a key; nothing of a window that is not finished.

        Raises:
            ValueError: a window that is damaged.
        """
        window = self._map.window_of(key)
        if window is None:
            return await super().get(key, prototype, byte_range)
        # It is asked first: a window may be finished while it is read.
        if not self._map.is_written(window):
            return None
        content = await super().get(key, prototype, byte_range)
        self._map.check(window, key, None if content is None else content.to_bytes())
        return content
