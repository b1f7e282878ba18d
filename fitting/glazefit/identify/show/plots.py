"""Picture of an identification: measured and fitted spectra, residuals and probabilities."""

from pathlib import Path

import numpy as np

from glazejax.plots import ABSORPTION, SCATTERING, label_spectra, picture

from ..result import Identification
from .explanation import LEAST, explanations

_COLOURS = (ABSORPTION, SCATTERING, "#41732b")


def plot_identification(identification: Identification, path: Path) -> int:
    """Draw measured and fitted spectra, residuals and probabilities of the first spectra.

    Args:
        identification: its result.
        path: of the picture.

    Returns:
        Spectra drawn.
    """
    count = min(len(identification), 6)
    with picture(path, 12, 3.3 * count) as figure:
        axes = figure.subplots(count, 3, squeeze=False, width_ratios=(1.2, 1, 1))
        for row in range(count):
            _draw(identification, row, axes[row])
    return count


def _draw(identification: Identification, row: int, axes: np.ndarray) -> None:
    spectra, residuals, chances = axes
    grid = identification.measured.wavelengths
    readings = identification.measured.readings[row]
    for reading in readings:
        spectra.plot(grid, reading, "o", color="0.25", ms=3.5, mfc="none")
    films = explanations(identification, row, len(_COLOURS))
    likely = [film for film in films if film.probability >= LEAST * films[0].probability]
    for n, (film, colour) in enumerate(zip(likely, _COLOURS, strict=False)):
        for ground, fitted in enumerate(film.fitted):
            spectra.plot(grid, fitted, "-", color=colour, lw=1.4 - 0.3 * n)
            style = "--" if ground else "-"
            residuals.plot(grid, readings[ground] - fitted, style, color=colour, lw=1.2)
    highest = max(
        float(np.nanmax(curves)) for curves in (readings, *(film.fitted for film in likely))
    )
    label_spectra(spectra, ylim=(0, 1.05 * highest))
    spectra.set_title(f"{identification.measured.names[row]}: circles measured, lines fitted")
    residuals.axhline(0, color="0.7", lw=0.8)
    label_spectra(residuals, "measured - fitted")
    residuals.set_title("residual" + (", dashed over the next ground" if len(readings) > 1 else ""))
    names = [film.words for film in films] + ["all others", "none of the catalogue"]
    probabilities = [film.probability for film in films]
    values = [
        *probabilities,
        max(0.0, 1.0 - sum(probabilities) - identification.none[row]),
        identification.none[row],
    ]
    colours = [*_COLOURS[: len(films)], "0.7", "0.3"]
    chances.barh(np.arange(len(names)) - 0.155, values, height=0.45, color=colours)
    chances.set(xlim=(0, 1), xlabel="probability", ylim=(len(names) - 0.4, -0.85))
    chances.set_yticks([])
    for position, name in enumerate(names):
        chances.text(0.01, position - 0.42, name, fontsize=7.5, va="bottom", ha="left")
