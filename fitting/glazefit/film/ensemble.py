"""Sampling by emcee: all walkers of all blocks in one compiled call a half step.

The moves are emcee's own: stretch and differential evolution between two halves of the ensemble.
A walker is accepted as a whole, so that thirty bands are one problem of sixty unknowns:
Hamiltonian Monte Carlo (`glazefit.film.hamiltonian`) samples each band by itself.
"""

import threading
from typing import Any

import numpy as np

from .problem import Draws, FilmProblem
from .sampling import Sampling
from .solve import Laplace


class Ensemble:
    """Walkers of one problem, see `glazefit.film.sample.draw_chain`."""

    def __init__(self, problem: FilmProblem, approximation: Laplace, options: Sampling) -> None:
        """Of a problem, beginning at draws of its approximation."""
        import emcee
        from emcee.moves import DEMove, StretchMove

        blocks, dims = len(problem.blocks), problem.dims
        self.walkers = options.walkers_for(blocks * dims)
        self.piece = options.every
        self._shape = (self.walkers, blocks, dims)
        self._problem = problem
        self._approximation = approximation
        self._seed = options.seed

        def log_prob(points: np.ndarray) -> np.ndarray:
            by_block = problem.log_probability(points.reshape(len(points), blocks, dims))
            return np.concatenate([by_block.sum(axis=1, keepdims=True), by_block], axis=1)

        self._sampler = emcee.EnsembleSampler(
            self.walkers,
            blocks * dims,
            log_prob,
            moves=[(StretchMove(), 0.4), (DEMove(), 0.6)],
            vectorize=True,
            blobs_dtype=np.float64,
        )

    def begin(self, asked: threading.Event) -> dict[str, Any]:
        """Draws of the approximation; nothing is warmed up."""
        free = self._approximation.gaussians.draws(self.walkers, np.random.default_rng(self._seed))
        height = self._problem.log_probability(free)
        return {"free": free.reshape(self.walkers, -1), "height": height}

    def steps(self, state: dict[str, Any], number: int, count: int) -> Draws:
        """So many steps after the first `number`."""
        import emcee

        height = state["height"]
        ensemble = emcee.State(state["free"], log_prob=height.sum(axis=1), blobs=np.squeeze(height))
        free = []
        heights = []
        accepted = 0.0
        for step in range(number, number + count):
            before = ensemble.coords
            ensemble.random_state = np.random.RandomState([self._seed, step]).get_state()
            # Draws of Laplace's approximation are far from each other where a block is open.
            ensemble = next(
                self._sampler.sample(ensemble, store=False, skip_initial_state_check=True)
            )
            free.append(ensemble.coords.reshape(self._shape))
            heights.append(np.reshape(np.asarray(ensemble.blobs), self._shape[:2]))
            accepted += float(np.mean(np.any(ensemble.coords != before, axis=1)))
        after = {"free": ensemble.coords, "height": heights[-1]}
        return Draws(np.stack(free), np.stack(heights), accepted, after)
