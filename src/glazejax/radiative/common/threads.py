"""A few threads for work that is done in XLA and in BLAS, which leave Python's lock alone."""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

import jax

Item = TypeVar("Item")
Answer = TypeVar("Answer")


def cores() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def in_threads(work: Callable[[Item], Answer], items: Sequence[Item]) -> list[Answer]:
    """Answers in order, worked out side by side, in the precision and on the device of the caller.

    An exception ends what has not begun, and is raised here.
    """
    count = min(len(items), cores())
    if count < 2:
        return [work(item) for item in items]
    double = bool(jax.config.jax_enable_x64)  # pyright: ignore[reportAttributeAccessIssue]
    device = jax.config.jax_default_device  # pyright: ignore[reportAttributeAccessIssue]

    def there(item: Item) -> Answer:
        # The caller's may be set for its thread alone.
        with jax.enable_x64(double), jax.default_device(device):
            return work(item)

    threads = ThreadPoolExecutor(count)
    try:
        return list(threads.map(there, items))
    finally:
        threads.shutdown(cancel_futures=True)
