"""What paper B's figures share: grid, lights, bodies, metals, and colours of spectra.

Everything is spectral, 400-700 nm step 5 as in the paper. Its measured spectra are figures only:
colour-science's ColorChecker patches, illuminant A (its slide projector) and D55 (its sunlight)
stand for them.
"""

import numpy as np
from scipy.interpolate import PchipInterpolator

from glazejax import colour
from glazejax.appearance.metals import metal
from glazejax.radiative.common.fresnel import (
    cook_torrance_reflectance,
    hall_extinction,
    hall_reflectance,
)

GRID = np.arange(400.0, 701.0, 5.0)
FORMS = ("exact Fresnel", "Cook-Torrance", "Hall")
KNOWN = "Hall, n and k known"
COPPER = "copper-hagemann"
"""Of Palik's handbook, which the paper used."""
COPPER_MEASURED = np.array(
    [
        (398, 0.261),
        (415, 0.290),
        (430, 0.317),
        (444, 0.334),
        (457, 0.348),
        (470, 0.383),
        (483, 0.396),
        (497, 0.410),
        (511, 0.448),
        (525, 0.455),
        (540, 0.463),
        (554, 0.494),
        (569, 0.580),
        (584, 0.701),
        (599, 0.757),
        (614, 0.790),
        (630, 0.784),
        (647, 0.832),
        (665, 0.840),
        (682, 0.861),
        (701, 0.869),
    ]
)
"""Copper in an integrating sphere: nm, reflectance. E. W. Spisz, A. J. Weigand, R. L. Bowman, J. R.
Jack, Solar absorptances and spectral reflectances of 12 metals, NASA TN D-5353 (1969), table II
(a)."""


def lamp(name: str) -> np.ndarray:
    """Spectrum of a CIE illuminant on the grid, Y = 1 for a white that faces it."""
    science = colour.colour_science()
    light = science.SDS_ILLUMINANTS[name].copy().align(science.SpectralShape(400, 700, 5)).values
    return light / (light @ weights()[:, 1])


def weights() -> np.ndarray:
    """Colour matching functions as weights of a spectrum of light, paper B, eq (25)."""
    return colour.colour_weights(GRID, "E")


def xyz(spectra) -> np.ndarray:
    return np.asarray(spectra) @ weights()


def chromaticity_of(values: np.ndarray) -> np.ndarray:
    """x and y, (..., 2), of XYZ, (..., 3)."""
    return values[..., :2] / values.sum(axis=-1, keepdims=True)


def chromaticity(spectra) -> np.ndarray:
    return chromaticity_of(xyz(spectra))


def chart() -> dict[str, np.ndarray]:
    """Reflectances of all ColorChecker patches on the grid."""
    science = colour.colour_science()
    patches = science.SDS_COLOURCHECKERS["BabelColor Average"]
    return {
        name: s.copy().align(science.SpectralShape(400, 700, 5)).values
        for name, s in patches.items()
    }


def patches(*names: str) -> list[np.ndarray]:
    """Reflectances of some ColorChecker patches."""
    known = chart()
    return [known[name] for name in names]


def reflectances(name: str, cosine: np.ndarray) -> dict[str, np.ndarray]:
    """Reflectance of a metal, (..., bands), by each form; Hall's also with the mean n and k instead
    of n = 1.
    """
    bare = metal(name, GRID)
    normal, c = np.asarray(bare.reflectance(1.0)), cosine[..., None]
    found = {
        FORMS[0]: bare.reflectance(cosine),
        FORMS[1]: cook_torrance_reflectance(c, normal),
        FORMS[2]: hall_reflectance(c, normal, hall_extinction(normal.mean())),
        KNOWN: hall_reflectance(c, normal, bare.extinction.mean(), bare.refractive_index.mean()),
    }
    return {form: np.asarray(values) for form, values in found.items()}


def measured_copper(cosine: np.ndarray) -> np.ndarray:
    """Reflectance of copper, (..., bands), by Hall from what was measured of it near normal
    incidence.
    """
    normal = PchipInterpolator(*COPPER_MEASURED.T)(GRID)
    return np.asarray(hall_reflectance(cosine[..., None], normal, hall_extinction(normal.mean())))
