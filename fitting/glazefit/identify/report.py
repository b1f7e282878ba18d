"""What `glazejax identify` leaves: lines on the screen, tables and a picture."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from glazejax.io import write_table

from .result import Candidate, Identification

COLUMNS = (
    "spectrum",
    "rank",
    "probability",
    *(f"{what}_{n}" for n in (1, 2, 3) for what in ("paint", "fraction", "fraction_sd", "coat")),
    "thickness_um",
    "thickness_sd_um",
    "rmse",
    "spectral_angle_deg",
    "delta_e_2000",
    "gloss",
    "none_of_these",
    "explained",
)
_COLOURS = ("#8c2d04", "#08519c", "#41732b")
_PICTURED = 6


def print_identification(found: Identification, console: Console, top: int, detailed: int) -> None:
    """Print the most probable explanations: a table for each of the first spectra, one line for the others.

    Args:
        found: identification.
        console: to print to.
        top: explanations in a table.
        detailed: spectra that get a table.
    """
    for row in range(min(detailed, len(found))):
        console.print(_table(found, row, top))
        console.print(f"[bold]{_verdict(found, row)}[/bold]")
        doubt = doubtful(found, row)
        if doubt:
            console.print(f"[dim]{doubt}[/dim]")
        console.print()
    for row in range(detailed, len(found)):
        console.print(found.words(row), markup=False)


def _verdict(found: Identification, row: int) -> str:
    if not found.explained[row]:
        words = found.unexplained(row)
        return f"{words[0].upper()}{words[1:]}."
    best = found.ranked(row, 1)[0]
    return f"Most probable: {best.words}. That none of these paints explain it: {found.none[row]:.1%}."


def doubtful(found: Identification, row: int, least: float = 0.05, most: float = 0.95) -> str:
    """Paints that may or may not be in the film, in words; empty if there are none."""
    chances = found.paint_probability[row]
    open_ = [i for i in np.argsort(-chances) if least < chances[i] < most]
    if not open_:
        return ""
    return "Not settled by this spectrum: " + ", ".join(f"{found.paints[i]} ({chances[i]:.0%})" for i in open_)


def _table(found: Identification, row: int, top: int) -> Table:
    table = Table(title=found.measured.names[row], title_justify="left", box=None)
    table.add_column("paints", overflow="fold")
    titles = (
        ["probability", "RMSE", "angle", "ΔE00"]
        if found.opaque
        else ["probability", "thickness", "RMSE", "angle", "ΔE00"]
    )
    for title in titles:
        table.add_column(title, justify="right", no_wrap=True)
    for candidate in found.ranked(row, top):
        cells = [_chance(candidate.probability)]
        if not found.opaque:
            cells.append(f"{_length(candidate.thickness)} ± {_length(candidate.thickness_sd)} µm")
        colour = "-" if np.isnan(candidate.delta_e) else f"{candidate.delta_e:.2f}"
        table.add_row(candidate.words, *cells, f"{candidate.rmse:.4f}", f"{candidate.angle:.2f}°", colour)
    return table


def _length(metres: float) -> str:
    """Micrometres, without a power of ten."""
    value = metres * 1e6
    return f"{value:.0f}" if value >= 9.5 else f"{value:.1f}" if value >= 0.95 else f"{value:.2f}"


def _chance(probability: float) -> str:
    return f"{probability:.1%}" if probability >= 0.001 else "< 0.1%"


def rows(found: Identification, top: int) -> Iterator[list[object]]:
    """Cells of `COLUMNS`, a row an explanation."""
    for row, name in enumerate(found.measured.names):
        for rank, candidate in enumerate(found.ranked(row, top), start=1):
            cells: list[object] = [name, rank, candidate.probability]
            for n in range(3):
                if n < len(candidate.paints):
                    share, sd = candidate.fractions[n], candidate.fractions_sd[n]
                    cells += [candidate.paints[n], share, sd, candidate.coats[n] + 1]
                else:
                    cells += ["", "", "", ""]
            thick = ["", ""] if found.opaque else [candidate.thickness * 1e6, candidate.thickness_sd * 1e6]
            colour = "" if np.isnan(candidate.delta_e) else candidate.delta_e
            cells += [*thick, candidate.rmse, candidate.angle, colour, candidate.gloss]
            yield [*cells, found.none[row], bool(found.explained[row])]


def write_candidates(found: Identification, path: Path, top: int, *, overwrite: bool = False) -> None:
    """Write the ranked explanations, a line each."""
    write_table(path, COLUMNS, rows(found, top), overwrite=overwrite)


def write_residuals(found: Identification, path: Path, *, overwrite: bool = False) -> None:
    """Write measured, fitted and residual spectra of the best explanations, a line a spectrum, ground and band."""
    header = ("spectrum", "ground", "wavelength_nm", "measured", "fitted", "residual")
    lines = (
        (name, ground + 1, f"{nm:g}", readings[ground, band], fitted[ground, band], off[ground, band])
        for name, readings, fitted, off in zip(
            found.measured.names, found.measured.readings, found.fitted[:, 0], found.residual[:, 0], strict=True
        )
        for ground in range(readings.shape[0])
        for band, nm in enumerate(found.measured.wavelengths)
    )
    write_table(path, header, lines, overwrite=overwrite)


def picture(found: Identification, path: Path, top: int = 3) -> int:
    """Draw measured and fitted spectra, residuals and probabilities of the first spectra.

    Returns:
        Spectra drawn.
    """
    from matplotlib.figure import Figure

    count = min(len(found), _PICTURED)
    figure = Figure(figsize=(12, 3.3 * count), layout="constrained")
    axes = figure.subplots(count, 3, squeeze=False, width_ratios=(1.2, 1, 1))
    for row in range(count):
        candidates = found.ranked(row, top)
        _draw(found, row, candidates, axes[row])
    figure.savefig(path, dpi=110)
    return count


def _draw(found: Identification, row: int, candidates: list[Candidate], axes: np.ndarray) -> None:
    spectra, residuals, chances = axes
    grid, readings = found.measured.wavelengths, found.measured.readings[row]
    for ground, reading in enumerate(readings):
        spectra.plot(grid, reading, "o", color="0.25", ms=3.5, mfc="none", label="measured" if ground == 0 else None)
    for n, (candidate, colour) in enumerate(zip(candidates, _COLOURS, strict=False)):
        for ground in range(len(readings)):
            first = ground == 0
            label = candidate.words if first else None
            spectra.plot(grid, candidate.fitted[ground], "-", color=colour, lw=1.4 - 0.3 * n, label=label)
            residuals.plot(grid, candidate.residual[ground], "-" if first else "--", color=colour, lw=1.2)
    spectra.set(ylim=(0, max(1.0, float(readings.max()) * 1.05)), ylabel="reflectance")
    spectra.set_title(found.measured.names[row], fontsize=10)
    residuals.axhline(0, color="0.7", lw=0.8)
    residuals.set(ylabel="measured - fitted")
    residuals.set_title("residual" + (", dashed over the next ground" if len(readings) > 1 else ""), fontsize=10)
    for axis in (spectra, residuals):
        axis.set(xlabel="wavelength (nm)")
    names = [candidate.words for candidate in candidates] + ["all others", "none of the catalogue"]
    shown = [candidate.probability for candidate in candidates]
    values = [*shown, max(0.0, 1.0 - sum(shown) - found.none[row]), found.none[row]]
    colours = [*_COLOURS[: len(candidates)], "0.7", "0.3"]
    chances.barh(np.arange(len(names)), values, color=colours)
    chances.set(xlim=(0, 1), xlabel="probability", ylim=(len(names) - 0.4, -0.85))
    chances.set_yticks([])
    for place, name in enumerate(names):
        chances.text(0.01, place - 0.42, name, fontsize=7.5, va="bottom", ha="left")
    for place, bar in enumerate(chances.patches):
        bar.set_height(0.45)
        bar.set_y(place - 0.4 + 0.02)
