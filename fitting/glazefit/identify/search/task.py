"""Task that the search for all spectra shares, the spectra as it takes them, and their errors."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple, TypeAlias

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from glazejax.spectra import Bands

from ...film.films import Noise
from ...film.model.errors import ModelError, Prior, Whitening, model_correlation, whitening
from ...film.model.optics import Optics
from ...film.model.response import FilmResponse
from ...film.shared_bands import means_of_steps
from .table import FlatReadings, Paints

OverGrounds: TypeAlias = Float[np.ndarray, "spectra grounds bands"]
"""Spectra of films over each of their grounds."""
RowNumbers: TypeAlias = Int[np.ndarray, "rows"]
"""Numbers of some spectra."""
Covariances: TypeAlias = Float[np.ndarray, "spectra readings readings"]
"""A covariance of the readings of each spectrum."""
Shapes: TypeAlias = Float[np.ndarray, "spectra shapes readings"]
"""Errors of known shapes, or numbers by which they are estimated."""
# A middling reflectance: errors that rank sets of paints are stated for it.
TYPICAL_READING = 0.3
Number = Float[Array | np.ndarray, ""] | float


class Effort(NamedTuple):
    """Effort of a search: what it looks at, and what it takes as.

    Attributes:
        fitted_pairs: number of pairs of paints that are fitted, the best of all pairs by a coarse
            grid of amounts.
        kept_sets: number of sets that go on to the second fit. The first fit gives all sets the
            same errors; the second gives each set the errors of its own paints.
        within: a set goes on to the second fit, and then to a third with its errors computed again,
            if its log weight is at most this much below the best set's; it is then an answer.
        trace_effect: a paint is a trace if it changes the readings by less than this (root mean
            square, per unit of the logarithm of its k and s). Sets that differ only by traces
            share their errors.
        ranking_steps: damped steps of the first fit.
        steps: those of the others, and of the fit that finds the amounts to show.
    """

    fitted_pairs: int
    kept_sets: int
    within: float
    trace_effect: float
    ranking_steps: int
    steps: int


USUAL = Effort(
    fitted_pairs=48,
    kept_sets=40,
    within=8.0,
    trace_effect=0.005,
    ranking_steps=4,
    steps=6,
)
"""What is used unless more is asked for. In one or two films of a hundred, which several sets
explain about equally well, `THOROUGH` puts another set first (`python -m
benchmarks.paint.identification`)."""
THOROUGH = Effort(
    fitted_pairs=10_000,
    kept_sets=120,
    within=20.0,
    trace_effect=0.0,
    ranking_steps=14,
    steps=14,
)
"""Every pair is fitted, and every set that may matter with the errors of its own paints."""


@dataclass(frozen=True)
class Measured:
    """Spectra over one ground or several.

    Attributes:
        names: of the spectra.
        wavelengths: (bands,), nm.
        readings: reflectance, (spectra, grounds, bands).
        grounds: internal reflectance under the paint, the same shape.
        noise_sd: of the readings, the same shape: what the instrument is said to have, or what the
            spectra show.
        doubt: further errors of known shapes, independent and of standard deviation 1, (spectra,
            shapes, grounds, bands).
    """

    names: tuple[str, ...]
    wavelengths: Bands
    readings: OverGrounds
    grounds: OverGrounds
    noise_sd: OverGrounds
    doubt: Float[np.ndarray, "spectra shapes grounds bands"]

    def __len__(self) -> int:
        return len(self.names)

    def take(self, rows: RowNumbers) -> "Measured":
        """Some of the spectra, by number."""
        arrays = {name: getattr(self, name)[rows] for name in _OF_SPECTRA}
        return replace(self, names=tuple(self.names[row] for row in rows), **arrays)

    def in_steps(self, step: float) -> "Measured":
        """The spectra averaged to steps, nm, where their bands are finer; a mean is as noisy as one
        band.
        """
        mean = means_of_steps(self.wavelengths, step)
        if mean is None:
            return self
        return replace(
            self, **{name: getattr(self, name) @ mean for name in ("wavelengths", *_OF_SPECTRA)}
        )

    def by_grounds(self, alike: float = 0.0) -> list[RowNumbers]:
        """Numbers of the spectra over each ground: they share what is computed.

        Args:
            alike: grounds that differ by no more, in internal reflectance, count as one.
        """
        remaining = np.arange(len(self))
        groups = []
        while remaining.size:
            off = np.abs(self.grounds[remaining] - self.grounds[remaining[0]])
            near = off.max(axis=(1, 2)) <= alike
            groups.append(remaining[near])
            remaining = remaining[~near]
        return groups

    @property
    def flat(self) -> FlatReadings:
        """Readings over all grounds in one row."""
        return self.readings.reshape(len(self), -1)

    def delta_e(
        self, computed: Float[np.ndarray, "spectra candidates grounds bands"]
    ) -> Float[np.ndarray, "spectra candidates"]:
        """CIEDE2000 (D65, 10 degrees) to computed readings, the largest over the grounds; NaN
        without a colour.
        """
        from glazejax.colour import delta_e_of_spectra

        try:
            differences = delta_e_of_spectra(
                self.wavelengths, self.readings[:, None], computed, observer=10
            )
        except ValueError:
            return np.full(computed.shape[:2], np.nan)
        return np.asarray(differences).max(axis=-1)

    @classmethod
    def join(cls, batches: Sequence["Measured"]) -> "Measured":
        """Several batches on one grid as one."""
        names = tuple(name for batch in batches for name in batch.names)
        arrays = {
            name: np.concatenate([getattr(batch, name) for batch in batches])
            for name in _OF_SPECTRA
        }
        return replace(batches[0], names=names, **arrays)


# Fields of `Measured` of which each spectrum has its own.
_OF_SPECTRA = ("readings", "grounds", "noise_sd", "doubt")


class Expected(NamedTuple):
    """Expectation of every film, and how its misfit counts."""

    spread: Number  # of the log of the total amount
    concentration: Number  # of the fractions
    freedom: Number  # of Student's t
    independent: Number  # readings that count as independent


class IdentificationTask(NamedTuple):
    """Task that all spectra of an identification share."""

    response: FilmResponse
    paints: Paints
    errors: Float[np.ndarray, "paints 2 bands"]  # relative, of the paints' k and s
    modes: Float[np.ndarray, "paints 2 bands modes"]  # correlated errors of their logarithms
    wavelengths: Bands
    optics: Optics
    surface: float  # what a smooth surface adds to a reading
    noise: Noise
    discrepancy: ModelError
    prior: Prior
    extenders: Bool[np.ndarray, "paints"]  # those that a film of usual thickness hardly shows
    max_paints: int  # no more than there are
    effort: Effort
    hides: bool  # the films hide their ground

    @property
    def paint_count(self) -> int:
        """Paints in the catalogue."""
        return self.paints.absorption.shape[0]

    @property
    def single(self) -> tuple[FilmResponse, Paints]:
        """Response and paints in single precision."""
        both = self.response, self.paints
        return jax.tree.map(lambda a: jnp.asarray(np.asarray(a, np.float32)), both)

    @property
    def expected(self) -> Expected:
        """Expectation of its films."""
        return Expected(
            spread=self.prior.spread,
            concentration=self.prior.concentration_sought,
            freedom=self.discrepancy.freedom,
            independent=self.independent_readings,
        )

    @property
    def mean_surface(self) -> float:
        """Reflectance that the surface adds to a reading in the mean of films."""
        return self.discrepancy.gloss * self.surface

    @property
    def surface_sd(self) -> float:
        """Standard deviation of that."""
        return self.discrepancy.surface_sd(self.surface)

    @property
    def independent_readings(self) -> float:
        """Readings that count as independent where candidates are weighed; see
        `ModelError.apart`.
        """
        return max(float(np.ptp(self.wavelengths)) / self.discrepancy.apart, 1.0)


Tasks: TypeAlias = Mapping[bool | None, IdentificationTask]
"""Of a search, for films that hide their ground (True), that let it through (False), and that lie
as stated (None).
"""


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

    def take(self, rows: RowNumbers) -> "Chunk":
        """Some of the spectra, by number."""
        return replace(self, spectra=self.spectra.take(rows))

    @cached_property
    def target(self) -> FlatReadings:
        """Readings without the mean surface: what a candidate's film is to meet."""
        return self.spectra.flat - self.task.mean_surface

    @cached_property
    def tolerance(self) -> FlatReadings:
        """Distance that counts as near to each reading, of the nearest amounts and gloss."""
        # Near black .005, and .02 for each unit of reflectance.
        near = np.hypot(self.spectra.noise_sd, 0.005 + 0.02 * self.spectra.readings)
        return near.reshape(len(self), -1)

    @cached_property
    def shapes(self) -> Shapes:
        """Errors that move all bands of a reading together, as large as their standard deviation:
        the unknown gloss, and other unknowns such as the amount of a varnish (`Measured.doubt`).
        """
        gloss = np.full_like(self.spectra.readings[:, None], self.task.surface_sd)
        shapes = np.concatenate([gloss, self.spectra.doubt], axis=1)
        return shapes.reshape(*shapes.shape[:2], -1)

    @property
    def shape_estimator(self) -> Shapes:
        """Matrix that estimates from a residual how many standard deviations of each of the
        `shapes` are in it: ridge regression, with errors that are independent from band to band.
        """
        precise = self.shapes / self.tolerance[:, None] ** 2
        normal = precise @ np.swapaxes(self.shapes, 1, 2) + np.eye(self.shapes.shape[1])
        return np.linalg.solve(normal, precise)

    @property
    def noise_covariance(self) -> Covariances:
        """Covariance of the readings' errors that come from noise, and of the `shapes`."""
        return self._with_shapes(self.spectra.noise_sd)

    @property
    def tolerance_covariance(self) -> Covariances:
        """`noise_covariance` with what counts as near in place of noise, for the amounts that come
        nearest: these must not put a residual down to smooth errors of the paints.
        """
        return self._with_shapes(self.tolerance)

    @property
    def near_errors(self) -> Whitening:
        """Errors that count when the nearest amounts are fitted."""
        return whitening(self.tolerance_covariance)

    def _with_shapes(self, sd: Float[np.ndarray, "spectra ..."]) -> Covariances:
        return diagonal_covariance(sd) + np.swapaxes(self.shapes, 1, 2) @ self.shapes

    @property
    def smooth_covariance(self) -> Covariances:
        """Covariance of the model's own smooth error, paints' coefficients aside."""
        return self._smooth(self.task.discrepancy.model_sd(self.spectra.flat))

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


def diagonal_covariance(sd: Float[np.ndarray, "spectra ..."]) -> Covariances:
    """Covariance of independent errors."""
    flat = sd.reshape(len(sd), -1)
    return flat[..., None] ** 2 * np.eye(flat.shape[-1])
