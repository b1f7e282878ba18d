"""Answers for spectra: the most probable set of each."""

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
