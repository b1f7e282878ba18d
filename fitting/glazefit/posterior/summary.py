"""Numbers of a posterior: of the chain and of Laplace's approximation side by side, and where the two differ."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

LEVELS = (0.05, 0.5, 0.95)
"""Quantiles that are reported; the outer two enclose 90 %."""

# The ends of both 90 % intervals must agree within this share of its width: half a standard deviation of a Gaussian.
_AGREE = 0.15
_SKEWED = 1.5
# Where a share that lies in [0, 1] touches its ends.
_TOUCH = 0.01

AGREES = "agrees"


@dataclass(frozen=True)
class Numbers:
    """Of one quantity, for all blocks, each (blocks,)."""

    mean: Float[np.ndarray, "blocks"]
    sd: Float[np.ndarray, "blocks"]
    lower: Float[np.ndarray, "blocks"]
    median: Float[np.ndarray, "blocks"]
    upper: Float[np.ndarray, "blocks"]

    @classmethod
    def of(cls, draws: Float[np.ndarray, "draws blocks"]) -> "Numbers":
        """From draws."""
        return cls(draws.mean(axis=0), draws.std(axis=0), *np.quantile(draws, LEVELS, axis=0))


@dataclass(frozen=True)
class Row:
    """One quantity of one block.

    Attributes:
        quantity, block: which.
        mean, sd, lower, median, upper: of the chain, with the 5, 50 and 95 % quantiles; of Laplace's approximation
            where nothing was sampled.
        laplace_mean, laplace_sd, laplace_lower, laplace_upper: of Laplace's approximation.
        effective_samples, autocorrelation_time: of the block's chain, NaN where nothing was sampled.
        converged: whether the block's chain is long enough.
        laplace: "agrees", or how the chain differs from it; without a chain whether its own test trusts it.
    """

    quantity: str
    block: str
    mean: float
    sd: float
    lower: float
    median: float
    upper: float
    laplace_mean: float
    laplace_sd: float
    laplace_lower: float
    laplace_upper: float
    effective_samples: float
    autocorrelation_time: float
    converged: bool
    laplace: str


def numbers(draws: Mapping[str, Float[np.ndarray, "*draws blocks"]]) -> dict[str, Numbers]:
    """Numbers of every quantity, over all leading axes."""
    return {name: Numbers.of(values.reshape(-1, values.shape[-1])) for name, values in draws.items()}


def compare(
    sampled: Numbers, laplace: Numbers, *, logarithmic: bool, share: bool, many: Bool[np.ndarray, "blocks"]
) -> list[str]:
    """How a chain differs from Laplace's approximation, in a word or two a block.

    Args:
        sampled, laplace: numbers of one quantity.
        logarithmic: compare logarithms.
        share: the quantity lies in [0, 1].
        many: whether the block has more modes than one.
    """
    look = np.log if logarithmic else np.asarray
    tiny = np.finfo(float).tiny if logarithmic else -np.inf
    low, middle, high = (look(np.maximum(v, tiny)) for v in (sampled.lower, sampled.median, sampled.upper))
    other_low, other_high = (look(np.maximum(v, tiny)) for v in (laplace.lower, laplace.upper))
    width = np.maximum(high - low, 1e-300)
    off = np.maximum(np.abs(low - other_low), np.abs(high - other_high)) / width
    skew = (high - middle) / np.maximum(middle - low, 1e-300)
    words = []
    for b in range(width.size):
        if off[b] <= _AGREE:
            words.append(AGREES)
        elif many[b]:
            words.append("two modes")
        elif share and (sampled.lower[b] < _TOUCH or sampled.upper[b] > 1.0 - _TOUCH):
            words.append("against a bound")
        elif not 1.0 / _SKEWED <= skew[b] <= _SKEWED:
            words.append("skewed")
        elif other_high[b] - other_low[b] > width[b] * (1.0 + _AGREE):
            words.append("Laplace too wide")
        elif other_high[b] - other_low[b] < width[b] * (1.0 - _AGREE):
            words.append("Laplace too narrow")
        else:
            words.append("shifted")
    return words
