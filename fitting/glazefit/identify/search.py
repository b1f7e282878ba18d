"""From spectra to a pool of fitted candidates: screen, fit, grow, fit, and stack."""

from dataclasses import replace
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from ..film.errors import (
    Whitening,
    model_covariance,
    noise_covariance,
    paints_covariance,
    whiten,
)
from .fit import LEAST, MOST, Fitted, Weights, coat_slopes, fit_sets
from .result import NOBODY, Pool
from .screen import (
    WhitenedSpectra,
    amounts_grid,
    grow,
    score,
    screen,
    sets_of,
    unique_best,
)
from .task import TYPICAL_READING, IdentificationTask, Measured
from .two_coats import fit_stacks, orders, stack_slopes, stack_starts

CHUNK = 16
"""Spectra that are fitted at a time."""

_SCREENED = 256
_KEPT_PAIRS, _GROWN_PAIRS, _KEPT_TRIPLES, _STACKED = 40, 12, 40, 8
_ROUNDS = 2
# What counts as near when amounts are shown: near black, and for each unit of reflectance.
_NEAR, _NEAR_SHARE = 0.005, 0.02
# Error while candidates are looked for, at a reading of 0 over that at a middling one.
_DARK = 0.1
# Candidates fitted with errors of their own, and again, by the largest size of a set.
_REFINED = {1: (8, 3), 2: (12, 4), 3: (20, 6)}
# Grounds that differ by less share a screening; each film is then fitted with its own.
_ALIKE = 0.04


def pieces(rows: Int[np.ndarray, "rows"], size: int = CHUNK) -> list[Int[np.ndarray, "some"]]:
    """The rows in order, so many at a time."""
    return np.split(rows, range(size, len(rows), size))


class SetStarts(NamedTuple):
    """Sets of one size and where to start them."""

    sets: Int[np.ndarray, "spectra sets size"]
    logs: Float[np.ndarray, "spectra sets size"]


def weights_of(task: IdentificationTask, some: Measured, errors: Whitening) -> Weights:
    """Errors and prior of some spectra, or of some candidates for each, which the errors' leading axes say."""
    batch = errors.height.shape[:-1]
    target = task.target(some.readings).reshape(len(some), *[1] * (len(batch) - 1), -1)
    target = np.broadcast_to(target, (*batch, target.shape[-1]))
    freedom = task.discrepancy.freedom or 0.0
    numbers = (task.prior.spread, task.prior.concentration, freedom, min(independent(task), target.shape[-1]))
    alike = [np.full(batch, value) for value in numbers]
    parts = (target, errors.basis, errors.height, *alike)
    return Weights(*(jnp.asarray(a, float) for a in parts))


def independent(task: IdentificationTask) -> float:
    """Readings that count as independent where candidates are weighed; see `Discrepancy.apart`."""
    return max(float(np.ptp(task.wavelengths)) / task.discrepancy.apart, 1.0)


def alike_errors(task: IdentificationTask, some: Measured) -> Whitening:
    """Errors while candidates are looked for: the same for all candidates of a spectrum."""
    d = task.discrepancy
    # Smaller on dark films, whose readings differ by little.
    off = d.screening * (_DARK + some.readings.reshape(len(some), -1) / TYPICAL_READING)
    model = model_covariance(task.wavelengths, some.readings.shape[1], d, off)
    fixed = fixed_errors(task, some, some.noise_sd)
    return whiten(fixed, np.broadcast_to(model, fixed.shape), d)


def fixed_errors(
    task: IdentificationTask, some: Measured, noise_sd: Float[np.ndarray, "spectra grounds bands"]
) -> Float[np.ndarray, "spectra readings readings"]:
    """Covariance of noise, of the surface's reflection and of what else is in doubt about the readings."""
    doubt = some.doubt.reshape(*some.doubt.shape[:2], some.readings[0].size)
    return noise_covariance(noise_sd, task.surface, task.discrepancy) + np.swapaxes(doubt, 1, 2) @ doubt


def own_errors(
    task: IdentificationTask,
    some: Measured,
    sets: Int[np.ndarray, "spectra sets size"],
    slopes: Float[np.ndarray, "spectra sets errors readings"],
) -> Whitening:
    """Errors of each candidate, from what its paints' coefficients do to the readings."""
    d = task.discrepancy
    off = d.amplitude + d.share * some.readings.reshape(len(some), -1)
    model = model_covariance(task.wavelengths, some.readings.shape[1], d, off)[:, None]
    fixed = fixed_errors(task, some, some.noise_sd)[:, None]
    scaled = model + paints_covariance(slopes, sets, task.errors, task.modes, task.wavelengths, d)
    return whiten(np.broadcast_to(fixed, scaled.shape), scaled, d)


def first_starts(task: IdentificationTask, measured: Measured) -> list[SetStarts]:
    """Sets of one paint and the best of two for every spectrum, from the screening."""
    kinds = []
    for size in range(1, min(task.max_paints, 2) + 1):
        sets = sets_of(task.known, size)
        keep = min(len(sets), _KEPT_PAIRS) if size == 2 else len(sets)
        chosen = np.empty((len(measured), keep, size), dtype=np.int32)
        logs = np.empty(chosen.shape)
        kinds.append((sets, amounts_grid(size, task.prior.spread), SetStarts(chosen, logs)))
    white = jnp.asarray(task.common_whitening(measured.readings.shape[1]), float)
    target = task.target(measured.readings) @ np.asarray(white).T
    for rows, ground in alike_grounds(measured.grounds):
        for first in range(0, len(rows), _SCREENED):
            some = rows[first : first + _SCREENED]
            # Padded to one of two sizes, so that little is compiled.
            padded = np.resize(some, 1 if len(some) == 1 else CHUNK if len(some) <= CHUNK else _SCREENED)
            search = WhitenedSpectra(jnp.asarray(target[padded], float), white, jnp.asarray(ground, float))
            for sets, grid, start in kinds:
                cost, where = screen(task.response, task.paints, jnp.asarray(sets), jnp.asarray(grid, float), search)
                best = np.argsort(np.asarray(cost)[: len(some)], axis=1)[:, : start.sets.shape[1]]
                start.sets[some] = sets[best]
                start.logs[some] = np.log(grid[np.take_along_axis(np.asarray(where)[: len(some)], best, axis=1)])
    return [start for _, _, start in kinds]


def alike_grounds(
    grounds: Float[np.ndarray, "spectra grounds bands"],
) -> list[tuple[Int[np.ndarray, "rows"], Float[np.ndarray, "grounds bands"]]]:
    """Groups of spectra with nearly the same grounds: their numbers and their mean ground."""
    left, groups = np.arange(len(grounds)), []
    while left.size:
        near = np.abs(grounds[left] - grounds[left[0]]).max(axis=(1, 2)) < _ALIKE
        groups.append((left[near], grounds[left[near]].mean(axis=0)))
        left = left[~near]
    return groups


def search_chunk(
    task: IdentificationTask, measured: Measured, rows: Int[np.ndarray, "rows"], starts: list[SetStarts]
) -> Pool:
    """Fitted candidates of some spectra, at most `CHUNK`."""
    # Few sizes, so that little is compiled.
    padded = np.resize(rows, CHUNK if len(rows) > 1 else 1)
    some = measured.take(padded)
    ground = jnp.asarray(some.grounds, float)
    weights = weights_of(task, some, alike_errors(task, some))
    pool: Pool | None = None
    last = None
    for start in starts:
        start = SetStarts(start.sets[padded], start.logs[padded])
        last = start.sets, _fit(task, start, ground, weights)
        pool = _add(pool, _pool(task, *last))
    assert pool is not None
    assert last is not None
    if task.max_paints == 3 and task.known >= 3:
        start, new = _grown(task, *last, some.readings, ground)
        triples = _pool(task, start.sets, _fit(task, start, ground, weights))
        triples.log_weight[~new] = -np.inf
        pool = pool.merged(triples)
    looked_at = pool
    pool = _nearest(task, _refined(task, pool, some, ground), some, ground)
    if task.layers == 2 and task.max_paints > 1 and task.known > 1:
        pool = _stacked(task, pool, looked_at, some, ground, weights)
    return _with_surface(task, pool.of(np.arange(len(rows))), measured.take(rows))


def _with_surface(task: IdentificationTask, pool: Pool, some: Measured) -> Pool:
    """The pool with readings as they are seen, and amounts in metres.

    The surface's share, and what else is in doubt, is what each candidate's residual speaks for.
    """
    d, count = task.discrepancy, len(some)
    surface = np.full((count, 1, some.readings[0].size), d.gloss_sd * task.surface)
    shapes = np.concatenate([surface, some.doubt.reshape(count, some.doubt.shape[1], surface.shape[-1])], axis=1)
    off = task.target(some.readings)[:, None] - pool.readings
    # Ridge regression on the shapes: unit sd beforehand, errors that are not alike at neighbouring bands.
    precise = shapes / near_sd(some).reshape(count, 1, -1) ** 2
    normal = precise @ np.swapaxes(shapes, 1, 2) + np.eye(shapes.shape[1])
    found = np.linalg.solve(normal, np.einsum("smr,scr->smc", precise, off))
    gloss = np.maximum(d.gloss + d.gloss_sd * found[:, 0], 0.0)
    seen = pool.readings + gloss[..., None] * task.surface + np.einsum("smc,smr->scr", found[:, 1:], shapes[:, 1:])
    allowed = pool.allowed + d.gloss * task.surface
    return replace(pool, readings=seen, allowed=allowed, gloss=gloss, logs=pool.logs + np.log(task.prior.thickness))


def _refined(task: IdentificationTask, pool: Pool, some: Measured, ground: jax.Array) -> Pool:
    """The best of the pool fitted again with errors of each candidate's own, and the very best once more."""
    many, few = _REFINED[task.max_paints]
    pool = _refit(task, pool.best(many), some, ground)
    order = np.argsort(-pool.log_weight, axis=1, kind="stable")
    return _refit(task, pool.take(order[:, :few]), some, ground).merged(pool.take(order[:, few:]))


def _nearest(task: IdentificationTask, pool: Pool, some: Measured, ground: jax.Array) -> Pool:
    """The pool with amounts that come near the readings, as a mixture is shown.

    With errors of its paints' coefficients allowed, the most probable amounts may leave to those errors what other
    amounts would meet: probabilities follow from that, but nobody would mix it.
    """
    d = task.discrepancy
    # Errors that are not alike at neighbouring bands: a smooth one would be excused.
    noise = fixed_errors(task, some, near_sd(some))
    near = weights_of(task, some, whiten(noise, np.zeros_like(noise), d))
    sets, logs = _sets_and_logs(pool)
    moved = _moved(pool, fit_sets(task.response, task.paints, sets, logs, ground, near, task.middle))
    slopes = np.asarray(coat_slopes(task.response, task.paints, *_sets_and_logs(moved), ground))
    return _with_allowance(task, moved, some, slopes)


def _with_allowance(task: IdentificationTask, pool: Pool, some: Measured, slopes: np.ndarray) -> Pool:
    """The pool with readings moved as the errors of its paints' coefficients most probably move them to what was seen.

    A film of the right paints is met once these are allowed for; one of others is not.
    """
    told = replace(task.discrepancy, coefficient=0.0, level=0.0)
    free = (
        paints_covariance(
            slopes, pool.members[..., : slopes.shape[2] // 2], task.errors, task.modes, task.wavelengths, told
        )
        + fixed_errors(task, some, np.zeros_like(some.noise_sd))[:, None]
    )
    near = near_sd(some).reshape(len(some), 1, -1) ** 2
    off = task.target(some.readings)[:, None] - pool.readings
    pull = np.linalg.solve(free + near[..., None] * np.eye(near.shape[-1]), off[..., None])
    return replace(pool, allowed=pool.readings + (free @ pull)[..., 0])


def near_sd(some: Measured) -> Float[np.ndarray, "spectra grounds bands"]:
    """What counts as near to each reading when amounts and gloss are shown."""
    return np.hypot(some.noise_sd, _NEAR + _NEAR_SHARE * some.readings)


def _refit(task: IdentificationTask, pool: Pool, some: Measured, ground: jax.Array) -> Pool:
    """All of a pool, with the errors that its paints' coefficients cause where it stands."""
    sets, logs = _sets_and_logs(pool)
    slopes = np.asarray(coat_slopes(task.response, task.paints, sets, logs, ground))
    weights = weights_of(task, some, own_errors(task, some, pool.members, slopes))
    fitted = fit_sets(task.response, task.paints, sets, logs, ground, weights, task.middle, own=True)
    # What was struck out stays so.
    evidence = task.discrepancy.trust * np.asarray(fitted.log_evidence)
    weight = np.where(np.isfinite(pool.log_weight), evidence + task.log_sets(pool.members), -np.inf)
    spread = np.where(absent_pairs(pool.members), 0.0, np.asarray(fitted.covariance))
    return replace(_moved(pool, fitted), covariance=spread, log_weight=weight)


def _sets_and_logs(pool: Pool) -> tuple[jax.Array, jax.Array]:
    """Paints and log amounts of a pool, as a fit starts from them."""
    return jnp.asarray(pool.members), jnp.asarray(np.where(pool.members == NOBODY, 0.0, pool.logs), float)


def _moved(pool: Pool, fitted: Fitted) -> Pool:
    """The pool with the amounts and readings of a fit."""
    logs = np.where(pool.members == NOBODY, -np.inf, np.asarray(fitted.logs))
    return replace(pool, logs=logs, readings=np.asarray(fitted.readings))


def absent_pairs(members: Int[np.ndarray, "*n 3"]) -> Bool[np.ndarray, "*n 3 3"]:
    """Where a covariance belongs to a paint that is not there."""
    absent = members == NOBODY
    return absent[..., :, None] | absent[..., None, :]


def _add(pool: Pool | None, more: Pool) -> Pool:
    return more if pool is None else pool.merged(more)


def _fit(task: IdentificationTask, start: SetStarts, ground: jax.Array, weights: Weights) -> Fitted:
    logs = jnp.asarray(np.clip(start.logs, np.log(LEAST), np.log(MOST)), float)
    return fit_sets(task.response, task.paints, jnp.asarray(start.sets), logs, ground, weights, task.middle)


def _pool(
    task: IdentificationTask, sets: np.ndarray, fitted: Fitted, coats: np.ndarray | None = None, log_share: float = 0.0
) -> Pool:
    """Fitted candidates with room for three paints each."""
    size = sets.shape[-1]
    room = ((0, 0), (0, 0), (0, 3 - size))
    where = np.zeros_like(sets) if coats is None else coats
    return Pool(
        np.pad(sets, room, constant_values=NOBODY),
        np.pad(where, room),
        np.pad(np.asarray(fitted.logs), room, constant_values=-np.inf),
        np.pad(np.asarray(fitted.covariance), (*room, (0, 3 - size))),
        task.discrepancy.trust * np.asarray(fitted.log_evidence) + task.log_sets(sets) + log_share,
        np.asarray(fitted.readings),
        np.asarray(fitted.readings),
        np.zeros(sets.shape[:2]),
        np.zeros(sets.shape[:2], dtype=np.int32),
    )


def _grown(
    task: IdentificationTask, pairs: np.ndarray, fitted: Fitted, readings: np.ndarray, ground: jax.Array
) -> tuple[SetStarts, Bool[np.ndarray, "spectra sets"]]:
    """Sets of three from the most probable pairs, and whether each is the first of its kind."""
    rows = np.arange(len(pairs))[:, None]
    best = np.argsort(-np.asarray(fitted.log_evidence), axis=1)[:, :_GROWN_PAIRS]
    amounts = np.exp(np.asarray(fitted.logs))[rows, best]
    sets, tries = grow(pairs[rows, best], amounts, task.known)
    white = task.common_whitening(readings.shape[1])
    target = task.target(readings) @ white.T
    given = (jnp.asarray(a, float) for a in (tries, ground, target, white))
    cost, where = (np.asarray(a) for a in score(task.response, task.paints, jnp.asarray(sets), *given))
    keep = min(_KEPT_TRIPLES, len(sets_of(task.known, 3)))
    # Pairs that overlap can give fewer sets than wanted: then some come twice.
    found = [unique_best(s, c, keep) for s, c in zip(sets, cost, strict=True)]
    chosen = np.stack([np.resize(numbers, keep) for numbers in found])
    new = np.arange(keep) < np.asarray([len(numbers) for numbers in found])[:, None]
    logs = np.log(np.take_along_axis(tries, where[..., None, None], axis=2)[:, :, 0])
    return SetStarts(sets[rows, chosen], logs[rows, chosen]), new


def _stacked(
    task: IdentificationTask, pool: Pool, looked_at: Pool, some: Measured, ground: jax.Array, weights: Weights
) -> Pool:
    """The pool with the best sets of two and three paints that were looked at as two coats too."""
    pool.log_weight[(pool.members != NOBODY).sum(axis=-1) > 1] += np.log1p(-task.prior.stacked)
    size = (looked_at.members != NOBODY).sum(axis=-1)
    for paints in range(2, task.max_paints + 1):
        ways = orders(paints)
        weight = np.where(size == paints, looked_at.log_weight, -np.inf)
        keep = min(_STACKED if paints == 2 else _STACKED // 2, int((size == paints).sum(axis=1).min()))
        best = np.argsort(-weight, axis=1)[:, :keep]
        sets = np.take_along_axis(looked_at.members, best[..., None], axis=1)[..., :paints]
        sets = np.repeat(sets, len(ways), axis=1)
        coats = np.broadcast_to(np.tile(ways, (keep, 1)), sets.shape)
        fitted, slopes = _fit_stacks(task, sets, coats, some, ground, weights)
        stacks = _pool(task, sets, fitted, coats, np.log(task.prior.stacked / len(ways)))
        stacks = _with_allowance(task, stacks, some, slopes)
        struck = ~np.isfinite(np.take_along_axis(weight, best, axis=1))
        stacks.log_weight[np.repeat(struck, len(ways), axis=1)] = -np.inf
        pool = pool.merged(stacks)
    return pool


def _fit_stacks(
    task: IdentificationTask,
    sets: np.ndarray,
    coats: np.ndarray,
    some: Measured,
    ground: jax.Array,
    weights: Weights,
) -> tuple[Fitted, np.ndarray]:
    """Stacks with errors of their own, and slopes near the fit."""
    films = task.paints, jnp.asarray(sets), jnp.asarray(coats)
    logs = stack_starts(*films, ground, weights, task.optics, task.middle)
    fitted, slopes = None, None
    for _ in range(_ROUNDS):
        slopes = np.asarray(stack_slopes(*films, logs, ground, task.optics))
        own = weights_of(task, some, own_errors(task, some, sets, slopes))
        fitted = fit_stacks(*films, logs, ground, own, task.optics, task.middle)
        logs = fitted.logs
    assert fitted is not None
    assert slopes is not None
    return fitted, slopes
