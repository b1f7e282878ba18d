"""What a recovery from coats tells its user: a table on the screen, and the files it leaves."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import equinox as eqx
import numpy as np
from rich.console import Console

from glazejax.io import write_table
from glazejax.paint.pigment_table import write_pigments
from glazejax.report import plain_table

from .coats import CoatPrediction, CoatRecovery, CoatScattering
from .report import draw_each

FILM_COLUMNS = (
    "film",
    "paint",
    "coats",
    "relative_thickness",
    "relative_thickness_sd",
    "rmse",
    "delta_e",
)
NEXT_COLUMNS = ("paint", "coats", "wavelength_nm", "reflectance", "low_90", "high_90")


def print_coats(
    recovery: CoatRecovery, foretold: Sequence[CoatPrediction], console: Console, seconds: float
) -> None:
    """Print a line a paint, and what is foretold of each."""
    title = (
        f"{len(recovery.paints)} paints from {len(recovery.films)} films of coats in "
        f"{seconds:.1f} s"
    )
    table = plain_table("paint", "coats", "s d of one coat", "met to", title=title)
    for paint, found in recovery.paints.items():
        coats = ", ".join(f"{recovery.coats[name]:g}" for name in found.films.names)
        table.add_row(
            paint,
            coats,
            _factor(recovery.scattering(paint)),
            f"ΔE00 {found.delta_e().mean():.1f}",
        )
    console.print(table)
    console.print(
        "[dim]s d: scattering times thickness of one coat, mean over the bands, × or ÷ one "
        "standard deviation.[/dim]"
    )
    for prediction in foretold:
        thickest = recovery.thickest(prediction.paint)
        change = float(prediction.delta_e(thickest.reflectance))
        console.print(
            f"{prediction.paint}, {prediction.coats:g} coats on the ground of {thickest.name!r}: "
            f"ΔE00 {change:.1f} from that film, foretold to ΔE00 {prediction.expected_error():.1f}."
        )
    console.print(
        f"Films of equal coats may differ in thickness by {np.expm1(recovery.spread):.0%}. "
        "[bold]The unit is a typical coat: no length was measured.[/bold]"
    )
    for paint, found in recovery.paints.items():
        if not found.converged:
            console.print(
                f"[yellow]{paint}: the solver did not settle in {found.steps} steps.[/yellow]"
            )


def write_coats(
    recovery: CoatRecovery,
    foretold: Sequence[CoatPrediction],
    thickness: float,
    folder: Path,
    *,
    overwrite: bool = False,
) -> None:
    """Write `pigments.csv` (k and s in 1/m, if a coat is this thick, m), `films.csv`, and
    `next_coats.csv`, the films foretold with their 90 % bands.
    """
    paints = [found.pigment(paint, thickness) for paint, found in recovery.paints.items()]
    plain = [eqx.tree_at(lambda paint: paint.error_modes, paint, None) for paint in paints]
    write_pigments(folder / "pigments.csv", plain, digits=6, overwrite=overwrite)
    write_table(folder / "films.csv", FILM_COLUMNS, _film_rows(recovery), overwrite=overwrite)
    write_table(folder / "next_coats.csv", NEXT_COLUMNS, _next_rows(foretold), overwrite=overwrite)


def plot_coats(
    recovery: CoatRecovery,
    foretold: Sequence[CoatPrediction],
    folder: Path,
    step: Callable[[], object] = lambda: None,
) -> None:
    """Draw the ladder of every paint, read and fitted, with the films foretold and their 90 %
    bands, to its own file, and call `step` after each.
    """
    from glazejax.plots import label_spectra, picture

    grid = recovery.wavelengths
    paints = list(recovery.paints)

    def draw(number: int, path: Path) -> None:
        paint = paints[number]
        found = recovery.paints[paint]
        with picture(path, 6, 4.2) as figure:
            spectra = figure.subplots()
            for row, name in enumerate(found.films.names):
                (line,) = spectra.plot(grid, found.fitted_white[row], label=f"{name}, fitted")
                read = recovery.film(name).reflectance
                spectra.plot(grid, read, "o", color=line.get_color(), ms=4, mfc="none")
            for prediction in foretold:
                if prediction.paint != paint:
                    continue
                words = f"{prediction.coats:g} coats, foretold"
                (line,) = spectra.plot(grid, prediction.reflectance, "--", label=words)
                spectra.fill_between(
                    grid, *prediction.interval(), color=line.get_color(), alpha=0.15, lw=0
                )
            ground = recovery.thickest(paint).ground
            spectra.plot(grid, ground, ":", color="0.6", lw=1, label="bare ground")
            label_spectra(spectra, ylim=(0, 1))
            spectra.legend()
            spectra.set_title(paint)

    draw_each(paints, folder, draw, step)


def _film_rows(recovery: CoatRecovery) -> Iterator[tuple[object, ...]]:
    for paint, found in recovery.paints.items():
        difference = np.where(found.films.seen, found.delta_e(), np.nan)
        for row, name in enumerate(found.films.names):
            yield (
                name,
                paint,
                f"{recovery.coats[name]:g}",
                f"{found.thickness[row]:.4g}",
                f"{found.thickness_sd[row]:.2g}",
                f"{found.rmse[row]:.5f}",
                f"{np.nanmean(difference[row]):.3f}",
            )


def _next_rows(foretold: Sequence[CoatPrediction]) -> Iterator[tuple[object, ...]]:
    for prediction in foretold:
        columns = (prediction.reflectance, *prediction.interval(0.9))
        for band, wavelength in enumerate(prediction.wavelengths):
            yield (
                prediction.paint,
                f"{prediction.coats:g}",
                f"{wavelength:g}",
                *(f"{column[band]:.5f}" for column in columns),
            )


def _factor(level: CoatScattering) -> str:
    return f"{np.exp(level.mean):.2g} ×÷ {np.exp(level.sd):.2g}"
