"""The picture of run time against error: curves named at their ends, colours that colour-blind readers can tell."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Style(NamedTuple):
    """How a curve is drawn."""

    colour: str
    line: str
    marker: str
    thick: bool = False


def draw(curves: dict[str, tuple[Style, Sequence[tuple[float, float]]]]) -> "Figure":
    """Log-log plot of (error, seconds) of each named curve; accuracy grows to the right."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.5, 6.2))
    axes = figure.add_subplot()
    ends = []
    for name, (style, points) in curves.items():
        errors, seconds = np.array(points).T
        axes.plot(
            errors,
            1e3 * seconds,
            linestyle=style.line,
            marker=style.marker,
            color=style.colour,
            linewidth=2.4 if style.thick else 1.4,
            markersize=5.5 if style.thick else 4.5,
            zorder=3 if style.thick else 2,
        )
        ends.append((errors[-1], 1e3 * seconds[-1], name, style))
    axes.set(xscale="log", yscale="log", xlabel="largest relative error of the spectrum", ylabel="run time / ms")
    axes.invert_xaxis()
    axes.set_title("41 wavelengths x 2 layers: run time against error", loc="left", fontsize=11)
    axes.grid(True, which="major", color="0.9", linewidth=0.8)
    axes.spines[["top", "right"]].set_visible(False)
    left, right = axes.get_xlim()
    axes.set_xlim(left, right / 60)  # room for the names
    _name(axes, ends)
    return figure


def _name(axes, ends: list) -> None:
    """Write each name beside its curve's last point, moved up or down where names would touch."""
    height = 11.0  # points from one name to the next
    scale = axes.figure.dpi / 72
    placed: list[tuple[float, float]] = []
    for error, time, name, style in sorted(ends, key=lambda end: end[1]):
        x, y = axes.transData.transform((error, time)) / scale
        width = 5.6 * len(name)
        while any(abs(y - other) < height and abs(x - at) < width for at, other in placed):
            y += 1.0
        placed.append((x, y))
        shift = y - axes.transData.transform((error, time))[1] / scale
        axes.annotate(
            name,
            (error, time),
            xytext=(8, shift),
            textcoords="offset points",
            va="center",
            fontsize=9,
            color=style.colour,
            fontweight="bold" if style.thick else "normal",
            bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.5},
            zorder=4,
        )
