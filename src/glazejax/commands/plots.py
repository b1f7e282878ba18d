"""Picture of a glaze: its spectra, swatches, and its colour coat after coat."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..appearance.exports.rgb import outside
from ..plots import EDGE, FAINT, GRID, INK, hex_colour, label_spectra, style
from ..spectra import Bands
from .rendering import Rendering

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.text import Text

# Signs of Unicode: matplotlib's own grammar of formulas takes a fifth of a second to build.
_NOTE = """R₀: seen with no coat. R₁: one
coat on the ground. R: bare
ground.
Mixing: the same paint stirred
into an opaque one that looks
like R₀, as much of it as brings
one portion nearest to one coat."""
_CLIPPED = """
Colours outside sRGB are clipped."""
# How each way of layering is drawn and explained.
_WAYS = {
    "glaze": ("glazejax", "light followed through every coat", "-", 3.2),
    "multiply": ("multiply", "R₀ (R₁/R)ⁿ, band by band", "--", 2.0),
    "mixing": ("mixing", "n portions stirred into opaque paint", ":", 2.6),
}


def glaze_figure(
    rendering: Rendering,
    names: Sequence[str],
    *,
    title: str = "",
    subtitle: str = "",
    coat: str = "one coat",
    marked: int | None = None,
) -> "Figure":
    """Picture of a glaze in three panels: spectra, swatches, and the ladder of its colour against
    coats.

    Args:
        rendering: what to draw.
        names: what to call each layer, top first.
        title, subtitle: lines above the panels.
        coat: what one coat of the ladder is, such as "Eosin 2 µm".
        marked: number of coats that is the glaze itself, marked on the ladder.

    Returns:
        A matplotlib figure of 16 x 10 inches; save it with ``.savefig(path, dpi=100)``.

    Raises:
        ValueError: what `lab` refuses.
        ModuleNotFoundError: matplotlib is not installed.
    """
    last = rendering.ladder.counts[-1]
    with style({"font.size": 15}):
        from matplotlib.figure import Figure

        figure = Figure(figsize=(16, 10))
        top = {"top": 0.84, "bottom": 0.6}
        _draw_spectra(figure.add_axes(_box(0.062, 0.615, **top)), rendering, names)
        _draw_swatches(figure.add_axes(_box(0.665, 0.975, **top)), rendering)
        strips = figure.add_axes(_box(0.235, 0.915, top=0.475, bottom=0.312))
        chroma = figure.add_axes(_box(0.235, 0.915, top=0.298, bottom=0.192), sharex=strips)
        lightness = figure.add_axes(_box(0.235, 0.915, top=0.176, bottom=0.07), sharex=strips)
        _draw_strips(strips, rendering, marked)
        _draw_curves(chroma, lightness, rendering)
        _fit(figure.text(0.025, 0.957, title, fontsize=23, fontweight="bold", va="center"), figure)
        _fit(figure.text(0.025, 0.916, subtitle, color=FAINT, va="center"), figure)
        heading = f"Coat after coat: {coat}, 1 to {last} times"
        _fit(
            figure.text(0.025, 0.512, heading, fontsize=19, fontweight="bold", va="center"), figure
        )
        note = _NOTE + (_CLIPPED if _clips(rendering) else "")
        figure.text(0.025, 0.29, note, fontsize=11, color=FAINT, va="top", linespacing=1.35)
    return figure


def _clips(rendering: Rendering) -> bool:
    """Test whether a colour of the ladder is outside sRGB."""
    shades = [rendering.rgb(getattr(rendering.ladder, key), clip=False) for key in _WAYS]
    return bool(outside(np.array(shades)).any())


def _ink(rendering: Rendering, spectrum: Bands) -> str:
    """The colour of a spectrum, darkened where it would vanish on white."""
    shade = rendering.rgb(spectrum)
    luminance = float(shade @ [0.2126, 0.7152, 0.0722])
    return hex_colour(shade * min(1.0, 0.62 / max(luminance, 1e-3)))


def _box(
    low: float, high: float, *, top: float, bottom: float
) -> tuple[float, float, float, float]:
    return low, bottom, high - low, top - bottom


def _fit(text: "Text", figure: "Figure") -> None:
    """Shrink a line of text, and cut it if it would become too small to read, to the figure's
    width without its margins.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    renderer = FigureCanvasAgg(figure).get_renderer()
    room = 0.95 * figure.bbox.width
    size = float(text.get_fontsize())
    smallest = 12.0
    # Widths of hinted letters are not quite proportional to their size.
    while (width := text.get_window_extent(renderer).width) > room and size > smallest:
        size = max(min(size * room / width, size - 0.25), smallest)
        text.set_fontsize(size)
    shortened = text.get_text()
    while text.get_window_extent(renderer).width > room:
        shortened = shortened[: int(0.97 * len(shortened))]
        text.set_text(f"{shortened.rstrip()}…")


def _draw_spectra(axes: "Axes", rendering: Rendering, names: Sequence[str]) -> None:
    x = rendering.wavelengths
    axes.plot(x, rendering.ground, color=FAINT, lw=2, ls=(0, (1, 1.5)), label="bare ground")
    if len(names) > 1:
        width = 2.2
        dashes = "--"
        # Without absent layers.
        spectra = [
            (f"{name} alone", spectrum)
            for name, spectrum in zip(names, rendering.alone, strict=True)
            if not np.allclose(spectrum, rendering.ground, rtol=0, atol=1e-9)
        ]
    else:
        width = 1.6
        dashes = "-"
        ladder = rendering.ladder
        counts = [count for count in (40, 20, 10, 5) if count <= ladder.counts[-1]]
        spectra = [(f"{count} coats", ladder.glaze[count]) for count in counts]
    for label, spectrum in spectra:
        axes.plot(x, spectrum, color=_ink(rendering, spectrum), lw=width, ls=dashes, label=label)
    axes.fill_between(
        x, 0, rendering.glaze, color=hex_colour(rendering.rgb(rendering.glaze)), alpha=0.18, lw=0
    )
    axes.plot(x, rendering.glaze, color=_ink(rendering, rendering.glaze), lw=4, label="the glaze")
    highest = max(float(np.max(line.get_ydata())) for line in axes.get_lines())
    label_spectra(axes, xlim=(x[0], x[-1]), ylim=(0, max(highest * 1.06, 0.05)))
    axes.grid(color=GRID, lw=1)
    axes.set_axisbelow(True)
    handles, labels = axes.get_legend_handles_labels()
    labels = [label if len(label) <= 30 else f"{label[:29]}…" for label in labels]
    longest = max(map(len, labels))
    columns = min(len(labels), 6 if longest < 12 else 4 if longest < 22 else 3)
    axes.legend(
        handles[::-1],
        labels[::-1],
        loc="lower left",
        bbox_to_anchor=(-0.01, 1.0),
        borderaxespad=0.2,
        ncols=columns,
        fontsize=13,
        handlelength=2.2,
        columnspacing=1.4,
    )


def _draw_swatches(axes: "Axes", rendering: Rendering) -> None:
    from matplotlib.patches import FancyBboxPatch

    axes.set(xlim=(0, 1), ylim=(0, 1))
    axes.set_axis_off()
    ground = rendering.ground
    glaze = rendering.glaze

    for corner, width, height, spectrum, edge in (
        ((0.0, 0.26), 1.0, 0.74, ground, EDGE),
        ((0.04, 0.33), 0.58, 0.60, glaze, "none"),
    ):
        patch = FancyBboxPatch(
            corner,
            width,
            height,
            boxstyle="round,pad=0,rounding_size=0.012",
            lw=1,
            mutation_aspect=1.7,
            facecolor=hex_colour(rendering.rgb(spectrum)),
            edgecolor=edge,
            clip_on=False,
        )
        axes.add_patch(patch)
    for x, what, spectrum in ((0.04, "the glaze", glaze), (0.68, "bare ground", ground)):
        lightness, a, b = rendering.lab(spectrum)
        axes.text(x, 0.185, what, fontweight="bold", va="center", fontsize=15)
        axes.text(
            x,
            0.085,
            hex_colour(rendering.rgb(spectrum)),
            va="center",
            fontsize=15,
            family="monospace",
        )
        axes.text(x, -0.01, f"Lab {lightness:z.1f}, {a:z.1f}, {b:z.1f}", va="center", fontsize=13.5)


def _draw_strips(axes: "Axes", rendering: Rendering, marked: int | None) -> None:
    from matplotlib.collections import PatchCollection
    from matplotlib.patches import Rectangle

    ladder = rendering.ladder
    for row, (key, (name, explanation, *_)) in enumerate(_WAYS.items()):
        shades = rendering.rgb(getattr(ladder, key))
        cells = [Rectangle((n - 0.5, -row - 0.92), 1, 0.92) for n in ladder.counts]
        # Edges of its own colour close the hairlines between neighbours.
        axes.add_collection(PatchCollection(cells, facecolor=shades, edgecolor=shades, lw=0.6))
        axes.text(-0.9, -row - 0.33, name, ha="right", va="center", fontsize=16, fontweight="bold")
        axes.text(
            -0.9, -row - 0.68, explanation, ha="right", va="center", fontsize=11.5, color=FAINT
        )
    axes.set(xlim=(-0.5, ladder.counts[-1] + 0.5), ylim=(-2.95, 0))
    if marked is not None and 0 < marked <= ladder.counts[-1]:
        axes.plot(marked, 0.1, marker="v", ms=10, color=INK, clip_on=False)
        axes.text(marked + 0.45, 0.12, "the glaze above", va="center", fontsize=12, color=FAINT)
    axes.set_axis_off()


def _draw_curves(chroma: "Axes", lightness: "Axes", rendering: Rendering) -> None:
    ladder = rendering.ladder
    last = int(ladder.counts[-1])
    colours = {key: rendering.lab(getattr(ladder, key)) for key in _WAYS}
    for axes, title, curves in (
        (
            chroma,
            "chroma C*",
            {key: np.hypot(values[:, 1], values[:, 2]) for key, values in colours.items()},
        ),
        (lightness, "lightness L*", {key: values[:, 0] for key, values in colours.items()}),
    ):
        for key, values in curves.items():
            _, _, dashes, width = _WAYS[key]
            axes.plot(ladder.counts, values, ls=dashes, lw=width, color=INK, solid_capstyle="round")
        highest = max(10.0, *(float(values.max()) for values in curves.values()))
        axes.set_ylim(0, 1.08 * highest)
        axes.set_ylabel(title, fontsize=12)
        axes.tick_params(axis="y", labelsize=13)
        axes.locator_params(axis="y", nbins=4)
        axes.grid(color=GRID, lw=1)
        axes.set_axisbelow(True)
        ends = sorted((float(values[-1]), key) for key, values in curves.items())
        gap = 0.21 * highest
        at = -np.inf
        heights = [at := max(value, at + gap) for value, _ in ends]
        # Pushed up where they would meet, and all of them down again if the uppermost leaves the
        # panel.
        for i in reversed(range(len(heights))):
            heights[i] = min(heights[i], 0.98 * highest - (len(heights) - 1 - i) * gap)
        for height, (value, key) in zip(heights, ends, strict=True):
            axes.annotate(
                _WAYS[key][0],
                (last, value),
                (last + 0.9, height),
                va="center",
                fontsize=13,
                fontweight="bold" if key == "glaze" else "normal",
                annotation_clip=False,
            )
    chroma.tick_params(labelbottom=False)
    lightness.set_xlabel("number of coats", labelpad=2)
    lightness.set_xticks([n for n in (0, 1, 5, 10, 15, 20, 25, 30, 35, 40) if n <= last])
