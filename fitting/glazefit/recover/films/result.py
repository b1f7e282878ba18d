"""Result of a recovery, and how well it is known."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import TypeAlias

import numpy as np
from jaxtyping import Bool, Float

from glazejax import Pigment
from glazejax.cie import find_illuminant, find_observer
from glazejax.colour import colour_weights, delta_e_of_spectra
from glazejax.io.spectra_table import list_names
from glazejax.spectra import describe_grid

from ...film.films import Films
from ...film.tables import Tabulated, Variables

PerFilm: TypeAlias = Float[np.ndarray, "films"]
"""A number a film."""
FilmSpectra: TypeAlias = Float[np.ndarray, "films bands"]
"""A number a film and band."""
FilmFlags: TypeAlias = Bool[np.ndarray, "films bands"]
"""Whether something holds of a film at a band."""
PerFilmAndCard: TypeAlias = Float[np.ndarray, "films 2"]
"""A number a film over black and over white."""
ReadingSpectra: TypeAlias = Float[np.ndarray, "films 2 bands"]
"""A number a film over black and over white, and band."""
_IN_TABLES = (
    "absorption",
    "absorption_sd",
    "scattering",
    "scattering_sd",
    "ratio",
    "ratio_sd",
    "identifiable",
    "fitted_black",
    "fitted_white",
)
CONTRAST_LIMIT = 5.0
RELATIVE_LIMIT = 0.5
ABSOLUTE_LIMIT = 0.01
RULE = (
    "k and s are separable where the film reads brighter over white than over black by "
    f"{CONTRAST_LIMIT:g} standard deviations or more, k d and s d are each known to "
    f"{RELATIVE_LIMIT:.0%} of their value or to {ABSOLUTE_LIMIT:g}, and no other pair fits as well"
)


def told_apart(
    optical: Float[np.ndarray, "*shape 2"],
    covariance: Float[np.ndarray, "*shape 2 2"],
    contrast: Float[np.ndarray, "*shape"],
) -> Bool[np.ndarray, "*shape"]:
    """True where k d and s d are both known.

    Below a contrast of five standard deviations the noise decides how opaque a film looks, and an
    error to first order says nothing (it covered 85 % for 95 % on simulated films). The absolute
    limit is for a film so clear, or a paint so weak, that a value near zero is well known without
    any relative accuracy to speak of.

    Args:
        optical: k d and s d.
        covariance: of the two.
        contrast: reflectance over white minus over black, in standard deviations.
    """
    sd = np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1))
    precise = np.all(sd <= np.maximum(RELATIVE_LIMIT * optical, ABSOLUTE_LIMIT), axis=-1)
    return precise & (contrast >= CONTRAST_LIMIT)


class FittedFilms:
    """Fit of spectra to films over two cards."""

    films: Films
    fitted_black: FilmSpectra
    fitted_white: FilmSpectra

    @property
    def _fitted(self) -> ReadingSpectra:
        """Over black and over white."""
        return np.stack([self.fitted_black, self.fitted_white], axis=1)

    @property
    def residual(self) -> ReadingSpectra:
        """Fitted minus measured reflectance, over black and over white."""
        return self.films.where_seen(self._fitted - self.films.over_cards)

    @property
    def rmse(self) -> PerFilm:
        """Root mean square of measured minus fitted reflectance, both cards together."""
        return np.sqrt(np.mean(self.residual**2, axis=(1, 2)))

    def _delta_e(self, illuminant: str, observer: str | int) -> PerFilmAndCard:
        """CIEDE2000 of fitted from measured spectra, over black and over white; NaN where the bands
        give no colour.
        """
        films = self.films
        lamp = find_illuminant(illuminant)
        eye = find_observer(observer)
        try:
            colour_weights(films.wavelengths, lamp, eye)
        except ValueError:
            return np.full((len(films), 2), np.nan)
        return films.where_seen(
            delta_e_of_spectra(
                films.wavelengths,
                self._fitted,
                films.over_cards,
                illuminant=lamp,
                observer=eye,
            )
        )


@dataclass(frozen=True)
class Recovery(FittedFilms, Tabulated):
    """Recovered films.

    Attributes:
        films: as measured.
        absorption, scattering: optical thicknesses k d and s d, (films, bands).
        covariance: of the two, from the noise of all four readings, (films, bands, 2, 2).
        identifiable: where k and s are separable (`RULE`), (films, bands); elsewhere only k/s is
            known and s d is continued from its neighbours.
        gloss: share of the surface's reflection in the readings, (films,).
        fitted_black, fitted_white: what the model reads, (films, bands).
        misfit: sum of the two squared residuals, in standard deviations, (films, bands).
        converged: whether the solver did, (films, bands).
        ambiguous: whether quite another pair of values fits as well, (films, bands).
    """

    films: Films
    absorption: FilmSpectra
    scattering: FilmSpectra
    covariance: Float[np.ndarray, "films bands 2 2"]
    identifiable: FilmFlags
    gloss: PerFilm
    fitted_black: FilmSpectra
    fitted_white: FilmSpectra
    misfit: FilmSpectra
    converged: FilmFlags
    ambiguous: FilmFlags

    def __len__(self) -> int:
        return len(self.films)

    def __repr__(self) -> str:
        identified = f"k and s separable in {self.identifiable.mean():.0%} of bands"
        return (
            f"Recovery({len(self)} films, {describe_grid(self.films.wavelengths)}, {identified}: "
            f"{list_names(self.films.names)})"
        )

    def arrays_and_axes(self) -> Variables:
        """Recovered and measured arrays."""
        measured, axes = self.films.arrays_and_axes()
        return {
            **measured,
            **{name: (tuple(axes), getattr(self, name)) for name in _IN_TABLES},
        }, axes

    @property
    def absorption_sd(self) -> FilmSpectra:
        """Standard deviation of k d."""
        return np.sqrt(self.covariance[..., 0, 0])

    @property
    def scattering_sd(self) -> FilmSpectra:
        """Standard deviation of s d."""
        return np.sqrt(self.covariance[..., 1, 1])

    @property
    def ratio(self) -> FilmSpectra:
        """Ratio k/s, which needs no thickness."""
        return self.absorption / self.scattering

    @property
    def ratio_sd(self) -> FilmSpectra:
        """Standard deviation of k/s, by the delta method."""
        slope = np.stack([1.0 / self.scattering, -self.absorption / self.scattering**2], axis=-1)
        return np.sqrt(np.einsum("...i,...ij,...j->...", slope, self.covariance, slope))

    def delta_e(self, illuminant: str) -> PerFilm:
        """The larger CIEDE2000 difference of the two fitted spectra from the measured ones, 2
        degree observer; NaN where the bands give no colour.
        """
        return self._delta_e(illuminant, 2).max(axis=-1)

    def interval(self, quantile: float = 1.96) -> tuple[np.ndarray, np.ndarray]:
        """Symmetric intervals of k d and s d, cut at zero: (lower, upper), each (films, bands, 2).

        The default covers the truth in 95 % of cases where `identifiable`.
        """
        value = np.stack([self.absorption, self.scattering], axis=-1)
        half = quantile * np.stack([self.absorption_sd, self.scattering_sd], axis=-1)
        return np.maximum(value - half, 0.0), value + half

    def pigment(self, row: int, thickness: float, provenance: str = "") -> Pigment:
        """One film's paint, if it is this thick (m): k, s and their standard deviations in 1/m."""
        return Pigment(
            self.films.names[row],
            self.films.wavelengths,
            self.absorption[row] / thickness,
            self.scattering[row] / thickness,
            identifiable=self.identifiable[row],
            absorption_sd=self.absorption_sd[row] / thickness,
            scattering_sd=self.scattering_sd[row] / thickness,
            provenance=provenance,
        )

    @classmethod
    def join(cls, films: Films, parts: Sequence["Recovery"]) -> "Recovery":
        """Recoveries of the first batches of some films as one.

        Raises:
            ValueError: there are none.
        """
        if not parts:
            raise ValueError("no film was recovered")
        arrays = {
            field.name: np.concatenate([getattr(recovery, field.name) for recovery in parts])
            for field in fields(cls)
            if field.name != "films"
        }
        return cls(films=films.take(slice(sum(map(len, parts)))), **arrays)
