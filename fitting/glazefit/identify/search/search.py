"""From spectra to a pool of fitted candidates: screen, fit, grow, fit, and stack."""

from dataclasses import replace
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from glazejax.radiative.common.threads import in_threads

from ...film.errors import Whitening, model_covariance, whiten
from ..result import NOBODY, Pool
from .coefficient_errors import (
    Groups,
    coefficient_errors,
    fixed_errors,
    move_readings,
    near_sd,
    refine,
    weights_of,
)
from .fit import LEAST, MOST, Fitted, Weights, fit_sets, programs_ahead
from .screen import grow, score, sets_of, unique_best
from .table import ALIKE, TableOfSize
from .task import TYPICAL_READING, IdentificationTask, Measured
from .two_coats import fit_stacks, orders, stack_slopes, stack_starts

CHUNK = 64
"""Spectra that are fitted at a time."""

_GROWN_PAIRS = 12
_KEPT_TRIPLES = 40
_STACKED = 8
_ROUNDS = 2
# Error while candidates are looked for, at a reading of 0 over that at a middling one.
_DARK = 0.1


def pieces(rows: Int[np.ndarray, "rows"], size: int = CHUNK) -> list[Int[np.ndarray, "some"]]:
    """The rows in order, so many at a time."""
    return np.split(rows, range(size, len(rows), size))


class SetStarts(NamedTuple):
    """Sets and where to start them; those of fewer paints are filled up with `NOBODY`."""

    sets: Int[np.ndarray, "spectra sets size"]
    logs: Float[np.ndarray, "spectra sets size"]


def alike_errors(
    task: IdentificationTask,
    batch: Measured,
    project: Float[np.ndarray, "components readings"] | None = None,
) -> Whitening:
    """Errors while candidates are looked for: the same for all candidates of a spectrum; of
    components if given.
    """
    d = task.discrepancy
    # Smaller on dark films, whose readings differ by little.
    off = d.screening * (_DARK + batch.readings.reshape(len(batch), -1) / TYPICAL_READING)
    model = model_covariance(task.wavelengths, batch.readings.shape[1], d, off)
    fixed = fixed_errors(task, batch, batch.noise_sd)
    if project is None:
        return whiten(fixed, np.broadcast_to(model, fixed.shape), d)
    fixed, model = (project @ np.broadcast_to(a, fixed.shape) @ project.T for a in (fixed, model))
    few = whiten(fixed, model, d)
    return Whitening(few.basis @ project, few.height)


def first_starts(task: IdentificationTask, measured: Measured) -> SetStarts:
    """Sets of one paint and the best of two for every spectrum, from the screening."""
    found: list[tuple[np.ndarray, np.ndarray]] = []
    for rows, ground in alike_grounds(measured.grounds):
        table = task.films_over(ground)
        kinds = table.nearest(task.target(measured.readings[rows]))
        parts = [
            _best_starts(kind, *near, task.effort.fitted_pairs)
            for kind, near in zip(table.sizes, kinds, strict=True)
        ]
        found.append((rows, np.concatenate(parts, axis=1)))
    order = np.argsort(np.concatenate([rows for rows, _ in found]))
    both = np.concatenate([part for _, part in found])[order]
    size = both.shape[-1] // 2
    return SetStarts(both[..., :size].astype(np.int32), both[..., size:])


def _best_starts(
    kind: TableOfSize,
    cost: Float[np.ndarray, "spectra sets"],
    where: Int[np.ndarray, "spectra sets"],
    pairs: int,
) -> Float[np.ndarray, "spectra kept four"]:
    """Members and log amounts of the sets of one size that are kept, side by side."""
    keep = len(kind.sets) if kind.sets.shape[1] == 1 else min(len(kind.sets), pairs)
    best = np.argsort(cost, axis=1, kind="stable")[:, :keep]
    logs = np.log(kind.grid[np.take_along_axis(where, best, axis=1)])
    room = ((0, 0), (0, 0), (0, 2 - kind.sets.shape[1]))
    members = np.pad(kind.sets[best], room, constant_values=NOBODY)
    return np.concatenate([members, np.pad(logs, room)], axis=-1)


def alike_grounds(
    grounds: Float[np.ndarray, "spectra grounds bands"],
) -> list[tuple[Int[np.ndarray, "rows"], Float[np.ndarray, "grounds bands"]]]:
    """Groups of spectra with nearly the same grounds: their numbers and their mean ground."""
    left = np.arange(len(grounds))
    groups = []
    while left.size:
        near = np.abs(grounds[left] - grounds[left[0]]).max(axis=(1, 2)) < ALIKE
        groups.append((left[near], grounds[left[near]].mean(axis=0)))
        left = left[~near]
    return groups


def compile_ahead(task: IdentificationTask, measured: Measured) -> None:
    """Begin to compile the programs of the search's later steps; return at once."""
    grounds, bands = measured.readings.shape[1:]
    films = (task.response, task.paints)
    scales = len(task.discrepancy.scales)
    largest = max(task.max_paints, 2)
    middle = task.middle
    programs_ahead(
        films,
        task.tables.single,
        (grounds, bands),
        scales,
        largest,
        middle,
        task.effort.single_precision,
    )


def search(
    task: IdentificationTask, measured: Measured, rows: Int[np.ndarray, "rows"], starts: SetStarts
) -> Pool:
    """Fitted candidates of some spectra; `CHUNK` at a time, a few of these side by side."""
    return Pool.joined(
        in_threads(lambda batch: search_chunk(task, measured, batch, starts), pieces(rows))
    )


def search_chunk(
    task: IdentificationTask, measured: Measured, rows: Int[np.ndarray, "rows"], starts: SetStarts
) -> Pool:
    """Fitted candidates of some spectra, at most `CHUNK`."""
    # Few sizes, so that little is compiled.
    padded = np.resize(rows, padded_size(len(rows)))
    batch = measured.take(padded)
    ranking = _ranking(task, batch)
    start = SetStarts(starts.sets[padded], starts.logs[padded])
    fitted = jax.tree.map(np.asarray, _fit(task, start, ranking))
    pool = _pool(task, start.sets, fitted)
    if task.max_paints == 3 and task.known >= 3:
        pairs = slice(task.known, None)
        start, new = _grown(
            task,
            start.sets[:, pairs],
            jax.tree.map(lambda a: a[:, pairs], fitted),
            batch.readings,
            batch.grounds,
        )
        triples = _pool(task, start.sets, _fit(task, start, ranking))
        triples.log_weight[~new] = -np.inf
        pool = pool.merged(triples)
    real = np.arange(len(rows))
    looked_at = pool
    pool = refine(task, pool.of(real), batch.take(real))
    if task.layers == 2 and task.max_paints > 1 and task.known > 1:
        pool = _search_two_coats(task, pool.of(np.resize(real, len(padded))), looked_at, batch).of(
            real
        )
    return _with_surface(task, pool, batch.take(real))


def padded_size(count: int) -> int:
    """Spectra that so many are fitted as: 16, or whole chunks."""
    return 16 if count <= 16 else CHUNK * -(-count // CHUNK)


class _Ranking(NamedTuple):
    """Grounds and errors of some spectra in few components and single precision, which
    only ranks.
    """

    ground: jax.Array
    weights: Weights


def _ranking(task: IdentificationTask, batch: Measured) -> _Ranking:
    """Errors while candidates are ranked, in the components of films over a ground like
    the first.
    """
    project = task.tables.like(batch.grounds[0]).project
    weights = weights_of(task, _flat(batch.readings), alike_errors(task, batch, project))
    small = jax.tree.map(lambda a: jnp.asarray(np.asarray(a, np.float32)), (batch.grounds, weights))
    return _Ranking(*small)


class NuisanceMode(NamedTuple):
    """What moves all bands of a reading together: the surface, and what else is in doubt.

    Attributes:
        shapes: what each does per standard deviation.
        found: how much of each a residual speaks for, shapes by readings.
    """

    shapes: Float[np.ndarray, "spectra shapes readings"]
    found: Float[np.ndarray, "spectra shapes readings"]

    @classmethod
    def of(cls, task: IdentificationTask, batch: Measured) -> "NuisanceMode":
        """Ridge regression on the shapes: unit sd beforehand, errors that are not alike at
        neighbouring bands.
        """
        count = len(batch)
        surface = np.full(
            (count, 1, batch.readings[0].size), task.discrepancy.gloss_sd * task.surface
        )
        doubt = batch.doubt.reshape(count, batch.doubt.shape[1], surface.shape[-1])
        shapes = np.concatenate([surface, doubt], axis=1)
        precise = shapes / near_sd(batch).reshape(count, 1, -1) ** 2
        normal = precise @ np.swapaxes(shapes, 1, 2) + np.eye(shapes.shape[1])
        return cls(shapes, np.linalg.solve(normal, precise))


def _with_surface(task: IdentificationTask, pool: Pool, batch: Measured) -> Pool:
    """The pool with readings as they are seen, and amounts in metres.

    The surface's share, and what else is in doubt, is what each candidate's residual speaks for.
    """
    d = task.discrepancy
    nuisance = NuisanceMode.of(task, batch)
    off = task.target(batch.readings)[:, None] - pool.readings
    found = nuisance.found @ np.swapaxes(off, 1, 2)
    gloss = np.maximum(d.gloss + d.gloss_sd * found[:, 0], 0.0)
    seen = pool.readings + gloss[..., None] * task.surface
    seen = seen + np.swapaxes(found[:, 1:], 1, 2) @ nuisance.shapes[:, 1:]
    moved = pool.allowed + d.gloss * task.surface
    lengths = {
        name: getattr(pool, name) + np.log(task.prior.thickness) for name in ("logs", "weighed")
    }
    return replace(pool, readings=seen, allowed=moved, gloss=gloss, **lengths)


def _fit(task: IdentificationTask, start: SetStarts, ranking: _Ranking) -> Fitted:
    logs = jnp.asarray(np.clip(start.logs, np.log(LEAST), np.log(MOST)).astype(np.float32))
    films = task.tables.single
    return fit_sets(
        *films,
        jnp.asarray(start.sets),
        logs,
        *ranking,
        task.middle,
        steps=task.effort.ranking_steps,
    )


def _flat(
    spectra: Float[np.ndarray, "spectra grounds bands"],
) -> Float[np.ndarray, "spectra readings"]:
    """Readings over all grounds in one row."""
    return spectra.reshape(len(spectra), -1)


def _pool(
    task: IdentificationTask,
    sets: np.ndarray,
    fitted: Fitted,
    coats: np.ndarray | None = None,
    log_share: float = 0.0,
) -> Pool:
    """Fitted candidates with room for three paints each."""
    size = sets.shape[-1]
    room = ((0, 0), (0, 0), (0, 3 - size))
    where = np.zeros_like(sets) if coats is None else coats
    logs = np.pad(np.asarray(fitted.logs, float), room, constant_values=-np.inf)
    return Pool(
        members=np.pad(sets, room, constant_values=NOBODY),
        coats=np.pad(where, room),
        logs=logs,
        weighed=logs,
        covariance=np.pad(np.asarray(fitted.covariance, float), (*room, (0, 3 - size))),
        log_weight=task.discrepancy.trust * np.asarray(fitted.log_evidence, float)
        + task.log_sets(sets)
        + log_share,
        readings=np.asarray(fitted.readings, float),
        allowed=np.asarray(fitted.readings, float),
        gloss=np.zeros(sets.shape[:2]),
        condition=np.zeros(sets.shape[:2], dtype=np.int32),
    )


def _grown(
    task: IdentificationTask,
    pairs: np.ndarray,
    fitted: Fitted,
    readings: np.ndarray,
    ground: np.ndarray,
) -> tuple[SetStarts, Bool[np.ndarray, "spectra sets"]]:
    """Sets of three from the most probable pairs, and whether each is the first of its kind."""
    rows = np.arange(len(pairs))[:, None]
    best = np.argsort(-np.asarray(fitted.log_evidence), axis=1)[:, :_GROWN_PAIRS]
    amounts = np.exp(np.asarray(fitted.logs))[rows, best]
    sets, tries = grow(pairs[rows, best], amounts, task.known)
    white = task.common_whitening(readings.shape[1])
    target = task.target(readings) @ white.T
    given = (jnp.asarray(a, float) for a in (tries, ground, target, white))
    cost, where = (
        np.asarray(a) for a in score(task.response, task.paints, jnp.asarray(sets), *given)
    )
    keep = min(_KEPT_TRIPLES, len(sets_of(task.known, 3)))
    # Pairs that overlap can give fewer sets than wanted: then some come twice.
    found = [unique_best(s, c, keep) for s, c in zip(sets, cost, strict=True)]
    chosen = np.stack([np.resize(numbers, keep) for numbers in found])
    new = np.arange(keep) < np.asarray([len(numbers) for numbers in found])[:, None]
    logs = np.log(np.take_along_axis(tries, where[..., None, None], axis=2)[:, :, 0])
    return SetStarts(sets[rows, chosen], logs[rows, chosen]), new


def _search_two_coats(
    task: IdentificationTask, pool: Pool, looked_at: Pool, batch: Measured
) -> Pool:
    """The pool with the best sets of two and three paints that were looked at as two coats too."""
    ground = jnp.asarray(batch.grounds, float)
    weights = jax.tree.map(
        jnp.asarray, weights_of(task, _flat(batch.readings), alike_errors(task, batch))
    )
    pool.log_weight[(pool.members != NOBODY).sum(axis=-1) > 1] += np.log1p(-task.prior.stacked)
    size = (looked_at.members != NOBODY).sum(axis=-1)
    for paints in range(2, task.max_paints + 1):
        ways = orders(paints)
        weight = np.where(size == paints, looked_at.log_weight, -np.inf)
        keep = min(
            _STACKED if paints == 2 else _STACKED // 2, int((size == paints).sum(axis=1).min())
        )
        best = np.argsort(-weight, axis=1)[:, :keep]
        sets = np.take_along_axis(looked_at.members, best[..., None], axis=1)[..., :paints]
        sets = np.repeat(sets, len(ways), axis=1)
        coats = np.broadcast_to(np.tile(ways, (keep, 1)), sets.shape)
        fitted, slopes = _fit_stacks(task, sets, coats, batch, ground, weights)
        stacks = _pool(task, sets, fitted, coats, np.log(task.prior.stacked / len(ways)))
        row = np.repeat(np.arange(len(batch)), sets.shape[1])
        groups = Groups(
            np.arange(len(row)), row, *(a.reshape(len(row), *a.shape[2:]) for a in (sets, slopes))
        )
        near = move_readings(task, batch, row, stacks.readings.reshape(len(row), -1), groups)
        stacks = replace(stacks, allowed=near.reshape(stacks.readings.shape))
        struck = ~np.isfinite(np.take_along_axis(weight, best, axis=1))
        stacks.log_weight[np.repeat(struck, len(ways), axis=1)] = -np.inf
        pool = pool.merged(stacks)
    return pool


def _fit_stacks(
    task: IdentificationTask,
    sets: np.ndarray,
    coats: np.ndarray,
    batch: Measured,
    ground: jax.Array,
    weights: Weights,
) -> tuple[Fitted, np.ndarray]:
    """Stacks with errors of their own, and slopes near the fit."""
    films = task.paints, jnp.asarray(sets), jnp.asarray(coats)
    logs = stack_starts(*films, ground, weights, task.optics, task.middle)
    row = np.repeat(np.arange(len(batch)), sets.shape[1])
    count = sets.shape[:2]
    readings = np.broadcast_to(_flat(batch.readings)[:, None], (*count, batch.readings[0].size))
    fitted = None
    slopes = None
    for _ in range(_ROUNDS):
        slopes = np.asarray(stack_slopes(*films, logs, ground, task.optics))
        errors = coefficient_errors(
            task, batch, row, *(a.reshape(len(row), *a.shape[2:]) for a in (sets, slopes))
        )
        errors = Whitening(
            *(a.reshape(*count, *a.shape[1:]) for a in (errors.basis, errors.height))
        )
        own = jax.tree.map(jnp.asarray, weights_of(task, readings, errors))
        fitted = fit_stacks(*films, logs, ground, own, task.optics, task.middle)
        logs = fitted.logs
    assert fitted is not None
    assert slopes is not None
    return fitted, slopes
