"""The command `glazejax recover`: films over black and white in, pigments out."""

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from glazejax.commands import options, progress
from glazejax.extras import require

if TYPE_CHECKING:
    from rich.console import Console

    from ..film.films import Films
    from .joint_result import JointRecovery
    from .result import Recovery

_GEOMETRY = "d:8"


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("recover")(recover)


def recover(
    file: Annotated[
        Path | None,
        typer.Argument(
            metavar="FILE",
            help="Table of spectra, four rows a film: NAME_b and NAME_w (bare black and white card), NAME_ob and "
            "NAME_ow (paint over them). CSV or TSV, percent or fractions.",
            show_default=False,
        ),
    ] = None,
    out: options.Folder = None,
    samples: options.Samples = "",
    masstones: Annotated[bool, typer.Option("--masstones", help="Only films of one paint (see --names).")] = False,
    names: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="What the samples are made of, a line each: 'SAMPLE<TAB>PaintA-PaintB|90-10'. Default: mixtures.tsv "
            "beside the table, if there is one.",
            show_default=False,
        ),
    ] = None,
    thickness: options.Thickness = "25um",
    noise: options.Noise = 0.0005,
    noise_share: options.NoiseShare = 0.002,
    geometry: Annotated[str | None, options.geometry_option(_GEOMETRY, sphere=True)] = None,
    refractive_index: options.RefractiveIndex = 1.5,
    simulate: Annotated[
        bool, typer.Option("--simulate", help="Try it without data: recover simulated films of the catalogue's paints.")
    ] = False,
    seed: options.Seed = 0,
    joint: Annotated[
        bool,
        typer.Option(
            "--joint",
            help="Fit all films together by their recipes (see --names): tints with white show what opaque films hide.",
        ),
    ] = False,
    law: Annotated[
        str,
        typer.Option(
            help="How paints mix, with --joint: mass (k and s add by weight) or strength (a paint may count for more, "
            "or less, than its weight)."
        ),
    ] = "mass",
    check: Annotated[
        bool,
        typer.Option("--check", help="With --joint: leave out each mixture in turn and predict it from the others."),
    ] = False,
    plots: Annotated[bool, typer.Option("--plots/--no-plots", help="Draw a picture for each paint.")] = True,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Write into a folder that is not empty.")] = False,
    incidence: options.OldIncidence = None,
    specular: options.OldSpecular = None,
) -> None:
    """Recover absorption k and scattering s of paints from films over a black and a white card.

    Every wavelength of every film is fitted on its own. With --joint all
    films of known recipes are fitted together, each with its own thickness.

    Writes pigments.csv (k and s in 1/m with standard deviations), a picture
    for each paint, and fits.csv (k/s and fitted spectra) or, with --joint,
    films.csv (thickness, gloss and fit of every film). --check adds
    left_out.csv and left_out.png: how well the fit predicts mixtures that
    it has not seen.

    k and s follow from the thickness: films twice as thick have half the
    k and s.

    Try it without data: glazejax recover --simulate --out demo
    """
    _check(file, simulate)
    _check_joint(joint, law, check, simulate, masstones)
    if plots:
        require("matplotlib")
    folder = options.check_folder(out, overwrite)
    metres = options.read_length(thickness)
    seen_by = options.read_geometry(geometry, _GEOMETRY, incidence=incidence, specular=specular)

    from rich.console import Console

    from glazejax.commands.main import start_jax

    from ..film.films import Instrument, Noise

    start_jax()
    console = Console()
    instrument = Instrument(seen_by, refractive_index)
    instrument.require_sphere()
    given = {"instrument": instrument, "noise": Noise(noise, noise_share)}
    results = _Results(folder, metres, plots, overwrite, console)
    if joint:
        assert file is not None
        _recover_jointly(file, samples, names, given, law, check, results)
        return
    if simulate:
        films = _simulated(samples, metres, given, seed, console)
    else:
        assert file is not None
        films = _measured(file, samples, masstones, names, console)

    from .film_by_film import recover_chunks
    from .result import Recovery

    chunks = recover_chunks(films, **given)
    parts, how = progress.collect(chunks, len(films), "compiling, then recovering", "recovering")
    recovery = Recovery.join(parts)
    _report(recovery, how, results)
    if simulate:
        _compare(recovery, metres, console)
    if how.interrupted:
        progress.stop_interrupted(console, len(recovery), len(films), "films")


class _Results(NamedTuple):
    """Where results go: the folder, the films' thickness in m, whether pictures are drawn, and the screen."""

    out: Path
    thickness: float
    plots: bool
    overwrite: bool
    console: "Console"


def _check(file: Path | None, simulate: bool) -> None:
    if simulate and file is not None:
        raise ValueError(f"--simulate needs no data; leave out {file}, or leave out --simulate")
    if file is None and not simulate:
        raise ValueError("no FILE was given; name a table of spectra, or try: glazejax recover --simulate --out demo")


def _check_joint(joint: bool, law: str, check: bool, simulate: bool, masstones: bool) -> None:
    for option, given in (("--simulate", simulate), ("--masstones", masstones)):
        if joint and given:
            raise ValueError(f"--joint fits measured mixtures; leave out {option}, or leave out --joint")
    if law not in ("mass", "strength"):
        raise ValueError(f"--law is {law!r}; it must be mass or strength")
    if law != "mass" and not joint:
        raise ValueError("--law says how paints mix in a joint fit; add --joint")
    if check and not joint:
        raise ValueError("--check leaves mixtures out of a joint fit; add --joint")


def _recover_jointly(
    file: Path, samples: str, names: Path | None, given: "dict[str, Any]", law: str, check: bool, results: _Results
) -> None:
    from glazejax.paint.describe import format_length

    from ..film.mixing import MixingLaw
    from ..film.readers import NAMES_FILE, read_names
    from .joint import recover_jointly
    from .report import (
        print_joint,
        write_joint_films,
        write_joint_pigments,
        write_joint_plots,
    )

    out, metres, plots, overwrite, console = results
    films = _films(file, samples, console)
    beside = names or file.parent / NAMES_FILE
    if not beside.is_file():
        raise ValueError(f"--joint needs to know what the films are made of: add --names FILE, or {beside}")
    with console.status("compiling, then fitting all films together"):
        began = time.perf_counter()
        recipes = read_names(beside)
        given = given | {"law": MixingLaw(law)}
        recovery = recover_jointly(films, recipes, **given)
        seconds = time.perf_counter() - began
    out.mkdir(parents=True, exist_ok=True)
    write_joint_pigments(recovery, metres, out / "pigments.csv", overwrite=overwrite)
    write_joint_films(recovery, out / "films.csv", overwrite=overwrite)
    print_joint(recovery, console, seconds)
    if check:
        _leave_out(recovery, films, recipes, given, results)
    console.print(
        f"[bold]Thickness: a typical film is taken as {format_length(metres)}, not measured.[/bold] Thicknesses in "
        "films.csv are in units of that."
    )
    if plots:
        write_joint_plots(recovery, metres, out, progress.drawing(len(recovery.paints)))
    pictures = f", films.csv and {len(recovery.paints)} pictures" if plots else " and films.csv"
    console.print(f"Wrote pigments.csv{pictures} to {out}")


def _leave_out(
    recovery: "JointRecovery",
    films: "Films",
    recipes: dict[str, dict[str, float]],
    given: dict[str, Any],
    results: _Results,
) -> None:
    from .crossvalidation import leave_films_out
    from .plots import plot_left_out
    from .report import print_left_out, write_left_out

    out, _, plots, overwrite, console = results
    with console.status("leaving films out") as status:
        left = leave_films_out(
            recovery, films, recipes, progress=lambda name: status.update(f"leaving out {name}"), **given
        )
    print_left_out(left, console)
    write_left_out(recovery, left, out / "left_out.csv", overwrite=overwrite)
    if plots:
        plot_left_out(recovery, left, out / "left_out.png")


def _films(file: Path, samples: str, console: "Console") -> "Films":
    """The films of a file, or those of --samples."""
    from ..film.readers import read_films

    films = read_films(file)
    if wanted := options.listed(samples):
        films = films.select(wanted)
    progress.print_notes(console, file, films.notes)
    return films


def _measured(file: Path, samples: str, masstones: bool, names: Path | None, console: "Console") -> "Films":
    from dataclasses import replace

    from ..film.readers import NAMES_FILE, is_masstone, read_names, readable_names

    films = _films(file, samples, console)
    beside = file.parent / NAMES_FILE
    recipes = read_names(names or beside) if names is not None or beside.is_file() else {}
    if masstones:
        if not recipes:
            raise ValueError(f"--masstones needs to know what the films are made of: add --names, or {beside}")
        pure = [name for name in films.names if is_masstone(recipes.get(name, {}))]
        if not pure:
            raise ValueError(f"--masstones: none of the {len(films)} films is listed as a single paint")
        films = films.select(pure)
    return replace(films, names=readable_names(films.names, recipes))


def _simulated(samples: str, thickness: float, given: "dict[str, Any]", seed: int, console: "Console") -> "Films":
    from glazejax import catalogue
    from glazejax.paint.describe import format_length

    from ..film.simulate import simulate_paints

    known = catalogue.load()
    paints = [catalogue.pigment(name) for name in options.listed(samples)] or list(known.values())
    console.print(
        f"[bold]Simulated data:[/bold] spectra of {len(paints)} catalogue paints, {format_length(thickness)} thick, "
        f"with made-up noise (seed {seed}). Nothing here was measured."
    )
    return simulate_paints(paints, thickness, seed=seed, **given)


def _report(recovery: "Recovery", how: progress.Collected, results: _Results) -> None:
    from glazejax.paint.describe import format_length

    from .report import print_summary, write_fits, write_pigments, write_plots

    out, metres, plots, overwrite, console = results
    out.mkdir(parents=True, exist_ok=True)
    write_pigments(recovery, metres, out / "pigments.csv", overwrite=overwrite)
    write_fits(recovery, out / "fits.csv", overwrite=overwrite)
    print_summary(recovery, console, how.seconds, how.first)
    console.print(
        f"[bold]Thickness: {format_length(metres)} is assumed, not measured.[/bold] Only k d and s d are known: a film "
        "of twice that has half the k and s."
    )
    if plots:
        write_plots(recovery, metres, out, progress.drawing(len(recovery)))
    pictures = f", fits.csv and {len(recovery)} pictures" if plots else " and fits.csv"
    console.print(f"Wrote pigments.csv{pictures} to {out}")


def _compare(recovery: "Recovery", thickness: float, console: "Console") -> None:
    """Say how often the simulated truth lies in the error bands."""
    import numpy as np

    from glazejax import catalogue

    known = catalogue.load()
    truth = np.stack(
        [
            np.stack([known[name].absorption, known[name].scattering], axis=-1) * thickness
            for name in recovery.films.names
        ]
    )
    lower, upper = recovery.interval()
    inside = (truth >= lower) & (truth <= upper)
    bands = recovery.identifiable
    if bands.any():
        k, s = inside[bands].mean(axis=0)
        console.print(
            f"The true k lies in its 95 % band in {k:.1%} and the true s in {s:.1%} of the {bands.sum()} bands where "
            "both are known."
        )
