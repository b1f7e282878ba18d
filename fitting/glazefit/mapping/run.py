"""Work by keys, here or on a dask cluster: what is done is kept, so that an interrupted run goes
on.
"""

from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, TypeVar

from glazejax.extras import require

from .chunk import ChunkMaps
from .windows import Window

if TYPE_CHECKING:
    from distributed import Client

    from .store import MapStore

Result = TypeVar("Result")
_Kept = TypeVar("_Kept", contravariant=True)


class Results(Protocol[_Kept]):
    """Where results go: `KeyedResults`, or the windows of a map."""

    def done(self) -> set[str]:
        """Keys of what is there."""
        ...

    def put(self, key: str, result: _Kept) -> None:
        """Keep a result, whole or not at all."""
        ...


class Solver(Protocol):
    """What maps a window; it can be pickled, and what it finds depends on the window alone."""

    def solve(self, window: Window) -> ChunkMaps:
        """Maps of a window."""
        ...


def finish(
    keys: Sequence[str],
    work: Callable[[str], Result],
    into: Results[Result],
    client: "Client | None" = None,
    told: Callable[[str, Result], None] | None = None,
) -> None:
    """Do the work of every key that has no result yet, and keep each result as soon as it is there.

    Args:
        keys: different names of pieces of work.
        work: from a key to its result; with a client it can be pickled, and its results too.
        into: where results are kept, by this process alone.
        client: of a dask cluster, whose workers do the work; None does it here. A piece that fails
            is tried three times more, one whose worker dies goes to another.
        told: called with each new key and its result, once it is kept.

    Raises:
        RuntimeError: no worker of the cluster came, or several died over the same piece.
        ConnectionError: the cluster was lost.
        OSError: the disk is full.
    """
    done = into.done()
    todo = [key for key in keys if key not in done]
    if client is None:
        found = _here(todo, work)
    else:
        from .cluster import on_cluster

        found = on_cluster(todo, work, client)
    with closing(found) as results:
        for key, result in results:
            into.put(key, result)
            if told is not None:
                told(key, result)


def run_chunks(
    store: "MapStore",
    solver: Solver,
    client: "Client | None" = None,
    told: Callable[[Window, ChunkMaps], None] | None = None,
) -> None:
    """Solve every window of a map that is not finished yet; see `finish`."""
    with store.writing():
        finish(
            [window.key for window in store.windows()],
            _SolveKey(solver),
            _Windows(store),
            client,
            None if told is None else lambda key, maps: told(Window.from_key(key), maps),
        )


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
    except (OSError, ValueError) as error:
        words = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise ValueError(
            f"--scheduler {address}: no dask scheduler answers there ({words}); start one with "
            "`dask scheduler`, and workers with `dask worker`"
        ) from None
    with client:
        yield client


@dataclass(frozen=True)
class _SolveKey:
    solver: Solver

    def __call__(self, key: str) -> ChunkMaps:
        return self.solver.solve(Window.from_key(key))


@dataclass(frozen=True)
class _Windows:
    """A map as a place for results."""

    store: "MapStore"

    def done(self) -> set[str]:
        return {window.key for window in self.store.done()}

    def put(self, key: str, result: ChunkMaps) -> None:
        self.store.put(Window.from_key(key), result)


def _here(
    todo: Iterable[str], work: Callable[[str], Result]
) -> Generator[tuple[str, Result], None, None]:
    """Results of keys, one after another."""
    for key in todo:
        yield key, work(key)
