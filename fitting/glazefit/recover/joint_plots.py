"""Pictures of a joint recovery: one a paint, with its films and its k and s; and the films that were left out."""

from pathlib import Path

import numpy as np

from .crossvalidation import LeftOut
from .joint_result import JointRecovery

_ABSORPTION, _SCATTERING = "#8c2d04", "#08519c"
_BLACK, _WHITE = "#333333", "#b8860b"
_SHOWN = 6
_COLUMNS = 6


def plot_joint_paint(recovery: JointRecovery, row: int, thickness: float, path: Path) -> None:
    """Draw one paint.

    Args:
        recovery: joint recovery.
        row: number of the paint.
        thickness: of a film of unit relative thickness, m.
        path: of the picture; its ending chooses the format.
    """
    import matplotlib
    from matplotlib.figure import Figure

    grid, films, paint = recovery.wavelengths, recovery.films, recovery.paints[row]
    figure = Figure(figsize=(11, 4.4), layout="constrained")
    spectra, coefficients = figure.subplots(1, 2)
    holding = np.flatnonzero(recovery.shares[:, row] > 0)
    shown = holding[np.argsort(-recovery.shares[holding, row])][:_SHOWN]
    colours = matplotlib.colormaps["viridis"](np.linspace(0.0, 0.88, max(len(shown), 1)))
    for film, colour in zip(shown, colours, strict=False):
        spectra.plot(
            grid, films.over_white[film], "o", color=colour, ms=3.5, mfc="none", label=_recipe(recovery, int(film))
        )
        spectra.plot(grid, films.over_black[film], "s", color=colour, ms=3, mfc="none", alpha=0.6)
        spectra.plot(grid, recovery.fitted_white[film], "-", color=colour, lw=1.1)
        spectra.plot(grid, recovery.fitted_black[film], "--", color=colour, lw=1.0)
    spectra.set(xlabel="wavelength (nm)", ylabel="reflectance", ylim=(0, 1))
    spectra.legend(frameon=False, fontsize=7, loc="upper left")
    more = f" ({len(shown)} of its {len(holding)} films)" if len(holding) > len(shown) else ""
    spectra.set_title(f"{paint}{more}: over white (circles), over black (squares), lines fitted", fontsize=9)

    for values, sd, colour, name in (
        (recovery.absorption[row], recovery.log_sd[0, row], _ABSORPTION, "absorption k"),
        (recovery.scattering[row], recovery.log_sd[1, row], _SCATTERING, "scattering s"),
    ):
        value = values / thickness
        coefficients.plot(grid, value, "-o", color=colour, ms=3, label=name)
        coefficients.fill_between(
            grid, value * np.exp(-1.96 * sd), value * np.exp(1.96 * sd), color=colour, alpha=0.2, lw=0
        )
    everything = np.concatenate([recovery.absorption[row], recovery.scattering[row]]) / thickness
    coefficients.set(
        xlabel="wavelength (nm)",
        ylabel="coefficient (1/m)",
        yscale="log",
        ylim=(everything.min() / 4, everything.max() * 4),
    )
    coefficients.legend(frameon=False, fontsize=8)
    coefficients.set_title(f"if a typical film is {thickness * 1e6:g} µm thick; bands of 95 %", fontsize=9)
    figure.savefig(path, dpi=110)


def plot_left_out(recovery: JointRecovery, out: LeftOut, path: Path) -> None:
    """Draw every film that was left out: as measured, as predicted, and the prediction's 90 % band.

    Args:
        recovery: of all films.
        out: films left out of it.
        path: of the picture; its ending chooses the format.
    """
    from matplotlib.figure import Figure

    columns = min(_COLUMNS, len(out.names))
    rows = -(-len(out.names) // columns)
    figure = Figure(figsize=(2.5 * columns + 0.4, 2.0 * rows + 0.9), layout="constrained")
    axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    for axis in axes.flat[len(out.names) :]:
        axis.set_axis_off()
    for i, (axis, found) in enumerate(zip(axes.flat, out.predictions, strict=False)):
        low, high = found.interval()
        for card, (spectrum, colour) in enumerate(((found.over_black, _BLACK), (found.over_white, _WHITE))):
            axis.fill_between(found.wavelengths, low[card], high[card], color=colour, alpha=0.18, lw=0)
            axis.plot(found.wavelengths, spectrum, "-", color=colour, lw=1.1)
            axis.plot(found.wavelengths, out.measured[i, card], "o", color=colour, ms=2.2, mfc="none", mew=0.7)
        recipe = _recipe(recovery, recovery.films.names.index(found.name)).replace(" + ", "\n+ ")
        axis.set_title(f"{recipe}\nΔE00 {out.predicted[i].mean():.1f}", fontsize=7, loc="left")
        axis.set_ylim(0, 1)
        axis.tick_params(labelsize=7)
    figure.supxlabel("wavelength (nm)", fontsize=8)
    figure.supylabel("reflectance", fontsize=8)
    figure.suptitle(
        "Films left out of the fit: measured over black (dark) and white (light), predicted (lines), 90 % bands",
        fontsize=9,
    )
    figure.savefig(path, dpi=110)


def _recipe(recovery: JointRecovery, film: int) -> str:
    """Recipe of a film in short."""
    parts = sorted(recovery.recipe(film).items(), key=lambda part: -part[1])
    if len(parts) == 1:
        return f"{recovery.films.names[film]} pure"
    return f"{recovery.films.names[film]} " + " + ".join(f"{share:.3g} {paint}" for paint, share in parts)
