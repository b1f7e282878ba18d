"""A view of a zarr store in which the chunks that are not wanted are not there."""

from collections.abc import Set
from typing import TYPE_CHECKING, Any

from zarr.storage import WrapperStore

from .layout import BY_NAME

if TYPE_CHECKING:
    from zarr.storage import LocalStore


def hide_unmarked(store: "LocalStore", done: Set[tuple[int, int]]) -> "WrapperStore[LocalStore]":
    """The store without the chunks of windows that are not finished; zarr shows fill values for
    them.

    Args:
        store: of a map, for reading.
        done: rows and columns, in chunks, of the windows that are finished.
    """
    view = _Finished(store)
    view.done = done
    return view


class _Finished(WrapperStore["LocalStore"]):
    done: Set[tuple[int, int]] = frozenset()

    def _with_store(self, store: Any) -> "_Finished":
        view = _Finished(store)
        view.done = self.done
        return view

    def _is_hidden(self, key: str) -> bool:
        name, _, place = key.partition("/c/")
        if not place or name not in BY_NAME:
            return False
        row, column = place.split("/")[:2]
        return (int(row), int(column)) not in self.done

    async def get(self, key: str, prototype: Any, byte_range: Any = None) -> Any:
        """What is stored under a key; nothing for a hidden one."""
        return None if self._is_hidden(key) else await super().get(key, prototype, byte_range)

    async def exists(self, key: str) -> bool:
        """Whether something is stored under a key and not hidden."""
        return not self._is_hidden(key) and await super().exists(key)
