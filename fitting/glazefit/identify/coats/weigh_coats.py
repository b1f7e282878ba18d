"""Mixed, or one over another: the odds for the best sets of paints of each spectrum, from readings
over one ground or several; and coats as candidates.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int
from scipy.special import logsumexp

from glazejax import Pigment

from ...film.model.errors import Prior
from ..families.templates import coefficients
from ..result import NINETY, Identification
from ..result.odds import DECIDED, CoatsOdds
from ..search.options import IdentificationOptions
from ..search.pool import Pool
from ..search.task import IdentificationTask, Measured
from ..search.weigh import odds_of
from .arrangement import Arrangement, arrangements
from .candidates import WeighedSet, log_rarity, with_coats
from .choose_sets import best_sets, nearest_pairs
from .evidence import CoatErrors, Evidence, coefficient_sd, weigh_arrangement
from .readings import CoatedFilms, grid_readings

STEP = 10.0
"""Finer spectra are averaged to this, nm: errors are correlated over more."""
# Share of readings whose evidence says nothing of how their paints lie: nearly twice that of the
# decided answers of `benchmarks.paintbench --coats` that were wrong while it was taken to be none.
_WORTHLESS = 0.2
# A library rarely separates k and s of a paint: each paint's scattering may also be so much
# less, with this probability.
_FAINT = 0.1
_FAINT_CHANCE = 0.2


Sets = list[tuple[int, ...]]


class _CoatSpectra(NamedTuple):
    """Spectra as coats are weighed by them, and all paints of the catalogue.

    Attributes:
        bodies: readings without the outer surface's part, on bands over which errors are
            correlated.
        grounds: internal reflectance under the paint.
        wavelengths: of the bands, nm.
        films: of all paints, over the ground of the first spectrum.
        names: of the paints.
        usual: amount that the optical thicknesses are of, m.
        groups: numbers of the spectra over each ground.
    """

    bodies: Float[np.ndarray, "spectra grounds bands"]
    grounds: Float[np.ndarray, "spectra grounds bands"]
    wavelengths: Float[np.ndarray, "bands"]
    films: CoatedFilms
    names: tuple[str, ...]
    usual: float
    groups: list[Int[np.ndarray, "rows"]]

    @classmethod
    def of(
        cls,
        measured: Measured,
        pigments: Sequence[Pigment],
        task: IdentificationTask,
        usual: float,
        opaque: bool,
    ) -> "_CoatSpectra":
        """Arguments as of `weigh_coats`, and whether the films hide their ground."""
        # Errors are correlated over more than a band: finer spectra are averaged.
        few = measured.in_steps(STEP)
        return cls(
            bodies=few.readings - task.surface,
            grounds=few.grounds,
            wavelengths=few.wavelengths,
            films=CoatedFilms(
                coefficients=coefficients(pigments, few.wavelengths) * usual,
                grounds=few.grounds[0],
                optics=task.optics,
                response=task.response,
                hides=opaque,
            ),
            names=tuple(pigment.name for pigment in pigments),
            usual=usual,
            groups=few.by_grounds(),
        )

    def by_grounds(self) -> list[tuple[Int[np.ndarray, "rows"], CoatedFilms]]:
        """Spectra by their grounds, each with films over these."""
        return [(rows, self.films._replace(grounds=self.grounds[rows[0]])) for rows in self.groups]


def weigh_coats(
    identification: Identification,
    pigments: Sequence[Pigment],
    options: IdentificationOptions,
    usual: float,
    searched: tuple[IdentificationTask, Pool],
) -> Identification:
    """The identification with the odds of mixture against superposition for the best sets of each
    spectrum.

    Candidates of two coats then take part in the answer with the probability that their paints lie
    so; there are none of films that hide their ground.

    Args:
        identification: in one coat, from readings over one ground or several.
        pigments: of the catalogue, in the order of its paints.
        options: of the search.
        usual: thickness of a usual coat, m.
        searched: what paints were searched with, and the candidates.
    """
    measured = identification.measured
    sets = _best_sets(identification, options)
    task, pool = searched
    spectra = _CoatSpectra.of(measured, pigments, task, usual, identification.opaque)
    if identification.opaque or options.max_paints == 1 or len(pigments) == 1:
        return replace(identification, coats_odds=_odds(spectra, _weigh(spectra, sets, options)))

    for rows, films in spectra.by_grounds():
        # A film of two coats may look like no mixture of its paints: the two pairs that come
        # nearest as coats are weighed with the best mixture.
        near = nearest_pairs(spectra.bodies[rows], films, spectra.wavelengths, log_rarity(task), 2)
        for row, pairs in zip(rows, near.tolist(), strict=True):
            larger = [paint_set for paint_set in sets[row] if len(paint_set) > 2]
            sets[row] = list(dict.fromkeys([*sets[row][:1], *map(tuple, pairs), *larger]))
    weighed = _weigh(spectra, sets, options)
    pool = with_coats(task, measured, pool, weighed)
    odds = odds_of(measured, pool, task.prior)
    with_stacks = Identification.of(
        measured, pool, odds, paints=identification.paints, opaque=False, keep=options.keep
    )
    return replace(with_stacks, coats_odds=_odds(spectra, weighed))


def _weigh(
    spectra: _CoatSpectra, sets: Sequence[Sets], options: IdentificationOptions
) -> list[WeighedSet]:
    """All ways in which the paints of sets may lie, with amounts, gain, surface and patches
    integrated out; spectra over one ground that share a set are weighed together.
    """
    out = []
    for rows, films in spectra.by_grounds():
        jobs: dict[tuple[int, ...], list[int]] = {}
        for row in rows:
            for members in sets[row]:
                jobs.setdefault(members, []).append(row)
        out += [
            _weigh_set(members, np.array(job_rows), spectra, films, options)
            for members, job_rows in jobs.items()
        ]
    return out


def _weigh_set(
    members: tuple[int, ...],
    rows: Int[np.ndarray, "films"],
    spectra: _CoatSpectra,
    films: CoatedFilms,
    options: IdentificationOptions,
) -> WeighedSet:
    """A set of paints for some spectra over one ground."""
    errors = CoatErrors()
    # Bands at which each of the paints is known.
    set_coefficients = films.coefficients[:, list(members)]
    bands = np.isfinite(set_coefficients).all(axis=(0, 1))
    films = films._replace(
        coefficients=set_coefficients[..., bands], grounds=films.grounds[:, bands]
    )
    bodies = spectra.bodies[rows][..., bands].reshape(len(rows), -1)
    size = len(members)
    arrangements, chances = _ways(size, options)

    stated = []
    summed = []
    for arrangement, chance in zip(arrangements, chances, strict=True):
        by_library = []
        for factors, share in _scattering_factors(arrangement, size, films.hides):
            k, s = films.coefficients
            s = s * factors[:, None]
            evidence = weigh_arrangement(
                bodies,
                arrangement,
                grid_readings(arrangement, films._replace(coefficients=np.stack([k, s]))),
                coefficient_sd(k, s, errors)[list(arrangement.paints)],
                spectra.wavelengths[bands],
                errors,
            )
            by_library.append(evidence._replace(log=evidence.log + np.log(chance * share)))
        stated.append(by_library[0])
        summed.append(_summed(by_library))
    # What a reading says of the ways is worth less than it says.
    logs = np.array([evidence.log for evidence in summed])
    total = np.asarray(logsumexp(logs, axis=0))
    tempered = (1.0 - _WORTHLESS) * np.exp(logs - total)
    worth = np.log(tempered + _WORTHLESS * (chances / chances.sum())[:, None]) + total
    return WeighedSet(
        members=members,
        rows=rows,
        arrangements=arrangements,
        stated=stated,
        evidence=[evidence._replace(log=log) for evidence, log in zip(summed, worth, strict=True)],
    )


def _ways(
    size: int, options: IdentificationOptions
) -> tuple[list[Arrangement], Float[np.ndarray, "ways"]]:
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
    sets = _best_sets(identification, options)
    odds = tuple(_odds_beforehand(row_sets, identification.paints, options) for row_sets in sets)
    return replace(identification, coats_odds=odds)


def _best_sets(identification: Identification, options: IdentificationOptions) -> list[Sets]:
    """Of each spectrum."""
    chances = zip(
        identification.members,
        identification.probability,
        identification.paint_probability,
        strict=True,
    )
    return [best_sets(*of_row, options.max_coats) for of_row in chances]


def _odds_beforehand(
    sets: Sets, names: Sequence[str], options: IdentificationOptions
) -> tuple[CoatsOdds, ...]:
    """Odds of the best set of a spectrum, whatever was read."""
    if not sets:
        return ()
    set_names = [names[member] for member in sets[0]]
    arrangements, chances = _ways(len(set_names), options)
    chances = chances / chances.sum()
    several = [len(arrangement.coats) > 1 for arrangement in arrangements]
    odds = CoatsOdds(
        paints=tuple(set_names),
        chances={
            arrangement.words(set_names): float(chance)
            for arrangement, chance in zip(arrangements, chances, strict=True)
        },
        layered=float(chances[several].sum()),
        share=1.0,
        reason="paints of other makers cannot decide it: name the catalogue of the film's paints",
        amounts_90=np.full((len(set_names), 2), np.nan),
    )
    return (odds,)


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


def _summed(by_library: Sequence[Evidence]) -> Evidence:
    """Evidence over several libraries; amounts and readings are those of the best one."""
    logs = np.array([evidence.log for evidence in by_library])
    best = np.argmax(logs, axis=0)
    films = np.arange(logs.shape[1])
    return Evidence(
        log=np.asarray(logsumexp(logs, axis=0)),
        log_amounts=np.array([evidence.log_amounts for evidence in by_library])[best, films],
        covariance=np.array([evidence.covariance for evidence in by_library])[best, films],
        nearest=np.array([evidence.nearest for evidence in by_library])[best, films],
        readings=np.array([evidence.readings for evidence in by_library])[best, films],
    )


def _odds(
    spectra: _CoatSpectra, weighed: Sequence[WeighedSet]
) -> tuple[tuple[CoatsOdds, ...], ...]:
    """The sets of each spectrum with their shares, most probable first."""
    of_rows: list[list[tuple[float, CoatsOdds]]] = [[] for _ in spectra.bodies]
    for weighed_set in weighed:
        for number, row in enumerate(weighed_set.rows):
            total = float(np.asarray(logsumexp(weighed_set.logs[:, number])))
            of_rows[row].append((total, _odds_of(spectra, weighed_set, number)))
    out = []
    for row_odds in of_rows:
        totals = np.array([total for total, _ in row_odds])
        shares = np.exp(totals - logsumexp(totals)) if row_odds else totals
        ranked = np.argsort(-shares, kind="stable")
        out.append(tuple(replace(row_odds[n][1], share=float(shares[n])) for n in ranked))
    return tuple(out)


def _odds_of(spectra: _CoatSpectra, weighed: WeighedSet, number: int) -> CoatsOdds:
    """Odds of one film for one set."""
    names = [spectra.names[member] for member in weighed.members]
    logs = weighed.logs[:, number]
    # Probability of each arrangement of this set.
    chances = np.exp(logs - np.asarray(logsumexp(logs)))
    best = int(np.argmax(chances))
    # Amounts in the most probable one, where the ground shows.
    amounts = np.full((len(names), 2), np.nan)
    if not spectra.films.hides:
        evidence = weighed.evidence[best]
        spread = np.sqrt(np.maximum(np.diagonal(evidence.covariance[number]), 0.0))
        logs_90 = evidence.log_amounts[number][:, None] + spread[:, None] * NINETY
        amounts[list(weighed.arrangements[best].paints)] = spectra.usual * np.exp(logs_90)
    layered = float(chances[weighed.several].sum())
    return CoatsOdds(
        paints=tuple(names),
        chances={
            arrangement.words(names): float(chance)
            for arrangement, chance in zip(weighed.arrangements, chances, strict=True)
        },
        layered=layered,
        share=1.0,
        reason=_reason(weighed, chances, layered, number),
        amounts_90=amounts,
    )


def _reason(
    weighed: WeighedSet, chances: Float[np.ndarray, "ways"], layered: float, number: int
) -> str:
    """Give the reason why a spectrum does not show whether there is more than one coat; empty where
    it does.
    """
    if max(layered, 1.0 - layered) >= DECIDED:
        return ""
    most, least = (
        int(np.argmax(np.where(several, chances, -1.0)))
        for several in (weighed.several, ~weighed.several)
    )
    stack, flat = weighed.arrangements[most], weighed.arrangements[least]
    stack_reading, flat_reading = (
        weighed.evidence[index].readings[number] for index in (most, least)
    )
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
