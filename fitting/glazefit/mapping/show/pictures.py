"""Pictures of a map: true colour, legend of sets, and a coloured picture of each number, for pages
and as PNG files.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from jaxtyping import Float, UInt8

from glazejax.extras import require
from glazejax.plots import FAINT, INK, picture

from ..store.layout import Status
from .legend import BLANK, OTHERS, STRIPES, rgb
from .overview import Overview

if TYPE_CHECKING:
    import xarray as xr

UNKNOWN = "#c4c4c4"
"""Colour where a number is not known in its map."""

RGB = UInt8[np.ndarray, "rows columns 3"]


class MapPicture(NamedTuple):
    """One number over the picture, and the colours that it becomes from 0 to `high`."""

    key: str
    title: str
    values: Float[np.ndarray, "rows columns"]
    caption: str = ""
    colours: str = "viridis"  # a colour map of matplotlib
    high: float = 1.0
    unit: str = ""


def legend_map(look: Overview) -> RGB:
    """Sets by colour; stripes where nothing in the catalogue explains a pixel, white where none was
    mapped.
    """
    status = look.examples["status"]
    image = np.full((*status.shape, 3), rgb(BLANK), np.uint8)
    image[(status == Status.MAPPED) & (look.examples["explained"] > 0)] = rgb(OTHERS)
    for members, colour in zip(look.shown, look.legend_colours, strict=True):
        image[look.where(members)] = rgb(colour)
    image = enlarge(image)
    none = enlarge(look.where(()))
    down, across = np.indices(none.shape)
    stripes = np.array([rgb(stripe) for stripe in STRIPES], np.uint8)[(down + across) // 4 % 2]
    image[none] = stripes[none]
    return image


def legend_places(look: Overview) -> dict[int, tuple[float, float]]:
    """Places of the numbers of the legend's sets, from 1: x and y from 0 to 1, in the middle of the
    set's densest area.
    """
    from scipy.ndimage import uniform_filter

    positions = {}
    for n, members in enumerate(look.shown, start=1):
        area = look.where(members)
        if not area.any():
            continue
        # Means over squares are dense in the midst of an area, whatever its outline.
        size = max(3, min(area.shape) // 12) // 2
        near, far = (
            uniform_filter(area.astype(float), 2 * half + 1, mode="constant")
            for half in (size, 3 * size)
        )
        density = np.where(area, near + 1e-3 * far, -1.0)
        y, x = np.unravel_index(int(density.argmax()), area.shape)
        positions[n] = ((x + 0.5) / area.shape[1], (y + 0.5) / area.shape[0])
    return positions


def numbers_of(look: Overview) -> list[MapPicture]:
    """Maps of numbers that hold for the whole film; one that is nowhere known has none."""
    means = look.means
    thick = means["thickness"] * 1e6
    thick_sd = means["thickness_sd"] * 1e6
    number_maps = [
        MapPicture(
            key="probability",
            title="How sure: probability of the most probable set",
            caption="Low where several sets explain a pixel about as well.",
            values=means["probability"],
        ),
        MapPicture(
            key="none",
            title="None of these paints",
            caption="Probability that no paints of the catalogue explain a pixel.",
            values=means["none"],
        ),
        MapPicture(
            key="thickness",
            title="Thickness",
            caption=(
                "Grey where it is not known: the film hides its ground, or no paints explain it."
            ),
            values=thick,
            high=_top(thick, 98.0, 1.0),
            unit="µm",
        ),
        MapPicture(
            key="thickness_sd",
            title="Thickness: its standard deviation",
            caption="How well the thickness is known, if the film is of these paints.",
            values=thick_sd,
            high=_top(thick_sd, 98.0, 0.1),
            unit="µm",
        ),
        MapPicture(
            key="misfit",
            title="Misfit",
            caption=(
                "Colour difference between what was measured and the best candidates: below 1 "
                "nobody sees it."
            ),
            values=means["misfit"],
            colours="inferno",
            high=max(2.0, _top(means["misfit"], 99.5, 0.1)),
            unit="ΔE00",
        ),
        MapPicture(
            key="rmse",
            title="Misfit of the spectra",
            caption="Root mean square of measured less fitted reflectance.",
            values=means["rmse"],
            colours="inferno",
            high=_top(means["rmse"], 99.5, 0.001),
        ),
    ]
    return [number_map for number_map in number_maps if np.isfinite(number_map.values).any()]


def paint_pictures(look: Overview, paint: int) -> list[MapPicture]:
    """Maps of one paint: its probability, and its amount, or its share where films hide their
    ground.
    """
    name = look.paints[paint]
    stem = look.file_stems[paint]
    probability = MapPicture(
        key=f"{stem}_probability",
        title=f"{name}: probability",
        values=look.paint_probability[..., paint],
        colours="magma_r",
    )
    share = look.paint_share[..., paint]
    amount = look.paint_amount[..., paint] * 1e6
    hidden = np.isnan(amount[share > 0])
    if hidden.sum() > 0.5 * hidden.size:
        quantity = MapPicture(
            key=f"{stem}_share",
            title=f"{name}: share by mass",
            values=share,
            colours="magma_r",
        )
    else:
        quantity = MapPicture(
            key=f"{stem}_amount",
            title=f"{name}: amount",
            values=amount,
            colours="magma_r",
            high=_top(amount[amount > 0], 98.0, 0.1),
            unit="µm",
        )
    return [probability, quantity]


def found_paints(look: Overview, least: float = 0.0005) -> list[int]:
    """Paints that are likely in at least so small a share of the mapped pixels, the most frequent
    first.
    """
    most = np.maximum(look.likely, look.in_set)
    return [
        int(p)
        for p in np.argsort(-most, kind="stable")
        if most[p] > 0 and most[p] >= least * look.mapped
    ]


def colour_numbers(number_map: MapPicture) -> RGB:
    """A number as a picture; grey where there is none."""
    values = np.ma.masked_invalid(number_map.values)
    return enlarge(_shades(number_map).to_rgba(values, bytes=True)[..., :3])


def _shades(number_map: MapPicture) -> Any:
    """Colours of numbers, as matplotlib has them."""
    require("matplotlib")
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    colours = colormaps[number_map.colours].with_extremes(bad=UNKNOWN)
    return ScalarMappable(Normalize(0.0, number_map.high), colours)


def false_colour(cube: "xr.DataArray", step: int = 1) -> tuple[RGB, str]:
    """A picture of three bands that a camera or an eye would not show so, each stretched to its own
    range.

    Args:
        cube: dims y, x, wavelength.
        step: every so many pixels one is shown.

    Returns:
        The picture, and in words which bands are red, green and blue in it.
    """
    grid = np.asarray(cube["wavelength"].values, float)
    # Infrared false colour as conservators know it, if the cube has infrared; else the ends and
    # middle of its range.
    centres = (
        (900.0, 650.0, 550.0)
        if grid[-1] >= 800
        else (grid[-1] - 10, 0.5 * (grid[0] + grid[-1]), grid[0] + 30)
    )
    bands = [int(np.abs(grid - centre).argmin()) for centre in centres]
    shown = slice(step // 2, None, step)
    channels = []
    for band in bands:
        values = np.asarray(cube.isel(y=shown, x=shown, wavelength=band))
        low, high = np.nanpercentile(values, (1, 99)) if np.isfinite(values).any() else (0.0, 1.0)
        stretched = np.nan_to_num(np.clip((values - low) / max(high - low, 1e-6), 0, 1), nan=1.0)
        channels.append((stretched * 255).round().astype(np.uint8))
    description = ", ".join(
        f"{name} {grid[b]:.0f} nm" for name, b in zip(("red", "green", "blue"), bands, strict=True)
    )
    return enlarge(np.stack(channels, axis=-1)), description


def enlarge(image: np.ndarray) -> np.ndarray:
    """Every pixel as a square, if there are so few that a page would blur them."""
    # Pictures below this width are shown with larger squares.
    times = -(-640 // image.shape[1])
    return image.repeat(times, axis=0).repeat(times, axis=1)


def write_pictures(
    look: Overview,
    folder: Path,
    numbers: Sequence[MapPicture],
    plain: Sequence[tuple[str, str, RGB]],
) -> None:
    """Write each picture as a PNG with its title and scale.

    Args:
        look: the map.
        folder: exists.
        numbers: maps of numbers.
        plain: further pictures, each with the name of its file and a title.
    """
    for name, title, image in (("true_colour", "True colour (D65)", enlarge(look.colour)), *plain):
        with _frame(folder / f"{name}.png", title, image):
            pass
    _write_legend(look, folder / "sets.png")
    for number_map in numbers:
        image = colour_numbers(number_map)
        with _frame(folder / f"{number_map.key}.png", number_map.title, image, 0.9) as axes:
            bar = axes.figure.colorbar(_shades(number_map), ax=axes, shrink=0.8)
            bar.outline.set_visible(False)
            bar.ax.tick_params(labelsize=8)
            bar.ax.set_title(number_map.unit, fontsize=8, color=FAINT)


@contextmanager
def _frame(
    path: Path, title: str, image: RGB, room: float = 0.0, least: float = 0.0
) -> Iterator[Any]:
    """Axes with an image and its title, written at the end.

    Args:
        path: of the file.
        title: above the image.
        image: eight inches wide.
        room: on its right, inches.
        least: height of the figure, inches.
    """
    height = 8.0 * image.shape[0] / image.shape[1] + 0.4
    with picture(path, 8.0 + room, max(height, least)) as figure:
        axes = figure.subplots()
        axes.imshow(image, interpolation="antialiased")
        axes.set_axis_off()
        axes.set_title(title, loc="left")
        yield axes


def _write_legend(look: Overview, path: Path) -> None:
    from matplotlib.legend_handler import HandlerTuple
    from matplotlib.patches import Patch

    def patch(**look_of: Any) -> Any:
        return Patch(ec=STRIPES[0], lw=0.4, **look_of)

    # Each set with its colour in the legend and its own.
    rows = [
        (
            f"{n}  {look.words(members)}",
            (patch(fc=colour), patch(fc=mixed)),
            look.sets[members].pixels,
        )
        for n, (members, colour, mixed) in enumerate(
            zip(look.shown, look.legend_colours, look.own_colours, strict=True), start=1
        )
    ]
    remaining = sum(look.sets[members].pixels for members in look.ranked[len(look.shown) :])
    none = look.mapped - look.explained
    rows += [("further sets", (patch(fc=OTHERS),), remaining)] if remaining else []
    rows += [(look.words(()), (patch(fc=STRIPES[1], hatch="/////"),), none)] if none else []
    title = "Most probable set of paints"
    with _frame(path, title, legend_map(look), 4.2, 0.5 + 0.2 * len(rows)) as axes:
        for n, (x, y) in legend_places(look).items():
            axes.text(
                x,
                1.0 - y,
                str(n),
                transform=axes.transAxes,
                ha="center",
                va="center",
                fontsize=8,
                bbox={"boxstyle": "circle,pad=.25", "fc": "white", "ec": INK, "lw": 0.6},
            )
        axes.figure.legend(
            [handles for _, handles, _ in rows],
            [f"{words}  ({count / max(look.mapped, 1):.1%})" for words, _, count in rows],
            handler_map={tuple: HandlerTuple(ndivide=None)},
            loc="outside right upper",
            fontsize=7.5,
        )


def _top(values: np.ndarray, percentile: float, least: float) -> float:
    """Upper end of a scale: a round number that most values stay below."""
    finite = values[np.isfinite(values)]
    top = max(float(np.percentile(finite, percentile)) if finite.size else least, least)
    unit = 10.0 ** np.floor(np.log10(top))
    return float(
        next(unit * step for step in (1, 1.5, 2, 3, 4, 5, 6, 8, 10) if unit * step >= top * 0.999)
    )
