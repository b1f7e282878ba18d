"""The command `glazejax recipe`: a colour or a spectrum in, glazes out."""

import shlex
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from glazejax.commands import options, progress
from glazejax.commands.command_line import changed, ground_file
from glazejax.commands.help_groups import help_groups

from .targets import (
    Target,
    colourchecker_targets,
    lab_target,
    parse_srgb,
    spectral_target,
    srgb_target,
)

if TYPE_CHECKING:
    from rich.console import Console

    from glazejax import Pigment

    from .recipe import Recipe
    from .task import RecipeTask


_GEOMETRY = "45:0"
# Films are read as for `glazejax predict` and `glazejax recover`.
_GEOMETRY_OF_READING = "d:8"
_GROUND = "0.9"
_COATS = "1-50um"


@help_groups(
    usual="--lab --srgb --spectrum --only --out",
    given="--samples --quantity --unit --scale "
    "--colourchecker --patch --after --mixed --batch --pigments --catalogue "
    "--without --modern --ground --instrument",
    tried="--glazes --max-paints --max-coats --coat-thickness --illuminants --test-illuminant",
    written="--count --csv --json --spectra --overwrite",
    fine="--metamerism --observer --refractive-index --seed",
)
def recipe(
    lab: Annotated[
        str | None,
        options.option(
            metavar="L,A,B",
            callback=options.checked(lambda text: _read_lab(text, "D65")),
            help="Colour L*,a*,b*, such as 50,20,30.",
        ),
    ] = None,
    srgb: Annotated[
        str | None,
        options.option(
            metavar="COLOUR",
            callback=options.checked(parse_srgb),
            help="Colour of a screen, such as '#8a4b2d' or 138,75,45.",
        ),
    ] = None,
    spectrum: Annotated[
        Path | None,
        options.file_option(
            help="File of measured reflectance; see --samples.",
        ),
    ] = None,
    samples: options.Samples = "",
    quantity: options.Quantity = None,
    unit: options.Unit = None,
    scale: options.Scale = None,
    after: Annotated[
        Path | None,
        options.file_option(
            help="Spectra of one film of the mixture as it came out (format of predict "
            "--reading), to compute what to add. With --mixed.",
        ),
    ] = None,
    mixed: Annotated[
        str,
        options.option(
            metavar="MIXTURE",
            help="Mixture of --after by weight: '10 Vermillion + 90 ZincWhite'.",
        ),
    ] = "",
    batch: Annotated[
        float | None,
        options.option(
            metavar="GRAMS",
            help="Amount of that mixture. Default: the weights of --mixed are grams.",
        ),
    ] = None,
    colourchecker: Annotated[
        bool,
        typer.Option("--colourchecker", help="The 24 measured patches of a ColorChecker chart."),
    ] = False,
    patch: Annotated[
        str,
        options.option(
            metavar="NAMES", help="Only these patches of the chart, such as 'blue sky,dark skin'."
        ),
    ] = "",
    illuminants: Annotated[
        str,
        typer.Option(
            metavar="NAMES",
            help="CIE illuminants of the match: D65,A,FL11 with --spectrum or --colourchecker. "
            "--lab is the colour under the one named here.",
        ),
    ] = "D65",
    test_illuminant: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            callback=options.checked(options.check_illuminant),
            help="Light used only to report metamerism.",
        ),
    ] = "A",
    observer: options.Observer = "2",
    glazes: Annotated[
        bool,
        typer.Option(
            "--glazes",
            help="No mixing: each coat is one paint from the tube. The answer states the gain "
            "of mixing.",
        ),
    ] = False,
    max_paints: Annotated[
        int | None,
        options.option(
            callback=options.between(1, 6),
            help="Largest number of paints in a recipe, 1 to 6. Default: 3, with --glazes 6.",
        ),
    ] = None,
    max_coats: Annotated[
        int | None,
        options.option(
            callback=options.between(1, 6),
            help="Largest number of coats, 1 to 4, with --glazes to 6. Default: 2, with --glazes "
            "6.",
        ),
    ] = None,
    coat_thickness: Annotated[
        str | None,
        options.option(
            metavar="RANGE",
            help=f"Thinnest and thickest coat; bare numbers are micrometres. Default: {_COATS}.",
        ),
    ] = None,
    only: options.Only = "",
    without: options.Without = "",
    modern: Annotated[
        bool,
        typer.Option(
            "--modern",
            help="Exclude poisonous paints and those rarely or no longer sold, except your own.",
        ),
    ] = False,
    pigments: options.Pigments = None,
    catalogue: options.CatalogueName = None,
    ground: Annotated[str | None, options.ground_option(_GROUND)] = None,
    refractive_index: options.RefractiveIndex = 1.5,
    instrument: Annotated[
        str | None, options.instrument_option(f"{_GEOMETRY}; with --after {_GEOMETRY_OF_READING}")
    ] = None,
    metamerism: Annotated[
        float,
        typer.Option(
            callback=options.between(0.0),
            help="Weight of the spectrum relative to the colour: an error of 0.01 (root mean "
            "square) counts as this Delta E.",
        ),
    ] = 0.2,
    count: Annotated[
        int,
        typer.Option(
            callback=options.between(1, 1000), help="Largest number of recipes for a target."
        ),
    ] = 5,
    seed: options.Seed = 0,
    out: options.PictureIfNamed = None,
    csv: options.Csv = None,
    json: Annotated[
        Path | None,
        options.option(metavar="FILE", help="Also write all recipes, with their spectra, as JSON."),
    ] = None,
    spectra: Annotated[
        Path | None,
        options.option(
            metavar="FILE", help="Also write the targets' spectra, at the paints' wavelengths."
        ),
    ] = None,
    overwrite: options.Overwrite = False,
) -> None:
    """Find recipes for a colour: paints, their order and thickness.

    All sets of up to three paints in one coat or two are tried. The best
    recipes are printed with their colour difference, the change if a coat is
    10 % thicker or thinner, and the distance of a colour out of reach.

    Example: glazejax recipe --srgb '#8a4b2d' --max-coats 1

    Without mixing, in up to six coats: glazejax recipe --lab 50,20,30 --glazes

    For many colours at once: glazejax recipe --colourchecker

    Correct a mixture: glazejax recipe --lab 50,20,30 --after film.csv --mixed '10
    Vermillion + 90 ZincWhite' says what to add, in grams.
    """
    started = time.perf_counter()
    outputs = {"--out": out, "--csv": csv, "--json": json, "--spectra": spectra}
    if (after is None) != (not mixed) or (batch is not None and after is None):
        raise ValueError(
            "--after FILE, --mixed MIXTURE and --batch GRAMS go together: what was mixed, and how "
            "it came out"
        )
    named = [option for option, path in outputs.items() if path is not None]
    if after is not None and named:
        raise ValueError(f"{named[0]} is for recipes; --after writes nothing: leave it out")
    searched = {
        "glazes": glazes,
        "max_paints": max_paints,
        "max_coats": max_coats,
        "coat_thickness": coat_thickness,
        "test_illuminant": test_illuminant,
        "metamerism": metamerism,
        "count": count,
        "seed": seed,
    }
    unused = changed(recipe, searched)
    if after is not None and unused:
        raise ValueError(
            f"{unused[0]} is for recipes; --after adds one or two paints to a mixture: leave it out"
        )
    bounds = options.read_lengths(
        _COATS if coat_thickness is None else coat_thickness, "--coat-thickness"
    )
    lights = options.split_names(illuminants)
    if not lights:
        raise ValueError("--illuminants is empty: name at least one, such as D65")
    for light in lights:
        options.check_illuminant(light)
    if after is not None and len(lights) > 1:
        raise ValueError(
            f"--illuminants {illuminants}: --after corrects a colour under one light; name one"
        )
    if len(lights) > 1 and (lab is not None or srgb is not None):
        raise ValueError(
            f"--illuminants {illuminants} needs a target with a spectrum, --spectrum FILE or "
            "--colourchecker: --lab and --srgb are a colour under one light"
        )
    if [lab, srgb, spectrum, patch or colourchecker or None].count(None) != 3:
        raise ValueError(
            "give one target: --lab 50,20,30, --srgb '#8a4b2d', --spectrum FILE, or "
            "--colourchecker (see --help)"
        )
    if samples and spectrum is None and after is None:
        raise ValueError("--samples names spectra of a file: add --spectrum FILE")
    of_values = {"quantity": quantity, "unit": unit, "scale": scale}
    if spectrum is None and after is None and (unused := changed(recipe, of_values)):
        raise ValueError(f"{unused[0]} is of spectra of a file: add --spectrum FILE")
    if spectra is not None and (lab is not None or srgb is not None):
        raise ValueError("--spectra: the target is a colour and has no spectrum; leave it out")
    options.check_names(options.split_names(f"{only},{without}"), pigments, catalogue)
    options.check_outputs(outputs, overwrite, inputs=[spectrum, ground_file(ground), pigments])
    # The colours of spectra are computed in double precision too.
    from glazejax.commands.main import start_jax
    from glazejax.plots import load_matplotlib_ahead

    start_jax()
    if out is not None:
        load_matplotlib_ahead()
    usual = _GEOMETRY if after is None else _GEOMETRY_OF_READING
    seen_by = options.read_geometry(instrument, usual)
    base = options.read_ground(_GROUND if ground is None else ground)

    from glazejax.geometry import resolve_instrument

    from .task import make_task

    console = progress.plain_console()
    stated = options.stated(quantity, unit, scale)
    notes: Sequence[str] = ()
    if lab is not None:
        targets = [_read_lab(lab, lights[0])]
    elif srgb is not None:
        targets = [srgb_target(srgb)]
    elif spectrum is None:
        targets = colourchecker_targets(options.split_names(patch))
    else:
        from glazejax.io import read_spectra

        table = read_spectra(spectrum, **stated)
        notes = table.notes
        targets = [
            spectral_target(table.wavelengths, table.reflectance[row], name=table.names[row])
            for row in options.choose_rows(spectrum, table.names, options.split_names(samples))
        ]
    shelf = options.read_shelf(pigments, catalogue)
    paints = options.choose_paints(shelf, only, without)
    paints = _modern(paints) if modern else paints
    if after is not None:
        from .command_after import say_addition

        if len(targets) > 1:
            raise ValueError(f"--after is for one target, and there are {len(targets)}")
        say_addition(
            targets[0],
            after,
            mixed,
            batch,
            samples="" if spectrum is not None else samples,
            stated=stated,
            shelf=shelf,
            paints=paints,
            ground=base,
            instrument=resolve_instrument(seen_by, refractive_index),
            eye=(lights[0], observer),
            console=console,
        )
        return
    paints = _cut_to_ground(paints, base)
    # Films of an instrument that has no table yet are solved: some seconds.
    with progress.follow("solving films"):
        task = make_task(
            targets,
            paints,
            ground=base.on(paints[0].wavelengths),
            instrument=seen_by,
            refractive_index=refractive_index,
            illuminants=lights,
            test_illuminant=test_illuminant,
            observer=observer,
            max_paints=max_paints,
            max_coats=max_coats,
            glazes=glazes,
            thickness=bounds,
            count=count,
            metamerism=metamerism,
            seed=seed,
        )
    for file, file_notes in ((spectrum, notes), ("--ground", base.notes)):
        progress.print_notes(console, str(file), file_notes)
    from .recipe import recipe_chunks

    groups, how = progress.collect(
        lambda report: recipe_chunks(task, progress=report),
        len(targets),
        "compiling, then looking through all sets of paints",
    )
    recipe_lists = [recipes for group in groups for recipes in group]
    seconds = time.perf_counter() - started
    if named:
        with progress.follow("writing"):
            _write(recipe_lists, task, outputs, overwrite)
    asked = {
        "--instrument": instrument or _GEOMETRY,
        "--ground": ground,
        "--refractive-index": None if refractive_index == 1.5 else refractive_index,
        "--illuminant": None if lights[0] == "D65" else lights[0],
        "--observer": None if str(observer) == "2" else observer,
        "--catalogue": catalogue,
        "--pigments": pigments,
    }
    view_options = shlex.join(
        word for name, value in asked.items() if value is not None for word in (name, str(value))
    )
    _print(recipe_lists, task, seconds, console, view_options)
    # Tints can be made of one's own paints alone.
    if pigments is not None and (
        remark := _say_unknown_strength(recipe_lists[0][0], task, observer)
    ):
        console.print(remark, style="yellow")
    if named:
        console.print(f"wrote {', '.join(str(outputs[name]) for name in named)}")
    if how.interrupted:
        progress.stop_interrupted(console, len(recipe_lists), len(targets), "targets")


def _say_unknown_strength(best: "Recipe", task: "RecipeTask", observer: str) -> str:
    """Say what it adds that paints of a recipe were read without tints; empty where none was."""
    shelf = {paint.name: paint for paint in task.pigments}
    unknown = [
        name
        for name in best.paints
        if (identifiable := shelf[name].identifiable) is not None and identifiable.mean() < 0.5
    ]
    if not unknown:
        return ""
    from ..recover.predict.mixture import predict_mixture
    from ..recover.predict.prediction import say_paint_errors

    thickest = max(
        (coat for coat in best.coats if any(name in unknown for _, name in coat.parts)),
        key=lambda coat: coat.thickness,
    )
    prediction = predict_mixture(
        shelf,
        {name: share for share, name in thickest.parts},
        [thickest.thickness],
        instrument=task.instrument,
    )
    return (
        f"The strength of {', '.join(unknown)} is unknown, which adds ΔE00 "
        f"{say_paint_errors(prediction, (task.illuminants[0], observer))}. One tint of each with a "
        "white measures it: glazejax recover --white ZincWhite."
    )


def _modern(paints: "list[Pigment]") -> "list[Pigment]":
    """Paints that are neither poisonous nor hard to buy.

    Raises:
        ValueError: there is none.
    """
    from glazejax import catalogue

    modern = [paint for paint in paints if not catalogue.caution(paint)]
    if not modern:
        cautions = "; ".join(f"{paint.name}: {catalogue.caution(paint)}" for paint in paints[:4])
        raise ValueError(
            f"--modern leaves no paint ({cautions}): name others, such as --catalogue acrylics"
        )
    return modern


def _cut_to_ground(paints: "list[Pigment]", ground: options.Ground) -> "list[Pigment]":
    """Paints at those bands of the first that all paints and the ground cover.

    Raises:
        ValueError: the ground covers too few for a colour; the message names its file.
    """
    if isinstance(ground.level, int | float):
        return paints
    from glazejax.colour import colour_weights
    from glazejax.spectra import common_range, lie_between

    grid = paints[0].wavelengths
    grid = grid[lie_between(grid, *common_range(paint.wavelengths for paint in paints))]
    shared = grid[lie_between(grid, *common_range([ground.level.wavelengths]))]
    if not shared.size:
        # Who does not meet whom is said where paints and ground are put on one grid.
        return paints
    if shared.size < grid.size:
        with ground.blame():
            colour_weights(shared)
    return [paint.resample(shared) for paint in paints]


def _read_lab(text: str, light: str) -> Target:
    try:
        lightness, a, b = map(float, text.split(","))
    except ValueError:
        raise ValueError(
            f"--lab is {text!r}: write three numbers with commas, such as 50,20,30"
        ) from None
    return lab_target({light: [lightness, a, b]})


def _write(
    recipe_lists: "list[list[Recipe]]",
    task: "RecipeTask",
    outputs: Mapping[str, Path | None],
    overwrite: bool,
) -> None:
    from .report import write_csv, write_json, write_targets

    if csv := outputs["--csv"]:
        write_csv(recipe_lists, csv, overwrite=overwrite)
    if json := outputs["--json"]:
        write_json(recipe_lists, json, overwrite=overwrite)
    if spectra := outputs["--spectra"]:
        write_targets(task.targets, task.wavelengths, spectra, overwrite=overwrite)
    if out := outputs["--out"]:
        _draw(recipe_lists, task, out)


def _draw(recipe_lists: "list[list[Recipe]]", task: "RecipeTask", out: Path) -> None:
    from glazejax.plots import save_picture

    from .plots import recipe_figure

    single = len(recipe_lists) == 1
    drawn = recipe_lists[0] if single else [recipes[0] for recipes in recipe_lists]
    titles = (
        [f"recipe {i}" for i in range(1, len(drawn) + 1)]
        if single
        else [r.target.name for r in drawn]
    )
    heading = (
        f"Recipes for {recipe_lists[0][0].target.name}"
        if single
        else "Recipes: target left, recipe right"
    )
    curves = "curves: grey the target, black the recipe; " if drawn[0].target.spectral else ""
    figure = recipe_figure(
        drawn,
        titles=titles,
        heading=heading,
        subtitle=f"{'target left, recipe right; ' if single else ''}{curves}coats top first; "
        f"{_describe_view(task)}",
    )
    save_picture(figure, out, dpi=100)


def _describe_view(task: "RecipeTask") -> str:
    eye = task.observer.replace(" Degree Standard Observer", "° observer")
    return f"{', '.join(task.illuminants)}, {eye}, {task.instrument.describe()}"


def _print(
    recipe_lists: "list[list[Recipe]]",
    task: "RecipeTask",
    seconds: float,
    console: "Console",
    view_options: str,
) -> None:
    from glazejax import catalogue

    from .report import print_best, print_recipes

    best = recipe_lists[0][0]
    tested = best.target.spectral and best.test_illuminant not in best.delta_e
    lead = f"In brackets ΔE00 under {best.test_illuminant}; per" if tested else "Per"
    if len(recipe_lists) == 1:
        print_recipes(recipe_lists[0], console, view_options)
    else:
        print_best(recipe_lists, console)
        reached = sum(recipes[0].in_gamut for recipes in recipe_lists)
        console.print(f"{reached} of {len(recipe_lists)} targets within a ΔE00 of 1")
    console.print(
        f"{lead} 10 %: ΔE00 when that coat alone is a tenth thicker or thinner. "
        f"{len(task.pigments)} paints, up to {task.max_paints} in {task.max_coats} "
        f"{'unmixed ' if task.glazes else ''}coats; {_describe_view(task)}.",
        style="dim",
    )
    for assumption in dict.fromkeys(filter(None, map(catalogue.assumed_scale, task.pigments))):
        console.print(
            f"{assumption[0].upper()}{assumption[1:]}; thicknesses here are on that scale.",
            style="dim",
        )
    console.print(
        f"{len(recipe_lists)} target{'s' if len(recipe_lists) > 1 else ''} in {seconds:.1f} s "
        "(less when run again)"
    )
