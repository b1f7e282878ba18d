"""Options of sampling that all functions of posteriors have in common."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypedDict, get_args

from glazejax.progress import Progress, no_progress

Sampler = Literal["hmc", "emcee", "importance"]
"""How a posterior is sampled."""

SAMPLERS: tuple[str, ...] = get_args(Sampler)
_STEPS = {"hmc": 200, "emcee": 5000, "importance": 0}
_EVERY = {"hmc": 1, "emcee": 5, "importance": 1}
_WALKERS = {"hmc": 16, "emcee": 32}


class SamplingOptions(TypedDict, total=False):
    """The fields of `Sampling`, as arguments of the functions that sample."""

    sampler: Sampler
    steps: int | None
    walkers: int | None
    thin: int | None
    seed: int
    path: str | Path | None
    resume: bool
    overwrite: bool
    progress: Progress


@dataclass(frozen=True, kw_only=True)
class Sampling:
    """Options of the chain.

    Attributes:
        sampler: "hmc", Hamiltonian Monte Carlo, which follows the posterior's slopes
            (`glazefit.film.hamiltonian`); "emcee", an ensemble that needs none
            (`glazefit.film.ensemble`); or "importance", draws of Laplace's approximation weighted
            by the posterior, without a chain: quick, and good where its tail index says so.
        steps: of the whole chain, by default 200 of hmc, its warm-up not counted, and
            5000 of emcee; a resumed one goes on until it has as many; 0 for Laplace's
            approximation alone.
        walkers: chains of hmc, at least 2 and by default 16; or of emcee's ensemble, even, by
            default 32 or twice as many as there are unknowns.
        thin: every how many steps one is kept; by default each of hmc, every fifth of emcee.
        seed: of all random numbers. A resumed chain takes the one that it was started with.
        path: HDF5 file that every kept step is written to; none keeps the chain in memory.
        resume: go on with the chain in it.
        overwrite: replace it.
        progress: called after each piece of the chain: fifty steps of hmc, and its warm-up in two
            pieces; of emcee the steps from one that is kept to the next.

    Raises:
        ValueError: no such sampler, or numbers of steps, or of walkers, that make no chain, or that
            are of one where none is sampled, or one to resume there.
    """

    sampler: Sampler = "hmc"
    steps: int | None = None
    walkers: int | None = None
    thin: int | None = None
    seed: int = 0
    path: str | Path | None = None
    resume: bool = False
    overwrite: bool = False
    progress: Progress = no_progress

    def __post_init__(self) -> None:
        check_sampler(self.sampler, "sampler")
        if self.steps is not None and self.steps < 0:
            raise ValueError(
                f"{self.steps} steps were asked for; ask for some thousands, or for 0 to sample "
                "nothing"
            )
        # No steps are none that were asked for.
        stated = {"steps": self.steps or None, "walkers": self.walkers, "thin": self.thin}
        of_chain = [name for name, value in stated.items() if value is not None]
        if self.sampler == "importance" and of_chain:
            raise ValueError(
                f"importance samples no chain: leave out {of_chain[0]}, or take hmc or emcee"
            )
        if self.resume and not self.length:
            raise ValueError(
                "resume goes on with a chain, and nothing is sampled: ask for steps of hmc or "
                "emcee, or leave out resume"
            )
        if self.every < 1:
            raise ValueError(f"thin is {self.thin}; keep every step with 1, or every fifth with 5")
        if 0 < self.length < self.every:
            raise ValueError(
                f"{self.length} steps are fewer than one kept step ({self.every}); ask for more, "
                f"such as {100 * self.every}, or for a smaller thin"
            )
        if self.walkers is not None:
            # Refuses too few.
            self.walkers_for(1)

    @property
    def length(self) -> int:
        """Steps of the whole chain."""
        return _STEPS[self.sampler] if self.steps is None else self.steps

    @property
    def every(self) -> int:
        """Steps between two that are kept."""
        return _EVERY[self.sampler] if self.thin is None else self.thin

    def walkers_for(self, dims: int) -> int:
        """Walkers for so many unknowns of all blocks: emcee takes two for each at least.

        Raises:
            ValueError: too few were asked for.
        """
        least = 2 * dims if self.sampler == "emcee" else 2
        usual = _WALKERS[self.sampler]
        if self.walkers is None:
            return max(usual, least)
        if self.sampler == "emcee" and (self.walkers < least or self.walkers % 2):
            raise ValueError(
                f"{self.walkers} walkers are not enough, or odd; take an even number of at least "
                f"{least}, such as {usual}"
            )
        if self.walkers < least:
            raise ValueError(
                f"{self.walkers} walkers are not enough; take {least} or more, such as {usual}"
            )
        return self.walkers


def check_sampler(word: str, argument: str) -> None:
    """Check that there is such a sampler.

    Raises:
        ValueError: there is none; says which there are.
    """
    if word not in SAMPLERS:
        raise ValueError(
            f"{argument} is {word!r}; it must be {', '.join(SAMPLERS[:-1])} or {SAMPLERS[-1]}"
        )
