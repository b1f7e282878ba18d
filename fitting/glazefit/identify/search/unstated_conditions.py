"""Conditions that nobody may have mentioned: a yellowed varnish on top, another ground than stated,
a film that hides its ground.

Films are searched as they were said to be. Where the answer may rest on something unstated, they
are searched again as they would be seen under each of a few other conditions.
"""

from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ...film.model.response import FilmResponse
from ...film.model.varnish import AMOUNTS, limits_under, under_varnish, without_varnish, yellow
from .candidates import find_candidates
from .pool import CandidateReadings, Pool
from .task import Chunk, Measured, OverGrounds, RowNumbers, Tasks
from .weigh import Odds, odds_of


class Condition(NamedTuple):
    """One way in which a film may lie differently from what was stated."""

    words: str  # as an answer names it; empty for what was stated
    chance: float  # prior, relative to 1 for the stated condition
    varnish: str = ""  # a name of `AMOUNTS`; empty for none
    ground: float | None = None  # internal reflectance; None is as stated
    opaque: bool | None = None  # None is as stated


_LIGHT = 0.85
_DARK = 0.04
"""Internal reflectances of grounds that nobody named."""
_LIGHT_GROUND = Condition("over a light ground", 0.4, ground=_LIGHT, opaque=False)
_OTHER_GROUNDS = (
    Condition("hiding its ground", 0.05, opaque=True),
    Condition("over a lighter ground than stated", 0.03, ground=_LIGHT),
    Condition("over a darker ground than stated", 0.03, ground=_DARK),
)
# In the order of `AMOUNTS`, by which maps number them.
_VARNISHED = {name: Condition("under a yellowed varnish", 0.08, varnish=name) for name in AMOUNTS}
CONDITIONS = (Condition("", 1.0), *_VARNISHED.values(), _LIGHT_GROUND, *_OTHER_GROUNDS)
"""All conditions that are tried; the first is what was stated. Pools and maps hold their places
here as numbers.
"""


def search_unstated_conditions(
    tasks: Tasks,
    measured: Measured,
    pool: Pool,
    varnish: str,
) -> tuple[Pool, Odds]:
    """The pool, with candidates under other conditions where what was stated leaves a film in
    doubt; and its odds.

    A film that was said to hide its ground is always tried over a light one, too: one reading
    cannot show which is so. A dark one would make any colour darker, and is not tried.

    Args:
        tasks: of the `Searcher`.
        measured: spectra; those in doubt are searched again.
        pool: their candidates as stated.
        varnish: what was stated of it, one of `options.VARNISHES`.
    """
    stated = tasks[None]
    stated_varnish = _VARNISHED.get(varnish)
    # A varnish that was stated weighs as what was stated does, and all without it little: by the
    # probability that it is not there.
    log_bare = 0.0 if stated_varnish is None else np.log(0.05)
    pool = replace(pool, log_weight=pool.log_weight + log_bare)

    def try_under(pool: Pool, conditions: Iterable[Condition], rows: RowNumbers) -> Pool:
        """The pool with candidates of some of the spectra under further conditions."""
        pools = []
        for condition in conditions:
            films, slope = films_under(condition, tasks, measured.take(rows))
            # What no paint reads under a varnish has no candidates there.
            possible = np.flatnonzero(np.isfinite(slope).all(axis=(1, 2)))
            if possible.size:
                films = films.take(possible)
                candidates = pool_under(condition, films, slope[possible], find_candidates(films))
                added = -np.log(condition.chance) if condition is stated_varnish else log_bare
                candidates = replace(candidates, log_weight=candidates.log_weight + added)
                pools.append(candidates.spread(rows[possible], len(measured)))
        return pool.merge(*pools)

    # Conditions that are tried for every spectrum.
    everything = np.arange(len(measured))
    if stated.hides:
        pool = try_under(pool, [_LIGHT_GROUND], everything)
    if stated_varnish is not None:
        pool = try_under(pool, [stated_varnish], everything)
    odds = odds_of(measured, pool, stated.prior)
    # Those that are tried where these leave a spectrum in doubt: none has more than a fifth.
    doubtful = everything[odds.none / odds.total > 0.2]
    if not len(doubtful):
        return pool, odds
    if measured.readings.shape[1] == 1 and not stated.hides:
        pool = try_under(pool, _OTHER_GROUNDS, doubtful)
    if varnish == "unknown":
        pool = try_under(pool, _VARNISHED.values(), doubtful)
    return pool, odds_of(measured, pool, stated.prior)


def films_under(
    condition: Condition, tasks: Tasks, measured: Measured
) -> tuple[Chunk, OverGrounds]:
    """Films as they would be seen under one condition, and the slopes of these readings by those
    that were measured; NaN for spectra that no paint reads under it.

    Args:
        condition: one of `CONDITIONS`.
        tasks: of the `Searcher`.
        measured: the spectra as they were measured.
    """
    task = tasks[condition.opaque]
    changed = measured
    slope = np.ones_like(measured.readings)
    if condition.ground is not None:
        changed = replace(changed, grounds=np.full_like(changed.grounds, condition.ground))
    if condition.varnish:
        changed, slope = remove_varnish(changed, task.response, task.surface, condition.varnish)
    return Chunk(task, changed), slope


def remove_varnish(
    measured: Measured, response: FilmResponse, surface: float, varnish: str
) -> tuple[Measured, OverGrounds]:
    """Spectra as they would be without a varnish, and their slopes by the readings under it; NaN
    for spectra that no paint reads under it.

    How much varnish there is is left open: an error of a known shape.

    Args:
        measured: under the varnish.
        response: of the instrument.
        surface: what the outer surface adds to a reading.
        varnish: a name of `AMOUNTS`.
    """
    absorption = yellow(measured.wavelengths)
    optical_thickness, spread = AMOUNTS[varnish]
    read = measured.readings - surface
    body = np.clip(read, *limits_under(response, optical_thickness * absorption))
    # Readings that are farther beyond what paint reads under a varnish are no noise.
    possible = (np.abs(read - body) <= 4.0 * measured.noise_sd).all(axis=(1, 2), keepdims=True)
    # At this level, at slightly more varnish, and for slightly higher readings.
    bare = without_varnish(response, body, optical_thickness * absorption)
    more_varnish = without_varnish(response, body, (optical_thickness + 0.01) * absorption)
    brighter = without_varnish(response, body + 1e-4, optical_thickness * absorption)
    varnish_error = spread / 0.01 * (more_varnish - bare)
    slope = (brighter - bare) / 1e-4
    changed = replace(
        measured,
        readings=bare + surface,
        noise_sd=measured.noise_sd * slope,
        doubt=varnish_error[:, None],
    )
    return changed, np.where(possible, slope, np.nan)


def pool_under(condition: Condition, films: Chunk, slope: OverGrounds, pool: Pool) -> Pool:
    """Candidates under one condition as they compete with those of films that lie as stated.

    Args:
        condition: one of `CONDITIONS`.
        films, slope: the films under it, and slopes of their readings (`films_under`).
        pool: their candidates.
    """
    task = films.task

    def add_varnish(readings: CandidateReadings) -> np.ndarray:
        thickness = AMOUNTS[condition.varnish][0] * yellow(films.spectra.wavelengths)
        return under_varnish(task.response, readings - task.surface, thickness) + task.surface

    if condition.varnish:
        pool = replace(
            pool, readings=add_varnish(pool.readings), adjusted=add_varnish(pool.adjusted)
        )
    # What changes of variables add to a spectrum's log density.
    change = task.independent_readings * np.log(slope).mean(axis=(1, 2))
    weight = pool.log_weight + np.log(condition.chance) + change[:, None]
    if condition.ground is not None:
        # What hardly shows is no answer over a ground that nobody stated: it is the ground that is
        # seen.
        clear = np.append(task.extenders, True)[pool.members].all(axis=-1)
        weight = np.where(clear, -np.inf, weight)
    return replace(
        pool, log_weight=weight, condition=np.full_like(pool.condition, CONDITIONS.index(condition))
    )
