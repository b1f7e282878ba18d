"""A map seen from afar: counts of every pixel, and arrays small enough to look at, in one pass over
the store.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from glazejax.plots import hex_colour

from ..store.chunk import Members, SetSums
from ..store.layout import Status
from .legend import MOST_SETS, legend_colours
from .names import file_stems, paint_names, set_words

if TYPE_CHECKING:
    import xarray as xr

MOST = (1600, 1200)
"""Rows and columns of the largest picture that is shown."""
LEAST = 0.01
"""Share of the mapped pixels from which a set is shown by itself."""

# Pixels looked at together, for memory.
_PIXELS = 2**20
_MEANS = (
    "probability",
    "none",
    "thickness",
    "thickness_sd",
    "misfit",
    "rmse",
)
_EXAMPLES = ("members", "fraction", "explained", "probability", "thickness", "status")


@dataclass
class Overview:
    """Counts and small arrays from which pictures and pages of a map are made.

    Attributes:
        shape: (y, x) of the map.
        step: so many pixels a side are one of the pictures.
        paints: their names, by number.
        sets: sums over the pixels of each set, by its members ascending; () where nothing in the
            catalogue explains them.
        means: by name, (rows, columns), means over the mapped pixels of each square, of thickness
            over those that a set explains; NaN where there are none.
        paint_probability, paint_amount, paint_share: (rows, columns, paints), coarser means; amount
            in m.
        examples: by name, (rows, columns, ...), the pixel in the middle of each square.
        colour: true colour, (rows, columns, 3).
        likely: of each paint, pixels that have it with a probability above one half.
        pixel_area: of one pixel, m2, or None if the map does not say.
    """

    shape: tuple[int, int]
    step: int
    paints: tuple[str, ...]
    sets: SetSums
    means: dict[str, Float[np.ndarray, "rows columns"]]
    paint_probability: Float[np.ndarray, "r c paints"]
    paint_amount: Float[np.ndarray, "r c paints"]
    paint_share: Float[np.ndarray, "r c paints"]
    examples: dict[str, np.ndarray]
    colour: UInt8[np.ndarray, "rows columns 3"]
    likely: Int[np.ndarray, "paints"]
    pixel_area: float | None

    @property
    def mapped(self) -> int:
        """Pixels that were mapped."""
        return mapped_pixels(self.sets)

    @property
    def explained(self) -> int:
        """Pixels that a set of the catalogue explains."""
        return sum(self.sets[members].pixels for members in self.ranked)

    @cached_property
    def in_set(self) -> Int[np.ndarray, "paints"]:
        """Of each paint, pixels whose most probable set has it."""
        counts = np.zeros(len(self.paints), int)
        for members, sums in self.sets.items():
            counts[list(members)] += sums.pixels
        return counts

    @cached_property
    def file_stems(self) -> list[str]:
        """Names of the paints as parts of files' names."""
        return file_stems(self.paints)

    @cached_property
    def ranked(self) -> list[Members]:
        """Sets by their area, largest first, without the one that is none."""
        return [members for members in self.sets if members]

    @cached_property
    def shown(self) -> list[Members]:
        """Those of them that have a row and a colour of their own."""
        return shown_sets(self.sets)

    @cached_property
    def own_colours(self) -> list[str]:
        """True colour of the sets that are shown, the mean over the pixels of each."""
        colours = []
        for members in self.shown:
            pixels = self.colour[self.where(members)] / 255.0
            # Light adds, encoded values do not; the square is near enough to sRGB's curve for a
            # swatch.
            mean = np.sqrt(np.mean(pixels**2, axis=0)) if len(pixels) else np.ones(3)
            colours.append(hex_colour(mean))
        return colours

    @cached_property
    def legend_colours(self) -> list[str]:
        """Colours of these sets in the legend, each like the set itself."""
        return legend_colours(self.own_colours)

    def words(self, members: Members) -> str:
        """Names of a set's paints."""
        return set_words(members, self.paints) or "none of these paints"

    def where(self, members: Members) -> Bool[np.ndarray, "rows columns"]:
        """Pixels of `examples` that have a set."""
        return pixels_with(members, self.examples)


def pixels_with(
    members: Members, pixels: Mapping[str, np.ndarray]
) -> Bool[np.ndarray, "rows columns"]:
    """True for mapped pixels whose most probable set is this one; () for none of the paints.

    Args:
        members: of the set, ascending.
        pixels: arrays `status`, `explained`, and `members` with those that are none last.
    """
    mapped = pixels["status"] == Status.MAPPED
    explained = pixels["explained"] > 0
    if not members:
        return mapped & ~explained
    padded = (*members, *([-1] * (pixels["members"].shape[-1] - len(members))))
    return mapped & explained & (pixels["members"] == np.array(padded)).all(axis=-1)


def mapped_pixels(sets: SetSums) -> int:
    """Pixels of all sets, and of none."""
    return sum(sums.pixels for sums in sets.values())


def shown_sets(sets: SetSums) -> list[Members]:
    """The largest sets of paints, as far as each has `LEAST` of all pixels; the first one in any
    case.
    """
    least = LEAST * mapped_pixels(sets)
    ranked = [members for members in sets if members][:MOST_SETS]
    return [members for n, members in enumerate(ranked) if not n or sets[members].pixels >= least]


def overview(dataset: "xr.Dataset", sets: SetSums) -> Overview:
    """Look at a map, some rows at a time, so that memory stays small whatever its size.

    Args:
        dataset: variables of `layout.VARIABLES`, coordinate `paint` with their names.
        sets: sums over the pixels of each set.
    """
    names = {"paint_probability", "true_colour", *_MEANS, *_EXAMPLES}
    height = dataset.sizes["y"]
    width = dataset.sizes["x"]
    step = max(1, -(-height // MOST[0]), -(-width // MOST[1]))
    # A paint's own map may have fewer: there are two for each paint.
    coarse = 2 * step if width > step * 640 else step
    paints = tuple(paint_names(dataset))
    likely = np.zeros(len(paints), int)
    tiles = []
    rows = max(1, _PIXELS // (coarse * width)) * coarse
    for y in range(0, height, rows):
        section = dataset.isel(y=slice(y, y + rows))
        block = {name: section[name].values for name in names}
        mapped = block["status"] == Status.MAPPED
        likely += np.sum(block["paint_probability"][mapped] > 0.5, axis=0)
        tiles.append(_parts(block, step, coarse))
    pictures = {name: np.concatenate([tile[name] for tile in tiles]) for name in tiles[0]}
    examples = {name: pictures[name] for name in _EXAMPLES}
    # Paints of a set by number, whatever order the map has them in; those that are none last.
    order = np.argsort(examples["members"].astype(np.uint16), axis=-1, kind="stable")
    for name in ("members", "fraction"):
        examples[name] = np.take_along_axis(examples[name], order, axis=-1)
    return Overview(
        shape=(height, width),
        step=step,
        paints=paints,
        sets=sets,
        means={name: pictures[f"mean_{name}"] for name in _MEANS},
        paint_probability=pictures["paint_probability"],
        paint_amount=pictures["paint_amount"],
        paint_share=pictures["paint_share"],
        examples=examples,
        colour=np.clip(np.rint(pictures["colour"]), 0, 255).astype(np.uint8),
        likely=likely,
        pixel_area=pixel_area(dataset),
    )


def pixel_area(dataset: "xr.Dataset") -> float | None:
    """Area of a pixel in m2 by the coordinates y and x, or None where they have no unit
    of length.
    """
    metres = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6}
    for prefix, size in (("", 1.0), ("centi", 1e-2), ("milli", 1e-3), ("micro", 1e-6)):
        metres |= {f"{prefix}{word}": size for word in ("metre", "meter", "metres", "meters")}
    area = 1.0
    for name in ("y", "x"):
        if name not in dataset.coords or dataset.sizes[name] < 2:
            return None
        unit = metres.get(str(dataset[name].attrs.get("units", "")).lower())
        if unit is None:
            return None
        first, second = dataset[name].values[:2].astype(float)
        area *= abs(second - first) * unit
    return area


def _parts(block: Mapping[str, np.ndarray], step: int, coarse: int) -> dict[str, np.ndarray]:
    """A block's share of the pictures; those of single paints are coarser."""
    mapped = block["status"] == Status.MAPPED
    explained = mapped & (block["explained"] > 0)
    # Elsewhere it is the thickness of a set that was rejected.
    of_sets = {"thickness": explained, "thickness_sd": explained}
    pictures = {
        f"mean_{name}": square_means(np.where(of_sets.get(name, mapped), block[name], np.nan), step)
        for name in _MEANS
    }
    share = np.zeros(block["paint_probability"].shape, np.float32)
    ys, xs, slots = np.nonzero((block["members"] >= 0) & explained[..., None])
    share[ys, xs, block["members"][ys, xs, slots]] = block["fraction"][ys, xs, slots]
    share[~explained] = np.nan
    # Nothing of a paint is nothing however thick the film is.
    amount = np.where(share == 0, 0.0, share * block["thickness"][..., None])
    probability = np.where(mapped[..., None], block["paint_probability"], np.nan)
    pictures["paint_share"] = square_means(share, coarse)
    pictures["paint_amount"] = square_means(amount, coarse)
    pictures["paint_probability"] = square_means(probability, coarse)
    pictures["colour"] = square_means(block["true_colour"].astype(np.float32), step)
    # The last square of a row or column may be cut off before its middle.
    middles = np.ix_(*(np.minimum(np.arange(0, n, step) + step // 2, n - 1) for n in mapped.shape))
    return pictures | {name: block[name][middles] for name in _EXAMPLES}


def square_means(
    values: Float[np.ndarray, "y x *more"], step: int
) -> Float[np.ndarray, "rows columns *more"]:
    """Means over squares of so many pixels a side, NaN left out; those at the edges may
    be smaller.
    """
    if step == 1:
        return np.asarray(values, np.float32)
    import xarray as xr

    array = xr.DataArray(np.asarray(values, np.float32))
    return array.coarsen(dim_0=step, dim_1=step, boundary="pad").mean().values
