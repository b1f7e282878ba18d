"""Work by keys, here or on a dask cluster: what is done is kept, so that an interrupted run goes
on.
"""

from collections.abc import Callable, Generator, Iterator, Sequence, Set
from contextlib import closing, contextmanager
from typing import TYPE_CHECKING, TypeVar

from glazejax.extras import require
from glazejax.progress import Progress, no_progress
from glazejax.radiative.common.threads import in_threads

from .process import one_thread_each

if TYPE_CHECKING:
    from distributed import Client

Key = TypeVar("Key")
Result = TypeVar("Result")

AT_ONCE = 2
"""Windows that are solved side by side in one process."""


def finish(
    keys: Sequence[Key],
    work: Callable[[Key], Result],
    done: Set[Key],
    put: Callable[[Key, Result], None],
    client: "Client | None" = None,
    progress: Progress = no_progress,
    stage: str = "",
    at_once: int = 1,
) -> None:
    """Do the work of every key that has no result yet, and keep each result as soon as it is there.

    Args:
        keys: different names of pieces of work.
        work: from a key to its result; with a client it can be pickled, and its results too.
        done: keys that have one.
        put: keeps a result, whole or not at all; called by this process alone.
        client: of a dask cluster, whose workers do the work; None does it here. A piece that fails
            is tried three times more, one whose worker dies goes to another.
        progress: called first, and each time a result is kept, with the number of all that are.
        stage: that it is called with.
        at_once: pieces that are worked on side by side in this process.

    Raises:
        RuntimeError: no worker of the cluster came, or several died over the same piece.
        ConnectionError: the cluster was lost.
        OSError: the disk is full.
    """
    todo = [key for key in keys if key not in done]
    finished = len(keys) - len(todo)
    progress(finished, len(keys), stage)
    if client is None:
        solved = _here(todo, work, at_once)
    else:
        from .cluster import on_cluster

        solved = on_cluster(todo, work, client)
    with closing(solved) as results:
        for number, (key, result) in enumerate(results, start=finished + 1):
            put(key, result)
            progress(number, len(keys), stage)


def client_in_scope() -> "Client | None":
    """The dask client that this program has made, if there is one."""
    import sys

    # Without the package loaded there is no client, and loading it takes a second.
    if "distributed" not in sys.modules:
        return None
    from distributed import default_client

    try:
        return default_client()
    except ValueError:
        return None


@contextmanager
def connect(address: str | None, seconds: float = 20.0) -> "Iterator[Client | None]":
    """A client of the dask scheduler at an address while it is needed; None without one.

    Raises:
        ValueError: no scheduler answers there.
    """
    if address is None:
        yield None
        return
    require("distributed")
    from distributed import Client

    try:
        client = Client(address, timeout=seconds, set_as_default=False)
    # The last two: TLS without certificates, and a server of another kind, which answers no sense.
    except (OSError, ValueError, TypeError, MemoryError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise ValueError(
            f"--scheduler {address}: no dask scheduler answers there ({reason}); start one with "
            "`dask scheduler`, and workers with `dask worker`"
        ) from None
    with client:
        yield client


def _here(
    todo: Sequence[Key], work: Callable[[Key], Result], at_once: int
) -> Generator[tuple[Key, Result], None, None]:
    """Results of keys, those of a few at a time as they finish."""
    results: dict[Key, Result] = {}

    def solve(key: Key) -> None:
        with one_thread_each():
            results[key] = work(key)

    # A result waits only for those of its batch: it takes memory until it is kept.
    for start in range(0, len(todo), at_once):
        try:
            in_threads(solve, todo[start : start + at_once])
        finally:
            # Finished results are kept, also if another piece of the batch fails.
            while results:
                yield results.popitem()
