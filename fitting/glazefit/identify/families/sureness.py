"""Worth of the evidence of a search.

The evidence of a template is worth less than it says, since paints of one family do not differ as a
single covariance has it. It is tempered by a power twice (Miller and Dunson, J. Am. Stat. Assoc.
114 (2019) 1113): once while the templates of a set of families are averaged, so that the result
lies between their mean and the largest, and once more between sets. Whether a reading is of none of
the families is a logistic function (Platt, Advances in Large Margin Classifiers (1999) 61) of its
whole evidence and of how probable it is as any paint at all: evidence is relative to that, and an
unusual reading has much of it for whatever comes nearest.
"""

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from jaxtyping import Float
from scipy.special import expit, logit, logsumexp, softmax

from ..search.pool import PerSpectrum

PerFamilySet: TypeAlias = Float[np.ndarray, "sets"]
"""A number for each set of families."""
PerSet: TypeAlias = Float[np.ndarray, "spectra sets"]
"""A number for each of these sets, of each spectrum."""
# Log evidence of a reading that no set may explain.
_NOTHING = -700.0
# Probability of none at most: what is left for the sets says which of them is nearest.
_SUREST = 1.0 - 1e-9
WORTHLESS = 0.01
"""Share of readings whose evidence says nothing of their family."""


@dataclass(frozen=True, kw_only=True)
class Sureness:
    """Worth of a search's evidence.

    Attributes:
        power: that likelihoods of templates are raised to.
        sharpness: that sets of families are, after that.
        slopes, intercept: of the log odds that a reading is of one of the families, over its log
            evidence and its log density as any paint, where half of all readings are.
        least: log evidence below which a reading looks less like the families than all but a
            twentieth of the paints that are of them.
    """

    power: float = 1.0
    sharpness: float = 1.0
    slopes: tuple[float, float] = (1.0, 0.0)
    intercept: float = 0.0
    least: float = -np.inf

    def share(self, log_sets: PerSet, log_prior: PerFamilySet) -> PerSet:
        """Probabilities of sets, if it is one of them.

        Args:
            log_sets: log evidence of each set, tempered, with its prior; -inf for what may not be.
            log_prior: of the sets.
        """
        allowed = np.where(np.isfinite(log_sets), log_prior, -np.inf)
        tempered = softmax(self.sharpness * log_sets, axis=1)
        return np.asarray((1.0 - WORTHLESS) * tempered + WORTHLESS * softmax(allowed, axis=1))

    def none(self, log_sets: PerSet, any_paint: PerSpectrum, unknown: float) -> PerSpectrum:
        """Probability that a reading is of none of the families.

        Args:
            log_sets: as for `share`.
            any_paint: log density of each reading as any paint (`Metric.log_any_paint`).
            unknown: the prior of the same.
        """
        log_odds = log_densities(log_sets, any_paint) @ np.array(self.slopes) + self.intercept
        return np.minimum(np.asarray(expit(logit(unknown) - log_odds)), _SUREST)


def log_densities(log_sets: PerSet, any_paint: PerSpectrum) -> Float[np.ndarray, "spectra 2"]:
    """Log evidence of all sets, and log density as any paint: what 'none' is judged by."""
    return np.column_stack([log_sum(log_sets), any_paint])


def log_sum(log_sets: PerSet) -> PerSpectrum:
    """Log of the sum over sets; finite where there is none."""
    return np.maximum(np.asarray(logsumexp(log_sets, axis=1)), _NOTHING)
