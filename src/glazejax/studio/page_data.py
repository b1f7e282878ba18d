"""Data of the page: paints with their coefficients and errors, lamps and the eye, as plain JSON.

The page computes every colour itself, from these numbers, with `page/solver.js`.
"""

import base64
import re
from collections.abc import Mapping

import numpy as np

from .. import catalogue, cie
from ..colour import CIE_1931
from ..paint.media import MAX_THICKNESS, Pigment
from ..spectra import describe_grid, ranges
from ..stacks import BLACK, MOST_COATS, MOST_PARTS, WHITE, all_paints, pigment_to_dict
from .messages import JsonObject

# What is seen of the eye's curves, nm.
_EYE = (360, 780)


def page_data(own_paints: Mapping[str, Pigment] | None = None) -> JsonObject:
    """All that the page needs to know, and own paints in addition to the catalogues'.

    Args:
        own_paints: by names that no catalogue has, see `glazejax.stacks.own_name`.

    Returns:
        `paints`, each as `entry` has it, with its coefficients; `own`, those of `own_paints`,
        as a stack's file brings them; `lamps`, `eye`, and the stack's limits.
    """
    shelf = all_paints()
    listed = [entry(name, paint) | {"curves": _curves(paint)} for name, paint in shelf.items()]
    added = own_paints or {}
    return {
        "paints": listed + [entry(name, paint) for name, paint in added.items()],
        "own": {name: pigment_to_dict(paint) for name, paint in added.items()},
        "lamps": {
            name: {"wavelengths": curve.wavelengths.tolist(), "power": curve.values.tolist()}
            for name, curve in cie.illuminants().items()
        },
        "eye": _eye(),
        "white": WHITE,
        "black": BLACK,
        "thickest": MAX_THICKNESS * 1e6,
        "most_coats": MOST_COATS,
        "most_parts": MOST_PARTS,
    }


def entry(name: str, paint: Pigment) -> JsonObject:
    """Entry of a paint on the page."""
    # The catalogues' paints are the first's by name, and further ones' as CATALOGUE/NAME.
    group, _, label = name.rpartition("/")
    if name not in all_paints():
        group = "own"
        label = name
    identifiable = paint.identifiable
    bands = paint.wavelengths
    # Bands at which the data leave k and s apart unknown.
    unknown = "" if identifiable is None or identifiable.all() else ranges(bands, ~identifiable)
    return {
        "name": name,
        # A catalogue's name as people write it: Chrome Yellow.
        "label": re.sub(r"(?<=[a-z0-9])(?=[A-Z])", " ", label),
        "group": group or catalogue.names()[0],
        "provenance": paint.provenance or "no provenance is stated",
        "bands": describe_grid(bands),
        "unknown": unknown,
        "caution": catalogue.caution(paint),
    }


def _curves(paint: Pigment) -> JsonObject:
    """Coefficients of a shipped paint, with the modes of its errors in 16 bits."""
    columns = pigment_to_dict(paint)
    for key in ("identifiable", "provenance"):
        columns.pop(key, None)
    if paint.error_modes is None:
        return columns
    modes = np.asarray(paint.error_modes, float)
    # The largest mode takes the whole range of 16 bits.
    step = float(np.abs(modes).max()) / 32767 or 1.0
    packed = base64.b64encode(np.round(modes / step).astype("<i2").tobytes()).decode()
    return columns | {"modes": packed, "step": step}


def _eye() -> JsonObject:
    """Colour matching functions at every nanometre."""
    eye: JsonObject = {"start": _EYE[0]}
    for name, curve in zip("xyz", cie.observers()[CIE_1931], strict=True):
        visible = (curve.wavelengths >= _EYE[0]) & (curve.wavelengths <= _EYE[1])
        eye[name] = curve.values[visible].tolist()
    return eye
