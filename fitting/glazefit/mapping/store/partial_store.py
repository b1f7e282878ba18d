"""A view of a map's store: without what a killed run left half-written, and with its checksums
looked at.
"""

from typing import TYPE_CHECKING, Any

from zarr.storage import LocalStore, WrapperStore

from .layout import BY_NAME
from .windows import Window

if TYPE_CHECKING:
    from .store import MapStore


class FinishedWindows(WrapperStore[LocalStore]):
    """The chunks of finished windows, each checked as it is read; zarr shows fill values elsewhere.

    Args:
        store: the map's files, for reading.
        map: whose they are.
    """

    def __init__(self, store: LocalStore, map: "MapStore"):
        super().__init__(store)
        self._map = map

    def _with_store(self, store: LocalStore) -> "FinishedWindows":
        return type(self)(store, self._map)

    async def get(self, key: str, prototype: Any, byte_range: Any = None) -> Any:
        """What is stored under a key; nothing of a window that is not finished.

        Raises:
            ValueError: a window that is damaged.
        """
        name, _, place = key.partition("/c/")
        if not place or name not in BY_NAME:
            return await super().get(key, prototype, byte_range)
        y, x = (int(at) * size for at, size in zip(place.split("/"), self._map.chunk, strict=False))
        window = Window.at(y, x, self._map.shape, self._map.chunk)
        # It is asked first: a window may be finished while it is read.
        if not self._map.complete and not self._map.is_done(window):
            return None
        content = await super().get(key, prototype, byte_range)
        self._map.check(window, key, None if content is None else content.to_bytes())
        return content
