"""A small image of known paints, for tests of the engine: few paints, so that little is
searched.
"""

import functools
from collections.abc import Sequence
from unittest import mock

import numpy as np
import xarray
from benchmarks.rivals import known_painting
from benchmarks.rivals.known_painting import NOISE, Painting, painting, spectra
from benchmarks.rivals.known_painting_scene import REGIONS

from glazefit import Noise
from glazefit.mapping.solve.image import Image, working_bands
from glazejax import Pigment, catalogue

PAINTS = (
    "ZincWhite",
    "LeadWhite",
    "UltramarineBlue",
    "EmeraldGreen",
    "ChromeYellow",
    "BoneBlack",
    "CobaltBlue",
)
FEW = ("ZincWhite", "ChromeYellow", "BoneBlack", "CobaltBlue")
"""Of them, for maps of which no more is asked than that they are whole."""


def paints():
    """A few paints of the catalogue."""
    known = catalogue.load()
    return [known[name] for name in PAINTS]


class Solved(Painting):
    """Each pixel by the solver: tables of all regions pay for larger paintings only."""

    def rows(self, y0, y1, *, noise=True):
        # To a thirtieth of the noise, which is enough.
        with mock.patch.multiple(known_painting, _table=_solved, _SOLVER=NOISE / 30):
            return super().rows(y0, y1, noise=noise)


def _solved(number, wavelengths, ground):
    known = {name: paint.resample(wavelengths) for name, paint in catalogue.load().items()}

    def table(values):
        size = next(iter(values.values())).size
        padded = {
            name: np.resize(column, -(-size // 128) * 128) for name, column in values.items()
        }  # of few shapes
        return spectra(REGIONS[number], known, np.asarray(ground), padded)[:size]

    return table


@functools.cache
def scene() -> Painting:
    """A painting with other paints in it too."""
    return Solved(**vars(painting((24, 40), 61, seed=5)))


def image(spectra: np.ndarray, wavelengths: np.ndarray) -> xarray.DataArray:
    """An image as `open_cube` gives them."""
    return xarray.DataArray(
        spectra, dims=("y", "x", "wavelength"), coords={"wavelength": wavelengths}
    )


def at_bands(
    wavelengths: np.ndarray, paints: Sequence[Pigment], noise: Noise | None = None, **attrs: float
) -> Image:
    """An image of nothing, for what is done at its working bands."""
    nothing = image(np.zeros((1, 1, wavelengths.size)), wavelengths).assign_attrs(attrs)
    return Image(nothing, working_bands(wavelengths, paints), noise, None)
