"""Arrays of a map of paints, by name: the list that solver, store, pictures and report share."""

from collections.abc import Mapping
from enum import IntEnum
from typing import NamedTuple


class Status(IntEnum):
    """Status of a pixel."""

    UNDONE = 0  # its chunk has not been solved yet
    MAPPED = 1
    MASKED = 2  # by the user's mask
    NO_DATA = 3  # NaN, the file's mark of missing data, or a dead pixel: one value at all bands
    SATURATED = 4  # a band at the detector's upper end
    DARK = 5  # too little light to distinguish paints
    NEGATIVE = 6  # readings below 0 by more than noise
    TOO_BRIGHT = 7  # reflectance above 1.5: a highlight, or no calibration


STATUS_WORDS = {
    Status.UNDONE: "not done yet",
    Status.MAPPED: "mapped",
    Status.MASKED: "left out by the mask",
    Status.NO_DATA: "no data",
    Status.SATURATED: "saturated",
    Status.DARK: "too dark",
    Status.NEGATIVE: "negative",
    Status.TOO_BRIGHT: "too bright",
}


def status_counts(tallies: Mapping[str, float]) -> dict[str, int]:
    """Pixels of each status that occurs by its words, from the tallies of a map."""
    return {words: int(tallies[words]) for words in STATUS_WORDS.values() if tallies.get(words)}


class Way(IntEnum):
    """Way in which a pixel's answer was found."""

    NONE = 0
    UPDATED = 1  # from the representative next to it, in closed form
    SEARCHED = 2  # by a search of its own
    NEIGHBOUR = 3  # in closed form too, from a pixel of the same window that was searched


class Variable(NamedTuple):
    """One array of a map; all are (y, x) first."""

    name: str
    meaning: str
    dtype: str = "float32"
    fill: float = float("nan")
    unit: str = ""
    further: tuple[str, ...] = ()  # dimensions after y and x


PLACES = 3
"""Paints a set can have."""

VARIABLES = (
    Variable("status", "what became of the pixel", dtype="uint8", fill=0),
    Variable("way", "how its answer was found", dtype="uint8", fill=0),
    Variable(
        "members",
        "paints of the most probable set, by number; -1 for none",
        dtype="int16",
        fill=-1,
        further=("place",),
    ),
    Variable("condition", "how it lies if not as stated", dtype="int8", fill=0),
    Variable("probability", "probability of that set", unit="1"),
    Variable(
        "none",
        "probability that no paints of the catalogue explain the pixel",
        unit="1",
    ),
    Variable("explained", "1 where the catalogue explains the pixel", dtype="uint8", fill=0),
    Variable("paint_probability", "probability of each paint", unit="1", further=("paint",)),
    Variable(
        "fraction",
        "share by mass of each paint of the set",
        unit="1",
        further=("place",),
    ),
    Variable("fraction_sd", "its standard deviation", unit="1", further=("place",)),
    Variable("thickness", "thickness; NaN where the film hides its ground", unit="m"),
    Variable("thickness_sd", "its standard deviation", unit="m"),
    Variable("misfit", "how far off the best candidates are", unit="Delta E00"),
    Variable("rmse", "root mean square of measured less fitted reflectance", unit="1"),
    Variable(
        "true_colour",
        "sRGB under D65, 2 degrees",
        dtype="uint8",
        fill=0,
        further=("rgb",),
    ),
)
"""All arrays of a map. `paint` counts the catalogue's paints, `place` those of a set, `rgb` red,
green and blue.
"""

BY_NAME = {variable.name: variable for variable in VARIABLES}
