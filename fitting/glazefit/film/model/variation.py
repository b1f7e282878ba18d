"""Distance of a film from its recipe: paint is mixed, weighed and spread separately.

Strength, the shape of k and s, and the model itself are off in each film by its own amount. `MIXED`
says how these errors look; how large they are differs from film to film, so a film's size is one of
`SIZES`, each with a probability: a priori as in `PRIOR`, and as films that were left out of a fit
then teach. The paints of a set differ in that: one that surprised once will again. So films count
for all paints, and more for their own.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from glazejax.spectra import Bands

from .errors import ModelError, whitening

MIXED = ModelError(coefficient=0.2, level=0.2, amplitude=0.004, length=100.0, shared=0.8)
"""Errors of k and s that a paint has in one film relative to others, and of the model, of size
one.
"""
SIZES = (0.03, 0.1, 0.3, 0.6, 1.0, 1.7, 3.0)
"""Sizes that a film's errors may have."""
PRIOR = (0.05, 0.08, 0.15, 0.22, 0.25, 0.18, 0.07)
"""How probable each is where no film was left out. More than nine tenths of the readings of the
revigo films lie in their bands with it (`python -m benchmarks.paint.prediction`); it was chosen on
them.
"""
STRENGTH = float(
    np.hypot(MIXED.level, MIXED.coefficient) * np.sqrt(np.dot(PRIOR, np.square(SIZES)))
)
"""Standard deviation of the log of a paint's strength in one film relative to others: level and
shape of its k and s.
"""
UNSTEADY = 0.1
"""How probable it is of a paint, a priori, that its films are farther off than others."""

Weights = Float[np.ndarray, "sizes"]


def thickness_variance(shown: Any, prior: Any, shares: Any) -> np.ndarray:
    """Variance of a film's log thickness, if readings show thickness times strength.

    A film is as strong as each of its paints by its share. The readings alone leave d open, 1/d =
    1/shown - 1/prior. Strength adds to d, and the prior holds the thickness: 1/(1/prior + 1/(d +
    strength)). Where a prior leaves the thickness open, strength counts in full.

    Args:
        shown: variance of the log of thickness times strength after the readings, by this prior.
        prior: variance of the log thickness before them.
        shares: sum of the squared shares of the paints whose strength varies.
    """
    information = np.maximum(1.0 / np.maximum(shown, 1e-12) - 1.0 / prior, 1e-12)
    return 1.0 / (1.0 / prior + 1.0 / (1.0 / information + STRENGTH**2 * shares))


class Spread(NamedTuple):
    """Scatter of films of a set, and of their readings, around their recipes, as standard
    deviations.
    """

    thickness: float = 0.4
    """Of the log of a film's thickness, about that in whose unit its paints' k and s are."""
    gain: float = 0.02
    """Of the log of a factor of one reading: texture, and where on the film it was taken."""
    alike: float = 0.9
    """No standard deviation: the correlation of what readings of one film over two cards are off,
    by that factor and by the model. They see the same film."""


class SizeEvidence(NamedTuple):
    """Evidence of one film that was left out."""

    paints: frozenset[str]
    log_likelihood: Weights  # of its readings, for each size


@dataclass(frozen=True)
class Variation:
    """Probability of each of `SIZES`.

    Attributes:
        weights: for a film of any paints, summing to 1.
        of_paint: for films of one paint.
        films: number of films that it was learned from; 0: the prior.
        unsteady: of each paint whose films were left out, how probable it is that they are twice as
            far from their recipes, on average, as films of all paints; a priori `UNSTEADY`. Such
            paint fades, stains, or is hard to weigh.
    """

    weights: Weights = field(default_factory=lambda: np.array(PRIOR))
    of_paint: Mapping[str, Weights] = field(default_factory=dict)
    films: int = 0
    unsteady: Mapping[str, float] = field(default_factory=dict)

    def of(self, paints: Sequence[str]) -> Weights:
        """For a film of these paints: that of its paint that varies most."""
        weights = [self.of_paint[paint] for paint in paints if paint in self.of_paint]
        return max(weights, key=lambda weights: float(weights @ SIZES)) if weights else self.weights

    def size_of(self, paints: Sequence[str]) -> float:
        """Mean size, for a film of these paints."""
        return float(self.of(paints) @ SIZES)


def learn(
    evidence: Sequence[SizeEvidence], mixing: Sequence[frozenset[str]] | None = None
) -> Variation:
    """Sizes of film errors from films that were left out, by maximum posterior (EM for a mixture's
    weights).

    A film counts for one of its paints, the one that is in fewest films. So whites and blacks,
    which everything is mixed with, are judged by their pure films alone.

    Args:
        evidence: one of each film.
        mixing: paints of all films that count for "in fewest", by default those of `evidence`.
    """
    if not evidence:
        return Variation()
    often = Counter(
        paint for paints in (mixing or [s.paints for s in evidence]) for paint in paints
    )
    likelihood = np.exp(np.stack([s.log_likelihood - s.log_likelihood.max() for s in evidence]))
    # The prior counts as twenty films in addition to those that were left out.
    weights = _weights(likelihood, np.array(PRIOR), 20.0)
    rows: dict[str, list[int]] = {}
    for row, size_evidence in enumerate(evidence):
        rows.setdefault(
            min(sorted(size_evidence.paints), key=lambda paint: often[paint]), []
        ).append(row)
    # All films count as two in addition to those of a paint.
    of_paint = {paint: _weights(likelihood[chosen], weights, 2.0) for paint, chosen in rows.items()}
    farther = _twice_as_far(weights)
    unsteady = {
        paint: _probability(likelihood[chosen], farther, weights) for paint, chosen in rows.items()
    }
    return Variation(weights, of_paint, len(evidence), unsteady)


def _twice_as_far(weights: Weights) -> Weights:
    """The weights made proportional to a power of the size, such that its mean doubles, or comes as
    near to that as it can.
    """
    # Not with the module: scipy.optimize takes longer than most that need the sizes alone.
    from scipy.optimize import root_scalar

    sizes = np.array(SIZES)
    mean = float(weights @ sizes)
    target = mean + min(mean, 0.9 * (sizes[-1] - mean))

    def tilt(power: float) -> Weights:
        tilted = weights * sizes**power
        return tilted / tilted.sum()

    solution = root_scalar(lambda power: float(tilt(power) @ sizes) - target, bracket=(0.0, 60.0))
    return tilt(float(solution.root))


def _probability(
    likelihood: Float[np.ndarray, "films sizes"], farther: Weights, usual: Weights
) -> float:
    """Probability that films are farther off than usual."""
    log_odds = np.sum(np.log(likelihood @ farther) - np.log(likelihood @ usual))
    log_odds += np.log(UNSTEADY / (1.0 - UNSTEADY))
    return float(1.0 / (1.0 + np.exp(-log_odds)))


def _weights(likelihood: Float[np.ndarray, "films sizes"], prior: Weights, films: float) -> Weights:
    """Weights of a mixture, the prior counting as so many films."""
    weights = prior
    for _ in range(100):
        share = likelihood * weights
        share = share / share.sum(axis=1, keepdims=True)
        weights = (films * prior + share.sum(axis=0)) / (films + len(likelihood))
    return weights


def log_likelihood(
    off: Float[np.ndarray, "grounds bands"],
    paint: Float[np.ndarray, "draws grounds bands"],
    film: Float[np.ndarray, "draws grounds bands"],
    wavelengths: Bands,
) -> Weights:
    """Log likelihood of a film's readings for each size, Gaussian, up to a constant.

    Args:
        off: readings minus their prediction.
        paint, film: deviations of draws from the prediction that the paints' k and s cause, and the
            film's own errors of size one.
        wavelengths: (bands,), nm. Bands nearer than 40 nm count as one.
    """
    # Every so many bands: residuals of neighbours are correlated in ways that no covariance
    # describes.
    step = (
        max(1, round(40.0 / float(np.median(np.diff(wavelengths))))) if wavelengths.size > 1 else 1
    )
    r, p, f = (x[..., ::step].reshape(*x.shape[:-2], -1) for x in (off, paint, film))
    fixed = p.T @ p / len(p) + 0.003**2 * np.eye(r.size)
    varied = f.T @ f / len(f)
    basis, height = whitening(fixed + np.square(SIZES)[:, None, None] * varied)
    return height - 0.5 * np.sum((basis @ r) ** 2, axis=-1)
