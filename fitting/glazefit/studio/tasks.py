"""The studio's searches: what a page asks for in plain JSON, the public function that finds it, and
its answer.

Each takes what is asked for and a function that takes words about the progress.
`glazejax.studio.jobs` runs them in a process of their own, where they are registered as entry
points `glazejax.studio`.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from glazejax import Pigment, catalogue, colour
from glazejax.catalogue import ASSUMED_THICKNESS
from glazejax.io import SpectraTable
from glazejax.paint.describe import MAX_THICKNESS, Coat
from glazejax.spectra import Bands, lie_between
from glazejax.stacks import (
    BLACK,
    WHITE,
    Hiding,
    Stack,
    all_paints,
    own_name,
    pigment_to_dict,
    stack_from_dict,
    stack_to_dict,
)
from glazejax.studio.page_data import entry

from ..film.readers import films_of

Request = Mapping[str, Any]
Report = Callable[[str], None]
_CANDIDATES = 5


def recipes(request: Request, report: Report) -> dict[str, Any]:
    """Best five recipes for a colour of the screen or a spectrum.

    Args:
        request: `stack`, whose ground, index and geometry count; `options` with `max_coats`, 1 or
            2, `own` (only own paints), `modern` (no other poisonous or unsold ones), and `srgb`, or
            `wavelengths` and `reflectance` of a spectrum.
        report: takes words.

    Raises:
        ValueError: the ground is paint that hides, no paint is left, or what
            `glazefit.find_recipes` refuses.
    """
    from ..recipe.parts import describe_parts
    from ..recipe.recipe import find_recipes
    from ..recipe.targets import spectral_target, srgb_target

    stack = stack_from_dict(request["stack"])
    options = request.get("options", {})
    if "reflectance" in request:
        target = spectral_target(
            np.array(request["wavelengths"]), np.array(request["reflectance"]), name="the spectrum"
        )
    else:
        target = srgb_target(str(options.get("srgb", "")))
    paints, short = _paints(stack)
    if options.get("own"):
        paints = [paint for paint in paints if paint.name in stack.pigments]
    shelf = len(paints)
    if options.get("modern"):
        paints = [
            paint
            for paint in paints
            if paint.name in stack.pigments or not catalogue.caution(paint)
        ]
    left_out = shelf - len(paints)
    if not paints:
        raise ValueError(short or "no paint is left: there is no tube of your own on the shelf")
    ground = _ground(stack, paints[0].wavelengths)
    report("; ".join(filter(None, (f"looking through all sets of {len(paints)} paints", short))))
    best_recipes = find_recipes(
        target,
        paints,
        ground=ground,
        instrument=stack.instrument,
        refractive_index=stack.refractive_index,
        max_coats=1 if options.get("max_coats") == 1 else 2,
        count=5,
    )
    listed = [
        {
            "words": recipe.text,
            "delta_e": recipe.distance,
            "between": recipe.between_mixings,
            "parts": " over ".join(filter(None, map(describe_parts, recipe.coats))),
            "cautions": "; ".join(f"{name}: {why}" for name, why in recipe.cautions.items()),
            "in_gamut": recipe.in_gamut,
            "rgb": _rgb(recipe.wavelengths, recipe.reflectance),
            "stack": _with_coats(stack, recipe.coats),
        }
        for recipe in best_recipes
    ]
    best = best_recipes[0]
    remark = (
        ""
        if best.in_gamut
        else f"out of reach of these paints by ΔE00 {best.gamut_distance:.1f} at least"
    )
    if remark and left_out:
        remark += f" ({left_out} poisonous or unsold paints are left out)"
    return {"target": target.name, "recipes": listed, "words": remark}


def identification(request: Request, report: Report) -> dict[str, Any]:
    """Identify the paints in a spectrum, or in films over a black and a white card.

    Args:
        request: `wavelengths`, `reflectance`; `options` with `names`, and `below`, the ground of a
            single spectrum: "opaque", "white", "black" or "ground" (the stack's); `films`, whether
            rows are films in fours.
        report: takes words.

    Raises:
        ValueError: the film's ground is paint that hides, or what `glazefit.identify` refuses.
    """
    from ..identify.identify import IdentificationOptions, identify_chunks, identify_films
    from ..identify.result import Identification

    stack = stack_from_dict(request["stack"])
    options = request.get("options", {})
    table = _table(request)
    paints, short = _paints(stack)
    words = f"weighing sets of {len(paints)} paints, and none of them"
    report("; ".join(filter(None, (words, short))))
    if options.get("films"):
        result = identify_films(films_of(table), paints, keep=_CANDIDATES)
    else:
        below = options.get("below", "opaque")
        levels = {"opaque": None, "white": WHITE, "black": BLACK}
        if below not in (*levels, "ground"):
            raise ValueError(
                f"the film lies over {below!r}; it must be opaque, white, black or ground"
            )
        finished_chunks = []
        # The stack's ground need not reach as far as a film that is not on it.
        level = _ground(stack, table.wavelengths) if below == "ground" else levels[below]
        chunks = identify_chunks(
            table.wavelengths,
            table.reflectance,
            paints,
            IdentificationOptions(keep=_CANDIDATES),
            ground=level,
            opaque=level is None,
            names=table.names,
        )
        for chunk in chunks:
            finished_chunks.append(chunk)
            report(f"{sum(map(len, finished_chunks))} of {len(table.names)} spectra")
        result = Identification.join(finished_chunks)
    return {"spectra": [_describe_spectrum(stack, result, row) for row in range(len(result))]}


def _describe_spectrum(stack: Stack, identification: Any, row: int) -> dict[str, Any]:
    """One spectrum's list, 'none of these' in its place."""
    grid = identification.measured.wavelengths
    listed = []
    for candidate in identification.ranked(row)[:_CANDIDATES]:
        thick = candidate.thickness
        sized = f"{thick * 1e6:.3g} µm thick, "
        if not np.isfinite(thick):
            thick = 1e-4
            sized = "hides its ground, "
        # No more than one coat is tried.
        parts = tuple(
            (round(share, 4), paint)
            for share, paint in zip(candidate.fractions.tolist(), candidate.paints, strict=True)
        )
        coat = Coat(parts, float(f"{min(thick, MAX_THICKNESS):.4g}"), 1)
        listed.append(
            {
                "words": candidate.words,
                "fit": f"{sized}fit error {candidate.rmse:.3f}",
                "probability": float(candidate.probability),
                "rgb": _rgb(grid, candidate.fitted[-1]),
                "stack": _with_coats(stack, [coat]),
            }
        )
    none = float(identification.none[row])
    listed.append(
        {
            "words": "none of these paints",
            "fit": "",
            "probability": none,
            "rgb": None,
            "stack": None,
        }
    )
    listed.sort(key=lambda entry: -entry["probability"])
    return {
        "name": identification.measured.names[row],
        "words": f"against {len(identification.paints)} paints",
        "candidates": listed,
    }


def recovery(request: Request, report: Report) -> dict[str, Any]:
    """Paints of measured films, rows in fours as `glazefit.read_films` has them, by their names.

    Args:
        request: `wavelengths`, `reflectance`, and `options` with the rows' `names`.
        report: takes words.

    Raises:
        ValueError: more films than can be waited for, or what `glazefit.recover_films` refuses.
    """
    from ..recover.films.film_by_film import recover_films

    films = films_of(_table(request))
    # More would take long.
    most = 20
    if len(films) > most:
        raise ValueError(
            f"{len(films)} films take long; the studio recovers {most} at once, `recover` "
            "any number"
        )
    report(f"recovering {len(films)} films")
    result = recover_films(films)
    origin = (
        f"recovered in the studio from one film each, taken as {ASSUMED_THICKNESS * 1e6:g} "
        "micrometres thick: k and s scale with its inverse"
    )
    paints = {
        own_name(film): result.pigment(row, ASSUMED_THICKNESS, origin)
        for row, film in enumerate(films.names)
    }
    return {
        "pigments": {name: pigment_to_dict(paint) for name, paint in paints.items()},
        "entries": [entry(name, paint) for name, paint in paints.items()],
        "words": f"films taken as {ASSUMED_THICKNESS * 1e6:g} µm thick",
    }


def _ground(stack: Stack, wavelengths: Bands) -> float | Bands:
    """The stack's ground for a search, at wavelengths in nm."""
    # A stack counts paint that hides as its last coat, which a search does not take along.
    if isinstance(stack.ground, Hiding):
        raise ValueError(
            "a search takes a ground of known reflectance, not one of paint: choose white, black, "
            "grey or a measured one"
        )
    return stack.ground_on(wavelengths)


def _paints(stack: Stack) -> tuple[list[Pigment], str]:
    """The catalogue that the stack's uppermost paint is from, and own paints on the same
    wavelengths; words about own paints that do not reach so far.
    """
    shelf = all_paints()
    first = next(
        (name for coat in stack.shown for _, name in coat.parts if name not in stack.pigments), ""
    )
    group = first.rpartition("/")[0]
    chosen = {name: paint for name, paint in shelf.items() if name.rpartition("/")[0] == group}
    grid = next(iter(chosen.values())).wavelengths
    own_paints = {
        name: paint.resample(grid)
        for name, paint in stack.pigments.items()
        if lie_between(grid, paint.wavelengths[0], paint.wavelengths[-1]).all()
    }
    short = [
        f"{name} is known from {paint.wavelengths[0]:g} to {paint.wavelengths[-1]:g} nm"
        for name, paint in stack.pigments.items()
        if name not in own_paints
    ]
    words = f"{', '.join(short)}; a search needs {grid[0]:g} to {grid[-1]:g} nm" if short else ""
    return [paint.renamed(name) for name, paint in {**chosen, **own_paints}.items()], words


def _table(request: Request) -> SpectraTable:
    """Spectra as the page sent them, checked; single precision leaves 0.4 as 0.4000000059604645."""
    grid = np.round(np.array(request["wavelengths"], float), 4)
    values = np.round(np.array(request["reflectance"], float).reshape(-1, grid.size), 7)
    names = tuple(map(str, request.get("options", {}).get("names", ["spectrum"])))
    if len(names) != len(values):
        raise ValueError(
            f"{len(names)} names were sent for {len(values)} spectra; drop the file again"
        )
    return SpectraTable(grid, names, values)


def _with_coats(stack: Stack, coats: Sequence[Coat]) -> dict[str, Any]:
    """The page's stack with other coats, and the own paints that they need."""
    named = {name for coat in coats for _, name in coat.parts}
    own_paints = {name: paint for name, paint in stack.pigments.items() if name in named}
    return stack_to_dict(replace(stack, coats=tuple(coats), hidden=(), pigments=own_paints))


def _rgb(grid: Bands, reflectance: Bands) -> list[int] | None:
    try:
        shade = colour.srgb(grid, reflectance)
    except ValueError:  # The bands give no colour.
        return None
    return np.round(255 * np.asarray(shade, float)).astype(int).tolist()
