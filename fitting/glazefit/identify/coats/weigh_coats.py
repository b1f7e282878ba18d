"""From an identification to the odds of mixture against superposition, for the best sets of paints
of each spectrum.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.special import logsumexp

from glazejax import Pigment
from glazejax.geometry import resolve_instrument

from ...film.model.errors import Prior
from ...film.model.optics import Optics
from ...film.model.response import film_response
from ...film.shared_bands import means_of_steps
from ..families.templates import coefficients
from ..result import NINETY, Identification
from ..result.odds import DECIDED, CoatsOdds
from ..search.options import IdentificationOptions
from ..search.pool import NOBODY
from .arrangement import Arrangement, arrangements
from .evidence import CoatErrors, Evidence, coefficient_sd, weigh_arrangement
from .readings import Paints, Solver, grid_readings

STEP = 10.0
"""Finer spectra are averaged to this, nm: errors are alike over more."""
# Sets that are weighed for a spectrum, and the least share of all sets of their size.
_MOST_SETS = 2
_LEAST_SHARE = 0.05
# A library rarely tells k and s of a paint apart: each paint's scattering may also be so much
# less, with this probability.
_FAINT = 0.1
_FAINT_CHANCE = 0.2
# Root mean square of a difference between two readings that the model's own errors do not cover.
_SEEN = 0.03


class _Library(NamedTuple):
    """Paints and an instrument as coats are weighed with them."""

    names: tuple[str, ...]
    paints: Paints
    usual: float  # amount that the optical thicknesses are of, m
    solver: Solver
    wavelengths: Float[np.ndarray, "bands"]


class _Weighed(NamedTuple):
    """One arrangement of a set of paints, for the spectra that the set is weighed for."""

    arrangement: Arrangement
    log_prior: float
    evidence: Evidence


def weigh_coats(
    found: Identification,
    pigments: Sequence[Pigment],
    options: IdentificationOptions,
    usual: float,
    errors: CoatErrors | None = None,
) -> Identification:
    """The identification with the odds of mixture against superposition.

    For the best sets of two paints (of three, where three coats are tried) all ways in which their
    paints may lie are weighed, each paint alone among them, with amounts, gain, surface and patches
    integrated out. Candidates of several coats take part in the answer with the probability that
    this gives.

    Args:
        found: what a search found, from readings over one ground.
        pigments: of the catalogue, in the order of its paints.
        options: of the search.
        usual: thickness of a usual coat, m.
        errors: what a reading errs by.
    """
    errors = errors or CoatErrors()
    measured = found.measured
    instrument = resolve_instrument(options.instrument)
    # Errors are alike over more than a band: finer spectra are averaged.
    mean = means_of_steps(measured.wavelengths, STEP)
    to_bands = np.eye(measured.wavelengths.size) if mean is None else mean
    wavelengths = measured.wavelengths @ to_bands
    bodies = measured.readings[:, 0] @ to_bands - instrument.seen_surface
    grounds = measured.grounds[:, 0] @ to_bands
    known = coefficients(pigments, wavelengths) * usual
    library = _Library(
        names=found.paints,
        paints=Paints(absorption=known[0], scattering=known[1]),
        usual=usual,
        solver=Solver(
            optics=Optics.of(instrument.geometry, instrument.refractive_index),
            response=film_response(instrument.geometry, instrument.refractive_index),
        ),
        wavelengths=wavelengths,
    )

    # Spectra over one ground that share a set are weighed together.
    odds: list[list[CoatsOdds]] = [[] for _ in range(len(measured))]
    totals: list[list[float]] = [[] for _ in range(len(measured))]
    jobs: dict[tuple[tuple[int, ...], bytes], list[int]] = {}
    for row in range(len(measured)):
        below = b"" if found.opaque else grounds[row].tobytes()
        for members in _best_sets(found, row, options.max_coats):
            jobs.setdefault((members, below), []).append(row)
    for (members, _), rows in jobs.items():
        ground = None if found.opaque else grounds[rows[0]]
        weighed = _weigh_set(members, bodies[rows], library, ground, options, errors)
        for number, row in enumerate(rows):
            one, total = _odds_of(members, weighed, number, library, found.opaque)
            odds[row].append(one)
            totals[row].append(total)
    return _with_odds(found, [_with_shares(*both) for both in zip(odds, totals, strict=True)])


def _best_sets(found: Identification, row: int, max_coats: int) -> list[tuple[int, ...]]:
    """The most probable sets of two paints, however they lie; of three where three coats are
    tried.
    """
    chances: dict[tuple[int, ...], float] = {}
    for members, chance in zip(found.members[row], found.probability[row], strict=True):
        own = tuple(sorted(int(member) for member in members if member != NOBODY))
        if len(own) > 1 and chance > 0:
            chances[own] = chances.get(own, 0.0) + float(chance)
    likely = np.argsort(-found.paint_probability[row], kind="stable")
    out = []
    for size in (2, 3)[: max_coats - 1]:
        of_size = {own: chance for own, chance in chances.items() if len(own) == size}
        if not of_size and len(likely) >= size:
            # None was kept: the paints that are most probable, whatever stands beside them.
            of_size = {tuple(sorted(int(paint) for paint in likely[:size])): 1.0}
        total = sum(of_size.values())
        best = sorted(of_size, key=lambda own: -of_size[own])
        most = _MOST_SETS if size == 2 else 1
        out += [own for own in best[:most] if of_size[own] >= _LEAST_SHARE * total]
    return out


def _weigh_set(
    members: tuple[int, ...],
    bodies: Float[np.ndarray, "films bands"],
    library: _Library,
    ground: Float[np.ndarray, "bands"] | None,
    options: IdentificationOptions,
    errors: CoatErrors,
) -> list[_Weighed]:
    """All ways in which the paints of a set may lie, weighed for some films."""
    prior = options.prior or Prior()
    rows = list(members)
    paints = Paints(library.paints.absorption[rows], library.paints.scattering[rows])
    # Bands at which each of them is known.
    bands = np.isfinite(paints.absorption).all(axis=0)
    paints = Paints(paints.absorption[:, bands], paints.scattering[:, bands])
    below = None if ground is None else ground[bands]
    ways = arrangements(len(members), min(options.max_coats, len(members)))
    several = [way for way in ways if len(way.coats) > 1]
    alone = [Arrangement(((place,),)) for place in range(len(members))]
    singles = np.log(prior.sizes[0] / len(members))
    mixture = np.log(prior.sizes[len(members) - 1] * (1.0 - prior.stacked))
    stack = np.log(prior.sizes[len(members) - 1] * prior.stacked / max(len(several), 1))

    out = []
    for way in [*alone, *ways]:
        log_prior = singles if len(way.paints) == 1 else stack if way in several else mixture
        parts = []
        for factors, chance in _scattering_factors(way, len(members), hides=below is None):
            own = paints.with_scattering(factors)
            deviations = coefficient_sd(own.absorption, own.scattering, errors)
            evidence = weigh_arrangement(
                bodies[:, bands],
                way,
                grid_readings(way, own, library.solver, below),
                deviations[list(way.paints)],
                library.wavelengths[bands],
                errors,
            )
            parts.append(evidence._replace(log=evidence.log + np.log(chance)))
        out.append(_Weighed(arrangement=way, log_prior=float(log_prior), evidence=_summed(parts)))
    return out


def _scattering_factors(
    arrangement: Arrangement, count: int, hides: bool
) -> list[tuple[Float[np.ndarray, "paints"], float]]:
    """Factors of the paints' scattering that are tried, and how probable each is.

    A thin coat over a ground that shows rarely told k from s; of a film that hides its ground k/s
    is what was read.
    """
    usual = np.ones(count)
    if hides:
        return [(usual, 1.0)]
    own = arrangement.paints
    out = [(usual, 1.0 - _FAINT_CHANCE)]
    for place in own:
        faint = usual.copy()
        faint[place] = _FAINT
        out.append((faint, _FAINT_CHANCE / len(own)))
    return out


def _summed(parts: Sequence[Evidence]) -> Evidence:
    """Evidence over several libraries; amounts and readings are those of the best one."""
    logs = np.array([part.log for part in parts])
    best = np.argmax(logs, axis=0)
    films = np.arange(logs.shape[1])
    return Evidence(
        log=np.asarray(logsumexp(logs, axis=0)),
        log_amounts=np.array([part.log_amounts for part in parts])[best, films],
        log_amounts_sd=np.array([part.log_amounts_sd for part in parts])[best, films],
        readings=np.array([part.readings for part in parts])[best, films],
    )


def _odds_of(
    members: tuple[int, ...],
    weighed: Sequence[_Weighed],
    number: int,
    library: _Library,
    opaque: bool,
) -> tuple[CoatsOdds, float]:
    """Odds of one film for one set, and the log of the set's whole weight."""
    names = [library.names[member] for member in members]
    logs = np.array([one.log_prior + one.evidence.log[number] for one in weighed])
    total = float(np.asarray(logsumexp(logs)))
    chances = np.exp(logs - total)
    layered = float(sum(chances[n] for n, one in enumerate(weighed) if _several(one)))
    best = weighed[int(np.argmax(chances))]
    amounts = np.full((len(members), 2), np.nan)
    if not opaque:
        middle = best.evidence.log_amounts[number][:, None]
        spread = best.evidence.log_amounts_sd[number][:, None] * NINETY
        amounts[list(best.arrangement.paints)] = library.usual * np.exp(middle + spread)
    odds = CoatsOdds(
        paints=tuple(names),
        chances={
            one.arrangement.words(names): float(chance)
            for one, chance in zip(weighed, chances, strict=True)
        },
        layered=layered,
        share=1.0,
        reason=_reason(weighed, chances, layered, number),
        amounts_90=amounts,
    )
    return odds, total


def _several(one: _Weighed) -> bool:
    return len(one.arrangement.coats) > 1


def _reason(
    weighed: Sequence[_Weighed], chances: Float[np.ndarray, "ways"], layered: float, number: int
) -> str:
    """Why a spectrum does not tell whether there is more than one coat; empty where it does."""
    if max(layered, 1.0 - layered) >= DECIDED:
        return ""
    order = np.argsort(-chances, kind="stable")
    stack = next(weighed[n] for n in order if _several(weighed[n]))
    flat = next(weighed[n] for n in order if not _several(weighed[n]))
    one, other = (way.evidence.readings[number] for way in (stack, flat))
    # A gain is free in either.
    off = one - other * (one @ other) / (other @ other)
    if np.sqrt(np.mean(off**2)) > _SEEN:
        return "neither a mixture nor coats of these paints meet it well"
    if flat.arrangement.coats[0] == stack.arrangement.coats[0]:
        return "the upper coat hides what is below"
    if len(flat.arrangement.paints) == 1:
        return "a second coat, if there is one, hardly shows"
    return "thin coats of these paints look like a mixture"


def _with_shares(odds: Sequence[CoatsOdds], totals: Sequence[float]) -> tuple[CoatsOdds, ...]:
    """The sets of one film with their shares, most probable first."""
    if not odds:
        return ()
    shares = np.exp(np.array(totals) - logsumexp(totals))
    ranked = np.argsort(-shares, kind="stable")
    return tuple(replace(odds[n], share=float(shares[n])) for n in ranked)


def _with_odds(found: Identification, odds: Sequence[tuple[CoatsOdds, ...]]) -> Identification:
    """The identification with these odds, its candidates' probabilities in keeping with them."""
    probability = found.probability.copy()
    stacked = (found.coats > 0).any(axis=-1) & (found.members != NOBODY).any(axis=-1)
    for row, own in enumerate(odds):
        if not own:
            continue
        layered = sum(one.share * one.layered for one in own)
        before = float(probability[row, stacked[row]].sum())
        rest = float(probability[row, ~stacked[row]].sum())
        if before > 0.0 and rest > 0.0:
            probability[row, stacked[row]] *= layered * (before + rest) / before
            probability[row, ~stacked[row]] *= (1.0 - layered) * (before + rest) / rest
    order = np.argsort(-probability, axis=1, kind="stable")
    return found.reordered(order, np.take_along_axis(probability, order, axis=1), tuple(odds))
