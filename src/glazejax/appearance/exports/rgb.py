"""Linear RGB of renderers: which space, from XYZ and back, and how much of a colour it
cannot hold.
"""

from typing import NamedTuple, TypeAlias

import numpy as np
from jaxtyping import Bool, Float

from ...colour import (
    SRGB_PRIMARIES,
    SRGB_WHITE,
    bradford,
    delta_e_2000,
    rgb_matrix,
    xyz_to_lab,
)
from .spaces import Space

Triples: TypeAlias = Float[np.ndarray, "*batch 3"]
"""Colours in linear RGB, XYZ or Lab."""

Values: TypeAlias = Float[np.ndarray, "*batch"]
"""A number a point."""


class _Primaries(NamedTuple):
    points: tuple[tuple[float, float], ...]
    white: tuple[float, float]
    label: str


# S-2014-004 of the Academy (ACEScg): its primaries AP1 and its white, near D60.
SPACES = {
    "lin_rec709": _Primaries(SRGB_PRIMARIES, SRGB_WHITE, "linear sRGB"),
    "acescg": _Primaries(
        ((0.713, 0.293), (0.165, 0.83), (0.128, 0.044)), (0.32168, 0.33767), "ACEScg"
    ),
}


def rgb_of_xyz(xyz: Triples, white: Float[np.ndarray, "3"], space: Space) -> Triples:
    """Linear RGB, (..., 3), not clipped, of XYZ seen under a white, which becomes (1, 1, 1)."""
    to_xyz = rgb_matrix(*SPACES[space][:2])
    adapt = bradford(white, to_xyz.sum(axis=1))
    return xyz @ (np.linalg.inv(to_xyz) @ adapt).T


def lab_of_rgb(rgb: Triples, space: Space) -> Triples:
    """CIE Lab of linear RGB, (..., 3): the space's white is (100, 0, 0), and what is adapted is
    D65.
    """
    to_xyz = rgb_matrix(*SPACES[space][:2])
    screen = rgb_matrix().sum(axis=1)
    matrix = bradford(to_xyz.sum(axis=1), screen) @ to_xyz
    return np.asarray(xyz_to_lab(rgb @ matrix.T, screen), float)


def delta_e(first: Triples, second: Triples, space: Space) -> Values:
    """CIEDE2000 between linear RGB colours, (...)."""
    return delta_e_2000(lab_of_rgb(first, space), lab_of_rgb(second, space))


def outside(rgb: Triples) -> Bool[np.ndarray, "*batch"]:
    """Mask of colours that lie outside of what the space holds, by more than rounding, (...)."""
    return np.any((rgb < -5e-4) | (rgb > 1 + 5e-4), axis=-1)
