"""What a map of paints holds, by name: the one list that solver, store, pictures and report share."""

from enum import IntEnum
from typing import NamedTuple


class Status(IntEnum):
    """What became of a pixel."""

    UNDONE = 0  # its chunk has not been solved yet
    MAPPED = 1
    MASKED = 2  # by the user's mask
    NO_DATA = 3  # NaN, the file's mark of missing data, or a dead pixel: one value at all bands
    SATURATED = 4  # a band at the detector's upper end
    DARK = 5  # so little light that nothing tells paints apart
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


class Way(IntEnum):
    """How a pixel's answer was found."""

    NONE = 0
    UPDATED = 1  # from the representative next to it, in closed form
    SEARCHED = 2  # by a search of its own
    NEIGHBOUR = 3  # in closed form too, from a pixel of the same window that was searched


class Variable(NamedTuple):
    """One array of a map; all are (y, x) first."""

    name: str
    dtype: str
    fill: float
    unit: str
    words: str
    further: tuple[str, ...] = ()  # dimensions after y and x


PLACES = 3
"""Paints a set can have."""

VARIABLES = (
    Variable("status", "uint8", 0, "", "what became of the pixel"),
    Variable("way", "uint8", 0, "", "how its answer was found"),
    Variable("members", "int16", -1, "", "paints of the most probable set, by number; -1 for none", ("place",)),
    Variable("coats", "int8", 0, "", "coat of each of them, 0 the uppermost", ("place",)),
    Variable("condition", "int8", 0, "", "how it lies if not as told"),
    Variable("probability", "float32", float("nan"), "1", "probability of that set"),
    Variable("none", "float32", float("nan"), "1", "probability that no paints of the catalogue explain the pixel"),
    Variable("explained", "uint8", 0, "", "1 where the catalogue explains the pixel"),
    Variable("paint_probability", "float32", float("nan"), "1", "probability of each paint", ("paint",)),
    Variable("fraction", "float32", float("nan"), "1", "share by mass of each paint of the set", ("place",)),
    Variable("fraction_sd", "float32", float("nan"), "1", "its standard deviation", ("place",)),
    Variable("thickness", "float32", float("nan"), "m", "thickness of all coats; NaN where the film hides its ground"),
    Variable("thickness_sd", "float32", float("nan"), "m", "its standard deviation"),
    Variable("misfit", "float32", float("nan"), "Delta E00", "how far off the best candidates are"),
    Variable("rmse", "float32", float("nan"), "1", "root mean square of measured less fitted reflectance"),
    Variable("true_colour", "uint8", 0, "", "sRGB under D65, 2 degrees", ("rgb",)),
)
"""All arrays of a map. `paint` counts the catalogue's paints, `place` those of a set, `rgb` red, green and blue."""

BY_NAME = {variable.name: variable for variable in VARIABLES}
