"""The command `glazejax recover`: films over black and white in, pigments out."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from glazejax.commands import options, progress
from glazejax.commands.help_groups import help_groups
from glazejax.extras import require

_GEOMETRY = "d:8"


@help_groups(
    usual="--out --into --white --thickness --joint",
    given=(
        "--samples --quantity --unit --scale --masstones --names --wet-film --excluded "
        "--catalogue --instrument"
    ),
    tried="--check --simulate",
    written="--plots --overwrite",
    fine="--noise --noise-share --refractive-index --seed",
)
def recover(
    file: Annotated[
        Path | None,
        typer.Argument(
            metavar="FILE",
            callback=options.there,
            help="Table of spectra. Rows of a film: NAME_ob and NAME_ow (paint over black, over "
            "white), or one of them, or NAME alone (opaque), and NAME_b and NAME_w (its bare "
            "cards), or card_b and card_w. 'Blue 1:10 White' is that tint, 'Blue 2 coats' is "
            "two coats of a brush. CSV or TSV, percent or fractions.",
            show_default=False,
        ),
    ] = None,
    out: options.Folder = None,
    samples: options.Samples = "",
    quantity: options.Quantity = None,
    unit: options.Unit = None,
    scale: options.Scale = None,
    masstones: Annotated[
        bool, typer.Option("--masstones", help="Only films of one paint (see --names).")
    ] = False,
    names: Annotated[
        Path | None,
        options.file_option(
            help="Recipes of the samples, a line each: 'SAMPLE<TAB>PaintA-PaintB|90-10'. Default: "
            "mixtures.tsv in the folder of the table, if it exists.",
        ),
    ] = None,
    into: Annotated[
        Path | None,
        options.option(
            metavar="FILE",
            help=(
                "Add the new paints to your own file of paints, such as mine.csv, whose paints "
                "stay fixed."
            ),
        ),
    ] = None,
    white: Annotated[
        str,
        options.option(
            metavar="NAME",
            help="White of the tints, which sets the scale: a paint of --into, of --catalogue "
            "(ZincWhite), or acrylics:TitaniumWhite.",
        ),
    ] = "",
    catalogue: options.CatalogueName = None,
    wet_film: Annotated[
        str,
        options.option(
            metavar="LENGTHS",
            help="Thickness by a gauge, or gap of the drawdown bar: 100um, 100um±20%, "
            "'Red=100um,Blue=50um', or 'same' (one bar of unknown gap). Give the dry thickness "
            "of acrylics, which lose about half.",
        ),
    ] = "",
    excluded: Annotated[
        Path | None,
        options.file_option(
            help="The same films read without the specular part (de:8), if FILE includes it: the "
            "difference is the gloss of each film.",
        ),
    ] = None,
    thickness: options.Thickness = "25um",
    noise: Annotated[
        float | None,
        options.option(
            callback=options.between(0.0),
            help="Noise of the instrument near black: standard deviation of a reflectance. "
            "Default: estimated from the roughness of the spectra, 0.0005 or more; with "
            "--noise-share 0.0005.",
        ),
    ] = None,
    noise_share: Annotated[
        float | None,
        options.option(
            callback=options.between(0.0),
            help="Noise proportional to the reading, added to --noise per unit of reflectance. "
            "Default: estimated from the spectra; with --noise 0.002.",
        ),
    ] = None,
    instrument: Annotated[str | None, options.instrument_option(_GEOMETRY)] = None,
    refractive_index: options.RefractiveIndex = 1.5,
    simulate: Annotated[
        bool,
        typer.Option(
            "--simulate",
            help="Try it without data: recover simulated films of the catalogue's paints.",
        ),
    ] = False,
    seed: options.Seed = 0,
    joint: Annotated[
        bool,
        typer.Option(
            "--joint",
            help=(
                "Fit all films together by their recipes (see --names): tints with white "
                "separate k from s of opaque paints."
            ),
        ),
    ] = False,
    check: Annotated[
        bool,
        typer.Option(
            "--check",
            help="With --joint: leave out each mixture in turn and predict it from the others.",
        ),
    ] = False,
    plots: Annotated[
        bool, typer.Option("--plots/--no-plots", help="Draw a picture for each paint.")
    ] = True,
    overwrite: Annotated[
        bool,
        typer.Option(
            "--overwrite",
            help="Write into a folder that is not empty, and replace entries of --into.",
        ),
    ] = False,
) -> None:
    """Recover absorption k and scattering s of paints from films over a black and a white card.

    Every wavelength of every film is fitted separately. --joint fits all
    films of stated recipes together, each with its own thickness. Tints,
    films that lack a reading, --into, --white, --wet-film and --excluded
    need it and switch it on.

    Writes pigments.csv (k and s in 1/m with standard deviations), a picture
    for each paint, and fits.csv (k/s and fitted spectra) or, with --joint,
    films.csv (thickness, gloss and fit of every film). --check predicts
    mixtures that are left out; with --out, left_out.csv and left_out.png.

    The scale of k and s is that of the thickness: films twice as thick have
    half the k and s.

    Films called 'Smalt 1 coat', 'Smalt 2 coats' are brushed coats of unknown
    thickness, each on a measured bare ground (NAME_w): k and s are then
    for one coat, and next_coats.csv predicts the next two coats of each
    paint with 90 % bands.

    Own tubes, by a masstone and one tint over a black-and-white card:
    glazejax recover blue.csv --white ZincWhite --into mine.csv

    Try it without data: glazejax recover --simulate --out demo
    """
    # What is known beside the films, and all options that are for measured films.
    knowledge = {"--into": into, "--white": white, "--wet-film": wet_film, "--excluded": excluded}
    measured = {"--masstones": masstones, "--names": names, **knowledge}
    of_file = {"--quantity": quantity, "--unit": unit, "--scale": scale}
    _check(file, simulate, check, joint, masstones, {**measured, **of_file})
    if seed and not simulate:
        raise ValueError(f"--seed {seed} is for simulated films; leave it out, or add --simulate")
    shelf = _catalogue(catalogue, bool(white) or simulate)
    stated = options.stated(quantity, unit, scale)
    metres = options.read_length(thickness)
    # The white may be a paint of --into, a file that need not be there yet.
    own_file = into if into is not None and into.is_file() else None
    options.check_names(options.split_names(white), own_file, shelf)
    options.check_outputs({"--into": into}, overwrite=True, pictures=())
    if plots and out is not None:
        require("matplotlib")
    folder = (
        None
        if out is None and into is not None
        else options.check_folder(out, overwrite, inputs=[file, names, excluded, into])
    )
    from glazejax.commands.main import start_jax

    start_jax()
    seen_by = options.read_geometry(instrument, _GEOMETRY)

    from glazejax.io.spectra_table import list_names
    from glazejax.paint.describe import format_length

    from ..film.films import Instrument, Noise
    from ..film.noise import estimate_noise
    from ..film.readers import (
        NAMES_FILE,
        is_masstone,
        read_loose_films,
        read_recipes,
        readable_names,
        tint,
    )
    from .fits import Destination, are_coats, recover_each, recover_from_coats, recover_together

    console = progress.plain_console()
    stated_noise = {
        name: value
        for name, value in (("floor", noise), ("share", noise_share))
        if value is not None
    }
    usual_noise = Noise(**stated_noise)
    fit_options: dict[str, Any] = {"instrument": Instrument(seen_by, refractive_index)}
    results = Destination(
        out=folder, thickness=metres, plots=plots, overwrite=overwrite, console=console
    )
    simulated = []
    if simulate:
        from glazejax.catalogue import load

        from ..film.simulate import simulate_paints

        fit_options["noise"] = usual_noise
        simulated = options.choose_paints(load(shelf), samples)
        console.print(
            f"Simulated data: spectra of {len(simulated)} catalogue paints, "
            f"{format_length(metres)} thick, with made-up noise (seed {seed}). Nothing here was "
            "measured."
        )
        films = simulate_paints(simulated, metres, seed=seed, **fit_options)
    else:
        assert file is not None
        films = read_loose_films(file, specular=bool(seen_by.sees_surface), **stated)
        if chosen := options.split_names(samples):
            films = films.select(chosen)
        progress.print_notes(console, file, films.notes)
        # As stated, or as rough as the spectra are, which is said where it is more than usual.
        read_noise = usual_noise if stated_noise else estimate_noise(films)
        if read_noise != usual_noise:
            console.print(
                f"Noise of a reading R, estimated from how rough the spectra are: "
                f"{read_noise.floor:.2g} + {read_noise.share:.2g} R (--noise, --noise-share)"
            )
        fit_options["noise"] = read_noise
        if are_coats(films, {"--joint": joint, **measured}):
            recover_from_coats(films, fit_options, results)
            return
        names_file = file.parent / NAMES_FILE
        listed = names or (names_file if names_file.is_file() else None)
        recipes = read_recipes(listed) if listed else {}
        unlisted = [name for name in films.names if name not in recipes and not tint(name)]
        if names is not None and unlisted:
            if len(unlisted) == len(films):
                raise ValueError(
                    f"--names {names} lists none of the films: they are {list_names(films.names)}, "
                    f"and it lists {list_names(list(recipes))}"
                )
            note = f"no recipe of {list_names(unlisted)}: each is taken for a paint of that name"
            progress.print_notes(console, names, (note,))
        if masstones:
            if not recipes:
                raise ValueError(
                    "--masstones needs to know what the films are made of: add --names, or "
                    f"{names_file}"
                )
            pure = [name for name in films.names if is_masstone(recipes.get(name, {}))]
            if not pure:
                raise ValueError(
                    f"--masstones: none of the {len(films)} films is listed as a single paint"
                )
            films = films.select(pure)
        tints = any(map(tint, films.names))
        if joint or any(knowledge.values()) or not films.complete or tints:
            if joint and not recipes and not tints:
                raise ValueError(
                    "--joint needs to know what the films are made of: add --names FILE, or "
                    f"{names_file}"
                )
            recover_together(
                films,
                recipes,
                fit_options,
                results,
                check=check,
                into=into,
                white=white,
                wet_film=wet_film,
                excluded=excluded,
                catalogue=shelf,
                stated=stated,
            )
            return
        films = replace(films, names=readable_names(films.names, recipes))

    recover_each(films, fit_options, results, simulated)


def _check(
    file: Path | None,
    simulate: bool,
    check: bool,
    joint: bool,
    masstones: bool,
    measured: Mapping[str, object],
) -> None:
    if simulate and file is not None:
        raise ValueError(f"--simulate needs no data; leave out {file}, or leave out --simulate")
    if file is None and not simulate:
        raise ValueError(
            "no FILE was given; name a table of spectra, or try: glazejax recover --simulate "
            "--out demo"
        )
    for option, value in (("--simulate", simulate), ("--masstones", masstones)):
        if joint and value:
            raise ValueError(
                f"--joint fits measured mixtures; leave out {option}, or leave out --joint"
            )
    for option, value in measured.items():
        if simulate and value:
            raise ValueError(
                f"{option} is for measured films; leave it out, or leave out --simulate"
            )
    if check and not joint:
        raise ValueError("--check leaves mixtures out of a joint fit; add --joint")


def _catalogue(name: str | None, used: bool) -> str:
    """The catalogue that the white of tints is of, or the paints to simulate."""
    from glazejax.catalogue import names

    if name is None:
        return options.OILS
    if name not in names():
        raise ValueError(f"--catalogue is {name!r}; recover takes {' or '.join(names())}")
    if not used:
        raise ValueError(
            f"--catalogue {name} says where the white of tints is from, or what is simulated: add "
            "--white NAME or --simulate, or leave it out"
        )
    return name
