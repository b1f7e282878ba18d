"""Panels of `benchmarks.object_colour_figures`: pictures on the left, chromaticities on the right."""

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_INK, _FAINT = "#26221e", "#7d766e"
_COLOURS = {"red": "#c0392b", "green": "#3f8f4f", "blue": "#3558a8"}
_FORMS = {"exact Fresnel": ("#26221e", "-"), "Cook-Torrance": ("#c0392b", "--"), "Hall": ("#3558a8", ":")}


def figure_of(pictures: dict[str, Any]) -> "Figure":
    """Spheres, copper and joined planes, one row each."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13, 14.5), layout="constrained")
    rows: Any = figure.subfigures(3, 1, height_ratios=[1.0, 1.9, 1.15])
    _spheres(rows[0], pictures["spheres"])
    _copper(rows[1], pictures["copper"])
    _planes(rows[2], pictures["planes"])
    return figure


def _spheres(row: Any, found: dict[str, Any]) -> None:
    row.suptitle(
        "Phong spheres: colours lie between the body's and the light's (paper B, figures 8 and 10)", fontsize=13
    )
    left, right = row.subplots(1, 2, width_ratios=[2.1, 1.0])
    _picture(left, found["image"], "ColorChecker red, green and blue; illuminant A, adapted; $S_s$ = 5 %, n = 11")
    for name, xy, ends in found["loci"]:
        right.plot(*ends.T, color=_FAINT, lw=0.8)
        right.plot(*xy.T, "+", color=_COLOURS[name], ms=5, label=name)
        right.plot(*ends[0], "D", color=_COLOURS[name], ms=5, mfc="none")
    right.plot(*found["light"], "o", color=_INK, ms=7, mfc="none", label="light")
    _diagram(right)


def _copper(row: Any, found: dict[str, Any]) -> None:
    row.suptitle("Copper by three forms of Fresnel reflectance (paper B, figures 11 to 13)", fontsize=13)
    top, bottom = row.subfigures(2, 1, height_ratios=[1.0, 2.6])
    for axes, (form, image) in zip(top.subplots(1, 3), found["plates"].items(), strict=True):
        _picture(axes, image, f"plate at 80°, {form}")
    left, right = bottom.subplots(1, 2)
    for name, values in found["curves"].items():
        ink, style = _FORMS[name]
        for angle in (0.0, 75.0, 85.0):
            row_of = int(np.argmin(np.abs(found["angles"] - angle)))
            left.plot(
                found["wavelengths"], values[row_of], style, color=ink, lw=1.6, label=name if angle == 0 else None
            )
            if name == "exact Fresnel":
                left.annotate(
                    f"{angle:g}°", (403, values[row_of, 0] + (0.008 if angle else -0.03)), color=_INK, fontsize=10
                )
    left.set(xlabel="wavelength (nm)", ylabel="reflectance", xlim=(400, 700), ylim=(0.3, 1.0))
    left.legend(frameon=False)
    for locus in found["loci"]:
        ink, style = _FORMS[locus.name]
        right.plot(*locus.xy.T, style, color=ink, lw=1.6, marker=".", ms=5, label=locus.name)
    right.plot(*found["light"], "o", color=_INK, ms=7, mfc="none")
    right.annotate(
        "sunlight, 90°", found["light"], xytext=(8, -3), textcoords="offset points", color=_FAINT, fontsize=10
    )
    start, eighty = found["loci"][0].xy[0], int(np.argmin(np.abs(found["angles"] - 80.0)))
    right.annotate("0°", start, xytext=(6, 2), textcoords="offset points", color=_FAINT, fontsize=10)
    for locus in found["loci"]:
        right.plot(*locus.xy[eighty], "s", color=_FORMS[locus.name][0], ms=7, mfc="none")
    right.plot([], [], "s", color=_FAINT, mfc="none", label="at 80°")
    _diagram(right)


def _planes(row: Any, found: dict[str, Any]) -> None:
    row.suptitle(
        "Two joined planes, 30°: light that went from one to the other (paper B, figures 15 and 16)", fontsize=13
    )
    *pictures, right = row.subplots(1, 4, width_ratios=[0.7, 0.7, 0.7, 1.5])
    for axes, (name, image) in zip(pictures, found["strips"].items(), strict=True):
        _picture(axes, image, "no bounce" if name == "none" else name)
    for (name, above, below), (ink, style) in zip(found["loci"], (("#c0392b", "-"), ("#3558a8", "--")), strict=True):
        right.plot(*above.T, style, color=ink, lw=1.8, label=name)
        right.plot(*below.T, style, color=ink, lw=1.8)
    for body, words in zip(found["bodies"], ("above", "below"), strict=True):
        right.plot(*body, "D", color=_INK, ms=6, mfc="none")
        right.annotate(words, body, xytext=(7, 4), textcoords="offset points", color=_FAINT, fontsize=10)
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
