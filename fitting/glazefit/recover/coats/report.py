"""Report of a recovery from coats: a table on the screen, and the files it leaves."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from rich.console import RenderableType
from rich.text import Text

from glazejax.report import plain_table

from .coats import CoatPrediction, CoatRecovery, CoatScattering

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


def report_coats(
    recovery: CoatRecovery, predictions: Sequence[CoatPrediction], seconds: float
) -> Iterator[RenderableType]:
    """A line a paint, and what is predicted of each."""
    title = (
        f"{len(recovery.paints)} paints from {len(recovery.films)} films of coats in "
        f"{seconds:.1f} s"
    )
    table = plain_table("paint", "coats", "s d of one coat", "met to", title=title)
    for paint, fit in recovery.paints.items():
        coats = ", ".join(f"{recovery.coats[name]:g}" for name in fit.films.names)
        table.add_row(
            paint,
            coats,
            _factor(recovery.scattering(paint)),
            f"ΔE00 {fit.delta_e().mean():.1f}",
        )
    yield table
    yield Text(
        "s d: scattering times thickness of one coat, mean over the bands, × or ÷ one "
        "standard deviation.",
        "dim",
    )
    for prediction in predictions:
        thickest = recovery.thickest(prediction.paint)
        change = float(prediction.delta_e(thickest.reflectance))
        yield (
            f"{prediction.paint}, {prediction.coats:g} coats on the ground of {thickest.name!r}: "
            f"ΔE00 {change:.1f} from that film, predicted to "
            f"ΔE00 {prediction.expected_error():.1f}."
        )
    yield Text.assemble(
        f"Films of equal coats may differ in thickness by {np.expm1(recovery.spread):.0%}. ",
        ("The unit is a typical coat: no length was measured.", "bold"),
    )
    for paint, fit in recovery.paints.items():
        if not fit.converged:
            yield Text(f"{paint}: the solver did not settle in {fit.steps} steps.", "yellow")


def plot_ladder(
    recovery: CoatRecovery, predictions: Sequence[CoatPrediction], paint: str, path: Path
) -> None:
    """Draw the ladder of a paint, read and fitted, with its films predicted and their 90 %
    bands.
    """
    from glazejax.plots import label_spectra, picture

    grid = recovery.wavelengths
    fit = recovery.paints[paint]
    with picture(path, 6, 4.2) as figure:
        spectra = figure.subplots()
        for row, name in enumerate(fit.films.names):
            (line,) = spectra.plot(grid, fit.fitted_white[row], label=f"{name}, fitted")
            read = recovery.film(name).reflectance
            spectra.plot(grid, read, "o", color=line.get_color(), ms=4, mfc="none")
        for prediction in predictions:
            if prediction.paint != paint:
                continue
            label = f"{prediction.coats:g} coats, predicted"
            (line,) = spectra.plot(grid, prediction.reflectance, "--", label=label)
            spectra.fill_between(
                grid, *prediction.interval(), color=line.get_color(), alpha=0.15, lw=0
            )
        ground = recovery.thickest(paint).ground
        spectra.plot(grid, ground, ":", color="0.6", lw=1, label="bare ground")
        label_spectra(spectra, ylim=(0, 1))
        spectra.legend()
        spectra.set_title(paint)


def coat_rows(recovery: CoatRecovery) -> Iterator[tuple[object, ...]]:
    """A row a film, of `FILM_COLUMNS`."""
    for paint, fit in recovery.paints.items():
        difference = fit.delta_e().mean(axis=1)
        for row, name in enumerate(fit.films.names):
            yield (
                name,
                paint,
                f"{recovery.coats[name]:g}",
                f"{fit.thickness[row]:.4g}",
                f"{fit.thickness_sd[row]:.2g}",
                f"{fit.rmse[row]:.5f}",
                f"{difference[row]:.3f}",
            )


def next_coat_rows(predictions: Sequence[CoatPrediction]) -> Iterator[tuple[object, ...]]:
    """A row a film predicted and wavelength, of `NEXT_COLUMNS`."""
    for prediction in predictions:
        columns = (prediction.reflectance, *prediction.interval())
        for band, wavelength in enumerate(prediction.wavelengths):
            yield (
                prediction.paint,
                f"{prediction.coats:g}",
                f"{wavelength:g}",
                *(f"{column[band]:.5f}" for column in columns),
            )


def _factor(scattering: CoatScattering) -> str:
    return f"{np.exp(scattering.mean):.2g} ×÷ {np.exp(scattering.sd):.2g}"
