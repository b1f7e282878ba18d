"""`glazejax recover` where films are coats of a brush: what is given, and what comes of it."""

import time
from typing import TYPE_CHECKING, Any

import numpy as np

from glazejax.commands import progress
from glazejax.paint.describe import format_length

if TYPE_CHECKING:
    from ..film.films import Films
    from .settings import Destination


def are_coats(films: "Films", refused: dict[str, Any]) -> bool:
    """True if the films of a table are coats, by their names.

    Args:
        films: as read.
        refused: option -> what was given, of options that are not for coats.

    Raises:
        ValueError: some are and some are not, or an option was given that is not for coats.
    """
    from .coats.coats import coat_of

    named = [name for name in films.names if coat_of(name)]
    if not named:
        return False
    other_film = next((name for name in films.names if not coat_of(name)), None)
    if other_film is not None:
        raise ValueError(
            f"{named[0]!r} is a film of coats and {other_film!r} is not: put coats into a table of "
            "their own, each film called 'PAINT 1 coat', 'PAINT 2 coats', ..."
        )
    for option, value in refused.items():
        if value:
            raise ValueError(f"{option} is not for coats, such as {named[0]!r}; leave it out")
    return True


def recover_from_coats(films: "Films", fit_options: dict[str, Any], results: "Destination") -> None:
    """Recover paints from their coats, and predict the next ones.

    Args:
        films: as read.
        fit_options: instrument and noise.
        results: where they go.
    """
    import equinox as eqx

    from ..film.shared_bands import average
    from .coats.coats import predict_next_coat, recover_coats
    from .show.plots import plot_ladder
    from .show.report import coat_table, next_coat_table, report_coats

    metres = results.thickness
    console = results.console
    fitted = average(films)
    progress.print_notes(console, "films", fitted.notes[len(films.notes) :])
    with progress.follow("compiling, then fitting the coats of each paint") as note:
        began = time.perf_counter()
        recovery = recover_coats(fitted, progress=note, **fit_options)
        predictions = []
        for paint in recovery.paints:
            last = recovery.thickest(paint)
            predictions += [
                predict_next_coat(recovery, paint, np.floor(last.coats) + extra, last.ground)
                for extra in (1.0, 2.0)
            ]
        seconds = time.perf_counter() - began
    for line in report_coats(recovery, predictions, seconds):
        console.print(line)
    console.print(f"In pigments.csv a coat is taken as {format_length(metres)}.")
    names = list(recovery.paints)
    results.write(
        [
            eqx.tree_at(lambda paint: paint.error_modes, fit.pigment(name, metres), None)
            for name, fit in recovery.paints.items()
        ],
        {"films.csv": coat_table(recovery), "next_coats.csv": next_coat_table(predictions)},
        names,
        lambda number, path: plot_ladder(recovery, predictions, names[number], path),
    )
