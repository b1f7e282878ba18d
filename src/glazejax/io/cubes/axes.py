"""Axes of an array: which is y, which x and which the wavelength."""

import re
from collections.abc import Sequence

# Names of y, x and wavelength, in small letters.
_NAMES = (
    re.compile(r"y|line.*|rows?|lat(itude)?|northing|height|along_track"),
    re.compile(r"x|sample.*|col(umn)?s?|lon(gitude)?|easting|width"),
    re.compile(r"wavelength.*|wl|wvl|lambda.*|band.*|spectral|channels?|c"),
)


def axes_of(
    shape: Sequence[int], count: int | None, names: Sequence[str | None] = ()
) -> tuple[int, int, int]:
    """Axes of y, x and wavelength.

    By their names where those are known; else the wavelength is the axis of as many entries as
    there are wavelengths, the last of them, or the last where that is not known either; y comes
    before x.

    Args:
        shape: three sizes.
        count: wavelengths, if they are known.
        names: of the axes.
    """
    words = [str(name or "").lower().rsplit("/", 1)[-1] for name in names]
    named = [
        next((i for i, word in enumerate(words) if kind.fullmatch(word)), None) for kind in _NAMES
    ]
    band = named[2]
    if band is None and None not in named[:2]:
        band = {0, 1, 2}.difference(named).pop()
    if band is None:
        fitting = [i for i in range(3) if shape[i] == count and i not in named]
        band = fitting[-1] if fitting else 2
    y, x = [i for i in range(3) if i != band]
    if named[0] == x or named[1] == y:
        y, x = x, y
    return y, x, band
