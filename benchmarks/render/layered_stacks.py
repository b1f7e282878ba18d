"""The 24 stacks of `python -m benchmarks.render.layered_truth`, and the angles at which they are seen:
data, nothing else.

A layer is scattering s d, absorption k d in three bands (as of three wavelengths: one grey
scatterer, one coloured absorber), and the mean cosine g of Henyey and Greenstein's phase function.
`coats` layers are what a renderer's rule takes as its coat; all below is its base. 0 coats: the
rule sees a clear surface of the paint itself.
"""

from typing import NamedTuple

import numpy as np


class Layer(NamedTuple):
    """One layer."""

    scattering: float  # s d
    absorption: tuple[float, float, float]  # k d in each band
    g: float = 0.0


class LayeredStack(NamedTuple):
    """Layers top first on a Lambertian ground."""

    name: str
    refractive_index: float | tuple[float, ...]  # one, or one for each layer
    roughness: float  # alpha of GGX
    layers: tuple[Layer, ...]
    ground: float
    coats: int

    @property
    def indices(self) -> tuple[float, ...]:
        """Of each layer."""
        n = self.refractive_index
        return n if isinstance(n, tuple) else (n,) * len(self.layers)

    @property
    def isotropic(self) -> bool:
        """Whether no layer prefers a direction."""
        return all(layer.g == 0.0 for layer in self.layers)

    @property
    def uniform(self) -> bool:
        """Whether all layers share one refractive index."""
        return len(set(self.indices)) == 1

    @property
    def albedo(self) -> np.ndarray:
        """Single-scattering albedo, (bands, layers)."""
        s, k = self.scattering, self.absorption.T
        return s / np.maximum(s + k, 1e-300)

    @property
    def thickness(self) -> np.ndarray:
        """Optical thickness, (bands, layers)."""
        return self.scattering + self.absorption.T

    @property
    def scattering(self) -> np.ndarray:
        """(layers,)."""
        return np.array([layer.scattering for layer in self.layers])

    @property
    def absorption(self) -> np.ndarray:
        """(layers, bands)."""
        return np.array([layer.absorption for layer in self.layers])

    @property
    def g(self) -> np.ndarray:
        """(layers,)."""
        return np.array([layer.g for layer in self.layers])


BANDS = 3
INCIDENCES = (10.0, 45.0, 75.0)
"""Degrees in air."""
VIEWS = (
    *((angle, 0.0) for angle in (20.0, 45.0, 70.0)),
    *((angle, 180.0) for angle in (45.0, 70.0)),
    *((angle, 90.0) for angle in (20.0, 45.0, 70.0)),
    (60.0, 45.0),
)
"""Degrees from the normal, and of azimuth: 0 the mirror side, 180 back towards the light, others
out of the plane.
"""
IN_PLANE = np.array([azimuth in (0.0, 180.0) for _, azimuth in VIEWS])

CLEAR = Layer(0.0, (0.0, 0.0, 0.0))
TINT = Layer(0.0, (0.02, 0.1, 0.4))
DEEP_TINT = Layer(0.0, (0.1, 0.5, 2.0))
WHITE = Layer(8.0, (0.004, 0.04, 0.4))
DARK = Layer(2.5, (0.25, 1.2, 6.0))
RED_GLAZE = Layer(0.3, (0.02, 0.2, 1.0))
BLUE_GLAZE = Layer(0.5, (0.6, 0.06, 0.02))
RED_PAINT = Layer(3.0, (0.05, 0.6, 3.0))
BLUE_PAINT = Layer(5.0, (4.0, 0.5, 0.1))
HAZE = Layer(0.25, (0.01, 0.02, 0.05))

STACKS = (
    LayeredStack("clear varnish on white, smooth", 1.5, 0.0, (CLEAR, WHITE), 0.8, 1),
    LayeredStack("clear varnish on white, .1", 1.5, 0.1, (CLEAR, WHITE), 0.8, 1),
    LayeredStack("clear varnish on white, .3", 1.5, 0.3, (CLEAR, WHITE), 0.8, 1),
    LayeredStack("clear varnish on white, .5", 1.5, 0.5, (CLEAR, WHITE), 0.8, 1),
    LayeredStack("clear varnish on dark, smooth", 1.5, 0.0, (CLEAR, DARK), 0.3, 1),
    LayeredStack("clear varnish on dark, .25", 1.5, 0.25, (CLEAR, DARK), 0.3, 1),
    LayeredStack("clear n 1.3 on white, smooth", 1.3, 0.0, (CLEAR, WHITE), 0.8, 1),
    LayeredStack("clear n 1.7 on white, smooth", 1.7, 0.0, (CLEAR, WHITE), 0.8, 1),
    LayeredStack("clear n 1.3 on dark, .4", 1.3, 0.4, (CLEAR, DARK), 0.3, 1),
    LayeredStack("clear n 1.7 on white, .4", 1.7, 0.4, (CLEAR, WHITE), 0.8, 1),
    LayeredStack("tinted varnish on white, smooth", 1.5, 0.0, (TINT, WHITE), 0.8, 1),
    LayeredStack("deep tint on white, smooth", 1.5, 0.0, (DEEP_TINT, WHITE), 0.8, 1),
    LayeredStack("deep tint on white, .2", 1.5, 0.2, (DEEP_TINT, WHITE), 0.8, 1),
    LayeredStack("tint n 1.7 on white, .5", 1.7, 0.5, (TINT, WHITE), 0.8, 1),
    LayeredStack("tint on a bare ground, .1", 1.5, 0.1, (DEEP_TINT,), 0.8, 1),
    LayeredStack("two thin glazes, smooth", 1.5, 0.0, (RED_GLAZE, BLUE_GLAZE), 0.9, 1),
    LayeredStack("two thin glazes, .3", 1.5, 0.3, (RED_GLAZE, BLUE_GLAZE), 0.9, 1),
    LayeredStack("two thick paints, smooth", 1.5, 0.0, (RED_PAINT, BLUE_PAINT), 0.5, 0),
    LayeredStack("two thick paints n 1.7, .15", 1.7, 0.15, (RED_PAINT, BLUE_PAINT), 0.5, 0),
    LayeredStack("hazy varnish on black, .05", 1.5, 0.05, (HAZE,), 0.02, 1),
    LayeredStack("varnish 1.5 on white 1.4, smooth", (1.5, 1.4), 0.0, (CLEAR, WHITE), 0.8, 1),
    LayeredStack("tint 1.4 on dark 1.7, smooth", (1.4, 1.7), 0.0, (TINT, DARK), 0.3, 1),
    LayeredStack(
        "forward glaze g .7 on white, smooth", 1.5, 0.0, (RED_GLAZE._replace(g=0.7), WHITE), 0.8, 1
    ),
    LayeredStack(
        "milk g .5 on paint g -.3, smooth",
        1.5,
        0.0,
        (HAZE._replace(g=0.5), RED_PAINT._replace(g=-0.3)),
        0.2,
        1,
    ),
)
