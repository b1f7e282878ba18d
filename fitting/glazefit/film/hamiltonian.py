"""Sampling with gradients: Hamiltonian Monte Carlo, all chains of all blocks in one compiled
program.

A posterior may be a bent sheet, a thousandth as thick as long: readings are good to a thousandth,
an opaque coat decides only k/s, and how far the next place is that reads the same differs by orders
of magnitude along the sheet. Steps of one size for all directions and places either leave the sheet
or stand still. So steps are taken on the graph of the scaled readings: a place is the unknowns
free, together with what would be read there in units of its error, e(free) (`FilmProblem.scaled`),
and a root of the prior's precision. Distances on that graph have the metric

    G = J^T J,   J the slopes of e,

in which the posterior is about as wide everywhere, in every direction. A step of length h pushes
the momentum p by half of h times the slope of log posterior - log det(G) / 2, looks for the place
free' on the graph with

    J(free)^T (e(free') - e(free)) = h p,

by Newton's method, and has the new momentum J(free')^T (e(free') - e(free)) / h, pushed once more.
That is the constrained leapfrog step RATTLE written for a graph; it keeps volumes and can be
reversed. A trajectory where Newton's method finds no place, or another one on its way back, is
refused.

Where there are no scaled readings, e is linear and G the same everywhere; the step is then the
usual leapfrog step.

Each move is a trajectory of up to half a turn, so that no direction comes back to where it began
(Neal 2011, Handbook of Markov Chain Monte Carlo, chapter 5). Steps are as long as keeps seven in
ten trajectories. Chains begin at the modes that least squares found, by their shares. Every tenth
move is a draw from Laplace's Gaussians instead, taken or refused by Metropolis and Hastings: it
goes between modes that are far apart.

Sources: K. X. Au, M. M. Graham and A. H. Thiery, J. R. Stat. Soc. B 85 (2023) 757, for thin
posteriors as manifolds; E. Zappa, M. Holmes-Cerf and J. Goodman, Comm. Pure Appl. Math. 71 (2018)
2609, for the check of the way back; M. Girolami and B. Calderhead, J. R. Stat. Soc. B 73 (2011)
123, for the metric.
"""

import functools
import threading
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from glazejax.programs import Program
from glazejax.radiative.common.linalg import solve_positive

from .forward import PerUnknown, Scalar, Terms
from .numerics.weighted import numbers_at
from .problem import Draws, FilmProblem, block_log_probability
from .sampling import Sampling
from .solve import Gaussians, Laplace

# Steps between two looks at the keyboard and the file.
_PIECE = 50
# Number of the first step after the warm-up, beyond any of it.
_SAMPLED = 100_000


class Here(NamedTuple):
    """A place on the graph of the scaled readings."""

    free: Float[Array, "*chains dims"]
    scaled: Float[Array, "*chains rows"]
    slopes: Float[Array, "*chains rows dims"]  # of the scaled readings by the unknowns
    inverse: Float[Array, "*chains dims dims"]  # of the metric
    height: Float[Array, "*chains"]  # log posterior
    potential: Float[Array, "*chains"]  # log det(metric) / 2 - log posterior
    pull: Float[Array, "*chains dims"]  # minus its slope


class Chains(NamedTuple):
    """All chains: where they are, and how those of each block step."""

    free: Float[Any, "chains blocks dims"]
    root: Float[Any, "blocks dims dims"]  # the metric's own part is root^T root
    log_step: Float[Any, "blocks"]


class Graph(NamedTuple):
    """One block's posterior and the graph of its scaled readings."""

    residuals: Any
    scaled: Any
    data: Any
    shared: Any
    root: Float[Array, "dims dims"]

    def lift(self, free: PerUnknown) -> Terms:
        """Scaled readings and unknowns: the coordinates in which distances are measured."""
        scaled = self.root @ free
        if self.scaled is None:
            return scaled
        return jnp.concatenate([self.scaled(free, self.data, self.shared), scaled])

    def slopes(self, free: PerUnknown) -> Float[Array, "rows dims"]:
        """Of `lift`."""
        if self.scaled is None:
            return self.root
        scaled_slopes = getattr(self.scaled, "slopes", None)
        if scaled_slopes is None:
            return jax.jacfwd(self.lift)(free)
        return jnp.concatenate([scaled_slopes(free, self.data, self.shared), self.root])

    def at(self, free: PerUnknown) -> Here:
        """All that a step needs to know of a place."""
        slopes = self.slopes(free)
        root = jnp.linalg.cholesky(slopes.T @ slopes)
        inverse = jax.scipy.linalg.cho_solve((root, True), jnp.eye(len(free), dtype=free.dtype))
        volume = jnp.sum(jnp.log(jnp.diagonal(root)))
        # The slope of log det(J^T J) / 2 is that of the sum of J (J^T J)^-1 times J, the first
        # factor held.
        factor = slopes @ inverse

        def falling(free: PerUnknown) -> tuple[Array, Array]:
            height = block_log_probability(self.residuals, free, self.data, self.shared)
            if self.scaled is None:
                return -height, height
            return jnp.sum(factor * self.slopes(free)) - height, height

        downhill, height = jax.grad(falling, has_aux=True)(free)
        return Here(
            free=free,
            scaled=self.lift(free),
            slopes=slopes,
            inverse=inverse,
            height=height,
            potential=volume - height,
            pull=-downhill,
        )

    def move(
        self, origin: Here, push: PerUnknown, near: Scalar
    ) -> tuple[PerUnknown, Bool[Array, ""]]:
        """The place on the graph that a push along it leads to, and whether it was found."""

        def left(free: Array) -> tuple[Array, Array]:
            off = origin.slopes.T @ (self.lift(free) - origin.scaled) - push
            return off, jnp.sqrt(off @ origin.inverse @ off)

        def search(state: tuple) -> Array:
            _, _, size, before, count = state
            # Where it does not come nearer, or not in ten steps, it will not arrive.
            return (size > near) & (size < before) & (count < 10)

        def newton(state: tuple) -> tuple:
            free, off, size, _, count = state
            across = origin.slopes.T @ self.slopes(free)
            free = free - solve_positive(across, off[:, None])[:, 0]
            return free, *left(free), size, count + 1

        first = origin.free + origin.inverse @ push
        if self.scaled is None:
            return first, jnp.all(jnp.isfinite(first))
        start = (first, *left(first), jnp.inf, 0)
        solution, _, size, _, _ = jax.lax.while_loop(search, newton, start)
        # What overflows is no number, and no place.
        return solution, size <= near


class Flight(NamedTuple):
    """A trajectory under way, between two of its places."""

    before: Here
    free: PerUnknown  # where it is now
    momentum: PerUnknown  # where it was
    first: Scalar  # energy at the start
    reversible: Bool[Array, ""]  # whether all of its steps can be reversed
    visited: Array  # places


def _energy(state: Here, momentum: PerUnknown) -> Scalar:
    return state.potential + 0.5 * momentum @ state.inverse @ momentum


def _trajectory(
    graph: Graph, free: PerUnknown, log_step: Scalar, key: Array
) -> tuple[PerUnknown, Scalar, Scalar]:
    """End of a trajectory of one chain, the log posterior there, and by how much its energy has
    fallen.
    """
    length, shorter, kick = jax.random.split(key, 3)
    dtype = free.dtype
    # Steps of one trajectory are half of the longest or more; it is half a turn at most.
    step = jnp.exp(log_step) * jax.random.uniform(shorter, (), dtype, 0.5, 1.0)
    turn = np.pi * jax.random.uniform(length, (), dtype)
    # Steps of a metric that is the same everywhere cost a tenth.
    most = 32 if graph.scaled is None else 12
    number = jnp.clip(jnp.ceil(turn / step), 1, most)
    # No place, in the shape of one.
    place = jax.eval_shape(graph.at, free)
    start = jax.tree.map(jnp.zeros_like, place)
    noise = jax.random.normal(kick, place.scaled.shape, dtype)

    def going(flight: Flight) -> Array:
        return flight.reversible & (flight.visited <= number)

    def leap(flight: Flight) -> Flight:
        # All is computed once a place: programs take long to compile.
        before, state = flight.before, graph.at(flight.free)
        begins, ends = flight.visited == 0, flight.visited == number
        # The momentum here: of the step that led here and its second half push; at the start J^T
        # times independent normal numbers, whose covariance is the metric.
        arriving = state.slopes.T @ (state.scaled - before.scaled)
        momentum = arriving / step + 0.5 * step * state.pull
        momentum = jnp.where(begins, state.slopes.T @ noise, momentum)
        # The way back from here, and the next step, if there is one.
        back = jnp.where(begins, 0.0, -arriving)
        ahead = jnp.where(ends, 0.0, step * (momentum + 0.5 * step * state.pull))
        # How near Newton's method comes, in standard deviations of the posterior; on the way back
        # it is enough to see that it goes to the same place, within a hundredth.
        points, reached = jax.vmap(graph.move, (None, 0, 0))(
            state, jnp.stack([back, ahead]), jnp.array([1e-3, 1e-5])
        )
        missed = before.slopes @ (points[0] - before.free)
        same = begins | (jnp.sum(missed**2) < 0.01**2)
        return Flight(
            before=state,
            free=jnp.where(reached[1], points[1], state.free),
            momentum=momentum,
            first=jnp.where(begins, _energy(state, momentum), flight.first),
            reversible=reached.all() & same,
            visited=flight.visited + 1,
        )

    zero = jnp.zeros((), dtype)
    flight = Flight(start, free, jnp.zeros_like(free), zero, jnp.array(True), jnp.array(0))
    flight = jax.lax.while_loop(going, leap, flight)
    end = flight.before
    fallen = flight.first - _energy(end, flight.momentum)
    reversible = flight.reversible & ~jnp.isnan(fallen)
    return end.free, end.height, jnp.where(reversible, fallen, -jnp.inf)


@functools.partial(Program, fixed=("residuals", "scaled"))
def _steps(
    residuals: Any,
    scaled: Any,
    data: Any,
    shared: Any,
    laplace: Gaussians,
    key: Array,
    start: Chains,
    first: Array,
    count: Array,
) -> Draws:
    """So many steps, by number from the first, in arrays of `_PIECE`."""

    @functools.partial(jax.vmap, in_axes=(0, None))
    @jax.vmap
    def height_at(free: Array, data: Any) -> Array:
        return block_log_probability(residuals, free, data, shared)

    @functools.partial(jax.vmap, in_axes=(0, None, None, None, 0))
    @jax.vmap
    def wander(free: Array, data: Any, root: Array, log_step: Array, key: Array) -> Any:
        return _trajectory(Graph(residuals, scaled, data, shared, root), free, log_step, key)

    def trajectory(chains: Chains, height: Array, key: Array) -> tuple[Array, Array, Array]:
        keys = jax.random.split(key, height.shape)
        return wander(chains.free, data, chains.root, chains.log_step, keys)

    def jump(chains: Chains, height: Array, key: Array) -> tuple[Array, Array, Array]:
        free = laplace.draw(key, len(height)).astype(chains.free.dtype)
        end = height_at(free, data)
        # By Metropolis and Hastings: Laplace's density is that of the proposal.
        now, then = (laplace.log_density(jnp, f) for f in (chains.free, free))
        gain: Array = end - height + now - then
        return free, end, jnp.where(jnp.isnan(gain), -jnp.inf, gain)

    def one(i: Array, state: tuple[Chains, Array, Draws]) -> tuple[Chains, Array, Draws]:
        chains, height, draws = state
        number = first + i
        move, coin = jax.random.split(jax.random.fold_in(key, number))
        jumps = number % 10 == 9
        proposal: tuple[Array, Array, Array] = jax.lax.cond(
            jumps, jump, trajectory, chains, height, move
        )
        free, end, gain = proposal
        chance = jnp.minimum(1.0, jnp.exp(gain))
        takes = jax.random.uniform(coin, chance.shape, chance.dtype) < chance
        height = jnp.where(takes, end, height)
        better = chains.log_step + (chance.mean(axis=0) - 0.7) / (1.0 + 0.1 * i)
        learns = (number < _SAMPLED) & ~jumps
        chains = chains._replace(
            free=jnp.where(takes[..., None], free, chains.free),
            log_step=jnp.where(learns, better, chains.log_step),
        )
        draws = draws._replace(
            free=draws.free.at[i].set(chains.free),
            height=draws.height.at[i].set(height),
            accepted=draws.accepted + takes.mean(),
        )
        return chains, height, draws

    height = height_at(start.free, data)
    dtype = start.free.dtype
    empty = Draws(
        free=jnp.zeros((_PIECE, *start.free.shape), dtype),
        height=jnp.zeros((_PIECE, *height.shape), dtype),
        accepted=jnp.zeros((), dtype),
        state={},
    )
    chains, _, draws = jax.lax.fori_loop(0, count, one, (start, height, empty))
    return draws._replace(state=chains._asdict())


class Hamiltonian:
    """Chains of one problem, see `glazefit.film.sample.draw_chain`."""

    piece = _PIECE

    def __init__(self, problem: FilmProblem, approximation: Laplace, options: Sampling) -> None:
        """Of a problem and its approximation, at whose modes chains begin and from which every
        tenth step is proposed.
        """
        self.walkers = options.walkers_for(problem.dims)
        self._problem = problem
        self._approximation = approximation
        self._options = options

    def _run(self, chains: Chains, first: int, count: int) -> Draws:
        problem = self._problem
        draws = _steps(
            residuals=problem.residuals,
            scaled=problem.scaled,
            data=problem.data,
            shared=problem.shared,
            laplace=self._approximation.gaussians,
            key=jax.random.key(self._options.seed),
            start=jax.tree.map(jnp.asarray, chains),
            first=jnp.asarray(first),
            count=jnp.asarray(count),
        )
        return draws._replace(free=draws.free[:count], height=draws.height[:count])

    def steps(self, state: dict[str, Any], number: int, count: int) -> Draws:
        """So many steps after the first `number`."""
        return self._run(Chains(**state), _SAMPLED + number, count)

    def begin(self, asked: threading.Event) -> dict[str, Any]:
        """Chains after two windows in which steps, and the metric where it is the same everywhere,
        are learnt.
        """
        chains = self._first()
        for first, count in ((0, 20), (20, 40)):
            if not asked.is_set():
                draws = self._run(chains, first, count)
                chains = Chains(**draws.state)
                if self._problem.scaled is None:
                    chains = chains._replace(root=_metric_root(chains.root, draws.free))
                self._options.progress(first + count, 60, "warming up")
        return chains._asdict()

    def _first(self) -> Chains:
        """Chains at the modes, by their shares, with the prior's precision as the metric's own
        part; or, where the metric is the same everywhere, at draws of Laplace's Gaussians, with
        their precision.
        """
        approximation = self._approximation
        rng = np.random.default_rng(self._options.seed)
        blocks, _, dims = approximation.modes.shape
        prior = np.linalg.cholesky(np.linalg.inv(self._problem.prior_covariance)).T
        root = np.broadcast_to(prior, (blocks, dims, dims))
        log_step = np.full(blocks, np.log(0.3))
        if self._problem.scaled is None:
            root = _metric_root(root, approximation.gaussians.draws(500, rng))
            return Chains(approximation.gaussians.draws(self.walkers, rng), root, log_step)
        # Each mode has its part of the chains.
        places = (np.arange(self.walkers) + rng.random()) / self.walkers
        chosen = np.stack([numbers_at(shares, places) for shares in approximation.weights], axis=1)
        modes = np.swapaxes(approximation.modes, 0, 1)
        starts = np.take_along_axis(modes, chosen[..., None], 0)
        return Chains(starts, root, log_step)


def _metric_root(
    root: Float[Any, "blocks dims dims"], draws: Float[Any, "*n blocks dims"]
) -> Float[np.ndarray, "blocks dims dims"]:
    """Root of the metric in which draws are about round; the one before counts as a few draws."""
    flat = np.asarray(draws, float).reshape(-1, *draws.shape[-2:])
    off = flat - flat.mean(axis=0)
    before = np.linalg.inv(np.asarray(root, float))
    prior_count = 2.0 * flat.shape[-1]
    spread = np.einsum("nbi,nbj->bij", off, off) + prior_count * before @ np.swapaxes(before, 1, 2)
    return np.linalg.inv(np.linalg.cholesky(spread / (len(flat) + prior_count)))
