"""Options of `glazejax map`, read into what the library takes."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from glazejax.commands import options

if TYPE_CHECKING:
    import numpy as np
    import xarray
    from jaxtyping import Float

    from glazejax import Pigment

    from ..film.films import Instrument

CUBE = "cube:"


def read_memory(text: str) -> int:
    """Bytes of ``--memory``, such as 2GiB or 800MB.

    Raises:
        ValueError: no size.
    """
    match = re.fullmatch(r"(\d+\.?\d*|\.\d+)\s*([kmg]?)(i?b)?", text.strip().lower())
    if match is None or not float(match[1]):
        raise ValueError(f"--memory is {text!r}; write a number and a unit, such as 2GiB or 800MB")
    thousand = 1000 if match[3] == "b" else 1024
    return int(float(match[1]) * thousand ** " kmg".index(match[2] or " "))


def read_window(text: str) -> tuple[int, int, int, int] | None:
    """First and end line, first and end sample of ``--window``, which is ``x0:x1,y0:y1``; None if
    it was left out.

    Raises:
        ValueError: something else.
    """
    if not text:
        return None
    match = re.fullmatch(r"\s*(\d+):(\d+)\s*,\s*(\d+):(\d+)\s*", text)
    if match is None or int(match[1]) >= int(match[2]) or int(match[3]) >= int(match[4]):
        raise ValueError(
            f"--window is {text!r}; write x0:x1,y0:y1 in pixels from 0, ends not included, such "
            "as 100:400,0:250"
        )
    x0, x1, y0, y1 = (int(match[i]) for i in range(1, 5))
    return y0, y1, x0, x1


def read_binning(text: str) -> tuple[int, int, int]:
    """Lines, samples and bands of ``--bin``, which is one number for lines and samples, or all
    three.

    Raises:
        ValueError: something else.
    """
    match = re.fullmatch(r"\s*(\d+)\s*(?:,\s*(\d+)\s*,\s*(\d+)\s*)?", text)
    factors = None if match is None else tuple(int(group) for group in match.groups() if group)
    if not factors or min(factors) < 1:
        raise ValueError(
            f"--bin is {text!r}; write 2 for 2 x 2 pixels, or lines, samples and bands, such as "
            "2,2,4"
        )
    lines, *others = factors
    samples, bands = others or (lines, 1)
    return lines, samples, bands


def read_bands(text: str) -> tuple[float, float] | None:
    """First and last wavelength of ``--bands``, nm; None if it was left out.

    Raises:
        ValueError: something else.
    """
    if not text:
        return None
    match = re.fullmatch(r"\s*(\d+\.?\d*)\s*[-:]\s*(\d+\.?\d*)\s*(?:nm)?\s*", text)
    if match is None or float(match[1]) >= float(match[2]):
        raise ValueError(
            f"--bands is {text!r}; write the first and the last wavelength in nm, such as 420-700"
        )
    return float(match[1]), float(match[2])


def read_wavelengths(text: str) -> tuple[float, ...] | Path | None:
    """Wavelengths of ``--wavelengths``, a file or numbers with commas; None if it was left out.

    Raises:
        ValueError: neither.
    """
    if not text:
        return None
    if Path(text).exists():
        return Path(text)
    try:
        return tuple(float(number) for number in text.split(","))
    except ValueError:
        raise ValueError(
            f"--wavelengths is {text!r}; name a text file of numbers, or write them in nm with "
            "commas: 400,410,420"
        ) from None


def read_white(text: str) -> float | Path:
    """The white's own reflectance of ``--white-reflectance``, a number or a file of one spectrum.

    Raises:
        ValueError: a number out of range.
        FileNotFoundError: neither a number nor a file.
    """
    try:
        reflectance = float(text)
    except ValueError:
        if not Path(text).exists():
            raise FileNotFoundError(
                f"--white-reflectance {text}: neither a number nor a file"
            ) from None
        return Path(text)
    if not 0 < reflectance <= 1.1:
        raise ValueError(
            f"--white-reflectance is {text}; write a fraction such as 0.99, or a file of its "
            "spectrum"
        )
    return reflectance


def read_spots(texts: Sequence[str], paint_names: Sequence[str]) -> dict[str, str]:
    """Names and places of ``--spot NAME=PLACE``.

    Args:
        texts: as typed.
        paint_names: names that paints have already.

    Raises:
        ValueError: no name or no place, or a name that is there already.
    """
    locations: dict[str, str] = {}
    for text in texts:
        name, equals, location = (piece.strip() for piece in text.partition("="))
        if not (name and equals and location):
            raise ValueError(
                f"--spot is {text!r}; write NAME=x,y, NAME=x0:x1,y0:y1 or NAME=mask.png"
            )
        if name in locations or name in paint_names:
            raise ValueError(
                f"--spot {text}: there is a paint {name!r} already; choose another name"
            )
        locations[name] = location
    return locations


def read_spectra_of_spots(
    locations: Mapping[str, str], cube: "xarray.DataArray"
) -> "dict[str, Float[np.ndarray, 'bands']]":
    """Mean spectra of spots by name, at all bands of a cube.

    Args:
        locations: by name; see `glazejax.io.read_spot`.
        cube: as it was opened.

    Raises:
        FileNotFoundError: neither a place nor a file.
        ValueError: a place outside of the cube, or without readings at some bands.
    """
    import numpy as np

    from glazejax.io import read_spot

    spectra = {}
    for name, location in locations.items():
        spectrum = read_spot(cube, location).reflectance
        if (missing := int((~np.isfinite(spectrum)).sum())) > 0:
            raise ValueError(
                f"--spot {name}={location}: {missing} bands have no reading there; choose another "
                "place, or leave those bands out with --bands"
            )
        spectra[name] = spectrum
    return spectra


def read_ground_of_cube(
    text: str | None,
    bare: bool,
    cube: "xarray.DataArray",
    paints: Sequence["Pigment"],
    instrument: "Instrument",
) -> tuple["Float[np.ndarray, 'bands'] | None", str, tuple[str, ...]]:
    """The ground below all pixels, as seen from inside the paint, at the bands of a cube; its
    words, and notes.

    Args:
        text: of ``--ground``: a number, a file of spectra, or ``cube:`` and a place in the cube
            where the ground lies bare; None for films that hide it.
        bare: a number or file is what the instrument reads from the bare ground, in air.
        cube: as it was opened.
        paints: beyond whose wavelengths the ground need not be known.
        instrument: with which the cube was taken.

    Raises:
        FileNotFoundError: neither a number nor a file.
        ValueError: values out of range, or no common wavelengths.
    """
    import numpy as np

    from glazejax.spectra import describe_grid

    from ..film.films import ground_from_air
    from .solve.image import used_range

    if text is None:
        return None, "a ground that is not seen", ()
    grid = np.asarray(cube["wavelength"].values, np.float64)
    first, last = used_range(paints)
    within = (grid >= first) & (grid <= last)
    used = grid[within]
    if not used.size:
        raise ValueError(
            f"{cube.attrs.get('path', 'the cube')}: its bands ({describe_grid(grid)}) lie outside "
            f"of those of the paints, {first:g} to {last:g} nm"
        )
    notes: tuple[str, ...] = ()
    if text.startswith(CUBE):
        from glazejax.io import read_spot

        spot = read_spot(cube, text.removeprefix(CUBE))
        below = spot.reflectance[within]
        bare = True
        if not np.isfinite(below).all():
            raise ValueError(
                f"--ground {text}: {int((~np.isfinite(below)).sum())} bands have no reading "
                "there; choose another place"
            )
        description = (
            f"measured bare in the cube at {text.removeprefix(CUBE)} ({spot.pixels} pixels, "
            f"mean {below.mean():.2f})"
        )
    else:
        stated = options.read_ground(text, bare=bare)
        below = stated.on(used)
        notes = stated.notes
        how = "measured bare with the same instrument" if bare else "as seen from inside the paint"
        description = f"{stated.words}, {how}"
    spectrum = np.broadcast_to(below, used.shape)
    if bare:
        spectrum = ground_from_air(spectrum, instrument)
    # Where no paint is known, no ground is asked for.
    return np.interp(grid, used, spectrum), description, notes
