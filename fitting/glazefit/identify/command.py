"""The command `glazejax identify`: measured spectra in; paints, fractions, thickness and
probabilities out.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from glazejax.commands import options, progress
from glazejax.commands.command_line import changed, command_line, ground_file, option
from glazejax.commands.help_groups import help_groups

from ..page import subject as head
from . import facts

if TYPE_CHECKING:
    import numpy as np
    from rich.console import Console

    from glazejax.io import SpectraTable

    from ..film.films import Films
    from .result import Identification
    from .search.options import IdentificationOptions

# Spectra from which on a map is the better way.
_MANY = 2000
# Candidates that are kept of each spectrum, however many are shown: the probability of pigments is
# the sum of theirs, and a report judges by them how near each paint comes.
_KEPT = 40
# Options of films of known paints, of which a search by family makes nothing.
_OF_PAINTS = ("noise", "noise_share", "model_error", "thickness", "thorough")
# Options that name files to write.
_OUTPUTS = ("csv", "residuals", "out", "report")


@help_groups(
    usual="--ground --catalogue --only --out --report",
    given=(
        "--samples --quantity --unit --scale "
        "--bare --opaque --pigments --references --without --elements "
        "--without-elements --painted --varnish --own-films --instrument"
    ),
    tried="--max-paints --max-coats --thorough",
    written="--top --csv --residuals --object --inventory --spot --operator --overwrite",
    fine="--thickness --refractive-index --noise --noise-share --model-error",
)
def identify(
    file: Annotated[
        Path | None,
        typer.Argument(
            metavar="FILE",
            callback=options.there,
            help="Table of spectra. Rows in fours, NAME_b and NAME_w (bare black and white card), "
            "NAME_ob and NAME_ow (paint over them), are films over cards; any other spectra need "
            "--ground or --opaque.",
            show_default=False,
        ),
    ] = None,
    ground: Annotated[str | None, options.ground_option()] = None,
    bare: facts.Bare = False,
    opaque: facts.Opaque = False,
    pigments: options.Pigments = None,
    catalogue: facts.Catalogue = None,
    references: facts.References = None,
    only: options.Only = "",
    without: options.Without = "",
    samples: options.Samples = "",
    quantity: options.Quantity = None,
    unit: options.Unit = None,
    scale: options.Scale = None,
    max_paints: facts.MaxPaints = 3,
    max_coats: Annotated[
        int,
        typer.Option(
            callback=options.between(1, 3),
            help="Largest number of coats: 2 decides whether two paints were mixed or laid one "
            "over the other, 3 does so for three (some ten seconds a spectrum). No set has more "
            "paints than --max-paints.",
        ),
    ] = 1,
    own_films: Annotated[
        bool,
        typer.Option(
            "--own-films",
            help="The films are by the maker of the catalogue: search its paints, not families of "
            "pigments.",
        ),
    ] = False,
    elements: facts.Elements = "",
    without_elements: facts.WithoutElements = "",
    painted: facts.Painted = None,
    varnish: Annotated[
        str | None,
        options.option(
            callback=options.among("none", "thin", "yellowed", "unknown"),
            help="Varnish: none, thin, yellowed or unknown. Default: none with --catalogue "
            "pigments, else unknown.",
        ),
    ] = None,
    thorough: Annotated[
        bool,
        typer.Option(
            "--thorough",
            help="Fit every pair of paints in full, which takes some five times as long.",
        ),
    ] = False,
    instrument: facts.InstrumentName = None,
    refractive_index: options.RefractiveIndex = 1.5,
    noise: options.Noise = 0.0005,
    noise_share: options.NoiseShare = 0.002,
    model_error: options.ModelError = None,
    thickness: options.Thickness = "25um",
    top: Annotated[
        int,
        typer.Option(callback=options.between(1), help="Number of explanations for each spectrum."),
    ] = 5,
    csv: options.Csv = None,
    residuals: Annotated[
        Path | None,
        options.option(
            metavar="FILE", help="Also write a table of measured, fitted and residual spectra."
        ),
    ] = None,
    out: options.PictureIfNamed = None,
    report: Annotated[
        Path | None,
        options.option(
            metavar="FILE",
            help="Also write a report, such as report.html: one page to file with each spectrum, "
            "its best fits, amounts with 90 % intervals and excluded paints. The same is "
            "written to report.csv and report.json.",
        ),
    ] = None,
    object: head.Object = "",
    inventory: head.Inventory = "",
    spot: head.Spot = "",
    operator: head.Operator = "",
    overwrite: options.Overwrite = False,
) -> None:
    """Identify the pigments in anybody's paint: a ranked list with probabilities.

    --catalogue oils or acrylics, or your own --pigments, searches the paints
    of that one maker instead, with fractions and thickness, on the scale of
    the catalogue (its oils: typical films of 25 micrometres). Films over two
    cards are searched in both. --noise, --noise-share, --model-error,
    --thickness and --thorough count where paints are searched, not pigments.

    Example: glazejax identify spectra.csv --opaque --instrument 45:0
    """
    typed = dict(locals())
    if file is None:
        raise ValueError("no FILE was given; name a table of spectra, such as films.tsv")
    subject = head.check_subject(
        report, object=object, inventory=inventory, spot=spot, operator=operator
    )
    if pigments is not None and catalogue == options.PIGMENTS and not own_films:
        raise ValueError(
            f"--catalogue pigments is searched by family, and the paints of {pigments} have none: "
            "add --catalogue oils or acrylics, or leave out --pigments"
        )
    facts.check_ground(ground, bare=bare, opaque=opaque)
    by_default = catalogue is pigments is None
    catalogue = options.PIGMENTS if by_default else catalogue
    options.check_names(options.split_names(f"{only},{without}"), pigments, catalogue)
    read = {
        "FILE": file,
        "--ground": ground_file(ground),
        "--pigments": pigments,
        "--references": references,
    }
    options.check_outputs(_outputs(typed), overwrite, inputs=list(read.values()))
    from glazejax.commands.main import start_jax

    start_jax()

    from glazejax.io import read_spectra

    from ..film.readers import ROWS, films_in, one_reading

    # A pipe can be read once.
    table = read_spectra(file, **options.stated(quantity, unit, scale))
    specular = bool(options.read_geometry(instrument, facts.GEOMETRY).sees_surface)
    # Rows in fours are films over cards.
    over_cards = not (ground or opaque) and all(
        name.rpartition("_")[2] in ROWS for name in one_reading(table, specular=specular).names
    )
    measured = films_in(table, file, specular=specular) if over_cards else table
    console = progress.plain_console()
    progress.print_notes(console, file, measured.notes)
    typed |= {"catalogue": catalogue}
    searches = [typed]
    if by_default and over_cards and not (own_films or only or without):
        # Two cards give a film's thickness too, and families have none.
        of_families = {"references": None, "elements": "", "without_elements": "", "painted": None}
        second = {**typed, **of_families, "catalogue": options.OILS}
        for output in _OUTPUTS:
            if (path := typed[output]) is not None:
                second[output] = path.with_stem(f"{path.stem}-{options.OILS}")
        options.check_outputs(_outputs(second), overwrite, inputs=list(read.values()))
        searches.append(second)
    for search in searches:
        files = {**read, "--references": search["references"]}
        _identify(search, measured, files, subject, console)


def _identify(
    typed: facts.Typed,
    measured: "SpectraTable | Films",
    read: Mapping[str, Path | None],
    subject: Mapping[str, str],
    console: "Console",
) -> None:
    """Search one catalogue for spectra or films, as options were typed, print and write what comes
    of it.
    """
    from ..film.films import Noise
    from ..page.inputs import input_files

    top, report, opaque = typed["top"], typed["report"], typed["opaque"]
    of_paints = changed(identify, {name: typed[name] for name in _OF_PAINTS})
    search = facts.read_search(typed, console, of_paints)
    paints = search.paints
    inputs = input_files(read) if report is not None else []
    task = _choose_spectra(typed, measured, search, console)
    from .identify import identify_chunks
    from .result import Identification
    from .search.options import IdentificationOptions

    search_options = IdentificationOptions(
        **search.keywords,
        noise=Noise(typed["noise"], typed["noise_share"]),
        keep=max(top, _KEPT),
        **{name: typed[name] for name in ("max_coats", "thorough", "own_films", "varnish")},
    )
    chunks = identify_chunks(
        task.wavelengths,
        task.spectra,
        paints,
        search_options,
        ground=task.ground,
        opaque=opaque,
        names=task.names,
    )
    finished, how = progress.collect(
        lambda _: chunks, len(task.spectra), "compiling, then searching", "searching"
    )
    identification = Identification.join(finished)
    _report(typed, identification, console)
    if report is not None:
        from .show.page import write_page
        from .show.record import make_record

        about = _about(
            typed, task=task, search=search, searched=search_options, inputs=inputs, subject=subject
        )
        bands = usual = None
        if search.by_family:
            from .families.misfit import usual_misfit

            usual = usual_misfit(identification, paints, search_options)
        else:
            from .search.searcher import Searcher
            from .show.bands import expected_bands

            searcher = Searcher.of(task.wavelengths, paints, search_options, opaque=opaque)
            bands = expected_bands(identification, searcher.task)
        record = make_record(
            identification,
            about,
            task.names,
            top,
            bands=bands,
            painted=typed["painted"],
            usual=usual,
        )
        beside = write_page(record, report, overwrite=typed["overwrite"])
        console.print(f"Wrote the report to {report}, and the same as {beside[0]} and {beside[1]}")
    counted = f"{len(identification)} spectra" if len(identification) > 1 else "1 spectrum"
    console.print(
        f"{counted} against {len(paints)} paints in {how.seconds:.1f} s, compilation included.",
        style="dim",
    )
    console.print(search.asked, soft_wrap=True)
    if how.interrupted:
        progress.stop_interrupted(console, len(identification), len(task.spectra), "spectra")


class _Spectra(NamedTuple):
    """Spectra to identify; what the grounds are, in words; and what the readers noticed."""

    names: tuple[str, ...]
    wavelengths: "np.ndarray"
    spectra: "np.ndarray"
    ground: "np.ndarray | None"
    ground_names: tuple[str, ...]
    notes: tuple[str, ...]


def _outputs(typed: facts.Typed) -> dict[str, Path | None]:
    """Files to write by what they are called in errors."""
    files = {f"--{name}": typed[name] for name in _OUTPUTS}
    if typed["report"] is None:
        return files
    from glazejax.extras import require

    table, data = head.beside(typed["report"])
    require("jinja2")
    return {**files, "the table of --report": table, "the JSON of --report": data}


def _choose_spectra(
    typed: facts.Typed,
    measured: "SpectraTable | Films",
    search: facts.Search,
    console: "Console",
) -> _Spectra:
    """Spectra and the grounds below them, on bands that the paints are known at."""
    import numpy as np

    from glazejax.spectra import common_range
    from glazejax.stacks import Spectrum

    from ..film.films import Films, ground_from_air
    from ..film.shared_bands import crop_bands, every_band, shared_bands

    def internal(bare: "np.ndarray") -> "np.ndarray":
        return ground_from_air(bare, search.keywords["instrument"])

    file, ground, bare = typed["file"], typed["ground"], typed["bare"]
    chosen = options.split_names(typed["samples"])
    stated_ground = None if ground is None else options.read_ground(ground, bare=bare)
    if search.by_family:
        # Each family is known at bands of its own, and what a reading has is used.
        bands = every_band(measured.wavelengths)
        if stated_ground is not None and isinstance(stated_ground.level, Spectrum):
            covered = stated_ground.level.wavelengths
            with stated_ground.blame():
                bands = crop_bands(
                    measured.wavelengths, covered[0], covered[-1], "the ground is known there only"
                )
    else:
        bands = shared_bands(
            measured.wavelengths, common_range(paint.wavelengths for paint in search.paints)
        )
    grid, mean, changes = bands
    below = None
    ground_names = ("a ground that is not seen",)
    if isinstance(measured, Films):
        films = measured.select(chosen) if chosen else measured
        names = films.names
        if search.by_family:
            changes = (
                "families are searched by the readings over the white cards, of which the mean is "
                "taken; those over black are not used",
            )
            spectra = films.over_white
            # One ground for all: each other one is a search that is set up again.
            below = internal(films.bare_white.mean(axis=0))
            ground_names = ("white card, measured bare, the mean of all",)
        else:
            spectra = films.over_cards @ mean
            below = internal(films.bare_cards @ mean)
            ground_names = ("black card, measured bare", "white card, measured bare")
    else:
        rows = options.choose_rows(file, measured.names, chosen)
        if len(rows) > _MANY and not search.by_family:
            note = (
                f"{len(rows)} spectra are searched one by one: an image is much faster with "
                "glazejax map, and --samples chooses some (Ctrl-C keeps finished ones)"
            )
            progress.print_notes(console, file, (note,))
        spectra = measured.reflectance[rows] @ mean
        names = tuple(measured.names[i] for i in rows)
        if ground is None and not typed["opaque"]:
            raise ValueError(
                f"{file}: no ground is stated: give --ground, its reflectance such as 0.9 or a "
                f"table, or --opaque, or rows in fours, such as {names[0]}_b, {names[0]}_w, "
                f"{names[0]}_ob and {names[0]}_ow"
            )
    progress.print_notes(console, file, changes)
    notes = (*measured.notes, *changes)
    if stated_ground is not None:
        progress.print_notes(console, "--ground", stated_ground.notes)
        notes = (*notes, *stated_ground.notes)
        below = np.broadcast_to(stated_ground.on(grid), grid.shape)
        below = internal(below) if bare else below
        mode = "measured bare with the same instrument" if bare else "as seen from inside the paint"
        ground_names = (f"{stated_ground.words}, {mode}",)
    return _Spectra(
        names=names,
        wavelengths=grid,
        spectra=spectra,
        ground=below,
        ground_names=ground_names,
        notes=notes,
    )


def _about(
    typed: facts.Typed,
    *,
    task: _Spectra,
    search: facts.Search,
    searched: "IdentificationOptions",
    inputs: list[dict[str, Any]],
    subject: Mapping[str, str],
) -> dict[str, Any]:
    """Describe how an identification was made, as its report has it."""
    from dataclasses import asdict
    from datetime import datetime

    from glazejax import catalogue

    paints = search.paints
    name = typed["catalogue"]
    sources = [str(source) for source in (typed["pigments"], name) if source is not None]
    scales = dict.fromkeys(filter(None, map(catalogue.assumed_scale, paints)))
    shelf: dict[str, Any] = {
        "name": " and ".join(sources),
        "asked": search.asked,
        "scale": "; ".join(scales) or None,
    }
    if name is not None:
        shelf["file"], shelf["sha256"] = catalogue.checksum(name)
    instrument = search.keywords["instrument"]
    return {
        "title": typed["file"].name,
        "subject": subject,
        "created": datetime.now().astimezone().isoformat(timespec="seconds"),
        "command": command_line(),
        "options": {
            "FILE" if name == "file" else option(name): _plain(value)
            for name, value in typed.items()
        },
        "inputs": inputs,
        "catalogue": {
            **shelf,
            "provenance": "; ".join(dict.fromkeys(p.provenance for p in paints if p.provenance)),
        },
        "measurement": {
            "geometry": instrument.geometry.describe(),
            "refractive_index": instrument.refractive_index,
            "grounds": task.ground_names,
            "notes": task.notes,
        },
        "method": {
            "max_paints": searched.max_paints,
            "layers": searched.max_coats,
            "settings": {
                name: asdict(getattr(searched, name)) for name in ("noise", "discrepancy", "prior")
            },
        },
    }


def _plain(value: Any) -> Any:
    return str(value) if isinstance(value, Path) else value


def _report(typed: facts.Typed, identification: "Identification", console: "Console") -> None:
    """Print an identification, and write and draw it as options were typed."""
    from glazejax.io import write_table

    from .result.table import table_of
    from .show.plots import plot_identification
    from .show.terminal import print_identification, report_families, write_residuals

    top, overwrite = typed["top"], typed["overwrite"]
    if identification.family_sets:
        for line in report_families(identification, top, typed["painted"]):
            console.print(line, soft_wrap=True)
    else:
        print_identification(identification, console, top)
    if (csv := typed["csv"]) is not None:
        write_table(csv, *table_of(identification, top), overwrite=overwrite)
        console.print(f"Wrote the explanations to {csv}")
    if (residuals := typed["residuals"]) is not None:
        write_residuals(identification, residuals, overwrite=overwrite)
        console.print(f"Wrote measured, fitted and residual spectra to {residuals}")
    if (out := typed["out"]) is not None:
        count = plot_identification(identification, out)
        console.print(f"Drew {'the first ' if count < len(identification) else ''}{count} to {out}")
