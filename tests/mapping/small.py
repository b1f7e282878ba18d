"""A small image of known paints, for tests of the engine: few paints, so that little is searched."""

import functools

import numpy as np
import xarray

from glazefit.mapping.example import Painting, painting
from glazejax import catalogue

PAINTS = ("ZincWhite", "LeadWhite", "UltramarineBlue", "EmeraldGreen", "ChromeYellow", "BoneBlack", "CobaltBlue")


def paints():
    """A few paints of the catalogue."""
    known = catalogue.load()
    return [known[name] for name in PAINTS]


@functools.lru_cache(maxsize=2)
def scene(seed: int = 5) -> Painting:
    """A painting with other paints in it too."""
    return painting((24, 40), 61, seed=seed)


def image(spectra: np.ndarray, wavelengths: np.ndarray) -> xarray.DataArray:
    """An image as `open_cube` gives them."""
    return xarray.DataArray(spectra, dims=("y", "x", "wavelength"), coords={"wavelength": wavelengths})
