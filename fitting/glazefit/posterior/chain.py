"""Sampling by emcee: all walkers of all blocks in one compiled call a half step, chains kept in a
file, convergence.

The moves are emcee's own: stretch and differential evolution between two halves of the ensemble.
A walker is accepted as a whole, so that thirty bands are one problem of sixty unknowns:
Hamiltonian Monte Carlo (`glazefit.posterior.hamiltonian`) samples each band by itself.

A chain counts as converged in a block if it holds 400 effective samples or more and its R-hat is
below 1.05, both as ArviZ counts them.
"""

import os
import signal
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import emcee
import numpy as np
from emcee.moves import DEMove, StretchMove
from jaxtyping import Bool, Float

from glazejax.extras import require

from .arviz import load_arviz
from .problem import Problem
from .sampling import Sampling

ENOUGH_SAMPLES = 400.0
"""Effective samples that it must hold."""

MOST_APART = 1.05
"""R-hat that it must stay below: how much wider all walkers together are than each by itself."""

GROUP = "mcmc"
MARK = "problem"
"""Where a file keeps the fingerprint of its problem."""

# Steps from which on ArviZ counts.
_COUNTED = 8

Ensemble = Float[np.ndarray, "walkers blocks dims"]


@dataclass(frozen=True)
class Chain:
    """What was sampled.

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


@dataclass(frozen=True)
class Convergence:
    """Whether a chain is long enough.

    Attributes:
        samples: effective samples of each block, (blocks,): of the quantity that has fewest.
        apart: R-hat of each block, (blocks,): that of the quantity whose walkers differ most.
        walkers: of the chain.
        length: steps kept.
        discarded: steps left out at the start.
    """

    samples: Float[np.ndarray, "blocks"]
    apart: Float[np.ndarray, "blocks"]
    walkers: int
    length: int
    discarded: int

    @property
    def times(self) -> Float[np.ndarray, "blocks"]:
        """Steps of all walkers for one effective sample, (blocks,); infinite without a sample."""
        with np.errstate(divide="ignore"):
            return self.length * self.walkers / self.samples

    @property
    def converged(self) -> Bool[np.ndarray, "blocks"]:
        """By block, (blocks,)."""
        return (self.samples >= ENOUGH_SAMPLES) & (self.apart < MOST_APART)

    def words(self) -> str:
        """One sentence, with the reason."""
        good = self.converged
        least = float(self.samples.min())
        rule = f"{ENOUGH_SAMPLES:.0f} samples are needed, and an R-hat below {MOST_APART:g}"
        numbers = (
            f"{self.length} steps kept, {least:.0f} effective samples, R-hat "
            f"{np.max(self.apart):.2f}"
        )
        if good.all():
            return f"converged: {numbers} ({rule})"
        if least <= 0:
            return (
                f"not converged: {self.length} steps kept are too few to count effective samples "
                f"({rule})"
            )
        where = "" if good.size == 1 else f" in {np.sum(~good)} of {good.size} blocks"
        more = int(np.ceil(1.2 * ENOUGH_SAMPLES / least * self.length / 100.0) * 100)
        if np.max(self.apart) >= MOST_APART:
            # Effective samples of walkers that have not met are too many.
            more = max(more, 4 * self.length)
        return (
            f"not converged{where}: {numbers} ({rule}); a chain of about {more + self.discarded} "
            "steps would do"
        )


def convergence(
    chain: Chain, values: Float[np.ndarray, "steps walkers blocks quantities"]
) -> Convergence:
    """Effective samples and R-hat of what is reported. Of emcee's chain, which has no warm-up, five
    times the steps of one effective sample are left out, or a tenth if that is more.

    Args:
        chain: the whole chain.
        values: of every quantity, on a scale where its mean means something.

    Raises:
        ModuleNotFoundError: ArviZ is not installed.
    """
    steps, walkers, blocks, count = values.shape
    flat = values.reshape(steps, walkers, -1)
    start = 0
    if chain.sampler == "emcee":
        samples, _ = count_samples(flat)
        longest = steps * walkers / samples[samples > 0].min(initial=np.inf)
        start = min(steps // 2, max(steps // 10, int(5 * longest)))
    samples, apart = count_samples(flat[start:])
    return Convergence(
        samples=samples.reshape(blocks, count).min(axis=1),
        apart=apart.reshape(blocks, count).max(axis=1),
        walkers=walkers,
        length=(steps - start) * chain.thin,
        discarded=start * chain.thin,
    )


def count_samples(
    values: Float[np.ndarray, "steps walkers n"],
) -> tuple[Float[np.ndarray, "n"], Float[np.ndarray, "n"]]:
    """Effective samples and R-hat of each column by ArviZ: of ranks, of halves of walkers; 0 and
    infinite for a chain too short or stuck.

    Source: A. Vehtari et al., Bayesian Analysis 16 (2021) 667.

    Raises:
        ModuleNotFoundError: ArviZ is not installed.
    """
    arviz = load_arviz()
    # ArviZ takes what never moves for independent draws.
    moves = np.ptp(values, axis=(0, 1)) > 0
    if len(values) < _COUNTED or not moves.any():
        return np.zeros(values.shape[-1]), np.full(values.shape[-1], np.inf)
    with warnings.catch_warnings():
        # More walkers than steps are what an ensemble has.
        warnings.simplefilter("ignore")
        draws = arviz.convert_to_dataset({"of": np.swapaxes(values, 0, 1)})
        samples = arviz.ess(draws)["of"].to_numpy()
        apart = arviz.rhat(draws)["of"].to_numpy()
    known = moves & np.isfinite(samples) & np.isfinite(apart)
    return np.where(known, samples, 0.0), np.where(known, apart, np.inf)


def run_chain(
    problem: Problem,
    start: Ensemble,
    options: Sampling,
) -> Chain:
    """Sample a problem.

    Args:
        problem: what is sampled.
        start: of the ensemble, an even number of walkers, at least twice as many as the unknowns of
            all blocks.
        options: all but its number of walkers.

    Raises:
        ValueError: a file whose chain is of another problem.
        FileExistsError: there is such a file, and neither `resume` nor `overwrite` was asked for.
        FileNotFoundError: `resume` was, and there is none.
    """
    steps = options.length
    thin = options.every
    path = None if options.path is None else Path(options.path)
    walkers, blocks, dims = start.shape
    backend = (
        emcee.backends.Backend()
        if path is None
        else _backend(
            problem, path, (walkers, blocks * dims), thin, options.resume, options.overwrite
        )
    )

    def log_prob(points: np.ndarray) -> np.ndarray:
        parts = problem.log_probability(points.reshape(len(points), blocks, dims))
        return (
            parts[:, 0]
            if blocks == 1
            else np.concatenate([parts.sum(axis=1, keepdims=True), parts], axis=1)
        )

    moves = [(StretchMove(), 0.4), (DEMove(), 0.6)]
    sampler = emcee.EnsembleSampler(
        walkers,
        blocks * dims,
        log_prob,
        moves=moves,
        backend=backend,
        vectorize=True,
        blobs_dtype=np.float64,
    )
    done = backend.iteration
    if done == 0:
        sampler.random_state = np.random.RandomState(options.seed).get_state()
        if path is not None:
            _mark(path, problem, thin)
    left = steps // thin - done
    stopped = False
    if left > 0:
        # Draws of Laplace's approximation are far from each other where a block is open.
        run = sampler.sample(
            emcee.State(start.reshape(walkers, -1)) if done == 0 else backend.get_last_sample(),
            iterations=left,
            thin_by=thin,
            skip_initial_state_check=True,
        )
        with gentle_interrupt() as asked:
            for kept, _ in enumerate(run, start=done + 1):
                options.progress(kept * thin, steps, "sampling")
                if asked.is_set():
                    stopped = True
                    break
    return read_chain(backend, blocks, thin, stopped)


def read_chain(backend: Any, blocks: int, thin: int, interrupted: bool = False) -> Chain:
    """The steps that a backend holds."""
    steps = backend.iteration
    if steps == 0:
        raise ValueError(
            "the chain was stopped before its first step was kept; there is nothing to report"
        )
    free = backend.get_chain()
    log_prob = backend.get_log_prob()
    parts = backend.get_blobs()
    shape = (steps, free.shape[1], blocks)
    parts = log_prob if parts is None else parts
    accepted = float(np.mean(backend.accepted)) / steps
    return Chain(
        free=free[:steps].reshape(*shape, -1),
        log_probability=np.asarray(parts[:steps]).reshape(shape),
        accepted=accepted,
        thin=thin,
        interrupted=interrupted,
    )


def _backend(
    problem: Problem, path: Path, shape: tuple[int, int], thin: int, resume: bool, overwrite: bool
) -> Any:
    """The file as emcee's backend, new or found again."""
    require("h5py")
    import h5py

    if not resume:
        begin_file(path, overwrite=overwrite)
        return emcee.backends.HDFBackend(str(path), name=GROUP)
    check_resumed(path)
    backend: Any = emcee.backends.HDFBackend(str(path), name=GROUP)
    if not backend.initialized:
        raise ValueError(f"{path}: this file holds no chain of emcee")
    with h5py.File(path, "r") as file:
        mark = file[GROUP].attrs.get(MARK)
        kept = int(file[GROUP].attrs.get("thin", 0))
    check_same_problem(path, mark, problem.fingerprint)
    if backend.shape != shape or kept != thin:
        refuse_settings(path, (backend.shape[0], kept), (shape[0], thin))
    return backend


def begin_file(path: Path, *, overwrite: bool) -> None:
    """Make room for the file of a new chain.

    Raises:
        FileExistsError: there is such a file, and it may not be replaced.
    """
    if path.exists() and not overwrite:
        raise FileExistsError(
            f"{path}: there is a chain already; resume it, choose another name, or ask to "
            "overwrite it"
        )
    if path.exists():
        os.remove(path)
    path.parent.mkdir(parents=True, exist_ok=True)


def check_resumed(path: Path) -> None:
    """That there is a file to go on from.

    Raises:
        FileNotFoundError: there is none.
    """
    if not path.is_file():
        raise FileNotFoundError(
            f"{path}: there is no chain to resume; leave out the request to resume, to start one"
        )


def check_same_problem(path: Path, mark: object, fingerprint: str) -> None:
    """That a file's chain is of this problem.

    Raises:
        ValueError: it is of another.
    """
    if mark != fingerprint:
        raise ValueError(
            f"{path}: the chain is of another problem (film, paints, noise or prior differ); "
            "resume it with the settings that it was started with, or start another chain "
            "elsewhere"
        )


def refuse_settings(path: Path, kept: tuple[int, int], asked: tuple[int, int]) -> NoReturn:
    """Say that a file's walkers and thinning are others than those asked for.

    Raises:
        ValueError: always.
    """
    raise ValueError(
        f"{path}: the chain has {kept[0]} walkers and keeps every {kept[1]}. step, not {asked[0]} "
        f"and {asked[1]}; ask for the same"
    )


def _mark(path: Path, problem: Problem, thin: int) -> None:
    import h5py

    with h5py.File(path, "a") as file:
        file[GROUP].attrs[MARK] = problem.fingerprint
        file[GROUP].attrs["thin"] = thin


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
