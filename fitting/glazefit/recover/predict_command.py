"""The command `glazejax predict`: what a mixture will look like, how sure that is, and what one
reading of it adds.
"""

import re
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Unpack

import typer

from glazejax.commands import options, progress
from glazejax.commands.command_line import changed
from glazejax.commands.help_groups import help_groups

if TYPE_CHECKING:
    import numpy as np
    from jaxtyping import Float
    from rich.console import Console

    from glazejax import Pigment
    from glazejax.geometry import Geometry
    from glazejax.io.quantity import Stated

    from ..film.films import Films

_GEOMETRY = "d:8"
_PART = re.compile(r"(?:(?P<weight>\d+\.?\d*|\.\d+)(?:\s*[%*]\s*|\s+))?(?P<name>\S.*)")


@help_groups(
    usual="--reading --thickness --pigments --catalogue --csv",
    given="--samples --quantity --unit --scale --film-thickness --instrument",
    written="--overwrite",
    fine="--illuminant --observer --refractive-index",
)
def predict(
    mixture: Annotated[
        str,
        typer.Argument(
            metavar="MIXTURE",
            help="Paints and parts by weight, in any unit: '10 Vermillion + 90 ZincWhite'.",
            show_default=False,
        ),
    ],
    reading: Annotated[
        Path | None,
        options.file_option(
            help="Spectra of one film of this mixture, to learn its strength: rows NAME_ob and "
            "NAME_ow (over a black, a white card), or one of them, or NAME alone (opaque), and "
            "card_b, card_w.",
        ),
    ] = None,
    samples: options.Samples = "",
    quantity: options.Quantity = None,
    unit: options.Unit = None,
    scale: options.Scale = None,
    film_thickness: Annotated[
        str,
        options.option(
            metavar="LENGTH",
            help="Measured thickness of the film in --reading, on the scale of the paints: "
            "20um, or 20um±20%.",
        ),
    ] = "",
    thickness: Annotated[
        str,
        options.option(
            metavar="LENGTHS",
            help=(
                "Thicknesses of the films to predict: 5um,25um. Default: 25um, or with "
                "--reading half, once and twice its film's."
            ),
        ),
    ] = "",
    out: options.Csv = None,
    pigments: options.Pigments = None,
    catalogue: options.CatalogueName = None,
    instrument: Annotated[str | None, options.instrument_option(_GEOMETRY)] = None,
    refractive_index: options.RefractiveIndex = 1.5,
    illuminant: options.Illuminant = "D65",
    observer: options.Observer = "10",
    overwrite: options.Overwrite = False,
) -> None:
    """Predict the colour of a mixture of paints, with its error.

    Prints the colour over a typical black and white card (or those of
    --reading), the expected colour difference between two mixings, and the
    part that comes from errors of the paints. A reading of one film measures
    the strength of the mixture, and reduces the error of its other films.

    Example: glazejax predict "10 Vermillion + 90 ZincWhite"
    """
    # Wrong input is reported before anything heavy is loaded.
    thicknesses = [options.read_length(text) for text in options.split_names(thickness)]
    of_reading = {"samples": samples, "film_thickness": film_thickness}
    of_reading |= {"quantity": quantity, "unit": unit, "scale": scale}
    if reading is None and (unused := changed(predict, of_reading)):
        raise ValueError(
            f"{unused[0]} is for the film of --reading; leave it out, or give --reading FILE"
        )
    options.check_names(read_recipe(mixture), pigments, catalogue)
    options.check_outputs({"--csv": out}, overwrite, inputs=[reading, pigments])
    from glazejax.commands.main import start_jax

    start_jax()
    seen_by = options.read_geometry(instrument, _GEOMETRY)
    recipe, shelf = read_mixture(mixture, options.read_shelf(pigments, catalogue))

    from glazejax.io import write_table

    from ..film.films import Instrument
    from .fits import read_gauge
    from .joint.joint import UNIT
    from .predict.mixture import calibrate_mixture, predict_mixture
    from .show.report import prediction_table, report_predictions, report_reading

    console = progress.plain_console()
    # A reading calibrates the mixture, and says over which grounds and how thick its films are.
    seen_with = Instrument(seen_by, refractive_index)
    calibrated = None
    grid = None
    ground = None
    if reading is not None:
        stated = options.stated(quantity, unit, scale)
        paints = [shelf[paint] for paint in recipe]
        film, whole_grid = read_film(reading, samples, paints, console, seen_by, **stated)
        gauge = read_gauge(film_thickness, film.names, "--film-thickness")
        with progress.follow("compiling, then fitting the reading") as report:
            calibrated = calibrate_mixture(
                shelf,
                recipe,
                film,
                instrument=seen_with,
                gauge=gauge,
                wavelengths=whole_grid,
                progress=report,
            )
        grid = calibrated.wavelengths
        black, white = calibrated.problem.ground[:, 0].T
        ground = (black, white)
        read_thickness = float(f"{calibrated.thickness[0] * UNIT:.2g}")
        thicknesses = thicknesses or (
            [read_thickness]
            if film.opaque[0]
            else [0.5 * read_thickness, read_thickness, 2.0 * read_thickness]
        )
    thicknesses = thicknesses or [options.read_length("25um")]
    # The films that are asked for, by that mixing or by any.
    predict_thicknesses = partial(
        predict_mixture,
        shelf,
        recipe,
        thicknesses,
        wavelengths=grid,
        ground=ground,
        instrument=seen_with,
    )
    with progress.follow("compiling, then predicting"):
        predictions = predict_thicknesses(calibrated=calibrated)
    if out is not None:
        write_table(out, *prediction_table(predictions), overwrite=overwrite)
    eye = (illuminant, observer)
    if calibrated is not None:
        for line in report_reading(calibrated, predict_thicknesses(), predictions, eye):
            console.print(line)
    for line in report_predictions(predictions, eye, anew=calibrated is None):
        console.print(line)
    if calibrated is not None:
        from .predict.next_reading import rank_next_readings

        further = rank_next_readings(
            calibrated,
            thicknesses,
            ground=ground,
            instrument=seen_with,
            illuminant=illuminant,
            observer=observer,
        )
        best = further.films[0]
        # Repeats of one reading differ by .1 on average (Kimera's), and that is not seen.
        if further.now - best.expected < 0.2:
            console.print("No further reading would improve this much.")
        else:
            console.print(
                f"Most useful next reading: {best.film}. It would reduce the error of the films "
                f"above that comes from this mixture from ΔE00 {further.now:.1f} to "
                f"{best.expected:.1f}."
            )
    if out is not None:
        console.print(f"Wrote {out}")


def read_recipe(text: str) -> dict[str, float]:
    """Paints and weights of ``10 Vermillion + 90 ZincWhite`` or ``0.1*Vermillion + 0.9*ZincWhite``;
    one paint alone.

    Raises:
        ValueError: a part without a name, several paints of which one has no weight, or a paint
            named twice.
    """
    recipe: dict[str, float] = {}
    terms = text.split("+")
    for term in terms:
        match = _PART.fullmatch(term.strip())
        weight = match and match["weight"]
        if match is None or (weight is None and len(terms) > 1):
            raise ValueError(
                f"cannot read {term.strip()!r} in {text!r}; write '10 Vermillion + 90 ZincWhite'"
            )
        if "," in term:
            plain = re.sub(r"\s*%\s*", " ", re.sub(r"\s*,\s*", " + ", text))
            raise ValueError(
                f"there is a comma in {text!r}; between paints stands a +: write {plain!r}"
            )
        name = match["name"].strip()
        if name in recipe:
            raise ValueError(f"{name} is named twice in {text!r}; add its weights up")
        recipe[name] = 1.0 if weight is None else float(weight)
    if not sum(recipe.values()) > 0:
        raise ValueError(f"all weights in {text!r} are 0")
    return recipe


def read_mixture(
    text: str, shelf: "dict[str, Pigment]"
) -> "tuple[dict[str, float], dict[str, Pigment]]":
    """Paints of a shelf or a catalogue, by their full names, and weights; and the shelf with them.

    Raises:
        ValueError: as `read_recipe`, or a name that is not known.
    """
    recipe = read_recipe(text)
    for name in recipe:
        if len(paints := options.find_paints([name], shelf)) > 1:
            raise ValueError(
                f"{name!r} is a family of {len(paints)} paints: name one, such as "
                f"{next(iter(paints))!r}"
            )
    mixed = options.find_paints(recipe, shelf)
    if len(mixed) < len(recipe):
        raise ValueError(f"a paint is named twice in {text!r}; add its weights up")
    return dict(zip(mixed, recipe.values(), strict=True)), shelf | mixed


def read_film(
    path: Path,
    samples: str,
    paints: "Sequence[Pigment]",
    console: "Console",
    geometry: "Geometry",
    **stated: Unpack["Stated"],
) -> "tuple[Films, Float[np.ndarray, 'bands'] | None]":
    """The one film that was read, on a grid that all these paints cover, and wavelengths (nm) that
    a reading of few bands is completed at; None where it has enough for a colour. Of a file of both
    kinds of readings the geometry says which is taken.
    """
    import numpy as np

    from glazejax.spectra import common_range, lie_between

    from ..film.readers import read_loose_films
    from ..film.shared_bands import average, crop

    films = read_loose_films(path, specular=bool(geometry.sees_surface), **stated)
    if chosen := options.split_names(samples):
        films = films.select(chosen)
    if len(films) != 1:
        raise ValueError(
            f"{path}: --reading takes one film, and there are {len(films)}: choose with "
            f"--samples, from {', '.join(films.names[:8])}{' ...' if len(films) > 8 else ''}"
        )
    films = average(films)
    for paint in paints:
        grid = paint.wavelengths
        films = crop(films, grid[0], grid[-1], f"{paint.name} is known there only")
    progress.print_notes(console, path, films.notes)
    bands = films.wavelengths
    # Bands farther apart give no colour by themselves, nor do those that leave out part of 420 to
    # 680 nm.
    near = bands.size > 1 and np.diff(bands).max() <= 20.0
    if near and bands[0] <= 420.0 and bands[-1] >= 680.0:
        return films, None
    grid = paints[0].wavelengths
    return films, grid[lie_between(grid, *common_range(paint.wavelengths for paint in paints))]
