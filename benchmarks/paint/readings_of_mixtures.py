"""What one reading of a mixture shows of its other readings, and what two show of another film;
part of `benchmarks.paint.prediction`, which runs it.

One reading: each measured mixture (revigo) is calibrated by its reading over one card, with paints
of a fit that never saw it, and predicted over the other card. How far films scatter is chosen for each
by all others, by the energy score of the colours drawn (Gneiting, Raftery, J. Am. Stat. Assoc. 102
(2007) 359, eq. 21), which judges where they are and how wide.

Two readings: no mixture of the data that are at hand was read three times. So two things are stated.
Measured: one film is read, and another of the same two paints is predicted, as if more of one paint
had been added to what was read. It was mixed again, so it is as far from its recipe as any film.
Simulated: a film of each recipe, as far from it as films are taken to be, is read and predicted twice
as thick. That is as true as what is taken for granted; predicting its other card, as it is done with
measured films, shows how far.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from itertools import permutations
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int
from scipy.stats import spearmanr

from benchmarks.results import Quantity, Results, percent, progress, quantity
from glazefit.film.films import Films, card_readings
from glazefit.film.model.errors import draw_model_errors
from glazefit.film.model.response import Response, film_response
from glazefit.film.model.variation import Spread
from glazefit.recover.joint.joint import UNIT, recover_jointly
from glazefit.recover.joint.problem import model_deviation
from glazefit.recover.joint.result import JointRecovery
from glazefit.recover.predict.crossvalidation import without
from glazefit.recover.predict.mixture import (
    CLOSE,
    SMOOTH,
    calibrate_mixture,
    film_readings,
    mix,
    predict_mixture,
)
from glazefit.recover.predict.prediction import Prediction, predict_films
from glazejax import Pigment, colour

Recipes = dict[str, dict[str, float]]

# How far films may scatter, of which those that are not predicted choose. A gain that both cards share
# changes nothing here: this judges how it differs between them.
SCATTER = tuple(
    (thickness, gain) for thickness in (0.15, 0.25, 0.4) for gain in (0.005, 0.01, 0.02)
)
ALIKE = (0.0, 0.5, 0.8, 0.9)
SPREADS = tuple(Spread(*scatter, alike) for scatter in SCATTER for alike in ALIKE)
# More than as much again is another paint rather than an addition.
_MOST = 1.0
_POINTS = 241
_SPAN = 1.5
# The card that a film is read over, and what is predicted by that.
OTHER_CARD = {"white": "black by the reading over white", "black": "white by that over black"}
# Which readings of a film are given: over black, over white.
GIVEN = {"white": (False, True), "black": (True, False), "both": (True, True)}


@dataclasses.dataclass(frozen=True)
class Read:
    """One film that was left out, with paints of all others.

    Attributes:
        film: as measured.
        recipe: paint -> weight.
        shelf: paints that never saw it.
        ground: internal reflectance of its cards.
        before: what its recipe predicts, over black and white, with its thickness fitted to both.
    """

    film: Films
    recipe: dict[str, float]
    shelf: Mapping[str, Pigment]
    ground: tuple[np.ndarray, np.ndarray]
    before: np.ndarray


class Predicted(NamedTuple):
    """One card's reading, predicted by the other's: Delta E00, what was expected of it, the share of
    the readings in the 90 % band, and the energy score, a Delta E76.
    """

    off: float
    said: float
    inside: float
    score: float


def left_out_films(
    whole: JointRecovery, films: Films, recipes: Recipes, response: Response | None, every: int
) -> list[Read]:
    """Every mixture, or one in several, and the paints of a fit without it."""
    often = (whole.shares > 0).sum(axis=0)
    rows = [r for r, s in enumerate(whole.shares) if (s > 0).sum() > 1 and np.all(often[s > 0] > 1)]
    ground = card_readings(films, whole.instrument, whole.noise).ground
    found = []
    for row in rows[::every]:
        progress(f"one reading of {films.names[row]}")
        rest = without(whole, films, recipes, row, response=response)
        film = films.take([row])
        (first,) = predict_films(rest, film, recipes, response=response)
        found.append(
            Read(
                film=film,
                recipe=_parts(recipes, films.names[row]),
                shelf={paint: rest.pigment(paint, UNIT) for paint in rest.paints},
                ground=tuple(ground[row].T),
                before=first.delta_e(film.over_black[0], film.over_white[0]),
            )
        )
    return found


def _parts(recipes: Recipes, name: str) -> dict[str, float]:
    return {paint: weight for paint, weight in recipes[name].items() if weight > 0}


def calibrate(
    read: Read, seen: tuple[bool, bool], spread: Spread, response: Response | None
) -> JointRecovery:
    """The mixture by its reading over black, over white, or both."""
    return calibrate_mixture(
        read.shelf,
        read.recipe,
        dataclasses.replace(read.film, seen=np.array([seen])),
        spread=spread,
        response=response,
    )


def predict(
    read: Read,
    found: JointRecovery,
    metres: float,
    truth: tuple[np.ndarray, np.ndarray],
    spread: Spread,
    response: Response | None,
) -> list[Predicted]:
    """A film of the mixture over black and over white, compared with what it reads."""
    (then,) = predict_mixture(
        read.shelf,
        read.recipe,
        [metres],
        wavelengths=read.film.wavelengths,
        ground=read.ground,
        calibrated=found,
        response=response,
        spread=spread,
    )
    low, high = then.interval()
    return [
        Predicted(
            off=float(then.delta_e(*truth)[card]),
            said=float(then.expected_errors()[card]),
            inside=float(np.mean((low[card] <= truth[card]) & (truth[card] <= high[card]))),
            score=_energy_score(then, card, truth[card]),
        )
        for card in (0, 1)
    ]


def _energy_score(then: Prediction, card: int, truth: Float[np.ndarray, "bands"]) -> float:
    """E |X - y| - E |X - X'| / 2 of the colours drawn, in L*a*b*."""
    drawn, seen = (
        np.asarray(colour.lab(then.wavelengths, what, illuminant="D65", observer=10))
        for what in (then.draws[:, card], truth)
    )
    half = len(drawn) // 2
    apart = np.linalg.norm(drawn[:half] - drawn[half : 2 * half], axis=1).mean()
    return float(np.linalg.norm(drawn - seen, axis=1).mean() - 0.5 * apart)


def choose_without(off: Float[np.ndarray, "spreads cards films"]) -> Int[np.ndarray, "films"]:
    """For each film the spread with which all others are predicted best."""
    errors = off.mean(axis=1)
    others = errors.sum(axis=1, keepdims=True) - errors
    return others.argmin(axis=0)


def one_reading(
    say: Results, name: str, reads: Sequence[Read], response: Response | None
) -> tuple[list[str], Spread]:
    """Each mixture read over one card and predicted over the other; and the spread that most films
    choose.
    """
    tried = np.zeros((len(SPREADS), 2, len(reads), len(Predicted._fields)))
    for number, read in enumerate(reads):
        progress(f"{name}: over the other card, {read.film.names[0]}")
        truth = (read.film.over_black[0], read.film.over_white[0])
        for card, seen in enumerate((GIVEN["white"], GIVEN["black"])):
            for first, scatter in enumerate(SCATTER):
                found = calibrate(read, seen, Spread(*scatter), response)
                metres = float(found.thickness[0]) * UNIT
                for more in range(len(ALIKE)):
                    place = first * len(ALIKE) + more
                    spread = SPREADS[place]
                    predictions = predict(read, found, metres, truth, spread, response)
                    tried[place, card, number] = predictions[card]
    chosen = choose_without(tried[..., Predicted._fields.index("score")])
    lines = []
    for card, (given, words) in enumerate(OTHER_CARD.items()):
        off, said, inside, _ = tried[chosen, card, np.arange(len(reads))].T
        before = np.array([read.before[card] for read in reads])
        rank = spearmanr(off, said)[0]
        lines.append(
            f"{name}, {words}: without it {before.mean():.2f} ({np.median(before):.2f}), with "
            f"it {off.mean():.2f} ({np.median(off):.2f}), {inside.mean():.1%}, "
            f"{rank:.2f}; {sum(off > 3)} of {len(off)} above 3"
        )
        key = key_of(response, given)
        say.record(
            **mean_and_median(f"{key}_with", off),
            **{f"{key}_inside": percent(inside.mean(), n=len(off))},
        )
        if response is None:
            say.record(
                **mean_and_median(f"{key}_without", before),
                **{
                    f"{key}_rank": quantity(rank, n=len(off)),
                    f"{key}_above": quantity(sum(off > 3), digits=0, n=len(off)),
                },
            )
    often = np.bincount(chosen, minlength=len(SPREADS))
    usual = SPREADS[int(often.argmax())]
    lines.append(
        f"{name}, chosen most often: thickness {usual.thickness:g}, gain {usual.gain:g}, alike "
        f"{usual.alike:g} ({often.max()} of {len(reads)})"
    )
    return lines, usual


def key_of(response: Response | None, name: str) -> str:
    """The name that a number is recorded by: of Kubelka-Munk's optics it begins with `km_`."""
    return name if response is None else f"km_{name}"


def median(name: str, off: np.ndarray) -> dict[str, Quantity]:
    """The median of some Delta E00, to be recorded."""
    return {f"{name}_median": quantity(np.median(off), n=len(off))}


def mean_and_median(name: str, off: np.ndarray) -> dict[str, Quantity]:
    """The mean, too."""
    return {name: quantity(off.mean(), n=len(off)), **median(name, off)}


def simulated_reading(
    read: Read, spread: Spread, response: Response | None, rng: np.random.Generator
) -> tuple[Read, tuple[np.ndarray, np.ndarray], float]:
    """A film of the recipe as it may be, over the same cards; what a film of the same mixing twice
    as thick reads; and the Delta E00 between that and what it is, its own gain and errors of the
    model left out.
    """
    metres = UNIT * float(np.exp(spread.thickness * rng.standard_normal()))
    both = predict_mixture(
        read.shelf,
        read.recipe,
        [metres, 2.0 * metres],
        wavelengths=read.film.wavelengths,
        ground=read.ground,
        response=response,
    )
    # Draws are the same mixing at each thickness.
    draw = int(rng.integers(len(both[0].draws)))
    over = [film.draws[draw] for film in both]
    grid = read.film.wavelengths
    seen = []
    for exact in over:
        # Gain and model: what both cards share, and what each has of its own.
        gain = rng.standard_normal((3, 1))
        model = draw_model_errors(rng, 3, 1, grid, SMOOTH)[:, 0]
        gain, model = (
            np.sqrt(spread.alike) * part[0] + np.sqrt(1.0 - spread.alike) * part[1:]
            for part in (gain, model)
        )
        off = (CLOSE.model_floor + CLOSE.model_share * exact) * model
        seen.append(np.maximum(exact * np.exp(spread.gain * gain) + off, 0.0))
    film = dataclasses.replace(read.film, over_black=seen[0][[0]], over_white=seen[0][[1]])
    thicker = (seen[1][0], seen[1][1])
    own = colour.delta_e_of_spectra(grid, over[1], seen[1], observer=10)
    return dataclasses.replace(read, film=film), thicker, float(own.mean())


def simulated(
    say: Results, name: str, reads: Sequence[Read], spread: Spread, response: Response | None
) -> list[str]:
    """Films of the recipes as they may be: the other card, and the same mixing twice as thick."""
    rng = np.random.default_rng(5)
    other = np.zeros((2, len(reads)))
    least = np.zeros(len(reads))
    twice: dict[str, list[list[Predicted]]] = {given: [] for given in GIVEN}
    for number, read in enumerate(reads):
        progress(f"{name}: simulated, {read.film.names[0]}")
        made, thicker, least[number] = simulated_reading(read, spread, response, rng)
        for given, seen in GIVEN.items():
            found = calibrate(made, seen, spread, response)
            own = float(found.thickness[0]) * UNIT
            if not all(seen):
                truth = (made.film.over_black[0], made.film.over_white[0])
                predictions = predict(made, found, own, truth, spread, response)
                other[int(seen[0]), number] = predictions[int(seen[0])].off
            twice[given].append(predict(made, found, 2.0 * own, thicker, spread, response))
    lines = []
    for off, (given, words) in zip(other, OTHER_CARD.items(), strict=True):
        lines.append(f"{name}, the other card, {words}: {off.mean():.2f} ({np.median(off):.2f})")
        if response is None:
            say.record(**median(f"other_{given}", off))
    for given, films in twice.items():
        scores = np.array(films)
        off, said, inside, _ = np.moveaxis(scores.mean(axis=1), -1, 0)
        lines.append(
            f"{name}, twice as thick, read over {given}: {off.mean():.2f} ({np.median(off):.2f}), "
            f"{inside.mean():.1%}, {spearmanr(off, said)[0]:.2f}"
        )
        say.record(**median(key_of(response, f"twice_{given}"), off))
        if response is None and given == "both":
            held = percent(inside.mean(), n=len(off))
            say.record(twice_both_inside=held)
    lines.append(
        f"{name}, twice as thick, all known but that film's own errors: {least.mean():.2f} "
        f"({np.median(least):.2f})"
    )
    if response is None:
        say.record(**median("least", least))
    return lines


def additions(names: Sequence[str], recipes: Recipes) -> list[tuple[str, str, str, float]]:
    """Films of two paints each, of which the second is the first with more of one paint: both
    names, that paint, and how much of it to one of the first.
    """
    found = []
    for first, then in permutations(names, 2):
        one, other = _parts(recipes, first), _parts(recipes, then)
        if set(one) != set(other) or len(one) != 2:
            continue
        shares = {p: (one[p] / sum(one.values()), other[p] / sum(other.values())) for p in one}
        paint = max(one, key=lambda p: shares[p][1] - shares[p][0])
        was, becomes = shares[paint]
        amount = (becomes - was) / (1.0 - becomes)
        if 0.0 < amount <= _MOST:
            found.append((first, then, paint, amount))
    return found


def another_film(
    say: Results,
    name: str,
    whole: JointRecovery,
    films: Films,
    recipes: Recipes,
    spread: Spread,
    response: Response | None,
) -> list[str]:
    """One film read, and another of its two paints predicted from that."""
    ground = card_readings(films, whole.instrument, whole.noise).ground
    off: dict[str, list[float]] = {"nothing": [], **{given: [] for given in GIVEN}}
    pairs = additions(films.names, recipes)
    for first, then, paint, amount in pairs:
        progress(f"{name}: {then} by {first}")
        rows = [films.names.index(film) for film in (first, then)]
        rest = without(whole, films, recipes, rows, response=response)
        one, other = (films.take([row]) for row in rows)
        (before,) = predict_films(rest, other, recipes, response=response)
        truth = other.over_cards[0]
        off["nothing"].append(float(before.delta_e(*truth).mean()))
        read = Read(
            film=one,
            recipe=_parts(recipes, first),
            shelf={known: rest.pigment(known, UNIT) for known in rest.paints},
            ground=tuple(ground[rows[0]].T),
            before=np.zeros(2),
        )
        for given, seen in GIVEN.items():
            found = calibrate(read, seen, spread, response)
            made = found.pigment(found.paints[0], UNIT)
            after = mix(
                {made.name: made, paint: read.shelf[paint]},
                {made.name: 1.0, paint: amount},
                wavelengths=films.wavelengths,
            )
            seen_as = _best_thickness(
                after,
                truth,
                tuple(ground[rows[1]].T),
                whole,
                float(found.gloss[0]),
                response,
            )
            apart = colour.delta_e_of_spectra(films.wavelengths, seen_as, truth, observer=10)
            off[given].append(float(apart.mean()))
    start = np.array(off["nothing"])
    words = f"{start.mean():.2f} ({np.median(start):.2f}); {len(pairs)} pairs of films"
    lines = [f"{name}, another film, nothing read: {words}"]
    for given, values in off.items():
        say.record(**median(key_of(response, f"another_{given}"), np.array(values)))
    if response is None:
        say.record(pairs=quantity(len(pairs), digits=0))
    for given in GIVEN:
        values = np.array(off[given])
        less = np.mean(start - values)
        error = np.std(start - values, ddof=1) / np.sqrt(len(values))
        lines.append(
            f"{name}, another film, read over {given}: {np.mean(values):.2f} "
            f"({np.median(values):.2f}), less than without {less:+.2f} +- {error:.2f}"
        )
        if response is None and given == "both":
            say.record(
                another_gain=quantity(less, digits=1, n=len(pairs)),
                another_error=quantity(error, digits=1, n=len(pairs)),
            )
    return lines


def _best_thickness(
    paint: Pigment,
    truth: Float[np.ndarray, "2 bands"],
    ground: tuple[np.ndarray, np.ndarray],
    whole: JointRecovery,
    gloss: float,
    response: Response | None,
) -> Float[np.ndarray, "2 bands"]:
    """The film that is met best with its thickness alone, as `predict_films` fits it."""
    logs = np.linspace(-_SPAN, _SPAN, _POINTS)
    grid = truth.shape[1]
    spectra = film_readings(
        response or film_response(whole.instrument),
        np.stack([paint.absorption, paint.scattering]) * UNIT,
        np.broadcast_to(logs[:, None, None], (_POINTS, 2, grid)),
        ground,
    )
    spectra = spectra + gloss * whole.instrument.seen_surface
    sd = model_deviation(truth, whole.noise, whole.expectations)
    cost = np.sum(((spectra - truth) / sd) ** 2, axis=(1, 2))
    cost = cost + (logs / whole.expectations.thickness) ** 2
    return spectra[int(cost.argmin())]


def reading_tables(
    say: Results, films: Films, recipes: Recipes, models: Mapping[str, Response | None], every: int
) -> None:
    """One reading, and two, with each model of a film."""
    first: list[str] = []
    made: list[str] = []
    more: list[str] = []
    for name, response in models.items():
        whole = recover_jointly(films, recipes, response=response)
        reads = left_out_films(whole, films, recipes, response, every)
        lines, spread = one_reading(say, name, reads, response)
        first += lines
        made += simulated(say, name, reads, spread, response)
        more += another_film(say, name, whole, films, recipes, spread, response)
    progress()
    for line in (
        "ONE READING: Delta E00 over the other card, mean (median), readings in the 90 % band, and",
        "rank correlation of said and true errors; thickness, gain and how alike both cards' errors",
        "are as all other films choose by the energy score",
        *first,
        "",
        "ANOTHER FILM of the same two paints, mixed again, by readings of the first and the recipe of",
        "what was added: Delta E00 over both cards, mean (median)",
        *more,
        "",
        "SIMULATED FILMS, each optics its own truth, as far from their recipes as is expected: Delta",
        "E00, mean (median), and of films twice as thick readings in the 90 % band and rank",
        "correlation",
        *made,
    ):
        say(line)
