"""What a recovery tells its user: a table on the screen, and the files it leaves."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float
from rich.console import Console
from rich.table import Table

from glazejax.io import write_table

from .result import RULE, Recovery

PIGMENT_COLUMNS = (
    "pigment",
    "wavelength_nm",
    "absorption",
    "scattering",
    "absorption_sd",
    "scattering_sd",
    "identifiable",
)


def ranges(wavelengths: Float[np.ndarray, "bands"], chosen: Bool[np.ndarray, "bands"]) -> str:
    """The chosen bands in words, such as ``400-470, 600 nm``."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], chosen.astype(int), [0]])))
    runs = [(wavelengths[a], wavelengths[b - 1]) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    if not runs:
        return "none"
    return ", ".join(f"{a:g}" if a == b else f"{a:g}-{b:g}" for a, b in runs) + " nm"


def print_summary(recovery: Recovery, console: Console, seconds: float, first: float) -> None:
    """Print a line a paint: how well it is met, and what is known of it.

    Args:
        recovery: recovered films.
        console: to print to.
        seconds: the recovery took.
        first: seconds until the first chunk was done, with what was compiled for it.
    """
    table = Table(
        title=f"{len(recovery)} paints in {seconds:.1f} s ({first:.1f} s to compile and do the first few)",
        title_justify="left",
        box=None,
    )
    table.add_column("paint", overflow="fold")
    for title in ("RMSE", "ΔE00 D65", "ΔE00 A", "gloss"):
        table.add_column(title, justify="right", no_wrap=True)
    table.add_column("k, s known", justify="right", no_wrap=True)
    d65, a = recovery.delta_e("D65"), recovery.delta_e("A")
    bands = recovery.films.wavelengths.size
    for row, name in enumerate(recovery.films.names):
        table.add_row(
            name,
            f"{recovery.rmse[row]:.5f}",
            f"{d65[row]:.2f}",
            f"{a[row]:.2f}",
            "1" if recovery.gloss[row] == 1 else f"{recovery.gloss[row]:.2f}",
            f"{recovery.identifiable[row].sum()}/{bands} bands",
        )
    console.print(table)
    if not recovery.identifiable.all():
        console.print("Too opaque to tell k from s, only k/s is known:")
        for row in np.flatnonzero(~recovery.identifiable.all(axis=1)).tolist():
            where = ranges(recovery.films.wavelengths, ~recovery.identifiable[row])
            console.print(f"  {recovery.films.names[row]}: {where}: k/s {_ratios(recovery, row)}")
    console.print(f"[dim]Rule: {RULE}.[/dim]")
    if (recovery.gloss < 1).any():
        console.print(
            "[dim]Gloss below 1: the film reads less than a smooth surface reflects; that share of it was counted."
            "[/dim]"
        )
    odd = ~recovery.converged & (recovery.misfit > 9)
    for row in np.flatnonzero(odd.any(axis=1)):
        console.print(
            f"[yellow]{recovery.films.names[row]}: the solver did not settle at "
            f"{ranges(recovery.films.wavelengths, odd[row])}.[/yellow]"
        )
    off = recovery.misfit > 16
    for row in np.flatnonzero(off.any(axis=1)):
        console.print(
            f"[yellow]{recovery.films.names[row]}: no k and s meet both spectra within 4 standard deviations at "
            f"{ranges(recovery.films.wavelengths, off[row])}.[/yellow]"
        )


def _ratios(recovery: Recovery, row: int) -> str:
    """Range of k/s, with errors, over the bands where only that is known."""
    bands = np.flatnonzero(~recovery.identifiable[row])
    ratio, sd = recovery.ratio[row], recovery.ratio_sd[row]
    ends = [bands[np.argmin(ratio[bands])], bands[np.argmax(ratio[bands])]]
    return " to ".join(_with_error(ratio[b], sd[b]) for b in dict.fromkeys(ends))


def _with_error(value: float, sd: float) -> str:
    """Value and error with as many digits as the error has; a lower bound where it is no better known."""
    if sd > value / 2:
        return f"above {max(value - 2 * sd, 0.2 * value):.1g}"
    digits = max(0, 1 - int(np.floor(np.log10(sd)))) if sd > 0 else 6
    return f"{value:.{digits}f}±{sd:.{digits}f}"


def write_pigments(recovery: Recovery, thickness: float, path: Path, *, overwrite: bool = False) -> None:
    """Write k and s in 1/m for a film this thick (m), a line a paint and wavelength."""
    columns = [
        recovery.absorption / thickness,
        recovery.scattering / thickness,
        recovery.absorption_sd / thickness,
        recovery.scattering_sd / thickness,
    ]
    rows = (
        (name, f"{wavelength:g}", *(f"{column[i, j]:.6g}" for column in columns), bool(recovery.identifiable[i, j]))
        for i, name in enumerate(recovery.films.names)
        for j, wavelength in enumerate(recovery.films.wavelengths)
    )
    write_table(path, PIGMENT_COLUMNS, rows, overwrite=overwrite)


def write_fits(recovery: Recovery, path: Path, *, overwrite: bool = False) -> None:
    """Write the ratio k/s and the fitted spectra, a line a paint and wavelength; none needs a thickness."""
    header = ("pigment", "wavelength_nm", "ratio", "ratio_sd", "fitted_over_black", "fitted_over_white")
    columns = [recovery.ratio, recovery.ratio_sd, recovery.fitted_black, recovery.fitted_white]
    rows = (
        (name, f"{wavelength:g}", *(f"{column[i, j]:.6g}" for column in columns))
        for i, name in enumerate(recovery.films.names)
        for j, wavelength in enumerate(recovery.films.wavelengths)
    )
    write_table(path, header, rows, overwrite=overwrite)


def slug(name: str) -> str:
    """A name that any file system takes."""
    return re.sub(r"[^A-Za-z0-9.]+", "_", name).strip("_.") or "paint"


def write_plots(recovery: Recovery, thickness: float, folder: Path, step: Callable[[], object] = lambda: None) -> None:
    """Draw every paint to its own file, and call `step` after each."""
    from .plots import plot_paint

    taken: set[str] = set()
    for row, name in enumerate(recovery.films.names):
        stem = slug(name)
        while stem.lower() in taken:
            stem += "_"
        taken.add(stem.lower())
        plot_paint(recovery, row, thickness, folder / f"{stem}.png")
        step()
