"""What the tests of Mitsuba's plugin share: variants, glazes, and the reflectance factor that the
plugin gives.
"""

import functools
import json

import numpy as np
import pytest

import glazejax as gj
from glazejax.appearance.mitsuba.variants import works

WAVELENGTHS = np.arange(400.0, 701.0, 10.0)
BLUE = "UltramarineBlue:3um, ZincWhite:20um"
WHITE = json.dumps(
    {
        "glazejax": "stack",
        "version": 1,
        "coats": [{"paint": {"W": 1}, "um": 10}],
        "ground": 1.0,
        "pigments": {
            "W": {
                "wavelengths": [400, 500, 600, 700],
                "absorption": [0] * 4,
                "scattering": [1e5, 2e5, 3e4, 1e6],
            }
        },
    }
)
"""A coat that absorbs nothing on a white ground."""


def mixed_over_white(bands):
    """Blue and red in equal parts on white, of few bands: the table's work grows with them."""
    blue, red, white = (
        gj.catalogue.load()[name].resample(bands)
        for name in ("UltramarineBlue", "Eosin", "ZincWhite")
    )
    mixture = gj.Mixture([blue, red], [0.5, 0.5])
    return mixture, gj.Glaze([gj.Layer(mixture, 2e-6), gj.Layer(white, 10e-6)], 0.8)


@functools.cache
def llvm() -> bool:
    """Whether LLVM works here, asked of a process of its own: an LLVM that does not fit ends the
    process.
    """
    return works("llvm_ad_spectral")


def mitsuba_in(variant: str):
    """Mitsuba with a variant set, and the glaze known to it."""
    mi = pytest.importorskip("mitsuba")
    if variant.startswith("llvm") and not llvm():
        pytest.skip("Dr.Jit finds no LLVM that works here")
    mi.set_variant(variant)
    from glazejax.appearance.mitsuba import register

    register()
    return mi


def interaction(cosine: float, wavelengths=(450.0, 500.0, 550.0, 600.0), uv=(0.5, 0.5)):
    """A point seen from a direction, at four wavelengths."""
    import drjit as dr
    import mitsuba as mi

    si = dr.zeros(mi.SurfaceInteraction3f)
    si.wi = direction(cosine)
    si.uv = mi.Point2f(*map(float, uv))
    si.wavelengths = mi.UnpolarizedSpectrum([float(w) for w in wavelengths])
    return si


def direction(cosine: float, azimuth: float = 0.0):
    """A unit vector."""
    import mitsuba as mi

    sine = np.sqrt(1 - cosine**2)
    return mi.Vector3f(float(sine * np.cos(azimuth)), float(sine * np.sin(azimuth)), float(cosine))


def factor(
    bsdf, cos_in: float, cos_out: float, wavelengths=WAVELENGTHS, uv=(0.5, 0.5), azimuth=1.0
):
    """pi times the BSDF at the wavelengths."""
    import mitsuba as mi

    found = []
    for some in np.array_split(wavelengths, -(-len(wavelengths) // 4)):
        padded = np.resize(some, 4)
        si = interaction(cos_in, padded, uv)
        value = np.array(bsdf.eval(mi.BSDFContext(), si, direction(cos_out, azimuth))).ravel()
        found.append(np.pi * value[: some.size] / cos_out)
    return np.concatenate(found)
