"""What the closed form costs: pixels answered by it beside the same searched in full."""

from collections.abc import Mapping
from dataclasses import dataclass, fields

import numpy as np
from jaxtyping import Bool, Float, Int

from ...identify.result import Identification, log_sds
from ...identify.search.pool import NOBODY
from .atlas import Atlas
from .by_family import FamilyAtlas, FamilySearcher
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


def compare(
    task: MapTask, atlas: Atlas | FamilyAtlas, readings: Float[np.ndarray, "spectra bands"]
) -> Agreement:
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
    if isinstance(searcher, FamilySearcher):
        own = searcher.search(readings, task.ground).answers
        return _agreement(mapped, own.members, own.explained, own.paint_probability, np.empty(0))
    measured = as_measured(searcher, readings, task.image.noise_sd(readings), task.ground)
    parts = [
        Identification.of(*one, paints=searcher.paints, opaque=searcher.opaque, keep=3)
        for one in searcher.search(measured)
    ]
    whole = Identification.join(parts)
    members = whole.members[:, 0]
    same = _same(mapped["members"], members)
    fractions = np.where(members != NOBODY, whole.fractions[:, 0], 0.0)
    spread = log_sds(members, fractions, whole.log_covariance[:, 0])[2]
    known = same & np.isfinite(mapped["thickness"])
    moved = np.log(mapped["thickness"][known] / whole.amounts[known, 0].sum(axis=1)) / spread[known]
    return _agreement(mapped, members, whole.explained, whole.paint_probability, moved)


def _same(
    one: Int[np.ndarray, "spectra 3"], other: Int[np.ndarray, "spectra 3"]
) -> Bool[np.ndarray, "spectra"]:
    return np.asarray((np.sort(one, axis=1) == np.sort(other, axis=1)).all(axis=1))


def _agreement(
    mapped: Mapping[str, np.ndarray],
    members: Int[np.ndarray, "spectra 3"],
    explained: Bool[np.ndarray, "spectra"],
    paint_probability: Float[np.ndarray, "spectra paints"],
    moved: Float[np.ndarray, "known"],
) -> Agreement:
    """A map's answers beside those of full searches; `moved` is how far the thickness is off, in
    its standard deviations, where it is known.
    """
    apart = np.abs(mapped["paint_probability"] - paint_probability).max(axis=1)
    probability, probability_90 = np.quantile(apart, [0.5, 0.9])
    amount, amount_90 = np.quantile(np.abs(moved), [0.5, 0.9]) if moved.size else np.full(2, np.nan)
    return Agreement(
        pixels=np.asarray(len(members)),
        first=_same(mapped["members"], members).mean(),
        explained=(mapped["explained"].astype(bool) == explained).mean(),
        probability=probability,
        probability_90=probability_90,
        amount=amount,
        amount_90=amount_90,
    )
