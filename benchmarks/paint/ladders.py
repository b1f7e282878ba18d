"""Coats of a brush: how well the next coat is predicted from the first one or two.

    python -m benchmarks.paint.ladders [--out FOLDER] [--paints N]

One coat is read, or two, and the next are predicted, each on its own ground. Simulated paints of
the catalogues: one coat's scattering times thickness e^-.3 with a spread of .6, thickness n coats
with a spread of .3, marble that is not the same everywhere, readings off by 1 %; made by glazejax,
and by Kubelka and Munk's formula with Saunderson's surface. None is measured.

Compared with Kubelka and Munk's formula in the same fits, and with 'the same as the last coat'.
CIEDE2000, means; D65, 10 degrees.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from benchmarks.kubelka_munk import KubelkaMunk
from benchmarks.results import Quantity, Results, command_line, percent, progress, quantities
from glazefit import Films
from glazefit.film.films import Noise, card_reflectance
from glazefit.film.model.response import Response, film_response
from glazefit.recover.coats.coats import predict_next_coat, recover_coats
from glazejax import catalogue
from glazejax.colour import delta_e_of_spectra
from glazejax.commands.main import start_jax
from glazejax.geometry import resolve_instrument

INSTRUMENT = resolve_instrument("45:0")
GRID = np.arange(400.0, 701.0, 10.0)
# Of a simulated coat: log of s d and its spread between paints, spread of the log of thickness.
LEVEL, LEVEL_SD, SPREAD = -0.3, 0.6, 0.3
# A reading's noise, and what its level is off: marble and coats are not the same everywhere.
NOISE, OFF = Noise(0.001, 0.003), 0.01


class Square(NamedTuple):
    """One film of a ladder, read next to its bare ground."""

    coats: float
    ground: Float[np.ndarray, "bands"]
    reading: Float[np.ndarray, "bands"]


Ladders = Mapping[str, Sequence[Square]]


class Method(NamedTuple):
    """How coats are predicted.

    `key` begins the names of what is recorded.
    """

    key: str
    title: str
    response: Response


def main() -> None:
    """Write the tables."""
    options = command_line(__doc__, paints=(40, 4, "simulated")).parse_args()
    start_jax()
    results = Results("ladders", options.out)
    optics, formula = film_response(INSTRUMENT), KubelkaMunk(INSTRUMENT)
    methods = (
        Method("", "glazejax", optics),
        Method("km_", "Kubelka-Munk", formula),
    )
    ladders = simulate(optics, options.paints)
    results.record(**report(results, "Simulated by glazejax", ladders, methods))
    report(results, "Simulated by Kubelka-Munk", simulate(formula, options.paints), methods)
    results.save()


def simulate(truth: Response, paints: int, seed: int = 0) -> Ladders:
    """Ladders of three coats of the catalogues' paints."""
    rng = np.random.default_rng(seed)
    shelf = [
        paint.resample(GRID)
        for name in ("oils", "acrylics")
        for paint in catalogue.load(name).values()
        if paint.wavelengths[0] <= GRID[0] and paint.wavelengths[-1] >= GRID[-1]
    ]
    ladders = {}
    for number in range(paints):
        paint = shelf[rng.integers(len(shelf))]
        k, s = np.asarray(paint.absorption), np.asarray(paint.scattering)
        factor = np.exp(LEVEL + LEVEL_SD * rng.standard_normal() - np.log(s).mean())
        squares = []
        for coats in (1.0, 2.0, 3.0):
            d = factor * coats * np.exp(SPREAD * rng.standard_normal())
            ground = 0.86 - 0.06 * np.exp(-(GRID - GRID[0]) / 60) + 0.01 * rng.standard_normal()
            inside = card_reflectance(ground, INSTRUMENT)[0]
            body = truth.body(np.minimum(k * d, 299.0), np.minimum(s * d, 900.0), inside)
            exact = (np.asarray(body) + INSTRUMENT.seen_surface) * np.exp(
                OFF * rng.standard_normal()
            )
            reading = exact + NOISE.sd(exact) * rng.standard_normal(GRID.size)
            squares.append(Square(coats, ground, np.clip(reading, 0.001, 0.985)))
        ladders[f"{paint.name} {number}"] = squares
    return ladders


def report(
    say: Results, title: str, ladders: Ladders, methods: Sequence[Method]
) -> dict[str, Quantity]:
    """Print a table of methods; its numbers, and the share of the second coat within the first
    method's band.
    """
    coats = ", ".join(f"{square.coats:g}" for square in next(iter(ladders.values())))
    say(f"\n{title}: {len(ladders)} paints; {coats} coats")
    say(f"{'':<38}{'2 from 1':>10}{'3 from 1':>10}{'3 from both':>13}{'in 90 % band':>22}")
    values = {}
    for method in methods:
        progress(f"{title}: {method.title}")
        cells = []
        held = []
        for known, coming in ((1, (1, 2)), (2, (2,))):
            recovery = recover_coats(
                films_of(ladders, known),
                instrument=INSTRUMENT,
                noise=NOISE,
                response=method.response,
            )
            for place in coming:
                off, inside = [], []
                for paint, squares in ladders.items():
                    square = squares[place]
                    found = predict_next_coat(recovery, paint, square.coats, square.ground)
                    low, high = found.interval()
                    off.append(float(found.delta_e(square.reading)))
                    inside.append(np.mean((square.reading >= low) & (square.reading <= high)))
                cells.append(np.mean(off))
                held.append(np.mean(inside))
        say(
            f"{method.title:<38}{cells[0]:>10.2f}{cells[1]:>10.2f}{cells[2]:>13.2f}"
            + " " * 4
            + "".join(f"{share:>6.0%}" for share in held)
        )
        values |= _of_coats(method.key, cells, len(ladders))
        if method is methods[0]:
            values["held"] = percent(held[0], n=len(ladders))
    same = [
        np.mean([_delta_e(squares[a], squares[b]) for squares in ladders.values()])
        for a, b in ((0, 1), (0, 2), (1, 2))
    ]
    say(f"{'the same as the last coat':<38}{same[0]:>10.2f}{same[1]:>10.2f}{same[2]:>13.2f}")
    return values | _of_coats("same_", same, len(ladders))


def _of_coats(key: str, three: Iterable[Any], paints: int) -> dict[str, Quantity]:
    """The second coat, the third by one, and by two, to be recorded."""
    named = (f"{key}{what}" for what in ("second", "third", "both"))
    return quantities(dict(zip(named, three, strict=True)), digits=1, n=paints)


def films_of(ladders: Ladders, known: int) -> Films:
    """The first squares of each paint."""
    rows = {
        f"{paint} {square.coats:g} coats": square
        for paint, squares in ladders.items()
        for square in squares[:known]
    }
    readings = np.stack([square.reading for square in rows.values()])
    count = len(rows)
    return Films(
        names=tuple(rows),
        wavelengths=GRID,
        bare_black=np.full(readings.shape, 0.05),
        bare_white=np.stack([square.ground for square in rows.values()]),
        over_black=readings,
        over_white=readings,
        seen=np.tile([False, True], (count, 1)),
        assumed=np.tile([True, False], (count, 1)),
    )


def _delta_e(one: Square, other: Square) -> float:
    return float(delta_e_of_spectra(GRID, one.reading, other.reading, observer=10))


if __name__ == "__main__":
    main()
