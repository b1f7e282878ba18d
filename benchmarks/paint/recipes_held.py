"""Do error bars hold on measured paint? Recipes of measured mixtures in 90 % intervals.

    python -m benchmarks.paint.recipes_held [--seed 0] [--out FOLDER]

Each mixture of two paints of the measured films (revigo) is left out of a joint fit of all others,
which gives k and s of its paints. `posterior_of_film` and `identify_films` then estimate its
fractions, given which paints it holds. What was weighed is the truth. The same intervals without the
strengths of paints, which differ from film to film, hold what the readings alone leave open.

How strength scatters was learnt from these films, those left out among them.

Then the twelve samples, their paints and, for `recover_jointly`, their recipes known: the standard
deviation of the log thickness that each of the three tasks states, from one prior. The true thickness
is not known.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from benchmarks.measured import FEW, measured_films
from benchmarks.results import Results, command_line, progress, quantities, quantity
from glazefit import (
    Candidate,
    Films,
    Prior,
    identify_films,
    posterior_of_film,
    read_films,
    recover_jointly,
)
from glazefit.recover.joint.joint import UNIT
from glazefit.recover.joint.problem import Expectations
from glazefit.recover.predict.crossvalidation import without
from glazejax import Pigment, catalogue, samples
from glazejax.commands.main import start_jax

NEEDS = ("data/revigo",)


class Interval(NamedTuple):
    """Of the log of the ratio of two paints: 90 %."""

    low: float
    high: float


def log_ratio(shares: np.ndarray) -> np.ndarray:
    """Of the first paint's fraction to the second's, (...)."""
    return np.log(shares[0] / shares[1])


def by_posterior(film: Films, paints: list[Pigment], seed: int) -> tuple[Interval, Interval]:
    """With strengths, and without."""
    posterior = posterior_of_film(film, paints, seed=seed)

    def interval(draws: Mapping[str, np.ndarray]) -> Interval:
        ratio = log_ratio(np.stack([draws[f"fraction {paint.name}"] for paint in paints]))
        return Interval(*np.percentile(ratio, [5.0, 95.0]))

    return interval(posterior.draws), interval(posterior.problem.shown(posterior.free))


def searched(film: Films, paints: list[Pigment]) -> Candidate | None:
    """The candidate of these paints alone and all of them; None where it is not listed."""
    options = {"own_films": True, "varnish": "none", "prior": Prior(concentration=1.0)}
    names = {paint.name for paint in paints}
    candidates = identify_films(film, paints, **options).ranked(0)
    return next((c for c in candidates if set(c.paints) == names), None)


def by_search(film: Films, paints: list[Pigment]) -> Interval | None:
    """Of `identify_films`."""
    candidate = searched(film, paints)
    if candidate is None:
        return None
    # The first paint at one end is the second at the other.
    first = candidate.fractions_90[candidate.paints.index(paints[0].name)]
    return Interval(*np.log(first / (1.0 - first)))


def spreads(say: Results) -> None:
    """Standard deviations of the log thickness of the twelve samples, by task."""
    films, recipes, oils = read_films(samples.path()), samples.recipes(), catalogue.load("oils")
    expected = Expectations(thickness=Prior().spread, scale=0.01)
    recovery = recover_jointly(films, recipes, pigments=oils, expectations=expected)
    recovered = recovery.thickness_sd / recovery.thickness
    say("\nStandard deviation of log thickness\n        recover   identify  posterior")
    alike = 0
    for row, name in enumerate(films.names):
        film, paints = films.take([row]), [oils[paint] for paint in recipes[name]]
        candidate = searched(film, paints)
        assert candidate is not None
        thickness = posterior_of_film(film, paints).draws["thickness"]
        stated = np.array(
            [
                recovered[row],
                candidate.thickness_sd / candidate.thickness,
                np.log(thickness).std(),
            ]
        )
        alike += bool(stated.max() <= 1.1 * stated.min())
        say(f"{name:<5}" + "".join(f"{value:>10.3f}" for value in stated))
    say(f"within 10 % of each other: {alike} of {len(films)}")
    say.record(alike=quantity(alike, digits=0), samples=quantity(len(films), digits=0))


def main() -> None:
    options = command_line(__doc__, seed=(0, 0, "of the chains")).parse_args()
    start_jax()
    films, recipes = measured_films(FEW if options.quick else ())
    whole = recover_jointly(films, recipes)
    results = Results("recipes_held", options.out)
    results("Log of the ratio of two paints: as weighed, and 90 % intervals\n")
    results(f"{'':<32}{'weighed':>8}   {'posterior':<15}{'strengths known':<18}{'identify':<15}")
    rows = []
    chosen = [row for row, share in enumerate(whole.shares) if (share > 0).sum() == 2]
    for done, row in enumerate(chosen):
        name = films.names[row]
        progress(f"{done} of {len(chosen)}: {name}")
        refit = without(whole, films, recipes, row)
        recipe = refit.recipe(row)
        paints = [refit.pigment(paint, UNIT) for paint in recipe]
        film = films.take([row])
        weighed = float(log_ratio(np.array(list(recipe.values()))))
        intervals = [*by_posterior(film, paints, options.seed), by_search(film, paints)]
        rows.append([i is not None and i.low <= weighed <= i.high for i in intervals])
        cells = [f"{i.low:6.2f} {i.high:6.2f}" if i else "   not listed" for i in intervals]
        results(
            f"{name:<5}{' / '.join(recipe):<27}{weighed:>8.2f}   {cells[0]:<15}{cells[1]:<18}{cells[2]}"
        )
    progress()
    means = np.array(rows).mean(axis=0)
    # Of a share, by counting.
    errors = np.sqrt(means * (1.0 - means) / len(rows))
    (posterior, readings, search), errors = 100.0 * means, 100.0 * errors
    results(
        f"\nheld by 90 % intervals, of {len(rows)} mixtures: posterior {posterior:.0f} %, with "
        f"strengths taken as known {readings:.0f} %, identify {search:.0f} %"
    )
    shares = {"posterior": posterior, "readings": readings, "identify": search}
    shares |= {f"{name}_error": error for name, error in zip(list(shares), errors, strict=True)}
    results.record(
        **quantities(shares, "%", 0, n=len(rows)), mixtures=quantity(len(rows), digits=0)
    )
    spreads(results)
    results.save()


if __name__ == "__main__":
    main()
