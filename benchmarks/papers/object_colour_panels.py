"""Panels of `benchmarks.papers.object_colour_figures`: pictures and chromaticities, the monitor."""

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_INK, _FAINT = "#26221e", "#7d766e"
_COLOURS = {"red": "#c0392b", "green": "#3f8f4f", "blue": "#3558a8"}
_FORMS = {
    "exact Fresnel": ("#26221e", "-"),
    "Cook-Torrance": ("#c0392b", "--"),
    "Hall": ("#3558a8", ":"),
}


def figure_of(pictures: dict[str, Any]) -> "Figure":
    """Spheres, copper and joined planes, one row each."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13, 14.5), layout="constrained")
    rows: Any = figure.subfigures(3, 1, height_ratios=[1.0, 1.9, 1.15])
    _spheres(rows[0], pictures["spheres"])
    _copper(rows[1], pictures["copper"])
    _planes(rows[2], pictures["planes"])
    return figure


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
        bottom[0].plot(*spheres["loci"][k][2].T, color=_FAINT, lw=0.8)
        bottom[0].plot(*spheres["loci"][k][2][0], "D", color=_COLOURS[name], ms=5, mfc="none")
        bottom[0].plot(*spheres["read"][part].T, "+", color=_COLOURS[name], ms=6)
    bottom[0].plot(*spheres["light"], "o", color=_INK, ms=7, mfc="none")
    _name(bottom[0], "figure 10: spheres")
    exact, seen, ends = copper["copper"]
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


def _spheres(row: Any, found: dict[str, Any]) -> None:
    row.suptitle(
        "Phong spheres: colours lie between the body's and the light's (paper B, figures 8 and 10)",
        fontsize=13,
    )
    left, right = row.subplots(1, 2, width_ratios=[2.1, 1.0])
    _picture(
        left,
        found["image"],
        "ColorChecker moderate red, green and blue; illuminant A, adapted; $S_s$ = 5 %, n = 11",
    )
    for name, xy, ends in found["loci"]:
        right.plot(*ends.T, color=_FAINT, lw=0.8)
        right.plot(*xy.T, "+", color=_COLOURS[name], ms=5, label=name)
        right.plot(*ends[0], "D", color=_COLOURS[name], ms=5, mfc="none")
    right.plot(*found["light"], "o", color=_INK, ms=7, mfc="none", label="light")
    _diagram(right)


def _copper(row: Any, found: dict[str, Any]) -> None:
    row.suptitle(
        "Copper by three forms of Fresnel reflectance (paper B, figures 11 to 13)", fontsize=13
    )
    top, bottom = row.subfigures(2, 1, height_ratios=[1.0, 2.6])
    for axes, (form, image) in zip(top.subplots(1, 3), found["plates"].items(), strict=True):
        _picture(axes, image, f"plate at 80°, {form}")
    left, right = bottom.subplots(1, 2)
    for name, values in found["curves"].items():
        ink, style = _FORMS[name]
        for angle in (0.0, 75.0, 85.0):
            row_of = int(np.argmin(np.abs(found["angles"] - angle)))
            left.plot(
                found["wavelengths"],
                values[row_of],
                style,
                color=ink,
                lw=1.6,
                label=name if angle == 0 else None,
            )
            if name == "exact Fresnel":
                left.annotate(
                    f"{angle:g}°",
                    (403, values[row_of, 0] + (0.008 if angle else -0.03)),
                    color=_INK,
                    fontsize=10,
                )
    left.set(xlabel="wavelength (nm)", ylabel="reflectance", xlim=(400, 700), ylim=(0.3, 1.0))
    left.legend(frameon=False)
    for locus in found["loci"]:
        ink, style = _FORMS[locus.name]
        right.plot(*locus.xy.T, style, color=ink, lw=1.6, marker=".", ms=5, label=locus.name)
    right.plot(*found["light"], "o", color=_INK, ms=7, mfc="none")
    right.annotate(
        "sunlight, 90°",
        found["light"],
        xytext=(8, -3),
        textcoords="offset points",
        color=_FAINT,
        fontsize=10,
    )
    start, eighty = found["loci"][0].xy[0], int(np.argmin(np.abs(found["angles"] - 80.0)))
    right.annotate(
        "0°", start, xytext=(6, 2), textcoords="offset points", color=_FAINT, fontsize=10
    )
    for locus in found["loci"]:
        right.plot(*locus.xy[eighty], "s", color=_FORMS[locus.name][0], ms=7, mfc="none")
    right.plot([], [], "s", color=_FAINT, mfc="none", label="at 80°")
    _diagram(right)


def _planes(row: Any, found: dict[str, Any]) -> None:
    row.suptitle(
        "Two joined planes, 30°, ray-traced: light that went from one to the other (paper B, "
        "figures 15 and 16)",
        fontsize=13,
    )
    *pictures, right = row.subplots(1, 4, width_ratios=[0.7, 0.7, 0.7, 1.5])
    for axes, (name, image) in zip(pictures, found["strips"].items(), strict=True):
        _picture(axes, image, name)
    for (name, above, below), (ink, style) in zip(
        found["loci"], (("#c0392b", "-"), ("#3558a8", "--")), strict=True
    ):
        right.plot(*above.T, style, color=ink, lw=1.8, label=name)
        right.plot(*below.T, style, color=ink, lw=1.8)
    for body, words in zip(found["bodies"], ("above", "below"), strict=True):
        right.plot(*body, "D", color=_INK, ms=6, mfc="none")
        right.annotate(
            words, body, xytext=(7, 4), textcoords="offset points", color=_FAINT, fontsize=10
        )
        right.plot(*np.stack([body, found["product"]]).T, color=_FAINT, lw=0.7)
    right.plot(*found["product"], "s", color=_INK, ms=7, label="product $S_A S_B$")
    _diagram(right)


def _picture(axes: "Axes", image: np.ndarray, words: str) -> None:
    axes.imshow(image)
    axes.set_axis_off()
    axes.set_title(words, fontsize=10, color=_FAINT)


def _diagram(axes: "Axes") -> None:
    axes.set(xlabel="x", ylabel="y")
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.12)
    axes.legend(frameon=False, fontsize=10)
    axes.spines[["top", "right"]].set_visible(False)
