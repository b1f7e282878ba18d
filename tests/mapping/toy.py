"""A solver that maps nothing real: numbers that depend on the window alone, to compare runs bit for
bit.
"""

import errno
import math
import os
import subprocess
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from glazefit.mapping.map_cube import solve_windows
from glazefit.mapping.store.chunk import ChunkMaps, SetSum
from glazefit.mapping.store.layout import PLACES, VARIABLES, Status
from glazefit.mapping.store.process import one_thread_each
from glazefit.mapping.store.store import MapStore
from glazefit.mapping.store.windows import Window
from glazejax.progress import no_progress

from ..fresh import PATHS

SHAPE, CHUNK, PAINTS, BANDS = (38, 50), (16, 20), ("ZincWhite", "Eosin", "Umber"), 7
WINDOWS = 9
"""Of the map, three by three, the last ones smaller: each is some twenty files."""


def empty_arrays(shape: tuple[int, int], paints: int) -> dict[str, np.ndarray]:
    """Arrays of a map or a window, all fill."""
    sizes = {"paint": paints, "place": PLACES, "rgb": 3}
    return {
        variable.name: np.full(
            (*shape, *(sizes[dim] for dim in variable.further)), variable.fill, variable.dtype
        )
        for variable in VARIABLES
    }


@dataclass(frozen=True)
class Toy:
    """Random maps by window, after some seconds."""

    seconds: float = 0.0

    def solve(self, window: Window) -> ChunkMaps:
        time.sleep(self.seconds)
        random = np.random.default_rng(list(window))
        arrays = empty_arrays(window.shape, len(PAINTS))
        for values in arrays.values():
            whole = values.dtype.kind != "f"
            values[:] = (
                random.integers(0, 3, values.shape) if whole else random.random(values.shape)
            )
        arrays["status"][:] = Status.MAPPED
        # Some windows are all fill in an array, of which zarr then writes no file.
        if window.x0 == 0:
            del arrays["misfit"]
        tallies = {"mapped": float(window.pixels), "third": random.random()}
        sets = {
            members: SetSum(
                int(random.integers(1, 9)),
                random.random(BANDS),
                random.random(BANDS),
                random.random(BANDS),
                random.random(),
                2,
            )
            for members in [(), (0,), (0, 2), (1, 2, 3)][: int(random.integers(0, 5))]
        }
        return ChunkMaps(arrays, tallies, sets)


@dataclass(frozen=True)
class Counted(Toy):
    """Keeps what it was asked for, and is interrupted after so many windows."""

    most: float = math.inf
    asked: list[Window] = field(default_factory=list)

    def solve(self, window: Window) -> ChunkMaps:
        if len(self.asked) == self.most:
            raise KeyboardInterrupt
        self.asked.append(window)
        return super().solve(window)


def store_at(path: str | Path, **changes) -> MapStore:
    """A map of the usual size, but for these arguments."""
    usual: dict[str, Any] = {
        "shape": SHAPE,
        "chunk": CHUNK,
        "paints": PAINTS,
        "options": {"noise": 0.003, "layers": 1},
    }
    return MapStore.create(path, **(usual | changes))


def run_chunks(store: MapStore, solver, client=None, progress=no_progress) -> None:
    """All windows that are not there yet, as `map_cube` has them made and kept."""
    with store.writing(), one_thread_each():
        solve_windows(store, solver.solve, client, progress)


class Said(list[tuple[int, int | None, str]]):
    """What a progress is told."""

    def __call__(self, *step: Any) -> None:
        self.append(step)


def local_cluster(workers: int = 1, *, processes: bool = False) -> Any:
    """A dask cluster of this machine, one thread a worker."""
    from distributed import LocalCluster

    return LocalCluster(
        n_workers=workers,
        processes=processes,
        threads_per_worker=1,
        dashboard_address=None,  # type: ignore[arg-type]
        silence_logs=60,
    )


def full(*_, **__):
    """What a full disk says to any call."""
    raise OSError(errno.ENOSPC, "No space left on device")


def start_run(path: Path, seconds: float) -> subprocess.Popen:
    """A run in a process of its own, once its map is there."""
    run = subprocess.Popen(
        [sys.executable, "-m", "tests.mapping.toy", str(path), str(seconds)],
        env={**os.environ, "PYTHONPATH": PATHS},
        stdout=subprocess.PIPE,
    )
    assert run.stdout is not None
    assert run.stdout.readline() == b"begun\n"
    return run


if __name__ == "__main__":
    store = store_at(sys.argv[1])
    print("begun", flush=True)
    run_chunks(store, Toy(float(sys.argv[2])))
