"""Sampling with gradients: Hamiltonian Monte Carlo, all chains of all blocks in one compiled
program.

A posterior may be a thin and bent sheet, a thousandth as thick as long, or several of them:
readings are good to a thousandth, an opaque coat tells only k/s, and a thin one reads as well. A
chain that begins at a mode stays near it, and looks as if it had converged there; draws of the
prior led to the posterior lose modes that are narrow. So many draws begin about all modes that
least squares found, and in the prior, and are led to the posterior by sequential Monte Carlo (Del
Moral, Doucet and Jasra, J. R. Stat. Soc. B 68 (2006) 411): along begin^(1 - power)
posterior^power, with powers from 0 to 1, they are weighted, drawn again, and moved. When the power
is 1 they are draws of the posterior, in the right shares, and each begins a chain.

Each move is a trajectory of leapfrog steps in coordinates in which the draws are about round; its
length is drawn anew each time, up to half a turn, so that no direction comes back to where it
began (Neal 2011, Handbook of Markov Chain Monte Carlo, chapter 5). Steps are as long as keeps four
in five trajectories. Once the power is 1 every tenth move is a draw from Laplace's Gaussians
instead, taken or refused by Metropolis and Hastings: where Laplace is good, chains are as good as
independent draws.

Random numbers follow from the seed and the number of the step, so that a chain that is resumed is
the one that was never stopped.
"""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from glazejax.progress import Progress

from .chain import Chain, gentle_interrupt
from .chain_file import DrawsFile
from .laplace import Laplace
from .problem import Problem
from .sampling import Sampling

# Moves after each rise of the power, and at the posterior before the first that is kept, in two
# windows.
_MOVES = 3
_WARM_UP = (10, 20)
# The power rises until the weights of this share of the draws are left.
_LEFT = 0.5
_MOST_RISES = 200
# Steps between two looks at the keyboard and the file.
_PIECE = 50
# Length of a trajectory at most, half a turn, and leapfrog steps at most on the way and there.
_HALF_TURN = np.pi
_MOST_ON_THE_WAY = 16
_MOST = 32
_JUMP = 10
_ACCEPT = 0.8
_FIRST_STEP = 0.3
_GAIN = 1.0
# Beginnings: how much wider than Laplace's variances, and which share of the draws is the prior's.
_WIDER = 2.0
_OF_PRIOR = 0.3
_PRIOR_DRAWS = 4000
# Number of the first step that is kept, beyond any of the way there.
_SAMPLING = 100_000
_BEGINNING = 1_000_000


class Here(NamedTuple):
    """Where all chains are; height and slope are those of the log-density on the way, the gain is
    by how much the posterior is above the beginning.
    """

    free: Float[Array, "chains blocks dims"]
    height: Float[Array, "chains blocks"]
    gain: Float[Array, "chains blocks"]
    slope: Float[Array, "chains blocks dims"]


class Tuning(NamedTuple):
    """Of each block."""

    root: Float[Array, "blocks dims dims"]  # Cholesky factor of the covariance
    log_step: Float[Array, "blocks"]


class Gaussians(NamedTuple):
    """A mixture of Gaussians for each block."""

    means: Float[Array, "*blocks parts dims"]
    roots: Float[Array, "*blocks parts dims dims"]
    inverses: Float[Array, "*blocks parts dims dims"]  # of the roots
    log_weights: Float[Array, "*blocks parts"]

    @classmethod
    def of(
        cls,
        means: Float[np.ndarray, "blocks parts dims"],
        covariances: Float[np.ndarray, "blocks parts dims dims"],
        weights: Float[np.ndarray, "blocks parts"],
    ) -> "Gaussians":
        """From means and covariances."""
        roots = np.linalg.cholesky(covariances)
        log_weights = np.log(np.maximum(weights, 1e-300))
        return cls(*map(jnp.asarray, (means, roots, np.linalg.inv(roots), log_weights)))

    def draw(self, key: Array, chains: int) -> Float[Array, "chains blocks dims"]:
        """One draw for each chain and block."""
        which, noise = jax.random.split(key)
        blocks, _, dims = self.means.shape
        chosen = jax.random.categorical(which, self.log_weights, shape=(chains, blocks))
        at = jnp.arange(blocks), chosen
        steps = jax.random.normal(noise, (chains, blocks, dims))
        return self.means[at] + jnp.einsum("cbij,cbj->cbi", self.roots[at], steps)

    def log_density(self, free: Float[Array, "dims"]) -> Float[Array, ""]:
        """Of one block, up to a constant."""
        white = jnp.einsum("pij,pj->pi", self.inverses, free - self.means)
        diagonal = jnp.diagonal(self.inverses, axis1=-2, axis2=-1)
        height = jnp.sum(jnp.log(diagonal), axis=-1) - 0.5 * jnp.sum(white**2, axis=-1)
        return jax.scipy.special.logsumexp(self.log_weights + height)


def beginning(problem: Problem, approximation: Laplace, rng: np.random.Generator) -> Gaussians:
    """Where draws begin: Laplace's Gaussians, made wider, each mode with a share of its own however
    low it is, and a Gaussian as wide as the prior.
    """
    prior = problem.prior_draws(rng, _PRIOR_DRAWS)
    blocks, _, dims = approximation.modes.shape
    real = approximation.weights > 0
    weights = 0.5 * approximation.weights + 0.5 * real / real.sum(axis=1, keepdims=True)
    return Gaussians.of(
        np.concatenate(
            [approximation.modes, np.broadcast_to(prior.mean(axis=0), (blocks, 1, dims))], axis=1
        ),
        np.concatenate(
            [
                _WIDER * approximation.covariances,
                np.broadcast_to(np.cov(prior, rowvar=False), (blocks, 1, dims, dims)),
            ],
            axis=1,
        ),
        np.concatenate([(1.0 - _OF_PRIOR) * weights, np.full((blocks, 1), _OF_PRIOR)], axis=1),
    )


class Piece(NamedTuple):
    """Some steps: where they led, (steps, chains, blocks, ...), and how many were accepted."""

    free: Float[Array, "steps chains blocks dims"]
    height: Float[Array, "steps chains blocks"]
    accepted: Float[Array, ""]


class Model(NamedTuple):
    """What is sampled, but for its residuals."""

    data: Any
    shared: Any
    laplace: Gaussians
    begin: Gaussians
    key: Array


class Span(NamedTuple):
    """Which steps are taken, and how; a compiled program's arguments."""

    first: int | Array
    number: int | Array
    power: Float[np.ndarray, "blocks"] | Array
    learning: bool | Array
    most: int | Array  # leapfrog steps


@functools.partial(jax.jit, static_argnames="residuals")
def heights(
    residuals: Any,
    model: Model,
    free: Float[Array, "chains blocks dims"],
    power: Float[Array, "blocks"],
) -> Here:
    """Log-density on the way and its slope; what overflows is impossible, and flat."""

    def height(free: Array, data: Any, begin: Gaussians, power: Array) -> tuple[Array, Array]:
        posterior = -0.5 * jnp.sum(residuals(free, data, model.shared) ** 2)
        first = begin.log_density(free)
        return power * posterior + (1.0 - power) * first, posterior - first

    slope = jax.vmap(jax.value_and_grad(height, has_aux=True))
    found: tuple[tuple[Array, Array], Array] = jax.vmap(
        lambda chain: slope(chain, model.data, model.begin, power)
    )(free)
    (values, gains), slopes = found
    sound = jnp.isfinite(values)
    return Here(
        free=free,
        height=jnp.where(sound, values, -jnp.inf),
        gain=jnp.where(sound, gains, -jnp.inf),
        slope=jnp.where(jnp.isfinite(slopes), slopes, 0.0),
    )


@functools.partial(jax.jit, static_argnames="residuals")
def _steps(
    residuals: Any, model: Model, here: Here, tuning: Tuning, span: Span
) -> tuple[Here, Tuning, Piece]:
    """Some steps of all chains, from where the last ones left them."""
    chains, blocks, dims = here.free.shape

    def at(free: Array) -> Here:
        return heights(residuals, model, free, span.power)

    def trajectory(here: Here, tuning: Tuning, key: Array) -> tuple[Here, Array]:
        length, kick = jax.random.split(key)
        step = jnp.exp(tuning.log_step)
        turn = _HALF_TURN * jax.random.uniform(length, (blocks,), step.dtype)
        number = jnp.clip(jnp.ceil(turn / step), 1, span.most)

        def pull(here: Here) -> Array:
            return jnp.einsum("bij,cbi->cbj", tuning.root, here.slope)

        def leap(i: Array, state: tuple[Here, Array]) -> tuple[Here, Array]:
            here, momentum = state
            # A block whose trajectory is done stands still.
            going = jnp.where(i < number, step, 0.0)[:, None]
            momentum = momentum + 0.5 * going * pull(here)
            there = at(here.free + going * jnp.einsum("bij,cbj->cbi", tuning.root, momentum))
            return there, momentum + 0.5 * going * pull(there)

        start = jax.random.normal(kick, (chains, blocks, dims), here.free.dtype)
        end, momentum = jax.lax.fori_loop(0, number.max().astype(int), leap, (here, start))
        energy = 0.5 * jnp.sum(start**2 - momentum**2, axis=-1)
        return end, end.height - here.height + energy

    def jump(here: Here, tuning: Tuning, key: Array) -> tuple[Here, Array]:
        del tuning
        end = at(model.laplace.draw(key, chains).astype(here.free.dtype))

        def density(free: Array) -> Array:
            return jax.vmap(jax.vmap(Gaussians.log_density), (None, 0))(model.laplace, free)

        return end, end.height - here.height + density(here.free) - density(end.free)

    def one(i: Array, state: tuple[Here, Tuning, Piece]) -> tuple[Here, Tuning, Piece]:
        here, tuning, piece = state
        number = span.first + i
        move, coin = jax.random.split(jax.random.fold_in(model.key, number))
        jumps = (number % _JUMP == _JUMP - 1) & jnp.all(span.power == 1.0)
        moved: tuple[Here, Array] = jax.lax.cond(jumps, jump, trajectory, here, tuning, move)
        end, gain = moved
        gain = jnp.where(jnp.isnan(gain), -jnp.inf, gain)
        chance = jnp.minimum(1.0, jnp.exp(gain))
        takes = jax.random.uniform(coin, chance.shape, chance.dtype) < chance
        here = Here(*(_chosen(takes, new, old) for new, old in zip(end, here, strict=True)))
        better = tuning.log_step + _GAIN / (1.0 + 0.1 * i) * (chance.mean(axis=0) - _ACCEPT)
        learns = span.learning & ~jumps
        tuning = tuning._replace(log_step=jnp.where(learns, better, tuning.log_step))
        piece = Piece(
            free=piece.free.at[i].set(here.free),
            height=piece.height.at[i].set(here.height),
            accepted=piece.accepted + takes.mean(),
        )
        return here, tuning, piece

    empty = Piece(
        free=jnp.zeros((_PIECE, *here.free.shape), here.free.dtype),
        height=jnp.zeros((_PIECE, *here.height.shape), here.height.dtype),
        accepted=jnp.zeros((), here.height.dtype),
    )
    return jax.lax.fori_loop(0, span.number, one, (here, tuning, empty))


def _chosen(takes: Bool[Array, "chains blocks"], new: Array, old: Array) -> Array:
    return jnp.where(takes.reshape(takes.shape + (1,) * (new.ndim - takes.ndim)), new, old)


class _Sampler:
    """The chains of one problem, and the random numbers of what is not compiled."""

    def __init__(self, problem: Problem, approximation: Laplace, options: Sampling) -> None:
        self._problem = problem
        self._rng = np.random.default_rng(options.seed)
        self._model = Model(
            data=problem.data,
            shared=problem.shared,
            laplace=Gaussians.of(
                approximation.modes, approximation.covariances, approximation.weights
            ),
            begin=beginning(problem, approximation, self._rng),
            key=jax.random.key(options.seed),
        )
        self.power = np.zeros(len(problem.blocks))

    def at(self, free: np.ndarray) -> Here:
        """Chains at these places."""
        problem = self._problem
        power = jnp.asarray(self.power)
        return heights(problem.residuals, self._model, jnp.asarray(free), power)

    def steps(self, here: Here, tuning: Tuning, span: Span) -> tuple[Here, Tuning, Piece]:
        """See `_steps`."""
        problem = self._problem
        return _steps(problem.residuals, self._model, here, tuning, Span(*map(jnp.asarray, span)))

    def first(self, chains: int) -> tuple[Here, Tuning]:
        """Draws of the beginning."""
        model = self._model
        free = np.asarray(model.begin.draw(jax.random.fold_in(model.key, _BEGINNING), chains))
        blocks = free.shape[1]
        tuning = Tuning(
            root=rounded(free, model.begin.roots[:, -1]),
            log_step=jnp.full(blocks, np.log(_FIRST_STEP)),
        )
        return self.at(free), tuning

    def rise(self, here: Here, tuning: Tuning) -> tuple[Here, Tuning]:
        """The next power of each block, and draws taken again by weight."""
        gain = np.asarray(here.gain, float)
        power = next_power(gain, self.power)
        logs = (power - self.power) * np.nan_to_num(gain, neginf=-1e30)
        chosen = again(logs, self._rng)
        self.power = power
        free = np.take_along_axis(np.asarray(here.free), chosen[..., None], axis=0)
        return self.at(free), tuning._replace(root=rounded(free, tuning.root))


def next_power(
    gain: Float[np.ndarray, "chains blocks"], power: Float[np.ndarray, "blocks"]
) -> Float[np.ndarray, "blocks"]:
    """As far as half the draws keep their weight, by bisection, at most 1."""
    logs = np.nan_to_num(gain, neginf=-1e30)
    logs = logs - logs.max(axis=0)

    def enough(to: np.ndarray) -> np.ndarray:
        weights = np.exp((to - power) * logs)
        return weights.sum(axis=0) ** 2 >= _LEFT * len(logs) * (weights**2).sum(axis=0)

    low, high = power.copy(), np.ones_like(power)
    whole = enough(high)
    for _ in range(60):
        # The power begins at 0, and small ones are many: halve the logarithm there.
        middle = np.where(low > 0, 0.5 * (low + high), high / 16.0)
        good = enough(middle)
        low, high = np.where(good, middle, low), np.where(good, high, middle)
    return np.where(whole, 1.0, np.maximum(low, power))


def again(
    logs: Float[np.ndarray, "chains blocks"], rng: np.random.Generator
) -> Float[np.ndarray, "chains blocks"]:
    """Numbers of the draws that are taken again by weight, at evenly spaced places of its sum."""
    chains, blocks = logs.shape
    summed = np.cumsum(np.exp(logs - logs.max(axis=0)), axis=0)
    places = (np.arange(chains)[:, None] + rng.random(blocks)) / chains * summed[-1]
    return np.stack(
        [np.searchsorted(summed[:, b], places[:, b]) for b in range(blocks)], axis=1
    ).clip(0, chains - 1)


def rounded(
    draws: Float[np.ndarray, "*n blocks dims"], before: Float[Array, "blocks dims dims"]
) -> Float[Array, "blocks dims dims"]:
    """Root of the covariance of all draws; what was taken before counts as a few."""
    flat = np.asarray(draws, float).reshape(-1, *draws.shape[-2:])
    off = flat - flat.mean(axis=0)
    old = np.asarray(before, float)
    few = 2.0 * flat.shape[-1]
    found = np.einsum("nbi,nbj->bij", off, off) + few * old @ np.swapaxes(old, 1, 2)
    return jnp.asarray(np.linalg.cholesky(found / (len(flat) + few)))


def run_hamiltonian(problem: Problem, approximation: Laplace, options: Sampling) -> Chain:
    """Sample a problem.

    Args:
        problem: what is sampled.
        approximation: to it, from which every tenth step is proposed.
        options: steps of each chain after the warm-up, how many chains, and the rest.

    Raises:
        ValueError: a file whose chain is of another problem, or nothing was kept.
        FileExistsError: there is such a file, and neither `resume` nor `overwrite` was asked for.
        FileNotFoundError: `resume` was, and there is none.
    """
    chains = options.walkers_for(problem.dims)
    kept = DrawsFile.open(problem.fingerprint, (chains, len(problem.blocks), problem.dims), options)
    sampler = _Sampler(problem, approximation, options)
    with gentle_interrupt() as asked:
        if kept.steps == 0:
            begun = _begin(sampler, chains, asked.is_set, options.progress)
            if begun is None:
                return kept.chain(interrupted=True)
            here, tuning = begun
        else:
            here, tuning = (
                Here(*map(jnp.asarray, kept.here)),
                Tuning(*map(jnp.asarray, kept.tuning)),
            )
        ones = np.ones(len(problem.blocks))
        while kept.steps < options.length and not asked.is_set():
            count = min(_PIECE, options.length - kept.steps)
            span = Span(_SAMPLING + kept.steps, count, ones, learning=False, most=_MOST)
            here, tuning, piece = sampler.steps(here, tuning, span)
            kept.add(piece.free[:count], piece.height[:count], float(piece.accepted), here, tuning)
            options.progress(kept.steps, options.length, "sampling")
    return kept.chain(interrupted=kept.steps < options.length)


def _begin(
    sampler: _Sampler, chains: int, stop: Callable[[], bool], progress: Progress
) -> tuple[Here, Tuning] | None:
    """Chains that begin at draws of the posterior; None if they were stopped on the way."""
    here, tuning = sampler.first(chains)
    done = 0
    for _ in range(_MOST_RISES):
        here, tuning = sampler.rise(here, tuning)
        span = Span(done, _MOVES, sampler.power, learning=True, most=_MOST_ON_THE_WAY)
        here, tuning, _ = sampler.steps(here, tuning, span)
        done += _MOVES
        progress(done, None, "leading draws to the posterior")
        if stop():
            return None
        if np.all(sampler.power == 1.0):
            break
    for window in _WARM_UP:
        span = Span(done, window, sampler.power, learning=True, most=_MOST)
        here, tuning, piece = sampler.steps(here, tuning, span)
        tuning = tuning._replace(root=rounded(np.asarray(piece.free[:window]), tuning.root))
        done += window
        if stop():
            return None
    span = Span(done, _MOVES, sampler.power, learning=True, most=_MOST)
    here, tuning, _ = sampler.steps(here, tuning, span)
    return here, tuning
