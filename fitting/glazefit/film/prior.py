"""Prior of a film: of fractions, thickness, an unknown paint, gloss and the paints' error.

Fractions are Dirichlet, gloss is uniform in [0, 1], and all else Gaussian: log
thickness, what the spectra of an unknown paint are made of, and the log size of the paints' error.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol, TypeAlias

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from scipy.special import polygamma

from .forward import Film, FilmShared, PerUnknown, Terms, log_fractions
from .model.errors import Prior
from .model.variation import STRENGTH

UnknownsCovariance: TypeAlias = Float[np.ndarray, "dims dims"]
"""Of the free unknowns of a block."""


class Law(Protocol):
    """A law of the free unknowns; hashable, since compiled programs are kept by it."""

    def residuals(self, free: PerUnknown, shared: Any) -> Terms:
        """Half their squares, summed, are minus the logarithm of the density up to a constant."""
        ...

    def draws(self, rng: np.random.Generator, n: int, shared: Any) -> Float[np.ndarray, "n dims"]:
        """Draws of the unknowns."""
        ...

    def covariance(self, shared: Any) -> UnknownsCovariance:
        """Of the draws."""
        ...


@dataclass(frozen=True)
class FilmPrior:
    """Of a film's free unknowns; the numbers of what is Gaussian are in `FilmShared`.

    Attributes:
        film: whose unknowns they are.
        concentration: of the fractions' Dirichlet distribution.
    """

    film: Film
    concentration: float

    def moments(
        self,
        spread: Float[np.ndarray, "coats"],
        shares: Sequence[Float[np.ndarray, "paints"]],
        prior: Prior,
    ) -> tuple[Float[np.ndarray, "dims"], Float[np.ndarray, "dims"]]:
        """Means and standard deviations of the free unknowns.

        Readings show thickness times strength, which scatters more than thickness.

        Args:
            spread: standard deviation of each coat's log thickness.
            shares: of each coat's paints, where they are known.
            prior: of the film.
        """
        positions = self.film.places
        mean = np.zeros(self.film.dims)
        sd = np.ones(self.film.dims)
        for n, own in enumerate(shares):
            # Trigamma functions of the concentrations (Aitchison 1986).
            sd[positions.ratios[n]] = np.sqrt(2.0 * polygamma(1, self.concentration))
            squares = np.sum(own**2)
            if self.film.fractions[n]:
                # Expected of Dirichlet's distribution.
                squares = (self.concentration + 1.0) / (len(own) * self.concentration + 1.0)
            sd[positions.thickness[n]] = np.sqrt(spread[n] ** 2 + STRENGTH**2 * squares)
        # Of the logistic distribution, whose sigmoid is uniform.
        sd[positions.gloss] = np.pi / np.sqrt(3.0)
        mean[positions.error] = np.log(prior.error)
        sd[positions.error] = prior.error_spread
        return mean, sd

    def residuals(self, free: PerUnknown, shared: FilmShared) -> Terms:
        """One an unknown, and one more for each coat's fractions."""
        positions = self.film.places
        # Dirichlet's density in the log-ratios is the product of the fractions to their
        # concentrations.
        terms = [
            jnp.sqrt(-2.0 * self.concentration * log_fractions(free[at]))
            for at, unknown in zip(positions.ratios, self.film.fractions, strict=True)
            if unknown
        ]
        # The logistic density, of an unknown whose sigmoid is uniform in [0, 1].
        gloss = free[positions.gloss]
        terms.append(jnp.sqrt(-2.0 * (jax.nn.log_sigmoid(gloss) + jax.nn.log_sigmoid(-gloss))))
        normal = np.delete(np.arange(self.film.dims), np.r_[(*positions.ratios, positions.gloss)])
        terms.append((free[normal] - shared.mean[normal]) / shared.sd[normal])
        return jnp.concatenate(terms)

    def draws(
        self, rng: np.random.Generator, n: int, shared: FilmShared
    ) -> Float[np.ndarray, "n dims"]:
        """Of the free unknowns."""
        film = self.film
        positions = film.places
        draws = np.array(shared.mean + shared.sd * rng.standard_normal((n, film.dims)))
        for at, size, unknown in zip(positions.ratios, film.sizes, film.fractions, strict=True):
            if unknown:
                # A fraction of exactly 0 has no logarithm.
                shares = np.maximum(rng.dirichlet(np.full(size, self.concentration), n), 1e-12)
                draws[:, at] = np.log(shares[:, :-1] / shares[:, -1:])
        draws[:, positions.gloss] = rng.logistic(size=(n, int(film.gloss)))
        return draws

    def covariance(self, shared: FilmShared) -> UnknownsCovariance:
        """Of the draws: log-ratios to the same fraction are correlated by a half."""
        sd = np.asarray(shared.sd)
        covariance = np.diag(sd**2)
        for at in self.film.places.ratios:
            covariance[at, at] = 0.5 * (covariance[at, at] + np.outer(sd[at], sd[at]))
        return covariance
