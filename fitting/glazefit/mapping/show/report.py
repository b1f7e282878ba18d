"""A map in words and tables: what the command prints, and the table of sets."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from glazejax.io import write_table
from glazejax.report import plain_table

from ..store.chunk import Members, SetSum
from ..store.layout import STATUS_WORDS, Status
from .names import set_words
from .overview import shown_sets

if TYPE_CHECKING:
    import xarray
    from rich.console import Console

_NONE = "none of these"
_LINES = 1 << 20


def statuses(dataset: "xarray.Dataset") -> dict[Status, int]:
    """Pixels of each status, those that occur, without the whole map in memory."""
    counts = np.zeros(len(Status), np.int64)
    rows = max(1, _LINES // dataset.sizes["x"])
    for y in range(0, dataset.sizes["y"], rows):
        counts += np.bincount(dataset["status"][y : y + rows].values.ravel(), minlength=counts.size)
    return {status: int(counts[status]) for status in Status if counts[status]}


def by_area(sets: Mapping[Members, SetSum]) -> list[tuple[Members, SetSum]]:
    """Sets, the most frequent first."""
    return sorted(sets.items(), key=lambda item: (-item[1].pixels, item[0]))


def print_map(
    dataset: "xarray.Dataset", sets: Mapping[Members, SetSum], console: "Console"
) -> None:
    """Print what became of the pixels, and the sets that the report shows, too.

    Args:
        dataset: the map.
        sets: sums over the pixels of each set.
        console: to print to.
    """
    counts = statuses(dataset)
    mapped = counts.get(Status.MAPPED, 0)
    lines = dataset.sizes["y"]
    samples = dataset.sizes["x"]
    unmapped = [
        f"{count:,} {STATUS_WORDS[status]}"
        for status, count in counts.items()
        if status is not Status.MAPPED
    ]
    console.print(
        f"[bold]{samples} x {lines} pixels: {'; '.join([f'{mapped:,} mapped', *unmapped])}.[/bold]"
    )
    if not mapped:
        return
    paints = [str(name) for name in dataset["paint"].values]
    # Of families no thickness is known anywhere.
    thick = any(sums.thickness[1] for sums in sets.values())
    table = plain_table("paints", "pixels", "area", *(["thickness"] if thick else []), "misfit")
    reported = {(), *shown_sets({members: sums.pixels for members, sums in sets.items()})}
    for members, sums in by_area(sets):
        if members not in reported:
            continue
        row = _row(members, sums, paints, mapped)
        thickness = "-" if row["thickness_um"] is None else f"{row['thickness_um']:.3g} µm"
        off = row["rmse_of_mean"]
        misfit = f"{off:.4f}" if members and np.isfinite(off) else "-"
        cells = [*([thickness] if thick else []), misfit]
        table.add_row(row["paints"], f"{sums.pixels:,}", f"{row['share']:.1%}", *cells)
    console.print(table)
    further = [sums.pixels for members, sums in sets.items() if members not in reported]
    if further:
        console.print(
            f"[dim]Others: {len(further)} further {'set' if len(further) == 1 else 'sets'} on "
            f"{sum(further) / mapped:.1%} of the "
            "area[/dim]"
        )


def write_sets(
    path: Path,
    dataset: "xarray.Dataset",
    sets: Mapping[Members, SetSum],
    grid: Sequence[float],
    *,
    overwrite: bool = False,
) -> None:
    """Write a table of sets: pixels, share of the mapped area, thickness, and mean spectra,
    measured and fitted.

    Args:
        path: CSV, or TSV by its ending.
        dataset: the map.
        sets: sums over the pixels of each set.
        grid: (bands,), nm, of the sums.
        overwrite: whether a file that exists may be replaced.

    Raises:
        FileExistsError, FileNotFoundError, IsADirectoryError: see
            `glazejax.io.outputs.check_output`.
    """
    paints = [str(name) for name in dataset["paint"].values]
    mapped = sum(sums.pixels for sums in sets.values())
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
    for members, sums in by_area(sets):
        row = _row(members, sums, paints, mapped)
        means = [*(sums.spectrum / sums.pixels), *(sums.fitted / sums.pixels)]
        rows.append(
            [*("" if row[name] is None else row[name] for name in titles), *map(float, means)]
        )
    write_table(path, [*titles, *bands], rows, overwrite=overwrite)


def _row(members: Members, sums: SetSum, paints: Sequence[str], mapped: int) -> dict[str, Any]:
    """Numbers of a set by the titles of its table."""
    mean = sums.spectrum / sums.pixels
    fitted = sums.fitted / sums.pixels
    total, count = sums.thickness
    return {
        "paints": set_words(members, paints) or _NONE,
        "pixels": sums.pixels,
        "share": sums.pixels / mapped,
        "thickness_um": total / count * 1e6 if count else None,
        "pixels_with_thickness": count,
        "rmse_of_mean": float(np.sqrt(np.mean((mean - fitted) ** 2))),
        # How far pixels lie about their mean, over all bands.
        "sd_of_pixels": float(
            np.sqrt(np.mean(np.maximum(sums.square / sums.pixels - mean**2, 0.0)))
        ),
    }
