"""The command `glazejax recover`: films over black and white in, pigments out."""

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from rich.console import Console

    from ..film.films import Films, Instrument, Noise
    from .joint_result import JointRecovery
    from .result import Recovery


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("recover")(recover)


def recover(
    file: Annotated[
        Path | None,
        typer.Argument(
            help="Table of spectra, four a film: NAME_b and NAME_w (bare black and white card), NAME_ob and "
            "NAME_ow (paint over them). CSV or TSV, percent or fraction.",
            show_default=False,
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Folder for the results; made if missing.", show_default=False)
    ] = None,
    samples: Annotated[str, typer.Option(help="Only these samples, such as 07A,11A.", show_default=False)] = "",
    masstones: Annotated[bool, typer.Option("--masstones", help="Only films of one paint (see --names).")] = False,
    names: Annotated[
        Path | None,
        typer.Option(
            help="What the samples are made of, 'SAMPLE<TAB>PaintA-PaintB|90-10' a line. "
            "By default mixtures.tsv beside FILE, if there is one.",
            show_default=False,
        ),
    ] = None,
    thickness: Annotated[
        float, typer.Option(help="Assumed thickness of the films, micrometres. k and s are in inverse proportion.")
    ] = 25.0,
    noise: Annotated[float, typer.Option(help="Standard deviation of a reading near black.")] = 0.0005,
    noise_share: Annotated[float, typer.Option(help="What is added to it for each unit of reflectance.")] = 0.002,
    incidence: Annotated[float, typer.Option(help="Angle at the sphere, degrees (8 for d:8 or 8:d).")] = 8.0,
    refractive_index: Annotated[float, typer.Option(help="Of the paint and of the cards' surface.")] = 1.5,
    specular: Annotated[
        bool, typer.Option("--specular/--no-specular", help="Whether the sphere includes the specular part.")
    ] = True,
    simulate: Annotated[
        bool, typer.Option("--simulate", help="Measure nothing: recover films simulated from the catalogue's paints.")
    ] = False,
    seed: Annotated[int, typer.Option(help="Of the noise of --simulate.")] = 0,
    joint: Annotated[
        bool,
        typer.Option("--joint", help="Fit all films together by their recipes: tints tell what opaque films hide."),
    ] = False,
    law: Annotated[
        str, typer.Option(help="How paints mix, with --joint: mass (linear), or strength (one number a paint).")
    ] = "mass",
    check: Annotated[
        bool,
        typer.Option("--check", help="With --joint: leave every mixture out in turn and predict it from the others."),
    ] = False,
    plots: Annotated[bool, typer.Option("--plots/--no-plots", help="Draw one picture a paint.")] = True,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Write into a folder that is not empty.")] = False,
) -> None:
    """Recover absorption k and scattering s of paints from films over a black and a white card.

    Every wavelength of every film is fitted on its own, in the geometry of an integrating sphere; with --joint all
    films of known recipes are fitted together, each with a thickness of its own.

    Writes pigments.csv (k and s in 1/m with standard deviations), a picture a paint, and fits.csv (k/s and fitted
    spectra) or, with --joint, films.csv (thickness, gloss and fit of every film). With --check it says
    how well mixtures are predicted that the fit has not seen: left_out.csv and left_out.png.

    Try it without data: glazejax recover --simulate --out demo
    """
    _check(file, out, thickness, simulate)
    _check_joint(joint, law, check, simulate, masstones)
    assert out is not None
    _check_folder(out, overwrite)

    from rich.console import Console

    from glazejax import Hemispherical
    from glazejax.commands.main import start_jax

    from ..film.films import Instrument, Noise

    start_jax()
    console = Console()
    instrument = Instrument(Hemispherical(incidence, specular), refractive_index)
    errors = Noise(noise, noise_share)
    if joint:
        assert file is not None
        _recover_jointly(
            file, samples, names, instrument, errors, law, check, thickness, out, plots, overwrite, console
        )
        return
    if simulate:
        films = _simulated(samples, thickness, instrument, errors, seed, console)
    else:
        assert file is not None
        films = _measured(file, samples, masstones, names, console)

    began = time.perf_counter()
    recovery, first, interrupted = _run(films, instrument, errors)
    seconds = time.perf_counter() - began
    _report(recovery, films, thickness, (seconds, first), out, plots, overwrite, console)
    if simulate:
        _compare(recovery, thickness, console)
    if interrupted:
        console.print(f"[yellow]Interrupted: {len(recovery)} of {len(films)} films were finished and written.[/yellow]")
        raise typer.Exit(130)


def _check(file: Path | None, out: Path | None, thickness: float, simulate: bool) -> None:
    if simulate and file is not None:
        raise ValueError(f"--simulate needs no data; leave out {file}, or leave out --simulate")
    if file is None and not simulate:
        raise ValueError("no FILE was given; name a table of spectra, or try: glazejax recover --simulate --out demo")
    if out is None:
        raise ValueError("say where the results go: --out FOLDER")
    if not 0 < thickness <= 10_000:
        raise ValueError(f"--thickness is {thickness:g}; it must be above 0 and at most 10000 micrometres, such as 25")


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
    file: Path,
    samples: str,
    names: Path | None,
    instrument: "Instrument",
    noise: "Noise",
    law: str,
    check: bool,
    thickness: float,
    out: Path,
    plots: bool,
    overwrite: bool,
    console: "Console",
) -> None:
    from rich.console import Console
    from rich.progress import track

    from ..film.mixing import MixingLaw
    from ..film.readers import NAMES_FILE, read_films, read_names
    from .joint import recover_jointly
    from .joint_report import (
        print_joint,
        write_joint_films,
        write_joint_pigments,
        write_joint_plots,
    )

    films = read_films(file)
    if wanted := _listed(samples):
        films = films.select(wanted)
    beside = names or file.parent / NAMES_FILE
    if not beside.is_file():
        raise ValueError(f"--joint needs to know what the films are made of: add --names FILE, or {beside}")
    for note in films.notes:
        console.print(f"[dim]{file}: {note}[/dim]")
    with console.status("compiling, then fitting all films together"):
        began = time.perf_counter()
        recipes = read_names(beside)
        given = {"instrument": instrument, "noise": noise, "law": MixingLaw(law)}
        recovery = recover_jointly(films, recipes, **given)
        seconds = time.perf_counter() - began
    metres = thickness * 1e-6
    out.mkdir(parents=True, exist_ok=True)
    write_joint_pigments(recovery, metres, out / "pigments.csv", overwrite=overwrite)
    write_joint_films(recovery, out / "films.csv", overwrite=overwrite)
    print_joint(recovery, console, seconds)
    if check:
        _leave_out(recovery, films, recipes, given, out, plots, overwrite, console)
    console.print(
        f"[bold]Thickness: a typical film is taken as {thickness:g} µm, not measured.[/bold] Thicknesses in films.csv "
        "are in units of that."
    )
    if plots:
        steps = iter(track(range(len(recovery.paints)), "drawing", console=Console(stderr=True), transient=True))
        next(steps, None)
        write_joint_plots(recovery, metres, out, lambda: next(steps, None))
    pictures = f", films.csv and {len(recovery.paints)} pictures" if plots else " and films.csv"
    console.print(f"Wrote pigments.csv{pictures} to {out}")


def _leave_out(
    recovery: "JointRecovery",
    films: "Films",
    recipes: dict[str, dict[str, float]],
    given: dict[str, Any],
    out: Path,
    plots: bool,
    overwrite: bool,
    console: "Console",
) -> None:
    from .crossvalidation import leave_films_out
    from .joint_plots import plot_left_out
    from .joint_report import print_left_out, write_left_out

    with console.status("leaving films out") as status:
        left = leave_films_out(
            recovery, films, recipes, progress=lambda name: status.update(f"leaving out {name}"), **given
        )
    print_left_out(left, console)
    write_left_out(recovery, left, out / "left_out.csv", overwrite=overwrite)
    if plots:
        plot_left_out(recovery, left, out / "left_out.png")


def _check_folder(out: Path, overwrite: bool) -> None:
    if out.exists() and not out.is_dir():
        raise FileExistsError(f"--out {out} is a file; name a folder")
    if out.is_dir() and any(out.iterdir()) and not overwrite:
        raise FileExistsError(f"the folder {out} exists and is not empty; choose another, or add --overwrite")


def _measured(file: Path, samples: str, masstones: bool, names: Path | None, console: "Console") -> "Films":
    from dataclasses import replace

    from ..film.readers import NAMES_FILE, is_masstone, read_films, read_names, readable_names

    films = read_films(file)
    beside = file.parent / NAMES_FILE
    recipes = read_names(names or beside) if names is not None or beside.is_file() else {}
    wanted = _listed(samples)
    if wanted:
        films = films.select(wanted)
    if masstones:
        if not recipes:
            raise ValueError(f"--masstones needs to know what the films are made of: add --names, or {beside}")
        pure = [name for name in films.names if is_masstone(recipes.get(name, {}))]
        if not pure:
            raise ValueError(f"--masstones: none of the {len(films)} films is listed as a single paint")
        films = films.select(pure)
    for note in films.notes:
        console.print(f"[dim]{file}: {note}[/dim]")
    return replace(films, names=readable_names(films.names, recipes))


def _simulated(
    samples: str, thickness: float, instrument: "Instrument", noise: "Noise", seed: int, console: "Console"
) -> "Films":
    from glazejax import catalogue

    from ..film.simulate import simulate_paints

    known = catalogue.load()
    paints = [catalogue.pigment(name) for name in _listed(samples)] or list(known.values())
    console.print(
        f"[bold]Simulated data:[/bold] spectra of {len(paints)} catalogue paints, {thickness:g} µm thick, with "
        f"made-up noise (seed {seed}). Nothing here was measured."
    )
    return simulate_paints(paints, thickness * 1e-6, instrument=instrument, noise=noise, seed=seed)


def _listed(text: str) -> list[str]:
    return [name.strip() for name in text.split(",") if name.strip()]


def _run(films: "Films", instrument: "Instrument", noise: "Noise") -> tuple["Recovery", float, bool]:
    """Recover with a progress bar; an interrupt keeps what is finished.

    Returns:
        What was recovered, the seconds until the first chunk was done, and whether there was an interrupt.
    """
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    from .film_by_film import recover_chunks
    from .result import Recovery

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    parts: list[Recovery] = []
    interrupted, began, first = False, time.perf_counter(), 0.0
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task("compiling, then recovering", total=len(films))
        try:
            for part in recover_chunks(films, instrument=instrument, noise=noise):
                parts.append(part)
                first = first or time.perf_counter() - began
                progress.update(task, advance=len(part), description="recovering")
        except KeyboardInterrupt:
            if not parts:
                raise
            interrupted = True
    return Recovery.join(parts), first, interrupted


def _report(
    recovery: "Recovery",
    films: "Films",
    thickness: float,
    seconds: tuple[float, float],
    out: Path,
    plots: bool,
    overwrite: bool,
    console: "Console",
) -> None:
    from rich.console import Console
    from rich.progress import track

    from .report import print_summary, write_fits, write_pigments, write_plots

    metres = thickness * 1e-6
    out.mkdir(parents=True, exist_ok=True)
    write_pigments(recovery, metres, out / "pigments.csv", overwrite=overwrite)
    write_fits(recovery, out / "fits.csv", overwrite=overwrite)
    print_summary(recovery, console, *seconds)
    console.print(
        f"[bold]Thickness: {thickness:g} µm is assumed, not measured.[/bold] Only k d and s d are known: a film of "
        "twice that has half the k and s."
    )
    if plots:
        steps = iter(track(range(len(recovery)), "drawing", console=Console(stderr=True), transient=True))
        next(steps, None)
        write_plots(recovery, metres, out, lambda: next(steps, None))
    pictures = f", fits.csv and {len(recovery)} pictures" if plots else " and fits.csv"
    console.print(f"Wrote pigments.csv{pictures} to {out}")


def _compare(recovery: "Recovery", thickness: float, console: "Console") -> None:
    """Say how often the simulated truth lies in the error bands."""
    import numpy as np

    from glazejax import catalogue

    known = catalogue.load()
    truth = np.stack(
        [
            np.stack([known[name].absorption, known[name].scattering], axis=-1) * thickness * 1e-6
            for name in recovery.films.names
        ]
    )
    lower, upper = recovery.interval()
    inside = (truth >= lower) & (truth <= upper)
    bands = recovery.identifiable
    if bands.any():
        k, s = inside[bands].mean(axis=0)
        console.print(
            f"The true k lies in its 95 % band at {k:.1%} and the true s at {s:.1%} of the {bands.sum()} values told "
            "apart."
        )
