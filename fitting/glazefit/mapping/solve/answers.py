"""Answers for spectra: the most probable set of each, and what the closed form by which a map has
them costs.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from ...film.model.errors import Prior
from ...film.numerics.columns import Columns
from ...identify.result import fractions_of, log_sds
from ...identify.search.pool import NOBODY
from .features import PerSpectrum, SpectraReadings


@dataclass(frozen=True)
class Answers(Columns):
    """Answers for spectra: the most probable set of each, and its odds against all others."""

    members: Int[np.ndarray, "spectra 3"]
    condition: Int[np.ndarray, "spectra"]
    opaque: Bool[np.ndarray, "spectra"]
    probability: PerSpectrum
    none: PerSpectrum
    explained: Bool[np.ndarray, "spectra"]
    paint_probability: Float[np.ndarray, "spectra paints"]
    amounts: Float[np.ndarray, "spectra 3"]  # log, m; -inf for no paint
    covariance: Float[np.ndarray, "spectra 3 3"]
    misfit: PerSpectrum
    fitted: SpectraReadings

    def put(self, rows: np.ndarray, source: "Answers") -> None:
        """Write others' answers into some rows."""
        for name, values in vars(source).items():
            getattr(self, name)[rows] = values

    @classmethod
    def empty(cls, spectra: int, paints: int, bands: int) -> "Answers":
        """Room for answers."""

        def unknown(*shape: int) -> np.ndarray:
            return np.full(shape, np.nan, np.float32)

        return cls(
            members=np.full((spectra, 3), NOBODY, np.int16),
            condition=np.zeros(spectra, np.int8),
            opaque=np.zeros(spectra, bool),
            probability=unknown(spectra),
            none=unknown(spectra),
            explained=np.zeros(spectra, bool),
            paint_probability=unknown(spectra, paints),
            amounts=np.full((spectra, 3), -np.inf, np.float32),
            covariance=np.zeros((spectra, 3, 3), np.float32),
            misfit=unknown(spectra),
            fitted=unknown(spectra, bands),
        )

    @property
    def thickness(self) -> PerSpectrum:
        """Of the film, m; NaN where it hides its ground."""
        return np.where(self.opaque, np.nan, np.exp(self.amounts).sum(axis=1))

    def columns(self, prior: Prior) -> dict[str, np.ndarray]:
        """Arrays of a map by the names of `layout.VARIABLES`; `prior` is what was expected."""
        fractions = fractions_of(np.exp(self.amounts))
        # Standard deviations of the logs of the fractions and of the thickness.
        _, fraction_sd, thickness_sd = log_sds(
            self.members, fractions, self.covariance, prior.spread
        )
        shares = np.where(self.members == NOBODY, np.nan, fractions)
        return {
            **vars(self),
            "fraction": shares,
            "fraction_sd": np.minimum(shares * fraction_sd, 0.3),
            "thickness": self.thickness,
            "thickness_sd": self.thickness * thickness_sd,
        }


def agreement(
    mapped: Mapping[str, np.ndarray], full: Mapping[str, np.ndarray]
) -> dict[str, np.ndarray]:
    """Compare a map's answers for pixels with a search of each.

    Args:
        mapped: the map's `members`, `explained`, `paint_probability` and `thickness`.
        full: the same, and `thickness_sd`, by a search of the same pixels.

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
