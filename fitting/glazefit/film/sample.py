"""Draws of a problem's posterior by chains of either sampler, in memory or in an HDF5 file, with
what a resumed chain goes on from, and how Ctrl-C stops one.
"""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from glazejax.extras import require

from .ensemble import Ensemble
from .hamiltonian import Hamiltonian
from .problem import Draws, FilmProblem
from .sampling import SAMPLERS, Sampling
from .solve import Laplace

_STATES = ("state", "other_state")


@dataclass(frozen=True)
class Chain:
    """Samples of a problem.

    Attributes:
        free: free unknowns, (steps, walkers, blocks, dims), of every `thin`-th step.
        log_probability: up to a constant, (steps, walkers, blocks).
        accepted: mean share of proposals accepted.
        thin: steps between two that are kept.
        interrupted: whether it was stopped before it was done.
        sampler: that made it, "emcee" or "hmc".
    """

    free: Float[np.ndarray, "steps walkers blocks dims"]
    log_probability: Float[np.ndarray, "steps walkers blocks"]
    accepted: float
    thin: int
    interrupted: bool = False
    sampler: str = "emcee"


def draw_chain(problem: FilmProblem, approximation: Laplace, options: Sampling) -> Chain:
    """Sample a problem.

    A sampler has a number of `walkers` that step together, a `piece` of steps between two looks at
    the keyboard and the file, `begin`, which gives the state of a new chain after its warm-up, and
    `steps`. Its random numbers follow from the seed and the number of the step, so that a chain
    that is resumed is the one that was never stopped.

    Args:
        problem: what is sampled.
        approximation: to it, from which chains begin.
        options: sampler, steps after the warm-up, how many chains, and the rest.

    Raises:
        ValueError: nothing was kept, or too few walkers.
        ValueError, FileExistsError, FileNotFoundError: see `DrawsFile`.
    """
    sampler: type[Hamiltonian | Ensemble] = Hamiltonian if options.sampler == "hmc" else Ensemble
    stepper = sampler(problem, approximation, options)
    shape = (stepper.walkers, len(problem.blocks), problem.dims)
    store = DrawsFile(problem.fingerprint, shape, options)
    with gentle_interrupt() as asked:
        state = store.state if store.steps else stepper.begin(asked)
        while store.steps < options.length and not asked.is_set():
            count = min(stepper.piece, options.length - store.steps)
            draws = stepper.steps(state, store.steps, count)
            state = draws.state
            store.add(draws)
            options.progress(store.steps, options.length, "sampling")
    return store.chain(interrupted=store.steps < options.length)


class DrawsFile:
    """Draws so far.

    Attributes:
        steps: drawn, kept or not.
        state: arrays that the next step goes on from, by name; empty before the first.
    """

    def __init__(self, fingerprint: str, shape: tuple[int, int, int], options: Sampling) -> None:
        """New, or found again.

        Args:
            fingerprint: of the problem.
            shape: walkers, blocks and unknowns.
            options: with the path and what to do with a file that is there.

        Raises:
            ValueError: a file whose chain is of another problem, sampler or settings, or that is
                none.
            FileExistsError: there is such a file, and neither `resume` nor `overwrite` was asked
                for.
            FileNotFoundError: `resume` was, and there is none.
        """
        self._path = None if options.path is None else Path(options.path)
        self._thin = options.every
        self._seed = options.seed
        self._group = options.sampler
        self._free: list[np.ndarray] = []
        self._height: list[np.ndarray] = []
        self._accepted = 0.0
        self.steps = 0
        self.state: dict[str, np.ndarray] = {}
        if self._path is not None:
            require("h5py")
            if options.resume:
                self._read(self._path, fingerprint, shape[0])
            else:
                self._begin(self._path, fingerprint, shape, options.overwrite)

    def _begin(
        self, path: Path, fingerprint: str, shape: tuple[int, int, int], overwrite: bool
    ) -> None:
        import h5py

        if path.exists() and not overwrite:
            raise FileExistsError(
                f"{path}: there is a chain already; resume it, choose another name, or ask to "
                "overwrite it"
            )
        path.parent.mkdir(parents=True, exist_ok=True)
        # An older file may still be open elsewhere.
        path.unlink(missing_ok=True)
        with h5py.File(path, "w") as file:
            group = file.create_group(self._group)
            group.attrs.update(
                {
                    "problem": fingerprint,
                    "thin": self._thin,
                    "seed": self._seed,
                    "steps": 0,
                    "accepted": 0.0,
                }
            )
            for name, step_shape in (("chain", shape), ("log_prob", shape[:2])):
                group.create_dataset(
                    name, (0, *step_shape), maxshape=(None, *step_shape), dtype="f8"
                )

    def _read(self, path: Path, fingerprint: str, walkers: int) -> None:
        import h5py

        if not path.is_file():
            raise FileNotFoundError(
                f"{path}: there is no chain to resume; leave out the request to resume, to start "
                "one"
            )
        if not h5py.is_hdf5(path):
            raise ValueError(f"{path}: this file holds no chain of {self._group}")
        with h5py.File(path, "r") as file:
            if self._group not in file:
                hints = [f'; resume it with the sampler "{s}"' for s in SAMPLERS if s in file]
                raise ValueError(
                    f"{path}: this file holds no chain of {self._group}{''.join(hints)}"
                )
            group: Any = file[self._group]
            if group.attrs["problem"] != fingerprint:
                raise ValueError(
                    f"{path}: the chain is of another problem (film, paints, noise or prior "
                    "differ); resume it with the settings that it was started with, or start "
                    "another chain elsewhere"
                )
            stored = group["chain"].shape[1], int(group.attrs["thin"])
            if stored != (walkers, self._thin):
                raise ValueError(
                    f"{path}: the chain has {stored[0]} walkers and keeps every {stored[1]}. step, "
                    f"not {walkers} and {self._thin}; ask for the same"
                )
            # Older files do not say.
            seed = int(group.attrs.get("seed", self._seed))
            if seed != self._seed:
                raise ValueError(
                    f"{path}: the chain was started with the seed {seed}, not {self._seed}; ask "
                    "for the same"
                )
            self.steps = int(group.attrs["steps"])
            self._accepted = float(group.attrs["accepted"])
            # Writing may have been cut after some rows, and before their steps were counted.
            kept = self.steps // self._thin
            self._free = [group["chain"][:kept]]
            self._height = [group["log_prob"][:kept]]
            if self.steps:
                stored_state = group[_state_name(group)]
                self.state = {name: array[()] for name, array in stored_state.items()}

    def add(self, draws: Draws) -> None:
        """Keep some steps."""
        count = len(draws.free)
        kept = self.steps // self._thin
        chosen = np.arange(self.steps + 1, self.steps + count + 1) % self._thin == 0
        self._free.append(np.asarray(draws.free)[chosen])
        self._height.append(np.asarray(draws.height)[chosen])
        self._accepted += float(draws.accepted)
        self.steps += count
        self.state = {name: np.asarray(array) for name, array in draws.state.items()}
        if self._path is None:
            return
        import h5py

        with h5py.File(self._path, "a") as file:
            group: Any = file[self._group]
            for name, new in (("chain", self._free[-1]), ("log_prob", self._height[-1])):
                group[name].resize(kept + len(new), axis=0)
                group[name][kept:] = new
            # The state before stays until the new steps are counted, which comes last: a chain
            # that is cut in between goes on from there.
            spare = group.require_group(_STATES[1 - _STATES.index(_state_name(group))])
            for name, array in self.state.items():
                dataset = spare.require_dataset(name, array.shape, array.dtype)
                dataset[...] = array
            spare.attrs["steps"] = self.steps
            group.attrs["accepted"] = self._accepted
            group.attrs["steps"] = self.steps

    def chain(self, *, interrupted: bool) -> Chain:
        """Steps kept.

        Raises:
            ValueError: nothing is.
        """
        if not sum(map(len, self._free)):
            raise ValueError(
                "the chain was stopped before its first step was kept; there is nothing to report"
            )
        return Chain(
            free=np.concatenate(self._free),
            log_probability=np.concatenate(self._height),
            accepted=self._accepted / self.steps,
            thin=self._thin,
            interrupted=interrupted,
            sampler=self._group,
        )


def _state_name(group: Any) -> str:
    """Name of the state after the steps counted; the first where none says, as in older files."""
    steps = group.attrs["steps"]
    after = (name for name in _STATES if name in group and group[name].attrs.get("steps") == steps)
    return next(after, _STATES[0])


@contextmanager
def gentle_interrupt() -> Iterator[threading.Event]:
    """Ctrl-C sets the event, so that a step is never cut in two; a second one stops at once."""
    asked = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield asked
        return
    before = signal.getsignal(signal.SIGINT)

    def note(number: int, frame: Any) -> None:
        if asked.is_set() and callable(before):
            before(number, frame)
        asked.set()

    signal.signal(signal.SIGINT, note)
    try:
        yield asked
    finally:
        signal.signal(signal.SIGINT, before)
