"""Differentiable colour of stacked paint glazes: from pigments' absorption and scattering to
reflectance.

Describe paint with `Pigment`, `Mixture`, `Layer` and `Glaze`, an instrument with `Bidirectional` or
`Hemispherical`, and ask for `reflectance`; `colour` turns spectra into XYZ, Lab and sRGB. The
solvers behind it work on plain arrays: `stack_reflectance_factor` and
`stack_hemispherical_reflectance`. `fit` is the package `glazefit`, which goes the other way, from
measurements to paint.
"""

from importlib import import_module
from importlib.metadata import version
from typing import Any

import lazy_loader

_load, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


def __getattr__(name: str) -> Any:
    """A public name when it is first asked for; the version as it was installed."""
    if name == "__version__":
        return version("glazejax")
    if name == "fit":
        return _fit()
    return _load(name)


def _fit() -> Any:
    """The inverse package, found by its name: nothing forward imports it before a user asks."""
    try:
        return import_module("glazefit")
    except ModuleNotFoundError as error:
        if error.name != "glazefit":
            raise
        raise AttributeError(
            "glazejax.fit is the package glazefit, which is not installed"
        ) from None
