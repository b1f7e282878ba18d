"""A map in words and tables: what the command prints, and the table of sets."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from rich.console import RenderableType
from rich.text import Text

from glazejax.io import write_table
from glazejax.report import plain_table

from ..store.chunk import Members, SetSums
from ..store.layout import STATUS_WORDS, Status, status_counts
from .names import paint_names, set_words
from .overview import mapped_pixels, shown_sets

if TYPE_CHECKING:
    import xarray


def report_map(dataset: "xarray.Dataset", sets: SetSums) -> Iterator[RenderableType]:
    """What became of the pixels, and the sets that the report shows, too.

    Args:
        dataset: the map.
        sets: sums over the pixels of each set.
    """
    lines = dataset.sizes["y"]
    samples = dataset.sizes["x"]
    mapped = mapped_pixels(sets)
    # What was mapped comes first, also where it is nothing.
    counts = {STATUS_WORDS[Status.MAPPED]: mapped, **status_counts(dataset.attrs["tallies"])}
    statuses = "; ".join(f"{count:,} {words}" for words, count in counts.items())
    yield Text(f"{samples} x {lines} pixels: {statuses}.", "bold")
    if not mapped:
        return
    paints = paint_names(dataset)
    # Of families no thickness is known anywhere.
    thick = any(sums.pixels_with_thickness for sums in sets.values())
    table = plain_table("paints", "pixels", "area", *(["thickness"] if thick else []), "misfit")
    reported = {(), *shown_sets(sets)}
    for members, sums in sets.items():
        if members not in reported:
            continue
        words = _words(members, paints)
        thickness = "-" if sums.thickness_um is None else f"{sums.thickness_um:.3g} µm"
        misfit = f"{sums.rmse:.4f}" if members and np.isfinite(sums.rmse) else "-"
        cells = [*([thickness] if thick else []), misfit]
        table.add_row(words, f"{sums.pixels:,}", f"{sums.pixels / mapped:.1%}", *cells)
    yield table
    further = [sums.pixels for members, sums in sets.items() if members not in reported]
    if further:
        yield Text(
            f"Others: {len(further)} further {'set' if len(further) == 1 else 'sets'} on "
            f"{sum(further) / mapped:.1%} of the area",
            "dim",
        )


def write_sets(
    path: Path,
    dataset: "xarray.Dataset",
    sets: SetSums,
    *,
    overwrite: bool,
) -> None:
    """Write a table of sets: pixels, share of the mapped area, thickness, and mean spectra,
    measured and fitted.

    Args:
        path: CSV, or TSV by its ending.
        dataset: the map.
        sets: sums over the pixels of each set.
        overwrite: whether a file that exists may be replaced.

    Raises:
        FileExistsError, FileNotFoundError, IsADirectoryError: see
            `glazejax.io.outputs.check_output`.
    """
    paints = paint_names(dataset)
    mapped = mapped_pixels(sets)
    grid = dataset.attrs["working_wavelengths"]
    titles = [
        "paints",
        "pixels",
        "share",
        "thickness_um",
        "pixels_with_thickness",
        "rmse_of_mean",
        "sd_of_pixels",
    ]
    bands = [f"{kind}_{nm:g}" for kind in ("measured", "fitted") for nm in grid]
    rows = []
    for members, sums in sets.items():
        row = [
            _words(members, paints),
            sums.pixels,
            sums.pixels / mapped,
            "" if sums.thickness_um is None else sums.thickness_um,
            sums.pixels_with_thickness,
            sums.rmse,
            # How far pixels lie about their mean, over all bands.
            np.sqrt(np.mean(sums.sd**2)),
        ]
        rows.append([*row, *sums.mean, *sums.mean_fit])
    write_table(path, [*titles, *bands], rows, overwrite=overwrite)


def _words(members: Members, paints: Sequence[str]) -> str:
    """A set by the names of its paints."""
    return set_words(members, paints) or "none of these"
