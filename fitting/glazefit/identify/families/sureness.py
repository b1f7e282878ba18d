"""Worth of the evidence of a search.

The evidence of a template is worth less than it says, since paints of one family do not differ as a
single covariance has it. It is tempered by a power twice (Miller and Dunson, J. Am. Stat. Assoc.
114 (2019) 1113): once while the templates of a set of families are averaged, so that the result
lies between their mean and the largest, and once more between sets. Whether a reading is of none of
the families is a logistic function of its whole evidence (Platt, Advances in Large Margin
Classifiers (1999) 61).
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy.special import expit, logsumexp, softmax

# Log evidence of a reading that no set may explain.
_NOTHING = -700.0
WORTHLESS = 0.01
"""Share of readings whose evidence says nothing of their family."""


@dataclass(frozen=True, kw_only=True)
class Sureness:
    """Worth of a search's evidence.

    Attributes:
        power: that likelihoods of templates are raised to.
        sharpness: that sets of families are, after that.
        slope, intercept: of the log odds that a reading is of one of the families, as a line over
            its log evidence, where half of all readings are.
        least: log evidence below which a reading looks less like the families than all but a
            twentieth of the paints that are of them.
    """

    power: float = 1.0
    sharpness: float = 1.0
    slope: float = 1.0
    intercept: float = 0.0
    least: float = -np.inf

    def share(
        self,
        log_sets: Float[np.ndarray, "spectra sets"],
        log_prior: Float[np.ndarray, "#spectra sets"],
    ) -> Float[np.ndarray, "spectra sets"]:
        """Probabilities of sets, if it is one of them.

        Args:
            log_sets: log evidence of each set, tempered, with its prior; -inf for what may not be.
            log_prior: of the sets.
        """
        allowed = np.where(np.isfinite(log_sets), log_prior, -np.inf)
        prior = softmax(np.broadcast_to(allowed, log_sets.shape), axis=1)
        tempered = softmax(self.sharpness * log_sets, axis=1)
        return np.asarray((1.0 - WORTHLESS) * tempered + WORTHLESS * prior)

    def is_unlike(self, log_sets: Float[np.ndarray, "spectra sets"]) -> Bool[np.ndarray, "spectra"]:
        """True for readings that look less like the families than nearly all paints that are of
        them.

        Args:
            log_sets: as for `share`.
        """
        return log_sum(log_sets) < self.least

    def none(
        self, log_sets: Float[np.ndarray, "spectra sets"], unknown: float
    ) -> Float[np.ndarray, "spectra"]:
        """Probability that a reading is of none of the families.

        Args:
            log_sets: as for `share`.
            unknown: the prior of the same.
        """
        log_odds = np.log(unknown / (1.0 - unknown)) - self.intercept
        return np.asarray(expit(log_odds - self.slope * log_sum(log_sets)))


def log_sum(log_sets: Float[np.ndarray, "spectra sets"]) -> Float[np.ndarray, "spectra"]:
    """Log of the sum over sets; finite where there is none."""
    return np.maximum(np.asarray(logsumexp(log_sets, axis=1)), _NOTHING)
