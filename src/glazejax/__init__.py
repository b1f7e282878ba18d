"""Differentiable colour of stacked paint glazes: from pigments' absorption and scattering to reflectance.

Describe paint with `Pigment`, `Mixture`, `Layer` and `Glaze`, an instrument with `Bidirectional` or
`Hemispherical`, and ask for `reflectance`; `colour` turns spectra into XYZ, Lab and sRGB. The solvers behind
it work on plain arrays: `stack_reflectance_factor` and `stack_hemispherical_reflectance`.
"""

import importlib
from typing import TYPE_CHECKING, Any

from .geometry import Bidirectional, Hemispherical
from .media import Glaze, Layer, Mixture, Pigment

# The functions picture and reflectance come after their submodules of the same name are loaded, so that they stay.
from .picture import picture
from .radiative.profile import profile_hemispherical_reflectance, profile_reflectance_factor
from .radiative.stack import (
    split_hemispherical_reflectance,
    split_reflectance_factor,
    stack_hemispherical_reflectance,
    stack_reflectance_factor,
)
from .reflectance import reflectance

if TYPE_CHECKING:
    from . import catalogue, colour, io, spectra

__version__ = "0.1.0"

__all__ = [
    "Bidirectional",
    "Glaze",
    "Hemispherical",
    "Layer",
    "Mixture",
    "Pigment",
    "catalogue",
    "colour",
    "io",
    "picture",
    "profile_hemispherical_reflectance",
    "profile_reflectance_factor",
    "reflectance",
    "spectra",
    "split_hemispherical_reflectance",
    "split_reflectance_factor",
    "stack_hemispherical_reflectance",
    "stack_reflectance_factor",
]

_SUBMODULES = {"appearance", "catalogue", "colour", "io", "plots", "spectra"}


def __getattr__(name: str) -> Any:
    """Load a submodule when it is first asked for."""
    if name in _SUBMODULES:
        return importlib.import_module(f"{__name__}.{name}")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *_SUBMODULES})
