"""Which unknowns a film of coats has, where each stands, what it is called, and what is likely of
it beforehand.
"""

import functools
import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.special import expit

from ..film.model.errors import Prior
from ..film.model.optics import Optics
from .coats import CoatPrior
from .film import draw_ratios, fraction, ratios_covariance
from .problem import Quantity


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
    def places(self) -> "Places":
        """Where each unknown stands."""
        ratios = []
        thickness = []
        at = 0
        for size, sought, thick in zip(self.sizes, self.fractions, self.thickness, strict=True):
            count = size - 1 if sought else 0
            ratios.append(slice(at, at + count))
            at += count
            thickness.append(at if thick else None)
            at += thick
        spectra = (slice(at, at + self.modes[0]), slice(at + self.modes[0], at + sum(self.modes)))
        at += sum(self.modes)
        return Places(
            ratios=tuple(ratios),
            thickness=tuple(thickness),
            spectra=spectra,
            gloss=at if self.gloss else None,
            error=at + self.gloss,
        )

    @property
    def prior_rows(self) -> int:
        """Residuals of the prior."""
        shares = sum(
            size for size, sought in zip(self.sizes, self.fractions, strict=True) if sought
        )
        return shares + sum(self.thickness) + sum(self.modes) + self.gloss + 1


class Places(NamedTuple):
    """Where each unknown stands among the free ones."""

    ratios: tuple[slice, ...]
    thickness: tuple[int | None, ...]
    spectra: tuple[slice, slice]
    gloss: int | None
    error: int


def unknowns(layout: Layout, coats: Sequence[CoatPrior] | None) -> tuple[str, ...]:
    """Names of the free unknowns; a log-ratio is called by the paint whose share it moves.

    Args:
        layout: of the unknowns.
        coats: of the film; None for several films side by side, whose paints differ.
    """
    names: list[str] = []
    for n, size in enumerate(layout.sizes):
        names += [_share(n, i, coats) for i in range(size - 1 if layout.fractions[n] else 0)]
        names += [f"thickness of coat {n + 1}"] * layout.thickness[n]
    for what, count in zip(("k d", "s d"), layout.modes, strict=True):
        names += [f"mode {i + 1} of {what}" for i in range(count)]
    return (*names, *["gloss"] * layout.gloss, "model error")


def _share(coat: int, which: int, coats: Sequence[CoatPrior] | None) -> str:
    name = which + 1 if coats is None else coats[coat].paints[which].name
    return f"fraction {name} of coat {coat + 1}"


def quantities(
    layout: Layout,
    coats: Sequence[CoatPrior] | None,
    median: Float[np.ndarray, "coats"],
    grid: Float[np.ndarray, "bands"],
    means: Float[np.ndarray, "2"],
    modes: tuple[Float[np.ndarray, "bands modes"], Float[np.ndarray, "bands others"]],
) -> tuple[Quantity, ...]:
    """What is reported of a film.

    Args:
        layout, coats: as for `unknowns`.
        median: of the thicknesses beforehand, m.
        grid: wavelengths, nm.
        means, modes: of log k d and log s d of an unknown paint.
    """
    places = layout.places
    found: list[Quantity] = []
    for n, size in enumerate(layout.sizes):
        if layout.fractions[n]:
            shares = (
                functools.partial(fraction, at=places.ratios[n], which=i) for i in range(size)
            )
            found += [
                Quantity(_share(n, i, coats), False, values) for i, values in enumerate(shares)
            ]
        if (place := places.thickness[n]) is not None:
            found.append(
                Quantity(f"thickness of coat {n + 1}", True, _scale(place, float(median[n])))
            )
    for b, wavelength in enumerate(grid if layout.unknown_coat is not None else []):
        k, s = (
            _affine(m, mode[b], at)
            for m, mode, at in zip(means, modes, places.spectra, strict=True)
        )
        for what, values in (("absorption", k), ("scattering", s), ("ratio", _difference(k, s))):
            name = f"{what} at {wavelength:g} nm"
            found.append(
                Quantity(
                    name, True, _exponential(values), spectrum=what, wavelength=float(wavelength)
                )
            )
    if places.gloss is not None:
        gloss = places.gloss
        found.append(Quantity("gloss", False, lambda free: expit(free[..., gloss])))
    found.append(Quantity("model error", True, lambda free: np.exp(free[..., -1])))
    return tuple(found)


Values = Callable[[np.ndarray], np.ndarray]


def _scale(place: int, scale: float) -> Values:
    return lambda free: scale * np.exp(free[..., place])


def _affine(mean: float | np.floating, weights: np.ndarray, at: slice) -> Values:
    return lambda free: mean + free[..., at] @ weights


def _difference(first: Values, second: Values) -> Values:
    return lambda free: first(free) - second(free)


def _exponential(values: Values) -> Values:
    return lambda free: np.exp(values(free))


def prior_draws(
    rng: np.random.Generator,
    n: int,
    *,
    layout: Layout,
    spread: Float[np.ndarray, "coats"],
    prior: Prior,
) -> Float[np.ndarray, "n dims"]:
    """Draws of the free unknowns; `spread` is the standard deviation of each coat's log
    thickness.
    """
    columns = []
    for coat, size in enumerate(layout.sizes):
        if layout.fractions[coat]:
            columns.append(draw_ratios(rng, n, size, prior.concentration_known))
        if layout.thickness[coat]:
            columns.append(spread[coat] * rng.standard_normal((n, 1)))
    columns.append(rng.standard_normal((n, sum(layout.modes))))
    if layout.gloss:
        columns.append(rng.logistic(size=(n, 1)))
    columns.append(np.log(prior.error) + prior.error_spread * rng.standard_normal((n, 1)))
    return np.concatenate(columns, axis=1)


def prior_covariance(
    layout: Layout, spread: Float[np.ndarray, "coats"], prior: Prior
) -> Float[np.ndarray, "dims dims"]:
    """Of `prior_draws`."""
    places = layout.places
    covariance = np.eye(places.error + 1)
    for at, place, size, sd in zip(
        places.ratios, places.thickness, layout.sizes, spread, strict=True
    ):
        if at.stop > at.start:
            covariance[at, at] = ratios_covariance(size, prior.concentration_known)
        if place is not None:
            covariance[place, place] = sd**2
    if places.gloss is not None:
        covariance[places.gloss, places.gloss] = np.pi**2 / 3.0
    covariance[-1, -1] = prior.error_spread**2
    return covariance
