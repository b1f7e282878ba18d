"""Cost of the closed form: its answers for pixels, compared with full searches of the same."""

from collections.abc import Mapping

import numpy as np

from .atlas import ImageSearcher
from .features import SpectraReadings


def agreement(
    searcher: ImageSearcher,
    readings: SpectraReadings,
    noise_sd: SpectraReadings,
    mapped: Mapping[str, np.ndarray],
) -> dict[str, np.ndarray]:
    """Compare a map's answers for pixels with a search of each.

    Args:
        searcher: of the map.
        readings: of good pixels, at the working bands.
        noise_sd: of these.
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
    full = searcher.answers(readings, noise_sd)
    members = np.sort(full["members"], axis=1)
    same = (np.sort(mapped["members"], axis=1) == members).all(axis=1)
    # Errors of the log thickness, in its standard deviations, where it is known.
    shifts = np.full(1, np.nan)
    rows = np.flatnonzero(same & np.isfinite(mapped["thickness"]))
    if rows.size:
        thickness = full["thickness"][rows]
        relative_sd = full["thickness_sd"][rows] / thickness
        shifts = np.log(mapped["thickness"][rows] / thickness) / relative_sd
    differences = np.abs(mapped["paint_probability"] - full["paint_probability"]).max(axis=1)
    probability, probability_90 = np.quantile(differences, [0.5, 0.9])
    amount, amount_90 = np.quantile(np.abs(shifts), [0.5, 0.9])
    return {
        "pixels": np.asarray(len(members)),
        "first": same.mean(),
        "explained": (mapped["explained"].astype(bool) == full["explained"]).mean(),
        "probability": probability,
        "probability_90": probability_90,
        "amount": amount,
        "amount_90": amount_90,
    }
