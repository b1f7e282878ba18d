"""Paints on the shelf: what they look like, thick and as a thin glaze over white, and what is not known of them."""

import re
from collections.abc import Mapping
from typing import Any

import numpy as np
from jaxtyping import Float

from .. import catalogue, colour
from ..geometry import Bidirectional
from ..paint.describe import describe_bands
from ..paint.media import MAX_THICKNESS, Glaze, Layer, Pigment
from ..reflectance import reflectance
from ..spectra import describe_grid, same_grid
from ..stacks import WHITE, Stack, paints
from .engine import TOLERANCE

THIN = 5e-6
"""Thickness of the thin glaze, m."""
# Paints to a batch: two rows each make one shape.
_BATCH = 16


def entry(name: str, paint: Pigment) -> dict[str, Any]:
    """What the page says of a paint."""
    group, slash, own = name.partition("/")
    known = paint.identifiable
    return {
        "name": name,
        "label": _spaced(own if slash and group in catalogue.names() else name),
        "group": _group(name, paint),
        "provenance": paint.provenance or "no provenance is stated",
        "bands": describe_grid(paint.wavelengths),
        "unknown": "" if known is None or known.all() else describe_bands(paint.wavelengths, ~known),
        "sure": paint.error_modes is not None or paint.absorption_sd is not None,
    }


def _spaced(name: str) -> str:
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
    shelf, found = paints(stack), []
    for name in dict.fromkeys(name for coat in stack.shown for weight, name in coat.parts if weight > 0):
        paint = shelf[name]
        if paint.identifiable is not None and not paint.identifiable.all():
            bands = describe_bands(paint.wavelengths, ~paint.identifiable)
            found.append(f"{name} at {bands}: only k/s is known; thin coats may look different")
    return found


def swatches(some: Mapping[str, Pigment]) -> tuple[Float[np.ndarray, "paints 3"], Float[np.ndarray, "paints 3"]]:
    """8-bit sRGB under D65 of each paint: thick, and a thin glaze over white, at 45:0."""
    found = np.zeros((2, len(some), 3))
    listed = list(some.values())
    grids = [paint.wavelengths for paint in listed]
    done: set[int] = set()
    for i, grid in enumerate(grids):
        if i in done:
            continue
        same = [j for j in range(i, len(listed)) if j not in done and same_grid(grid, grids[j])]
        done.update(same)
        weights = colour.colour_weights(grid)
        for at in range(0, len(same), _BATCH):
            chosen = same[at : at + _BATCH]
            spectra = _batch([listed[j] for j in chosen], grid)
            xyz = spectra @ weights
            found[:, chosen] = np.round(255 * np.asarray(colour.xyz_to_srgb(xyz, weights.sum(axis=0)), float))
    return found[0], found[1]


def _batch(some: list[Pigment], grid: Float[np.ndarray, "bands"]) -> Float[np.ndarray, "2 paints bands"]:
    filled = some + some[:1] * (_BATCH - len(some))
    k, s = (np.array([np.asarray(getattr(p, what), float) for p in filled]) for what in ("absorption", "scattering"))
    depth = np.stack([np.full(_BATCH, MAX_THICKNESS), np.full(_BATCH, THIN)])
    glaze = Glaze([Layer(Pigment("shelf", grid, k, s), depth)], WHITE)
    return np.asarray(reflectance(glaze, Bidirectional(45.0, 0.0), tolerance=TOLERANCE), float)[:, : len(some)]
