"""``glazejax recipe --after READING``: a mixture came out like this; what is to be added?"""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from glazejax.commands import progress

if TYPE_CHECKING:
    from rich.console import Console

    from glazejax import Pigment
    from glazejax.commands.options import Ground
    from glazejax.geometry import Instrument
    from glazejax.io.quantity import Stated

    from .targets import Target


def say_addition(
    target: "Target",
    reading: Path,
    mixed: str,
    batch: float | None,
    *,
    samples: str,
    stated: "Stated",
    shelf: "dict[str, Pigment]",
    paints: "Sequence[Pigment]",
    ground: "Ground",
    instrument: "Instrument",
    eye: tuple[str, str],
    console: "Console",
) -> None:
    """Calibrate the mixture by its reading, and say what to add.

    Args:
        target: to search for.
        reading: file of one film of the mixture, of many bands or of few.
        mixed: paints and weights of it.
        batch: grams of it; None if the weights are grams.
        samples: name of the film, if the file has several.
        stated: what the user says of the file's quantity and units.
        shelf: paints by name.
        paints: that may be added.
        ground: below the film.
        instrument: of the reading, and of the colour.
        eye: illuminant and observer.
        console: to print to.
    """
    from glazejax.report import plain_table

    from ..recover.predict.mixture import calibrate_mixture
    from ..recover.predict_command import read_film, read_mixture
    from .addition import next_addition
    from .report import in_painters_terms

    recipe, mixture_paints = read_mixture(mixed, shelf)
    mass = sum(recipe.values()) if batch is None else batch
    mixed_paints = [mixture_paints[name] for name in recipe]
    film, wavelengths = read_film(
        reading, samples, mixed_paints, console, instrument.geometry, **stated
    )
    with progress.follow("compiling, then fitting the reading") as report:
        calibrated = calibrate_mixture(
            mixture_paints,
            recipe,
            film,
            instrument=instrument,
            wavelengths=wavelengths,
            progress=report,
        )
        addition = next_addition(
            calibrated,
            target,
            paints,
            mass,
            ground=ground.on(calibrated.wavelengths),
            instrument=instrument,
            illuminant=eye[0],
            observer=eye[1],
        )
    table = plain_table("", "L*", "a*", "b*", "ΔE00 to the target", words=(0,))
    rows = [("as it came out", addition.lab_before, addition.before)]
    if addition.grams:
        rows.append(("after the addition", addition.lab_after, addition.after))
    for label, lab, distance in rows:
        table.add_row(label, *(f"{value:.1f}" for value in lab), f"{distance:.1f}")
    console.print(table)
    console.print(f"Read by, and seen by, {instrument.describe()} (--instrument).", style="dim")
    if not addition.grams:
        console.print(
            f"Add nothing: none of these paints, nor two of them, brings it nearer than ΔE00 "
            f"{addition.before:.1f} by as much as can be seen."
        )
        return
    amounts = " and ".join(
        f"{float(f'{grams:.2g}'):g} g {paint}" for paint, grams in addition.grams.items()
    )
    console.print(
        f"Add {amounts} to {addition.batch:g} g of it, weighed as they come from the tube. Expect "
        f"ΔE00 {addition.after:.1f} from the target, give or take {addition.expected:.1f}."
    )
    if addition.expected > addition.before - addition.after:
        console.print("Add half of it first, and read again: more cannot be taken out.")
    if addition.thickness is not None:
        console.print(
            f"Of a film as thick as that of {reading.name}: "
            f"{in_painters_terms(addition.thickness)}.",
            style="dim",
        )
