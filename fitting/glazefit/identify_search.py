"""From spectra to a pool of fitted candidates: screen, fit, grow, fit, and stack."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from .candidates import Paints, Search, amounts_grid, grow, score, screen, sets_of, unique_best
from .evidence import Discrepancy, Prior, covariance, whitening
from .films import Noise
from .identify_fit import LEAST, MOST, Fitted, Weights, fit_sets
from .identify_inputs import Measured
from .identify_result import NOBODY, Pool
from .identify_stacks import Optics, fit_stacks, orders
from .response import FilmResponse

CHUNK = 16
"""Spectra that are fitted at a time."""

_SCREENED = 256
_KEPT_PAIRS, _GROWN_PAIRS, _KEPT_TRIPLES, _STACKED = 40, 12, 40, 8
# Grounds that differ by less share a screening; each film is then fitted with its own.
_ALIKE = 0.04
_TYPICAL_READING = 0.3


class Task(NamedTuple):
    """What all spectra of an identification share."""

    response: FilmResponse
    paints: Paints
    wavelengths: Float[np.ndarray, "bands"]
    optics: Optics
    surface: float  # what a smooth surface adds to a reading
    noise: Noise
    discrepancy: Discrepancy
    prior: Prior
    max_paints: int
    layers: int

    @property
    def known(self) -> int:
        """Paints in the catalogue."""
        return self.paints.absorption.shape[0]

    @property
    def middle(self) -> int:
        """Scale of the discrepancy that is fitted with: the one nearest to 1."""
        return int(np.argmin(np.abs(np.log(self.discrepancy.scales))))

    def target(self, readings: Float[np.ndarray, "spectra grounds bands"]) -> Float[np.ndarray, "spectra readings"]:
        """Readings without the mean surface."""
        return (readings - self.discrepancy.gloss * self.surface).reshape(len(readings), -1)

    def common_whitening(self, grounds: int) -> Float[np.ndarray, "readings readings"]:
        """Of a reading of middling size, for the searches that only rank."""
        sd = self.noise.sd(np.full((grounds, self.wavelengths.size), _TYPICAL_READING))
        return whitening(covariance(sd, self.wavelengths, self.surface, self.discrepancy, 1.0))[0]

    def log_set(self, size: int) -> float:
        """Log prior probability of one set of so many paints."""
        sizes = np.asarray(self.prior.sizes[: self.max_paints])
        return float(
            np.log(sizes[size - 1] / sizes.sum() * (1.0 - self.prior.unknown)) - np.log(len(sets_of(self.known, size)))
        )


class Start(NamedTuple):
    """Sets of one size and where to start them."""

    sets: Int[np.ndarray, "spectra sets size"]
    logs: Float[np.ndarray, "spectra sets size"]


def weights_of(task: Task, readings: Float[np.ndarray, "spectra grounds bands"]) -> Weights:
    """Errors of some spectra, for each scale of the discrepancy."""
    sd, d = task.noise.sd(readings), task.discrepancy
    parts = [whitening(covariance(sd, task.wavelengths, task.surface, d, scale)) for scale in d.scales]
    white, height = (np.stack(a, axis=1) for a in zip(*parts, strict=True))
    height = height + np.log(np.asarray(d.weights) / sum(d.weights))
    alike = [np.full(len(readings), value) for value in (task.prior.spread, task.prior.concentration)]
    return Weights(*(jnp.asarray(a, float) for a in (task.target(readings), white, height, *alike)))


def first_starts(task: Task, measured: Measured) -> list[Start]:
    """Sets of one paint and the best of two for every spectrum, from the screening."""
    kinds = []
    for size in range(1, min(task.max_paints, 2) + 1):
        sets = sets_of(task.known, size)
        keep = min(len(sets), _KEPT_PAIRS) if size == 2 else len(sets)
        chosen = np.empty((len(measured), keep, size), dtype=np.int32)
        logs = np.empty(chosen.shape)
        kinds.append((sets, amounts_grid(size, task.prior.spread), Start(chosen, logs)))
    white = jnp.asarray(task.common_whitening(measured.readings.shape[1]), float)
    target = task.target(measured.readings) @ np.asarray(white).T
    for rows, ground in alike_grounds(measured.grounds):
        for first in range(0, len(rows), _SCREENED):
            some = rows[first : first + _SCREENED]
            # Padded to one of two sizes, so that little is compiled.
            padded = np.resize(some, CHUNK if len(some) <= CHUNK else _SCREENED)
            search = Search(jnp.asarray(target[padded], float), white, jnp.asarray(ground, float))
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


def search_chunk(task: Task, measured: Measured, rows: Int[np.ndarray, "rows"], starts: list[Start]) -> Pool:
    """Fitted candidates of some spectra, at most `CHUNK`."""
    padded = np.resize(rows, CHUNK)
    readings, ground = measured.readings[padded], jnp.asarray(measured.grounds[padded], float)
    weights = weights_of(task, readings)
    pool: Pool | None = None
    last = None
    for start in starts:
        start = Start(start.sets[padded], start.logs[padded])
        last = start.sets, _fit(task, start, ground, weights)
        pool = _add(pool, _pool(task, *last))
    assert pool is not None
    assert last is not None
    if task.max_paints == 3 and task.known >= 3:
        start, new = _grown(task, *last, measured.readings[padded], ground)
        triples = _pool(task, start.sets, _fit(task, start, ground, weights))
        triples.log_weight[~new] = -np.inf
        pool = pool.merged(triples)
    if task.layers == 2 and task.max_paints > 1 and task.known > 1:
        pool = _stacked(task, pool, ground, weights)
    return pool.take(np.broadcast_to(np.arange(pool.log_weight.shape[1]), (len(rows), pool.log_weight.shape[1])))


def _add(pool: Pool | None, more: Pool) -> Pool:
    return more if pool is None else pool.merged(more)


def _fit(task: Task, start: Start, ground: jax.Array, weights: Weights) -> Fitted:
    logs = jnp.asarray(np.clip(start.logs, np.log(LEAST), np.log(MOST)), float)
    return fit_sets(task.response, task.paints, jnp.asarray(start.sets), logs, ground, weights, task.middle)


def _pool(
    task: Task, sets: np.ndarray, fitted: Fitted, coats: np.ndarray | None = None, log_share: float = 0.0
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
        np.asarray(fitted.log_evidence) + task.log_set(size) + log_share,
        np.asarray(fitted.readings),
    )


def _grown(
    task: Task, pairs: np.ndarray, fitted: Fitted, readings: np.ndarray, ground: jax.Array
) -> tuple[Start, Bool[np.ndarray, "spectra sets"]]:
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
    return Start(sets[rows, chosen], logs[rows, chosen]), new


def _stacked(task: Task, pool: Pool, ground: jax.Array, weights: Weights) -> Pool:
    """The pool with its best sets of two and three paints as two coats too; a coat less likely than one of a kind."""
    size = (pool.members != NOBODY).sum(axis=-1)
    coats_share = np.log(task.prior.stacked)
    several = size > 1
    whole = Pool(*pool.parts)
    whole.log_weight[several] += np.log1p(-task.prior.stacked)
    for paints in range(2, task.max_paints + 1):
        ways = orders(paints)
        keep = min(_STACKED if paints == 2 else _STACKED // 2, int((size == paints).sum(axis=1).min()))
        if keep == 0:
            continue
        weight = np.where(size == paints, pool.log_weight, -np.inf)
        best = np.argsort(-weight, axis=1)[:, :keep]
        sets = np.take_along_axis(pool.members, best[..., None], axis=1)[..., :paints]
        sets = np.repeat(sets, len(ways), axis=1)
        coats = np.broadcast_to(np.tile(ways, (keep, 1)), sets.shape)
        fitted = fit_stacks(
            task.paints, jnp.asarray(sets), jnp.asarray(coats), ground, weights, task.optics, task.middle
        )
        whole = whole.merged(_pool(task, sets, fitted, coats, coats_share - np.log(len(ways))))
    return whole
