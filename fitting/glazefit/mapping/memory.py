"""Memory that was freed and not given back."""

import ctypes
import functools
import sys
from collections.abc import Callable
from contextlib import suppress

# Parameter of glibc's mallopt, from malloc.h.
_ARENA_MAX = -8


def give_back() -> None:
    """Let the C library return what is free to the system, where it is glibc.

    Each thread that starts takes a heap of its own, and what is freed there stays: a long run of
    short threads would grow by a gigabyte that nothing uses.
    """
    trim = _trim()
    if trim is not None:
        trim(0)


@functools.cache
def _trim() -> Callable[[int], int] | None:
    if sys.platform != "linux":
        return None
    try:
        return ctypes.CDLL("libc.so.6").malloc_trim
    except (OSError, AttributeError):
        return None


def few_arenas() -> None:
    """Let all threads of this process share two heaps; heard only before the first thread has
    begun.
    """
    if sys.platform == "linux":
        with suppress(OSError, AttributeError):
            ctypes.CDLL("libc.so.6").mallopt(_ARENA_MAX, 2)
