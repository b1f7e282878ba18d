"""Films left out in turn, predicted from their weights with only the thickness free: this model and
Kubelka-Munk's.

    python -m benchmarks.paint.prediction [--out FOLDER] [--scan | --readings]

Every tint and shade of the measured films (revigo) is left out of a joint fit of all the others and
then predicted, with a 90 % band as wide as the other films left out say. Both models go through the
same fit, with the same instrument and expectations; only what one film reflects differs. Films
of the same recipes are simulated too, faultless and with scatter of strength. What one reading of a mixture shows, and what two do, is a result of its own,
`prediction_readings.txt` (see `readings_of_mixtures.py`); with --readings it is made alone. With --scan,
what is expected a priori is varied instead.
"""

import dataclasses
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from scipy.stats import spearmanr

from benchmarks.kubelka_munk import KubelkaMunk
from benchmarks.measured import FEW, measured_films
from benchmarks.paint.readings_of_mixtures import reading_tables
from benchmarks.results import Results, command_line, percent, progress, quantities, quantity
from benchmarks.timing import time_call
from glazefit.film.films import Films, Instrument, Noise
from glazefit.film.simulate import simulate_films
from glazefit.recover.joint.joint import UNIT, recover_jointly
from glazefit.recover.joint.problem import Expectations
from glazefit.recover.predict.crossvalidation import LeftOut, cross_validate
from glazejax import catalogue
from glazejax.commands.main import start_jax

NEEDS = ("data/revigo",)

Recipes = dict[str, dict[str, float]]

# One expectation at a time is changed from what it is by default.
# Each mixture is left out; of a quick run one in several.
EVERY = 1
SCAN: tuple[dict[str, Any], ...] = (
    {},
    {"model_floor": 0.002, "model_share": 0.008},
    {"model_floor": 0.005, "model_share": 0.02},
    {"model_floor": 0.02, "model_share": 0.08},
    {"thickness": 0.15},
    {"thickness": 0.45},
    {"tail": 100.0},
    {"curvature_k": 0.15, "curvature_s": 0.05},
    {"curvature_k": 0.6, "curvature_s": 0.2},
    {"level_k": (0.0, 2.0), "level_s": (1.0, 1.0)},
    {"level_k": (-2.0, 0.7), "level_s": (0.0, 0.7)},
    {"level_k": (0.0, 6.0), "level_s": (1.0, 3.0)},
    {"gloss": 0.1, "paint_gloss": 0.1},
    {"weight_share": 0.1},
    {"weight_share": 0.3, "tail": 100.0},
)


@dataclasses.dataclass(frozen=True)
class Scores:
    """Films left out, and the seconds that the fit of all films took, first and again (nan if it
    was fitted once).
    """

    out: LeftOut
    seconds: float
    warm: float


def mixtures(names: Sequence[str], recipes: Recipes) -> list[str]:
    """Names of films of several paints: a masstone says nothing of how paints mix."""
    return [name for name in names if sum(weight > 0 for weight in recipes[name].values()) > 1]


def leave_out(
    films: Films, recipes: Recipes, name: str, again: bool = True, **given: Any
) -> Scores:
    """Fit all films, twice for the time if asked, and leave out every mixture in turn."""
    whole, seconds = time_call(lambda: recover_jointly(films, recipes, **given))
    warm = float("nan")
    if again:
        _, warm = time_call(lambda: recover_jointly(films, recipes, **given))

    def show(done: int, total: int | None, words: str) -> None:
        progress(f"{name}: {words}")

    chosen = mixtures(films.names, recipes)[::EVERY]
    out = cross_validate(
        whole, films, recipes, only=lambda film: film in chosen, progress=show, **given
    )
    return Scores(out, seconds, warm)


def kinds(films: tuple[str, ...], recipes: Recipes) -> dict[str, np.ndarray]:
    """Which films are of a kind."""
    eosin = np.array(["Eosin" in " ".join(recipes[name]) for name in films])
    shade = np.array(
        [
            min(recipes[name], key=lambda paint: recipes[name][paint]) == "BoneBlack"
            for name in films
        ]
    )
    return {
        "all": np.ones(len(films), bool),
        "without eosins": ~eosin,
        "tints": ~shade,
        "shades": shade,
    }


def simulated(films: Films, recipes: Recipes, scatter: float, seed: int = 4) -> Films:
    """Films of the same recipes from the catalogue's paints; their thickness and their paints'
    strength scatter.
    """
    shelf, grid, rng = catalogue.load(), films.wavelengths, np.random.default_rng(seed)
    k, s = np.zeros((2, len(films), grid.size))
    for row, name in enumerate(films.names):
        total, thickness = sum(recipes[name].values()), UNIT * np.exp(0.25 * rng.standard_normal())
        for paint, weight in recipes[name].items():
            amount = weight / total * thickness * np.exp(scatter * rng.standard_normal())
            k[row] += amount * np.asarray(shelf[paint].absorption)
            s[row] += amount * np.asarray(shelf[paint].scattering)
    return simulate_films(grid, k, s, names=films.names, noise=Noise(), seed=seed)


def simulated_table(say: Results, films: Films, recipes: Recipes) -> None:
    """How well simulated films are predicted, and how well their bands say so."""
    say(
        "SIMULATED FILMS of the same recipes, mixtures left out\n"
        "scatter of strength   mean  median  said  in band"
    )
    for scatter in (0.0, 0.2):
        out = leave_out(
            simulated(films, recipes, scatter), recipes, f"simulated, {scatter:.0%}"
        ).out
        off = out.predicted.mean(axis=1)
        said = out.expected.mean()
        say(
            f"{scatter:>19.0%}{off.mean():>7.2f}{np.median(off):>8.2f}{said:>6.2f}{out.inside.mean():>9.1%}"
        )
        values = {"simulated": off.mean(), "simulated_median": np.median(off)}
        if scatter:
            values = {"scattered": off.mean()}
        else:
            say.record(simulated_said=quantity(said, digits=1, n=len(off)))
        say.record(**quantities(values, n=len(off)))


def table(say: Results, scores: dict[str, Scores], recipes: Recipes) -> None:
    """Means over films of several kinds, and every film."""
    outs = [one.out for one in scores.values()]
    some = outs[0]

    def row(words: str, cells: Iterable[str]) -> None:
        say(f"{words:<46}" + "".join(f"{cell:>24}" for cell in cells))

    row("mean Delta E00 (D65, 10 deg), both cards", scores)
    row("", ["fitted  left out"] * len(scores))
    for kind, chosen in kinds(some.names, recipes).items():
        row(
            f"{kind:<16} {chosen.sum():>3} films",
            (f"{o.fitted[chosen].mean():.2f}      {o.predicted[chosen].mean():.2f}" for o in outs),
        )
    row(
        "median, all",
        (f"{np.median(out.fitted):.2f}      {np.median(out.predicted):.2f}" for out in outs),
    )
    apart = [(out.predicted - some.predicted).mean(axis=1) for out in outs]
    row(
        "difference to the first, film by film",
        (f"{d.mean():+.2f} +- {d.std(ddof=1) / np.sqrt(d.size):.2f}" for d in apart),
    )
    row("readings within the 90 % band", (f"{out.inside.mean():.1%}" for out in outs))
    ranks = [spearmanr(out.expected, out.predicted.mean(axis=1))[0] for out in outs]
    row("rank correlation of said and true errors", (f"{rank:.2f}" for rank in ranks))
    row(
        "Delta E00 that predictions say of themselves",
        (f"{out.expected.mean():.2f}" for out in outs),
    )
    say()
    row(
        "fit of all films, seconds (first; compiled)",
        (f"{one.seconds:.1f}; {one.warm:.1f}" for one in scores.values()),
    )
    say(
        "\neach film left out: Delta E00 over black and white, and (what the prediction says of "
        "itself)"
    )
    for i, name in enumerate(some.names):
        recipe = " + ".join(
            f"{weight:g} {paint}" for paint, weight in recipes[name].items() if weight > 0
        )
        cells = (
            f"{o.predicted[i, 0]:.2f}  {o.predicted[i, 1]:.2f} ({o.expected[i]:.1f})" for o in outs
        )
        row(f"{name:<5}{recipe}", cells)
    theirs = scores["Kubelka-Munk"].out.predicted
    films = len(some.names)
    means = {
        "fitted": some.fitted.mean(),
        "left_out": some.predicted.mean(),
        "kubelka_munk": theirs.mean(),
        "correlation": ranks[0],
    }
    others = {
        "median": np.median(some.predicted),
        "kubelka_munk_median": np.median(theirs),
        "said": some.expected.mean(),
    }
    say.record(
        **quantities(means, n=films),
        **quantities(others, digits=1, n=films),
        in_band=percent(some.inside.mean(), n=films),
        films=quantity(films, digits=0),
    )


def scan(say: Results, films: Films, recipes: Recipes) -> None:
    """Prediction errors as expectations vary, a line each."""
    say("Delta E00 of films left out       mean  median  tints  shades  fitted  in 90 % band")
    for changed in SCAN:
        name = ", ".join(f"{key} {value}" for key, value in changed.items()) or "as by default"
        out = leave_out(films, recipes, name, again=False, expectations=Expectations(**changed)).out
        of = kinds(out.names, recipes)
        off = out.predicted.mean(axis=1)
        say(
            f"{off.mean():>38.2f}{np.median(off):>8.2f}{off[of['tints']].mean():>7.2f}"
            f"{off[of['shades']].mean():>8.2f}{out.fitted.mean():>8.2f}{out.inside.mean():>14.1%}   {name}"
        )
    progress()


def compare(say: Results, films: Films, recipes: Recipes) -> None:
    """Models side by side, and simulated films."""
    models: dict[str, dict[str, Any]] = {
        "glazejax": {},
        "Kubelka-Munk": {"response": KubelkaMunk(Instrument())},
    }
    scores = {name: leave_out(films, recipes, name, **given) for name, given in models.items()}
    progress()
    table(say, scores, recipes)
    say()
    simulated_table(say, films, recipes)
    progress()


def main() -> None:
    parser = command_line(__doc__)
    alone = parser.add_mutually_exclusive_group()
    alone.add_argument("--scan", action="store_true", help="vary what is expected a priori")
    alone.add_argument("--readings", action="store_true", help="what one reading shows, and two")
    options = parser.parse_args()
    if options.quick:
        globals().update(EVERY=2)
    start_jax()
    films, recipes = measured_films(FEW if options.quick else ())
    if options.scan:
        results = Results("prediction_scan", options.out)
        scan(results, films, recipes)
        results.save()
        return
    models = {"glazejax": None, "Kubelka-Munk": KubelkaMunk(Instrument())}
    results = Results("prediction_readings", options.out)
    reading_tables(results, films, recipes, models, EVERY)
    results.save()
    if not options.readings:
        results = Results("prediction", options.out)
        compare(results, films, recipes)
        results.save()


if __name__ == "__main__":
    main()
