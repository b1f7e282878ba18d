"""Picture of a paint of a joint recovery: its films' spectra, and its k and s."""

from pathlib import Path

import numpy as np

from glazejax.plots import label_spectra, picture

from ..films.plots import draw_coefficients
from .report import describe_recipe
from .result import JointRecovery


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
            spectra.plot(
                grid, films.over_white[film], "o", color=colour, ms=3.5, mfc="none", label=label
            )
            spectra.plot(
                grid, films.over_black[film], "s", color=colour, ms=3, mfc="none", alpha=0.6
            )
            spectra.plot(grid, recovery.fitted_white[film], "-", color=colour, lw=1.1)
            spectra.plot(grid, recovery.fitted_black[film], "--", color=colour, lw=1.0)
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
