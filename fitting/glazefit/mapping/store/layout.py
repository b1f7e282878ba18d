"""What a map of paints holds, by name: the one list that solver, store, pictures and
report share.
"""

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

    def further_sizes(self, paints: int) -> tuple[int, ...]:
        """Sizes of these dimensions in a map of so many paints."""
        sizes = {"paint": paints, "place": PLACES, "rgb": 3}
        return tuple(sizes[name] for name in self.further)


PLACES = 3
"""Paints a set can have."""

VARIABLES = (
    Variable(name="status", dtype="uint8", fill=0, unit="", words="what became of the pixel"),
    Variable(name="way", dtype="uint8", fill=0, unit="", words="how its answer was found"),
    Variable(
        name="members",
        dtype="int16",
        fill=-1,
        unit="",
        words="paints of the most probable set, by number; -1 for none",
        further=("place",),
    ),
    Variable(name="condition", dtype="int8", fill=0, unit="", words="how it lies if not as told"),
    Variable(
        name="probability",
        dtype="float32",
        fill=float("nan"),
        unit="1",
        words="probability of that set",
    ),
    Variable(
        name="none",
        dtype="float32",
        fill=float("nan"),
        unit="1",
        words="probability that no paints of the catalogue explain the pixel",
    ),
    Variable(
        name="explained",
        dtype="uint8",
        fill=0,
        unit="",
        words="1 where the catalogue explains the pixel",
    ),
    Variable(
        name="paint_probability",
        dtype="float32",
        fill=float("nan"),
        unit="1",
        words="probability of each paint",
        further=("paint",),
    ),
    Variable(
        name="fraction",
        dtype="float32",
        fill=float("nan"),
        unit="1",
        words="share by mass of each paint of the set",
        further=("place",),
    ),
    Variable(
        name="fraction_sd",
        dtype="float32",
        fill=float("nan"),
        unit="1",
        words="its standard deviation",
        further=("place",),
    ),
    Variable(
        name="thickness",
        dtype="float32",
        fill=float("nan"),
        unit="m",
        words="thickness; NaN where the film hides its ground",
    ),
    Variable(
        name="thickness_sd",
        dtype="float32",
        fill=float("nan"),
        unit="m",
        words="its standard deviation",
    ),
    Variable(
        name="misfit",
        dtype="float32",
        fill=float("nan"),
        unit="Delta E00",
        words="how far off the best candidates are",
    ),
    Variable(
        name="rmse",
        dtype="float32",
        fill=float("nan"),
        unit="1",
        words="root mean square of measured less fitted reflectance",
    ),
    Variable(
        name="true_colour",
        dtype="uint8",
        fill=0,
        unit="",
        words="sRGB under D65, 2 degrees",
        further=("rgb",),
    ),
)
"""All arrays of a map. `paint` counts the catalogue's paints, `place` those of a set, `rgb` red,
green and blue.
"""

BY_NAME = {variable.name: variable for variable in VARIABLES}
