"""Spectra that are fitted together, and what is the same for all candidates of each: its errors."""

from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np
from jaxtyping import Float

from ...film.model.errors import model_correlation
from .table import FlatReadings
from .task import TYPICAL_READING, IdentificationTask, Measured, OverGrounds

Covariances: TypeAlias = Float[np.ndarray, "spectra readings readings"]
"""A covariance of the readings of each spectrum."""


@dataclass(frozen=True)
class Chunk:
    """Some spectra as fits take them: what they are to meet, and how well.

    Covariances are (spectra, readings, readings), readings over all grounds in one row. They are
    computed again where needed: kept, they would take most of the memory.
    """

    task: IdentificationTask
    spectra: Measured

    def __len__(self) -> int:
        return len(self.spectra)

    @cached_property
    def target(self) -> FlatReadings:
        """Readings without the mean surface: what a candidate's film is to meet."""
        return self.spectra.flat - self.task.mean_surface

    @cached_property
    def tolerance(self) -> OverGrounds:
        """Distance that counts as near to each reading when amounts and gloss are shown."""
        # Near black .005, and .02 for each unit of reflectance.
        return np.hypot(self.spectra.noise_sd, 0.005 + 0.02 * self.spectra.readings)

    @property
    def noise_covariance(self) -> Covariances:
        """Covariance of the readings' errors that come from noise, from the unknown gloss, and from
        other unknowns such as the amount of a varnish (`Measured.doubt`).
        """
        return diagonal_covariance(self.spectra.noise_sd) + self.noiseless_covariance

    @property
    def tolerance_covariance(self) -> Covariances:
        """`noise_covariance` with what counts as near in place of noise, for the amounts that are
        shown: these must not put a residual down to smooth errors of the paints.
        """
        return diagonal_covariance(self.tolerance) + self.noiseless_covariance

    @property
    def noiseless_covariance(self) -> Covariances:
        """`noise_covariance` without the noise: unknown gloss and other unknowns alone."""
        doubt = self.spectra.doubt.reshape(*self.spectra.doubt.shape[:2], self.target.shape[1])
        return self.task.surface_sd**2 + np.swapaxes(doubt, 1, 2) @ doubt

    @property
    def smooth_covariance(self) -> Covariances:
        """Covariance of the model's own smooth error, paints' coefficients aside."""
        d = self.task.discrepancy
        return self._smooth(d.amplitude + d.share * self.spectra.flat)

    @property
    def ranking_covariance(self) -> Covariances:
        """Covariance of one smooth error that stands for all while candidates are looked for."""
        # Smaller on dark films, whose readings differ by little: at 0 a tenth of the error at a
        # middling reading.
        dark = 0.1 + self.spectra.flat / TYPICAL_READING
        return self._smooth(self.task.discrepancy.screening * dark)

    def _smooth(self, amplitude: FlatReadings) -> Covariances:
        d = self.task.discrepancy
        grounds = self.spectra.readings.shape[1]
        correlation = model_correlation(self.task.wavelengths, grounds, d.length, d.shared)
        return amplitude[:, :, None] * amplitude[:, None] * correlation


def diagonal_covariance(sd: OverGrounds) -> Covariances:
    """Covariance of independent errors."""
    flat = sd.reshape(len(sd), -1)
    return flat[..., None] ** 2 * np.eye(flat.shape[-1])
