"""The best candidates fitted again, with the errors that their own paints' coefficients cause.

Errors go with a film: how large it is, and how well its paints are known. Candidates of one
spectrum that have the same paints but for traces share them: most of what comes near a film is the
right paint with a trace of another. So errors are worked out once for each group, where its best
candidate stands, and again where that has moved to.
"""

from dataclasses import replace
from typing import NamedTuple, TypeAlias

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from glazejax.programs import Program
from glazejax.radiative.common.chunks import by_blocks, pieces_of

from ...film.model.errors import (
    Whitening,
    modes_covariance,
    paint_covariance,
    smooth_kernel,
    whitening,
)
from ...film.model.response import FilmResponse
from .fit import (
    FilmLogs,
    FilmNumbers,
    FilmSets,
    Fitted,
    Weights,
    fit_all,
    fit_films,
    log_set_prior,
)
from .pool import NOBODY, Pool
from .table import Block, Paints
from .task import Chunk, IdentificationTask

FilmReadings: TypeAlias = Float[np.ndarray, "films readings"]
"""Readings of each film over all grounds in one row."""
FilmSlopes: TypeAlias = Float[np.ndarray, "films errors readings"]
"""Slopes of each film's readings by the log of its paints' k, then s."""
# Films whose errors are worked out together.
_ERRORS = 32


def compile_ahead(task: IdentificationTask, grounds: int) -> None:
    """Begin to compile what the best candidates are fitted with, over so many grounds, while others
    are still looked for; return at once.
    """
    readings = grounds * task.wavelengths.size
    count = block_size(readings)
    members = np.zeros((count, max(task.max_paints, 2)), np.int32)
    logs = np.zeros(members.shape)
    ground = np.zeros((count, grounds, task.wavelengths.size))
    film_slopes.ahead(task.response, task.paints, members, logs, ground)
    weights = Weights(
        target=np.zeros((count, readings)),
        basis=np.zeros((count, readings, readings)),
        height=np.zeros(count),
        expected=task.expected,
    )
    single = jax.tree.map(np.float32, (logs, ground, weights))
    fit_films.ahead(*task.single, members, *single, steps=np.asarray(0), along=np.asarray(False))


class Groups(NamedTuple):
    """Films that stand for all with the same paints but for traces."""

    of: FilmNumbers  # group of each film
    row: Int[np.ndarray, "groups"]  # spectrum
    sets: Int[np.ndarray, "groups size"]
    slopes: Float[np.ndarray, "groups errors readings"]


def refine(chunk: Chunk, pool: Pool) -> Pool:
    """The best of a pool with errors of their own, and with readings that come near the measured
    ones.

    Sets far behind the best get a weight of -inf. Two kinds of amounts are kept. The most probable
    ones allow for errors of the paints' k and s: probabilities follow from them, and they are
    reported. But they may put down to such errors what slightly other amounts would explain, so
    that a mixture by them would miss the reading. How near a set comes is therefore judged by
    amounts that are fitted without these errors.
    """
    task = chunk.task
    ranked = np.argsort(-pool.log_weight, axis=1, kind="stable")
    # Arrays of its own, of which what is refined is replaced.
    pool = pool.choose(ranked[:, : task.effort.kept_sets])
    deficit = pool.log_weight.max(axis=1, keepdims=True) - pool.log_weight
    row, column = np.nonzero(deficit <= task.effort.within)
    # Places of the paints of a set.
    places = slice(max(task.max_paints, 2))
    sets = pool.members[row, column, places]
    logs = np.where(sets == NOBODY, 0.0, pool.logs[row, column, places])
    # With the errors of groups of like films; then those that came near, with errors where they
    # are now.
    fitted, _, _ = fit_with_errors(chunk, row, sets, logs, pool.log_weight[row, column])
    best = np.full(len(chunk), -np.inf)
    np.maximum.at(best, row, fitted.log_evidence)
    stay = best[row] - fitted.log_evidence <= task.effort.within
    row, column, sets = row[stay], column[stay], sets[stay]
    fitted, groups, _ = fit_with_errors(
        chunk, row, sets, fitted.logs[stay], fitted.log_evidence[stay], along=True
    )
    # Amounts that come near the readings; those that are weighed are kept separately.
    near = fit_all(
        chunk,
        row,
        sets,
        fitted.logs,
        chunk.near_errors,
        own=row,
        steps=task.effort.steps,
        block=block_size(chunk.target.shape[1]),
    )
    absent = sets == NOBODY
    # Nothing is known together with a paint that is not there.
    unknown = absent[:, :, None] | absent[:, None]
    pool.log_weight[:] = -np.inf
    pool.log_weight[row, column] = fitted.log_evidence
    pool.covariance[:] = 0.0
    pool.covariance[row, column, places, places] = np.where(unknown, 0.0, fitted.covariance)
    pool.logs[row, column, places] = np.where(absent, -np.inf, near.logs)
    pool.weighed[row, column, places] = np.where(absent, -np.inf, fitted.logs)
    pool.readings[row, column] = near.readings
    pool.adjusted[row, column] = move_readings(chunk, near.readings, groups)
    return pool


def slopes_at(chunk: Chunk, sets: FilmSets, logs: FilmLogs, row: FilmNumbers) -> FilmSlopes:
    """`film_slopes` of any number of films, over the grounds of their spectra, which `row`
    numbers.
    """
    task = chunk.task
    grounds = chunk.spectra.grounds

    def run(n: np.ndarray) -> Array:
        return film_slopes(task.response, task.paints, sets[n], logs[n], grounds[row[n]])

    return by_blocks(len(sets), block_size(grounds[0].size), run)


def slopes_by_amount(
    slopes: Float[np.ndarray, "*n errors readings"],
) -> Float[np.ndarray, "*n size readings"]:
    """Slopes of readings by the log of every paint's amount, with which its k and s grow together,
    from those by k, then s.
    """
    by_absorption, by_scattering = np.split(slopes, 2, axis=-2)
    return by_absorption + by_scattering


@Program
def film_slopes(
    response: FilmResponse, paints: Paints, sets: Array, logs: Array, ground: Array
) -> Float[Array, "films errors readings"]:
    """Slopes of the readings by the log of every paint's k, then s, band by band.

    Args:
        response: of the instrument.
        paints: of the catalogue.
        sets: paints of each film, (films, size); a negative number is none.
        logs: log amounts, (films, size).
        ground: internal reflectance, (films, grounds, bands).
    """

    def film(members: Array, logs: Array, ground: Array) -> Array:
        amounts = jnp.where(members >= 0, jnp.exp(logs), 0.0)[:, None]
        depths = amounts * paints.absorption[members], amounts * paints.scattering[members]
        _, by_k, by_s = response.body_and_slopes(
            depths[0].sum(axis=0), depths[1].sum(axis=0), ground
        )
        slopes = jnp.concatenate([depths[0][:, None] * by_k, depths[1][:, None] * by_s])
        return slopes.reshape(slopes.shape[0], -1)

    return jax.vmap(film)(sets, logs, ground)


def fit_with_errors(
    chunk: Chunk,
    row: FilmNumbers,
    sets: FilmSets,
    logs: FilmLogs,
    log_weight: Float[np.ndarray, "films"],
    *,
    along: bool = False,
) -> tuple[Fitted, Groups, Whitening]:
    """Films fitted again with the errors of their groups; the groups, and the errors of each.

    Args:
        chunk: the spectra.
        row: spectrum of each film.
        sets: its paints; a negative number is none.
        logs: log amounts to start from.
        log_weight: how probable it was; the most probable film of a group stands for it.
        along: see `fit_films`.

    Returns:
        Films with the prior of their sets in the evidence.
    """
    task = chunk.task
    slopes = slopes_at(chunk, sets, logs, row)
    groups = _group(task, row, sets, log_weight, slopes)
    errors = coefficient_errors(chunk, groups)
    fitted = fit_all(
        chunk,
        row,
        sets,
        logs,
        errors,
        own=groups.of,
        steps=task.effort.steps,
        block=block_size(chunk.target.shape[1]),
        along=along,
    )
    weighed = fitted.log_evidence + log_set_prior(task, sets)
    return fitted._replace(log_evidence=weighed), groups, errors


def _group(
    task: IdentificationTask,
    row: FilmNumbers,
    sets: FilmSets,
    log_weight: Float[np.ndarray, "films"],
    slopes: FilmSlopes,
) -> Groups:
    """Groups of each spectrum's films by their paints but for traces; arguments as for
    `fit_with_errors`.
    """
    size = sets.shape[1]
    effect = np.sqrt(np.mean(slopes**2, axis=-1))
    effect = np.hypot(effect[:, :size], effect[:, size:])
    counts = (effect > task.effort.trace_effect) | (effect == effect.max(axis=1, keepdims=True))
    main = np.sort(np.where(counts, sets, NOBODY), axis=1)
    key = row.astype(np.int64)
    for paint in main.T:
        key = key * (task.paint_count + 1) + (paint + 1)
    order = np.argsort(-log_weight, kind="stable")
    _, first, of = np.unique(key[order], return_index=True, return_inverse=True)
    best = order[first]
    return Groups(of[np.argsort(order)], row[best], sets[best], slopes[best])


def paints_covariance(
    task: IdentificationTask,
    slopes: Float[np.ndarray, "*n errors readings"],
    members: Int[np.ndarray, "*n size"],
) -> Float[np.ndarray, "*n readings readings"]:
    """Covariance that all errors of films' paints cause.

    Args:
        task: of the search.
        slopes: of the readings by the log of k of the films' paints, then of s, band by band; 0 for
            no paint.
        members: paints of each film by number, negative for none.
    """
    d = task.discrepancy
    at = np.maximum(members, 0)
    grounds = slopes.shape[-1] // task.wavelengths.size
    kernel = smooth_kernel(np.tile(task.wavelengths, grounds), d.coefficient_length)
    stated = np.concatenate([task.errors[at, coefficient] for coefficient in (0, 1)], axis=-2)
    # What the pigments state, and some more: alike over the same distance.
    scaled = np.concatenate([d.coefficient * slopes, slopes * np.tile(stated, grounds)], axis=-2)
    caused = paint_covariance(scaled, kernel.astype(scaled.dtype))
    if d.level:
        caused += paint_covariance(d.level * slopes, 1.0)
    if task.modes.shape[-1]:
        modes = [task.modes[at, coefficient] for coefficient in (0, 1)]
        caused += modes_covariance(slopes, np.concatenate(modes, axis=-3))
    return caused


def coefficient_errors(chunk: Chunk, groups: Groups) -> Whitening:
    """Errors of films, from what their paints' coefficients do to the readings."""
    task = chunk.task
    common = chunk.noise_covariance + chunk.smooth_covariance
    # Single precision does for what is added to these, and takes a third of the time.
    by = groups.slopes.astype(np.float32)
    single = task._replace(errors=task.errors.astype(np.float32))

    def some(n: Block) -> Whitening:
        caused = paints_covariance(single, by[n], groups.sets[n])
        white = whitening(common[groups.row[n]] + caused)
        return white._replace(basis=white.basis.astype(np.float32))

    # A few at a time: matrices that stay in a core's cache.
    return by_blocks(len(by), min(_ERRORS, len(by)), some)


def block_size(readings: int) -> int:
    """Films that are fitted at a time, so that their errors take some megabytes at most."""
    return int(np.clip(2**22 // readings**2, 4, 128))


def move_readings(chunk: Chunk, readings: FilmReadings, groups: Groups) -> FilmReadings:
    """Readings of films, changed by the most probable errors of their paints' k and s.

    A film of the right paints then agrees with what was measured; one of other paints does not.

    Args:
        chunk: the spectra.
        readings: of each film, without the surface.
        groups: of the films.
    """
    off = chunk.target[groups.row[groups.of]] - readings
    out = readings.copy()
    # A few groups at a time: matrices that stay in a core's cache.
    for some in pieces_of(np.arange(len(groups.row)), _ERRORS):
        n = np.flatnonzero(np.isin(groups.of, some))
        free = coefficient_projection(
            chunk, groups.row[some], groups.sets[some], groups.slopes[some]
        )
        out[n] += np.einsum("fij,fj->fi", free[groups.of[n] - some[0]], off[n])
    return out


def coefficient_projection(
    chunk: Chunk, row: FilmNumbers, sets: FilmSets, slopes: FilmSlopes
) -> Float[np.ndarray, "films readings readings"]:
    """Matrix from each film's residual to the part of it that errors of its paints' k and s most
    probably cause.

    Args:
        chunk: the spectra.
        row: spectrum of each film.
        sets: its paints.
        slopes: of its readings.
    """
    task = chunk.task
    # What the pigments say of their errors, and no more.
    stated = replace(task.discrepancy, coefficient=0.0, level=0.0)
    free = paints_covariance(task._replace(discrepancy=stated), slopes, sets)
    spectra = chunk.take(row)
    white = whitening(spectra.tolerance_covariance + free).basis
    # All by which a film may be off, but for what counts as near.
    near = spectra.tolerance[:, :, None] ** 2
    return np.eye(near.shape[1]) - near * (np.swapaxes(white, 1, 2) @ white)
