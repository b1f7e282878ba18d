"""The command `glazejax posterior`: one measured film in, what is known of it out."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

if TYPE_CHECKING:
    from rich.console import Console

    from glazejax import Pigment

    from ..film.films import Films, Instrument, Noise
    from ..film.reading import Reading
    from .posterior import Posterior

CHAIN, DATA, SUMMARY = "chain.h5", "posterior.nc", "summary.csv"
CORNER, BANDS = "corner.png", "bands.png"


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("posterior")(posterior)


def posterior(
    file: Annotated[
        Path | None,
        typer.Argument(
            help="Table of spectra: films in rows of four, NAME_b, NAME_w (bare black and white card), NAME_ob, "
            "NAME_ow (paint over them); or any spectra, with --ground.",
            show_default=False,
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Folder for the results; made if missing.", show_default=False)
    ] = None,
    sample: Annotated[str, typer.Option(help="Which film of FILE.", show_default=False)] = "",
    paints: Annotated[
        str,
        typer.Option(
            help="What the film is made of, such as CobaltBlue,ZincWhite. By default as mixtures.tsv beside FILE says.",
            show_default=False,
        ),
    ] = "",
    bands: Annotated[
        bool, typer.Option("--bands", help="Assume no paint: k d and s d of the film at every wavelength.")
    ] = False,
    pigments: Annotated[
        Path | None,
        typer.Option(
            help="Your own paints (pigments.csv of `glazejax recover`) instead of the catalogue's.", show_default=False
        ),
    ] = None,
    ground: Annotated[
        float | None,
        typer.Option(help="Internal reflectance of the ground below a single spectrum, 0 to 1.", show_default=False),
    ] = None,
    steps: Annotated[int, typer.Option(help="Of the whole chain; 0 for Laplace's standard errors alone.")] = 5000,
    walkers: Annotated[int, typer.Option(help="Of the ensemble; even.")] = 32,
    thin: Annotated[int, typer.Option(help="Every how many steps one is kept.")] = 5,
    seed: Annotated[int, typer.Option(help="Of all random numbers.")] = 0,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with the chain in the folder until it has --steps steps.")
    ] = False,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Start anew in a folder that is not empty.")] = False,
    model_error: Annotated[
        float, typer.Option(help="Expected relative error of the paints' k and s; its true size is sampled.")
    ] = 0.05,
    noise: Annotated[float, typer.Option(help="Standard deviation of a reading near black.")] = 0.0005,
    noise_share: Annotated[float, typer.Option(help="What is added to it for each unit of reflectance.")] = 0.002,
    incidence: Annotated[float, typer.Option(help="Angle at the sphere, degrees (8 for d:8 or 8:d).")] = 8.0,
    refractive_index: Annotated[float, typer.Option(help="Of the paint and of the cards' surface.")] = 1.5,
    specular: Annotated[
        bool, typer.Option("--specular/--no-specular", help="Whether the sphere includes the specular part.")
    ] = True,
    simulate: Annotated[
        bool, typer.Option("--simulate", help="Measure nothing: simulate a film of equal parts of --paints, 25 µm.")
    ] = False,
) -> None:
    """How well a film is known: posterior of its paints and thickness, or of k and s band by band.

    Prints medians and 90 % intervals by emcee beside Laplace's standard errors,
    and names what the measurement leaves open.

    Writes chain.h5, posterior.nc (for ArviZ), summary.csv, corner.png, bands.png.
    Ctrl-C keeps the chain; --resume goes on with it.

    Try it without data: glazejax posterior --simulate --paints CobaltBlue,ZincWhite --out demo
    """
    _check(file, out, sample, paints, bands, simulate, ground)
    assert out is not None
    _check_folder(out, resume, overwrite)

    from rich.console import Console

    from glazejax import Hemispherical
    from glazejax.commands.main import start_jax

    from ..film.films import Instrument, Noise

    start_jax()
    console = Console(highlight=False)
    instrument = Instrument(Hemispherical(incidence, specular), refractive_index)
    errors = Noise(noise, noise_share)
    task = (
        _simulated(_listed(paints), instrument, errors, seed, console)
        if simulate
        else _measured(file, sample, _listed(paints), bands, pigments, ground, errors, console)
    )
    options = {"steps": steps, "walkers": walkers, "thin": thin, "seed": seed, "resume": resume}
    result = _run(task, bands, model_error, instrument, errors, out, overwrite, options)
    _write(result, out, console)
    if result.chain is not None and result.chain.interrupted:
        console.print(
            f"[yellow]Interrupted: {result.chain.free.shape[0] * thin} of {steps} steps are kept in {out / CHAIN}. To "
            "go on, give the same command with --resume (and without --overwrite).[/yellow]"
        )
        raise typer.Exit(130)
    if result.chain is not None and not result.converged:
        console.print("To lengthen the chain, give the same command with --resume and more --steps.")


class _Task(NamedTuple):
    """One film, and what it is made of (nothing for --bands)."""

    film: "Films | Reading"
    paints: "list[Pigment]"


def _check(
    file: Path | None, out: Path | None, sample: str, paints: str, bands: bool, simulate: bool, ground: float | None
) -> None:
    if simulate and file is not None:
        raise ValueError(f"--simulate needs no data; leave out {file}, or leave out --simulate")
    if simulate and not paints:
        raise ValueError("--simulate needs paints to simulate: add --paints, such as --paints CobaltBlue,ZincWhite")
    if simulate and sample:
        raise ValueError(f"--simulate makes its own film; leave out --sample {sample}")
    if simulate and ground is not None:
        raise ValueError("--simulate has cards of its own; leave out --ground")
    if not simulate and file is None:
        raise ValueError("no FILE was given; name a table of spectra, such as films.tsv, or try --simulate")
    if not simulate and bands and paints:
        raise ValueError("--bands assumes no paint; leave out --paints, or leave out --bands")
    if ground is not None and not 0 <= ground <= 1:
        raise ValueError(f"--ground is {ground:g}; an internal reflectance lies between 0 and 1, such as 0.93")
    if out is None:
        raise ValueError("say where the results go: --out FOLDER")


def _check_folder(out: Path, resume: bool, overwrite: bool) -> None:
    if resume and overwrite:
        raise ValueError("--resume goes on with a chain and --overwrite throws it away; choose one")
    if out.exists() and not out.is_dir():
        raise FileExistsError(f"--out {out} is a file; name a folder")
    if resume and not (out / CHAIN).is_file():
        raise FileNotFoundError(f"{out / CHAIN}: there is no chain to resume; leave out --resume to start one")
    if out.is_dir() and any(out.iterdir()) and not (resume or overwrite):
        more = ", go on with its chain by --resume" if (out / CHAIN).is_file() else ""
        raise FileExistsError(f"the folder {out} exists and is not empty; choose another{more}, or add --overwrite")


def _listed(text: str) -> list[str]:
    return [name.strip() for name in text.split(",") if name.strip()]


def _simulated(names: list[str], instrument: "Instrument", noise: "Noise", seed: int, console: "Console") -> _Task:
    import numpy as np

    from ..film.simulate import simulate_films

    paints = _paints(names, None)
    k, s = (
        25e-6 * np.mean([np.asarray(getattr(p, what)) for p in paints], axis=0) for what in ("absorption", "scattering")
    )
    film = simulate_films(
        ["simulated"], paints[0].wavelengths, k[None], s[None], instrument=instrument, noise=noise, seed=seed
    )
    console.print(
        f"[bold]Simulated data:[/bold] equal parts of {', '.join(p.name for p in paints)}, 25 µm thick, with "
        f"made-up noise (seed {seed}). Nothing here was measured."
    )
    return _Task(film, paints)


def _measured(
    file: Path | None,
    sample: str,
    names: list[str],
    bands: bool,
    pigments: Path | None,
    ground: float | None,
    noise: "Noise",
    console: "Console",
) -> _Task:
    assert file is not None
    film = _film(file, sample, console) if ground is None else _spectrum(file, sample, ground, noise, console)
    if bands:
        return _Task(film, [])
    names = names or _recipe(file, sample)
    return _Task(film, _paints(names, pigments))


def _film(file: Path, sample: str, console: "Console") -> "Films":
    from ..film.readers import read_films

    films = read_films(file)
    for note in films.notes:
        console.print(f"[dim]{file}: {note}[/dim]")
    if not sample and len(films) != 1:
        known = ", ".join(films.names[:8]) + (f" and {len(films) - 8} more" if len(films) > 8 else "")
        raise ValueError(f"{file} holds {len(films)} films; choose one with --sample: {known}")
    return films.select([sample] if sample else films.names)


def _spectrum(file: Path, sample: str, ground: float, noise: "Noise", console: "Console") -> "Reading":
    from glazejax.io import read_spectra

    from ..film.films import nearest
    from ..film.reading import over_ground

    table = read_spectra(file)
    for note in table.notes:
        console.print(f"[dim]{file}: {note}[/dim]")
    names = list(table.names)
    if not sample and len(names) > 1:
        raise ValueError(f"{file} holds {len(names)} spectra; choose one with --sample")
    name = sample or names[0]
    if name not in names:
        raise ValueError(f"unknown sample {name!r}; {nearest(name, names)}")
    return over_ground(table.wavelengths, table.reflectance[names.index(name)], ground, noise=noise, name=name)


def _recipe(file: Path, sample: str) -> list[str]:
    from ..film.readers import NAMES_FILE, read_names

    beside = file.parent / NAMES_FILE
    found = read_names(beside).get(sample) if beside.is_file() else None
    if not found:
        where = f"and {beside} does not say" if beside.is_file() else f"and there is no {NAMES_FILE} beside it"
        raise ValueError(
            f"what is the film made of? Name its paints, such as --paints CobaltBlue,ZincWhite ({file.name} does not "
            f"say, {where}), or ask for --bands"
        )
    return list(found)


def _paints(names: list[str], pigments: Path | None) -> "list[Pigment]":
    from glazejax import catalogue
    from glazejax.paint.describe import find_name
    from glazejax.paint.pigment_table import read_pigments

    known = dict(catalogue.load()) if pigments is None else read_pigments(pigments)
    return [known[find_name(name, known)] for name in names]


def _run(
    task: _Task,
    bands: bool,
    model_error: float,
    instrument: "Instrument",
    noise: "Noise",
    out: Path,
    overwrite: bool,
    options: dict[str, Any],
) -> "Posterior":
    from rich.console import Console

    from .film import FilmPrior
    from .posterior import posterior_of_bands, posterior_of_film

    out.mkdir(parents=True, exist_ok=True)
    common = options | {"instrument": instrument, "noise": noise, "overwrite": overwrite, "progress": True}
    common["path"] = out / CHAIN
    Console(stderr=True).print("[dim]Finding the mode; the first run compiles for up to a minute.[/dim]")
    if bands:
        return posterior_of_bands(task.film, **common)
    return posterior_of_film(task.film, task.paints, prior=FilmPrior(error=model_error), **common)


def _write(result: "Posterior", out: Path, console: "Console") -> None:
    """Print and write everything but the chain, which is written already; these files are the command's own."""
    from .plots import plot_bands, plot_corner
    from .report import print_posterior, write_summary

    print_posterior(result, console)
    write_summary(result, out / SUMMARY, overwrite=True)
    # A notebook may have the old file open: put a new one in its place.
    fresh = out / f"{DATA}.part"
    result.inference_data.to_netcdf(str(fresh))
    fresh.replace(out / DATA)
    plot_corner(result, out / CORNER)
    plot_bands(result, out / BANDS)
    kept = [CHAIN] if result.chain is not None else []
    console.print(f"Wrote {', '.join([*kept, DATA, SUMMARY, CORNER, BANDS])} to {out}")
    if result.problem.kind == "paints":
        console.print("[dim]Thickness is on the scale of the paints; the catalogue's assume films of 25 µm.[/dim]")
