"""Which unknowns a film of coats has, where each stands, what it is called, and what is likely of
it before the measurement.
"""

import functools
import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int
from scipy.special import expit, polygamma, softmax

from ..film.model.errors import Prior
from ..film.model.optics import Optics
from .problem import Quantity


class Places(NamedTuple):
    """Where each unknown stands among the free ones; empty for what is known. The model error is
    the last.
    """

    ratios: tuple[slice, ...]
    thickness: tuple[slice, ...]
    spectra: tuple[slice, ...]
    gloss: slice


@dataclass(frozen=True)
class Layout:
    """What the unknowns are: fixed when the program is compiled, alike for all films that are
    sampled side by side.

    The free unknowns, in order: for each coat the log-ratios of its fractions to the last, where
    they are unknown, and log thickness over its median, where that is; the weights of the modes of
    log k d and log s d of an unknown paint; logit gloss, where the instrument sees the surface; log
    model error.

    Attributes:
        sizes: paints of each coat, top first; 0 for the unknown one.
        fractions: whether those of a coat are unknown.
        thickness: whether that of a coat is.
        modes: number of modes of log k d, and of log s d; 0 if all paints are known.
        gloss: whether there is one.
        concentration: of the fractions' Dirichlet distribution.
        optics: of the instrument.
    """

    sizes: tuple[int, ...]
    fractions: tuple[bool, ...]
    thickness: tuple[bool, ...]
    modes: tuple[int, int]
    gloss: bool
    concentration: float
    optics: Optics

    @property
    def unknown_coat(self) -> int | None:
        """Number of the coat whose paint is unknown, from 0."""
        return self.sizes.index(0) if 0 in self.sizes else None

    @property
    def paints(self) -> tuple[slice, ...]:
        """Where each coat's paints stand among all."""
        ends = np.cumsum([0, *self.sizes])
        return tuple(slice(int(a), int(b)) for a, b in itertools.pairwise(ends))

    @property
    def places(self) -> Places:
        """Where each unknown stands."""
        counts: list[int] = []
        for size, sought, thick in zip(self.sizes, self.fractions, self.thickness, strict=True):
            counts += [size - 1 if sought else 0, thick]
        ends = np.cumsum([0, *counts, *self.modes, self.gloss]).tolist()
        each = tuple(slice(first, last) for first, last in itertools.pairwise(ends))
        return Places(
            ratios=each[:-3:2], thickness=each[1:-3:2], spectra=each[-3:-1], gloss=each[-1]
        )

    @property
    def dims(self) -> int:
        """Number of the free unknowns."""
        return self.places.gloss.stop + 1

    @property
    def normal(self) -> Int[np.ndarray, "normal"]:
        """Where the unknowns stand that are Gaussian beforehand: all but log-ratios and gloss."""
        places = self.places
        return np.delete(np.arange(self.dims), np.r_[(*places.ratios, places.gloss)])

    @property
    def prior_rows(self) -> int:
        """Residuals of the prior: one an unknown, and one more for each coat's fractions."""
        return self.dims + sum(self.fractions)


def log_fractions(ratios: Float[Array, "*n ratios"]) -> Float[Array, "*n paints"]:
    """Logarithms of the fractions from their log-ratios to the last one."""
    return jax.nn.log_softmax(jnp.concatenate([ratios, jnp.zeros_like(ratios[..., :1])], axis=-1))


def _fraction(free: Float[np.ndarray, "*n dims"], at: slice, which: int) -> np.ndarray:
    """One paint's fraction, from the log-ratios that stand at these places, (...)."""
    ratios = np.concatenate([free[..., at], np.zeros_like(free[..., :1])], axis=-1)
    return softmax(ratios, axis=-1)[..., which]


def _exponential(
    free: Float[np.ndarray, "*n dims"],
    level: float | np.floating,
    weights: Float[np.ndarray, "dims"],
) -> np.ndarray:
    """A quantity whose logarithm is linear in the unknowns, (...)."""
    return np.exp(level + free @ weights)


def name_unknowns(
    layout: Layout,
    *,
    paints: Sequence[Sequence[object]],
    suffixes: Sequence[str],
    median: Float[np.ndarray, "coats"],
    grid: Float[np.ndarray, "bands"],
    levels: Float[np.ndarray, "2"],
    modes: tuple[Float[np.ndarray, "bands modes"], Float[np.ndarray, "bands others"]],
) -> tuple[tuple[str, ...], tuple[Quantity, ...]]:
    """Names of the free unknowns, of which a log-ratio is called by the paint whose share it moves,
    and what is reported of a film.

    Args:
        layout: of the unknowns.
        paints: names of each coat's paints.
        suffixes: of the names of what a coat has.
        median: of the thicknesses beforehand, m.
        grid: wavelengths, nm.
        levels, modes: of log k d and log s d of an unknown paint.
    """
    places = layout.places
    reported: list[Quantity] = []
    names: list[str] = []

    def report(name: str, level: float, weights: np.ndarray, spectrum: str = "") -> None:
        values = functools.partial(_exponential, level=level, weights=weights)
        reported.append(Quantity(name, True, values, spectrum))

    unit = np.eye(layout.dims)
    for n, suffix in enumerate(suffixes):
        if layout.fractions[n]:
            each = [f"fraction {paint}{suffix}" for paint in paints[n]]
            names += each[:-1]
            reported += [
                Quantity(name, False, functools.partial(_fraction, at=places.ratios[n], which=i))
                for i, name in enumerate(each)
            ]
        if layout.thickness[n]:
            names.append(f"thickness{suffix}")
            report(names[-1], np.log(median[n]), unit[places.thickness[n].start])
    for what, count in zip(("k d", "s d"), layout.modes, strict=True):
        names += [f"mode {i + 1} of {what}" for i in range(count)]
    for b, wavelength in enumerate(grid if layout.unknown_coat is not None else []):
        k, s = (mode[b] @ unit[at] for mode, at in zip(modes, places.spectra, strict=True))
        for what, level, weights in (
            ("absorption", levels[0], k),
            ("scattering", levels[1], s),
            ("ratio", levels[0] - levels[1], k - s),
        ):
            report(f"{what} at {wavelength:g} nm", level, weights, spectrum=what)
    if layout.gloss:
        names.append("gloss")
        reported.append(Quantity("gloss", False, lambda free: expit(free[..., -2])))
    names.append("model error")
    report("model error", 0.0, unit[-1])
    return tuple(names), tuple(reported)


def prior_moments(
    layout: Layout, spread: Float[np.ndarray, "coats"], prior: Prior
) -> tuple[Float[np.ndarray, "dims"], Float[np.ndarray, "dims"]]:
    """Means and standard deviations of the free unknowns before the measurement.

    Args:
        layout: of the unknowns.
        spread: standard deviation of each coat's log thickness.
        prior: of the film.
    """
    places = layout.places
    mean = np.zeros(layout.dims)
    sd = np.ones(layout.dims)
    for ratios, thickness, off in zip(places.ratios, places.thickness, spread, strict=True):
        # Trigamma functions of the concentrations (Aitchison 1986).
        sd[ratios] = np.sqrt(2.0 * polygamma(1, layout.concentration))
        sd[thickness] = off
    # Of the logistic distribution, whose sigmoid is uniform.
    sd[places.gloss] = np.pi / np.sqrt(3.0)
    mean[-1] = np.log(prior.error)
    sd[-1] = prior.error_spread
    return mean, sd


def prior_draws(
    rng: np.random.Generator,
    n: int,
    *,
    layout: Layout,
    mean: Float[np.ndarray, "dims"],
    sd: Float[np.ndarray, "dims"],
) -> Float[np.ndarray, "n dims"]:
    """Draws of the free unknowns of these `prior_moments`."""
    places = layout.places
    draws = mean + sd * rng.standard_normal((n, mean.size))
    for at, size, sought in zip(places.ratios, layout.sizes, layout.fractions, strict=True):
        if sought:
            # A fraction of exactly 0 has no logarithm.
            shares = np.maximum(rng.dirichlet(np.full(size, layout.concentration), n), 1e-12)
            draws[:, at] = np.log(shares[:, :-1] / shares[:, -1:])
    draws[:, places.gloss] = rng.logistic(size=(n, int(layout.gloss)))
    return draws


def prior_covariance(layout: Layout, sd: Float[np.ndarray, "dims"]) -> np.ndarray:
    """Of `prior_draws`, (dims, dims): log-ratios to the same fraction are correlated by a half."""
    covariance = np.diag(sd**2)
    for at in layout.places.ratios:
        covariance[at, at] = 0.5 * (covariance[at, at] + np.outer(sd[at], sd[at]))
    return covariance
