"""Colours of a legend: each like the paint that it stands for, and none like another's, for people
who see few colours, either.
"""

import itertools
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from glazejax.colour import (
    colour_science,
    delta_e_2000,
    encoded_srgb,
    linear_srgb,
    srgb_to_xyz,
    xyz_to_lab,
)
from glazejax.plots import hex_colour

MOST_SETS = 15
"""Sets that have a row and a colour of their own, at most."""
OTHERS = "#b8b3bb"
"""Colour of all further sets."""
STRIPES = ("#8a8a8a", "#f2f2f2")
"""Stripes where no set of the catalogue explains a pixel."""
BLANK = "#ffffff"
"""Colour of what was not mapped in the legend map."""
APART = 11.0
"""CIEDE2000 that two colours differ by, whoever looks."""

Shades = Float[np.ndarray, "colours 3"]


def legend_colours(colours: Sequence[str]) -> list[str]:
    """A colour for each set: the one nearest to its own that is `APART` from all before it, as seen
    with three or two kinds of cones; where there is none, the one farthest from all before it.

    Args:
        colours: what sets look like, #rrggbb, the most important first.

    Returns:
        As many colours, #rrggbb.
    """
    shades = _shades(colours)
    # Levels of red, green and blue that are tried.
    levels = np.linspace(0.0, 1.0, 13)
    grid = np.array(list(itertools.product(levels, levels, levels)))
    tried = np.concatenate([shades, grid])
    tried_lab = seen_colours(tried)
    reserved_lab = seen_colours(_shades([OTHERS, BLANK, *STRIPES]))
    room = delta_e_2000(tried_lab[:, :, None], reserved_lab[:, None]).min(axis=(0, 2))
    chosen = []
    for shade in tried_lab[0, : len(shades)]:
        off = delta_e_2000(tried_lab[0], shade)
        best = int(np.where(room >= APART, off, np.inf).argmin())
        best = best if room[best] >= APART else int(room.argmax())
        chosen.append(hex_colour(tried[best]))
        room = np.minimum(room, delta_e_2000(tried_lab, tried_lab[:, best, None]).min(axis=0))
    return chosen


def seen_colours(shades: Shades) -> Float[np.ndarray, "eyes colours 3"]:
    """L*a*b* of encoded sRGB, as seen with all cones and without those for long, middle and short
    waves.
    """
    # One or two kinds of cones missing, on linear sRGB: G. Machado, M. Oliveira, L. Fernandes, IEEE
    # TVCG 15:1291 (2009).
    matrices = colour_science().CVD_MATRICES_MACHADO2010
    kinds = ("Protanomaly", "Deuteranomaly", "Tritanomaly")
    eyes = np.stack([np.eye(3), *(matrices[kind][1.0] for kind in kinds)])
    perceived = np.clip(linear_srgb(shades) @ eyes.transpose(0, 2, 1), 0, 1)
    return np.asarray(xyz_to_lab(srgb_to_xyz(encoded_srgb(perceived)), srgb_to_xyz(np.ones(3))))


def rgb(colour: str) -> list[int]:
    """Red, green and blue of #rrggbb, 0 to 255."""
    return list(bytes.fromhex(colour[1:]))


def _shades(colours: Sequence[str]) -> Shades:
    return np.array([rgb(colour) for colour in colours]).reshape(-1, 3) / 255
