"""One picture a paint: its spectra as measured and as fitted, and its k and s with their errors."""

from pathlib import Path

import numpy as np

from .result import Recovery

_BLACK, _WHITE = "#333333", "#b8860b"
_ABSORPTION, _SCATTERING = "#8c2d04", "#08519c"


def plot_paint(recovery: Recovery, row: int, thickness: float, path: Path) -> None:
    """Draw one paint of a recovery to a file.

    Args:
        recovery: recovered films.
        row: number of the film.
        thickness: assumed, m.
        path: of the picture; its ending chooses the format.
    """
    from matplotlib.figure import Figure

    films, grid = recovery.films, recovery.films.wavelengths
    figure = Figure(figsize=(10, 4.2), layout="constrained")
    spectra, coefficients = figure.subplots(1, 2)
    for measured, fitted, colour, card in (
        (films.over_white[row], recovery.fitted_white[row], _WHITE, "white"),
        (films.over_black[row], recovery.fitted_black[row], _BLACK, "black"),
    ):
        spectra.plot(grid, measured, "o", color=colour, ms=4, mfc="none", label=f"over {card}, measured")
        spectra.plot(grid, fitted, "-", color=colour, lw=1.2, label=f"over {card}, fitted")
    spectra.plot(grid, films.bare_white[row], ":", color="0.6", lw=1, label="bare cards")
    spectra.plot(grid, films.bare_black[row], ":", color="0.6", lw=1)
    spectra.set(xlabel="wavelength (nm)", ylabel="reflectance", ylim=(0, 1))
    spectra.legend(frameon=False, fontsize=8)
    gloss = "" if recovery.gloss[row] == 1 else f", gloss {recovery.gloss[row]:.2f}"
    spectra.set_title(f"{films.names[row]}: RMSE {recovery.rmse[row]:.5f}{gloss}", fontsize=10)

    known = recovery.identifiable[row]
    lower, upper = recovery.interval()
    for n, (values, colour, name) in enumerate(
        ((recovery.absorption, _ABSORPTION, "absorption k"), (recovery.scattering, _SCATTERING, "scattering s"))
    ):
        value = values[row] / thickness
        coefficients.plot(grid, np.where(known, value, np.nan), "-o", color=colour, ms=3, label=name)
        coefficients.plot(grid, value, ":", color=colour, lw=1)
        coefficients.fill_between(
            grid,
            np.maximum(lower[row, :, n] / thickness, 1.0),
            upper[row, :, n] / thickness,
            where=known.tolist(),
            color=colour,
            alpha=0.2,
            lw=0,
        )
    if not known.all():
        coefficients.plot([], [], ":", color="0.4", lw=1, label="too opaque: only k/s is known")
    everything = np.concatenate([recovery.absorption[row], recovery.scattering[row]]) / thickness
    floor = max(everything.max() * 1e-6, everything.min() / 2, 1.0)
    coefficients.set(
        xlabel="wavelength (nm)", ylabel="coefficient (1/m)", yscale="log", ylim=(floor, everything.max() * 3)
    )
    coefficients.legend(frameon=False, fontsize=8)
    coefficients.set_title(f"if the film is {thickness * 1e6:g} µm thick; bands of 95 %", fontsize=10)
    figure.savefig(path, dpi=110)
