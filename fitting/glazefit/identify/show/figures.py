"""Figures of a page: spectra and residuals of a spot as SVG text, in colours that the page sets."""

import io
import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from glazejax.plots import ABSORPTION, EDGE, FAINT, GRID, INK, SCATTERING, label_spectra, style

FITS = 3
"""Explanations that are drawn."""

_COLOURS = (ABSORPTION, SCATTERING, "#41732b")
_DASHES: tuple[Any, ...] = ("-", (0, (5, 2)), (0, (1.5, 1.8)))
_VARIABLES = {
    INK: "--ink",
    FAINT: "--faint",
    GRID: "--grid",
    EDGE: "--edge",
    _COLOURS[0]: "--fit-1",
    _COLOURS[1]: "--fit-2",
    _COLOURS[2]: "--fit-3",
}
_SIZE = (4.4, 2.9)


def draw_spectra(spot: Mapping[str, Any], grid: np.ndarray, grounds: list[str]) -> str:
    """Measured spectra, the first fits and the band of the best, over every ground."""

    def draw(figure: Any) -> None:
        axes = figure.subplots()
        measured = np.asarray(spot["measured"])
        for n, found in reversed(list(enumerate(spot["explanations"][:FITS]))):
            for fitted, half in zip(
                found["fitted"], found["band_90"] or found["fitted"], strict=True
            ):
                # What is not known at a band is None there.
                middle = np.asarray(fitted, dtype=float)
                half = np.asarray(half)
                if n == 0 and found["band_90"] is not None:
                    axes.fill_between(
                        grid, middle - half, middle + half, color=_COLOURS[0], alpha=0.18, lw=0
                    )
                axes.plot(grid, middle, ls=_DASHES[n], color=_COLOURS[n], lw=1.7 - 0.2 * n)
        for reading in measured:
            axes.plot(grid, reading, "o", color=INK, ms=2.6, mfc="none", mew=0.7)
        label_spectra(
            axes, ylim=(0, max(0.1, float(measured.max()) * 1.15)), xlim=_wavelength_limits(grid)
        )
        if len(measured) > 1:
            _note(axes, "; ".join(f"over {_short(ground)}" for ground in grounds))

    return _svg(spot["id"] + "-spectra", draw)


def draw_residuals(spot: Mapping[str, Any], grid: np.ndarray, grounds: list[str]) -> str:
    """Measured minus fitted of the first fits, a panel for each ground, with the band of
    the best.
    """

    def draw(figure: Any) -> None:
        measured = np.asarray(spot["measured"])
        fits = spot["explanations"][:FITS]
        off = float(max(np.abs(measured - np.asarray(found["fitted"])).max() for found in fits))
        band = float(np.max(fits[0]["band_90"])) if fits[0]["band_90"] is not None else 0.0
        # A band that is far wider than what is left fills the panel, so that what is left can be
        # seen.
        most = max(1.15 * off, min(1.05 * band, 5.0 * off), 0.01)
        panels = figure.subplots(len(measured), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
        for g, axes in enumerate(panels):
            for n, found in reversed(list(enumerate(fits))):
                if n == 0 and found["band_90"] is not None:
                    half = np.asarray(found["band_90"][g])
                    axes.fill_between(grid, -half, half, color=_COLOURS[0], alpha=0.18, lw=0)
                off = measured[g] - np.asarray(found["fitted"][g])
                axes.plot(grid, off, ls=_DASHES[n], color=_COLOURS[n], lw=1.7 - 0.2 * n)
            axes.axhline(0, color=EDGE, lw=0.7)
            axes.set(xlim=_wavelength_limits(grid), ylim=(-most, most))
            if len(measured) > 1:
                _note(axes, _short(grounds[g]))
        label_spectra(panels[-1], "")
        figure.supylabel("measured − fitted", x=0.005, fontsize=9, color=INK)

    return _svg(spot["id"] + "-residuals", draw)


def _note(axes: Any, words: str) -> None:
    axes.text(0.01, 1.0, words, transform=axes.transAxes, fontsize=7.5, color=FAINT, va="bottom")


def _short(ground: str) -> str:
    return ground.partition(",")[0]


def _wavelength_limits(grid: np.ndarray) -> tuple[float, float]:
    margin = 0.02 * float(np.ptp(grid)) or 1.0
    return float(grid[0]) - margin, float(grid[-1]) + margin


def _svg(salt: str, draw: Any) -> str:
    """An SVG element of no size of its own: text stays text, colours are the page's, equal input
    gives equal text.
    """
    settings = {
        "svg.fonttype": "none",
        "svg.hashsalt": salt,
        "font.size": 9,
        "axes.labelsize": 9,
        "xtick.labelsize": 8,
        "ytick.labelsize": 8,
        "figure.facecolor": "none",
        "axes.facecolor": "none",
        "axes.linewidth": 0.7,
        "text.parse_math": False,
        "axes.unicode_minus": True,
    }
    with style(settings):
        from matplotlib.backends.backend_svg import FigureCanvasSVG
        from matplotlib.figure import Figure

        # Set by hand: a layout that matplotlib works out takes three times as long as the figure.
        figure = Figure(figsize=_SIZE)
        figure.subplots_adjust(left=0.15, right=0.985, bottom=0.155, top=0.94, hspace=0.28)
        draw(figure)
        text = io.StringIO()
        FigureCanvasSVG(figure).print_svg(
            text, metadata=dict.fromkeys(("Date", "Creator", "Format", "Type"))
        )
    return _inline(text.getvalue())


def _inline(text: str) -> str:
    """SVG of matplotlib as part of a page."""
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    text = re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL)
    opening, closed, rest = text.partition(">")
    opening = re.sub(r"\s(?:xmlns(?::\w+)?|version|width|height)=\"[^\"]*\"", "", opening)
    text = (opening + closed + rest).replace("xlink:href", "href")
    # Names of groups repeat in every figure.
    text = re.sub(r"<g id=\"[^\"]*\"", "<g", text)
    text = re.sub(r"font: ([\d.]+px)[^;\"]*", r"font: \1 system-ui, sans-serif", text)
    for colour, name in _VARIABLES.items():
        text = text.replace(colour, f"var({name})")
    text = re.sub(r">\s+<", "><", text)
    return text.replace("<svg", '<svg aria-hidden="true"', 1).strip()
