"""`glazejax recover` where films are fitted together: their recipes, what is known, and the files
that come of it.
"""

import itertools
import re
import time
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

from glazejax.commands import options, progress
from glazejax.paint.describe import format_length

if TYPE_CHECKING:
    from rich.console import Console

    from glazejax import Pigment

    from ..film.films import Films
    from .joint.entries import PaintFile
    from .joint.pose import Gauge
    from .joint.result import JointRecovery
    from .settings import Destination, PriorKnowledge

Recipes: TypeAlias = Mapping[str, Mapping[str, float]]
"""Weight of each paint in each sample."""


def recover_together(
    films: "Films",
    listed: Recipes,
    fit_options: dict[str, Any],
    check: bool,
    knowledge: "PriorKnowledge",
    results: "Destination",
) -> None:
    """Fit films together, and write and say what was found.

    Args:
        films: as read.
        listed: recipes of a list; other films are what their names say.
        fit_options: instrument and noise.
        check: whether films are left out in turn.
        knowledge: own paints, white and thicknesses.
        results: where they go.
    """
    from ..film.gloss import measure_gloss
    from ..film.readers import read_loose_films, recipes_from_names
    from ..film.shared_bands import average, crop
    from .joint.entries import PaintFile, add_paints
    from .joint.joint import recover_jointly
    from .joint.problem import Expectations

    out, metres, plots, overwrite, console = results
    recipes = recipes_from_names(films.names, listed)
    for short, long in _one_paint_twice(recipes):
        console.print(
            f"{short} and {long} are fitted as two paints: if they are one, call it by one name.",
            style="yellow",
        )
    file = None if knowledge.into is None else PaintFile.open(knowledge.into, "--into")
    references = known_paints(recipes, file, knowledge.white, overwrite, knowledge.catalogue)
    gauge = read_gauge(knowledge.wet_film, films.names)
    fitted = average(films)
    for paint in references.values():
        grid = paint.wavelengths
        fitted = crop(fitted, grid[0], grid[-1], f"{paint.name} is known there only")
    progress.print_notes(console, "films", fitted.notes[len(films.notes) :])
    unit = gauge.typical if gauge is not None and not references else metres
    fit_options = fit_options | {"unit": unit, "pigments": references, "gauge": gauge}
    if knowledge.wet_film == "same":
        # Films that one bar drew are as thick to a tenth.
        fit_options["expectations"] = Expectations(thickness=0.1)
    if knowledge.excluded is not None:
        # Of the films that were read without the specular part too.
        grid = fitted.wavelengths
        excluded = crop(
            average(read_loose_films(knowledge.excluded, specular=False, **knowledge.stated)),
            grid[0],
            grid[-1],
            "as the films with the specular part",
        )
        progress.print_notes(console, knowledge.excluded, excluded.notes)
        gloss = measure_gloss(fitted, excluded, fit_options["instrument"])
        values = sorted(gloss.values())
        console.print(
            f"Gloss, from readings with and without the specular part of {len(gloss)} of "
            f"{len(fitted)} films: {values[0]:.2f} to {values[-1]:.2f} of a smooth surface's."
        )
        fit_options["gloss"] = gloss
    with progress.follow("compiling, then fitting all films together") as report:
        began = time.perf_counter()
        recovery = recover_jointly(fitted, recipes, progress=report, **fit_options)
        seconds = time.perf_counter() - began

    from .show.plots import plot_joint_paint, plot_left_out
    from .show.report import film_table, left_out_table, report_joint, report_left_out

    for line in report_joint(recovery, seconds):
        console.print(line)
    if out is not None:
        results.write(
            recovery.pigments(unit).values(),
            {"films.csv": film_table(recovery)},
            recovery.paints,
            lambda row, path: plot_joint_paint(recovery, row, path),
        )
        if check:
            from glazejax.io import write_table

            from .predict.crossvalidation import cross_validate

            with progress.follow("leaving films out") as report:
                left_out = cross_validate(recovery, fitted, recipes, progress=report, **fit_options)
            for line in report_left_out(left_out):
                console.print(line)
            write_table(
                out / "left_out.csv", *left_out_table(recovery, left_out), overwrite=overwrite
            )
            if plots:
                plot_left_out(recovery, left_out, out / "left_out.png")
    _say_scale(recovery, references, gauge, console)
    if file is not None:
        new = add_paints(recovery, file.path, overwrite=overwrite)
        replaced = sorted(set(new) & set(file.paints))
        remark = f" (replaced: {', '.join(replaced)})" if replaced else ""
        console.print(
            f"Added {', '.join(new)} to {file.path}{remark}, with {len(file.paints)} paints there "
            "before."
        )
    if not listed or knowledge.any:
        _print_next_films(recovery, knowledge.catalogue, console)


def _one_paint_twice(recipes: Recipes) -> list[tuple[str, str]]:
    """Pairs of names of which one is the other cut short within a word, as Titan and Titanium."""
    paints = sorted({paint for recipe in recipes.values() for paint in recipe})
    return [
        (short, long)
        for short, long in itertools.permutations(paints, 2)
        if len(short) > 2
        and long.casefold().startswith(short.casefold())
        and long[len(short) : len(short) + 1].islower()
    ]


def known_paints(
    recipes: Recipes,
    file: "PaintFile | None",
    white: str,
    overwrite: bool,
    catalogue: str,
) -> "dict[str, Pigment]":
    """Paints of the recipes that are known: those of the file, and the white, which is one of the
    file or of a catalogue.

    Raises:
        ValueError: a white that neither the file nor a catalogue has or that no film holds, or
            nothing that is new.
    """
    paints = list(
        dict.fromkeys(p for recipe in recipes.values() for p, w in recipe.items() if w > 0)
    )
    in_file = file.paints if file is not None else {}
    pure = {p for recipe in recipes.values() if len(recipe) == 1 for p in recipe}
    references = {p: in_file[p] for p in paints if p in in_file}
    chosen = ""
    if white:
        from glazejax.catalogue import load

        (paint,) = options.find_paints([white], {**load(catalogue), **in_file}).values()
        # The name that it has in films.
        paint = paint.renamed(paint.name.rpartition(":")[2])
        chosen = paint.name
        if chosen not in paints:
            raise ValueError(
                f"--white {white}: no film holds {chosen}; the films are of {', '.join(paints)}"
            )
        references[chosen] = paint
    if overwrite:
        references = {p: paint for p, paint in references.items() if p not in pure or p == chosen}
    if paints and len(references) == len(paints):
        where = "known" if file is None else f"in {file.path}"
        raise ValueError(
            f"all paints of the films are {where} already: {', '.join(paints)}; --overwrite fits "
            "those again that have a film of their own (but --white)"
        )
    return references


_SPREAD = re.compile(r"(?P<length>[^±+]*?)\s*(?:±|\+/?-)\s*(?P<share>\d+(?:\.\d+)?)\s*%")


def read_gauge(text: str, films: Sequence[str], option: str = "--wet-film") -> "Gauge | None":
    """Thicknesses of an option such as ``--wet-film``; None if it is empty, or says that one bar
    drew all films.

    Raises:
        ValueError: no length, or a film that there is not.
    """
    if text in ("", "same"):
        return None
    from .joint.pose import Gauge

    lengths: dict[str, float] = {}
    errors: list[float] = []
    for entry in options.split_names(text):
        film, equals, length = entry.rpartition("=")
        spread = _SPREAD.fullmatch(length.strip())
        metres = options.read_length(spread["length"] if spread else length, option)
        errors += [float(spread["share"]) / 100] if spread else []
        film = film.strip()
        if equals and film not in films:
            raise ValueError(f"{option}: no film is called {film!r}; there are {', '.join(films)}")
        lengths |= dict.fromkeys([film] if equals else films, metres)
    return Gauge(lengths, error=max(errors)) if errors else Gauge(lengths)


def _say_scale(
    recovery: "JointRecovery",
    references: "Mapping[str, Pigment]",
    gauge: "Gauge | None",
    console: "Console",
) -> None:
    unit = recovery.unit
    if references:
        films = ~recovery.films.opaque
        thick = (
            f"; on it the films are {_lengths(recovery.thickness[films] * unit)} thick"
            if films.any()
            else ""
        )
        console.print(f"Scale: that of {' and '.join(references)}{thick}.", style="bold")
    elif gauge is not None:
        console.print(
            f"Thickness: as measured, about {format_length(gauge.typical)}; k and s share its "
            f"error of {gauge.common:.0%}. In films.csv it is in units of {format_length(unit)}.",
            style="bold",
        )
    else:
        console.print(
            f"Thickness: a typical film is taken as {format_length(unit)}, not measured. "
            "Thicknesses in films.csv are in units of that.",
            style="bold",
        )


def _lengths(metres: Any) -> str:
    low = float(f"{metres.min():.2g}")
    high = float(f"{metres.max():.2g}")
    return format_length(low) if low == high else f"{format_length(low)} to {format_length(high)}"


def _print_next_films(recovery: "JointRecovery", catalogue: str, console: "Console") -> None:
    """Say of the first few new paints what would teach most."""
    from glazejax.catalogue import load

    from .predict.next_reading import rank_next_films

    new = [paint for paint in recovery.paints if paint not in recovery.known]
    shelf = load(catalogue)
    # What tints would be made with, where no white is named.
    stand_in = next(shelf[name] for name in ("ZincWhite", "TitaniumWhite") if name in shelf)
    for paint in new[:3]:
        ranking = rank_next_films(recovery, paint, white=stand_in)
        best, *further_films = ranking.films
        runners_up = "; ".join(
            f"{further.film}: {further.expected:.1f}" for further in further_films[:2]
        )
        console.print(
            f"{paint}: mixtures with white and films of it are predicted to "
            f"ΔE00 {ranking.now:.1f}. Most useful next film: {best.film} "
            f"(then {best.expected:.1f}; {runners_up})."
        )
