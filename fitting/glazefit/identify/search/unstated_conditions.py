"""Films sought again under conditions that nobody mentioned, and all candidates compete.

Films are sought as they were said to be. Where the answer may rest on something untold, they are
sought again under each of a few other conditions (`conditions.CONDITIONS`).
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from ...film.response import FilmResponse
from ...film.varnish import under_varnish, without_varnish, yellow
from ..result import Pool
from .coefficient_errors import independent
from .conditions import CONDITIONS, NOT_OPAQUE, OTHER_GROUNDS, VARNISHES
from .search import first_starts, search
from .task import IdentificationTask, Measured
from .weigh import Odds, odds_of

# Two levels of a varnish that is seen; what is between them is left open.
_LEVELS = {0.2: 0.15, 0.6: 0.3}
"""Optical thickness at 400 nm -> its standard deviation."""
_DOUBTFUL = 0.2
"""Probability of none above which a film is sought again."""


def search_unstated_conditions(
    tasks: Mapping[bool, IdentificationTask], opaque: bool, measured: Measured, pool: Pool
) -> tuple[Pool, Odds]:
    """The pool, with candidates under other conditions where what was told leaves a film in doubt;
    and its odds.

    Films that were said to hide their ground are always tried without: one reading does not tell.

    Args:
        tasks: for films that let the ground through, and for films that hide it.
        opaque: what was told.
        measured: spectra; those in doubt are sought again, `CHUNK` at a time.
        pool: their candidates as told.
    """
    one_ground = measured.readings.shape[1] == 1

    def more(pool: Pool, numbers: tuple[int, ...], rows: Int[np.ndarray, "rows"]) -> Pool:
        for number in numbers:
            found = _under(number, tasks, opaque, measured.take(rows))
            pool = pool.merged(found.spread(rows, len(measured)))
        return pool

    everything = np.arange(len(measured))
    if opaque:
        pool = more(pool, NOT_OPAQUE, everything)
    prior = tasks[opaque].prior
    odds = odds_of(measured, pool, prior)
    doubtful = everything[odds.none / odds.total > _DOUBTFUL]
    if not len(doubtful):
        return pool, odds
    if one_ground and not opaque:
        pool = more(pool, OTHER_GROUNDS, doubtful)
    pool = more(pool, VARNISHES, doubtful)
    return pool, odds_of(measured, pool, prior)


class FilmsUnderCondition(NamedTuple):
    """Films as they would be seen under a condition."""

    task: IdentificationTask
    opaque: bool  # whether they hide their ground
    measured: Measured
    slope: Float[
        np.ndarray, "spectra grounds bands"
    ]  # of these readings by those that were measured


def films_under(
    number: int, tasks: Mapping[bool, IdentificationTask], told: bool, measured: Measured
) -> FilmsUnderCondition:
    """Films under one condition, by its number.

    Args:
        number: of `conditions.CONDITIONS`.
        tasks: for films that let the ground through, and for films that hide it.
        told: whether they were said to hide it.
        measured: the spectra as they were measured.
    """
    condition = CONDITIONS[number]
    opaque = told if condition.opaque is None else condition.opaque
    task = tasks[opaque]
    seen = measured
    slope = np.ones_like(measured.readings)
    if condition.ground is not None:
        seen = replace(seen, grounds=np.full_like(seen.grounds, condition.ground))
    if condition.varnish:
        seen, slope = remove_varnish(seen, task.response, task.surface, condition.varnish)
    return FilmsUnderCondition(task, opaque, seen, slope)


def _under(
    number: int, tasks: Mapping[bool, IdentificationTask], told: bool, measured: Measured
) -> Pool:
    """Candidates under one condition."""
    condition = CONDITIONS[number]
    task, _, seen, slope = films_under(number, tasks, told, measured)
    pool = search(task, seen, np.arange(len(seen)), first_starts(task, seen))

    def add_varnish(readings: np.ndarray) -> np.ndarray:
        body = readings.reshape(*readings.shape[:2], *measured.readings.shape[1:]) - task.surface
        thickness = condition.varnish * yellow(measured.wavelengths)
        return (under_varnish(task.response, body, thickness) + task.surface).reshape(
            readings.shape
        )

    if condition.varnish:
        pool = replace(pool, readings=add_varnish(pool.readings), allowed=add_varnish(pool.allowed))
    # What changes of variables add to a spectrum's log density.
    change = np.log(slope).mean(axis=(1, 2))
    weight = pool.log_weight + np.log(condition.chance) + (independent(task) * change)[:, None]
    if condition.ground is not None:
        # What hardly shows is no answer over a ground that nobody told: it is the ground that is
        #     seen.
        clear = np.append(task.extenders, True)[pool.members].all(axis=-1)
        weight = np.where(clear, -np.inf, weight)
    return replace(pool, log_weight=weight, condition=np.full_like(pool.condition, number))


def remove_varnish(
    measured: Measured, response: FilmResponse, surface: float, level: float
) -> tuple[Measured, Float[np.ndarray, "spectra grounds bands"]]:
    """Spectra as they would be without a varnish, and their slopes by the readings under it.

    How much varnish there is is left open: an error of a known shape.

    Args:
        measured: under the varnish.
        response: of the instrument.
        surface: what the outer surface adds to a reading.
        level: optical thickness of the varnish at 400 nm, one of those that are tried.
    """
    grid = measured.wavelengths
    body = measured.readings - surface
    spread = _LEVELS[level]

    def off(thickness: np.ndarray) -> np.ndarray:
        return without_varnish(response, body, thickness)

    coat = level * yellow(grid)
    bare = off(coat)
    step = 0.01
    more = spread / step * (off((level + step) * yellow(grid)) - bare)
    slope = (without_varnish(response, body + 1e-4, coat) - bare) / 1e-4
    doubt = more[:, None]
    changed = replace(
        measured, readings=bare + surface, noise_sd=measured.noise_sd * slope, doubt=doubt
    )
    return changed, slope
