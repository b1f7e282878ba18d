"""The posterior of k d and s d of a measured film, every wavelength a block of its own.

Two readings and two unknowns a band. Beforehand any order of magnitude of k d is as likely as
another, from where a film is clear to where it is opaque: the density of log k d is 1/((1 + c/k
d)(1 + k d/h)), level between soft ends c = .01 and h = 100, and that of log s d the same with h =
400. The free unknowns are log k/s and log s d, because an opaque film knows the first and not the
second.

The grounds' own errors are part of the variance, through the film: v = sd^2 + (dR/d rho)^2
ground_sd^2. The gloss is one number for the whole film; two readings a band leave it open, so it is
estimated beforehand (`glazefit.film.gloss`).
"""

import functools
from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..film.films import Instrument
from ..film.model.body import HIGHEST
from ..film.model.response import FilmResponse, film_response
from ..film.numerics.least_squares import root_of_log1p
from ..film.reading import Reading
from .problem import MeasuredResiduals, Problem, Quantity, fingerprint

CLEAR = 0.01
"""Optical thickness below which a film is clear, and the prior falls off; it does so too above
`HIGHEST`.
"""


class Band(NamedTuple):
    """One band, over its grounds (last axis)."""

    reading: Float[Array, "*blocks grounds"]
    surface: Float[Array, "*blocks"]  # what the surface adds to the reading
    ground: Float[Array, "*blocks grounds"]
    sd: Float[Array, "*blocks grounds"]
    ground_sd: Float[Array, "*blocks grounds"]


def logarithms(free: Float[Array, "2"]) -> Float[Array, "2"]:
    """Log k d and log s d from the free unknowns."""
    return jnp.stack([free[0] + free[1], free[1]])


def readings_of(
    free: Float[Array, "2"], data: Band, shared: FilmResponse
) -> Float[Array, "grounds"]:
    """What the instrument reads."""
    thickness = jnp.exp(logarithms(free))
    return data.surface + shared.body(thickness[0], thickness[1], data.ground)


def residuals(free: Float[Array, "2"], data: Band, shared: FilmResponse) -> Float[Array, "rows"]:
    """Misfit, log-determinant and prior of one band."""
    logs = logarithms(free)
    thickness = jnp.exp(logs)
    black, gain, back = shared.numbers(thickness[0], thickness[1])
    through = gain / (1.0 - back * data.ground)
    off = data.reading - data.surface - black - through * data.ground
    root = jnp.maximum(through, 0.0) / (1.0 - back * data.ground) * data.ground_sd / data.sd
    misfit = off / (data.sd * jnp.sqrt(1.0 + root**2))
    # Minus the logarithm of the prior's density is the sum of two soft ends.
    ends = jax.nn.softplus(np.log(CLEAR) - logs) + jax.nn.softplus(logs - np.log(np.array(HIGHEST)))
    return jnp.concatenate([misfit, root_of_log1p(root), jnp.sqrt(2.0 * ends)])


def prior_draws(rng: np.random.Generator, n: int) -> Float[np.ndarray, "n 2"]:
    """Draws of the free unknowns, by the inverse of log[(x + c)/(x + h) h/c] / log(h/c)."""
    ends = np.array(HIGHEST)
    share = (CLEAR / ends) ** (1.0 - rng.random((n, 2)))
    logs = np.log(np.maximum(share * ends - CLEAR, 1e-300) / (1.0 - share))
    return np.stack([logs[:, 0] - logs[:, 1], logs[:, 1]], axis=-1)


@functools.cache
def prior_covariance() -> Float[np.ndarray, "2 2"]:
    """Of the free unknowns, from many draws."""
    return np.cov(prior_draws(np.random.default_rng(0), 200_000), rowvar=False)


def pose_bands(films: Sequence[Reading], gloss: float, instrument: Instrument) -> Problem:
    """Problem of k d and s d in every band of some films, film after film.

    Args:
        films: as measured.
        gloss: share of the surface's reflection in the readings.
        instrument: its geometry.
    """

    def joined(what: str) -> Array:
        return jnp.asarray(np.concatenate([getattr(film, what) for film in films]))

    reading = joined("reflectance")
    measured = [part for film in films for part in reading_parts(film)]
    return Problem(
        kind="bands",
        blocks=tuple(f"{w:g} nm" for film in films for w in film.wavelengths),
        unknowns=("log k/s", "log s d"),
        residuals=residuals,
        fitted=readings_of,
        # The soft ends.
        prior_rows=2,
        data=Band(
            reading=reading,
            surface=jnp.full(len(reading), gloss * instrument.seen_surface),
            ground=joined("ground"),
            sd=joined("sd"),
            ground_sd=joined("ground_sd"),
        ),
        shared=film_response(instrument),
        quantities=(
            Quantity("absorption", True, lambda free: np.exp(free[..., 0] + free[..., 1])),
            Quantity("scattering", True, lambda free: np.exp(free[..., 1])),
            Quantity("ratio", True, lambda free: np.exp(free[..., 0])),
        ),
        prior_draws=prior_draws,
        prior_covariance=prior_covariance(),
        bands=1,
        fingerprint=fingerprint("bands", *measured, gloss, instrument),
        scaled=MeasuredResiduals(residuals, prior_rows=2),
    )


def reading_parts(reading: Reading) -> tuple[object, ...]:
    """What of a reading decides the posterior."""
    return reading.wavelengths, reading.reflectance, reading.ground, reading.sd, reading.ground_sd
