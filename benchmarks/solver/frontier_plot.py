"""The picture of run time against error, in colours that colour-blind readers can distinguish."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from matplotlib.figure import Figure


PAPER, OTHERS = "left", "right"
BOTH = (PAPER, OTHERS)
_TITLES = {PAPER: "next to the method of paper A", OTHERS: "next to other programs"}


class Style(NamedTuple):
    """How a curve is drawn, and in which panel."""

    colour: str
    line: str
    marker: str
    panel: str | tuple[str, ...] = OTHERS
    thick: bool = False


def draw(curves: dict[str, tuple[Style, Sequence[tuple[float, float]]]]) -> "Figure":
    """Log-log plots of (error, seconds) of each named curve; accuracy grows to the right."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(14.5, 7.0), layout="constrained")
    panels = figure.subplots(1, 2, sharey=True)
    for panel, axes in zip(BOTH, panels, strict=True):
        _draw(axes, {name: curve for name, curve in curves.items() if panel in curve[0].panel})
        axes.set_title(_TITLES[panel], loc="left", fontsize=11)
    panels[0].set_ylabel("run time / ms")
    figure.suptitle("Run time against error: 41 wavelengths x 2 layers, one geometry", fontsize=12)
    return figure


def _draw(axes, curves: dict) -> None:
    for name, (style, points) in curves.items():
        errors, seconds = np.array(points).T
        axes.plot(
            errors,
            1e3 * seconds,
            label=name,
            linestyle=style.line,
            marker=style.marker,
            color=style.colour,
            linewidth=2.4 if style.thick else 1.4,
            markersize=5.5 if style.thick else 4.5,
            zorder=3 if style.thick else 2,
        )
    axes.set(xscale="log", yscale="log", xlabel="largest relative error of the spectrum")
    axes.invert_xaxis()
    axes.grid(True, which="major", color="0.9", linewidth=0.8)
    axes.spines[["top", "right"]].set_visible(False)
    # Below, where no curve is.
    axes.legend(
        loc="upper center",
        bbox_to_anchor=(0.5, -0.1),
        ncols=3,
        fontsize=9,
        columnspacing=1.2,
        frameon=False,
    )
