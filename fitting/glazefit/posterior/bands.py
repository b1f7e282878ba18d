"""Optical thicknesses of a measured film, every wavelength a block of its own: a film of one coat
of unknown paint, whose spectra are two numbers.

Two readings and two unknowns a band. By the prior any order of magnitude of k d is as likely
as another, from where a film is clear to where it is opaque: the density of log k d is 1/((1 + c/k
d)(1 + k d/h)), level between soft ends c = .01 and h = 100, and that of log s d the same with h =
400. The free unknowns are log k/s and log s d, because an opaque film knows the first and not the
second.

The gloss is one number for the whole film; two readings a band leave it open, so it is estimated
in advance (`glazefit.film.gloss`).
"""

from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..film.errors import PaintErrors
from ..film.films import Instrument, Reading
from ..film.forward import OPAQUE_THICKNESS, pose_each_band
from ..film.problem import FilmProblem, Quantity, fingerprint

CLEAR = 0.01
"""Optical thickness below which a film is clear, and the prior falls off; it does so too above
`OPAQUE_THICKNESS`.
"""

# Slopes of log k d and of log s d by log k/s and log s d.
_LOGS = np.array([[1.0, 1.0], [0.0, 1.0]])


@dataclass(frozen=True)
class BandPrior:
    """Of log k/s and log s d of one band."""

    def residuals(self, free: Float[Array, "2"], shared: Any) -> Float[Array, "2"]:
        """Minus the logarithm of the density is the sum of two soft ends."""
        logs = jnp.stack([free[0] + free[1], free[1]])
        ends = jax.nn.softplus(np.log(CLEAR) - logs)
        return jnp.sqrt(2.0 * (ends + jax.nn.softplus(logs - np.log(np.array(OPAQUE_THICKNESS)))))

    def draws(
        self, rng: np.random.Generator, n: int, shared: Any = None
    ) -> Float[np.ndarray, "n 2"]:
        """By the inverse of log[(x + c)/(x + h) h/c] / log(h/c)."""
        ends = np.array(OPAQUE_THICKNESS)
        share = (CLEAR / ends) ** (1.0 - rng.random((n, 2)))
        logs = np.log(np.maximum(share * ends - CLEAR, 1e-300) / (1.0 - share))
        return np.stack([logs[:, 0] - logs[:, 1], logs[:, 1]], axis=-1)

    def covariance(self, shared: Any = None) -> Float[np.ndarray, "2 2"]:
        """Of the draws, from many of them."""
        return np.cov(self.draws(np.random.default_rng(0), 200_000), rowvar=False)


def pose_bands(reading: Reading, gloss: float, instrument: Instrument) -> FilmProblem:
    """Problem of k d and s d in every band of a film.

    Args:
        reading: of the film.
        gloss: share of the surface's reflection in the readings.
        instrument: its geometry.
    """
    surface = gloss * float(instrument.seen_surface)
    film, data, shared = pose_each_band(instrument, surface, _LOGS, reading)
    return FilmProblem(
        kind="bands",
        blocks=tuple(f"{wavelength:g} nm" for wavelength in reading.wavelengths),
        unknowns=("log k/s", "log s d"),
        film=film,
        misfit=PaintErrors(film),
        prior=BandPrior(),
        data=data,
        shared=shared,
        quantities=(
            Quantity("absorption", True, lambda free: np.exp(free[..., 0] + free[..., 1])),
            Quantity("scattering", True, lambda free: np.exp(free[..., 1])),
            Quantity("ratio", True, lambda free: np.exp(free[..., 0])),
        ),
        bands=1,
        fingerprint=fingerprint("bands", reading, gloss, instrument),
        # Its determinants count as readings: without them chains mix a third slower.
        scaled=PaintErrors(film),
    )
