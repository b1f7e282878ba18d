"""Lights of a scene, and spectra of lamps: CIE illuminants through colour-science, and measured
ones from files.

A band gets the mean of the lamp around it (weighted by a triangle that reaches to the next bands),
so that the narrow lines of a fluorescent lamp are not missed between two bands. All lamps are
brought to luminance 1: a perfect white that faces a lamp of strength 1 has Y = 1.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from ...cie import illuminants
from ...colour import colour_weights, find_illuminant
from ...spectra import Bands, Grid, Numbers, describe_grid, validate_wavelengths
from .shapes import Plane, Shape, Sphere, vector


@dataclass(frozen=True)
class ParallelLight:
    """Light from afar.

    Args:
        direction: the way the light travels.
        spectrum: (bands,), radiance of a perfect white that faces it; see `lamp` and
            `measured_lamp`.
    """

    direction: Numbers
    spectrum: Numbers

    def __post_init__(self) -> None:
        vector("direction", self.direction, direction=True)


@dataclass(frozen=True)
class PointLight:
    """Light from a point, weaker with the square of the distance.

    Args:
        position: where it is.
        spectrum: (bands,), radiance of a perfect white that faces it one unit of length away.
    """

    position: Numbers
    spectrum: Numbers

    def __post_init__(self) -> None:
        vector("position", self.position)


@dataclass(frozen=True)
class AreaLight:
    """A thing that shines: a window, a lamp's globe. Shadows under it are soft. For `path_trace`
    alone.

    Args:
        shape: a rectangle (`Plane` with a size), which shines to the side of its normal and is
            black behind, or a
            `Sphere`. Its material plays no part.
        spectrum: (bands,), radiance of the shining surface: with that of `lamp` at strength 1 it
            looks as bright as a perfect white that faces a light of strength 1.

    Raises:
        ValueError: another shape, or a plane without a size.
    """

    shape: Shape
    spectrum: Numbers

    def __post_init__(self) -> None:
        if isinstance(self.shape, Plane):
            if self.shape.size is None:
                raise ValueError(
                    "an area light needs a size, its width and height: an endless plane cannot "
                    "shine"
                )
            if self.shape.relief is not None:
                raise ValueError("an area light is flat: leave its relief out")
        elif not isinstance(self.shape, Sphere):
            raise ValueError(
                f"an area light is a rectangle or a sphere, not a {type(self.shape).__name__}"
            )


Light = ParallelLight | PointLight | AreaLight
"""What a scene is lit by."""


def lamp(name: str, wavelengths: Grid, strength: float = 1.0) -> Bands:
    """Spectrum of a CIE illuminant such as D65, A, FL2 or LED-B3.

    Args:
        name: see `glazejax.colour.find_illuminant`.
        wavelengths: (bands,), nm.
        strength: luminance of a perfect white that faces it.

    Raises:
        ValueError: an unknown name, bands beyond the lamp's table or a grid too coarse for colour.
    """
    full = find_illuminant(name)
    table = illuminants()[full]
    return lamp_on_bands(
        table.wavelengths, table.values, wavelengths, strength, words=f"the illuminant {full}"
    )


def measured_lamp(text: str | Path, wavelengths: Grid, strength: float = 1.0) -> Bands:
    """Spectrum of a lamp from a text table: wavelengths in a column and a lamp in each other one,
    names on top, or a lamp a row (`glazejax.io.formats.table.read_table`).

    Args:
        text: FILE.csv, or FILE.csv:NAME where it holds several. Any unit of power; the scale does
            not matter.
        wavelengths, strength: as for `lamp`.

    Raises:
        FileNotFoundError: no such file.
        ValueError: it is no such table, the name is not in it, or it does not cover the bands.
    """
    from ...io.files.sample import split_sample
    from ...io.formats.table import read_table
    from ...io.quantity import nanometres
    from ...io.source import naming, open_source, show_path
    from ...io.spectra_table import row_of

    path, name = split_sample(str(text))
    with open_source(
        path, missing=f"there is no file {show_path(path)} with the spectrum of a lamp"
    ) as source:
        raw = read_table(source)
    with naming(path):
        row = row_of(raw.names, name, "the file", f"{path}:", "lamp")
        bands, _ = nanometres(raw.wavelengths, raw.wavelength_unit)
        order = np.argsort(bands)
        bands = bands[order]
        power = raw.values[row, order]
        wrong = ~np.isfinite(power)
        if wrong.any():
            raise ValueError(f"the lamp lacks a number at {bands[wrong][0]:g} nm")
    return lamp_on_bands(bands, power, wavelengths, strength, words=f"the lamp in {path}")


def lamp_on_bands(
    own: Float[np.ndarray, "samples"],
    values: Float[np.ndarray, "samples"],
    wavelengths: Grid,
    strength: float = 1.0,
    *,
    words: str = "the lamp",
) -> Bands:
    """Mean power of a lamp around each band, scaled to a luminance.

    Args:
        own, values: the lamp's own table, nm and any unit of power.
        wavelengths: (bands,), nm.
        strength: luminance of a perfect white that faces it, by the CIE 1931 observer.
        words: what the errors call it.

    Raises:
        ValueError: the table does not cover the bands, or holds negative or no power.
    """
    grid = validate_wavelengths(wavelengths)
    if own[0] > grid[0] or own[-1] < grid[-1]:
        raise ValueError(
            f"{words} is known at {describe_grid(own)} only, but the scene has "
            f"{describe_grid(grid)}"
        )
    if not np.all(values >= 0) or not np.any(values > 0):
        raise ValueError(f"{words} must have power above 0 and nowhere below, not {values.min():g}")
    # Of a lamp, in its own unit: beyond it sums over bands leave the range of numbers.
    if values.max() > 1e250:
        raise ValueError(
            f"{words} has a power of {values.max():g}, where sums overflow; give it in another unit"
        )
    steps = np.diff(grid) if grid.size > 1 else np.array([1.0])
    # The outermost bands reach outwards as far as inwards; there the lamp's last value is repeated
    # if need be.
    outer = np.concatenate([[grid[0] - steps[0]], grid, [grid[-1] + steps[-1]]])
    # 1 nm is fine enough for every table of lamps there is. With the bands themselves, a narrow one
    # that has no whole number around it still has a value.
    fine = np.union1d(np.arange(np.floor(outer[0]), np.ceil(outer[-1]) + 1.0), grid)
    power = np.interp(fine, own, values)
    hats = np.stack([np.interp(fine, outer, hat) for hat in np.eye(outer.size)[1:-1]])
    # Each sample counts for the wavelengths that are nearest to it.
    hats *= np.gradient(fine)
    bands = (hats @ power) / hats.sum(axis=1)
    luminance = float(bands @ colour_weights(grid, "E")[:, 1])
    return strength * bands / luminance
