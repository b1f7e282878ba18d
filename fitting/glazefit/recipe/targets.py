"""Targets that a recipe is to match: a colour under one or several illuminants, or a spectrum.

The patches of a measured ColorChecker chart are at hand as targets: `colourchecker_targets`.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from jaxtyping import Float, Int
from numpy.typing import ArrayLike

from glazejax import cie

Bands: TypeAlias = Float[np.ndarray, "bands"]
"""A number a band."""
Ground: TypeAlias = float | Bands
"""Internal reflectance of what lies below the paint."""
Lab: TypeAlias = Float[np.ndarray, "3"]
Colour: TypeAlias = Sequence[float] | Lab
"""L*, a*, b*."""
Indices: TypeAlias = Int[np.ndarray, "n"]
"""Numbers of rows, or a number of a row each."""


@dataclass(frozen=True)
class Target:
    """A colour or a spectrum to match. Make one with `lab_target`, `srgb_target` or
    `spectral_target`.

    Attributes:
        name: what to call it.
        labs: L*a*b* by full name of the illuminant, if it is given as a colour; empty if as a
            spectrum.
        wavelengths: (bands,), nm, or None.
        reflectance: (bands,), fraction, or None.
    """

    name: str
    labs: Mapping[str, Lab] = field(default_factory=dict)
    wavelengths: Bands | None = None
    reflectance: Bands | None = None

    @property
    def spectral(self) -> bool:
        """True if a spectrum is known, and with it the colour under every illuminant."""
        return self.reflectance is not None

    def lab(self, illuminant: str, observer: str) -> Lab:
        """L*a*b* under an illuminant, (3,); a given colour is taken to be for the observer asked
        for.

        Raises:
            ValueError: the target is a colour under other illuminants.
        """
        full = cie.find_illuminant(illuminant)
        if self.wavelengths is not None and self.reflectance is not None:
            from glazejax import colour

            return np.asarray(
                colour.lab(self.wavelengths, self.reflectance, illuminant=full, observer=observer)
            )
        if full not in self.labs:
            illuminants = ", ".join(self.labs)
            raise ValueError(
                f"the colour of {self.name!r} is given under {illuminants}, not under {full}: ask "
                f"for {illuminants}, give the colour under {full} too, or give a spectrum"
            )
        return self.labs[full]

    def on(self, wavelengths: Float[np.ndarray, "m"]) -> Float[np.ndarray, "m"]:
        """Reflectance at other wavelengths (nm); 0 of a colour."""
        if self.wavelengths is None or self.reflectance is None:
            return np.zeros(wavelengths.size)
        from glazejax.spectra import resample

        return np.asarray(resample(self.wavelengths, self.reflectance, wavelengths))

    def __repr__(self) -> str:
        if self.wavelengths is not None:
            from glazejax.spectra import describe_grid

            return f"Target({self.name!r}, {describe_grid(self.wavelengths)})"
        return f"Target({self.name!r}, Lab under {', '.join(self.labs)})"


class TargetArrays(NamedTuple):
    """Targets of a search as arrays."""

    lab: Float[Any, "targets lights 3"]
    metric: Float[Any, "targets lights 3 3"]
    """metric @ (Lab - lab) is as long as a small colour difference."""
    spectrum: Float[Any, "targets bands"]
    spectral: Float[Any, "targets"]
    """Weight of the squared difference in reflectance, summed over the bands; 0 of a colour."""


TargetLike = Target | Mapping[str, Colour] | Colour
"""A target, a colour under D65, or colours by illuminant."""


def lab_target(lab: Mapping[str, Colour] | Colour, name: str | None = None) -> Target:
    """A colour to match.

    Args:
        lab: (3,), CIE 1976 L*a*b* under D65, or a mapping from illuminants to such colours.
        name: what to call it; made of the numbers if left out.

    Raises:
        ValueError: not three finite numbers, L* outside [0, 100], or an unknown illuminant.
    """
    colours = lab if isinstance(lab, Mapping) else {"D65": lab}
    if not colours:
        raise ValueError(
            "a target needs a colour under at least one illuminant, such as {'D65': (50, 20, 30)}"
        )
    labs = {
        cie.find_illuminant(illuminant): _check(values) for illuminant, values in colours.items()
    }
    first = next(iter(labs.values()))
    title = name or f"Lab {', '.join(f'{value:g}' for value in first)}"
    return Target(title, MappingProxyType(labs))


def as_targets(target: Any) -> tuple[tuple[Target, ...], bool]:
    """Targets of one or of a batch, and whether it is a batch; a target may be a `Target`, three
    numbers, or a mapping of such.
    """
    # An iterator gives each of its targets once.
    target = list(target) if isinstance(target, Iterator) else target
    single = isinstance(target, Target | Mapping)
    if not single:
        try:
            first = next(iter(target), ())
        except TypeError:
            raise ValueError(
                f"a target is a colour of three numbers, or made by spectral_target, not {target!r}"
            ) from None
        single = np.ndim(first) == 0 and not isinstance(first, Target | Mapping)
    members = [target] if single else target
    return tuple(m if isinstance(m, Target) else lab_target(m) for m in members), not single


def _check(values: Any) -> Lab:
    try:
        lab = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        lab = np.empty(0)
    if lab.shape != (3,) or not np.all(np.isfinite(lab)):
        raise ValueError(f"a colour is three numbers L*, a*, b*, such as 50,20,30, not {values!r}")
    if not 0 <= lab[0] <= 100:
        raise ValueError(f"L* is {lab[0]:g}; it lies between 0 (black) and 100 (white)")
    if np.abs(lab[1:]).max() > 200:
        raise ValueError(
            f"a*, b* are {lab[1]:g}, {lab[2]:g}; no colour of a surface exceeds 150 or so"
        )
    return lab


def srgb_target(code: str, name: str | None = None) -> Target:
    """A colour of a screen, such as ``#8a4b2d`` or ``138,75,45``, as L*a*b* under D65.

    Args:
        code: three or six hexadecimal digits, with or without ``#``; for numbers see
            `glazejax.colour.srgb_to_lab`.
        name: what to call it; the code if left out.

    Raises:
        ValueError: neither three or six hexadecimal digits nor three whole numbers from 0 to 255.
    """
    from glazejax import colour

    encoded, digits = parse_srgb(code)
    lab = np.asarray(colour.srgb_to_lab(encoded))
    return Target(name or f"#{digits}", MappingProxyType({cie.find_illuminant("D65"): lab}))


def parse_srgb(code: str) -> tuple[Lab, str]:
    """Encoded sRGB, 0 to 1, of the code of a colour, and its six digits; see `srgb_target`."""
    digits = code.strip().removeprefix("#")
    if "," in digits:
        channels = [channel.strip() for channel in digits.split(",")]
        if len(channels) != 3 or not all(
            re.fullmatch(r"\d{1,3}", channel) and int(channel) <= 255 for channel in channels
        ):
            raise ValueError(
                f"{code!r} is not an sRGB colour: write red, green and blue from 0 to 255, such as "
                "138,75,45, or '#8a4b2d'"
            )
        digits = "".join(f"{int(channel):02x}" for channel in channels)
    if not re.fullmatch(r"[0-9a-fA-F]{3}|[0-9a-fA-F]{6}", digits):
        raise ValueError(
            f"{code!r} is not an sRGB colour: write six hexadecimal digits, such as '#8a4b2d', or "
            "138,75,45"
        )
    if len(digits) == 3:
        digits = "".join(2 * digit for digit in digits)
    return np.array(list(bytes.fromhex(digits))) / 255.0, digits.lower()


def spectral_target(wavelengths: ArrayLike, reflectance: ArrayLike, *, name: str) -> Target:
    """A spectrum to match, (bands,), as a fraction or in percent, on any wavelengths in nm.

    Raises:
        ValueError: an illegal grid, or values that are no reflectance.
    """
    from glazejax.spectra import as_fraction, validate_wavelengths

    grid = validate_wavelengths(np.asarray(wavelengths))
    values = as_fraction(np.asarray(reflectance), name)
    if values.shape != grid.shape:
        raise ValueError(
            f"{name!r} has {values.size} values for {grid.size} wavelengths; give one a wavelength"
        )
    return Target(name, wavelengths=grid, reflectance=values)


def colourchecker_targets(patches: Sequence[str] = ()) -> list[Target]:
    """Measured patches of the ColorChecker chart: the mean of 30 charts of 24 patches, measured at
    45:0, 380-730 nm, as colour-science ships it ("BabelColor Average").

    Args:
        patches: names, such as "blue sky"; the beginning will do if it fits one only. All 24 if
            left out.

    Raises:
        ValueError: an unknown patch; the message lists what there is.
    """
    spectra = cie.charts()["BabelColor Average"]
    chosen = [_patch(patch, list(spectra)) for patch in patches] or list(spectra)
    return [
        spectral_target(spectra[name].wavelengths, spectra[name].values, name=_short(name))
        for name in dict.fromkeys(chosen)
    ]


def _short(patch: str) -> str:
    """Name of a patch without its density, such as ``black 2`` for ``black 2 (1.5 D)``."""
    return re.sub(r"\s*\(.*\)$", "", patch)


def _patch(asked: str, names: Sequence[str]) -> str:
    key = re.sub(r"[\s_-]+", " ", asked.strip()).lower()
    short = {_short(name).lower(): name for name in names}
    if key in short:
        return short[key]
    matches = [name for plain, name in short.items() if key and plain.startswith(key)]
    if len(matches) == 1:
        return matches[0]
    raise ValueError(
        f"unknown patch {asked!r}: the chart has {', '.join(_short(name) for name in names)}"
    )
