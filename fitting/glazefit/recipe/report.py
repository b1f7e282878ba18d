"""Report of a search for recipes: tables on the screen, and the files it leaves."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.text import Text

from glazejax import colour
from glazejax.io import SpectraTable, write_spectra, write_table
from glazejax.io.write import write_files
from glazejax.paint.describe import Coat
from glazejax.plots import hex_colour
from glazejax.report import leave_out, plain_table, swatch

from .parts import describe_parts, parts_by_paint
from .recipe import PAINT_COLUMNS, Recipe
from .selection import IN_GAMUT
from .targets import Bands, Target

CSV_COLUMNS = (
    "target",
    "recipe",
    "delta_e_2000",
    "metamerism",
    "rmse",
    *PAINT_COLUMNS,
    "delta_e_between_mixings",
)

MARK = " !"
"""Stands behind a paint that is poisonous or hard to buy."""

COATS = "coats, top first"

NO_BREAK = "\u00a0"

BRUSHED = 25e-6
"""Thickness of one coat as a brush lays it, m: assumed, as are those of the oils' own films."""
DENSITY = 1.5e6
"""Of paint from a tube, g/m3: assumed; whites are denser, lakes lighter."""
# A coat as far from a brushed one as this counts as one.
_ONE_COAT = 1.5


def in_painters_terms(thickness: float) -> str:
    """A thickness (m) in grams to the square metre and in coats of a brush, which are a guess."""
    coats = thickness / BRUSHED
    size, mass = (float(f"{value:.2g}") for value in (thickness * 1e6, thickness * DENSITY))
    grams = f"{size:g} µm, about {mass:g} g/m²"
    if coats > _ONE_COAT:
        laid = f"{coats:.0f} brushed coats"
    elif coats > 1 / _ONE_COAT:
        laid = "one brushed coat"
    else:
        laid = f"one coat thinned about 1:{max(1 / coats - 1, 1):.0f} with medium"
    return f"{grams}, {laid} (a guess: {DENSITY / 1e6:g} g/ml, {BRUSHED * 1e6:g} µm a coat)"


def describe_coat(coat: Coat) -> str:
    """A coat in words, such as ``3.5 µm · 89.1 % ZincWhite + 10.9 % EmeraldGreen (8 : 1)``; lines
    may break between paints.
    """
    size = f"{coat.thickness * 1e6:.1f} µm{' ·' if len(coat.parts) > 1 else ''}"
    text = f"{size} {' + '.join(_parts(coat))}".replace(" ", NO_BREAK)
    text = text.replace(f"{NO_BREAK}+{NO_BREAK}", f"{NO_BREAK}+ ")
    proportions = describe_parts(coat).replace(" ", NO_BREAK)
    return f"{text} ({proportions})" if proportions else text


def _parts(coat: Coat) -> list[str]:
    """Paints with their percentages, the largest first; a paint alone has none."""
    if len(coat.parts) == 1:
        return [coat.name]
    return [f"{100 * share:.1f} % {name}" for share, name in coat.parts]


def screen_colours(recipe: Recipe) -> tuple[str, str]:
    """Colours of the target and of the recipe on a screen, #rrggbb, seen by the first illuminant
    and the recipe's observer.
    """
    light = next(iter(recipe.delta_e))
    eye = recipe.observer
    target = recipe.target
    if target.wavelengths is not None and target.reflectance is not None:
        wanted = colour.srgb(target.wavelengths, target.reflectance, illuminant=light, observer=eye)
        mixed = colour.srgb(recipe.wavelengths, recipe.reflectance, illuminant=light, observer=eye)
    else:
        # Relative to the illuminant's white, which a screen shows as its own; by the screen's
        # observer, so that a colour of a screen is shown as it was typed.
        white = colour.white_point(recipe.wavelengths, light)
        wanted, mixed = (
            colour.xyz_to_srgb(colour.lab_to_xyz(labs[light], white), white)
            for labs in (target.labs, recipe.lab)
        )
    return hex_colour(wanted), hex_colour(mixed)


def print_recipes(recipes: Sequence[Recipe], console: Console, view_options: str = "") -> None:
    """Print all recipes of one target, coat by coat.

    Args:
        recipes: the best first, as `glazefit.find_recipes` lists them.
        console: to print to.
        view_options: options of ``glazejax render`` under which it shows the colour that was
            computed here.
    """
    first = recipes[0]
    swatches = Text(" ").join(map(swatch, screen_colours(first)))
    title = Text(f"{first.target.name} ", style="bold")
    console.print(title + swatches + Text(" target, first recipe"))
    _print_table(recipes, [{"": str(rank)} for rank in range(1, len(recipes) + 1)], console)
    _print_mixing([first], console)
    for number, coat in enumerate(first.coats, 1):
        text = f"Coat {number} of the first: {in_painters_terms(coat.thickness)}."
        console.print(Text(text, "dim"))
    _print_cautions(recipes, console)
    # A shell takes a quotation mark in a name for the end of the text unless it is set apart.
    coats = first.text.replace("'", "'\\''")
    line = " ".join(filter(None, (f"glazejax render --coats '{coats}'", view_options)))
    console.print(Text(f"See the first: {line}", "dim"), soft_wrap=True)
    mixed = first.mixed
    if mixed is not None:
        unmixed = min(recipe.distance for recipe in recipes)
        instead = f"ΔE00 {mixed.distance:.2f} instead of {unmixed:.2f}"
        # A gain of less is not worth mixing.
        gain = (
            f"Mixing within a coat gains nothing: {instead}."
            if mixed.distance > unmixed - 0.05
            else f"Mixed within a coat: {instead}, by {mixed.text}"
        )
        console.print(Text(gain))
    unsettled = [str(rank) for rank, recipe in enumerate(recipes, 1) if not recipe.converged]
    _print_warnings([recipes], "recipe", unsettled, console)


def print_best(recipe_lists: Sequence[Sequence[Recipe]], console: Console) -> None:
    """Print the best recipe of each of many targets, coat by coat."""
    recipes = [best for best, *_ in recipe_lists]
    leads = [
        {"target": best.target.name, "": Text().join(map(swatch, screen_colours(best)))}
        for best in recipes
    ]
    _print_table(recipes, leads, console)
    mixed = [best.mixed.distance for best in recipes if best.mixed is not None]
    if mixed:
        unmixed = [min(recipe.distance for recipe in several) for several in recipe_lists]
        reached = [sum(off < IN_GAMUT for off in distances) for distances in (mixed, unmixed)]
        text = (
            f"Mixed within a coat: ΔE00 {np.median(mixed):.2f} instead of {np.median(unmixed):.2f} "
            f"in the median, and {reached[0]} instead of {reached[1]} of {len(recipes)} targets "
            "within a ΔE00 of 1."
        )
        console.print(Text(text))
    _print_mixing(recipes, console)
    _print_cautions(recipes, console)
    unsettled = [best.target.name for best in recipes if not best.converged]
    _print_warnings(recipe_lists, "the recipe of", unsettled, console)


def _figures(recipe: Recipe, *, batch: bool) -> dict[str, str]:
    """Colour differences by their headings: lights asked for, the test light if it is another."""
    figures = {f"ΔE00 {name}": f"{value:.2f}" for name, value in recipe.delta_e.items()}
    if recipe.test_illuminant not in recipe.delta_e and recipe.target.spectral:
        figures[f"({recipe.test_illuminant})"] = f"({recipe.metamerism:.2f})"
    if batch and recipe.mixed is not None:
        figures["if mixed"] = f"{recipe.mixed.distance:.2f}"
    return figures | {"mixing": f"{recipe.between_mixings:.1f}"}


def _print_table(
    recipes: Sequence[Recipe], leads: Sequence[Mapping[str, str | Text]], console: Console
) -> None:
    """Print a row a coat, what holds for a recipe in its first, and say what is left out on a
    narrow screen.
    """
    rows = [
        {**lead, **_figures(recipe, batch="target" in lead)}
        for lead, recipe in zip(leads, recipes, strict=True)
    ]
    titles = list(rows[0])
    columns = (*titles, "µm", COATS, "parts", "per 10 %")
    table = plain_table(
        *columns,
        words=[n for n, title in enumerate(columns) if title in ("target", "", COATS)],
        header_style="dim",
        pad_edge=False,
    )
    # A name of a paint is not broken.
    table.columns[-3].no_wrap = True
    for row, recipe in zip(rows, recipes, strict=True):
        cells = list(row.values())
        cautions = recipe.cautions
        for coat, change in zip(recipe.coats, recipe.sensitivity, strict=True):
            lines = [
                f"{paint}{MARK if name in cautions else ''}"
                for paint, (_, name) in zip(_parts(coat), coat.parts, strict=True)
            ]
            size = f"{coat.thickness * 1e6:.1f}"
            table.add_row(*cells, size, "\n".join(lines), describe_parts(coat), f"{change:.2f}")
            cells = [""] * len(cells)
    tested = [title for title in titles if title.startswith("(")]
    table, gone = leave_out(table, console, ("per 10 %", "parts", "mixing", *tested))
    console.print(table)
    if gone:
        note = f"Left out on a screen of {console.width} columns: {', '.join(gone)}."
        console.print(Text(note, "dim"))


def _print_mixing(recipes: Sequence[Recipe], console: Console) -> None:
    apart = np.mean([recipe.between_mixings for recipe in recipes])
    note = f"Column mixing: the same recipe, mixed twice, differs by about ΔE00 {apart:.1f}."
    console.print(Text(note, "dim"))


def _print_cautions(recipes: Sequence[Recipe], console: Console) -> None:
    """A line on each paint that is marked."""
    cautions = {name: why for recipe in recipes for name, why in recipe.cautions.items()}
    if cautions:
        text = "; ".join(f"{name}: {why}" for name, why in cautions.items())
        console.print(Text(f"{MARK.strip()} {text} (--modern leaves such paints out).", "yellow"))


def _print_warnings(
    recipe_lists: Sequence[Sequence[Recipe]],
    what: str,
    unsettled: Sequence[str],
    console: Console,
) -> None:
    """Sentences on targets out of reach, and on recipes whose least squares were stopped."""
    for recipes in recipe_lists:
        # The reason is of the recipe that the distance is of, which need not stand first.
        nearest = min(recipes, key=lambda recipe: recipe.distance)
        if not nearest.in_gamut:
            rank = recipes.index(nearest) + 1
            where = f"in recipe {rank}, " if rank > 1 else ""
            why = (
                "these paints reach no further"
                if nearest.limit == "paints"
                else f"{where}{nearest.limit}: try other bounds"
            )
            distance = f"out of reach by a Delta E of {nearest.gamut_distance:.1f}"
            console.print(Text(f"{nearest.target.name}: {distance}; {why}.", "yellow"))
    if unsettled:
        text = (
            f"Least squares stopped before it had settled for {what} {', '.join(unsettled)}: other "
            "amounts of the same paints may come nearer."
        )
        console.print(Text(text, "yellow"))


def write_csv(recipe_lists: Sequence[Sequence[Recipe]], path: Path, *, overwrite: bool) -> None:
    """Write all recipes, a line for each paint in each coat."""

    def text(value: float | None, digits: int) -> str:
        return "" if value is None else f"{value:.{digits}f}"

    rows = [
        (
            recipe.target.name,
            rank,
            text(recipe.distance, 3),
            text(recipe.metamerism, 3),
            text(recipe.rmse, 5),
            coat,
            f"{thickness:.6g}",
            paint,
            f"{share:.6g}",
            proportion,
            text(change, 3),
            text(recipe.between_mixings, 2),
        )
        for recipes in recipe_lists
        for rank, recipe in enumerate(recipes, 1)
        for coat, thickness, paint, share, proportion, change in recipe.rows()
    ]
    write_table(path, CSV_COLUMNS, rows, overwrite=overwrite)


def write_json(recipe_lists: Sequence[Sequence[Recipe]], path: Path, *, overwrite: bool) -> None:
    """Write all there is on all recipes, with spectra."""
    plain = [[_plain(recipe) for recipe in recipes] for recipes in recipe_lists]
    text = f"{json.dumps(plain, indent=1)}\n"
    write_files({path: [text.encode()]}, overwrite=overwrite)


def _plain(recipe: Recipe) -> dict:
    return {
        "target": recipe.target.name,
        "layers": recipe.text,
        "coats": [
            {
                "thickness_um": round(coat.thickness * 1e6, 6),
                "paints": {name: share for share, name in coat.parts},
                "parts": parts_by_paint(coat),
                "delta_e_per_10_percent": change,
            }
            for coat, change in zip(recipe.coats, recipe.sensitivity, strict=True)
        ],
        "cautions": recipe.cautions,
        "delta_e_2000": dict(recipe.delta_e),
        "delta_e_2000_unrounded": recipe.unrounded,
        "delta_e_between_mixings": recipe.between_mixings,
        "lab": {name: values.tolist() for name, values in recipe.lab.items()},
        "metamerism": recipe.metamerism,
        "test_illuminant": recipe.test_illuminant,
        "rmse": recipe.rmse,
        "in_gamut": recipe.in_gamut,
        "gamut_distance": recipe.gamut_distance,
        "limit": recipe.limit,
        "converged": recipe.converged,
        "solver_steps": recipe.steps,
        "delta_e_2000_before_solver": None if np.isnan(recipe.before) else recipe.before,
        "mixed": None
        if recipe.mixed is None
        else {"layers": recipe.mixed.text, "delta_e_2000": dict(recipe.mixed.delta_e)},
        "wavelengths_nm": recipe.wavelengths.tolist(),
        "reflectance": [round(float(value), 7) for value in recipe.reflectance],
    }


def write_targets(
    targets: Sequence[Target],
    wavelengths: Bands,
    path: Path,
    *,
    overwrite: bool,
) -> None:
    """Write the spectra of targets on some wavelengths (nm), as CSV, CxF3 or ENVI by the name's
    ending.
    """
    spectra = np.stack([target.on(wavelengths) for target in targets])
    table = SpectraTable(wavelengths, tuple(target.name for target in targets), spectra)
    write_spectra(table, path, overwrite=overwrite)
