"""How a posterior is sampled: the options that its functions have in common."""

import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import TypedDict

from glazejax.progress import Progress, no_progress

_WALKERS = 32


class SamplingOptions(TypedDict, total=False):
    """The fields of `Sampling`, as arguments of the functions that sample."""

    steps: int
    walkers: int | None
    thin: int
    seed: int
    path: str | Path | None
    resume: bool
    overwrite: bool
    progress: Progress


@dataclass(frozen=True, kw_only=True)
class Sampling:
    """Options of the chain.

    Attributes:
        steps: of the whole chain, a resumed one goes on until it has as many; 0 for Laplace's
            approximation alone.
        walkers: of the ensemble, even; by default 32, or as many as the unknowns need.
        thin: every how many steps one is kept.
        seed: of all random numbers. A resumed chain goes on with its own.
        path: HDF5 file that every kept step is written to; none keeps the chain in memory.
        resume: go on with the chain in it.
        overwrite: replace it.
        progress: called at each step that is kept.

    Raises:
        ValueError: numbers of steps, or of walkers, that make no chain.
    """

    steps: int = 5000
    walkers: int | None = None
    thin: int = 5
    seed: int = 0
    path: str | Path | None = None
    resume: bool = False
    overwrite: bool = False
    progress: Progress = no_progress

    def __post_init__(self) -> None:
        if isinstance(self.progress, bool):
            warnings.warn(
                "progress is a function of (done, total, words) now, see glazejax.progress",
                DeprecationWarning,
                stacklevel=4,
            )
            object.__setattr__(self, "progress", no_progress)
        if self.steps < 0:
            raise ValueError(
                f"{self.steps} steps were asked for; ask for some thousands, or for 0 to sample "
                "nothing"
            )
        if self.thin < 1:
            raise ValueError(f"thin is {self.thin}; keep every step with 1, or every fifth with 5")
        if 0 < self.steps < self.thin:
            raise ValueError(
                f"{self.steps} steps are fewer than one kept step ({self.thin}); ask for some "
                "thousands, such as 4000"
            )
        if self.walkers is not None:
            _check_walkers(self.walkers, 2)

    def walkers_for(self, dims: int) -> int:
        """Walkers for so many unknowns.

        Raises:
            ValueError: too few were asked for.
        """
        least = 2 * dims + 2
        if self.walkers is None:
            return max(_WALKERS, least)
        _check_walkers(self.walkers, least)
        return self.walkers


def _check_walkers(walkers: int, least: int) -> None:
    if walkers < least or walkers % 2:
        raise ValueError(
            f"{walkers} walkers are not enough, or odd; take an even number of at least {least}, "
            "such as 32"
        )
