"""Pictures of recoveries and predictions: spectra as measured and as fitted, k and s of a paint,
and films that were predicted.
"""

import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from jaxtyping import Bool, Float

from glazejax.plots import ABSORPTION, OVER_BLACK, OVER_WHITE, SCATTERING, label_spectra, picture
from glazejax.spectra import Bands

from ..coats.coats import CoatPrediction, CoatRecovery
from ..films.result import Recovery
from ..joint.result import JointRecovery
from ..predict.crossvalidation import LeftOut
from .report import describe_recipe

if TYPE_CHECKING:
    from matplotlib.axes import Axes

BandCoefficients: TypeAlias = Float[np.ndarray, "bands 2"]
"""k and s at each band."""


def plot_paint(recovery: Recovery, row: int, thickness: float, path: Path) -> None:
    """Draw one paint of a recovery to a file.

    Args:
        recovery: recovered films.
        row: number of the film.
        thickness: assumed, m.
        path: of the picture; its ending chooses the format.
    """
    films = recovery.films
    grid = recovery.films.wavelengths
    with picture(path, 10, 4.2) as figure:
        spectra, coefficients = figure.subplots(1, 2)
        for measured, fitted, colour, card in (
            (films.over_white[row], recovery.fitted_white[row], OVER_WHITE, "white"),
            (films.over_black[row], recovery.fitted_black[row], OVER_BLACK, "black"),
        ):
            spectra.plot(
                grid, measured, "o", color=colour, ms=4, mfc="none", label=f"over {card}, measured"
            )
            spectra.plot(grid, fitted, "-", color=colour, lw=1.2, label=f"over {card}, fitted")
        spectra.plot(grid, films.bare_white[row], ":", color="0.6", lw=1, label="bare cards")
        spectra.plot(grid, films.bare_black[row], ":", color="0.6", lw=1)
        label_spectra(spectra, ylim=(0, 1))
        spectra.legend()
        gloss = "" if recovery.gloss[row] == 1 else f", gloss {recovery.gloss[row]:.2f}"
        spectra.set_title(f"{films.names[row]}: RMSE {recovery.rmse[row]:.5f}{gloss}")

        identifiable = recovery.identifiable[row]
        values = np.column_stack([recovery.absorption[row], recovery.scattering[row]]) / thickness
        lower, upper = (ends[row] / thickness for ends in recovery.interval())
        draw_coefficients(coefficients, grid, values, np.maximum(lower, 1.0), upper, identifiable)
        coefficients.set_ylim(max(values.max() * 1e-6, values.min() / 2, 1.0), values.max() * 3)
        coefficients.set_title(f"if the film is {thickness * 1e6:g} µm thick; bands of 95 %")


def draw_coefficients(
    axes: "Axes",
    grid: Bands,
    values: BandCoefficients,
    lower: BandCoefficients,
    upper: BandCoefficients,
    identifiable: Bool[np.ndarray, "bands"],
) -> None:
    """k and s in 1/m with their bands, dotted where only their ratio is known."""
    for n, (colour, name) in enumerate(
        ((ABSORPTION, "absorption k"), (SCATTERING, "scattering s"))
    ):
        axes.plot(
            grid, np.where(identifiable, values[:, n], np.nan), "-o", color=colour, ms=3, label=name
        )
        axes.plot(grid, values[:, n], ":", color=colour, lw=1)
        axes.fill_between(
            grid,
            lower[:, n],
            upper[:, n],
            where=identifiable.tolist(),
            color=colour,
            alpha=0.2,
            lw=0,
        )
    if not identifiable.all():
        axes.plot([], [], ":", color="0.4", lw=1, label="too opaque: only k/s is known")
    label_spectra(axes, "coefficient (1/m)", yscale="log")
    axes.legend()


def plot_joint_paint(recovery: JointRecovery, row: int, path: Path) -> None:
    """Draw one paint.

    Args:
        recovery: joint recovery.
        row: number of the paint.
        path: of the picture; its ending chooses the format.
    """
    import matplotlib

    grid = recovery.wavelengths
    films = recovery.films
    paint = recovery.paints[row]
    holding = np.flatnonzero(recovery.shares[:, row] > 0)
    drawn = holding[np.argsort(-recovery.shares[holding, row])][:6]
    colours = matplotlib.colormaps["viridis"](np.linspace(0.0, 0.88, max(len(drawn), 1)))
    with picture(path, 11, 4.4) as figure:
        spectra, coefficients = figure.subplots(1, 2)
        for film, colour in zip(drawn, colours, strict=False):
            label = f"{films.names[film]}: {describe_recipe(recovery, int(film))}"
            # Where nothing was read there are copies of what was.
            black, white = np.where(films.seen[film], 1.0, np.nan)
            read_black, read_white = films.over_black[film] * black, films.over_white[film] * white
            spectra.plot(grid, read_white, "o", color=colour, ms=3.5, mfc="none", label=label)
            spectra.plot(grid, read_black, "s", color=colour, ms=3, mfc="none", alpha=0.6)
            spectra.plot(grid, recovery.fitted_white[film] * white, "-", color=colour, lw=1.1)
            spectra.plot(grid, recovery.fitted_black[film] * black, "--", color=colour, lw=1.0)
        label_spectra(spectra, ylim=(0, 1))
        spectra.legend(fontsize=7, loc="upper left")
        remark = f" ({len(drawn)} of its {len(holding)} films)" if len(holding) > len(drawn) else ""
        spectra.set_title(
            f"{paint}{remark}: over white (circles), over black (squares), lines fitted", fontsize=9
        )

        values = np.column_stack([recovery.absorption[row], recovery.scattering[row]])
        values = values / recovery.unit
        factor = np.exp(1.96 * recovery.log_sd[:, row].T)
        draw_coefficients(
            coefficients, grid, values, values / factor, values * factor, np.ones(grid.size, bool)
        )
        coefficients.set_ylim(values.min() / 4, values.max() * 4)
        coefficients.set_title(
            f"if a typical film is {recovery.unit * 1e6:g} µm thick; bands of 95 %", fontsize=9
        )


def plot_ladder(
    recovery: CoatRecovery, predictions: Sequence[CoatPrediction], paint: str, path: Path
) -> None:
    """Draw the ladder of a paint, read and fitted, with its films predicted and their 90 %
    bands.
    """
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


def plot_left_out(recovery: JointRecovery, out: LeftOut, path: Path) -> None:
    """Draw every film that was left out: as measured, as predicted, and the prediction's 90 % band.

    Args:
        recovery: of all films.
        out: films left out of it.
        path: of the picture; its ending chooses the format.
    """
    columns = min(6, len(out.names))
    rows = -(-len(out.names) // columns)
    with picture(path, 2.5 * columns + 0.4, 2.0 * rows + 0.9) as figure:
        axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
        for axis in axes.flat[len(out.names) :]:
            axis.set_axis_off()
        for i, (axis, prediction) in enumerate(zip(axes.flat, out.predictions, strict=False)):
            low, high = prediction.interval()
            for card, colour in enumerate((OVER_BLACK, OVER_WHITE)):
                spectrum = prediction.reflectance[card]
                axis.fill_between(
                    prediction.wavelengths, low[card], high[card], color=colour, alpha=0.18, lw=0
                )
                axis.plot(prediction.wavelengths, spectrum, "-", color=colour, lw=1.1)
                if not out.films.seen[i, card]:
                    continue
                axis.plot(
                    prediction.wavelengths,
                    out.measured[i, card],
                    "o",
                    color=colour,
                    ms=2.2,
                    mfc="none",
                    mew=0.7,
                )
            row = recovery.films.names.index(prediction.name)
            recipe = describe_recipe(recovery, row).replace(" + ", "\n+ ")
            title = f"{prediction.name}: {recipe}\nΔE00 {out.predicted[i].mean():.1f}"
            axis.set_title(title, fontsize=7, loc="left")
            axis.set_ylim(0, 1)
            axis.tick_params(labelsize=7)
        figure.supxlabel("wavelength (nm)", fontsize=8)
        figure.supylabel("reflectance", fontsize=8)
        caption = (
            "Films left out of the fit: measured over black (dark) and white (light), predicted "
            "(lines), 90 % bands"
        )
        figure.suptitle(textwrap.fill(caption, 40 * columns), fontsize=9)
