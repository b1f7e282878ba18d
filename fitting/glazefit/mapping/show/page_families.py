"""Families on a map's page: where each is in the picture of the object, and how probable."""

from typing import Any

import numpy as np

from .overview import Overview
from .pictures import RGB, enlarge, file_stem, paint_pictures

# Share of its contrast that the rest of the picture keeps.
_FADED = 0.12


def family_rows(look: Overview) -> list[dict[str, Any]]:
    """Families and groups of the sets that are shown, those of the largest sets first."""
    return [
        {
            "name": look.paints[number],
            "key": f"{file_stem(look.paints[number])}_place",
            "pixels": look.in_set[number],
            "place": _place(look, number),
            "probability": paint_pictures(look, number)[0],
        }
        for number in dict.fromkeys(member for members in look.shown for member in members)
    ]


def _place(look: Overview, family: int) -> RGB:
    """The object in true colour where a family is of the most probable set, faded elsewhere."""
    present = (look.examples["members"] == family).any(axis=-1) & (look.examples["explained"] > 0)
    faded = 255 - _FADED * (255.0 - look.colour)
    return enlarge(np.where(present[..., None], look.colour, faded).round().astype(np.uint8))
