"""Small scenes and a glaze that the tests share."""

import numpy as np

import glazejax as gj
from glazejax.appearance.scene.scene import Scene
from glazejax.appearance.scene.shapes import Plane
from glazejax.spectra import Numbers

from ..glazes import coated

GRID = np.arange(400.0, 701.0, 30.0)


def paint(name):
    """A paint of the catalogue on `GRID`."""
    return gj.catalogue.load()[name].resample(GRID)


def blue_glaze(thickness: Numbers = 3e-6):
    """Ultramarine blue over zinc white, on a bright ground."""
    return coated(0.8, bands=GRID, UltramarineBlue=thickness, ZincWhite=20e-6)


def rising(first, last):
    """A spectrum that rises evenly."""
    return np.linspace(first, last, GRID.size)


def half_range(count):
    """Cosines from 0 to 1, and weights of twice the integral over them."""
    nodes, weights = np.polynomial.legendre.leggauss(count)
    return 0.5 * (nodes + 1), weights


def unit(vectors):
    """Directions of vectors along the last axis."""
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def flat(material, light, camera, **options):
    """A plane, seen in one pixel unless the options say otherwise."""
    size = {"width": 1, "height": 1}
    return scene([Plane("m")], {"m": material}, [light], camera, **(size | options))


def scene(shapes, materials, lights, camera, **options):
    """A scene on `GRID`, 32 x 24 pixels unless the options say otherwise."""
    return Scene(GRID, shapes, materials, lights, camera, **({"width": 32, "height": 24} | options))
