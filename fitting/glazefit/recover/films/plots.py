"""Picture of a film that was recovered by itself: its spectra and its k and s."""

from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from jaxtyping import Bool, Float

from glazejax.plots import ABSORPTION, OVER_BLACK, OVER_WHITE, SCATTERING, label_spectra, picture
from glazejax.spectra import Bands

from .result import Recovery

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
