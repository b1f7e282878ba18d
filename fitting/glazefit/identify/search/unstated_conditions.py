"""Conditions that nobody may have mentioned: a yellowed varnish on top, another ground than stated,
a film that hides its ground.

Films are searched as they were said to be. Where the answer may rest on something unstated, they
are searched again as they would be seen under each of a few other conditions.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from ...film.model.response import FilmResponse
from ...film.model.varnish import AMOUNTS, limits_under, under_varnish, without_varnish, yellow
from .candidates import find_candidates
from .pool import Pool
from .task import IdentificationTask, Measured
from .weigh import Odds, odds_of


class Condition(NamedTuple):
    """One way in which a film may lie differently from what was stated."""

    words: str  # as an answer names it; empty for what was stated
    chance: float  # prior, relative to 1 for the stated condition
    varnish: float = 0.0  # optical thickness at 400 nm
    ground: float | None = None  # internal reflectance; None is as stated
    opaque: bool | None = None  # None is as stated


_VARNISHED = "under a yellowed varnish"
_LIGHT = 0.85
_DARK = 0.04
"""Internal reflectances of grounds that nobody named."""
CONDITIONS = (
    Condition("", 1.0),
    Condition(_VARNISHED, 0.08, varnish=AMOUNTS["thin"][0]),
    Condition(_VARNISHED, 0.08, varnish=AMOUNTS["yellowed"][0]),
    Condition("over a light ground", 0.4, ground=_LIGHT, opaque=False),
    Condition("hiding its ground", 0.05, opaque=True),
    Condition("over a lighter ground than stated", 0.03, ground=_LIGHT),
    Condition("over a darker ground than stated", 0.03, ground=_DARK),
)
"""All that are tried, by number; the first is what was stated."""
CONDITIONS_OF_VARNISH: dict[str, tuple[int, ...]] = {
    "none": (),
    "thin": (1,),
    "yellowed": (2,),
    "unknown": (1, 2),
}
"""What was stated of a varnish -> numbers of the conditions that are tried for it."""
_STATED = ("thin", "yellowed")
# Probability that a varnish which was stated is not there.
NOT_OPAQUE = (3,)
OTHER_GROUNDS = (4, 5, 6)
"""Numbers of those for films said to be opaque, and of those for one reading over a ground."""
_LEVELS = dict(AMOUNTS.values())
"""Optical thickness at 400 nm -> its standard deviation."""


def search_unstated_conditions(
    tasks: Mapping[bool, IdentificationTask],
    opaque: bool,
    measured: Measured,
    pool: Pool,
    varnish: str = "unknown",
) -> tuple[Pool, Odds]:
    """The pool, with candidates under other conditions where what was stated leaves a film in
    doubt; and its odds.

    A film that was said to hide its ground is always tried over a light one, too: one reading
    cannot show which is so. A dark one would make any colour darker, and is not tried.

    Args:
        tasks: for films that let the ground through, and for films that hide it.
        opaque: whether they were said to hide it.
        measured: spectra; those in doubt are searched again.
        pool: their candidates as stated.
        varnish: what was stated of it, a key of `CONDITIONS_OF_VARNISH`.
    """
    prior = tasks[opaque].prior

    def more(pool: Pool, numbers: tuple[int, ...], rows: Int[np.ndarray, "rows"]) -> Pool:
        others = []
        for number in numbers:
            seen = films_under(number, tasks, opaque, measured.take(rows))
            # What no paint reads under a varnish has no candidates there.
            here = np.flatnonzero(np.isfinite(seen.slope).all(axis=(1, 2)))
            if here.size:
                seen = seen.take(here)
                found = find_candidates(seen.task, seen.measured)
                others.append(pool_under(number, seen, found).spread(rows[here], len(measured)))
        return pool.merge(*others)

    everything = np.arange(len(measured))
    if opaque:
        pool = more(pool, NOT_OPAQUE, everything)
    if varnish in _STATED:
        pool = more(pool, CONDITIONS_OF_VARNISH[varnish], everything)
        pool = replace(pool, log_weight=pool.log_weight + _weight_of_stated(varnish, pool))
    odds = odds_of(measured, pool, prior)
    # Films that are more probably none of these are searched again.
    doubtful = everything[odds.none / odds.total > 0.2]
    if not len(doubtful):
        return pool, odds
    if measured.readings.shape[1] == 1 and not opaque:
        pool = more(pool, OTHER_GROUNDS, doubtful)
    if varnish not in _STATED:
        pool = more(pool, CONDITIONS_OF_VARNISH[varnish], doubtful)
    return pool, odds_of(measured, pool, prior)


def _weight_of_stated(varnish: str, pool: Pool) -> Float[np.ndarray, "spectra candidates"]:
    """What is to be added to log weights where a varnish was stated: its own condition weighs as
    what was stated does, and all others, without it, little.
    """
    (number,) = CONDITIONS_OF_VARNISH[varnish]
    own = -np.log(CONDITIONS[number].chance)
    # Without it: the probability that a varnish which was stated is not there.
    return np.where(pool.condition == number, own, np.log(0.05))


class FilmsUnderCondition(NamedTuple):
    """Films as they would be seen under a condition."""

    task: IdentificationTask
    opaque: bool  # whether they hide their ground
    measured: Measured
    slope: Float[
        np.ndarray, "spectra grounds bands"
    ]  # of these readings by those that were measured

    def take(self, rows: Int[np.ndarray, "rows"]) -> "FilmsUnderCondition":
        """Some of the films, by number."""
        return self._replace(measured=self.measured.take(rows), slope=self.slope[rows])


def films_under(
    number: int, tasks: Mapping[bool, IdentificationTask], stated_opaque: bool, measured: Measured
) -> FilmsUnderCondition:
    """Films under one condition, by its number.

    Args:
        number: of `CONDITIONS`.
        tasks: for films that let the ground through, and for films that hide it.
        stated_opaque: whether they were said to hide it.
        measured: the spectra as they were measured.
    """
    condition = CONDITIONS[number]
    opaque = stated_opaque if condition.opaque is None else condition.opaque
    task = tasks[opaque]
    seen = measured
    slope = np.ones_like(measured.readings)
    if condition.ground is not None:
        seen = replace(seen, grounds=np.full_like(seen.grounds, condition.ground))
    if condition.varnish:
        seen, slope = remove_varnish(seen, task.response, task.surface, condition.varnish)
    return FilmsUnderCondition(task, opaque, seen, slope)


def remove_varnish(
    measured: Measured, response: FilmResponse, surface: float, level: float
) -> tuple[Measured, Float[np.ndarray, "spectra grounds bands"]]:
    """Spectra as they would be without a varnish, and their slopes by the readings under it; NaN
    for spectra that no paint reads under it.

    How much varnish there is is left open: an error of a known shape.

    Args:
        measured: under the varnish.
        response: of the instrument.
        surface: what the outer surface adds to a reading.
        level: optical thickness of the varnish at 400 nm, one of those that are tried.
    """
    absorption = yellow(measured.wavelengths)
    read = measured.readings - surface
    body = np.clip(read, *limits_under(response, level * absorption))
    # Readings that are farther beyond what paint reads under a varnish are no noise.
    possible = (np.abs(read - body) <= 4.0 * measured.noise_sd).all(axis=(1, 2), keepdims=True)
    spread = _LEVELS[level]
    # At this level, at slightly more varnish, and for slightly higher readings.
    bare = without_varnish(response, body, level * absorption)
    more_varnish = without_varnish(response, body, (level + 0.01) * absorption)
    brighter = without_varnish(response, body + 1e-4, level * absorption)
    more = spread / 0.01 * (more_varnish - bare)
    slope = (brighter - bare) / 1e-4
    doubt = more[:, None]
    changed = replace(
        measured, readings=bare + surface, noise_sd=measured.noise_sd * slope, doubt=doubt
    )
    return changed, np.where(possible, slope, np.nan)


def pool_under(number: int, seen: FilmsUnderCondition, pool: Pool) -> Pool:
    """Candidates under one condition as they compete with those of films that lie as stated.

    Args:
        number: of `CONDITIONS`.
        seen: the films under it.
        pool: their candidates.
    """
    condition = CONDITIONS[number]
    task = seen.task

    def add_varnish(readings: np.ndarray) -> np.ndarray:
        shape = seen.measured.readings.shape[1:]
        body = readings.reshape(*readings.shape[:2], *shape) - task.surface
        thickness = condition.varnish * yellow(seen.measured.wavelengths)
        return (under_varnish(task.response, body, thickness) + task.surface).reshape(
            readings.shape
        )

    if condition.varnish:
        pool = replace(
            pool, readings=add_varnish(pool.readings), adjusted=add_varnish(pool.adjusted)
        )
    # What changes of variables add to a spectrum's log density.
    change = task.independent_readings * np.log(seen.slope).mean(axis=(1, 2))
    weight = pool.log_weight + np.log(condition.chance) + change[:, None]
    if condition.ground is not None:
        # What hardly shows is no answer over a ground that nobody stated: it is the ground that is
        # seen.
        clear = np.append(task.extenders, True)[pool.members].all(axis=-1)
        weight = np.where(clear, -np.inf, weight)
    return replace(pool, log_weight=weight, condition=np.full_like(pool.condition, number))
