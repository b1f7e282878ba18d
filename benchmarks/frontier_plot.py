"""The picture of run time against error: curves named at their ends, colours that colour-blind readers can tell."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from matplotlib.figure import Figure


PAPER, OTHERS = "left", "right"
BOTH = (PAPER, OTHERS)
_TITLES = {PAPER: "beside the method of paper A", OTHERS: "beside other programs"}


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

    figure = Figure(figsize=(14.5, 6.2), layout="constrained")
    panels = figure.subplots(1, 2, sharey=True)
    for panel, axes in zip(BOTH, panels, strict=True):
        _draw(axes, {name: curve for name, curve in curves.items() if panel in curve[0].panel})
        axes.set_title(_TITLES[panel], loc="left", fontsize=11)
    panels[0].set_ylabel("run time / ms")
    figure.suptitle("Run time against error: 41 wavelengths x 2 layers, one geometry", fontsize=12)
    figure.draw_without_rendering()  # names are placed by where the layout puts the points
    for panel, axes in zip(BOTH, panels, strict=True):
        _name(axes, {name: curve for name, curve in curves.items() if panel in curve[0].panel})
    return figure


def _draw(axes, curves: dict) -> None:
    for style, points in curves.values():
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
    axes.set(xscale="log", yscale="log", xlabel="largest relative error of the spectrum")
    axes.invert_xaxis()
    axes.grid(True, which="major", color="0.9", linewidth=0.8)
    axes.spines[["top", "right"]].set_visible(False)
    left, right = axes.get_xlim()
    axes.set_xlim(left, right / 3e3)  # room for the names


def _name(axes, curves: dict) -> None:
    """Write each name beside its curve's last point, moved up where it would touch a name or a marker."""
    height = 12.0  # points from one name to the next
    scale = axes.figure.dpi / 72
    ends = [(*points[-1], name, style) for name, (style, points) in curves.items()]
    markers = np.array([(error, 1e3 * seconds) for _, points in curves.values() for error, seconds in points])
    markers = axes.transData.transform(markers) / scale
    placed: list[tuple[float, float]] = []
    for error, seconds, name, style in sorted(ends, key=lambda end: end[1]):
        x, y = start = axes.transData.transform((error, 1e3 * seconds)) / scale
        width = 5.6 * len(name)

        def touches(y: float, x: float = x, width: float = width) -> bool:
            covered = (markers[:, 0] > x + 4) & (markers[:, 0] < x + 8 + width) & (np.abs(markers[:, 1] - y) < 8)
            return bool(covered.any()) or any(abs(y - b) < height and abs(x - a) < width for a, b in placed)

        while touches(y):
            y += 1.0
        placed.append((x, y))
        axes.annotate(
            name,
            (error, 1e3 * seconds),
            xytext=(8, y - start[1]),
            textcoords="offset points",
            va="center",
            fontsize=9,
            color=style.colour,
            fontweight="bold" if style.thick else "normal",
            bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.5},
            zorder=4,
        )
