"""Sampling by emcee: all walkers of all blocks in one compiled call a half step, chains kept in a
file, convergence.

emcee proposes and accepts a walker as a whole, and thirty bands would be one problem of sixty
unknowns, of which almost every proposal is refused. Blocks do not depend on each other, so the
moves here are emcee's own (stretch and differential evolution between two halves of the ensemble)
done in each block by itself: every block takes a step of two unknowns, or seven, and accepts it
alone. The rest, the random numbers, the file and the autocorrelation times, is emcee's.

A chain counts as converged in a block if what is kept of it is 50 autocorrelation times long,
emcee's own rule, its effective sample size is 400 or more, and its R-hat below 1.05: walkers that
never met have short times, each about its own place.
"""

import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import emcee
import numpy as np
from emcee.moves import Move
from jaxtyping import Float

from glazejax.extras import require

from .problem import Problem
from .sampling import Sampling

ENOUGH_TIMES = 50.0
"""Autocorrelation times that a chain must be long."""

ENOUGH_SAMPLES = 400.0
"""Effective samples that it must hold."""

MOST_APART = 1.05
"""R-hat that it must stay below: how much wider all walkers together are than each by itself."""

GROUP = "mcmc"
MARK = "problem"
"""Where a file keeps the fingerprint of its problem."""

Ensemble = Float[np.ndarray, "walkers blocks dims"]


class BlockMove(Move):
    """A move of two halves of an ensemble that every block makes and accepts by itself."""

    def __init__(self, blocks: int):
        self.blocks = blocks

    def step(
        self, here: Ensemble, there: Ensemble, random: Any
    ) -> tuple[Ensemble, Float[np.ndarray, "walkers blocks"]]:
        """Proposals for the walkers here from those there, and the logarithm of the factor in their
        acceptance.
        """
        raise NotImplementedError

    def propose(self, model: Any, state: Any) -> tuple[Any, np.ndarray]:
        """One step of the whole ensemble; gives the state and the share of blocks that moved,
        (walkers,).
        """
        walkers = len(state.coords)
        order = model.random.permutation(walkers)
        halves = order[: walkers // 2], order[walkers // 2 :]
        accepted = np.zeros(walkers)
        coords = state.coords.reshape(walkers, self.blocks, -1)
        for half, other in (halves, halves[::-1]):
            proposal, factor = self.step(coords[half], coords[other], model.random)
            log_prob, parts = model.compute_log_prob_fn(proposal.reshape(len(half), -1))
            old = _by_block(
                state.log_prob[half], None if state.blobs is None else state.blobs[half]
            )
            new = _by_block(log_prob, parts)
            moves = np.log(model.random.random_sample(new.shape)) < factor + new - old
            coords[half] = np.where(moves[..., None], proposal, coords[half])
            old = np.where(moves, new, old)
            state.log_prob[half] = old.sum(axis=1)
            if state.blobs is not None:
                state.blobs[half] = old
            accepted[half] = moves.mean(axis=1)
        state.coords = coords.reshape(walkers, -1)
        return state, accepted


def _by_block(total: np.ndarray, parts: np.ndarray | None) -> Float[np.ndarray, "walkers blocks"]:
    """Log-probabilities of each block: emcee carries those of several as blobs, of a single one as
    the total.
    """
    return total[:, None] if parts is None else np.asarray(parts)


class BlockStretch(BlockMove):
    """Along the line to another walker (Goodman and Weare 2010)."""

    def step(self, here: Ensemble, there: Ensemble, random: Any) -> tuple[Ensemble, np.ndarray]:
        """See `BlockMove.step`; the stretch z has a density of z^-1/2 on [1/2, 2]."""
        walkers, blocks, dims = here.shape
        z = (1.0 + random.random_sample((walkers, blocks))) ** 2 / 2.0
        partner = there[random.randint(len(there), size=(walkers, blocks)), np.arange(blocks)]
        return partner + z[..., None] * (here - partner), (dims - 1.0) * np.log(z)


class BlockDifference(BlockMove):
    """By the difference of two other walkers (differential evolution, Nelson, Ford and Payne 2014).

    One step in ten is the whole difference, which carries walkers between two modes.
    """

    def step(self, here: Ensemble, there: Ensemble, random: Any) -> tuple[Ensemble, np.ndarray]:
        """See `BlockMove.step`; the move is symmetric."""
        walkers, blocks, dims = here.shape
        first = random.randint(len(there), size=(walkers, blocks))
        second = (first + 1 + random.randint(len(there) - 1, size=(walkers, blocks))) % len(there)
        usual = 2.38 / np.sqrt(2.0 * dims) * np.exp(0.1 * random.standard_normal((walkers, blocks)))
        length = np.where(random.random_sample((walkers, blocks)) < 0.1, 1.0, usual)
        columns = np.arange(blocks)
        step = length[..., None] * (there[first, columns] - there[second, columns])
        # So small a shake only keeps the walkers from lying in one plane.
        return here + step + 1e-6 * random.standard_normal(here.shape), np.zeros((walkers, blocks))


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
        times: longest autocorrelation time of each block, in steps, (blocks,); infinite if it
            cannot be told.
        samples: effective sample size of each block, (blocks,).
        length: steps kept.
        discarded: steps left out at the start.
        apart: R-hat of each block, (blocks,): that of the quantity whose walkers differ most.
        enough: autocorrelation times that are needed; 0 where walkers are many and short, and begin
            at draws of the posterior.
    """

    times: Float[np.ndarray, "blocks"]
    samples: Float[np.ndarray, "blocks"]
    length: int
    discarded: int
    apart: Float[np.ndarray, "blocks"] | float = 1.0
    enough: float = ENOUGH_TIMES

    @property
    def converged(self) -> np.ndarray:
        """By block, (blocks,)."""
        long = self.length >= self.enough * self.times
        return long & (self.samples >= ENOUGH_SAMPLES) & (np.asarray(self.apart) < MOST_APART)

    def words(self) -> str:
        """One sentence, with the reason."""
        good = self.converged
        worst = float(self.times.max())
        numbers = (
            f"{self.length} steps kept, {_ratio(self.length, worst)} autocorrelation times of "
            f"{worst:.0f} steps, {self.samples.min():.0f} effective samples, R-hat "
            f"{np.max(self.apart):.2f}"
        )
        times = f"{self.enough:.0f} times and " if self.enough else ""
        rule = f"{times}{ENOUGH_SAMPLES:.0f} samples are needed, and an R-hat below {MOST_APART:g}"
        if good.all():
            return f"converged: {numbers} ({rule})"
        if not np.isfinite(worst):
            return (
                f"not converged: {self.length} steps kept are too few to tell an autocorrelation "
                f"time ({rule})"
            )
        where = "" if good.size == 1 else f" in {np.sum(~good)} of {good.size} blocks"
        more = int(np.ceil(1.2 * self.enough * worst / 100.0) * 100) + self.discarded
        if np.max(self.apart) >= MOST_APART or not self.enough:
            # Times of walkers that have not met are too short.
            more = max(more, 4 * (self.length + self.discarded))
        return f"not converged{where}: {numbers} ({rule}); a chain of about {more} steps would do"


def _ratio(length: int, time: float) -> str:
    return f"{length / time:.0f}" if np.isfinite(time) else "unknown"


def convergence(
    chain: Chain, values: Float[np.ndarray, "steps walkers blocks quantities"]
) -> Convergence:
    """Autocorrelation times of what is reported, after leaving out five of them, or a tenth if that
    is more.

    Args:
        chain: the whole chain.
        values: of every quantity, on a scale where its mean means something.
    """
    steps, walkers, blocks, count = values.shape
    flat = values.reshape(steps, walkers, -1)
    times = autocorrelation_times(flat)
    finite = times[np.isfinite(times)]
    start = min(steps // 2, max(steps // 10, int(5 * finite.max()) if finite.size else 0))
    times = autocorrelation_times(flat[start:]).reshape(blocks, count).max(axis=1)
    samples = np.where(np.isfinite(times), (steps - start) * walkers / times, 0.0)
    apart = scale_reduction(flat[start:]).reshape(blocks, count).max(axis=1)
    return Convergence(
        times * chain.thin,
        samples,
        (steps - start) * chain.thin,
        start * chain.thin,
        apart=apart,
        enough=ENOUGH_TIMES if chain.sampler == "emcee" else 0.0,
    )


def scale_reduction(values: Float[np.ndarray, "steps walkers n"]) -> Float[np.ndarray, "n"]:
    """Split R-hat of each column: the standard deviation of all halves of walkers together over
    that of each by itself (Gelman et al., Bayesian Data Analysis, 3rd ed., 11.4); infinite for a
    chain too short or stuck.
    """
    half = len(values) // 2
    if half < 4:
        return np.full(values.shape[-1], np.inf)
    halves = np.concatenate([values[:half], values[-half:]], axis=1)
    within = halves.var(axis=0, ddof=1).mean(axis=0)
    between = halves.mean(axis=0).var(axis=0, ddof=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        found = np.sqrt((half - 1.0) / half + between / within)
    return np.where(np.isfinite(found), found, np.inf)


def autocorrelation_times(values: Float[np.ndarray, "steps walkers n"]) -> Float[np.ndarray, "n"]:
    """emcee's estimate for each column, in stored steps, at least 1; infinite for a chain too short
    or stuck.
    """
    if len(values) < 8:
        return np.full(values.shape[-1], np.inf)
    with np.errstate(invalid="ignore", divide="ignore"):
        times = emcee.autocorr.integrated_time(values, tol=0, quiet=True)
    return np.where(np.isfinite(times) & (times > 0), np.maximum(times, 1.0), np.inf)


def run_chain(
    problem: Problem,
    start: Ensemble,
    options: Sampling,
) -> Chain:
    """Sample a problem.

    Args:
        problem: what is sampled.
        start: of the ensemble, an even number of walkers, at least 2 dims + 2.
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

    moves = [(BlockStretch(blocks), 0.4), (BlockDifference(blocks), 0.6)]
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
        # Blocks are sampled side by side, so walkers may be fewer than the unknowns of all blocks
        # together.
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
