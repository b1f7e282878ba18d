"""Probabilities of candidates, and of none of them."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from ...film.model.errors import Prior
from .pool import PerCandidate, PerSpectrum, Pool
from .task import Measured

MISFIT = (-0.98, 1.83)
"""Of `log_odds_of_none`: at a misfit of 1, and its slope by the logarithm."""
UNSEEN = 1.0
"""Delta E00 below which two colours look the same."""
REJECTED = 4.0
"""Delta E00 above which a person sees that the fit is none."""

# Delta E00 for a residual's root mean square of 1, in the middle of the films that were left out.
_COLOUR_OF_RMSE = 100.0
# Draws of noise whose colours are compared.
_DRAWS = 8


class Misfits(NamedTuple):
    """Misfits of candidates to the spectra; infinite for those that hardly matter."""

    delta_e: PerCandidate  # Delta E00, the larger over the grounds, as fitted
    adjusted_delta_e: PerCandidate  # the same with errors of their paints allowed
    residual: PerCandidate  # root mean square of the latter's residual, noise aside
    noise_delta_e: PerSpectrum  # Delta E00 that noise alone makes


class Odds(NamedTuple):
    """Odds of candidates and of none of them, before they are made to sum to 1."""

    candidates: PerCandidate
    none: PerSpectrum
    misfit: PerSpectrum  # see `glazefit.Identification`
    rejected: Bool[np.ndarray, "spectra candidates"]  # by eye
    misfits: Misfits

    @property
    def total(self) -> PerSpectrum:
        """Of all there is."""
        return self.candidates.sum(axis=1) + self.none


def odds_of(measured: Measured, pool: Pool, prior: Prior) -> Odds:
    """Odds of all candidates and of none.

    Args:
        measured: spectra.
        pool: their candidates.
        prior: what was expected.
    """
    return weigh(pool.log_weight, _misfits(measured, pool), prior)


def weigh(weight: PerCandidate, misfits: Misfits, prior: Prior) -> Odds:
    """Odds of candidates and of none.

    Args:
        weight: log evidence and log prior of each.
        misfits: how far each is off.
        prior: what was expected.
    """
    share = evidence_shares(weight)
    # Invisible differences count equally: what fits best is not for that more likely to be
    # there.
    # Judged by the geometric mean of the colour differences as fitted and with the paints' errors,
    # less what noise alone makes of a colour; a residual may have a shape that no colour shows.
    noise = misfits.noise_delta_e[:, None] ** 2
    squared = np.maximum(misfits.delta_e * misfits.adjusted_delta_e - noise, 0.0)
    judged = np.maximum(np.sqrt(squared), _COLOUR_OF_RMSE * misfits.residual)
    odds = share * np.exp(-log_odds_of_none(np.maximum(judged, UNSEEN))) * (1.0 - prior.unknown)
    # A fit that a person rejects by eye is never more probable than none.
    rejected = misfits.delta_e**2 - noise > REJECTED**2
    odds = np.where(rejected, np.minimum(odds, share * prior.unknown), odds)
    # Geometric mean of the candidates' misfits, each with its odds.
    weights = odds / odds.sum(axis=1, keepdims=True)
    log_misfits = np.log(np.clip(judged, 0.1, 100.0))
    misfit = np.exp(np.sum(weights * log_misfits, axis=1))
    # None has as many odds as expected at a misfit that is just not seen, and fewer below; what is
    # seen has lowered the candidates' own odds already.
    none = prior.unknown * np.exp(
        log_odds_of_none(np.minimum(misfit, UNSEEN)) - log_odds_of_none(UNSEEN)
    )
    return Odds(candidates=odds, none=none, misfit=misfit, rejected=rejected, misfits=misfits)


def evidence_shares(weight: PerCandidate) -> PerCandidate:
    """Probability of each candidate before its misfit counts, if the film is of the catalogue's
    paints; none of one whose log weight is not finite.
    """
    weight = np.where(np.isfinite(weight), weight, -np.inf)
    share = np.exp(weight - weight.max(axis=1, keepdims=True))
    return share / share.sum(axis=1, keepdims=True)


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


def _misfits(measured: Measured, pool: Pool) -> Misfits:
    """Misfits of the candidates of the largest share."""
    # The colour of a spectrum costs as much as its fit: those of 40 are compared.
    shares = evidence_shares(pool.log_weight)
    chosen = np.argsort(-shares, axis=1, kind="stable")[:, :40]
    at = np.arange(len(measured))[:, None], chosen
    read = measured.readings[:, None]
    # With the errors of their paints allowed.
    allowed = pool.adjusted[at]
    noise = np.mean(measured.noise_sd**2, axis=(1, 2))[:, None]
    square = np.mean((read - allowed) ** 2, axis=(-1, -2)) - noise

    def place(values: np.ndarray) -> np.ndarray:
        """Values of these candidates among all, where the others' are infinite."""
        out = np.full(shares.shape, np.inf)
        out[at] = values
        return out

    return Misfits(
        delta_e=place(_colour_difference(measured, pool.readings[at])),
        adjusted_delta_e=place(_colour_difference(measured, allowed)),
        residual=place(np.sqrt(np.maximum(square, 0.0))),
        noise_delta_e=_of_noise(measured),
    )


def _of_noise(measured: Measured) -> PerSpectrum:
    """Delta E00 that the noise of the readings causes, root mean square of a few draws; 0 where it
    could not be seen.
    """
    noisy = measured.noise_sd.mean(axis=(1, 2)) > 0.002
    out = np.zeros(len(measured))
    if noisy.any():
        draws = np.random.default_rng(0).standard_normal((_DRAWS, *measured.readings.shape[1:]))
        drawn = measured.readings[:, None] + draws * measured.noise_sd[:, None]
        off = _colour_difference(measured, np.maximum(drawn, 0.0))
        out[noisy] = np.sqrt(np.mean(off[noisy] ** 2, axis=1))
    return out


def _colour_difference(measured: Measured, computed: np.ndarray) -> PerCandidate:
    """`Measured.delta_e`, and a size like it where the bands give no colour."""
    off = measured.delta_e(computed)
    if np.isnan(off).all():
        return _COLOUR_OF_RMSE * np.sqrt(
            np.mean((measured.readings[:, None] - computed) ** 2, axis=(-1, -2))
        )
    return off
