"""Pictures of recipes: target and recipe side by side, their spectra, and what to mix."""

import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from glazejax.plots import EDGE, FAINT, INK, style

from .recipe import Recipe
from .report import describe_coat, recipe_hex, target_hex

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_TARGET = "#a9a29a"


class _Inches(NamedTuple):
    """A cell, its text below and its title above, and the margins of the figure."""

    width: float = 3.0
    swatch: float = 0.8
    curves: float = 1.15
    text: float = 1.2
    title: float = 0.34
    left: float = 0.55
    top: float = 0.95
    bottom: float = 0.3


_INCHES = _Inches()


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
    rows = -(-len(recipes) // columns)
    cell = _INCHES.title + _INCHES.swatch + _INCHES.curves + _INCHES.text
    width = max(_INCHES.left + columns * _INCHES.width + 0.1, 9.5)
    height = _INCHES.top + rows * cell + _INCHES.bottom
    with style():
        figure = Figure(figsize=(width, height))
        figure.text(
            0.25 / width, 1 - 0.34 / height, heading, fontsize=20, fontweight="bold", va="center"
        )
        # A letter is about half as wide as it is high.
        size = min(12.0, 72.0 * (width - 0.5) / (0.53 * len(subtitle)))
        figure.text(
            0.25 / width, 1 - 0.68 / height, subtitle, fontsize=size, color=FAINT, va="center"
        )
        tallest = _tallest(recipes)
        for number, (recipe, title) in enumerate(zip(recipes, titles, strict=True)):
            row, column = divmod(number, columns)
            left = _INCHES.left + column * _INCHES.width
            top = height - _INCHES.top - row * cell

            def box(down: float, tall: float, left: float = left, top: float = top) -> tuple:
                return (
                    left / width,
                    (top - down - tall) / height,
                    (_INCHES.width - 0.35) / width,
                    tall / height,
                )

            swatch = figure.add_axes(box(_INCHES.title, _INCHES.swatch))
            _draw_swatch(swatch, recipe, title)
            curves = figure.add_axes(
                box(_INCHES.title + _INCHES.swatch + 0.1, _INCHES.curves - 0.1)
            )
            _draw_spectra(curves, recipe, tallest[number], labelled=column == 0)
            text = "\n".join(_wrap(describe_coat(coat)) for coat in recipe.coats)
            x, y, *_ = box(_INCHES.title + _INCHES.swatch + _INCHES.curves + 0.27, 0.0)
            figure.text(x, y, text, fontsize=8.5, va="top", linespacing=1.25)
    return figure


def _wrap(text: str) -> str:
    """Lines of a coat, broken between paints."""
    return "\n".join(textwrap.wrap(text, 41, subsequent_indent="      "))


def _draw_swatch(axes: "Axes", recipe: Recipe, title: str) -> None:
    from matplotlib.patches import Rectangle

    axes.set(xlim=(0, 2), ylim=(0, 1))
    axes.set_axis_off()
    for x, shade in ((0, target_hex(recipe)), (1, recipe_hex(recipe))):
        # An edge of its own colour closes the hairline between the two halves.
        axes.add_patch(Rectangle((x, 0), 1, 1, facecolor=shade, edgecolor=shade, lw=0.6))
    axes.add_patch(Rectangle((0, 0), 2, 1, fill=False, edgecolor=EDGE, lw=0.8, clip_on=False))
    # Where the halves meet, since a good recipe hides it.
    axes.plot([1, 1], [-0.07, 0.0], color=FAINT, lw=0.8, clip_on=False)
    axes.plot([1, 1], [1.0, 1.07], color=FAINT, lw=0.8, clip_on=False)
    axes.text(0, 1.06, title, fontsize=12, fontweight="bold", va="bottom")
    mark = INK if recipe.distance < 1 else "#b3261e"
    axes.text(
        2, 1.06, f"ΔE {recipe.distance:.2f}", fontsize=11, ha="right", va="bottom", color=mark
    )


def _tallest(recipes: Sequence[Recipe]) -> list[float]:
    """Largest reflectance that is drawn for each recipe's target: recipes for one target are
    compared by eye.
    """
    heights = [max(float(r.reflectance.max()), _highest(r.target.reflectance)) for r in recipes]
    return [
        max(
            height
            for height, neighbour in zip(heights, recipes, strict=True)
            if neighbour.target is r.target
        )
        for r in recipes
    ]


def _highest(values: Any) -> float:
    return 0.0 if values is None else float(values.max())


def _draw_spectra(axes: "Axes", recipe: Recipe, highest: float, labelled: bool) -> None:
    target = recipe.target
    if target.wavelengths is not None and target.reflectance is not None:
        axes.plot(
            target.wavelengths, target.reflectance, color=_TARGET, lw=3.2, solid_capstyle="round"
        )
    axes.plot(recipe.wavelengths, recipe.reflectance, color=INK, lw=1.3)
    axes.set(
        xlim=(recipe.wavelengths[0], recipe.wavelengths[-1]),
        ylim=(0, 1.0 if highest > 0.35 else 0.4),
    )
    axes.set_xticks([400, 500, 600, 700])
    axes.set_yticks([0, 0.5, 1.0] if highest > 0.35 else [0, 0.2, 0.4])
    axes.tick_params(labelsize=8, length=2, pad=2)
    if labelled:
        axes.set_ylabel("reflectance", fontsize=9)
