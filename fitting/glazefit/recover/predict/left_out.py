"""Report of films that were left out of a joint fit and predicted: on the screen, in a file, and in
a picture.
"""

import textwrap
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from rich.console import RenderableType
from rich.text import Text

from glazejax.plots import OVER_BLACK, OVER_WHITE, picture

from ..films.report import Table
from ..joint.report import describe_recipe
from ..joint.result import JointRecovery
from .crossvalidation import LeftOut
from .prediction import PARTS

LEFT_OUT_COLUMNS = (
    "film",
    "recipe",
    "delta_e_black",
    "delta_e_white",
    "delta_e_expected",
    "inside_90_percent_band",
    "delta_e_fitted_black",
    "delta_e_fitted_white",
)


def report_left_out(out: LeftOut) -> Iterator[RenderableType]:
    """Say how well films that were left out of the fit were predicted by the others."""
    off = out.predicted.mean(axis=1)
    farthest = int(off.argmax())
    yield (
        f"Left out in turn and predicted from their recipes, {len(out.names)} mixtures: ΔE00 "
        f"(D65, 10°) {off.mean():.2f} on average, median {np.median(off):.2f}, {off[farthest]:.2f} "
        f"at most ({out.names[farthest]}); {out.inside.mean():.0%} of the readings lie in the 90 % "
        "bands."
    )
    errors = {
        source: np.mean(
            [prediction.expected_error(parts=(source,)) for prediction in out.predictions]
        )
        for source in PARTS
    }
    yield (
        f"What they were expected to be off, ΔE00 {out.expected.mean():.1f} on average, comes "
        f"from the film ({errors['film']:.1f}, as the other films left out show), from the scale "
        f"of its paints ({errors['scale']:.1f}) and from the shape of their k and s "
        f"({errors['paint']:.1f}). Two mixings of one recipe differ by about ΔE00 "
        f"{np.mean([prediction.between_mixings() for prediction in out.predictions]):.1f}."
    )
    unsteady = {p: chance for p, chance in out.variation.unsteady.items() if chance >= 0.5}
    if unsteady:
        listed = ", ".join(f"{paint} ({chance:.0%})" for paint, chance in unsteady.items())
        yield (
            "Films of these paints are probably twice as far from their recipes as films are on "
            f"average; such paint fades, stains or is hard to weigh: {listed}. Behind each, how "
            "probable that is."
        )
    if not out.complete:
        yield Text("Interrupted: the mixtures that follow were not left out.", "yellow")


def left_out_table(recovery: JointRecovery, out: LeftOut) -> Table:
    """Colour differences of each film as the others predict it, and as they were expected."""
    rows = (
        (
            name,
            describe_recipe(recovery, recovery.films.names.index(name)),
            *(f"{value:.3f}" for value in out.predicted[i]),
            f"{out.expected[i]:.3f}",
            f"{out.inside[i]:.3f}",
            *(f"{value:.3f}" for value in out.fitted[i]),
        )
        for i, name in enumerate(out.names)
    )
    return LEFT_OUT_COLUMNS, rows


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
            for card, (spectrum, colour) in enumerate(
                ((prediction.over_black, OVER_BLACK), (prediction.over_white, OVER_WHITE))
            ):
                axis.fill_between(
                    prediction.wavelengths, low[card], high[card], color=colour, alpha=0.18, lw=0
                )
                axis.plot(prediction.wavelengths, spectrum, "-", color=colour, lw=1.1)
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
