"""Result of a joint recovery: paints, films, and how well each is known."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float

from glazejax import Pigment
from glazejax.spectra import Bands

from ...film.films import Films, Instrument, Noise
from ...film.model.mixing import MixingLaw
from ...film.model.variation import thickness_variance
from ..films.result import (
    RELATIVE_LIMIT,
    FilmSpectra,
    FittedFilms,
    PerFilm,
    PerFilmAndCard,
    ReadingSpectra,
)
from .pose import MOST_ERROR, ModeNumbers
from .problem import Expectations, FilmShares, JointProblem, Unknowns
from .solver import JointCovariance, thickness_variances

JOINT_RULE = (
    f"k and s count as separable where the joint fit knows each to {RELATIVE_LIMIT:.0%} of its "
    "value, if the paint is in a mixture or thicknesses were measured: else its scale is as "
    "expected, not found"
)


def by_paint(
    values: Float[np.ndarray, "*n bands local"],
) -> Float[np.ndarray, "*n 2 paints bands"]:
    """Values of each paint's k and then of each one's s at every band, by k and s and by paint."""
    # There may be no values at all, of which -1 could not give the size.
    *leading, local = values.shape
    return np.moveaxis(values.reshape(*leading, 2, local // 2), -3, -1)


@dataclass(frozen=True)
class JointRecovery(FittedFilms):
    """Paints recovered jointly. Coefficients are optical thicknesses of a pure film of unit
    relative thickness.

    Attributes:
        films: as measured.
        paints: names.
        shares: of each paint in each film, (films, paints), as the mixing law gives them.
        law: mixing law.
        unknowns: solution of `glazefit.recover.joint.problem`; starts another fit of the same
            films.
        log_covariance: of log k of all paints, then log s, at each band, (bands, 2 paints, 2
            paints).
        draws: of the unknowns from Laplace's approximation, each with a leading axis of draws.
        fitted_black, fitted_white: what the model reads, (films, bands).
        residual_sd: expected size of a residual, noise and model together, (films, 2, bands).
        expectations, instrument: as given.
        steps, converged: of the solver.
        noise: of a reading, as given or as estimated from the readings.
        unit: thickness of a film of unit relative thickness, m.
        known_paints: those that were known before, by name, in the order of `paints`.
        known_modes: known paint -> its error modes' numbers among the unknowns' `others`, and
            among its own.
        whole_covariance: covariance of all unknowns together.
        problem: model of a film, data and expectations, with readings that there are not left out.
        gauged: whether thicknesses were measured.
    """

    films: Films
    paints: tuple[str, ...]
    shares: FilmShares
    law: MixingLaw
    unknowns: Unknowns
    log_covariance: Float[np.ndarray, "bands coefficients coefficients"]
    draws: Unknowns
    fitted_black: FilmSpectra
    fitted_white: FilmSpectra
    residual_sd: ReadingSpectra
    expectations: Expectations
    instrument: Instrument
    steps: int
    converged: bool
    noise: Noise
    unit: float
    known_paints: Mapping[str, Pigment]
    known_modes: Mapping[str, ModeNumbers]
    whole_covariance: JointCovariance
    problem: JointProblem
    gauged: bool

    def __repr__(self) -> str:
        new = [paint for paint in self.paints if paint not in self.known_paints]
        references = f", known: {', '.join(self.known)}" if self.known else ""
        state = "" if self.converged else ", not converged"
        return f"JointRecovery({', '.join(new)} from {len(self.films)} films{references}{state})"

    @property
    def known(self) -> tuple[str, ...]:
        """Names of the paints that were known before."""
        return tuple(self.known_paints)

    @property
    def wavelengths(self) -> Bands:
        """Wavelengths in nm, (bands,)."""
        return self.films.wavelengths

    @property
    def absorption(self) -> Float[np.ndarray, "paints bands"]:
        """k of each paint for unit thickness, (paints, bands)."""
        return np.exp(by_paint(self.unknowns.bands)[0])

    @property
    def scattering(self) -> Float[np.ndarray, "paints bands"]:
        """s of each paint for unit thickness, (paints, bands)."""
        return np.exp(by_paint(self.unknowns.bands)[1])

    @property
    def log_variance(self) -> Float[np.ndarray, "bands coefficients"]:
        """Variances of log k of all paints, then of log s, at each band."""
        return np.diagonal(self.log_covariance, axis1=1, axis2=2)

    @property
    def log_sd(self) -> Float[np.ndarray, "2 paints bands"]:
        """Standard deviations of log k and of log s."""
        return by_paint(np.sqrt(self.log_variance))

    @property
    def log_ratio_sd(self) -> Float[np.ndarray, "paints bands"]:
        """Standard deviation of log(k/s), often far smaller than that of either."""
        paints = len(self.paints)
        cross = np.diagonal(self.log_covariance[:, :paints, paints:], axis1=1, axis2=2).T
        return np.sqrt(np.maximum(np.sum(self.log_sd**2, axis=0) - 2 * cross, 0.0))

    @property
    def relative_log_sd(self) -> Float[np.ndarray, "2 paints bands"]:
        """`log_sd` but for a factor common to all paints: nothing determines it where all films
        hide what is below.
        """
        count = 2 * len(self.paints)
        centring = np.eye(count) - np.full((count, count), 1.0 / count)
        variance = np.diagonal(centring @ self.log_covariance @ centring, axis1=1, axis2=2)
        return by_paint(np.sqrt(np.maximum(variance, 0.0)))

    @property
    def identifiable(self) -> Bool[np.ndarray, "paints bands"]:
        """True where k and s of a paint are both known (`JOINT_RULE`)."""
        mixed = self.shares[(self.shares > 0).sum(axis=1) > 1]
        scaled = (mixed > 0).any(axis=0) | self.gauged | np.isin(self.paints, self.known)
        return np.all(self.log_sd <= RELATIVE_LIMIT, axis=0) & scaled[:, None]

    @property
    def thickness(self) -> PerFilm:
        """Relative thickness of each film."""
        return np.exp(self.unknowns.films[:, 0])

    @cached_property
    def thickness_sd(self) -> PerFilm:
        """Standard deviation of `thickness`: what the readings leave open, and that paints known
        before may be stronger or weaker in these films.
        """
        shown = thickness_variances(self.problem, self.unknowns, self.whole_covariance)
        # What was expected of each film; without a gauge all may share a factor besides.
        prior = self.problem.scale.films[:, 0] ** 2
        if not self.gauged:
            prior = prior + np.sum(np.square(self.problem.thickness_modes), axis=0)
        varied = self.shares**2 @ [paint in self.known_paints for paint in self.paints]
        return self.thickness * np.sqrt(thickness_variance(shown, prior, varied))

    def depth(
        self, films: Float[np.ndarray, "*draws films 2+parts"]
    ) -> Float[np.ndarray, "*draws"]:
        """Mean over the films that do not hide their ground of the log of thickness, by unknowns of
        the films; 0 where all hide it.
        """
        logs = films[..., ~self.films.opaque, 0]
        return np.sum(logs, axis=-1) / max(logs.shape[-1], 1)

    @property
    def gloss(self) -> PerFilm:
        """Share of the smooth surface's reflection that each film shows."""
        measured = self.problem.gloss
        expected = np.where(np.isnan(measured), self.shares @ self.unknowns.paints, measured)
        return np.exp(expected + self.unknowns.films[:, 1])

    def delta_e(self, illuminant: str = "D65", observer: str | int = 10) -> PerFilmAndCard:
        """CIEDE2000 of fitted from measured spectra, over black and over white; NaN where the bands
        give no colour.
        """
        return self._delta_e(illuminant, observer)

    def recipe(self, film: int) -> dict[str, float]:
        """Paints of a film, by number, and the share of each, in the order of `paints`."""
        return {
            self.paints[p]: float(share) for p, share in enumerate(self.shares[film]) if share > 0
        }

    @cached_property
    def _modes(self) -> Float[np.ndarray, "modes 2 paints bands"]:
        """Modes of what the films leave open in log k and log s of all paints together: the largest
        modes of the covariance. What they leave out is in the standard deviations.

        A coefficient that is not known to a factor of exp(`MOST_ERROR`) counts as known to that
        factor.
        """
        cap = np.minimum(1.0, MOST_ERROR / np.maximum(np.sqrt(self.log_variance), 1e-12))
        return by_paint(self.whole_covariance.largest(cap, 64))

    def row(self, paint: str) -> int:
        """Number of a paint.

        Raises:
            ValueError: there is none of that name.
        """
        if paint not in self.paints:
            raise ValueError(f"no paint is called {paint!r}; known: {', '.join(self.paints)}")
        return self.paints.index(paint)

    def pigment(self, paint: str, thickness: float, provenance: str = "") -> Pigment:
        """One paint, if a film of unit relative thickness is this thick (m): k, s and standard
        deviations in 1/m.
        """
        row = self.row(paint)
        k = self.absorption[row] / thickness
        s = self.scattering[row] / thickness
        return Pigment(
            paint,
            self.wavelengths,
            k,
            s,
            identifiable=self.identifiable[row],
            absorption_sd=k * self.log_sd[0, row],
            scattering_sd=s * self.log_sd[1, row],
            error_modes=self._modes[:, :, row],
            provenance=provenance,
        )

    def pigments(self, thickness: float) -> dict[str, Pigment]:
        """All paints by name; see `pigment`."""
        return {paint: self.pigment(paint, thickness) for paint in self.paints}
