"""Fits of `glazejax recover`, film by film, of films together by their recipes, or of coats of a
brush: what is said of them, and the files that come of them.
"""

import itertools
import re
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import equinox as eqx
import numpy as np
import typer
from rich.console import Console

from glazejax import Pigment
from glazejax.catalogue import load
from glazejax.colour import colour_weights
from glazejax.commands import options, progress
from glazejax.io import write_table
from glazejax.io.quantity import Stated
from glazejax.paint.describe import format_length
from glazejax.paint.pigment_table import write_pigments

from ..film.films import Films
from ..film.gloss import measure_gloss
from ..film.readers import read_loose_films, recipes_from_names
from ..film.shared_bands import average, crop
from .coats.coats import MOST_COATS, coat_of, predict_next_coat, recover_coats
from .films.film_by_film import recover_chunks
from .films.result import Recovery
from .joint.entries import add_paints, read_own_paints
from .joint.joint import recover_jointly
from .joint.pose import Gauge
from .joint.problem import Expectations
from .joint.result import JointRecovery
from .predict.crossvalidation import cross_validate
from .predict.next_reading import rank_next_films
from .show.plots import plot_joint_paint, plot_ladder, plot_left_out, plot_paint
from .show.report import (
    Table,
    coat_table,
    film_table,
    fit_table,
    left_out_table,
    next_coat_table,
    report_coats,
    report_films,
    report_joint,
    report_left_out,
)

Recipes: TypeAlias = Mapping[str, Mapping[str, float]]
"""Weight of each paint in each sample."""


class Destination(NamedTuple):
    """Destination of results: the folder, the films' thickness in m, whether pictures are drawn,
    and the screen.
    """

    out: Path | None
    thickness: float
    plots: bool
    overwrite: bool
    console: Console

    def write(
        self,
        pigments: Iterable[Pigment],
        tables: Mapping[str, Table],
        names: Sequence[str],
        draw: Callable[[int, Path], object],
    ) -> None:
        """Write paints, tables and pictures into the folder, which need not exist, and say so.

        Args:
            pigments: that go into `pigments.csv`.
            tables: by the names of their files.
            names: of what the pictures show; files differ also where the file system takes capitals
                for small letters.
            draw: draws one of them, by number, to a path.
        """
        out = self.out
        assert out is not None
        out.mkdir(parents=True, exist_ok=True)
        write_pigments(out / "pigments.csv", pigments, digits=6, overwrite=self.overwrite)
        for file, table in tables.items():
            write_table(out / file, *table, overwrite=self.overwrite)
        written = ["pigments.csv", *tables]
        if self.plots:
            stems: set[str] = set()
            with progress.follow("drawing", len(names)) as note:
                for number, name in enumerate(names):
                    stem = slug(name)
                    while stem.lower() in stems:
                        stem += "_"
                    stems.add(stem.lower())
                    draw(number, out / f"{stem}.png")
                    note(number + 1, len(names), "drawing")
            written.append(f"{len(names)} pictures")
        self.console.print(f"Wrote {', '.join(written[:-1])} and {written[-1]} to {out}")


def slug(name: str) -> str:
    """A name that any file system takes."""
    return re.sub(r"[^A-Za-z0-9.]+", "_", name).strip("_.") or "paint"


def recover_each(
    films: Films,
    fit_options: dict[str, Any],
    results: Destination,
    simulated: Sequence[Pigment],
) -> None:
    """Recover each film by itself, and write and say what was found.

    Args:
        films: as read, or made.
        fit_options: instrument and noise.
        results: where they go.
        simulated: true paints of films that were made; none of measured ones.
    """
    metres = results.thickness
    console = results.console
    chunks = recover_chunks(films, **fit_options)
    chunk_recoveries, how = progress.collect(
        lambda _: chunks, len(films), "compiling, then recovering", "recovering"
    )
    recovery = Recovery.join(films, chunk_recoveries)
    for line in report_films(recovery, how.seconds, how.first):
        console.print(line)
    console.print(
        f"Thickness: {format_length(metres)} is assumed, not measured. Only k d and s d are known: "
        "a film of twice that has half the k and s.",
        style="bold",
    )
    results.write(
        [recovery.pigment(row, metres) for row in range(len(recovery))],
        {"fits.csv": fit_table(recovery)},
        recovery.films.names,
        lambda row, path: plot_paint(recovery, row, metres, path),
    )
    if simulated:
        _compare(recovery, metres, simulated, console)
    if how.interrupted:
        progress.stop_interrupted(console, len(recovery), len(films), "films")


def _compare(
    recovery: Recovery, thickness: float, paints: Sequence[Pigment], console: Console
) -> None:
    """Say how often the simulated truth lies in the error bands."""
    truth = thickness * np.stack(
        [np.column_stack([paint.absorption, paint.scattering]) for paint in paints[: len(recovery)]]
    )
    lower, upper = recovery.interval()
    covered = (truth >= lower) & (truth <= upper)
    bands = recovery.identifiable
    if bands.any():
        k, s = covered[bands].mean(axis=0)
        console.print(
            f"The true k lies in its 95 % band in {k:.1%} and the true s in {s:.1%} of the "
            f"{bands.sum()} bands where both are known."
        )


def recover_together(
    films: Films,
    listed: Recipes,
    fit_options: dict[str, Any],
    results: Destination,
    *,
    check: bool,
    into: Path | None,
    white: str,
    wet_film: str,
    excluded: Path | None,
    catalogue: str,
    stated: Stated,
) -> None:
    """Fit films together, and write and say what was found.

    Args:
        films: as read.
        listed: recipes of a list; other films are what their names say.
        fit_options: instrument and noise.
        results: where they go.
        check: whether films are left out in turn.
        into: file of own paints.
        white: of the tints, by name.
        wet_film: thicknesses.
        excluded: the same films read without the specular part.
        catalogue: that the white is searched in.
        stated: what files hold.
    """
    out, metres, plots, overwrite, console = results
    recipes = recipes_from_names(films.names, listed)
    for short, long in _one_paint_twice(recipes):
        console.print(
            f"{short} and {long} are fitted as two paints: if they are one, call it by one name.",
            style="yellow",
        )
    own_paints = {} if into is None else read_own_paints(into, "--into")
    references = known_paints(recipes, own_paints, into, white, overwrite, catalogue)
    gauge = read_gauge(wet_film, films.names)
    fitted = average(films)
    for paint in references.values():
        grid = paint.wavelengths
        fitted = crop(fitted, grid[0], grid[-1], f"{paint.name} is known there only")
    progress.print_notes(console, "films", fitted.notes[len(films.notes) :])
    if check:
        # Predictions are judged by their colours: bands that give none are refused here, before the
        # fit.
        colour_weights(fitted.wavelengths)
    unit = gauge.typical if gauge is not None and not references else metres
    fit_options = fit_options | {"unit": unit, "pigments": references, "gauge": gauge}
    if wet_film == "same":
        # Films that one bar drew are as thick to a tenth.
        fit_options["expectations"] = Expectations(thickness=0.1)
    if excluded is not None:
        # Of the films that were read without the specular part too.
        grid = fitted.wavelengths
        diffuse = crop(
            average(read_loose_films(excluded, specular=False, **stated)),
            grid[0],
            grid[-1],
            "as the films with the specular part",
        )
        progress.print_notes(console, excluded, diffuse.notes)
        gloss = measure_gloss(fitted, diffuse, fit_options["instrument"])
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
    for line in report_joint(recovery, seconds):
        console.print(line)
    if out is not None:
        results.write(
            recovery.pigments(unit).values(),
            {"films.csv": film_table(recovery)},
            recovery.paints,
            lambda row, path: plot_joint_paint(recovery, row, path),
        )
    _say_scale(recovery, references, gauge, console)
    if into is not None:
        new = add_paints(recovery, into, overwrite=overwrite)
        replaced = sorted(set(new) & set(own_paints))
        remark = f" (replaced: {', '.join(replaced)})" if replaced else ""
        console.print(
            f"Added {', '.join(new)} to {into}{remark}, with {len(own_paints)} paints there before."
        )
    # After all that is kept, since it may be refused where no film can be left out.
    if check:
        with progress.follow("leaving films out") as report:
            left_out = cross_validate(recovery, fitted, recipes, progress=report, **fit_options)
        for line in report_left_out(left_out):
            console.print(line)
        if out is not None:
            write_table(
                out / "left_out.csv", *left_out_table(recovery, left_out), overwrite=overwrite
            )
            if plots:
                plot_left_out(recovery, left_out, out / "left_out.png")
        if not left_out.complete:
            raise typer.Exit(progress.INTERRUPTED)
    # What teaches most is told by colours.
    coloured = not np.isnan(recovery.delta_e()).any()
    if coloured and (not listed or into or white or wet_film or excluded):
        _print_next_films(recovery, catalogue, console)


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
    own_paints: Mapping[str, Pigment],
    into: Path | None,
    white: str,
    overwrite: bool,
    catalogue: str,
) -> dict[str, Pigment]:
    """Paints of the recipes that are known: own ones, of the file `into`, and the white, which is
    one of these or of a catalogue.

    Raises:
        ValueError: a white that neither the file nor a catalogue has or that no film holds, or
            nothing that is new.
    """
    paints = list(
        dict.fromkeys(p for recipe in recipes.values() for p, w in recipe.items() if w > 0)
    )
    pure = {p for recipe in recipes.values() if len(recipe) == 1 for p in recipe}
    references = {p: own_paints[p] for p in paints if p in own_paints}
    if white:
        (paint,) = options.find_paints([white], {**load(catalogue), **own_paints}).values()
        # The name that it has in films.
        paint = paint.renamed(paint.name.rpartition(":")[2])
        if paint.name not in paints:
            raise ValueError(
                f"--white {white}: no film holds {paint.name}; the films are of {', '.join(paints)}"
            )
        references[paint.name] = paint
        pure.discard(paint.name)
    if overwrite:
        references = {p: paint for p, paint in references.items() if p not in pure}
    if len(references) == len(paints):
        where = "known" if into is None else f"in {into}"
        raise ValueError(
            f"all paints of the films are {where} already: {', '.join(paints)}; --overwrite fits "
            "those again that have a film of their own (but --white)"
        )
    return references


_SPREAD = re.compile(r"(?P<length>[^±+]*?)\s*(?:±|\+/?-)\s*(?P<share>\d+(?:\.\d+)?)\s*%")


def read_gauge(text: str, films: Sequence[str], option: str = "--wet-film") -> Gauge | None:
    """Thicknesses of an option such as ``--wet-film``; None if it is empty, or says that one bar
    drew all films.

    Raises:
        ValueError: no length, a film that there is not or that is named twice, or a length for all
            films that does not stand first.
    """
    if text == "" or (text == "same" and option == "--wet-film"):
        return None
    lengths: dict[str, float] = {}
    named: set[str] = set()
    errors: list[float] = []
    for entry in options.split_names(text):
        film, equals, length = entry.rpartition("=")
        spread = _SPREAD.fullmatch(length.strip())
        metres = options.read_length(spread["length"] if spread else length, option)
        errors += [float(spread["share"]) / 100] if spread else []
        film = film.strip()
        if equals and film not in films:
            raise ValueError(f"{option}: no film is called {film!r}; there are {', '.join(films)}")
        if film in named:
            raise ValueError(f"{option}: {film!r} is named twice; give one length for it")
        if not equals and lengths:
            raise ValueError(
                f"{option}: {entry!r} is for all films and must stand first; for one film write "
                f"FILM={entry}"
            )
        named |= {film} if equals else set()
        lengths |= dict.fromkeys([film] if equals else films, metres)
    if len(set(errors)) > 1:
        raise ValueError(
            f"{option}: one error counts for all lengths, and {min(errors):.0%} and "
            f"{max(errors):.0%} are stated; state one"
        )
    return Gauge(lengths, error=errors[0]) if errors else Gauge(lengths)


def _say_scale(
    recovery: JointRecovery,
    references: Mapping[str, Pigment],
    gauge: Gauge | None,
    console: Console,
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


def _print_next_films(recovery: JointRecovery, catalogue: str, console: Console) -> None:
    """Say of the first few new paints what would teach most."""
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


def are_coats(films: Films, refused: Mapping[str, object]) -> bool:
    """True if the films of a table are coats, by their names.

    Args:
        films: as read.
        refused: option -> what was given, of options that are not for coats.

    Raises:
        ValueError: some are and some are not, or an option was given that is not for coats.
    """
    named = [name for name in films.names if coat_of(name)]
    if not named:
        return False
    other_film = next((name for name in films.names if not coat_of(name)), None)
    if other_film is not None:
        raise ValueError(
            f"{named[0]!r} is a film of coats and {other_film!r} is not: put coats into a table of "
            "their own, each film called 'PAINT 1 coat', 'PAINT 2 coats', ..."
        )
    for option, value in refused.items():
        if value:
            raise ValueError(f"{option} is not for coats, such as {named[0]!r}; leave it out")
    return True


def recover_from_coats(films: Films, fit_options: dict[str, Any], results: Destination) -> None:
    """Recover paints from their coats, and predict the next ones.

    Args:
        films: as read.
        fit_options: instrument and noise.
        results: where they go.
    """
    metres = results.thickness
    console = results.console
    fitted = average(films)
    progress.print_notes(console, "films", fitted.notes[len(films.notes) :])
    with progress.follow("compiling, then fitting the coats of each paint") as note:
        began = time.perf_counter()
        recovery = recover_coats(fitted, progress=note, **fit_options)
        predictions = []
        for paint in recovery.paints:
            last = recovery.thickest(paint)
            predictions += [
                predict_next_coat(recovery, paint, np.floor(last.coats) + extra, last.ground)
                for extra in (1.0, 2.0)
                if np.floor(last.coats) + extra <= MOST_COATS
            ]
        seconds = time.perf_counter() - began
    for line in report_coats(recovery, predictions, seconds):
        console.print(line)
    console.print(f"In pigments.csv a coat is taken as {format_length(metres)}.")
    names = list(recovery.paints)
    results.write(
        [
            eqx.tree_at(lambda paint: paint.error_modes, fit.pigment(name, metres), None)
            for name, fit in recovery.paints.items()
        ],
        {"films.csv": coat_table(recovery), "next_coats.csv": next_coat_table(predictions)},
        names,
        lambda number, path: plot_ladder(recovery, predictions, names[number], path),
    )
