"""Draws of `glazefit.posterior.hamiltonian`, in memory or in an HDF5 file, with what a resumed
chain goes on from.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from glazejax.extras import require

from .chain import GROUP as EMCEE
from .chain import MARK, Chain, begin_file, check_resumed, check_same_problem, refuse_settings
from .sampling import Sampling

GROUP = "hmc"


class DrawsFile:
    """What was drawn so far.

    Attributes:
        steps: drawn, kept or not.
        state: arrays that the next step goes on from, by name; empty before the first.
    """

    def __init__(self, path: Path | None, thin: int) -> None:
        self._path = path
        self._thin = thin
        self._free: list[np.ndarray] = []
        self._height: list[np.ndarray] = []
        self._accepted = 0.0
        self.steps = 0
        self.state: dict[str, np.ndarray] = {}

    @classmethod
    def open(cls, fingerprint: str, shape: tuple[int, int, int], options: Sampling) -> "DrawsFile":
        """New, or found again.

        Args:
            fingerprint: of the problem.
            shape: chains, blocks and unknowns.
            options: with the path and what to do with a file that is there.

        Raises:
            ValueError: a file whose chain is of another problem or other settings, or that is none.
            FileExistsError, FileNotFoundError: see `glazefit.posterior.chain.run_chain`.
        """
        path = None if options.path is None else Path(options.path)
        kept = cls(path, options.every)
        if path is None:
            return kept
        require("h5py")
        import h5py

        if options.resume:
            kept._read(path, fingerprint, shape)
            return kept
        begin_file(path, overwrite=options.overwrite)
        with h5py.File(path, "w") as file:
            group = file.create_group(GROUP)
            group.create_group("state")
            group.attrs.update({MARK: fingerprint, "thin": options.every, "steps": 0})
            group.attrs["accepted"] = 0.0
            for name, each in (("chain", shape), ("log_prob", shape[:2])):
                group.create_dataset(name, (0, *each), maxshape=(None, *each), dtype="f8")
        return kept

    def _read(self, path: Path, fingerprint: str, shape: tuple[int, int, int]) -> None:
        import h5py

        check_resumed(path)
        if not h5py.is_hdf5(path):
            raise ValueError(f"{path}: this file holds no chain of emcee or hmc")
        with h5py.File(path, "r") as file:
            if GROUP not in file:
                found = "a chain of emcee" if EMCEE in file else "no chain of emcee or hmc"
                raise ValueError(
                    f"{path}: this file holds {found}"
                    + ('; resume it with the sampler "emcee"' if EMCEE in file else "")
                )
            group: Any = file[GROUP]
            check_same_problem(path, group.attrs[MARK], fingerprint)
            chains, thin = group["chain"].shape[1], int(group.attrs["thin"])
            if chains != shape[0] or thin != self._thin:
                refuse_settings(path, (chains, thin), (shape[0], self._thin))
            self.steps = int(group.attrs["steps"])
            self._accepted = float(group.attrs["accepted"])
            self._free = [group["chain"][:]]
            self._height = [group["log_prob"][:]]
            self.state = {name: array[()] for name, array in group["state"].items()}

    def add(
        self,
        free: Float[Any, "steps chains blocks dims"],
        height: Float[Any, "steps chains blocks"],
        accepted: float,
        state: Mapping[str, Any],
    ) -> None:
        """Keep some steps; `accepted` is the sum of their shares."""
        chosen = np.arange(self.steps + 1, self.steps + len(free) + 1) % self._thin == 0
        self._free.append(np.asarray(free)[chosen])
        self._height.append(np.asarray(height)[chosen])
        self._accepted += accepted
        self.steps += len(free)
        self.state = {name: np.asarray(array) for name, array in state.items()}
        if self._path is None:
            return
        import h5py

        with h5py.File(self._path, "a") as file:
            group: Any = file[GROUP]
            for name, new in (("chain", self._free[-1]), ("log_prob", self._height[-1])):
                group[name].resize(len(group[name]) + len(new), axis=0)
                group[name][len(group[name]) - len(new) :] = new
            for name, array in self.state.items():
                kept = group["state"].require_dataset(name, array.shape, array.dtype)
                kept[...] = array
            group.attrs.update({"steps": self.steps, "accepted": self._accepted})

    def chain(self, *, interrupted: bool) -> Chain:
        """What is kept.

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
            sampler=GROUP,
        )
