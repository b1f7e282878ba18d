"""A map in words and tables: what the command prints, and the table of sets."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import RenderableType
from rich.text import Text

from glazejax.io import write_table
from glazejax.report import plain_table

from ..store.chunk import Members, SetSum, SetSums, rms_difference
from ..store.layout import STATUS_WORDS, Status, status_counts
from .names import paint_names, set_words
from .overview import shown_sets

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
    mapped = sum(sums.pixels for sums in sets.values())
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
        row = _row(members, sums, paints, mapped)
        thickness = "-" if row["thickness_um"] is None else f"{row['thickness_um']:.3g} µm"
        off = row["rmse_of_mean"]
        misfit = f"{off:.4f}" if members and np.isfinite(off) else "-"
        cells = [*([thickness] if thick else []), misfit]
        table.add_row(row["paints"], f"{sums.pixels:,}", f"{row['share']:.1%}", *cells)
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
    mapped = sum(sums.pixels for sums in sets.values())
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
        row = _row(members, sums, paints, mapped)
        cells = ("" if row[name] is None else row[name] for name in titles)
        rows.append([*cells, *map(float, [*sums.mean, *sums.mean_fit])])
    write_table(path, [*titles, *bands], rows, overwrite=overwrite)


def _row(members: Members, sums: SetSum, paints: Sequence[str], mapped: int) -> dict[str, Any]:
    """Numbers of a set by the titles of its table."""
    return {
        "paints": set_words(members, paints) or "none of these",
        "pixels": sums.pixels,
        "share": sums.pixels / mapped,
        "thickness_um": sums.thickness_um,
        "pixels_with_thickness": sums.pixels_with_thickness,
        "rmse_of_mean": float(rms_difference(sums.mean, sums.mean_fit)),
        # How far pixels lie about their mean, over all bands.
        "sd_of_pixels": float(np.sqrt(np.mean(sums.sd**2))),
    }
