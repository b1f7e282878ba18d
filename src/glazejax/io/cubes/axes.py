"""Which axis of an array is y, which x and which the wavelength."""

from collections.abc import Sequence

_LINES = {
    "y",
    "line",
    "lines",
    "row",
    "rows",
    "lat",
    "latitude",
    "northing",
    "height",
    "along_track",
}
_SAMPLES = {
    "x",
    "sample",
    "samples",
    "column",
    "columns",
    "col",
    "cols",
    "lon",
    "longitude",
    "easting",
    "width",
}
_BANDS = {
    "wavelength",
    "wavelengths",
    "wl",
    "wvl",
    "lambda",
    "band",
    "bands",
    "spectral",
    "channel",
    "channels",
    "c",
}


def axes_of(
    shape: Sequence[int], count: int | None = None, names: Sequence[str | None] = ()
) -> tuple[tuple[int, int, int], tuple[int, int, int]]:
    """Axes of y, x and wavelength, and their sizes.

    By their names where those are known; else the wavelength is the axis of as many entries as
    there are wavelengths, the last of them, or the last where that is not known either; y comes
    before x.

    Args:
        shape: three sizes.
        count: wavelengths, if they are known.
        names: of the axes.
    """
    words = [str(name or "").lower().rsplit("/", 1)[-1] for name in names] or [""] * 3
    named = [
        next(
            (
                i
                for i, word in enumerate(words)
                if word in known or word.startswith(tuple(known & _LONG))
            ),
            None,
        )
        for known in (_LINES, _SAMPLES, _BANDS)
    ]
    band = named[2]
    if band is None and named[0] is not None and named[1] is not None:
        band = ({0, 1, 2} - {named[0], named[1]}).pop()
    if band is None:
        fitting = [i for i in range(3) if shape[i] == count and i not in named]
        band = fitting[-1] if fitting else 2
    y, x = [i for i in range(3) if i != band]
    if named[0] == x or named[1] == y:
        y, x = x, y
    return (y, x, band), (int(shape[y]), int(shape[x]), int(shape[band]))


_LONG = {"wavelength", "lambda", "band", "sample", "line"}
