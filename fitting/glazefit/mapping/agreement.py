"""What the closed form costs: pixels answered by it beside the same searched in full."""

from dataclasses import dataclass, fields

import numpy as np
from jaxtyping import Float

from ..identify.result import NOBODY, Identification, log_sds
from ..identify.searcher import Searcher
from ..identify.weigh import weigh
from .atlas import Atlas
from .local import as_measured
from .solver import Image

_KEPT = 3


@dataclass(frozen=True)
class Agreement:
    """Of pixels that were searched in full.

    Attributes:
        pixels: how many.
        first: share with the same first set.
        explained: share with the same answer to whether the catalogue explains the pixel.
        probability: median over the pixels of the largest difference of a paint's probability,
        probability_90: and what nine of ten stay below.
        amount: median difference of the thickness in its standard deviations, where the sets are the same,
        amount_90: and what nine of ten stay below; NaN where films hide their ground.
    """

    pixels: np.ndarray
    first: np.ndarray
    explained: np.ndarray
    probability: np.ndarray
    probability_90: np.ndarray
    amount: np.ndarray
    amount_90: np.ndarray

    def arrays(self) -> dict[str, np.ndarray]:
        """All by name."""
        return {f.name: np.asarray(getattr(self, f.name)) for f in fields(self)}


def compare(
    searcher: Searcher,
    image: Image,
    ground: Float[np.ndarray, "bands"] | None,
    atlas: Atlas,
    readings: Float[np.ndarray, "spectra bands"],
) -> Agreement:
    """Answers for spectra in closed form, beside a search of each.

    Args:
        searcher, image, ground, atlas: of the map.
        readings: of good pixels, at the working bands.
    """
    found, _ = atlas.answers(readings.astype(np.float32))
    measured = as_measured(searcher, readings, image.noise_sd(readings), ground)
    parts = [weigh(*one, searcher.paints, searcher.opaque, _KEPT) for one in searcher.search(measured)]
    whole = Identification.join(parts)
    same = (np.sort(found.members, axis=1) == np.sort(whole.members[:, 0], axis=1)).all(axis=1)
    apart = np.abs(found.paint_probability - whole.paint_probability).max(axis=1)
    there = whole.members[:, 0] != NOBODY
    fractions = np.where(there, whole.fractions[:, 0], 0.0)
    spread = log_sds(whole.members[:, 0], fractions, whole.log_covariance[:, 0])[2]
    moved = np.log(np.exp(found.amounts.astype(float)).sum(axis=1) / whole.amounts[:, 0].sum(axis=1))
    known = same & ~found.opaque
    amount = np.abs(moved[known] / spread[known])
    of_amounts = np.quantile(amount, [0.5, 0.9]) if amount.size else np.full(2, np.nan)
    return Agreement(
        np.asarray(len(readings)),
        same.mean(),
        (found.explained == whole.explained).mean(),
        *np.quantile(apart, [0.5, 0.9]),
        *of_amounts,
    )
