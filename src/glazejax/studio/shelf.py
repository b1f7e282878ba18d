"""Paints on the shelf: what they look like, thick and as a thin glaze over white, and what is not
known of them.
"""

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from jaxtyping import Float

from .. import catalogue, colour
from ..paint.describe import describe_bands
from ..paint.media import MAX_THICKNESS, Pigment
from ..spectra import describe_grid, same_grid
from ..stacks import WHITE, Stack, paints
from .engine import GAMUT, Engine, View, padded_size, rows_of

THIN = 5e-6
"""Thickness of the thin glaze, m."""
# Coats of the program that draws the shelf.
_SIZE = 3


def entry(name: str, paint: Pigment) -> dict[str, Any]:
    """What the page says of a paint."""
    group, slash, own = name.partition("/")
    known = paint.identifiable
    return {
        "name": name,
        "label": _space_words(own if slash and group in catalogue.names() else name),
        "group": _group(name, paint),
        "provenance": paint.provenance or "no provenance is stated",
        "bands": describe_grid(paint.wavelengths),
        "unknown": ""
        if known is None or known.all()
        else describe_bands(paint.wavelengths, ~known),
        "sure": paint.error_modes is not None or paint.absorption_sd is not None,
    }


def _space_words(name: str) -> str:
    """A catalogue's name as people write it: ``Chrome Yellow``."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", " ", name)


def _group(name: str, paint: Pigment) -> str:
    first, *others = catalogue.names()
    prefix = name.partition("/")[0]
    if prefix in others:
        return prefix
    return first if catalogue.assumed_scale(paint) else "own"


def doubts(stack: Stack) -> list[str]:
    """Sentences on paints of the shown coats of which measurements do not tell k and s apart."""
    shelf = paints(stack)
    found = []
    for name in dict.fromkeys(
        name for coat in stack.shown for weight, name in coat.parts if weight > 0
    ):
        paint = shelf[name]
        if paint.identifiable is not None and not paint.identifiable.all():
            bands = describe_bands(paint.wavelengths, ~paint.identifiable)
            found.append(f"{name} at {bands}: only k/s is known; thin coats may look different")
    return found


def swatches(engine: Engine, paints: Sequence[Pigment]) -> dict[str, Float[np.ndarray, "..."]]:
    """8-bit sRGB under D65 of paints on one grid: thick, and a thin glaze over white, at 45:0.

    Returns:
        `thick`, `thin` (paints, 3), and `outside` (paints, 2): 1 where sRGB cannot show the colour.

    The program is that of stacks of three coats, so that nothing more is compiled.
    """
    grid = paints[0].wavelengths
    weights = colour.colour_weights(grid)
    key = (_SIZE, padded_size(grid.size), False)
    rows = rows_of(_SIZE)
    columns = np.minimum(np.arange(key[1]), grid.size - 1)
    most = rows // 2
    found = np.zeros((2, len(paints), 3))
    outside = np.zeros((len(paints), 2))
    for at in range(0, len(paints), most):
        chosen = paints[at : at + most]
        both = np.zeros((2, rows, key[1], _SIZE))
        depth = np.zeros((rows, _SIZE))
        for i, paint in enumerate(chosen):
            k_and_s = np.stack(
                [np.asarray(paint.absorption, float), np.asarray(paint.scattering, float)]
            )[:, columns]
            for row, thickness in ((i, MAX_THICKNESS), (most + i, THIN)):
                both[:, row, :, 0] = k_and_s
                depth[row, 0] = thickness
        ground = np.full((rows, key[1]), WHITE)
        spectra = engine.solve(key, both, depth, ground, Stack(()), View(light=45.0, view=0.0))[
            :, : grid.size
        ]
        for half in (0, 1):
            xyz = spectra[half * most : half * most + len(chosen)] @ weights
            encoded = np.asarray(colour.xyz_to_srgb(xyz, weights.sum(axis=0), clip=False), float)
            found[half, at : at + most] = np.round(255 * np.clip(encoded, 0, 1))
            outside[at : at + most, half] = np.any(
                (encoded < -GAMUT) | (encoded > 1 + GAMUT), axis=1
            )
    return {"thick": found[0], "thin": found[1], "outside": outside}


def by_grid(paints: Mapping[str, Pigment]) -> list[dict[str, Pigment]]:
    """Paints that share their wavelengths, together."""
    groups: list[dict[str, Pigment]] = []
    for name, paint in paints.items():
        for group in groups:
            if same_grid(next(iter(group.values())).wavelengths, paint.wavelengths):
                group[name] = paint
                break
        else:
            groups.append({name: paint})
    return groups
