"""Own tubes: what a masstone and one tint show of a paint, on simulated films and on measured ones.

    python -m benchmarks.paint.tubes [--out FOLDER] [--paints N]

Noise not stated: films of the catalogue's paints with a noise of .002, film by film; do 90 % intervals
hold k and s where both are separated? Tubes, simulated: a masstone and a 1:10 tint with a zinc
white that is the catalogue's but for its own errors, thicknesses unknown, noise .002 not stated; do the
entry's 90 % intervals hold k and s, and how far off is a 1:3 tint that was not fitted? Tubes,
measured (revigo): the masstone and the white tint of one paint, with zinc white and bone black as a
fit of all other paints' films knows them; the paint's other tints and shades are predicted, and by
the joint fit of all films but that one. Times are those of this process.
"""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from benchmarks.measured import FEW, measured_films
from benchmarks.results import Results, command_line, ends, percent, progress, quantities, quantity
from benchmarks.timing import time_call
from glazefit import Films, Instrument, Noise, recover_films, simulate_films
from glazefit.film.films import usual_cards
from glazefit.film.readers import is_masstone, recipes_from_names
from glazefit.film.simulate import simulate_paints
from glazefit.recover.joint.entries import entries
from glazefit.recover.joint.joint import UNIT, recover_jointly
from glazefit.recover.joint.pose import error_modes
from glazefit.recover.joint.result import JointRecovery
from glazefit.recover.predict.crossvalidation import cross_validate
from glazefit.recover.predict.next_reading import rank_next_films
from glazefit.recover.predict.prediction import predict_films
from glazejax import Pigment, catalogue
from glazejax.commands.main import start_jax
from glazejax.spectra import describe_grid

NEEDS = ("data/revigo",)

NOISE = Noise(0.002, 0.0)
LEVEL = 1.645
# Simulations of each paint, its instruments, and measured paints at most.
SEEDS, INSTRUMENTS, MEASURED = 3, ("d:8", "45:0"), 100
# Measured films are those of these paints, of all if none is named.
SHELF: tuple[str, ...] = ()
WHITE, BLACK = "ZincWhite", "BoneBlack"


def film_by_film(say: Results) -> None:
    """Coverage where noise is stated, stated wrongly, and not stated."""
    times = {1: "once", 3: "three times"}[SEEDS]
    say(
        f"\nFilm by film, all paints of the catalogue, {times}: 90 % intervals where the noise "
        f"is {NOISE.floor}\n"
        f"{'':<32}{'bands separated':>18}{'k held':>9}{'s held':>9}"
    )
    paints = list(catalogue.load().values())
    truth = np.stack([np.stack([p.absorption, p.scattering], axis=-1) for p in paints]) * UNIT
    for words in INSTRUMENTS:
        instrument = Instrument.parse(words)
        measured = [
            simulate_paints(paints, UNIT, instrument=instrument, noise=NOISE, seed=seed)
            for seed in range(SEEDS)
        ]
        for key, title, noise in (
            ("untold", "nothing stated", None),
            ("usual", "stated .0005 + .002 R", Noise()),
            ("told", "stated .002", NOISE),
        ):
            held = []
            for films in measured:
                found = recover_films(films, instrument=instrument, noise=noise)
                low, high = found.interval(LEVEL)
                held.append(((truth >= low) & (truth <= high))[found.identifiable])
            k, s = np.concatenate(held).mean(axis=0)
            say(f"{words + ', ' + title:<32}{sum(map(len, held)):>18}{k:>9.1%}{s:>9.1%}")
            if words == INSTRUMENTS[0]:
                say.record(**quantities({f"{key}_k": 100 * k, f"{key}_s": 100 * s}, "%", 0))


class Case(NamedTuple):
    """What is measured of a tube: the instrument, and which rows there are; and by what name the
    error of its tint is recorded, if it is.
    """

    words: str
    instrument: str
    cards: bool
    opaque: bool
    tint: str = ""


CASES = (
    Case("d:8, both cards, bare cards too", "d:8", True, False, "tint"),
    Case("de:8, both cards, bare cards too", "de:8", True, False),
    Case("45:0, both cards, bare cards too", "45:0", True, False),
    Case("45:0, over white only, card not measured", "45:0", False, False, "one_card_tint"),
    Case("d:8, opaque films", "d:8", True, True, "opaque_tint"),
)


class Tube(NamedTuple):
    """One simulated tube: its films, the last of which is kept aside, and its true k d and s d for
    unit thickness.
    """

    films: Films
    recipes: dict[str, Any]
    truth: np.ndarray


def tube(paint: Pigment, white: Pigment, case: Case, seed: int) -> Tube:
    """Films of a paint and a white that is off by its error modes."""
    rng = np.random.default_rng(seed)
    modes = error_modes(white)
    off = np.einsum("m,mcb->cb", rng.standard_normal(len(modes)), modes)
    pale = np.stack([white.absorption, white.scattering]) * UNIT * np.exp(off)
    full = np.stack([paint.absorption, paint.scattering]) * UNIT
    shares = np.array([1.0, 1 / 11, 1 / 4])
    thickness = np.exp(0.5 * rng.standard_normal() + 0.3 * rng.standard_normal(3))
    if case.opaque:
        thickness[:2] = 400.0
    mixed = shares[:, None, None] * full + (1 - shares)[:, None, None] * pale
    k, s = np.moveaxis(mixed * thickness[:, None, None], 1, 0)
    names = (paint.name, f"{paint.name} 1:10 {WHITE}", f"{paint.name} 1:3 {WHITE}")
    # As thick as the solver's table goes, at the same albedo.
    less = np.minimum(1.0, np.minimum(250.0 / k, 900.0 / s))
    k, s = k * less, s * less
    films = simulate_films(
        paint.wavelengths,
        k,
        s,
        names=names,
        instrument=Instrument.parse(case.instrument),
        noise=NOISE,
        seed=seed,
    )
    seen, assumed, opaque = np.ones((3, 2), bool), np.zeros((3, 2), bool), np.zeros(3, bool)
    if not case.cards:
        seen[:2, 0], assumed[:2] = False, True
    opaque[:2] = case.opaque
    bare = [films.bare_black, films.bare_white]
    if not case.cards:
        # The card that is assumed is not quite the one below the paint.
        odds = np.exp(0.4 * rng.standard_normal(2))
        usual = [
            card * o / (1 - card + card * o)
            for card, o in zip(usual_cards(films.wavelengths), odds, strict=True)
        ]
        bare = [np.where(assumed[:, i, None], usual[i], bare[i]) for i in range(2)]
    cards = {"bare_black": bare[0], "bare_white": bare[1]}
    films = replace(films, **cards, seen=seen, assumed=assumed, opaque=opaque)
    return Tube(films, dict(recipes_from_names(names, {})), full)


def simulated(say: Results, count: int) -> None:
    """Coverage of entries of simulated tubes, and a tint that was not fitted."""
    shelf = catalogue.load()
    white = shelf[WHITE]
    paints = [paint for name, paint in shelf.items() if name != WHITE][:count]
    grid = describe_grid(white.wavelengths)
    say(
        f"\nSimulated tubes: {len(paints)} paints, a masstone and a 1:10 tint with {WHITE}, {grid}\n"
        f"{'':<44}{'90 % intervals':>18}{'1:3 tint kept aside':>34}{'seconds':>9}\n"
        f"{'':<44}{'k held':>9}{'s held':>9}{'dE00':>8}{'predicted':>10}{'in 90 % band':>16}{'a paint':>9}"
    )
    known = []
    for case in CASES:
        instrument = Instrument.parse(case.instrument)
        held = []
        off = []
        said = []
        inside = []
        seconds = []
        for seed, paint in enumerate(paints):
            made = tube(paint, white, case, seed)
            (found, entry), taken = time_call(
                lambda m=made, i=instrument: recovered(m, {WHITE: white}, i)
            )
            seconds.append(taken)
            held.append(within(entry, made.truth))
            (third,) = predict_films(found, made.films.take([2]), made.recipes, noise=NOISE)
            measured = made.films.over_cards[2]
            low, high = third.interval()
            off.append(third.delta_e(*measured).mean())
            said.append(third.expected_error())
            inside.append(np.mean((low <= measured) & (measured <= high)))
        k, s = np.mean(held, axis=(0, 2))
        say(
            f"{case.words:<44}{k:>9.1%}{s:>9.1%}{np.mean(off):>8.2f}{np.mean(said):>10.2f}{np.mean(inside):>16.1%}"
            f"{np.median(seconds):>9.2f}"
        )
        if case.cards and not case.opaque:
            known += [100 * k, 100 * s]
        if case.tint:
            say.record(**{case.tint: quantity(np.mean(off), digits=1, n=len(paints))})
        if not case.cards:
            say.record(**quantities({"one_card_k": 100 * k, "one_card_s": 100 * s}, "%", 0))
    say.record(**quantities(ends("held", known), "%", 0))


def recovered(
    made: Tube, known: dict[str, Pigment], instrument: Instrument | None = None
) -> tuple[JointRecovery, Pigment]:
    """The fit of a tube's masstone and tint, and the entry of its paint."""
    films = made.films.take([0, 1])
    found = recover_jointly(films, made.recipes, instrument=instrument, pigments=known)
    return found, entries(found, {})[0]


def within(entry: Pigment, truth: np.ndarray) -> np.ndarray:
    """Whether an entry's 90 % intervals hold k and s, (2, bands)."""
    values = np.stack([entry.absorption, entry.scattering]) * UNIT
    sd = (
        np.stack([np.asarray(entry.absorption_sd), np.asarray(entry.scattering_sd)]) * UNIT / values
    )
    return np.abs(np.log(values / truth)) <= LEVEL * sd


def real(say: Results) -> None:
    """Measured paints: masstone and white tint in, other films out."""
    films, recipes = measured_films(SHELF)
    whole = recover_jointly(films, recipes)
    tubes = dict(list(paints_with_a_tint(films, recipes).items())[:MEASURED])
    others = {name for rows in tubes.values() for name in rows[2:]}
    full = cross_validate(
        whole,
        films,
        recipes,
        only=lambda name: name in others,
        progress=lambda *step: progress(step[2]),
    )
    full_off = dict(zip(full.names, full.predicted.mean(axis=1), strict=True))
    say(
        f"\nMeasured tubes (revigo): {len(tubes)} paints, masstone and white tint fitted, "
        f"{len(others)} films predicted\n"
        f"{'':<46}{'dE00 of the tube':>18}{'predicted':>10}{'in 90 % band':>14}{'joint fit of all others':>26}"
    )
    rows, sums = [], []
    for paint, names in tubes.items():
        progress(paint)
        use = np.array([paint not in recipes[name] for name in films.names], dtype=float)
        rest = recover_jointly(films, recipes, use=use, start=whole.unknowns)
        known = {
            name: rest.pigment(name, UNIT, "all other paints' films") for name in (WHITE, BLACK)
        }
        own = films.select(names)
        found = recover_jointly(
            own, recipes, pigments=known, use=np.array([1.0, 1.0] + [0.0] * (len(names) - 2))
        )
        for guess in predict_films(found, own.take(list(range(2, len(names)))), recipes):
            row = films.names.index(guess.name)
            measured = films.over_cards[row]
            low, high = guess.interval()
            inside = np.mean((low <= measured) & (measured <= high))
            off = guess.delta_e(*measured).mean()
            recipe = " + ".join(
                f"{weight:g} {part}" for part, weight in recipes[guess.name].items()
            )
            title = f"{guess.name} {recipe}"
            other = full_off[guess.name]
            rows.append(
                f"{title:<46}{off:>18.2f}{guess.expected_error():>10.2f}{inside:>14.0%}{other:>26.2f}"
            )
            sums.append((off, guess.expected_error(), inside, full_off[guess.name]))
    progress()
    for row in rows:
        say(row)
    mean, median = np.mean(sums, axis=0), np.median(sums, axis=0)
    say(
        f"{'mean':<46}{mean[0]:>18.2f}{mean[1]:>10.2f}{mean[2]:>14.0%}{mean[3]:>26.2f}\n"
        f"{'median':<46}{median[0]:>18.2f}{median[1]:>10.2f}{median[2]:>14.0%}{median[3]:>26.2f}"
    )
    say.record(
        in_band=percent(mean[2], n=len(sums)),
        **quantities({"measured": mean[0], "joint": mean[3]}, digits=1, n=len(sums)),
        **quantities(
            {"measured_median": median[0], "joint_median": median[3]}, digits=1, n=len(sums)
        ),
    )


def paints_with_a_tint(films: Films, recipes: dict[str, dict[str, float]]) -> dict[str, list[str]]:
    """Paint -> its masstone, its tint with most white that is not above 92 %, and its other films,
    if there are any.
    """
    found: dict[str, list[str]] = {}
    for name in films.names:
        if is_masstone(recipes[name]) and (paint := next(iter(recipes[name]))) not in (
            WHITE,
            BLACK,
        ):
            mine = [other for other in films.names if paint in recipes[other] and other != name]
            mine = [other for other in mine if set(recipes[other]) <= {paint, WHITE, BLACK}]
            tints = [other for other in mine if 85 < recipes[other].get(WHITE, 0.0) < 95]
            if tints and len(mine) > 1:
                found[paint] = [name, tints[0], *(other for other in mine if other != tints[0])]
    return found


def seconds(say: Results) -> None:
    """Time of an entry with its errors; that of the command: `benchmarks.cold_start`."""
    made = tube(catalogue.pigment("CobaltBlue"), catalogue.pigment(WHITE), CASES[0], 1)
    known = {WHITE: catalogue.pigment(WHITE)}
    (found, _), fit = time_call(lambda: recovered(made, known))
    rank_next_films(found, "CobaltBlue")
    taught, after = time_call(lambda: rank_next_films(found, "CobaltBlue"))
    best = taught.films[0]
    say(
        f"\nAn entry with its error modes, in a running process: {fit:.2f} s; what to measure "
        f"next: {after:.2f} s"
    )
    say.record(**quantities({"entry_seconds": fit, "advice_seconds": after}, "s"))
    say(f"   ({best.film}: dE00 {taught.now:.2f} -> {best.expected:.2f})")


def written(films: Films) -> str:
    """Films as a table."""
    rows = [["Name", *(f"{w:g}" for w in films.wavelengths)]]
    ends = {
        "b": films.bare_black,
        "w": films.bare_white,
        "ob": films.over_black,
        "ow": films.over_white,
    }
    for i, name in enumerate(films.names):
        rows += [
            [f"{name}_{end}", *(f"{v:.5f}" for v in values[i])] for end, values in ends.items()
        ]
    return "\n".join(",".join(row) for row in rows) + "\n"


def main() -> None:
    paints = (100, 2, "simulated tubes, at most")
    options = command_line(__doc__, paints=paints).parse_args()
    if options.quick:
        globals().update(
            SEEDS=1,
            INSTRUMENTS=("d:8",),
            MEASURED=1,
            CASES=(CASES[0], *CASES[3:]),
            SHELF=FEW,
        )
    start_jax()
    results = Results("tubes", options.out)
    results("Own tubes: a masstone and a tint with a known white")
    simulated(results, options.paints)
    real(results)
    film_by_film(results)
    seconds(results)
    results.save()


if __name__ == "__main__":
    main()
