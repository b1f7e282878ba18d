"""Sureness of a search, learnt from its own exemplars: each is searched among those of other
sources, once with its family and once without.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.optimize import minimize

from glazejax.progress import Progress
from glazejax.radiative.common.chunks import pieces_of

from ...film.numerics.weighted import numbers_at
from ..result.groups import COLOURLESS, group_of
from .search import FamilySearch
from .sureness import PerFamilySet, Sureness, log_densities
from .templates import FilmCurves, PerExemplar

POWERS = (0.15, 0.2, 0.25, 0.33, 0.5, 0.75)
"""Powers within a set that are tried."""
SHARPNESSES = (0.8, 1.0, 1.15, 1.3, 1.5, 1.75, 2.0)
"""Powers between sets that are tried."""
# Where no two sources share a family: the power that is learnt as a rule.
_UNTAUGHT = Sureness(power=0.33)
FALSE_ALARMS = 0.05
"""Share of paints of a known family that are said to be of none."""
# The slopes of 'none' are pulled to the evidence as it is by Gaussians of this width.
_SLOPE_SD = 1.0
# Exemplars of a source's family that are searched while it is learnt how sure a search may be.
_SOUGHT = 4


def learn_sureness(
    search: FamilySearch,
    readings: FilmCurves,
    rows: PerExemplar,
    progress: Progress,
) -> Sureness:
    """Sureness with which what a search says of its exemplars comes true: each is searched among
    those of other sources, with its family and without.

    Args:
        search: with all that it compares; how sure it is does not count.
        readings: of a film of each exemplar (`exemplars_as_readings`), with what varies from film
            to film, such as a varnish.
        rows: numbers of these exemplars.
        progress: called with readings that are searched.
    """
    chosen = _few_of_each(search.source_of[rows], search.family_of[rows])
    readings = readings[chosen]
    rows = rows[chosen]
    sources = search.source_of[rows]
    truth = search.family_of[rows]
    of_others = search.source_of != sources[:, None]
    comparable = (of_others & (search.family_of == truth[:, None])).any(axis=1)
    if not comparable.any():  # Of a family by one hand nothing can be learnt.
        return _UNTAUGHT
    has_family = (search.members == truth[:, None, None]).any(axis=-1)
    named = right_sets(search)[truth]
    weights = _weights(search, sources, truth)

    # A few readings at a time: log odds of all sets at each power.
    log_odds = []
    any_paint = []
    for some in pieces_of(np.arange(len(readings)), search.chunk):
        progress(int(some[0]), len(readings), "trying families")
        density, evidence, possible = search.compare(readings[some], sources[some])
        any_paint.append(density)
        logs = [search._sum_by_set(evidence, possible, power).logs for power in POWERS]
        log_odds.append(np.array(logs) + search.log_prior)
    by_power = dict(zip(POWERS, np.concatenate(log_odds, axis=1), strict=True))

    # First how sure one set is relative to others, among paints whose family is there.
    sureness = learn_power(
        {power: logs[comparable] for power, logs in by_power.items()},
        search.log_prior,
        named[comparable],
        weights[comparable],
    )
    # Then how probable none is, with the family and without.
    logs = by_power[sureness.power]
    density = np.concatenate(any_paint)
    slopes, intercept, least = learn_none(
        log_densities(logs[comparable], density[comparable]),
        log_densities(np.where(has_family, -np.inf, logs), density),
        (weights[comparable], weights),
    )
    return replace(sureness, slopes=slopes, intercept=intercept, least=least)


def learn_power(
    log_sets: Mapping[float, Float[np.ndarray, "readings sets"]],
    log_prior: PerFamilySet,
    correct: Bool[np.ndarray, "readings sets"],
    weights: Float[np.ndarray, "readings"],
) -> Sureness:
    """Power with the best mean log probability of the truth, then sharpness with the same.

    Args:
        log_sets: power -> log evidence of each set, with its prior.
        log_prior: of the sets.
        correct: which sets name the truth.
        weights: of the readings.
    """

    def score(choice: Sureness) -> float:
        shares = choice.share(log_sets[choice.power], log_prior)
        # A truth without a chance costs much, and not all.
        return float(weights @ np.log(np.maximum(np.sum(shares * correct, axis=1), 1e-9)))

    best = max((Sureness(power=power) for power in log_sets), key=score)
    return max((replace(best, sharpness=sharpness) for sharpness in SHARPNESSES), key=score)


def learn_none(
    with_family: Float[np.ndarray, "known 2"],
    without: Float[np.ndarray, "readings 2"],
    weights: tuple[Float[np.ndarray, "known"], Float[np.ndarray, "readings"]],
) -> tuple[tuple[float, float], float, float]:
    """Slopes and intercept of the log odds of 'one of the families' over `log_densities`, by
    logistic regression in which both halves count equally; and the log evidence that all but a few
    readings of a known family exceed.

    Args:
        with_family: log evidence, and log density as any paint, of readings whose family is there.
        without: of readings whose family was taken out.
        weights: of both.
    """
    densities = np.concatenate([with_family, without])
    # Odds speak for the truth where it is one of the families, and elsewhere against it.
    sign = np.repeat([-1.0, 1.0], [len(with_family), len(without)])
    normalised = np.concatenate([w / np.sum(w) for w in weights])
    # The evidence as it is, and nothing else.
    usual = np.array([1.0, 0.0, 0.0])

    def loss(line: Float[np.ndarray, "3"]) -> float:
        odds = densities @ line[:2] + line[2]
        misfit = np.sum(normalised * np.logaddexp(0.0, sign * odds))
        pull = np.sum(((line - usual)[:2] / _SLOPE_SD) ** 2)
        return float(misfit + 0.5 * pull / len(densities))

    of_evidence, of_density, intercept = minimize(loss, usual, method="BFGS").x.tolist()
    evidence = with_family[:, 0]
    order = np.argsort(evidence)
    least = float(evidence[order][numbers_at(weights[0][order], FALSE_ALARMS)])
    # More evidence never speaks for 'none'.
    return (max(of_evidence, 0.0), of_density), intercept, least


def right_sets(search: FamilySearch) -> Bool[np.ndarray, "families sets"]:
    """True for sets that name a pure paint of each family rightly: by its group, whatever
    colourless family accompanies a coloured one.
    """
    right = [
        [group in answer and (group in COLOURLESS or len(answer) == 1) for answer in search.answers]
        for group in map(group_of, search.families)
    ]
    return np.array(right, dtype=bool)


def _few_of_each(sources: PerExemplar, families: PerExemplar) -> Int[np.ndarray, "kept"]:
    """Exemplars of each source's families, evenly through their order, at most some of each."""
    chosen: list[int] = []
    for source, family in set(zip(sources.tolist(), families.tolist(), strict=True)):
        rows = np.flatnonzero((sources == source) & (families == family))
        positions = np.linspace(0, len(rows) - 1, min(len(rows), _SOUGHT)).round().astype(int)
        chosen += rows[positions].tolist()
    return np.array(sorted(chosen))


def _weights(
    search: FamilySearch, sources: Int[np.ndarray, "readings"], truth: Int[np.ndarray, "readings"]
) -> Float[np.ndarray, "readings"]:
    """Each source counts by the share of the exemplars that are left without it: where most are
    gone, little is learnt of how sure all of them make. In a source each family counts equally.
    """
    of_source = sources == sources[:, None]
    share = 1.0 / np.sum(of_source & (truth == truth[:, None]), axis=1)
    remaining = np.mean(search.source_of != sources[:, None], axis=1)
    return remaining * share / (of_source @ share)


def exemplars_as_readings(
    search: FamilySearch,
) -> tuple[Float[np.ndarray, "exemplars bands"], PerExemplar]:
    """One film of each exemplar, on all bands; beyond those that are compared, as at the last."""
    films = search.templates
    pure = np.flatnonzero(films.members[:, 1] < 0)
    rows, first = np.unique(films.members[pure, 0], return_index=True)
    readings = [
        np.interp(search.wavelengths, search.grid, reading) + search.surface
        for reading in films.readings[pure[first]]
    ]
    return np.array(readings), rows
