"""Draws of a problem's posterior by chains of either sampler."""

from .chain_file import Chain, DrawsFile, gentle_interrupt
from .ensemble import Ensemble
from .hamiltonian import Hamiltonian
from .problem import FilmProblem
from .sampling import Sampling
from .solve import Laplace


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
        ValueError, FileExistsError, FileNotFoundError: see `glazefit.film.chain_file`.
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
