"""Pictures of recipes: target and recipe side by side, their spectra, and what to mix."""

import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING

from glazejax.plots import EDGE, FAINT, INK, style

from .recipe import Recipe
from .report import describe_coat, screen_colours

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_TARGET = "#a9a29a"
# Inches: a cell with its title, swatch, curves and text, and the margins of the figure.
_WIDTH = 3.0
_TITLE = 0.34
_SWATCH = 0.8
_CURVES = 1.15
_TEXT = 1.2
_LEFT = 0.55
_TOP = 0.95
_BOTTOM = 0.3


def recipe_figure(
    recipes: Sequence[Recipe], *, titles: Sequence[str], heading: str, subtitle: str
) -> "Figure":
    """One cell a recipe: swatches, spectra, and the coats in words.

    Args:
        recipes: at least one.
        titles: above each cell.
        heading, subtitle: above all of them.

    Returns:
        A matplotlib figure; save it with ``.savefig(path, dpi=100)``.
    """
    from matplotlib.figure import Figure

    columns = min(len(recipes), 6 if len(recipes) > 10 else 5)
    cell = _TITLE + _SWATCH + _CURVES + _TEXT
    width = max(_LEFT + columns * _WIDTH + 0.1, 9.5)
    height = _TOP + -(-len(recipes) // columns) * cell + _BOTTOM
    # A letter is about half as wide as it is high.
    size = min(12.0, 72.0 * (width - 0.5) / (0.53 * len(subtitle)))
    with style():
        figure = Figure(figsize=(width, height))
        x = 0.25 / width
        figure.text(x, 1 - 0.34 / height, heading, fontsize=20, fontweight="bold", va="center")
        figure.text(x, 1 - 0.68 / height, subtitle, fontsize=size, color=FAINT, va="center")
        for number, (recipe, title) in enumerate(zip(recipes, titles, strict=True)):
            row, column = divmod(number, columns)
            # From the left, and from the top of the figure downwards.
            x = (_LEFT + column * _WIDTH) / width
            swatch = _TOP + row * cell + _TITLE
            curves = swatch + _SWATCH + 0.1

            def axes(down: float, tall: float, x: float = x) -> "Axes":
                box = (x, 1 - (down + tall) / height, (_WIDTH - 0.35) / width, tall / height)
                return figure.add_axes(box)

            _draw_swatch(axes(swatch, _SWATCH), recipe, title)
            _draw_spectra(
                axes(curves, _CURVES - 0.1), recipe, _tallest(recipe, recipes), column == 0
            )
            coats = [
                textwrap.fill(describe_coat(coat), 41, subsequent_indent="      ")
                for coat in recipe.coats
            ]
            y = 1 - (curves + _CURVES + 0.17) / height
            figure.text(x, y, "\n".join(coats), fontsize=8.5, va="top", linespacing=1.25)
    return figure


def _draw_swatch(axes: "Axes", recipe: Recipe, title: str) -> None:
    from matplotlib.patches import Rectangle

    axes.set(xlim=(0, 2), ylim=(0, 1))
    axes.set_axis_off()
    for x, shade in enumerate(screen_colours(recipe)):
        # An edge of its own colour closes the hairline between the two halves.
        axes.add_patch(Rectangle((x, 0), 1, 1, facecolor=shade, edgecolor=shade, lw=0.6))
    axes.add_patch(Rectangle((0, 0), 2, 1, fill=False, edgecolor=EDGE, lw=0.8, clip_on=False))
    # Where the halves meet, since a good recipe hides it.
    for ends in ((-0.07, 0.0), (1.0, 1.07)):
        axes.plot([1, 1], ends, color=FAINT, lw=0.8, clip_on=False)
    axes.text(0, 1.06, title, fontsize=12, fontweight="bold", va="bottom")
    mark = INK if recipe.distance < 1 else "#b3261e"
    axes.text(
        2, 1.06, f"ΔE {recipe.distance:.2f}", fontsize=11, ha="right", va="bottom", color=mark
    )


def _tallest(recipe: Recipe, recipes: Sequence[Recipe]) -> float:
    """Largest reflectance that is drawn for a recipe's target: recipes for one target are compared
    by eye.
    """
    alike = [r for r in recipes if r.target is recipe.target]
    spectra = [recipe.target.reflectance, *(r.reflectance for r in alike)]
    return max(float(spectrum.max()) for spectrum in spectra if spectrum is not None)


def _draw_spectra(axes: "Axes", recipe: Recipe, highest: float, labelled: bool) -> None:
    target = recipe.target
    if target.wavelengths is not None and target.reflectance is not None:
        axes.plot(
            target.wavelengths, target.reflectance, color=_TARGET, lw=3.2, solid_capstyle="round"
        )
    axes.plot(recipe.wavelengths, recipe.reflectance, color=INK, lw=1.3)
    top = 1.0 if highest > 0.35 else 0.4
    axes.set(
        xlim=(recipe.wavelengths[0], recipe.wavelengths[-1]),
        ylim=(0, top),
        xticks=[400, 500, 600, 700],
        yticks=[0, top / 2, top],
    )
    axes.tick_params(labelsize=8, length=2, pad=2)
    if labelled:
        axes.set_ylabel("reflectance", fontsize=9)
