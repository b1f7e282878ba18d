"""The sets that a report shows as classes of an ENVI image, which GIS and image programs open."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from glazejax.io.write import write_files

from ..store.export import braceless, envi_header
from ..store.layout import Status
from .legend import BLANK, OTHERS, STRIPES, rgb
from .overview import Overview, pixels_with

if TYPE_CHECKING:
    import xarray as xr

CLASSES = "classes.hdr"
"""File next to the page; its numbers are in classes.img."""
# Pixels looked at together, for memory.
_PIXELS = 2**22


def write_classes(dataset: "xr.Dataset", look: Overview, folder: Path, *, overwrite: bool) -> None:
    """Write a class for each set that is shown, for all others, for none of the paints and for what
    was not mapped, number 0, as bytes.

    Args:
        dataset: the map.
        look: of it.
        folder: of the report.
        overwrite: whether older files may be replaced.

    Raises:
        FileExistsError: there are such files, and `overwrite` is false.
    """
    names = ["not mapped", *map(look.words, look.shown), "others", look.words(())]
    colours = [BLANK, *look.legend_colours, OTHERS, STRIPES[0]]
    classes = {
        "bands": 1,
        "file type": "ENVI Classification",
        "data type": 1,
        "classes": len(names),
        "class names": "{ " + ", ".join(map(braceless, names)) + " }",
        "class lookup": "{ " + ", ".join(f"{n}" for colour in colours for n in rgb(colour)) + " }",
    }
    header = folder / CLASSES
    text = envi_header(dataset, classes).encode()
    files = {header.with_suffix(".img"): _classes(dataset, look), header: [text]}
    write_files(files, overwrite=overwrite)


def _classes(dataset: "xr.Dataset", look: Overview) -> Iterator[bytes]:
    """Class of each pixel, some lines at a time."""
    lines, samples = look.shape
    height = max(1, _PIXELS // samples)
    for y in range(0, lines, height):
        section = dataset.isel(y=slice(y, y + height))
        block = {name: section[name].values for name in ("status", "explained", "members")}
        block["members"] = np.sort(block["members"].astype(np.uint16), axis=-1).astype(np.int16)
        mapped = block["status"] == Status.MAPPED
        classes = np.where(mapped, len(look.shown) + 1, 0)
        classes[pixels_with((), block)] += 1
        for number, members in enumerate(look.shown, start=1):
            classes[pixels_with(members, block)] = number
        yield classes.astype(np.uint8).tobytes()
