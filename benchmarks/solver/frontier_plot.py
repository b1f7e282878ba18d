"""The picture of run time against error: curves named at their ends, colours that colour-blind
readers can tell.
"""

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
    axes.set_xlim(left, right / 5e2)  # room for the names


def _name(axes, curves: dict) -> None:
    """Write each name near its curve's last point, or else its first, where it covers no curve and
    no other name.
    """
    scale = axes.figure.dpi / 72  # everything below in points
    paths = {
        name: axes.transData.transform([(error, 1e3 * seconds) for error, seconds in points])
        / scale
        for name, (_, points) in curves.items()
    }
    between = np.linspace(0, 1, 20)[:, None, None]
    lines = np.concatenate(
        [
            (path[:-1] + between * np.diff(path, axis=0)).reshape(-1, 2)
            for path in paths.values()
            if len(path) > 1
        ]
    )
    boxes: list[tuple[float, float, float, float]] = []

    def covered(box: tuple[float, float, float, float]) -> int:
        left, right, low, high = box
        x, y = lines.T
        names = sum(left < b[1] and b[0] < right and low < b[3] and b[2] < high for b in boxes)
        return int(np.sum((x > left) & (x < right) & (y > low) & (y < high))) + 100 * names

    for name, (style, points) in sorted(curves.items(), key=lambda item: item[1][1][-1][1]):
        width = (5.6 if style.thick else 5.1) * len(name)
        places = [
            (points[-1], paths[name][-1], aside, shift)
            for aside in (8.0, 16.0)
            for shift in (0, 4, -4, 8, -8, -12)
        ]
        places += [
            (points[-1], paths[name][-1], -0.5 * width, shift) for shift in (12, -12, 16, -16)
        ]
        places += [
            (points[0], paths[name][0], aside, shift)
            for aside in (-4.0, -18.0)
            for shift in (12, -12)
        ]
        places += [(points[-1], paths[name][-1], 8.0, shift) for shift in range(12, 60, 4)]

        def box(place: tuple, width: float = width) -> tuple[float, float, float, float]:
            _, (x, y), right, up = place
            return x + right - 3.0, x + right + width, y + up - 6.0, y + up + 6.0

        (error, seconds), _, right, up = best = min(
            places, key=lambda place: covered(box(place)) + 0.1 * abs(place[3])
        )
        boxes.append(box(best))
        axes.annotate(
            name,
            (error, 1e3 * seconds),
            xytext=(right, up),
            textcoords="offset points",
            va="center",
            fontsize=9,
            color=style.colour,
            fontweight="bold" if style.thick else "normal",
            bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.5},
            zorder=4,
        )
