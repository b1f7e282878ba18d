"""A map seen from afar: counts of every pixel, and arrays small enough to look at, in one pass over
the store.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from ..store.chunk import Members, distinct_sets
from ..store.layout import STATUS_WORDS, Status, Way
from .legend import MOST_SETS
from .names import set_words

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
        coarse: the same in pictures of single paints.
        paints: their names, by number.
        status: pixels of each status.
        ways: pixels answered in each way.
        sets: pixels of each set, by its members ascending; () where nothing in the catalogue
            explains them.
        means: by name, (rows, columns), means over the mapped pixels of each square; NaN where
            there are none.
        paint_probability, paint_amount, paint_share: (rows, columns, paints), coarser means; amount
            in m.
        examples: by name, (rows, columns, ...), the pixel in the middle of each square.
        colour: true colour, (rows, columns, 3).
        likely: of each paint, pixels that have it with a probability above one half.
        in_set: of each paint, pixels whose most probable set has it.
        pixel_area: of one pixel, m2, or None if the map does not say.
    """

    shape: tuple[int, int]
    step: int
    coarse: int
    paints: tuple[str, ...]
    status: dict[Status, int] = field(default_factory=dict)
    ways: dict[Way, int] = field(default_factory=dict)
    sets: dict[Members, int] = field(default_factory=dict)
    means: dict[str, Float[np.ndarray, "rows columns"]] = field(default_factory=dict)
    paint_probability: Float[np.ndarray, "r c paints"] = field(init=False)
    paint_amount: Float[np.ndarray, "r c paints"] = field(init=False)
    paint_share: Float[np.ndarray, "r c paints"] = field(init=False)
    examples: dict[str, np.ndarray] = field(default_factory=dict)
    colour: UInt8[np.ndarray, "rows columns 3"] = field(init=False)
    likely: Int[np.ndarray, "paints"] = field(init=False)
    in_set: Int[np.ndarray, "paints"] = field(init=False)
    pixel_area: float | None = None

    @property
    def mapped(self) -> int:
        """Pixels that were mapped."""
        return self.status.get(Status.MAPPED, 0)

    @property
    def explained(self) -> int:
        """Pixels that a set of the catalogue explains."""
        return sum(count for members, count in self.sets.items() if members)

    @cached_property
    def ranked(self) -> list[Members]:
        """Sets by their area, largest first, without the one that is none."""
        return ranked_sets(self.sets)

    @cached_property
    def shown(self) -> list[Members]:
        """Those of them that have a row and a colour of their own."""
        return shown_sets(self.sets)

    def words(self, members: Members) -> str:
        """Names of a set's paints."""
        return set_words(members, self.paints) or "none of these paints"

    def where(self, members: Members) -> Bool[np.ndarray, "rows columns"]:
        """Pixels of `examples` that have a set."""
        padded = (*members, *([-1] * (self.examples["members"].shape[-1] - len(members))))
        mapped = self.examples["status"] == Status.MAPPED
        explained = self.examples["explained"] > 0
        if not members:
            return mapped & ~explained
        return mapped & explained & (self.examples["members"] == np.asarray(padded)).all(axis=-1)


def ranked_sets(pixels: Mapping[Members, int]) -> list[Members]:
    """Sets by their pixels, largest first, without the one that is none."""
    return sorted((members for members in pixels if members), key=lambda m: (-pixels[m], m))


def shown_sets(pixels: Mapping[Members, int]) -> list[Members]:
    """The largest of these, as far as each has `LEAST` of all pixels; the first one in any case."""
    least = LEAST * sum(pixels.values())
    ranked = ranked_sets(pixels)[:MOST_SETS]
    return [members for n, members in enumerate(ranked) if not n or pixels[members] >= least]


def overview(dataset: "xr.Dataset", most: tuple[int, int] = MOST) -> Overview:
    """Look at a map, some rows at a time, so that memory stays small whatever its size.

    Args:
        dataset: variables of `layout.VARIABLES`, coordinate `paint` with their names.
        most: rows and columns of the largest picture.

    Raises:
        ValueError: the dataset lacks a variable of a map.
    """
    lacking = [
        name
        for name in ("status", "way", "paint_probability", "true_colour", *_MEANS, *_EXAMPLES)
        if name not in dataset
    ]
    if lacking:
        raise ValueError(f"this is no map of paints: it lacks {', '.join(sorted(set(lacking)))}")
    height = dataset.sizes["y"]
    width = dataset.sizes["x"]
    step = max(1, -(-height // most[0]), -(-width // most[1]))
    # A paint's own map may have fewer: there are two for each paint.
    coarse = 2 * step if width > step * 640 else step
    paints = tuple(str(name) for name in dataset["paint"].values)
    look = Overview((height, width), step, coarse, paints, pixel_area=pixel_area(dataset))
    look.likely = np.zeros(len(paints), int)
    look.in_set = np.zeros(len(paints), int)
    tiles: dict[str, list[np.ndarray]] = {}
    for block in _blocks(dataset, look.coarse):
        _count(look, block)
        for name, tile in _parts(look, block).items():
            tiles.setdefault(name, []).append(tile)
    pictures = {name: np.concatenate(rows) for name, rows in tiles.items()}
    look.means = {name: pictures[f"mean_{name}"] for name in _MEANS}
    look.examples = {name: pictures[name] for name in _EXAMPLES}
    look.colour = np.clip(np.rint(pictures["colour"]), 0, 255).astype(np.uint8)
    look.paint_probability = pictures["paint_probability"]
    look.paint_amount = pictures["paint_amount"]
    look.paint_share = pictures["paint_share"]
    look.status = {status: count for status, count in look.status.items() if count}
    return look


def pixel_area(dataset: "xr.Dataset") -> float | None:
    """Area of a pixel in m2 by the coordinates y and x, or None where they have no unit
    of length.
    """
    metres = {
        "m": 1.0,
        "metre": 1.0,
        "meter": 1.0,
        "metres": 1.0,
        "meters": 1.0,
        "cm": 1e-2,
        "mm": 1e-3,
        "um": 1e-6,
        "µm": 1e-6,
    }
    area = 1.0
    for name in ("y", "x"):
        if name not in dataset.coords or dataset.sizes[name] < 2:
            return None
        unit = metres.get(str(dataset[name].attrs.get("units", "")).lower())
        if unit is None:
            return None
        first, second = np.asarray(dataset[name].isel({name: slice(0, 2)}), float)
        area *= abs(second - first) * unit
    return area


def _blocks(dataset: "xr.Dataset", step: int) -> Iterator[dict[str, np.ndarray]]:
    names = {"way", "paint_probability", "true_colour", *_MEANS, *_EXAMPLES}
    rows = max(1, _PIXELS // (step * dataset.sizes["x"])) * step
    for y in range(0, dataset.sizes["y"], rows):
        section = dataset.isel(y=slice(y, y + rows))
        block = {name: np.asarray(section[name].values) for name in names}
        # Paints of a set by number, whatever order the map has them in.
        members = block["members"].astype(np.int64)
        order = np.argsort(
            np.where(members < 0, np.iinfo(np.int64).max, members), axis=-1, kind="stable"
        )
        for name in ("members", "fraction"):
            block[name] = np.take_along_axis(block[name], order, axis=-1)
        yield block


def _count(look: Overview, block: Mapping[str, np.ndarray]) -> None:
    """Add the pixels of a block to the counts."""
    for status in STATUS_WORDS:
        look.status[status] = look.status.get(status, 0) + int(np.sum(block["status"] == status))
    mapped = block["status"] == Status.MAPPED
    for way in Way:
        count = int(np.sum(mapped & (block["way"] == way)))
        if count:
            look.ways[way] = look.ways.get(way, 0) + count
    members = np.where((block["explained"] > 0)[..., None], block["members"], -1)[mapped].astype(
        np.int64
    )
    first, which = distinct_sets(members)
    for at, count in zip(first, np.bincount(which).tolist(), strict=True):
        present = tuple(int(member) for member in members[at] if member >= 0)
        look.sets[present] = look.sets.get(present, 0) + count
        look.in_set[list(present)] += count
    look.likely += np.sum(np.nan_to_num(block["paint_probability"])[mapped] > 0.5, axis=0)


def _parts(look: Overview, block: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """A block's share of the pictures."""
    step = look.step
    coarse = look.coarse
    mapped = block["status"] == Status.MAPPED
    pictures = {
        f"mean_{name}": square_means(np.where(mapped, block[name], np.nan), step) for name in _MEANS
    }
    explained = mapped & (block["explained"] > 0)
    share = np.zeros((*mapped.shape, len(look.paints)), np.float32)
    ys, xs, slots = np.nonzero((block["members"] >= 0) & explained[..., None])
    share[ys, xs, block["members"][ys, xs, slots]] = block["fraction"][ys, xs, slots]
    share[~explained] = np.nan
    # Nothing of a paint is nothing however thick the film is.
    amount = np.where(share == 0, 0.0, share * block["thickness"][..., None])
    pictures["paint_share"] = square_means(share, coarse)
    pictures["paint_amount"] = square_means(amount, coarse)
    pictures["paint_probability"] = square_means(
        np.where(mapped[..., None], block["paint_probability"], np.nan), coarse
    )
    pictures["colour"] = square_means(block["true_colour"].astype(np.float32), step)
    for name in _EXAMPLES:
        # The last square of a row or column may be cut off before its middle.
        rows = np.minimum(np.arange(0, mapped.shape[0], step) + step // 2, mapped.shape[0] - 1)
        columns = np.minimum(np.arange(0, mapped.shape[1], step) + step // 2, mapped.shape[1] - 1)
        pictures[name] = block[name][np.ix_(rows, columns)]
    return pictures


def square_means(
    values: Float[np.ndarray, "y x *more"], step: int
) -> Float[np.ndarray, "rows columns *more"]:
    """Means over squares of so many pixels a side, NaN left out; those at the edges may
    be smaller.
    """
    if step == 1:
        return np.asarray(values, np.float32)
    finite = np.isfinite(values)
    total = np.where(finite, values, 0.0).astype(np.float32)
    counts = finite.astype(np.float32)
    for axis in (0, 1):
        starts = np.arange(0, values.shape[axis], step)
        total = np.add.reduceat(total, starts, axis=axis)
        counts = np.add.reduceat(counts, starts, axis=axis)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(counts > 0, total / counts, np.nan).astype(np.float32)
