"""Differentiable colour of stacked paint glazes: from pigments' absorption and scattering to
reflectance.

Describe paint with `Pigment`, `Mixture`, `Layer` and `Glaze`, an instrument with `Bidirectional` or
`Hemispherical`, and ask for `reflectance`; `colour` turns spectra into XYZ, Lab and sRGB. The
solvers behind it work on plain arrays: `stack_reflectance_factor` and
`stack_hemispherical_reflectance`.
"""

from importlib.metadata import version
from typing import Any

import lazy_loader

_load, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


def __getattr__(name: str) -> Any:
    """A public name when it is first asked for; the version as it was installed."""
    if name == "__version__":
        return version("glazejax")
    return _load(name)
