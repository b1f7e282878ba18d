"""The posterior of a film of known paints: fractions, thickness, gloss, and how wrong the paints' k
and s are.

The mixture's k and s are the paints' sums, weighted by fraction, times the thickness. Fractions are
Dirichlet beforehand, thickness log-normal, gloss uniform in [0, 1].

A catalogue never fits to the noise. Its error is a relative one: log k and log s of the mixture are
each off by a smooth random function of wavelength, delta, Gaussian with a Matérn-3/2 correlation, K
= (1 + x) exp(-x) with x = sqrt(3)|l - l'| / length, which forgives sharper errors than a smoother
law. Their standard deviation is itself
unknown: the model error e, log-normal beforehand.

The errors, two a band, are integrated out. About their likeliest values delta* readings are linear
in them, f(mixture, delta) = f(mixture, delta*) + J (delta - delta*), so that a mixture's readings
are Gaussian with

    mean f(mixture, delta*) - J delta*,     covariance C = diag(v) + e^2 J K J^T

and variances v by noise and grounds. With W that makes diag(v) unity and J K J^T diagonal, b, the
residuals are W (reading - mean) / sqrt(1 + e^2 b) and the determinant is that of 1 + e^2 b:
sampling needs no factorisation.
`glazefit.posterior.film_errors` finds delta* and J.
"""

import functools
from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.special import expit, polygamma

from glazejax import Pigment

from ..film.films import Instrument
from ..film.model.errors import Prior
from ..film.model.response import FilmResponse, film_response
from ..film.numerics.least_squares import root_of_log1p
from ..film.reading import Reading
from .bands import reading_parts
from .problem import (
    Problem,
    Quantity,
    fingerprint,
    uniform_residual,
)

MOST_PAINTS = 5


class FilmData(NamedTuple):
    """One film and its paints; readings are flat, band after band and ground after ground."""

    absorption: Float[Array, "*blocks bands paints"]  # k times the prior's thickness
    scattering: Float[Array, "*blocks bands paints"]
    reading: Float[Array, "*blocks bands grounds"]
    ground: Float[Array, "*blocks bands grounds"]
    shift: Float[Array, "*blocks 2 bands"]  # delta*, of log k and of log s
    offset: Float[Array, "*blocks bands grounds"]  # -J delta*
    whiten: Float[Array, "*blocks rows rows"]  # W
    spread: Float[Array, "*blocks rows"]  # roots of b


class FilmShared(NamedTuple):
    """What all films have in common."""

    response: FilmResponse
    surface: Float[Array, ""]
    thickness_spread: Float[Array, ""]
    concentration: Float[Array, ""]
    log_error: Float[Array, ""]
    error_spread: Float[Array, ""]


def unknowns(paints: int, seen_surface: float) -> tuple[str, ...]:
    """Names of the free unknowns: log-ratios to the last paint's fraction, log thickness, logit
    gloss, log error.
    """
    ratios = tuple(f"fraction {i + 1}" for i in range(paints - 1))
    return (*ratios, "thickness", *(("gloss",) if seen_surface else ()), "model error")


def log_fractions(free: Float[Array, "*n dims"], paints: int) -> Float[Array, "*n paints"]:
    """Logarithms of the fractions; the last paint's log-ratio is 0."""
    ratios = jnp.concatenate([free[..., : paints - 1], jnp.zeros_like(free[..., :1])], axis=-1)
    return jax.nn.log_softmax(ratios, axis=-1)


def mixture(
    free: Float[Array, "dims"], data: FilmData
) -> tuple[Float[Array, "bands"], Float[Array, "bands"]]:
    """Optical thicknesses k d and s d of the film."""
    paints = data.absorption.shape[-1]
    amounts = jnp.exp(log_fractions(free, paints) + free[paints - 1])
    return data.absorption @ amounts, data.scattering @ amounts


def surface(free: Float[Array, "dims"], data: FilmData, shared: FilmShared) -> Float[Array, ""]:
    """What the surface adds to a reading."""
    paints = data.absorption.shape[-1]
    return (
        shared.surface * jax.nn.sigmoid(free[paints])
        if free.shape[-1] > paints + 1
        else shared.surface
    )


def readings_of(
    free: Float[Array, "dims"], data: FilmData, shared: FilmShared
) -> Float[Array, "bands grounds"]:
    """What the instrument would read if the catalogue had no error."""
    k, s = (a[:, None] for a in mixture(free, data))
    return surface(free, data, shared) + shared.response.body(k, s, data.ground)


def residuals(
    free: Float[Array, "dims"], data: FilmData, shared: FilmShared
) -> Float[Array, "rows"]:
    """Misfit, log-determinant and prior of one film."""
    paints = data.absorption.shape[-1]
    k, s = (a[:, None] for a in jnp.stack(mixture(free, data)) * jnp.exp(data.shift))
    mean = surface(free, data, shared) + shared.response.body(k, s, data.ground) + data.offset
    root = jnp.exp(free[-1]) * data.spread
    misfit = data.whiten @ (data.reading - mean).reshape(-1) / jnp.sqrt(1.0 + root**2)
    normal = jnp.stack(
        [
            free[paints - 1] / shared.thickness_spread,
            (free[-1] - shared.log_error) / shared.error_spread,
        ]
    )
    parts = [misfit, root_of_log1p(root), normal]
    if paints > 1:
        # Dirichlet's density in the log-ratios is the product of the fractions to their
        # concentrations.
        parts.append(jnp.sqrt(-2.0 * shared.concentration * log_fractions(free, paints)))
    if free.shape[-1] > paints + 1:
        parts.append(uniform_residual(free[paints : paints + 1]))
    return jnp.concatenate(parts)


def pose_films(
    films: Sequence[Reading],
    paints: Sequence[Sequence[Pigment]],
    instrument: Instrument,
    prior: Prior,
) -> Problem:
    """Problem of one film or of several with as many paints each, without the model's error yet.

    Raises:
        ValueError: no paint or too many, a paint listed twice, or paints that do not cover the
            film's wavelengths.
    """
    grid = films[0].wavelengths
    count = len(paints[0])
    sets = [check_paints(film, chosen) for film, chosen in zip(films, paints, strict=True)]
    count_films, (bands, grounds) = len(films), films[0].reflectance.shape

    def gather(what: str) -> Array:
        values = [
            np.stack([np.asarray(getattr(p, what)) for p in chosen], axis=-1) for chosen in sets
        ]
        return jnp.asarray(np.stack(values) * prior.thickness)

    # What is each film's own, ...
    data = FilmData(
        absorption=gather("absorption"),
        scattering=gather("scattering"),
        reading=jnp.asarray(np.stack([f.reflectance for f in films])),
        ground=jnp.asarray(np.stack([f.ground for f in films])),
        shift=jnp.zeros((count_films, 2, bands)),
        offset=jnp.zeros((count_films, bands, grounds)),
        whiten=jnp.asarray(np.stack([np.eye(bands * grounds) / f.sd.ravel() for f in films])),
        spread=jnp.zeros((count_films, bands * grounds)),
    )
    # ... and what all share.
    numbers = (
        instrument.seen_surface,
        prior.spread,
        prior.concentration_known,
        np.log(prior.error),
    )
    shared = FilmShared(
        film_response(instrument),
        *(jnp.asarray(float(n)) for n in (*numbers, prior.error_spread)),
    )
    names = unknowns(count, instrument.seen_surface)
    # The fingerprint holds all numbers that the posterior rests on.
    measured = [part for film in films for part in reading_parts(film)]
    spectra = [
        np.asarray(getattr(p, what))
        for s in sets
        for p in s
        for what in ("absorption", "scattering")
    ]
    return Problem(
        kind="paints",
        blocks=tuple(film.name for film in films),
        unknowns=names,
        residuals=residuals,
        fitted=readings_of,
        prior_rows=2 + (count if count > 1 else 0) + ("gloss" in names),
        data=data,
        shared=shared,
        quantities=_quantities(
            [p.name for p in sets[0]] if len(sets) == 1 else range(1, count + 1), names, prior
        ),
        prior_draws=functools.partial(
            _prior_draws, count=count, gloss="gloss" in names, prior=prior
        ),
        prior_covariance=_prior_covariance(count, "gloss" in names, prior),
        bands=grid.size,
        fingerprint=fingerprint("paints", *measured, *spectra, prior, instrument),
    )


def check_paints(film: Reading, paints: Sequence[Pigment]) -> list[Pigment]:
    """The paints on the film's wavelengths."""
    names = [paint.name for paint in paints]
    if not 1 <= len(names) <= MOST_PAINTS:
        raise ValueError(
            f"{len(names)} paints were given for {film.name!r}; name 1 to {MOST_PAINTS}"
        )
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise ValueError(f"the paint {twice!r} is listed twice")
    return [paint.resample(film.wavelengths) for paint in paints]


def _quantities(
    names: Sequence[object], free: tuple[str, ...], prior: Prior
) -> tuple[Quantity, ...]:
    count = len(names)
    found = [
        Quantity(
            f"fraction {name}", False, functools.partial(fraction, at=slice(0, count - 1), which=i)
        )
        for i, name in enumerate(names)
        if count > 1
    ]
    found.append(
        Quantity("thickness", True, lambda values: prior.thickness * np.exp(values[..., count - 1]))
    )
    if "gloss" in free:
        found.append(Quantity("gloss", False, lambda values: expit(values[..., count])))
    found.append(Quantity("model error", True, lambda values: np.exp(values[..., -1])))
    return tuple(found)


def fraction(free: Float[np.ndarray, "*n dims"], at: slice, which: int) -> Float[np.ndarray, "*n"]:
    """One paint's fraction, from the log-ratios to the last paint's that stand at these places."""
    ratios = np.concatenate([free[..., at], np.zeros_like(free[..., :1])], axis=-1)
    shares = np.exp(ratios - ratios.max(axis=-1, keepdims=True))
    return shares[..., which] / shares.sum(axis=-1)


def draw_ratios(
    rng: np.random.Generator, n: int, count: int, concentration: float
) -> Float[np.ndarray, "n ratios"]:
    """Log-ratios to the last of fractions with a Dirichlet distribution."""
    # A fraction of exactly 0 has no logarithm.
    shares = np.log(np.maximum(rng.dirichlet(np.full(count, concentration), n), 1e-12))
    return shares[:, :-1] - shares[:, -1:]


def ratios_covariance(count: int, concentration: float) -> Float[np.ndarray, "ratios ratios"]:
    """Of `draw_ratios`: trigamma functions of the concentrations (Aitchison 1986)."""
    return float(polygamma(1, concentration)) * (np.eye(count - 1) + 1.0)


def _prior_draws(
    rng: np.random.Generator, n: int, *, count: int, gloss: bool, prior: Prior
) -> Float[np.ndarray, "n dims"]:
    columns = [
        draw_ratios(rng, n, count, prior.concentration_known),
        prior.spread * rng.standard_normal((n, 1)),
    ]
    if gloss:
        columns.append(rng.logistic(size=(n, 1)))
    columns.append(np.log(prior.error) + prior.error_spread * rng.standard_normal((n, 1)))
    return np.concatenate(columns, axis=1)


def _prior_covariance(count: int, gloss: bool, prior: Prior) -> Float[np.ndarray, "dims dims"]:
    dims = count + 1 + gloss
    covariance = np.zeros((dims, dims))
    covariance[: count - 1, : count - 1] = ratios_covariance(count, prior.concentration_known)
    covariance[count - 1, count - 1] = prior.spread**2
    if gloss:
        covariance[count, count] = np.pi**2 / 3.0
    covariance[-1, -1] = prior.error_spread**2
    return covariance
