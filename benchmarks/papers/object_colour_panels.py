"""Picture of `benchmarks.papers.object_colour_figures`: what is read of the simulated monitor."""

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_INK, _FAINT = "#26221e", "#7d766e"
_COLOURS = {"red": "#c0392b", "green": "#3f8f4f", "blue": "#3558a8"}


def monitor_figure(screen: dict[str, Any], pictures: dict[str, Any]) -> "Figure":
    """The simulated monitor: its tables, what they make of light, chips, and the figures that the
    paper measured.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(15, 9.2), layout="constrained")
    figure.suptitle(
        "Paper B's monitor, simulated: tables, and what a colorimeter reads of it", fontsize=14
    )
    top, bottom = figure.subplots(2, 4, width_ratios=[1, 1, 1, 1])
    _tables(top, screen)
    wanted, read = screen["chips"]
    top[3].plot([0, wanted.max()], [0, wanted.max()], color=_FAINT, lw=0.8)
    top[3].plot(wanted, read, "+", color=_INK, ms=7)
    top[3].set(xlabel="luminance wanted (cd/m²)", ylabel="read (cd/m²)")
    _name(top[3], "chips of a ColorChecker")
    spheres, copper, planes = (pictures[name] for name in ("spheres", "copper", "planes"))
    for k, name in enumerate(_COLOURS):
        part = slice(k * len(spheres["read"]) // 3, (k + 1) * len(spheres["read"]) // 3)
        bottom[0].plot(*spheres["ends"][k].T, color=_FAINT, lw=0.8)
        bottom[0].plot(*spheres["ends"][k][0], "D", color=_COLOURS[name], ms=5, mfc="none")
        bottom[0].plot(*spheres["read"][part].T, "+", color=_COLOURS[name], ms=6)
    bottom[0].plot(*spheres["light"], "o", color=_INK, ms=7, mfc="none")
    _name(bottom[0], "figure 10: spheres")
    exact, seen, ends = copper
    bottom[1].plot(*exact.T, color=_FAINT, lw=0.8)
    bottom[1].plot(*seen.T, "+", color="#b0602f", ms=6)
    bottom[1].plot(*ends[0], "D", color=_INK, ms=6, mfc="none")
    bottom[1].plot(*ends[1], "o", color=_INK, ms=7, mfc="none")
    _name(bottom[1], "figure 14: copper, 0° to 87.5°")
    for body in planes["bodies"]:
        bottom[2].plot(*body, "D", color=_INK, ms=6, mfc="none")
        bottom[2].plot(*np.stack([body, planes["product"]]).T, color=_FAINT, lw=0.8)
    bottom[2].plot(*planes["product"], "s", color=_INK, ms=6)
    bottom[2].plot(*planes["read"].T, "+", color="#2f7f7a", ms=6)
    _name(bottom[2], "figure 16: joined planes")
    for axes in bottom[:3]:
        axes.set(xlabel="x", ylabel="y")
        axes.set_aspect("equal", adjustable="datalim")
        axes.margins(0.1)
    _legend(bottom[3])
    return figure


def _tables(panels: Any, screen: dict[str, Any]) -> None:
    """Figures 2, 3 and 4."""
    for (coarse, fine), colour in zip(screen["tables"], _COLOURS.values(), strict=True):
        panels[0].plot(np.arange(256), np.rint(coarse), color=colour, lw=1.4)
        panels[1].step(np.arange(fine.size) / 10, np.rint(fine), color=colour, lw=1.4, where="mid")
        panels[1].plot(np.arange(15), np.rint(coarse[:15]), "o", color=colour, ms=3.5, mfc="none")
    panels[0].set(xlabel="light wanted, of 255", ylabel="level sent")
    panels[1].set(xlabel="light wanted, of 255", ylabel="level sent")
    panels[1].set_xticks(range(0, 15, 2))
    panels[1].text(
        0.97,
        0.06,
        "circles: the table of 256",
        transform=panels[1].transAxes,
        ha="right",
        color=_FAINT,
    )
    _name(panels[0], "figure 2: table of 256")
    _name(panels[1], "figure 3: ten times finer below 14")
    values = screen["values"]
    for k, colour in enumerate(_COLOURS.values()):
        top = screen["luminances"][k]
        panels[2].plot(
            values, np.array(screen["lines"]["two tables"][k]) / 255 * top, color=colour, lw=1.4
        )
    inner = panels[2].inset_axes([0.12, 0.56, 0.4, 0.36])
    low = values < 20
    for name, colour in (("one table", "#c9826b"), ("two tables", _INK)):
        inner.plot(
            values[low],
            (np.array(screen["lines"][name][1]) - values)[low],
            color=colour,
            lw=1.0,
            label=name,
        )
    inner.set_title("green: value minus line", fontsize=8, color=_FAINT)
    inner.tick_params(labelsize=7)
    inner.set_ylim(-1.0, 1.6)
    inner.legend(frameon=False, fontsize=7, loc="upper right")
    panels[2].set(xlabel="RGB value", ylabel="luminance read (cd/m²)")
    _name(panels[2], "figure 4: after the correction")


def _legend(axes: "Axes") -> None:
    axes.plot([], [], "+", color=_INK, ms=7, label="read from the monitor")
    axes.plot([], [], "D", color=_INK, mfc="none", label="body; copper at 0°")
    axes.plot([], [], "o", color=_INK, ms=7, mfc="none", label="light")
    axes.plot([], [], "s", color=_INK, label="product $S_A S_B$")
    axes.plot([], [], color=_FAINT, lw=0.8, label="wanted")
    axes.legend(frameon=False, fontsize=11, loc="center left")
    axes.set_axis_off()


def _name(axes: "Axes", words: str) -> None:
    axes.set_title(words, fontsize=11, loc="left")
    axes.spines[["top", "right"]].set_visible(False)
