"""Pictures of a map: true colour, legend of sets, and a coloured picture of each number, for pages
and as PNG files.
"""

import io
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, UInt8

from glazejax.extras import require
from glazejax.plots import FAINT, INK, hex_colour, picture

from ..store.chunk import Members
from ..store.layout import Status
from .legend import BLANK, OTHERS, STRIPES, legend_colours
from .overview import Overview

if TYPE_CHECKING:
    import xarray as xr

UNKNOWN = "#c4c4c4"
"""Colour where a number is not known in its map."""

RGB = UInt8[np.ndarray, "rows columns 3"]


class Scale(NamedTuple):
    """Scale by which a number becomes a colour."""

    colours: str  # a colour map of matplotlib
    low: float
    high: float
    unit: str = ""


class MapPicture(NamedTuple):
    """One number over the picture."""

    key: str
    title: str
    caption: str
    values: Float[np.ndarray, "rows columns"]
    scale: Scale


def set_colours(look: Overview) -> list[str]:
    """Colours of these sets in the legend, each like the set itself."""
    return legend_colours(own_colours(look))


def legend_map(look: Overview) -> RGB:
    """Sets by colour; stripes where nothing in the catalogue explains a pixel, white where none was
    mapped.
    """
    status = look.examples["status"]
    image = np.full((*status.shape, 3), rgb(BLANK), np.uint8)
    image[(status == Status.MAPPED) & (look.examples["explained"] > 0)] = rgb(OTHERS)
    for members, colour in zip(look.shown, set_colours(look), strict=True):
        image[look.where(members)] = rgb(colour)
    image = enlarge(image)
    none = enlarge(look.where(()))
    down, across = np.indices(none.shape)
    stripes = np.array([rgb(stripe) for stripe in STRIPES], np.uint8)[(down + across) // 4 % 2]
    image[none] = stripes[none]
    return image


def legend_places(look: Overview) -> dict[Members, tuple[float, float]]:
    """Position of the number of each set of the legend: x and y from 0 to 1, in the middle of the
    set's densest area.
    """
    positions = {}
    for members in look.shown:
        area = look.where(members)
        if not area.any():
            continue
        # Means over squares are dense in the midst of an area, whatever its outline.
        size = max(3, min(area.shape) // 12) // 2
        density = np.where(area, _box(area, size) + 1e-3 * _box(area, 3 * size), -1.0)
        y, x = np.unravel_index(int(density.argmax()), area.shape)
        positions[members] = ((x + 0.5) / area.shape[1], (y + 0.5) / area.shape[0])
    return positions


def _box(area: Bool[np.ndarray, "rows columns"], half: int) -> Float[np.ndarray, "rows columns"]:
    """Share of the square about each pixel."""
    sums = np.pad(area.astype(float), half + 1).cumsum(axis=0).cumsum(axis=1)[:, :]
    side = 2 * half + 1
    total = sums[side:, side:] - sums[:-side, side:] - sums[side:, :-side] + sums[:-side, :-side]
    return total[: area.shape[0], : area.shape[1]] / side**2


def numbers_of(look: Overview) -> list[MapPicture]:
    """Maps of numbers that hold for the whole film; one that is nowhere known has none."""
    means = look.means
    thick = means["thickness"] * 1e6
    top = _top(thick, 98.0, 1.0)
    number_maps = [
        MapPicture(
            key="probability",
            title="How sure: probability of the most probable set",
            caption="Low where several sets explain a pixel about as well.",
            values=means["probability"],
            scale=Scale("viridis", 0.0, 1.0),
        ),
        MapPicture(
            key="none",
            title="None of these paints",
            caption="Probability that no paints of the catalogue explain a pixel.",
            values=means["none"],
            scale=Scale("viridis", 0.0, 1.0),
        ),
        MapPicture(
            key="thickness",
            title="Thickness",
            caption=(
                "Grey where it is not known: the film hides its ground, or no paints explain it."
            ),
            values=thick,
            scale=Scale("viridis", 0.0, top, "µm"),
        ),
        MapPicture(
            key="thickness_sd",
            title="Thickness: its standard deviation",
            caption="How well the thickness is known, if the film is of these paints.",
            values=means["thickness_sd"] * 1e6,
            scale=Scale("viridis", 0.0, _top(means["thickness_sd"] * 1e6, 98.0, 0.1), "µm"),
        ),
        MapPicture(
            key="misfit",
            title="Misfit",
            caption=(
                "Colour difference between what was measured and the best candidates: below 1 "
                "nobody sees it."
            ),
            values=means["misfit"],
            scale=Scale("inferno", 0.0, max(2.0, _top(means["misfit"], 99.5, 0.1)), "ΔE00"),
        ),
        MapPicture(
            key="rmse",
            title="Misfit of the spectra",
            caption="Root mean square of measured less fitted reflectance.",
            values=means["rmse"],
            scale=Scale("inferno", 0.0, _top(means["rmse"], 99.5, 0.001)),
        ),
    ]
    return [number_map for number_map in number_maps if np.isfinite(number_map.values).any()]


def paint_pictures(look: Overview, paint: int) -> list[MapPicture]:
    """Maps of one paint: its probability, and its amount, or its share where films hide their
    ground.
    """
    name = look.paints[paint]
    first = MapPicture(
        key=f"{file_stem(name)}_probability",
        title=f"{name}: probability",
        caption="",
        values=look.paint_probability[..., paint],
        scale=Scale("magma_r", 0.0, 1.0),
    )
    amount = look.paint_amount[..., paint] * 1e6
    share = look.paint_share[..., paint]
    with np.errstate(invalid="ignore"):
        unknown = np.sum(np.isnan(amount) & (share > 0)) > 0.5 * np.sum(share > 0)
    top = _top(np.where(amount > 0, amount, np.nan), 98.0, 0.1)
    second = MapPicture(
        key=f"{file_stem(name)}_{'share' if unknown else 'amount'}",
        title=f"{name}: {'share by mass' if unknown else 'amount'}",
        caption="",
        values=share if unknown else amount,
        scale=Scale("magma_r", 0.0, 1.0) if unknown else Scale("magma_r", 0.0, top, "µm"),
    )
    return [first, second]


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
    require("matplotlib")
    from matplotlib import colormaps

    scale = number_map.scale
    values = np.nan_to_num((number_map.values - scale.low) / max(scale.high - scale.low, 1e-30))
    image = (
        (colormaps[scale.colours](np.clip(values, 0, 1))[..., :3] * 255.0).round().astype(np.uint8)
    )
    image[~np.isfinite(number_map.values)] = rgb(UNKNOWN)
    return enlarge(image)


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
    channels = []
    for band in bands:
        values = np.asarray(
            cube.isel(
                y=slice(step // 2, None, step), x=slice(step // 2, None, step), wavelength=band
            )
        )
        low, high = np.nanpercentile(values, (1, 99)) if np.isfinite(values).any() else (0.0, 1.0)
        stretched = np.nan_to_num(np.clip((values - low) / max(high - low, 1e-6), 0, 1), nan=1.0)
        channels.append((stretched * 255).round().astype(np.uint8))
    description = ", ".join(
        f"{name} {grid[b]:.0f} nm" for name, b in zip(("red", "green", "blue"), bands, strict=True)
    )
    return enlarge(np.stack(channels, axis=-1)), description


def png(image: RGB) -> bytes:
    """A picture as the bytes of a PNG."""
    require("PIL")
    from PIL import Image

    file = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(image)).save(file, "PNG", optimize=True)
    return file.getvalue()


def enlarge(image: np.ndarray) -> np.ndarray:
    """Every pixel as a square, if there are so few that a page would blur them."""
    # Pictures below this width are shown with larger squares.
    times = -(-640 // image.shape[1])
    return image if times == 1 else image.repeat(times, axis=0).repeat(times, axis=1)


def write_pictures(
    look: Overview,
    folder: Path,
    numbers: Sequence[MapPicture],
    *,
    colours: Sequence[str],
    plain: Sequence[tuple[str, str, RGB]] = (),
) -> list[Path]:
    """Write each picture as a PNG with its title and scale.

    Args:
        look: the map.
        folder: exists.
        numbers: maps of numbers.
        colours: colours of the sets of the legend themselves.
        plain: further pictures, each with the name of its file and a title.
    """
    written = []
    for name, title, image in (("true_colour", "True colour (D65)", enlarge(look.colour)), *plain):
        written.append(folder / f"{name}.png")
        with _frame(written[-1], title, image):
            pass
    written.append(folder / "sets.png")
    _write_legend(look, written[-1], colours)
    for number_map in numbers:
        written.append(folder / f"{number_map.key}.png")
        with _frame(written[-1], number_map.title, colour_numbers(number_map), 0.9) as figure:
            _add_scale(figure, number_map.scale)
    return written


@contextmanager
def _frame(path: Path, title: str, image: RGB, room: float = 0.0) -> Iterator[Any]:
    """A figure with an image, at one pixel a dot as far as its width allows; written at the end."""
    width = 8.0
    height = width * image.shape[0] / image.shape[1]
    tall = height + 0.4
    with picture(path, width + room, tall, layout=None) as figure:
        axes = figure.add_axes((0, 0, width / (width + room), height / tall))
        axes.imshow(image, interpolation="antialiased", aspect="auto")
        axes.set_axis_off()
        figure.text(0.008, 1 - 0.2 / tall, title, fontsize=10, color=INK, va="center")
        yield figure


def _add_scale(figure: Any, scale: Scale) -> None:
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    width = figure.get_figwidth()
    axes = figure.add_axes((8.12 / width, 0.03, 0.16 / width, 0.8))
    bar = figure.colorbar(ScalarMappable(Normalize(scale.low, scale.high), scale.colours), cax=axes)
    bar.outline.set_visible(False)
    bar.ax.tick_params(labelsize=8)
    bar.ax.set_title(scale.unit, fontsize=8, color=FAINT)


def _write_legend(look: Overview, path: Path, colours: Sequence[str]) -> None:
    from matplotlib.patches import Rectangle

    with _frame(path, "Most probable set of paints", legend_map(look), 4.2) as figure:
        positions = legend_places(look)
        width = figure.get_figwidth()
        tall = figure.get_figheight()
        picture_axes = figure.axes[0]
        size = enlarge(look.examples["status"]).shape
        for n, members in enumerate(look.shown, start=1):
            if members in positions:
                x, y = positions[members]
                picture_axes.text(
                    x * size[1],
                    y * size[0],
                    str(n),
                    ha="center",
                    va="center",
                    fontsize=8,
                    color=INK,
                    bbox={"boxstyle": "circle,pad=.25", "fc": "white", "ec": INK, "lw": 0.6},
                )
        axes = figure.add_axes((8.15 / width, 0, 4.0 / width, 1))
        axes.set(xlim=(0, 4.0), ylim=(tall, 0))
        axes.set_axis_off()
        rows = [
            (f"{n}  {look.words(m)}", colour, mixed, look.sets[m])
            for n, (m, colour, mixed) in enumerate(
                zip(look.shown, set_colours(look), colours, strict=True), start=1
            )
        ]
        remaining = sum(look.sets[m] for m in look.ranked[len(look.shown) :])
        rows += [("further sets", OTHERS, None, remaining)] if remaining else []
        rows += [("none of these paints", None, None, look.sets[()])] if look.sets.get(()) else []
        high = min(0.34, (tall - 0.3) / max(len(rows), 1))
        for row, (label, colour, mixed, count) in enumerate(rows):
            y = 0.25 + row * high
            hatch: dict[str, Any] = (
                {"hatch": "/////", "fc": STRIPES[1]} if colour is None else {"fc": colour}
            )
            axes.add_patch(Rectangle((0, y), 0.28, 0.7 * high, ec=STRIPES[0], lw=0.4, **hatch))
            if mixed is not None:
                axes.add_patch(
                    Rectangle((0.32, y), 0.28, 0.7 * high, fc=mixed, ec=STRIPES[0], lw=0.4)
                )
            label = f"{label}  ({count / max(look.mapped, 1):.1%})"
            axes.text(
                0.68, y + 0.35 * high, label, fontsize=min(7.5, 24 * high), va="center", color=INK
            )


def own_colours(look: Overview) -> list[str]:
    """True colour of the sets that are shown, the mean over the pixels of each."""
    return [_mean_colour(look, look.where(members)) for members in look.shown]


def _mean_colour(look: Overview, area: Bool[np.ndarray, "rows columns"]) -> str:
    if not area.any():
        return hex_colour(np.ones(3))
    # Light adds, encoded values do not; the square is near enough to sRGB's curve for a swatch.
    return hex_colour(np.sqrt(np.mean((look.colour[area] / 255.0) ** 2, axis=0)))


def _top(values: np.ndarray, percentile: float, least: float) -> float:
    """Upper end of a scale: a round number that most values stay below."""
    finite = values[np.isfinite(values)]
    top = max(float(np.percentile(finite, percentile)) if finite.size else least, least)
    unit = 10.0 ** np.floor(np.log10(top))
    return float(
        next(unit * step for step in (1, 1.5, 2, 3, 4, 5, 6, 8, 10) if unit * step >= top * 0.999)
    )


def file_stem(name: str) -> str:
    """A paint's name as part of a file's."""
    return "".join(c if c.isalnum() or c in "-_" else "_" for c in name)


def rgb(colour: str) -> tuple[int, int, int]:
    """Red, green and blue of #rrggbb, 0 to 255."""
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)
