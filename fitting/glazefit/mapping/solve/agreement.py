"""Cost of the closed form: its answers for pixels, compared with full searches of the same."""

from collections.abc import Mapping

import numpy as np

from ...identify.result import Identification
from .by_family import FamilySearcher
from .local import as_measured
from .survey import SpectraReadings
from .task import MapTask


def agreement(
    task: MapTask,
    readings: SpectraReadings,
    mapped: Mapping[str, np.ndarray],
) -> dict[str, np.ndarray]:
    """Compare a map's answers for pixels with a search of each.

    Args:
        task: of the map, with its noise.
        readings: of good pixels, at the working bands.
        mapped: the map's `members`, `explained`, `paint_probability` and `thickness` for these.

    Returns:
        pixels: how many.
        first: share with the same first set.
        explained: share with the same answer to whether the catalogue explains the pixel.
        probability: median over the pixels of the largest difference of a paint's probability,
        probability_90: and what nine of ten stay below.
        amount: median difference of the thickness in its standard deviations, where the sets are
            the same,
        amount_90: and what nine of ten stay below; NaN where films hide their ground.
    """
    searcher = task.searcher
    if isinstance(searcher, FamilySearcher):
        searched = searcher.search(readings, task.ground).answers
        members = searched.members
    else:
        measured = as_measured(searcher, readings, task.image.noise_sd(readings), task.ground)
        batches = [
            Identification.of(
                *batch,
                paints=searcher.paints,
                opaque=searcher.task.hides,
                keep=3,
                spread=searcher.spread,
            )
            for batch in searcher.search(measured)
        ]
        searched = Identification.join(batches)
        members = searched.members[:, 0]
    same = (np.sort(mapped["members"], axis=1) == np.sort(members, axis=1)).all(axis=1)
    # Errors of the log thickness, in its standard deviations, where it is known.
    shifts = np.full(1, np.nan)
    rows = np.flatnonzero(same & np.isfinite(mapped["thickness"]))
    if isinstance(searched, Identification) and rows.size:
        _, _, thickness_sd = searched.log_sd
        thickness = searched.amounts[rows, 0].sum(axis=1)
        shifts = np.log(mapped["thickness"][rows] / thickness) / thickness_sd[rows, 0]
    differences = np.abs(mapped["paint_probability"] - searched.paint_probability).max(axis=1)
    probability, probability_90 = np.quantile(differences, [0.5, 0.9])
    amount, amount_90 = np.quantile(np.abs(shifts), [0.5, 0.9])
    return {
        "pixels": np.asarray(len(members)),
        "first": same.mean(),
        "explained": (mapped["explained"].astype(bool) == searched.explained).mean(),
        "probability": probability,
        "probability_90": probability_90,
        "amount": amount,
        "amount_90": amount_90,
    }
