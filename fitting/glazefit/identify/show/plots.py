"""Picture of an identification: measured and fitted spectra, residuals and probabilities."""

from pathlib import Path

import numpy as np

from glazejax.plots import ABSORPTION, SCATTERING, label_spectra, picture

from ..result import Candidate, Identification

_COLOURS = (ABSORPTION, SCATTERING, "#41732b")


def plot_identification(found: Identification, path: Path, top: int = 3) -> int:
    """Draw measured and fitted spectra, residuals and probabilities of the first spectra.

    Returns:
        Spectra drawn.
    """
    count = min(len(found), 6)
    with picture(path, 12, 3.3 * count) as figure:
        axes = figure.subplots(count, 3, squeeze=False, width_ratios=(1.2, 1, 1))
        for row in range(count):
            _draw(found, row, found.ranked(row, top), axes[row])
    return count


def _draw(found: Identification, row: int, candidates: list[Candidate], axes: np.ndarray) -> None:
    spectra, residuals, chances = axes
    grid = found.measured.wavelengths
    readings = found.measured.readings[row]
    for ground, reading in enumerate(readings):
        spectra.plot(
            grid,
            reading,
            "o",
            color="0.25",
            ms=3.5,
            mfc="none",
            label="measured" if ground == 0 else None,
        )
    # A fit that is a thousand times less probable would only stretch the axes of the others.
    likely = [one for one in candidates if one.probability >= 0.001 * candidates[0].probability]
    for n, (candidate, colour) in enumerate(zip(likely, _COLOURS, strict=False)):
        for ground in range(len(readings)):
            first = ground == 0
            label = candidate.words if first else None
            spectra.plot(
                grid, candidate.fitted[ground], "-", color=colour, lw=1.4 - 0.3 * n, label=label
            )
            residuals.plot(
                grid, candidate.residual[ground], "-" if first else "--", color=colour, lw=1.2
            )
    label_spectra(spectra, ylim=(0, max(1.0, float(readings.max()) * 1.05)))
    spectra.set_title(f"{found.measured.names[row]}: circles measured, lines fitted")
    residuals.axhline(0, color="0.7", lw=0.8)
    label_spectra(residuals, "measured - fitted")
    residuals.set_title("residual" + (", dashed over the next ground" if len(readings) > 1 else ""))
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
