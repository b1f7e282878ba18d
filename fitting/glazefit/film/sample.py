"""Draws of a problem's posterior by chains of either sampler."""

import threading
from typing import Any, Protocol

from .chain_file import Chain, Draws, DrawsFile, gentle_interrupt
from .ensemble import Ensemble
from .hamiltonian import Hamiltonian
from .problem import FilmProblem
from .sampling import Sampling
from .solve import Laplace


class Stepper(Protocol):
    """A sampler of one problem.

    Attributes:
        walkers: that step together.
        piece: steps between two looks at the keyboard and the file.
    """

    walkers: int
    piece: int

    def begin(self, asked: threading.Event) -> dict[str, Any]:
        """The state of a new chain after its warm-up, which ends early when it is asked to."""
        ...

    def steps(self, state: dict[str, Any], number: int, count: int) -> Draws:
        """So many steps after the first `number`: random numbers follow from the seed and the
        number of the step, so that a chain that is resumed is the one that was never stopped.
        """
        ...


def draw_chain(problem: FilmProblem, approximation: Laplace, options: Sampling) -> Chain:
    """Sample a problem.

    Args:
        problem: what is sampled.
        approximation: to it, from which chains begin.
        options: sampler, steps after the warm-up, how many chains, and the rest.

    Raises:
        ValueError: nothing was kept, or too few walkers.
        ValueError, FileExistsError, FileNotFoundError: see `glazefit.film.chain_file`.
    """
    sampler: type[Hamiltonian | Ensemble] = Hamiltonian if options.sampler == "hmc" else Ensemble
    stepper: Stepper = sampler(problem, approximation, options)
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
