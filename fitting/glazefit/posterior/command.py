"""The command `glazejax posterior`: from one measured film to its posterior."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from glazejax.commands import options, progress
from glazejax.commands.command_line import changed, ground_file
from glazejax.commands.help_groups import help_groups
from glazejax.extras import require

if TYPE_CHECKING:
    from rich.console import Console

    from glazejax.geometry import Geometry
    from glazejax.io.quantity import Stated
    from glazejax.io.spectra_table import SpectraTable

    from ..film.films import Films, Instrument, Noise, Reading
    from .coats import CoatPrior
    from .posterior import Posterior

_GEOMETRY = "d:8"

CHAIN = "chain.h5"
DATA = "posterior.nc"
SUMMARY = "summary.csv"
CORNER = "corner.png"
BANDS = "bands.png"


@help_groups(
    usual="--paints --coats --ground --out --steps",
    given="--sample --quantity --unit --scale --pigments --catalogue --instrument --thickness "
    "--paint-error",
    tried="--bands --sampler --simulate",
    written="--resume --overwrite",
    fine="--walkers --thin --noise --noise-share --refractive-index --seed",
)
def posterior(
    file: Annotated[
        Path | None,
        typer.Argument(
            metavar="FILE",
            callback=options.there,
            help="Table of spectra: films in rows of four, NAME_b and NAME_w (bare black and "
            "white card), NAME_ob and NAME_ow (paint over them); or any spectra, with --ground.",
            show_default=False,
        ),
    ] = None,
    out: options.Folder = None,
    sample: Annotated[
        str,
        options.option(metavar="NAME", help="The film of FILE, if it holds several."),
    ] = "",
    quantity: options.Quantity = None,
    unit: options.Unit = None,
    scale: options.Scale = None,
    paints: Annotated[
        str,
        options.option(
            metavar="NAMES",
            help="What the film is made of, such as CobaltBlue,ZincWhite. Default: what "
            "mixtures.tsv in the folder of FILE states.",
        ),
    ] = "",
    coats: Annotated[
        str,
        options.option(
            metavar="COATS",
            help="Several coats, top first, written as `glazejax render --coats` takes them, "
            "with ~ before a thickness that is about right and ? for one not known: "
            "Eosin:~5um,ZincWhite+CobaltBlue:? (fractions of the lower coat not known either); "
            "?:? is a coat of unknown paint, whose k and s times thickness are found.",
        ),
    ] = "",
    bands: Annotated[
        bool,
        typer.Option(
            "--bands", help="Assume no paint: find k and s times thickness at every wavelength."
        ),
    ] = False,
    pigments: options.Pigments = None,
    catalogue: options.CatalogueName = None,
    ground: Annotated[str | None, options.ground_option()] = None,
    thickness: options.Thickness = "25um",
    sampler: Annotated[
        str,
        typer.Option(
            metavar="WORD",
            help="hmc follows the posterior's slopes; emcee is an ensemble that needs none; "
            "importance weights Laplace's draws, without a chain, and says whether that is good "
            "enough.",
        ),
    ] = "hmc",
    steps: Annotated[
        int | None,
        options.option(
            help="Steps of the whole chain; 0 for Laplace's standard errors alone. Default: 200 of "
            "hmc, 5000 of emcee.",
        ),
    ] = None,
    walkers: Annotated[
        int | None,
        options.option(
            help="How many chains of hmc, or walkers of emcee's ensemble, an even number. Default: "
            "16; 32 of emcee, or twice as many as there are unknowns.",
        ),
    ] = None,
    thin: Annotated[
        int | None,
        options.option(
            help="Keep every so many-th step: 5 keeps steps 5, 10, 15, ... Default: 1 of hmc, 5 of "
            "emcee.",
        ),
    ] = None,
    seed: options.Seed = 0,
    resume: Annotated[
        bool,
        typer.Option(
            "--resume", help="Go on with the chain in the folder until it has --steps steps."
        ),
    ] = False,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Start again in a folder that is not empty.")
    ] = False,
    paint_error: Annotated[
        float,
        typer.Option(
            help="Error expected of the paints' k and s, as a share of them; its true size is "
            "estimated too."
        ),
    ] = 0.05,
    noise: options.Noise = 0.0005,
    noise_share: options.NoiseShare = 0.002,
    instrument: Annotated[str | None, options.instrument_option(_GEOMETRY)] = None,
    refractive_index: options.RefractiveIndex = 1.5,
    simulate: Annotated[
        bool,
        typer.Option(
            "--simulate", help="Try it without data: simulate a film of equal parts of --paints."
        ),
    ] = False,
) -> None:
    """Estimate a film's paints and thickness, coat by coat, or its k and s, each with an error.

    Prints medians and 90 % intervals of the posterior with Laplace's
    standard errors, and states what the measurement leaves open.

    Writes chain.h5, posterior.nc (for ArviZ), summary.csv, corner.png, bands.png.
    Ctrl-C keeps the chain; --resume goes on with it.

    Try it without data: glazejax posterior --simulate --paints CobaltBlue,ZincWhite --out demo
    """
    from ..film.sampling import Sampling, check_sampler

    check_sampler(sampler, "--sampler")
    # Says what is wrong with the numbers.
    settings: dict[str, Any] = {
        "sampler": sampler,
        "steps": steps,
        "walkers": walkers,
        "thin": thin,
        "resume": resume,
    }
    total = Sampling(**settings).length
    named = options.split_names(paints)
    options.check_names(named, pigments, catalogue)
    usual = options.read_length(thickness)
    _check(file, sample, paints=paints, coats=coats, bands=bands, simulate=simulate, ground=ground)
    of_paints = {"paints": paints, "thickness": thickness, "paint_error": paint_error}
    of_paints |= {"pigments": pigments, "catalogue": catalogue}
    if bands and (unused := changed(posterior, of_paints)):
        raise ValueError(f"--bands assumes no paint; leave out {unused[0]}, or leave out --bands")
    require("matplotlib", "corner", "arviz", "h5py")
    folder = _check_folder(out, resume, overwrite, [file, pigments, ground_file(ground)])
    from glazejax.commands.main import start_jax

    start_jax()
    seen_by = options.read_geometry(instrument, _GEOMETRY)

    from glazejax.spectra import common_range

    from ..film.films import Films, Instrument, Noise
    from ..film.model.errors import Prior
    from ..film.shared_bands import PAINTS_KNOWN, crop
    from .coats import CoatPrior, parse_coats

    console = progress.plain_console()
    seen_with = Instrument(seen_by, refractive_index)
    errors = Noise(noise, noise_share)
    prior = Prior(thickness=usual, error=paint_error)
    shelf = {} if bands else options.read_shelf(pigments, catalogue)
    stack = parse_coats(coats, options.all_named(shelf), prior.spread) if coats else ()
    stated = options.stated(quantity, unit, scale)
    measured: Films | SpectraTable | None = None
    if file is not None:
        measured = (
            _only_film(file, sample, stated, seen_by)
            if ground is None
            else _only_spectrum(file, sample, stated)
        )
        if not (named or coats or bands):
            named = _recipe(file, measured.names[0])
    made_of = list(options.find_paints(named, shelf).values())
    layers = stack or (CoatPrior(made_of),)
    grids = [paint.wavelengths for coat in layers for paint in coat.paints]
    # Without a paint nothing bounds the bands.
    reach = common_range(grids) if grids else (0.0, math.inf)
    film: Films | Reading
    if file is None or measured is None:
        film = _simulate(layers, usual, seen_with, errors, seed=seed, console=console)
    elif isinstance(measured, Films):
        film = crop(measured, *reach, PAINTS_KNOWN)
        progress.print_notes(console, file, film.notes)
    else:
        assert ground is not None
        film = _over_ground(file, measured, ground, reach, noise=errors, console=console)
    folder.mkdir(parents=True, exist_ok=True)
    with progress.follow("finding the mode (the first run compiles for up to a minute)") as report:
        from .posterior import posterior_of_bands, posterior_of_coats, posterior_of_film

        settings |= {
            "seed": seed,
            "path": folder / CHAIN,
            "overwrite": overwrite,
            "instrument": seen_with,
            "noise": errors,
            "progress": report,
        }
        if stack:
            result = posterior_of_coats(film, stack, prior=prior, **settings)
        elif made_of:
            result = posterior_of_film(film, made_of, prior=prior, **settings)
        else:
            result = posterior_of_bands(film, **settings)
    _write(result, folder, console)
    chain = result.chain
    if chain is not None and chain.interrupted:
        count = len(chain.free) * chain.thin
        console.print(
            f"Interrupted: {count} of {total} steps are kept in {folder / CHAIN}. To go "
            "on, give the same command with --resume (and without --overwrite).",
            style="yellow",
        )
        raise typer.Exit(progress.INTERRUPTED)
    if chain is not None and not result.converged:
        console.print(
            "To lengthen the chain, give the same command with --resume and more --steps."
        )


def _check(
    file: Path | None,
    sample: str,
    paints: str,
    coats: str,
    bands: bool,
    simulate: bool,
    ground: str | None,
) -> None:
    if coats and (paints or bands):
        option = "--paints" if paints else "--bands"
        raise ValueError(
            f"--coats says what each coat is made of; leave out {option}, or leave out --coats"
        )
    if simulate and bands:
        raise ValueError(
            "--simulate makes a film of paints, and --bands assumes none; leave out one of the two"
        )
    if simulate and file is not None:
        raise ValueError(f"--simulate needs no data; leave out {file}, or leave out --simulate")
    if simulate and not (paints or coats):
        raise ValueError(
            "--simulate needs paints to simulate: add --paints, such as --paints "
            "CobaltBlue,ZincWhite"
        )
    if simulate and sample:
        raise ValueError(f"--simulate makes its own film; leave out --sample {sample}")
    if simulate and ground is not None:
        raise ValueError("--simulate has cards of its own; leave out --ground")
    if not simulate and file is None:
        raise ValueError(
            "no FILE was given; name a table of spectra, such as films.tsv, or try --simulate"
        )


def _check_folder(
    out: Path | None, resume: bool, overwrite: bool, inputs: Sequence[Path | None]
) -> Path:
    if resume and overwrite:
        raise ValueError("--resume goes on with a chain and --overwrite throws it away; choose one")
    old = out is not None and (out / CHAIN).is_file()
    folder = options.check_folder(
        out,
        resume or overwrite,
        instead=", go on with its chain by --resume" if old else "",
        inputs=inputs,
    )
    if resume and not old:
        raise FileNotFoundError(
            f"{folder / CHAIN}: there is no chain to resume; leave out --resume to start one"
        )
    return folder


def _simulate(
    coats: "Sequence[CoatPrior]",
    usual: float,
    instrument: "Instrument",
    noise: "Noise",
    *,
    seed: int,
    console: "Console",
) -> "Films":
    """A simulated film of coats as described, with unknown fractions equal, unknown thicknesses the
    usual one.
    """
    import numpy as np

    from glazejax import Mixture
    from glazejax.paint.describe import format_length

    from ..film.simulate import simulate_films

    if any(coat.unknown for coat in coats):
        raise ValueError(
            "--simulate cannot make a film of an unknown paint (?); name a paint in its place"
        )
    grid = coats[0].paints[0].wavelengths
    thick = [usual if coat.thickness is None else coat.thickness for coat in coats]
    media = [Mixture(coat.on(grid).paints, coat.shares) for coat in coats]
    k, s = (
        np.stack([getattr(medium, what) for medium in media], axis=-1) * thick
        for what in ("absorption", "scattering")
    )
    film = simulate_films(
        grid, k[None], s[None], names=["simulated"], instrument=instrument, noise=noise, seed=seed
    )
    mixtures = [
        " + ".join(
            f"{share:.3g} {p.name}" for share, p in zip(coat.shares, coat.paints, strict=True)
        )
        for coat in coats
    ]
    description = " over ".join(
        f"{mixture}, {format_length(d)} thick," for mixture, d in zip(mixtures, thick, strict=True)
    )
    console.print(
        f"Simulated data: {description} with made-up noise (seed {seed}). Nothing "
        "here was measured."
    )
    return film


def _only_film(file: Path, sample: str, stated: "Stated", geometry: "Geometry") -> "Films":
    """The film that is called so, or the file's only one if none is named, read over both cards."""
    from glazejax.io.spectra_table import there_are

    from ..film.readers import read_films

    films = read_films(file, specular=bool(geometry.sees_surface), **stated)
    if not sample and len(films) != 1:
        raise ValueError(
            f"{file} holds {len(films)} films; choose one with --sample "
            f"({there_are('', films.names)})"
        )
    return films.select([sample or films.names[0]])


def _only_spectrum(file: Path, sample: str, stated: "Stated") -> "SpectraTable":
    """The spectrum that is called so, or the file's only one if none is named."""
    from glazejax.io import read_spectra
    from glazejax.io.spectra_table import SpectraTable, row_of

    table = read_spectra(file, **stated)
    row = row_of(table.names, sample, str(file), "--sample ")
    return SpectraTable(
        wavelengths=table.wavelengths,
        names=(table.names[row],),
        reflectance=table.reflectance[[row]],
        notes=table.notes,
    )


def _over_ground(
    file: Path,
    spectrum: "SpectraTable",
    ground: str,
    reach: tuple[float, float],
    *,
    noise: "Noise",
    console: "Console",
) -> "Reading":
    """A spectrum over the ground that was stated, on the bands that its paints reach."""
    from ..film.films import reading_over
    from ..film.shared_bands import PAINTS_KNOWN, crop_bands

    below = options.read_ground(ground)
    progress.print_notes(console, file, spectrum.notes)
    progress.print_notes(console, "--ground", below.notes)
    grid, mean, notes = crop_bands(spectrum.wavelengths, *reach, PAINTS_KNOWN)
    progress.print_notes(console, file, notes)
    (name,), (reflectance,) = spectrum.names, spectrum.reflectance
    return reading_over(grid, reflectance @ mean, below.on(grid), noise=noise, name=name)


def _recipe(file: Path, sample: str) -> list[str]:
    """Paints of the film or spectrum by the list of names in the file's folder."""
    from ..film.readers import NAMES_FILE, read_recipes

    path = file.parent / NAMES_FILE
    recipe = read_recipes(path).get(sample) if path.is_file() else None
    if not recipe:
        where = (
            f"and {path} does not say"
            if path.is_file()
            else f"and there is no {NAMES_FILE} in its folder"
        )
        raise ValueError(
            "what is the film made of? Name its paints, such as --paints CobaltBlue,ZincWhite "
            f"({file.name} does not say, {where}), or ask for --bands"
        )
    return list(recipe)


def _write(result: "Posterior", out: Path, console: "Console") -> None:
    """Print and write everything but the chain, which is written already; these files are the
    command's own.
    """
    from glazejax.whole_file import whole_file

    from .plots import plot_bands, plot_corner
    from .report import report_posterior, write_summary

    for line in report_posterior(result):
        console.print(line)
    write_summary(result, out / SUMMARY)
    # A notebook may have the old file open: put a new one in its place.
    with whole_file(out / DATA) as path:
        result.inference_data.to_netcdf(str(path))
    plot_corner(result, out / CORNER)
    plot_bands(result, out / BANDS)
    files = [CHAIN] if result.chain is not None else []
    console.print(f"Wrote {', '.join([*files, DATA, SUMMARY, CORNER, BANDS])} to {out}")
    if result.problem.kind != "bands":
        console.print(
            "Thickness is on the scale of the paints; the catalogue's assume films of 25 µm.",
            style="dim",
        )
