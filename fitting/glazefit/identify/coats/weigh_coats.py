"""Mixed, or one over another: the odds for the best sets of paints of each spectrum, from readings
over one ground or several; and coats as candidates.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeAlias

import numpy as np
from jaxtyping import Float, Int
from scipy.special import logsumexp, softmax

from glazejax import Pigment
from glazejax.spectra import Bands

from ...film.model.errors import Prior
from ...film.shared_bands import SEARCHED
from ..families.templates import coefficients
from ..result import Identification
from ..result.odds import DECIDED, CoatsOdds
from ..search.options import IdentificationOptions
from ..search.pool import Pool
from ..search.task import IdentificationTask, OverGrounds
from ..search.weigh import odds_of
from .arrangement import Arrangement, PaintNumbers, arrangements
from .candidates import WeighedSet, log_rarity, with_coats
from .choose_sets import best_sets, nearest_pairs
from .evidence import coefficient_sd, weigh_arrangement
from .readings import CoatedFilms, grid_readings

Chances: TypeAlias = Float[np.ndarray, "ways"]
"""Probability of each way in which paints may lie."""
# Share of readings whose evidence says nothing of how their paints lie: nearly twice that of the
# decided answers of `benchmarks.paintbench --coats` that were wrong while it was taken to be none.
_WORTHLESS = 0.2
# A library rarely separates k and s of a paint: each paint's scattering may also be so much
# less, with this probability.
_FAINT = 0.1
_FAINT_CHANCE = 0.2


def weigh_coats(
    identification: Identification,
    pigments: Sequence[Pigment],
    options: IdentificationOptions,
    task: IdentificationTask,
    pool: Pool,
) -> Identification:
    """The identification with the odds of mixture against superposition for the best sets of each
    spectrum.

    Candidates of two coats then take part in the answer with the probability that their paints lie
    so; there are none of films that hide their ground.

    Args:
        identification: in one coat, from readings over one ground or several.
        pigments: of the catalogue, in the order of its paints.
        options: of the search.
        task: of the search.
        pool: its candidates.
    """
    measured = identification.measured
    opaque = identification.opaque
    sets = [best_sets(identification, row, options.max_coats) for row in range(len(measured))]
    few = measured.in_steps(SEARCHED)
    films = CoatedFilms(
        coefficients=coefficients(pigments, few.wavelengths) * (options.prior or Prior()).thickness,
        grounds=few.grounds[0],
        optics=task.optics,
        response=task.response,
        hides=opaque,
    )
    bodies = few.readings - task.surface
    layered = not opaque and task.max_paints > 1
    weighed = []
    for rows in few.by_grounds():
        over = films._replace(grounds=few.grounds[rows[0]])
        if layered:
            # A film of two coats may look like no mixture of its paints: the two pairs that come
            # nearest as coats are weighed with the best mixture.
            near = nearest_pairs(bodies[rows], over, few.wavelengths, log_rarity(task))
            for row, pairs in zip(rows, near.tolist(), strict=True):
                larger = [paint_set for paint_set in sets[row] if len(paint_set) > 2]
                sets[row] = list(dict.fromkeys([*sets[row][:1], *map(tuple, pairs), *larger]))
        # Spectra over one ground that share a set are weighed together.
        jobs: dict[PaintNumbers, list[int]] = {}
        for row in rows:
            for members in sets[row]:
                jobs.setdefault(members, []).append(row)
        weighed += [
            _weigh_set(members, np.array(job_rows), bodies, over, few.wavelengths, options)
            for members, job_rows in jobs.items()
        ]
    coats_odds = _odds(len(measured), weighed, identification.paints)
    if layered:
        pool = with_coats(task, measured, pool, weighed)
        odds = odds_of(measured, pool, task.prior)
        identification = Identification.of(
            measured,
            pool,
            odds,
            paints=identification.paints,
            opaque=False,
            keep=options.keep,
            spread=identification.spread,
        )
    return replace(identification, coats_odds=coats_odds)


def _weigh_set(
    members: PaintNumbers,
    rows: Int[np.ndarray, "films"],
    bodies: OverGrounds,
    films: CoatedFilms,
    wavelengths: Bands,
    options: IdentificationOptions,
) -> WeighedSet:
    """All ways in which the paints of a set may lie, with amounts, gain, surface and patches
    integrated out.

    Args:
        members: the set, by number.
        rows: spectra over one ground.
        bodies: of all spectra, without the outer surface's part.
        films: of all paints, over this ground.
        wavelengths: of the bands, nm.
        options: of the search.
    """
    # Bands at which each of the paints is known.
    set_coefficients = films.coefficients[:, list(members)]
    bands = np.isfinite(set_coefficients).all(axis=(0, 1))
    films = films._replace(
        coefficients=set_coefficients[..., bands], grounds=films.grounds[:, bands]
    )
    read = bodies[rows][..., bands].reshape(len(rows), -1)
    size = len(members)
    arrangements, chances = _ways(size, options)

    stated = []
    summed = []
    readings = []
    for arrangement, chance in zip(arrangements, chances, strict=True):
        by_library = []
        for factors, share in _scattering_factors(arrangement, size, films.hides):
            k, s = films.coefficients
            s = s * factors[:, None]
            evidence = weigh_arrangement(
                read,
                arrangement,
                grid_readings(arrangement, films._replace(coefficients=np.stack([k, s]))),
                coefficient_sd(k, s)[list(arrangement.paints)],
                wavelengths[bands],
            )
            by_library.append(evidence._replace(log=evidence.log + np.log(chance * share)))
        stated.append(by_library[0])
        # The sum over all libraries, and readings of the best one.
        by_log = np.array([evidence.log for evidence in by_library])
        summed.append(logsumexp(by_log, axis=0))
        of_libraries = np.array([evidence.readings for evidence in by_library])
        readings.append(of_libraries[by_log.argmax(axis=0), np.arange(len(rows))])
    # What a reading says of the ways is worth less than it says.
    logs = np.array(summed)
    total = np.asarray(logsumexp(logs, axis=0))
    tempered = (1.0 - _WORTHLESS) * np.exp(logs - total)
    return WeighedSet(
        members=members,
        rows=rows,
        arrangements=arrangements,
        stated=stated,
        logs=np.log(tempered + _WORTHLESS * (chances / chances.sum())[:, None]) + total,
        readings=np.array(readings),
    )


def _ways(size: int, options: IdentificationOptions) -> tuple[list[Arrangement], Chances]:
    """Ways in which some of a set's paints may lie, and their prior probabilities."""
    prior = options.prior or Prior()
    alone = [Arrangement(((paint,),)) for paint in range(size)]
    together = arrangements(size, min(options.max_coats, size))
    layered = np.array([len(arrangement.coats) > 1 for arrangement in together])
    shares = np.where(layered, prior.stacked / layered.sum(), 1.0 - prior.stacked)
    chances = [np.full(size, prior.sizes[0] / size), prior.sizes[size - 1] * shares]
    return [*alone, *together], np.concatenate(chances)


def coats_of_families(
    identification: Identification, options: IdentificationOptions
) -> Identification:
    """The identification by families with the prior odds of the best set of each spectrum:
    exemplars are paints by other hands, and how much these scatter decides.
    """
    coats_odds: list[tuple[CoatsOdds, ...]] = []
    for row in range(len(identification)):
        sets = best_sets(identification, row, options.max_coats)
        if not sets:
            coats_odds.append(())
            continue
        arrangements, chances = _ways(len(sets[0]), options)
        odds = _odds_of(
            [identification.paints[member] for member in sets[0]],
            arrangements,
            chances / chances.sum(),
            "paints of other makers cannot decide it: name the catalogue of the film's paints",
        )
        coats_odds.append((odds,))
    return replace(identification, coats_odds=tuple(coats_odds))


def _odds_of(
    names: Sequence[str], arrangements: Sequence[Arrangement], chances: Chances, reason: str
) -> CoatsOdds:
    """Odds of one set by those of the ways in which its paints may lie."""
    several = [len(arrangement.coats) > 1 for arrangement in arrangements]
    return CoatsOdds(
        paints=tuple(names),
        chances={
            arrangement.words(names): float(chance)
            for arrangement, chance in zip(arrangements, chances, strict=True)
        },
        layered=float(chances[several].sum()),
        share=1.0,
        reason=reason,
    )


def _scattering_factors(
    arrangement: Arrangement, count: int, hides: bool
) -> list[tuple[Float[np.ndarray, "paints"], float]]:
    """Factors of the paints' scattering that are tried, and how probable each is.

    A thin coat over a ground that shows rarely separates k from s; of a film that hides its ground
    k/s is what was read.
    """
    usual = np.ones(count)
    if hides:
        return [(usual, 1.0)]
    paints = arrangement.paints
    out = [(usual, 1.0 - _FAINT_CHANCE)]
    for paint in paints:
        faint = usual.copy()
        faint[paint] = _FAINT
        out.append((faint, _FAINT_CHANCE / len(paints)))
    return out


def _odds(
    count: int, weighed: Sequence[WeighedSet], names: Sequence[str]
) -> tuple[tuple[CoatsOdds, ...], ...]:
    """The sets of each spectrum with their shares, most probable first.

    Args:
        count: of spectra.
        weighed: sets for them.
        names: of all paints.
    """
    of_rows: list[list[tuple[float, CoatsOdds]]] = [[] for _ in range(count)]
    for weighed_set in weighed:
        set_names = [names[member] for member in weighed_set.members]
        logs = weighed_set.logs
        totals = np.asarray(logsumexp(logs, axis=0))
        # Probability of each arrangement of this set.
        chances = np.exp(logs - totals)
        for number, row in enumerate(weighed_set.rows):
            chance = chances[:, number]
            reason = _reason(weighed_set, chance, number)
            odds = _odds_of(set_names, weighed_set.arrangements, chance, reason)
            of_rows[row].append((float(totals[number]), odds))
    out = []
    for row_odds in of_rows:
        totals = np.array([total for total, _ in row_odds])
        shares = softmax(totals) if row_odds else totals
        ranked = np.argsort(-shares, kind="stable")
        out.append(tuple(replace(row_odds[n][1], share=float(shares[n])) for n in ranked))
    return tuple(out)


def _reason(weighed: WeighedSet, chances: Chances, number: int) -> str:
    """Give the reason why a spectrum does not show whether there is more than one coat; empty where
    it does.
    """
    layered = float(chances[weighed.several].sum())
    if max(layered, 1.0 - layered) >= DECIDED:
        return ""
    most, least = (
        int(np.argmax(np.where(several, chances, -1.0)))
        for several in (weighed.several, ~weighed.several)
    )
    stack, flat = weighed.arrangements[most], weighed.arrangements[least]
    stack_reading, flat_reading = weighed.readings[[most, least], number]
    off = stack_reading - flat_reading * (stack_reading @ flat_reading) / (
        flat_reading @ flat_reading
    )
    # A gain is free in either: this root mean square of a difference the model's own errors do not
    # cover.
    if np.sqrt(np.mean(off**2)) > 0.03:
        return "neither a mixture nor coats of these paints meet it well"
    if flat.coats[0] == stack.coats[0]:
        return "the upper coat hides the lower one"
    if len(flat.paints) == 1:
        return "a second coat, if there is one, hardly shows"
    return "thin coats of these paints look like a mixture"
