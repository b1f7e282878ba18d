"""Two coats: the best sets of paints, tried as one coat over another, in both orders, with the
solver itself.

The unknowns stay the amounts of the paints; only where each lies changes. A mixture's amounts start
no stack well, so each is tried at a coarse grid of amounts first.
"""

import functools
import itertools
from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from glazejax.programs import Program

from ...film.model.errors import whiten
from ...film.model.optics import Optics
from .chunk import Chunk
from .fit import Fitted, Weights, fit_one, pool_of
from .pool import NOBODY, Pool
from .refine import Groups, coefficient_errors, move_readings
from .table import Paints

_TOLERANCE = 1e-4
_SCREEN_TOLERANCE = 1e-2
# Log amounts of each paint that a stack starts from, about the set's usual thickness.
_STARTS = {2: np.log([0.03, 0.1, 0.3, 0.8, 2.0]), 3: np.log([0.05, 0.25, 1.0])}
_STACKED = 8
_ROUNDS = 2


def search_two_coats(chunk: Chunk, pool: Pool, ranked: Pool) -> Pool:
    """The pool with the best sets of two and three paints that were ranked as two coats too."""
    task = chunk.task
    errors = whiten(chunk.noise_covariance, chunk.ranking_covariance, task.discrepancy)
    weights = Weights(chunk.target, errors.basis, errors.height, *chunk.expectation)
    weights = jax.tree.map(jnp.asarray, weights)
    pool.log_weight[(pool.members != NOBODY).sum(axis=-1) > 1] += np.log1p(-task.prior.stacked)
    size = (ranked.members != NOBODY).sum(axis=-1)
    for paints in range(2, task.max_paints + 1):
        ways = orders(paints)
        weight = np.where(size == paints, ranked.log_weight, -np.inf)
        keep = min(
            _STACKED if paints == 2 else _STACKED // 2, int((size == paints).sum(axis=1).min())
        )
        best = np.argsort(-weight, axis=1)[:, :keep]
        sets = np.take_along_axis(ranked.members, best[..., None], axis=1)[..., :paints]
        sets = np.repeat(sets, len(ways), axis=1)
        coats = np.broadcast_to(np.tile(ways, (keep, 1)), sets.shape)
        logs = stack_starts(
            task.paints,
            jnp.asarray(sets),
            jnp.asarray(coats),
            jnp.asarray(chunk.spectra.grounds, float),
            weights,
            optics=task.optics,
            middle=task.middle,
        )
        share = float(np.log(task.prior.stacked / len(ways)))
        stacks = fit_with_own_errors(chunk, sets, coats, logs, share)
        struck = ~np.isfinite(np.take_along_axis(weight, best, axis=1))
        stacks.log_weight[np.repeat(struck, len(ways), axis=1)] = -np.inf
        pool = pool.merge(stacks)
    return pool


def orders(size: int) -> Int[np.ndarray, "orders size"]:
    """All ways to put paints in two coats, neither empty: 0 for the upper coat, 1 for the lower."""
    ways = [way for way in itertools.product((0, 1), repeat=size) if 0 < sum(way) < size]
    return np.asarray(ways, dtype=np.int32).reshape(-1, size)


def fit_with_own_errors(
    chunk: Chunk,
    sets: Int[np.ndarray, "spectra sets size"],
    coats: Int[np.ndarray, "spectra sets size"],
    logs: Float[Array | np.ndarray, "spectra sets size"],
    log_share: float = 0.0,
) -> Pool:
    """Stacks fitted with the errors of their own paints, as candidates.

    Args:
        chunk: spectra.
        sets: paints of each stack.
        coats: coat of each paint.
        logs: log amounts to start from.
        log_share: how probable this kind of stack is among its kinds.
    """
    task = chunk.task
    films = task.paints, jnp.asarray(sets), jnp.asarray(coats)
    ground = jnp.asarray(chunk.spectra.grounds, float)
    row = np.repeat(np.arange(len(chunk)), sets.shape[1])
    count = sets.shape[:2]
    target, *expected = (
        np.broadcast_to(part[:, None], (*count, *part.shape[1:]))
        for part in (chunk.target, *chunk.expectation)
    )

    def flat(array: np.ndarray) -> np.ndarray:
        return array.reshape(len(row), *array.shape[2:])

    at = jnp.asarray(logs)
    fitted: Any = None
    slopes = np.zeros(0)
    for _ in range(_ROUNDS):
        slopes = np.asarray(stack_slopes(*films, at, ground, task.optics))
        errors = coefficient_errors(chunk, row, flat(sets), flat(slopes))
        # Stacks are solved in double precision, errors may have been computed in single.
        basis, height = (
            np.asarray(a, float).reshape(*count, *a.shape[1:])
            for a in (errors.basis, errors.height)
        )
        own = jax.tree.map(jnp.asarray, Weights(target, basis, height, *expected))
        fitted = fit_stacks(*films, at, ground, own, task.optics, task.middle)
        at = fitted.logs
    stacks = pool_of(task, sets, fitted, coats, log_share)
    groups = Groups(np.arange(len(row)), row, flat(sets), flat(slopes))
    near = move_readings(chunk, row, flat(stacks.readings), groups)
    return replace(stacks, adjusted=near.reshape(stacks.readings.shape))


@functools.partial(Program, fixed=("optics", "middle"))
def stack_starts(
    paints: Paints,
    sets: Array,
    coats: Array,
    ground: Array,
    weights: Weights,
    optics: Optics,
    middle: int,
) -> Float[Array, "spectra sets size"]:
    """Log amounts to start stacks from: the best of a coarse grid. Arguments as of `fit_stacks`."""
    size = sets.shape[-1]
    places = jnp.asarray(list(itertools.product(_STARTS[size], repeat=size)))

    def start(members: Array, coats: Array, ground: Array, weights: Weights) -> Array:
        k = paints.absorption[members]
        s = paints.scattering[members]

        def coarse(logs: Array) -> Array:
            return stack_readings(
                k,
                s,
                coats,
                amounts=jnp.exp(logs),
                ground=ground,
                optics=optics,
                tolerance=_SCREEN_TOLERANCE,
            ).reshape(-1)

        white = weights.basis[middle]
        off = (weights.target - jax.vmap(coarse)(places)) @ white.T
        return places[jnp.argmin(jnp.sum(off**2, axis=-1))]

    over_sets = jax.vmap(start, in_axes=(0, 0, None, None))
    return jax.lax.map(lambda spectrum: over_sets(*spectrum), (sets, coats, ground, weights))


def stack_readings(
    k: Float[Array, "size bands"],
    s: Float[Array, "size bands"],
    coats: Int[Array, "size"],
    amounts: Float[Array, "size"],
    ground: Float[Array, "grounds bands"],
    optics: Optics,
    tolerance: float,
) -> Float[Array, "grounds bands"]:
    """What two coats read over each ground, without the surface's part.

    Args:
        k, s: optical thicknesses of the paints at the usual thickness.
        coats: where each paint lies, 0 above 1.
        amounts: of the paints.
        ground: internal reflectance.
        optics: cosines and index.
        tolerance: of the solver.
    """
    place = jnp.where(coats[:, None] == jnp.arange(2, dtype=coats.dtype), amounts[:, None], 0.0)
    layers_k = jnp.einsum("ml,mb->bl", place, k)
    layers_s = jnp.einsum("ml,mb->bl", place, s)
    return optics.body(layers_k, layers_s, ground, tolerance)


@functools.partial(Program, fixed=("optics",))
def stack_slopes(
    paints: Paints, sets: Array, coats: Array, logs: Array, ground: Array, optics: Optics
) -> Float[Array, "spectra sets errors readings"]:
    """Slopes of the readings by the log of every paint's k, then s, band by band; arguments as of
    `fit_stacks`.
    """
    size = sets.shape[-1]

    def candidate(members: Array, coats: Array, logs: Array, ground: Array) -> Array:
        both = jnp.stack([paints.absorption[members], paints.scattering[members]])

        # Bands do not meet, so that one tangent moves a coefficient in all of them at once.
        def read_film(errors: Array) -> Array:
            k, s = both * (1.0 + errors[..., None])
            return stack_readings(
                k,
                s,
                coats,
                amounts=jnp.exp(logs),
                ground=ground,
                optics=optics,
                tolerance=_TOLERANCE,
            ).reshape(-1)

        return jax.jacfwd(read_film)(jnp.zeros((2, size))).reshape(-1, 2 * size).T

    over_sets = jax.vmap(candidate, in_axes=(0, 0, 0, None))
    return jax.lax.map(lambda spectrum: over_sets(*spectrum), (sets, coats, logs, ground))


@functools.partial(Program, fixed=("optics", "middle"))
def fit_stacks(
    paints: Paints,
    sets: Array,
    coats: Array,
    starts: Array,
    ground: Array,
    weights: Weights,
    optics: Optics,
    middle: int,
) -> Fitted:
    """Fit candidates of two coats, each with weights of its own.

    Args:
        paints: of the catalogue.
        sets: paints of each candidate, (spectra, sets, size).
        coats: coat of each paint, (spectra, sets, size).
        starts: log amounts, (spectra, sets, size).
        ground: internal reflectance, (spectra, grounds, bands).
        weights: of each candidate.
        optics: cosines and index.
        middle: scale of the discrepancy that is fitted with.
    """
    size = sets.shape[-1]

    def candidate(
        members: Array, coats: Array, start: Array, ground: Array, weights: Weights
    ) -> Fitted:
        k = paints.absorption[members]
        s = paints.scattering[members]

        def read_film(amounts: Array) -> Array:
            return stack_readings(
                k, s, coats, amounts=amounts, ground=ground, optics=optics, tolerance=_TOLERANCE
            ).reshape(-1)

        def model(amounts: Array) -> tuple[Array, Array]:
            readings, push = jax.linearize(read_film, amounts)
            return readings, jax.vmap(push)(jnp.diag(amounts))

        return fit_one(model, start, jnp.ones(size, bool), weights, middle)

    over_sets = jax.vmap(candidate, in_axes=(0, 0, 0, None, 0))
    return jax.lax.map(
        lambda spectrum: over_sets(*spectrum), (sets, coats, starts, ground, weights)
    )
