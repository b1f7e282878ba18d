"""The command `glazejax recipe`: a colour or a spectrum in, glazes out."""

import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from rich.console import Console

    from glazejax import Pigment
    from glazejax.geometry import Geometry

    from .recipe import Recipe
    from .targets import Target
    from .task import Task


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("recipe")(recipe)


def recipe(
    lab: Annotated[str | None, typer.Option(help="Colour L*,a*,b*, such as 50,20,30.", show_default=False)] = None,
    srgb: Annotated[str | None, typer.Option(help="Colour of a screen, such as '#8a4b2d'.", show_default=False)] = None,
    spectrum: Annotated[
        Path | None, typer.Option(help="File of reflectance spectra; see --samples.", show_default=False)
    ] = None,
    samples: Annotated[str, typer.Option(help="Only these spectra of the file.", show_default=False)] = "",
    colourchecker: Annotated[
        bool, typer.Option("--colourchecker", help="The 24 measured patches of a ColorChecker chart.")
    ] = False,
    patch: Annotated[
        str, typer.Option(help="Only these patches, such as 'blue sky,dark skin'.", show_default=False)
    ] = "",
    illuminants: Annotated[
        str, typer.Option(help="Match under all of these: D65,A,FL11. Default: D65; --lab is under the first.")
    ] = "D65",
    test_illuminant: Annotated[str, typer.Option(help="Light for the test of metamerism.")] = "A",
    observer: Annotated[str, typer.Option(help="Standard observer: 2 or 10 (degrees).")] = "2",
    max_paints: Annotated[int, typer.Option(help="Most paints in a recipe, 1 to 6.")] = 3,
    max_layers: Annotated[int, typer.Option(help="Most coats, 1 to 4.")] = 2,
    thickness: Annotated[str, typer.Option(help="Thinnest and thickest coat, micrometres.")] = "1-50",
    only: Annotated[
        str, typer.Option(help="Only these paints, such as ZincWhite,CobaltBlue.", show_default=False)
    ] = "",
    without: Annotated[str, typer.Option(help="All but these paints.", show_default=False)] = "",
    pigments: Annotated[
        Path | None,
        typer.Option(help="Your own paints: a pigments.csv as `glazejax recover` writes it.", show_default=False),
    ] = None,
    ground: Annotated[float, typer.Option(help="Reflectance of the ground, seen from inside the paint.")] = 0.9,
    refractive_index: Annotated[float, typer.Option(help="Of every coat, 1 to 2.5.")] = 1.5,
    sphere: Annotated[
        bool, typer.Option("--sphere", help="Seen by an integrating sphere, d:8 with the mirror reflection, not 45:0.")
    ] = False,
    metamerism: Annotated[
        float, typer.Option(help="Delta E that a spectrum off by 0.01 (root mean square) weighs.")
    ] = 0.2,
    count: Annotated[int, typer.Option(help="Most recipes for a target.")] = 5,
    seed: Annotated[int, typer.Option(help="Of the mixtures that are tried first.")] = 0,
    out: Annotated[Path, typer.Option(help="Picture to write: .png, .pdf, .svg or .jpg.")] = Path("recipes.png"),
    csv: Annotated[Path | None, typer.Option(help="Also write all recipes to this table.", show_default=False)] = None,
    json: Annotated[
        Path | None, typer.Option(help="Also write all recipes, with spectra, to this file.", show_default=False)
    ] = None,
    spectra: Annotated[
        Path | None,
        typer.Option(help="Also write the targets' spectra, at the paints' bands.", show_default=False),
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace files that exist.")] = False,
) -> None:
    """Recipes for a colour: which paints, in which order and how thick.

    All sets of up to three paints in one coat or two are tried; the best few that differ are printed with their colour
    difference, what 10 % of each coat's thickness changes, and how far a colour is out of reach.

    Example: glazejax recipe --srgb '#8a4b2d' --max-layers 1

    For many colours at once: glazejax recipe --colourchecker
    """
    started = time.perf_counter()
    others = {"--csv": csv, "--json": json, "--spectra": spectra}
    _check_outputs(out, others, overwrite)
    lights = _listed(illuminants)
    bounds = _bounds(thickness)
    # The colours of spectra are computed in double precision too.
    from glazejax.commands.main import start_jax

    start_jax()
    from rich.console import Console

    targets, notes = _targets(lab, srgb, spectrum, samples, colourchecker or bool(patch), patch, lights)
    from glazejax import Bidirectional, Hemispherical

    from .task import make_task

    if spectra is not None and not all(target.spectral for target in targets):
        raise ValueError("--spectra: the target is a colour and has no spectrum; leave it out")
    geometry: Geometry = Hemispherical(8) if sphere else Bidirectional(45, 0)
    task = make_task(
        targets,
        _shelf(pigments, only, without),
        ground=ground,
        geometry=geometry,
        refractive_index=refractive_index,
        illuminants=lights,
        test_illuminant=test_illuminant,
        observer=observer,
        max_paints=max_paints,
        max_layers=max_layers,
        thickness=bounds,
        count=count,
        metamerism=metamerism,
        simplicity=0.3,
        seed=seed,
    )
    console = Console(highlight=False)
    for note in notes:
        console.print(f"[dim]{note}[/dim]")
    found, interrupted = _search(task)
    seconds = time.perf_counter() - started
    _write(found, task, out, others, overwrite)
    _print(found, task, seconds, console)
    files = ", ".join(str(path) for path in (out, *others.values()) if path is not None)
    console.print(f"wrote {files}", markup=False)
    if interrupted:
        console.print(
            f"[yellow]Interrupted: {len(found)} of {len(targets)} targets were finished and written.[/yellow]"
        )
        raise typer.Exit(130)


def _listed(text: str) -> list[str]:
    return [name.strip() for name in text.split(",") if name.strip()]


def _check_outputs(out: Path, others: Mapping[str, Path | None], overwrite: bool) -> None:
    from glazejax.io.outputs import check_output
    from glazejax.plots import check_picture

    check_picture(out, overwrite=overwrite)
    taken = {out.resolve(): "--out"}
    for option, path in others.items():
        if path is None:
            continue
        check_output(path, overwrite=overwrite, argument=option)
        if path.resolve() in taken:
            raise ValueError(f"{taken[path.resolve()]} and {option} are the same file: give them different names")
        taken[path.resolve()] = option


def _bounds(text: str) -> tuple[float, float]:
    """Thinnest and thickest coat in m."""
    low, dash, high = text.strip().lower().removesuffix("um").removesuffix("µm").partition("-")
    try:
        return float(low.removesuffix("um").removesuffix("µm")) * 1e-6, float(high if dash else low) * 1e-6
    except ValueError:
        raise ValueError(f"--thickness is {text!r}: write two numbers of micrometres, such as 1-50") from None


def _targets(
    lab: str | None,
    srgb: str | None,
    spectrum: Path | None,
    samples: str,
    chart: bool,
    patch: str,
    lights: Sequence[str],
) -> "tuple[list[Target], list[str]]":
    """What is to be matched, and notes of the file's reader."""
    from .targets import colourchecker_targets, lab_target, spectral_target, srgb_target

    if (lab is not None) + (srgb is not None) + (spectrum is not None) + chart != 1:
        raise ValueError(
            "give one target: --lab 50,20,30, --srgb '#8a4b2d', --spectrum FILE, or --colourchecker (see --help)"
        )
    if samples and spectrum is None:
        raise ValueError("--samples names spectra of a file: add --spectrum FILE")
    if lab is not None:
        try:
            values = [float(value) for value in lab.split(",")]
        except ValueError:
            raise ValueError(f"--lab is {lab!r}: write three numbers with commas, such as 50,20,30") from None
        if not lights:
            raise ValueError("--illuminants is empty: name at least one, such as D65")
        return [lab_target({lights[0]: values})], []
    if srgb is not None:
        return [srgb_target(srgb)], []
    if chart:
        return colourchecker_targets(_listed(patch)), []
    from glazejax.io import read_spectra

    assert spectrum is not None
    table = read_spectra(spectrum)
    names = _listed(samples) or list(table.names)
    for name in names:
        if name not in table.names:
            some = ", ".join(table.names[:6])
            raise ValueError(f"{spectrum} holds no spectrum {name!r}; there are {len(table.names)}: {some}")
    targets = [spectral_target(name, table.wavelengths, table[name]) for name in names]
    return targets, [f"{spectrum}: {note}" for note in table.notes]


def _shelf(path: Path | None, only: str, without: str) -> "list[Pigment]":
    """The paints that may be used."""
    from glazejax import catalogue
    from glazejax.paint.describe import find_name
    from glazejax.paint.pigment_table import read_pigments

    shelf = catalogue.load() if path is None else read_pigments(path)
    chosen = [find_name(name, shelf) for name in _listed(only)] or list(shelf)
    left_out = {find_name(name, shelf) for name in _listed(without)}
    kept = [shelf[name] for name in dict.fromkeys(chosen) if name not in left_out]
    if not kept:
        raise ValueError("--only and --without leave no paint: name fewer in --without")
    return kept


def _search(task: "Task") -> "tuple[list[list[Recipe]], bool]":
    """Search with a progress bar; an interrupt keeps what is finished."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    from .recipe import recipe_chunks

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    found: list[list[Recipe]] = []
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        bar = progress.add_task("looking through all sets of paints", total=len(task.targets))
        try:
            for group in recipe_chunks(task):
                found += group
                progress.update(bar, completed=len(found), description="recipes")
        except KeyboardInterrupt:
            if not found:
                raise
            return found, True
    return found, False


def _write(
    found: "list[list[Recipe]]", task: "Task", out: Path, others: Mapping[str, Path | None], overwrite: bool
) -> None:
    from .plots import recipe_figure
    from .report import write_csv, write_json, write_targets

    if csv := others["--csv"]:
        write_csv(found, csv, overwrite=overwrite)
    if json := others["--json"]:
        write_json(found, json)
    if spectra := others["--spectra"]:
        write_targets(task.targets, task.wavelengths, spectra, overwrite=overwrite)
    one = len(found) == 1
    shown = found[0] if one else [recipes[0] for recipes in found]
    titles = [f"recipe {i}" for i in range(1, len(shown) + 1)] if one else [r.target.name for r in shown]
    heading = f"Recipes for {found[0][0].target.name}" if one else "Recipes: target left, recipe right"
    curves = "curves: grey the target, black the recipe; " if shown[0].target.spectral else ""
    figure = recipe_figure(
        shown,
        titles=titles,
        heading=heading,
        subtitle=f"{'target left, recipe right; ' if one else ''}{curves}coats top first; {_seen(task)}",
    )
    figure.savefig(out, dpi=100)


def _seen(task: "Task") -> str:
    from glazejax import Hemispherical

    sphere = isinstance(task.geometry, Hemispherical)
    how = "sphere d:8, mirror reflection included" if sphere else "light at 45°, view at 0°"
    eye = task.observer.replace(" Degree Standard Observer", "° observer")
    return f"{', '.join(task.illuminants)}, {eye}, {how}"


def _print(found: "list[list[Recipe]]", task: "Task", seconds: float, console: "Console") -> None:
    from glazejax import catalogue

    from .report import print_best, print_recipes

    best = found[0][0]
    test = f"in brackets ΔE00 under {best.test_illuminant}; " if best.target.spectral else ""
    legend = f"{test}per 10 %: ΔE00 when that coat alone is a tenth thicker or thinner"
    legend = legend[0].upper() + legend[1:]
    if len(found) == 1:
        print_recipes(found[0], console)
    else:
        print_best(found, console)
        reached = sum(recipes[0].in_gamut for recipes in found)
        console.print(f"{reached} of {len(found)} targets within a ΔE00 of 1")
    console.print(
        f"[dim]{legend}. {len(task.pigments)} paints, up to {task.max_paints} in {task.max_layers} coats; "
        f"{_seen(task)}.[/dim]"
    )
    if any(p.provenance == catalogue.PROVENANCE for p in task.pigments):
        console.print(
            "[dim]The catalogue's films had no measured thickness: thicknesses are on its scale "
            f"({catalogue.ASSUMED_THICKNESS * 1e6:g} µm a film).[/dim]"
        )
    console.print(f"{len(found)} target{'s' if len(found) > 1 else ''} in {seconds:.1f} s (less when run again)")
