"""Probabilities of candidates, and of none of them."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from ...film.model.errors import Prior
from .pool import NOBODY, Pool
from .task import Measured

MISFIT = (-0.98, 1.83)
"""Of `log_odds_of_none`: at a misfit of 1, and its slope by the logarithm."""
UNSEEN = 1.0
"""Delta E00 below which two colours look the same."""
REJECTED = 4.0
"""Delta E00 above which a person sees that the fit is none."""

# Delta E00 by which a paint earns its place in a set.
_EARNS_COLOUR = 0.5
# Delta E00 for a residual's root mean square of 1, in the middle of the films that were left out.
_COLOUR_OF_RMSE = 100.0


def weigh_traces(pool: Pool, extenders: Bool[np.ndarray, "paints"]) -> Pool:
    """The pool, in which films of an extender with a mere trace of colour are less probable: the
    less of it, the less, below a mass fraction of .02. In what is nearly clear, traces that nobody
    would weigh imitate any colour.

    Args:
        pool: candidates with their log amounts.
        extenders: which paints hardly show in a film of usual thickness.
    """
    present = pool.members != NOBODY
    amounts = np.where(present, np.exp(np.where(present, pool.logs, 0.0)), 0.0)
    clear = np.append(extenders, False)[pool.members]
    coloured = np.sum(np.where(clear, 0.0, amounts), axis=-1) / amounts.sum(axis=-1)
    # What is an extender alone is no trace.
    share = np.where(coloured > 0.0, np.minimum(coloured / 0.02, 1.0), 1.0)
    return replace(pool, log_weight=pool.log_weight + np.log(share))


class Misfits(NamedTuple):
    """Misfits of candidates to the spectra; infinite for those that hardly matter."""

    delta_e: Float[
        np.ndarray, "spectra candidates"
    ]  # Delta E00, the larger over the grounds, as fitted
    adjusted_delta_e: Float[
        np.ndarray, "spectra candidates"
    ]  # the same with errors of their paints allowed
    residual: Float[
        np.ndarray, "spectra candidates"
    ]  # root mean square of the latter's residual, noise aside
    noise_delta_e: Float[np.ndarray, "spectra"]  # Delta E00 that noise alone makes


class Odds(NamedTuple):
    """Odds of candidates and of none of them, before they are made to sum to 1."""

    candidates: Float[np.ndarray, "spectra candidates"]
    none: Float[np.ndarray, "spectra"]
    misfit: Float[np.ndarray, "spectra"]  # see `glazefit.Identification`
    rejected: Bool[np.ndarray, "spectra candidates"]  # by eye
    misfits: Misfits

    @property
    def total(self) -> Float[np.ndarray, "spectra"]:
        """Of all there is."""
        return self.candidates.sum(axis=1) + self.none


class Smaller(NamedTuple):
    """One candidate, and those of the same film less one paint."""

    candidate: int
    subsets: list[int]


def odds_of(measured: Measured, pool: Pool, prior: Prior, *, looked_at: int = 40) -> Odds:
    """Odds of all candidates and of none.

    Args:
        measured: spectra.
        pool: their candidates.
        prior: what was expected.
        looked_at: candidates whose colour is compared with the spectrum's; the others have odds of
            0.
    """
    weight = np.where(np.isfinite(pool.log_weight), pool.log_weight, -np.inf)
    share = _shares(weight)
    misfits = _misfits(measured, pool, share, looked_at)
    odds, rejected = _judge(share, misfits, prior)
    # Paints that nothing needs give way, spectrum by spectrum, as each has its own candidates.
    for row in range(len(odds)):
        order = smaller_sets(
            members=pool.members[row],
            condition=pool.condition[row],
            log_weight=pool.log_weight[row],
            possible=(odds[row] > 0) & ~pool.coats[row].any(axis=-1),
        )
        odds[row : row + 1] = simplest(
            order, weight[row : row + 1], misfits.delta_e[row : row + 1], odds[row : row + 1]
        )
    return _beside_none(odds, rejected, misfits, prior)


def odds_of_shared_candidates(
    weight: Float[np.ndarray, "spectra candidates"],
    misfits: Misfits,
    order: Sequence[Smaller],
    prior: Prior,
) -> Odds:
    """Odds of spectra that all have the same candidates.

    Args:
        weight: log evidence and log prior of each.
        misfits: how far each is off.
        order: of `smaller_sets`.
        prior: what was expected.
    """
    odds, rejected = _judge(_shares(weight), misfits, prior)
    return _beside_none(simplest(order, weight, misfits.delta_e, odds), rejected, misfits, prior)


def _shares(
    weight: Float[np.ndarray, "spectra candidates"],
) -> Float[np.ndarray, "spectra candidates"]:
    """Probability of each candidate before its misfit counts, if the film is of the catalogue's
    paints.
    """
    share = np.exp(weight - weight.max(axis=1, keepdims=True))
    return share / share.sum(axis=1, keepdims=True)


def _judged_misfit(misfits: Misfits) -> Float[np.ndarray, "spectra candidates"]:
    """Misfit in Delta E00 by which candidates are judged."""
    # Geometric mean of the colour differences as fitted and with the paints' errors, less what
    # noise alone makes of a colour.
    squared = np.maximum(
        misfits.delta_e * misfits.adjusted_delta_e - misfits.noise_delta_e[:, None] ** 2, 0.0
    )
    # A residual may have a shape that no colour shows.
    return np.maximum(np.sqrt(squared), _COLOUR_OF_RMSE * misfits.residual)


def _judge(
    share: Float[np.ndarray, "spectra candidates"], misfits: Misfits, prior: Prior
) -> tuple[Float[np.ndarray, "spectra candidates"], Bool[np.ndarray, "spectra candidates"]]:
    """Odds of candidates by their misfit too, and whether a person would reject each by eye."""
    # Invisible differences count equally: what fits best is not for that more likely to be
    # there.
    odds = (
        share
        * np.exp(-log_odds_of_none(np.maximum(_judged_misfit(misfits), UNSEEN)))
        * (1.0 - prior.unknown)
    )
    # A fit that a person rejects by eye is never more probable than none.
    rejected = misfits.delta_e**2 - misfits.noise_delta_e[:, None] ** 2 > REJECTED**2
    return np.where(rejected, np.minimum(odds, share * prior.unknown), odds), rejected


def _beside_none(
    odds: Float[np.ndarray, "spectra candidates"],
    rejected: Bool[np.ndarray, "spectra candidates"],
    misfits: Misfits,
    prior: Prior,
) -> Odds:
    """Odds with those of none: the smaller the misfit the less probable is none, even
    where nobody would see the misfit.
    """
    # Geometric mean of the candidates' misfits, each with its odds; those without odds have none.
    weights = odds / odds.sum(axis=1, keepdims=True)
    log_misfits = np.log(np.clip(_judged_misfit(misfits), 0.1, 100.0))
    misfit = np.exp(np.sum(np.where(weights > 0, weights * log_misfits, 0.0), axis=1))
    # As many odds as expected at a misfit that is just not seen, and fewer below; what is seen has
    # lowered the candidates' own odds already.
    none = prior.unknown * np.exp(
        log_odds_of_none(np.minimum(misfit, UNSEEN)) - log_odds_of_none(UNSEEN)
    )
    return Odds(candidates=odds, none=none, misfit=misfit, rejected=rejected, misfits=misfits)


def log_odds_of_none(misfit: float | Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
    """Log of how much more often a film misses by this if its paints are not in the catalogue than
    if they are.

    A logistic regression on the logarithm of the misfit (`glazefit.Identification.misfit`) of 55
    films that were left out of the fit, each once with the catalogue as it is and once without the
    family of its main paint, as the catalogue's errors were when it was chosen. `python -m
    benchmarks.paint.truth` makes it again: with today's errors it would call more films none, three
    times as many of them wrongly, so that it was kept.
    """
    intercept, slope = MISFIT
    return np.asarray(intercept + slope * np.log(np.maximum(misfit, 0.1)))


def smaller_sets(
    members: Int[np.ndarray, "candidates 3"],
    condition: Int[np.ndarray, "candidates"],
    log_weight: Float[np.ndarray, "candidates"],
    possible: Bool[np.ndarray, "candidates"],
) -> list[Smaller]:
    """Candidates of a spectrum that have others of one paint less, largest sets first.

    Args:
        members, condition, log_weight: as in `Pool`, of one spectrum.
        possible: which candidates count: those of one coat.
    """
    size = (members != NOBODY).sum(axis=1)
    # Each candidate's condition and paints, and the weightiest candidate of each such pair.
    sets: dict[int, tuple[int, frozenset[int]]] = {}
    numbers: dict[tuple[int, frozenset[int]], int] = {}
    counted = np.flatnonzero(possible)
    for n in counted[np.argsort(-log_weight[counted], kind="stable")].tolist():
        sets[n] = int(condition[n]), frozenset(members[n, : size[n]].tolist())
        numbers.setdefault(sets[n], n)
    # Under the same condition, every set of one paint less that is a candidate.
    out = []
    for n in sorted(sets, key=lambda n: -size[n]):
        under, paints = sets[n]
        subsets = [
            numbers[key] for paint in paints if (key := (under, paints - {paint})) in numbers
        ]
        if subsets:
            out.append(Smaller(n, subsets))
    return out


def simplest(
    order: Sequence[Smaller],
    weight: Float[np.ndarray, "spectra candidates"],
    delta_e: Float[np.ndarray, "spectra candidates"],
    odds: Float[np.ndarray, "spectra candidates"],
) -> Float[np.ndarray, "spectra candidates"]:
    """Odds in which a set and the same set less one paint change places where that paint is not
    needed.

    A paint is needed if it raises the log odds by 2, or makes a difference that can be seen. Else
    the simpler film comes first.
    """
    odds = odds.copy()
    for n, subsets in order:
        # Subsets that do without the paint: behind by odds, near by weight, and no worse to see.
        enough = (
            (odds[:, subsets] < odds[:, n, None])
            & (weight[:, subsets] > weight[:, n, None] - 2.0)
            & (
                delta_e[:, subsets]
                < np.maximum(delta_e[:, n], _EARNS_COLOUR)[:, None] + _EARNS_COLOUR
            )
        )
        rows = np.flatnonzero(enough.any(axis=1))
        if rows.size:
            # The weightiest of them changes places with the set.
            best = np.asarray(subsets)[
                np.argmax(np.where(enough, weight[:, subsets], -np.inf)[rows], axis=1)
            ]
            odds[rows, best], odds[rows, n] = odds[rows, n], odds[rows, best]
    return odds


def _of_noise(measured: Measured) -> Float[np.ndarray, "spectra"]:
    """Delta E00 that the noise of the readings causes, root mean square of a few draws; 0 where it
    cannot be seen.
    """
    # Smaller noise has no part in a colour that could be seen.
    noisy = measured.noise_sd.mean(axis=(1, 2)) > 0.002
    if not noisy.any():
        return np.zeros(len(measured))
    draws = np.random.default_rng(0).standard_normal((8, *measured.readings.shape[1:]))
    drawn = measured.readings[:, None] + draws * measured.noise_sd[:, None]
    off = _colour_difference(measured, np.maximum(drawn, 0.0))
    return np.where(noisy, np.sqrt(np.mean(off**2, axis=1)), 0.0)


def _colour_difference(measured: Measured, computed: np.ndarray) -> np.ndarray:
    """`Measured.delta_e`, and a size like it where the bands give no colour."""
    off = measured.delta_e(computed)
    if np.isnan(off).all():
        return _COLOUR_OF_RMSE * np.sqrt(
            np.mean((measured.readings[:, None] - computed) ** 2, axis=(-1, -2))
        )
    return off


def _misfits(
    measured: Measured,
    pool: Pool,
    share: Float[np.ndarray, "spectra candidates"],
    looked_at: int,
) -> Misfits:
    """Misfits of the candidates of the largest share."""
    # The colour of a spectrum costs as much as its fit.
    chosen = np.argsort(-share, axis=1, kind="stable")[:, :looked_at]
    rows = np.arange(len(measured))[:, None]
    measured_readings = measured.readings[:, None]
    noise = np.mean(measured.noise_sd**2, axis=(1, 2))[:, None]
    # Readings of the candidates as fitted, and with the errors of their paints allowed.
    fitted, allowed = (
        a[rows, chosen].reshape(*chosen.shape, *measured_readings.shape[2:])
        for a in (pool.readings, pool.adjusted)
    )
    residual = np.sqrt(
        np.maximum(np.mean((measured_readings - allowed) ** 2, axis=(-1, -2)) - noise, 0.0)
    )

    def place(values: np.ndarray) -> np.ndarray:
        """Values of these candidates among all, where the others' are infinite."""
        out = np.full(share.shape, np.inf)
        out[rows, chosen] = values
        return out

    delta_e, adjusted_delta_e = (
        place(_colour_difference(measured, readings)) for readings in (fitted, allowed)
    )
    return Misfits(
        delta_e=delta_e,
        adjusted_delta_e=adjusted_delta_e,
        residual=place(residual),
        noise_delta_e=_of_noise(measured),
    )
