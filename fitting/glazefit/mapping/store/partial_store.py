"""A view of a map's store without what a killed run left half-written."""

from collections.abc import Set
from typing import TYPE_CHECKING, Any

from zarr.storage import WrapperStore

from .layout import BY_NAME

if TYPE_CHECKING:
    from zarr.storage import LocalStore


def hide_unfinished(store: "LocalStore", done: Set[tuple[int, int]]) -> "WrapperStore[LocalStore]":
    """The store without the chunks of windows that are not finished; zarr shows fill values there.

    Args:
        store: of a map, for reading.
        done: rows and columns, in chunks, of the windows that are finished.
    """

    class Finished(WrapperStore["LocalStore"]):
        async def get(self, key: str, prototype: Any, byte_range: Any = None) -> Any:
            """What is stored under a key; nothing of a window that is not finished."""
            name, _, place = key.partition("/c/")
            if place and name in BY_NAME:
                row, column = place.split("/")[:2]
                if (int(row), int(column)) not in done:
                    return None
            return await super().get(key, prototype, byte_range)

    return Finished(store)
