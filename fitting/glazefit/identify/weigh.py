"""Probabilities of candidates, and of none of them."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float
from scipy.special import logsumexp

from ..film.errors import REJECTED, UNSEEN, Prior, log_odds_of_none
from .result import NOBODY, Identification, Pool
from .task import Measured

# Candidates whose colour is compared with the film's.
_LOOKED_AT = 40
# Log odds, and a Delta E00, by which a paint earns its place in a set.
_EARNS, _EARNS_COLOUR = 2.0, 0.5
# Noise below which its part in a colour is not looked at, and random spectra for it.
_SEEN_NOISE, _DRAWS = 0.002, 8
# Delta E00 for a residual's root mean square of 1, in the middle of the films that were left out.
_COLOUR_OF_RMSE = 100.0


class Odds(NamedTuple):
    """How candidates and none of them compare, before they are made to sum to 1."""

    candidates: Float[np.ndarray, "spectra candidates"]
    none: Float[np.ndarray, "spectra"]
    misfit: Float[np.ndarray, "spectra"]  # see `Identification.misfit`
    rejected: Bool[np.ndarray, "spectra candidates"]  # by eye

    @property
    def total(self) -> Float[np.ndarray, "spectra"]:
        """Of all there is."""
        return self.candidates.sum(axis=1) + self.none


def weigh(
    measured: Measured, pool: Pool, odds: Odds, names: tuple[str, ...], opaque: bool, keep: int
) -> Identification:
    """Probabilities of all candidates and of none, and the best candidates in full."""
    total = odds.total
    probability = odds.candidates / total[:, None]
    present = pool.members[..., None] == np.arange(len(names))
    best = np.argsort(-probability, axis=1, kind="stable")[:, :keep]
    top = pool.take(best)
    return Identification(
        measured=measured,
        paints=names,
        members=top.members,
        coats=top.coats,
        amounts=np.exp(top.logs),
        log_covariance=top.covariance,
        probability=np.take_along_axis(probability, best, axis=1),
        none=odds.none / total,
        misfit=odds.misfit,
        rejected=np.take_along_axis(odds.rejected, best, axis=1),
        paint_probability=np.einsum("sc,scmp->sp", probability, present),
        gloss=top.gloss,
        fitted=top.readings.reshape(*best.shape, *measured.readings.shape[1:]),
        condition=top.condition,
        opaque=opaque,
    )


def odds_of(measured: Measured, pool: Pool, prior: Prior) -> Odds:
    """Odds of all candidates and of none beside them."""
    weight = np.where(np.isfinite(pool.log_weight), pool.log_weight, -np.inf)
    # Before the misfit is looked at: how probable each is if the film is of the catalogue's paints.
    share = np.exp(weight - np.asarray(logsumexp(weight, axis=1))[:, None])
    seen, left, shape = _misfits(measured, pool, share)
    # What noise alone makes of a colour is no misfit.
    blur = _of_noise(measured)[:, None]
    # A residual may have a shape that no colour shows.
    off = np.maximum(np.sqrt(np.maximum(seen * left - blur**2, 0.0)), _COLOUR_OF_RMSE * shape)
    # Differences that nobody sees count alike: what fits best is not for that more likely to be there.
    odds = share * np.exp(-log_odds_of_none(np.maximum(off, UNSEEN))) * (1.0 - prior.unknown)
    # A fit that a person rejects by eye is never more probable than none.
    rejected = seen**2 - blur**2 > REJECTED**2
    odds = np.where(rejected, np.minimum(odds, share * prior.unknown), odds)
    odds = _simplest(pool, weight, seen, odds)
    # The better the film is met, the less probable is none, also below what is seen.
    kept = odds / odds.sum(axis=1, keepdims=True)
    met = np.exp(np.sum(np.where(kept > 0, kept * np.log(np.clip(off, 0.1, 100.0)), 0.0), axis=1))
    none = prior.unknown * np.exp(log_odds_of_none(np.minimum(met, UNSEEN)) - log_odds_of_none(UNSEEN))
    return Odds(odds, none, met, rejected)


def _simplest(pool: Pool, weight: np.ndarray, seen: np.ndarray, odds: np.ndarray) -> np.ndarray:
    """Odds with those of a set and of the same set less one paint changed over, where that paint earns nothing.

    A paint earns its place by evidence or by a difference that is seen; else the simpler film comes first.
    """
    odds = odds.copy()
    size = (pool.members != NOBODY).sum(axis=2)
    for row in range(len(odds)):
        sets: dict[int, tuple[int, frozenset[int]]] = {}
        place: dict[tuple[int, frozenset[int]], int] = {}
        here = np.flatnonzero((odds[row] > 0) & ~pool.coats[row].any(axis=-1))
        for n in here[np.argsort(-weight[row, here], kind="stable")].tolist():
            sets[n] = int(pool.condition[row, n]), frozenset(pool.members[row, n, : size[row, n]].tolist())
            place.setdefault(sets[n], n)
        for n in sorted(sets, key=lambda n: -size[row, n]):
            condition, paints = sets[n]
            smaller = (place.get((condition, paints - {paint})) for paint in paints)
            enough = [
                m
                for m in smaller
                if m is not None
                and odds[row, m] < odds[row, n]
                and weight[row, m] > weight[row, n] - _EARNS
                and seen[row, m] < max(seen[row, n], _EARNS_COLOUR) + _EARNS_COLOUR
            ]
            if enough:
                best = max(enough, key=lambda m: weight[row, m])
                odds[row, [best, n]] = odds[row, [n, best]]
    return odds


def _of_noise(measured: Measured) -> Float[np.ndarray, "spectra"]:
    """Delta E00 that the noise of the readings causes, root mean square of a few draws; 0 where it cannot be seen."""
    noisy = measured.noise_sd.mean(axis=(1, 2)) > _SEEN_NOISE
    if not noisy.any():
        return np.zeros(len(measured))
    draws = np.random.default_rng(0).standard_normal((_DRAWS, *measured.readings.shape[1:]))
    drawn = measured.readings[:, None] + draws * measured.noise_sd[:, None]
    off = _colour_difference(measured, np.maximum(drawn, 0.0))
    return np.where(noisy, np.sqrt(np.mean(off**2, axis=1)), 0.0)


def _colour_difference(measured: Measured, computed: np.ndarray) -> np.ndarray:
    """`Measured.delta_e`, and a size like it where the bands give no colour."""
    off = measured.delta_e(computed)
    if np.isnan(off).all():
        return _COLOUR_OF_RMSE * np.sqrt(np.mean((measured.readings[:, None] - computed) ** 2, axis=(-1, -2)))
    return off


def _misfits(
    measured: Measured, pool: Pool, share: np.ndarray
) -> tuple[
    Float[np.ndarray, "spectra candidates"],
    Float[np.ndarray, "spectra candidates"],
    Float[np.ndarray, "spectra candidates"],
]:
    """How far off the candidates are; infinite for those that hardly matter.

    Delta E00, the larger over the grounds, as fitted and with errors of their paints allowed; and the root mean square
    of the latter's residual, noise aside.
    """
    # The colour of a spectrum costs as much as its fit.
    few = np.argsort(-share, axis=1, kind="stable")[:, :_LOOKED_AT]
    rows = np.arange(len(measured))[:, None]
    seen = measured.readings[:, None]
    noise = np.mean(measured.noise_sd**2, axis=(1, 2))[:, None]
    fitted, allowed = (a[rows, few].reshape(*few.shape, *seen.shape[2:]) for a in (pool.readings, pool.allowed))
    left = np.sqrt(np.maximum(np.mean((seen - allowed) ** 2, axis=(-1, -2)) - noise, 0.0))

    def placed(values: np.ndarray) -> np.ndarray:
        out = np.full(share.shape, np.inf)
        out[rows, few] = values
        return out

    off, less = (placed(_colour_difference(measured, readings)) for readings in (fitted, allowed))
    return off, less, placed(left)
