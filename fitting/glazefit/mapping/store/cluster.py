"""Work by keys on a dask cluster. Imports `distributed`, and is imported by functions that have a
client.
"""

from collections.abc import Callable, Generator, Sequence
from typing import Any, TypeVar
from uuid import uuid4

import cloudpickle
import jax
from distributed import (
    CancelledError,
    Client,
    KilledWorker,
    Worker,
    WorkerPlugin,
    as_completed,
    get_worker,
)

from .process import one_thread_each

Key = TypeVar("Key")
Result = TypeVar("Result")

_PATIENCE = 60


class _Tool(WorkerPlugin):
    """The work itself, once on every worker, those that join later included, so that tasks carry a
    key alone.

    As a future that tasks depend on it would draw all tasks to the worker that has it, and be lost
    with that worker.
    """

    def __init__(self, name: str, work: Callable[[Any], Any]):
        self.name = name
        # In a packet of its own: JAX's arrays lose half of their digits where they arrive before
        # its precision is set.
        self.packed = cloudpickle.dumps(work)
        self.precision = bool(jax.config.jax_enable_x64)  # pyright: ignore[reportAttributeAccessIssue]

    def setup(self, worker: Worker) -> None:
        """Have JAX compute in the precision of the process that asks, then unpack the work."""
        jax.config.update("jax_enable_x64", self.precision)
        self.work: Callable[[Any], Any] = cloudpickle.loads(self.packed)


def _do(name: str, key: Any) -> Any:
    """One piece, on a worker."""
    tool = get_worker().plugins[name]
    assert isinstance(tool, _Tool)
    with one_thread_each():
        return tool.work(key)


def on_cluster(
    todo: Sequence[Key], work: Callable[[Key], Result], client: Client
) -> Generator[tuple[Key, Result], None, None]:
    """Results of keys from the workers of a cluster, as they come; few are asked for at a time.

    Args:
        todo: different keys.
        work: from a key to its result; both can be pickled.
        client: of the cluster.

    Raises:
        RuntimeError: no worker came, they lack a package, or several died over the same piece.
        ConnectionError: the cluster was lost.
    """
    if not todo:
        return
    address = client.scheduler_info()["address"]
    try:
        client.wait_for_workers(1, timeout=_PATIENCE)
    except TimeoutError:
        raise RuntimeError(
            f"the dask cluster at {address} has no workers; start some with `dask worker {address}`"
        ) from None
    name = f"glazejax-{uuid4().hex[:12]}"
    try:
        client.register_plugin(_Tool(name, work), name=name)
    except ModuleNotFoundError as error:
        raise RuntimeError(
            f"the workers of the dask cluster at {address} lack a package ({error}); install "
            "glazejax there as it is here"
        ) from None
    flying = as_completed(loop=client.loop)
    names = {}
    waiting = iter(todo)

    def fill() -> None:
        workers: Any = client.nthreads()
        # A worker computes one piece while the next waits for it; more would only fill memories.
        room = 2 * max(len(workers), 1) - len(names)
        # The count comes first: `zip` would take one key more than it gives.
        for _, key in zip(range(room), waiting, strict=False):
            future = client.submit(_do, name, key, key=f"{name}-{key}", retries=3, pure=False)
            names[future] = key
            flying.add(future)

    try:
        fill()
        for future in flying:
            key = names[future]
            try:
                result = future.result()
            except KilledWorker:
                raise RuntimeError(
                    f"the dask workers that took on {key} died one after another: have they enough "
                    "memory? What is finished is kept, and the same run goes on"
                ) from None
            except CancelledError:
                raise _lost_error() from None
            del names[future]
            future.release()
            yield key, result
            del result
            try:
                fill()
            except (OSError, RuntimeError):
                if client.status == "running":
                    raise
                raise _lost_error() from None
    finally:
        if client.status == "running":
            client.cancel([*names])
            client.unregister_worker_plugin(name)


def _lost_error() -> ConnectionError:
    return ConnectionError(
        "the dask cluster was lost or restarted; what is finished is kept, and the same run goes on"
    )
