"""The adding-doubling blocks of iadpython (PyPI), the one peer whose refracting surface can lie on
stacks of layers.

Its ready-made entry points take normal incidence and one layer; the blocks beneath them take any
directions, so the stack is put together from those: doubling of each layer from a thin start,
adding of layers, ground and surface. Its own directions (Gauss and Radau rules in the inside
cosine) meet the square root in the interface's reflectance at the critical angle and converge with
the third power of their number; here its rules are applied to the outside cosine, which removes the
square root. Its Radau rule fails from 32 points.
"""

import itertools
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from benchmarks.peers import Work

PACKAGE = "iadpython"


class Setting(NamedTuple):
    """Numbers of directions, and halvings of the starting thickness beyond iadpython's own."""

    cone: (
        int  # in each of the three parts, ending at the two directions asked for and at the normal
    )
    total: int  # totally reflected
    halvings: int

    def __str__(self) -> str:
        return f"{3 * self.cone} + {self.total} dir."


SETTINGS = (
    Setting(2, 3, 0),
    Setting(3, 5, 0),
    Setting(4, 6, 0),
    Setting(5, 9, 0),
    Setting(6, 12, 1),
    Setting(8, 18, 2),
)


def reflectance(
    work: Work, setting: Setting, refractive_index: float = 1.5
) -> Callable[[], np.ndarray]:
    """Directions and surface set up once; a call solves all wavelengths, one after the other. Index
    above one.
    """
    import iadpython as iad  # pyright: ignore[reportMissingImports]
    from iadpython.combine import add_slide_above, double_until  # pyright: ignore[reportMissingImports]

    sample, seen, lit = _directions(iad, work, setting, refractive_index)
    surface = iad.start.boundary_layer(sample, top=True)
    ground = np.full((sample.quad_pts, sample.quad_pts), work.ground)
    nothing = np.zeros_like(ground)

    def layer(albedo: float, thickness: float) -> tuple[np.ndarray, np.ndarray]:
        sample.a, sample.b = float(albedo), float(thickness)
        sample.b_thinnest = iad.start.starting_thickness(sample) / 2**setting.halvings
        return double_until(sample, *iad.start.diamond(sample), sample.b_thinnest, sample.b)

    def one(albedo: np.ndarray, thickness: np.ndarray) -> float:
        below, through = ground, nothing
        for q, d in zip(albedo[::-1], thickness[::-1], strict=True):
            r, t = layer(q, d)
            # Nothing comes out below the ground: only the reflection from above is carried along.
            below, _ = iad.add_layers_basic(sample, below, through, r, r, t, t)
        whole, _, _, _ = add_slide_above(sample, *surface, below, nothing, nothing, nothing)
        return whole[seen, lit] / refractive_index**2

    return lambda: np.array(
        [one(*stack) for stack in zip(work.albedo, work.optical_thickness, strict=True)]
    )


def _directions(iad: Any, work: Work, setting: Setting, index: float) -> tuple[Any, int, int]:
    """A `Sample` with its directions, and the numbers of those of viewing and incidence."""
    critical = np.sqrt(1 - 1 / index**2)
    y, w = iad.quadrature.gauss(setting.total, 0, 1)
    cosines, weights = [critical * y**2], [2 * critical * y * w]
    ends = [0.0, *sorted((work.cos_incidence, work.cos_viewing)), 1.0]
    for start, end in itertools.pairwise(ends):
        outside, w = iad.quadrature.radau(setting.cone, start, end)
        inside = np.sqrt(1 - (1 - outside**2) / index**2)
        cosines.append(inside)
        weights.append(w * outside / (index**2 * inside))
    sample = iad.Sample(n=index, quad_pts=setting.total + 3 * setting.cone)
    sample.nu = np.concatenate(cosines)
    sample.twonuw = 2 * sample.nu * np.concatenate(weights)

    def nearest(outside: float) -> int:
        return int(np.argmin(np.abs(sample.nu - np.sqrt(1 - (1 - outside**2) / index**2))))

    return sample, nearest(work.cos_viewing), nearest(work.cos_incidence)
