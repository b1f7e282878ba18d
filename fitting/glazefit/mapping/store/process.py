"""Settings of the process: the same numbers whatever the number of cores, and memory given back."""

import ctypes
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from glazejax.extras import require

# Parameter of glibc's mallopt, from malloc.h.
_ARENA_MAX = -8


@contextmanager
def one_thread_each() -> Iterator[None]:
    """Matrix products by one thread each while a piece of work is done, alone or next to others
    (`in_threads`); then memory is given back.

    A BLAS that shares a product among threads rounds it in other places; where two representatives
    are as near, or two sets as probable, a pixel's answer would hang on the number of threads.
    """
    require("threadpoolctl")
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1, "blas"):
        yield
    give_back()


def give_back() -> None:
    """Let the C library return what is free to the system, where it is glibc.

    Each thread that starts takes a heap of its own, and what is freed there stays: a long run of
    short threads would grow by a gigabyte that nothing uses.
    """
    _call_glibc("malloc_trim", 0)


def few_arenas() -> None:
    """Let all threads of this process share two heaps; heard only before the first thread has
    begun.
    """
    _call_glibc("mallopt", _ARENA_MAX, 2)


def _call_glibc(function: str, *numbers: int) -> None:
    if sys.platform == "linux":
        with suppress(OSError, AttributeError):
            getattr(ctypes.CDLL("libc.so.6"), function)(*numbers)
