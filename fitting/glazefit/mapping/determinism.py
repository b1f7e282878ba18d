"""The same numbers wherever a map is made."""

from collections.abc import Iterator
from contextlib import contextmanager

from glazejax.extras import require


@contextmanager
def one_thread_each() -> Iterator[None]:
    """Matrix products by one thread each, as in a dask worker, while side by side by several
    (`in_threads`).

    A BLAS that shares a product among threads rounds it in other places; where two representatives
    are as near, or two sets as probable, a pixel's answer would hang on the number of threads.
    """
    require("threadpoolctl")
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1, "blas"):
        yield
