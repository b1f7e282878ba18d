"""Report of films recovered one by one: a table on the screen, and the file that it leaves."""

from collections.abc import Iterable, Iterator, Sequence
from typing import TypeAlias

import numpy as np
from rich.console import RenderableType
from rich.text import Text

from glazejax.report import plain_table
from glazejax.spectra import ranges

from .result import RULE, Recovery

Table: TypeAlias = tuple[Sequence[str], Iterable[Sequence[object]]]
"""Titles of columns, and rows."""


def report_films(recovery: Recovery, seconds: float, first: float) -> Iterator[RenderableType]:
    """A line a paint: how well it is met, and what is known of it.

    Args:
        recovery: recovered films.
        seconds: the recovery took.
        first: seconds until the first chunk was done, with what was compiled for it.
    """
    title = (
        f"{len(recovery)} paints in {seconds:.1f} s ({first:.1f} s to compile and do the first few)"
    )
    table = plain_table("paint", "RMSE", "ΔE00 D65", "ΔE00 A", "gloss", "k, s known", title=title)
    d65 = recovery.delta_e("D65")
    a = recovery.delta_e("A")
    names = recovery.films.names
    grid = recovery.films.wavelengths
    for row, name in enumerate(names):
        table.add_row(
            name,
            f"{recovery.rmse[row]:.5f}",
            f"{d65[row]:.2f}",
            f"{a[row]:.2f}",
            "1" if recovery.gloss[row] == 1 else f"{recovery.gloss[row]:.2f}",
            f"{recovery.identifiable[row].sum()}/{grid.size} bands",
        )
    yield table
    if not recovery.identifiable.all():
        yield "Too opaque to separate k from s, only k/s is known:"
        for row in np.flatnonzero(~recovery.identifiable.all(axis=1)).tolist():
            where = ranges(grid, ~recovery.identifiable[row])
            yield f"  {names[row]}: {where}: k/s {_ratios(recovery, row)}"
    yield Text(f"Rule: {RULE}.", "dim")
    if (recovery.gloss < 1).any():
        yield Text(
            "Gloss below 1: the film reads less than a smooth surface reflects; that share "
            "of it was counted.",
            "dim",
        )
    odd = ~recovery.converged & (recovery.misfit > 9)
    for row in np.flatnonzero(odd.any(axis=1)):
        yield Text(
            f"{names[row]}: the solver did not settle at {ranges(grid, odd[row])}.", "yellow"
        )
    off = recovery.misfit > 16
    for row in np.flatnonzero(off.any(axis=1)):
        yield Text(
            f"{names[row]}: no k and s meet both spectra within 4 standard deviations at "
            f"{ranges(grid, off[row])}.",
            "yellow",
        )


def _ratios(recovery: Recovery, row: int) -> str:
    """Range of k/s, with errors, over the bands where only that is known."""
    bands = np.flatnonzero(~recovery.identifiable[row])
    ratio = recovery.ratio[row]
    sd = recovery.ratio_sd[row]
    ends = [bands[np.argmin(ratio[bands])], bands[np.argmax(ratio[bands])]]
    return " to ".join(_with_error(ratio[b], sd[b]) for b in dict.fromkeys(ends))


def _with_error(value: float, sd: float) -> str:
    """Value and error with as many digits as the error has; a lower bound where it is no better
    known.
    """
    if sd > value / 2:
        return f"above {max(value - 2 * sd, 0.2 * value):.1g}"
    digits = max(0, 1 - int(np.floor(np.log10(sd)))) if sd > 0 else 6
    return f"{value:.{digits}f}±{sd:.{digits}f}"


def fit_table(recovery: Recovery) -> Table:
    """Ratio k/s and fitted spectra, a line a paint and wavelength; none needs a thickness."""
    header = (
        "pigment",
        "wavelength_nm",
        "ratio",
        "ratio_sd",
        "fitted_over_black",
        "fitted_over_white",
    )
    columns = [recovery.ratio, recovery.ratio_sd, recovery.fitted_black, recovery.fitted_white]
    rows = (
        (name, f"{wavelength:g}", *(f"{column[film, band]:.6g}" for column in columns))
        for film, name in enumerate(recovery.films.names)
        for band, wavelength in enumerate(recovery.films.wavelengths)
    )
    return header, rows
