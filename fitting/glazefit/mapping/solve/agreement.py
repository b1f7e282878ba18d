"""Cost of the closed form: its answers for pixels, compared with full searches of the same."""

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
    """Compare answers for spectra in closed form with a search of each.

    Args:
        task, atlas: of the map.
        readings: of good pixels, at the working bands.
    """
    answers, _ = atlas.answers(readings.astype(np.float32))
    thickness = np.where(answers.opaque, np.nan, np.exp(answers.amounts.astype(float)).sum(axis=1))
    arrays = {
        name: getattr(answers, name) for name in ("members", "explained", "paint_probability")
    }
    return agreement(task, readings, arrays | {"thickness": thickness})


def agreement(
    task: MapTask,
    readings: Float[np.ndarray, "spectra bands"],
    mapped: Mapping[str, np.ndarray],
) -> Agreement:
    """Compare a map's answers for pixels with a search of each.

    Args:
        task: of the map, with its noise.
        readings: of good pixels, at the working bands.
        mapped: the map's `members`, `explained`, `paint_probability` and `thickness` for these.
    """
    searcher = task.searcher
    if isinstance(searcher, FamilySearcher):
        searched = searcher.search(readings, task.ground).answers
        return _agreement(
            mapped, searched.members, searched.explained, searched.paint_probability, np.empty(0)
        )
    measured = as_measured(searcher, readings, task.image.noise_sd(readings), task.ground)
    batches = [
        Identification.of(*batch, paints=searcher.paints, opaque=searcher.opaque, keep=3)
        for batch in searcher.search(measured)
    ]
    identification = Identification.join(batches)
    members = identification.members[:, 0]
    same = _same(mapped["members"], members)
    fractions = np.where(members != NOBODY, identification.fractions[:, 0], 0.0)
    spread = log_sds(members, fractions, identification.log_covariance[:, 0])[2]
    comparable = same & np.isfinite(mapped["thickness"])
    shifts = (
        np.log(mapped["thickness"][comparable] / identification.amounts[comparable, 0].sum(axis=1))
        / spread[comparable]
    )
    return _agreement(
        mapped, members, identification.explained, identification.paint_probability, shifts
    )


def _same(
    first: Int[np.ndarray, "spectra 3"], second: Int[np.ndarray, "spectra 3"]
) -> Bool[np.ndarray, "spectra"]:
    return np.asarray((np.sort(first, axis=1) == np.sort(second, axis=1)).all(axis=1))


def _agreement(
    mapped: Mapping[str, np.ndarray],
    members: Int[np.ndarray, "spectra 3"],
    explained: Bool[np.ndarray, "spectra"],
    paint_probability: Float[np.ndarray, "spectra paints"],
    shifts: Float[np.ndarray, "comparable"],
) -> Agreement:
    """Compare a map's answers with those of full searches; `shifts` are errors of the log
    thickness, in its standard deviations, where it is known.
    """
    differences = np.abs(mapped["paint_probability"] - paint_probability).max(axis=1)
    probability, probability_90 = np.quantile(differences, [0.5, 0.9])
    amount, amount_90 = (
        np.quantile(np.abs(shifts), [0.5, 0.9]) if shifts.size else np.full(2, np.nan)
    )
    return Agreement(
        pixels=np.asarray(len(members)),
        first=_same(mapped["members"], members).mean(),
        explained=(mapped["explained"].astype(bool) == explained).mean(),
        probability=probability,
        probability_90=probability_90,
        amount=amount,
        amount_90=amount_90,
    )
