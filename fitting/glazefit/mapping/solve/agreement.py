"""What the closed form costs: pixels answered by it beside the same searched in full."""

from collections.abc import Mapping
from dataclasses import dataclass, fields

import numpy as np
from jaxtyping import Float

from ...identify.result import Identification, log_sds
from ...identify.search.pool import NOBODY
from .atlas import Atlas
from .local import as_measured
from .task import MapTask


@dataclass(frozen=True)
class Agreement:
    """Of pixels that were searched in full.

    Attributes:
        pixels: how many.
        first: share with the same first set.
        explained: share with the same answer to whether the catalogue explains the pixel.
        probability: median over the pixels of the largest difference of a paint's probability,
        probability_90: and what nine of ten stay below.
        amount: median difference of the thickness in its standard deviations, where the sets are
            the same,
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


def compare(task: MapTask, atlas: Atlas, readings: Float[np.ndarray, "spectra bands"]) -> Agreement:
    """Answers for spectra in closed form, beside a search of each.

    Args:
        task, atlas: of the map.
        readings: of good pixels, at the working bands.
    """
    found, _ = atlas.answers(readings.astype(np.float32))
    thickness = np.where(found.opaque, np.nan, np.exp(found.amounts.astype(float)).sum(axis=1))
    arrays = {name: getattr(found, name) for name in ("members", "explained", "paint_probability")}
    return agreement(task, readings, arrays | {"thickness": thickness})


def agreement(
    task: MapTask,
    readings: Float[np.ndarray, "spectra bands"],
    mapped: Mapping[str, np.ndarray],
) -> Agreement:
    """A map's answers for pixels beside a search of each.

    Args:
        task: of the map, with its noise.
        readings: of good pixels, at the working bands.
        mapped: the map's `members`, `explained`, `paint_probability` and `thickness` for these.
    """
    searcher = task.searcher
    measured = as_measured(searcher, readings, task.image.noise_sd(readings), task.ground)
    parts = [
        Identification.of(*one, paints=searcher.paints, opaque=searcher.opaque, keep=3)
        for one in searcher.search(measured)
    ]
    whole = Identification.join(parts)
    members = whole.members[:, 0]
    same = (np.sort(mapped["members"], axis=1) == np.sort(members, axis=1)).all(axis=1)
    apart = np.abs(mapped["paint_probability"] - whole.paint_probability).max(axis=1)
    fractions = np.where(members != NOBODY, whole.fractions[:, 0], 0.0)
    spread = log_sds(members, fractions, whole.log_covariance[:, 0])[2]
    known = same & np.isfinite(mapped["thickness"])
    moved = np.log(mapped["thickness"][known] / whole.amounts[known, 0].sum(axis=1)) / spread[known]
    probability, probability_90 = np.quantile(apart, [0.5, 0.9])
    amount, amount_90 = np.quantile(np.abs(moved), [0.5, 0.9]) if moved.size else np.full(2, np.nan)
    return Agreement(
        pixels=np.asarray(len(readings)),
        first=same.mean(),
        explained=(mapped["explained"].astype(bool) == whole.explained).mean(),
        probability=probability,
        probability_90=probability_90,
        amount=amount,
        amount_90=amount_90,
    )
