"""Measured films: paint over a black and over a white card, and the noise of the instrument that saw them."""

import difflib
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Array, Float

from glazejax.geometry import Instrument as Instrument
from glazejax.radiative.stack import stack_hemispherical_reflectance
from glazejax.spectra import validate_wavelengths

from .response import ground_below

Spectra = Float[np.ndarray, "films bands"]


@dataclass(frozen=True)
class Noise:
    """Repeatability of a reading: independent Gaussian errors of sd = floor + share * R.

    The default is a fair bench instrument: printed to 0.01 %, zero and stray light to 0.05 %, scale to 0.2 %;
    repeats of paint-outs published by the Kimera project differ by 0.0018 on average.

    Raises:
        ValueError: a negative or not finite value, or both zero.
    """

    floor: float = 0.0005
    share: float = 0.002

    def __post_init__(self) -> None:
        for name, value in (("floor", self.floor), ("share", self.share)):
            if not (np.isfinite(value) and value >= 0):
                raise ValueError(f"the noise's {name} is {value:g}; it must be 0 or more, such as 0.0005")
        if self.floor == 0:
            raise ValueError("a noise floor of 0 makes readings near 0 exact; give a value such as 0.0005")

    def sd(self, reflectance: Float[np.ndarray, "*shape"]) -> Float[np.ndarray, "*shape"]:
        """Standard deviation of readings of this reflectance (fractions)."""
        return self.floor + self.share * np.abs(reflectance)


@dataclass(frozen=True)
class Films:
    """Films that share a wavelength grid.

    Attributes:
        names: what each paint is called, all different.
        wavelengths: (bands,), nm.
        bare_black, bare_white: (films, bands), reflectance of the cards without paint.
        over_black, over_white: (films, bands), reflectance of the paint on them.
        notes: sentences on what a reader changed or noticed.

    Raises:
        ValueError: shapes that do not match, a value that is NaN, infinite or negative, a white card that is not
            brighter than the black one, or names that repeat.
    """

    names: tuple[str, ...]
    wavelengths: Float[np.ndarray, "bands"]
    bare_black: Spectra
    bare_white: Spectra
    over_black: Spectra
    over_white: Spectra
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        grid = validate_wavelengths(self.wavelengths)
        object.__setattr__(self, "wavelengths", grid)
        if len(set(self.names)) < len(self.names):
            twice = next(name for name in self.names if self.names.count(name) > 1)
            raise ValueError(f"two films are called {twice!r}; names must differ")
        for what in ("bare_black", "bare_white", "over_black", "over_white"):
            values = np.asarray(getattr(self, what), dtype=np.float64)
            object.__setattr__(self, what, values)
            if values.shape != (len(self.names), grid.size):
                raise ValueError(
                    f"{what} has shape {values.shape} but there are {len(self.names)} films and {grid.size} bands"
                )
            wrong = ~np.isfinite(values) | (values < 0)
            if wrong.any():
                i, j = (int(n) for n in np.argwhere(wrong)[0])
                raise ValueError(
                    f"{what} of {self.names[i]!r} at {grid[j]:g} nm is {values[i, j]:g}; reflectance is 0 or more"
                )
        dim = self.bare_white.mean(axis=1) <= self.bare_black.mean(axis=1)
        if dim.any():
            name = self.names[int(dim.argmax())]
            raise ValueError(
                f"the bare white card of {name!r} is not brighter than its bare black card: are the rows swapped?"
            )

    def __len__(self) -> int:
        return len(self.names)

    def take(self, rows: Sequence[int] | slice) -> "Films":
        """Some of the films, by number."""
        index = np.arange(len(self))[rows]
        pick = {what: getattr(self, what)[index] for what in ("bare_black", "bare_white", "over_black", "over_white")}
        return replace(self, names=tuple(self.names[i] for i in index), **pick)

    def select(self, wanted: Sequence[str]) -> "Films":
        """Films of these names, in this order.

        Raises:
            ValueError: there is no film of that name; the message lists the nearest ones.
        """
        for name in wanted:
            if name not in self.names:
                raise ValueError(f"unknown sample {name!r}; {nearest(name, self.names)}")
        return self.take([self.names.index(name) for name in wanted])


def nearest(name: str, known: Sequence[str]) -> str:
    """'nearest: ...' for an error about a name that is not known, or the known names if none is near."""
    folded = {k.lower(): k for k in known}
    close = [folded[k] for k in difflib.get_close_matches(name.lower(), list(folded), n=4, cutoff=0.5)]
    if close:
        return "nearest: " + ", ".join(map(repr, close))
    more = f" and {len(known) - 8} more" if len(known) > 8 else ""
    return "known: " + ", ".join(map(repr, known[:8])) + more


def diffuse_internal_reflectance(instrument: Instrument) -> float:
    """Reflectance of the surface for diffuse light from inside, r_i, as the solver's own directions see it.

    A bare ground rho reflects (1 - R_s) rho (1 - r_i)/(1 - rho r_i); one evaluation of the solver with an empty
    layer gives r_i, so that a fit and its cards use the same number (0.5963 at n = 1.5).

    Raises:
        ValueError: the instrument is no integrating sphere.
    """
    instrument.require_sphere()
    ground = 0.5
    body = _bare(ground, instrument) / (1.0 - instrument.surface)
    return float((ground - body) / (ground * (1.0 - body)))


def _bare(ground: float, instrument: Instrument) -> float:
    value: Array = stack_hemispherical_reflectance(
        np.zeros(1),
        np.zeros(1),
        ground,
        refractive_index=instrument.refractive_index,
        cos_incidence=instrument.cos_incidence,
    )
    return float(value)


def card_reflectance(
    bare: Spectra, instrument: Instrument
) -> tuple[Float[np.ndarray, "films bands"], Float[np.ndarray, "films bands"]]:
    """Internal reflectance of cards from their bare reflectance in air, and its derivative.

    Under paint only the internal reflectance counts: a card that reads 5 % in air is 2.5 % inside, one that reads
    84 % is 93 %.

    Returns:
        rho, (films, bands), and d rho / d bare, (films, bands). Values outside [0, 1] are possible and the
        caller's to refuse.
    """
    r = diffuse_internal_reflectance(instrument)
    share = 1.0 - instrument.surface
    x = (np.asarray(bare) - instrument.seen_surface) / share
    return ground_below(x, 1.0 - r, r), (1.0 - r) / (1.0 - r + x * r) ** 2 / share


def cards(films: Films, instrument: Instrument, noise: Noise) -> tuple[Spectra, Spectra, Spectra, Spectra]:
    """Internal reflectance of both cards and its standard deviation: (black, white, sd black, sd white).

    Raises:
        ValueError: a card is darker than its surface alone, or brighter than a perfect diffuser, by more than four
            standard deviations.
    """
    out, errors = [], []
    for what, bare in (("black", films.bare_black), ("white", films.bare_white)):
        inside, slope = card_reflectance(bare, instrument)
        sd = slope * noise.sd(bare)
        for wrong, complaint in (
            (inside < -4 * sd, "darker than its surface alone ({surface:.4f}); was the specular part excluded?"),
            (inside > 1 + 4 * sd, "brighter than a perfect diffuser; is it fluorescent, or the scale wrong?"),
        ):
            if wrong.any():
                i, j = (int(n) for n in np.argwhere(wrong)[0])
                raise ValueError(
                    f"the bare {what} card of {films.names[i]!r} reads {bare[i, j]:.4f} at "
                    f"{films.wavelengths[j]:g} nm, {complaint.format(surface=instrument.seen_surface)}"
                )
        out.append(np.clip(inside, 0.0, 1.0))
        errors.append(sd)
    return out[0], out[1], errors[0], errors[1]
