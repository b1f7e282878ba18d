"""Mixed, or one over another: the odds for the best sets of paints of each spectrum, from readings
over one ground or several; and coats as candidates.
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float
from scipy.special import logsumexp, softmax

from glazejax import Pigment

from ...film.model.errors import Prior
from ...film.shared_bands import SEARCHED
from ..families.templates import coefficients
from ..result import Identification
from ..result.odds import DECIDED, CoatsOdds
from ..search.options import IdentificationOptions
from ..search.pool import Pool
from ..search.task import IdentificationTask
from ..search.weigh import odds_of
from .arrangement import Arrangement, PaintNumbers, ways
from .candidates import with_coats
from .choose_sets import best_sets, nearest_pairs
from .evidence import WeighedSet, weigh_set
from .readings import CoatedFilms


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
    groups = measured.by_grounds()
    few = measured.in_steps(SEARCHED)
    bodies = few.readings - task.surface
    usual = coefficients(pigments, few.wavelengths) * (options.prior or Prior()).thickness
    rarity = np.log(np.where(task.extenders, task.prior.extender, 1.0))
    layered = not task.hides and task.max_paints > 1
    max_coats = min(options.max_coats, options.max_paints)
    weighed = []
    for rows in groups:
        films = CoatedFilms(
            coefficients=usual,
            grounds=few.grounds[rows[0]],
            wavelengths=few.wavelengths,
            optics=task.optics,
            response=task.response,
            hides=task.hides,
        )
        near = nearest_pairs(bodies[rows], films, rarity).tolist() if layered else [()] * len(rows)
        # Spectra over one ground that share a set are weighed together.
        jobs: defaultdict[PaintNumbers, list[int]] = defaultdict(list)
        for row, pairs in zip(rows.tolist(), near, strict=True):
            for members in best_sets(identification, row, max_coats, pairs):
                jobs[members].append(row)
        weighed += [
            weigh_set(members, np.array(job_rows), bodies, films, options)
            for members, job_rows in jobs.items()
        ]
    coats_odds = _odds(len(measured), weighed, identification.paints)
    if layered:
        pool = with_coats(task, measured, pool, weighed, rarity)
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


def coats_of_families(
    identification: Identification, options: IdentificationOptions
) -> Identification:
    """The identification by families with the prior odds of the best set of each spectrum:
    exemplars are paints by other hands, and how much these scatter decides.
    """
    reason = "paints of other makers cannot decide it: name the catalogue of the film's paints"
    max_coats = min(options.max_coats, options.max_paints)
    coats_odds = []
    for row in range(len(identification)):
        row_odds = []
        for members in best_sets(identification, row, max_coats)[:1]:
            names = [identification.paints[member] for member in members]
            row_odds.append(_odds_of(names, ways(len(members), options), 1.0, reason))
        coats_odds.append(tuple(row_odds))
    return replace(identification, coats_odds=tuple(coats_odds))


def _odds(
    count: int, weighed: Sequence[WeighedSet], names: Sequence[str]
) -> tuple[tuple[CoatsOdds, ...], ...]:
    """The sets of each spectrum with their shares, most probable first.

    Args:
        count: of spectra.
        weighed: sets for them.
        names: of all paints.
    """
    totals = [np.asarray(logsumexp(weighed_set.logs, axis=0)) for weighed_set in weighed]
    of_all = np.full(count, -np.inf)
    for weighed_set, total in zip(weighed, totals, strict=True):
        np.logaddexp.at(of_all, weighed_set.rows, total)
    of_rows: list[list[CoatsOdds]] = [[] for _ in range(count)]
    for weighed_set, total in zip(weighed, totals, strict=True):
        shares = np.exp(total - of_all[weighed_set.rows])
        set_names = [names[member] for member in weighed_set.members]
        arrangements = [evidence.arrangement for evidence in weighed_set.evidence]
        # Probability of each arrangement of this set.
        chances = np.asarray(softmax(weighed_set.logs, axis=0))
        for number, row in enumerate(weighed_set.rows):
            chance = chances[:, number]
            reason = _reason(weighed_set, chance, number)
            lies = dict(zip(arrangements, chance.tolist(), strict=True))
            of_rows[row].append(_odds_of(set_names, lies, float(shares[number]), reason))
    return tuple(tuple(sorted(odds, key=lambda of_set: -of_set.share)) for odds in of_rows)


def _odds_of(
    names: Sequence[str], chances: Mapping[Arrangement, float], share: float, reason: str
) -> CoatsOdds:
    """Odds of one set by the chances of the ways in which its paints may lie, to any sum."""
    total = sum(chances.values())
    layered = [chance for arrangement, chance in chances.items() if arrangement.layered]
    return CoatsOdds(
        paints=tuple(names),
        chances={
            arrangement.words(names): chance / total for arrangement, chance in chances.items()
        },
        layered=sum(layered) / total,
        share=share,
        reason=reason,
    )


def _reason(weighed: WeighedSet, chances: Float[np.ndarray, "ways"], number: int) -> str:
    """Give the reason why a spectrum does not show whether there is more than one coat; empty where
    it does.
    """
    layered = float(chances[weighed.layered].sum())
    if max(layered, 1.0 - layered) >= DECIDED:
        return ""
    # The most probable way of several coats, and that of one.
    stack, flat = (
        weighed.evidence[int(np.argmax(np.where(coats, chances, -1.0)))]
        for coats in (weighed.layered, ~weighed.layered)
    )
    stack_reading, flat_reading = (way.readings[number] for way in (stack, flat))
    off = stack_reading - flat_reading * (stack_reading @ flat_reading) / (
        flat_reading @ flat_reading
    )
    # A gain is free in either: this root mean square of a difference the model's own errors do not
    # cover.
    if np.sqrt(np.mean(off**2)) > 0.03:
        return "neither a mixture nor coats of these paints meet it well"
    if flat.arrangement.coats[0] == stack.arrangement.coats[0]:
        return "the upper coat hides the lower one"
    if len(flat.arrangement.paints) == 1:
        return "a second coat, if there is one, hardly shows"
    return "thin coats of these paints look like a mixture"
