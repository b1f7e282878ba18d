"""One film, three tasks: how sure `recover`, `identify` and `posterior` say that they are."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import glazejax.samples
from glazefit import identify_films, posterior_of_film, read_films, recover_jointly
from glazefit.film.model.variation import STRENGTH
from glazefit.recover.joint.problem import Expectations
from glazejax import catalogue

# Of the twelve samples those that show their cards; of 09B the three say .32 to .49.
SHOWN = ("12A", "10A", "08A", "02A", "15C", "05B", "13G", "04B")


def test_three_tasks_state_the_same_spread_of_thickness():
    films = read_films(glazejax.samples.path()).select(SHOWN)
    recipes = {name: recipe for name, recipe in glazejax.samples.recipes().items() if name in SHOWN}
    oils = catalogue.load("oils")
    # The same belief about thicknesses as a posterior's.
    expected = Expectations(thickness=0.7, scale=0.01)
    recovery = recover_jointly(films, recipes, pigments=oils, expectations=expected)
    recovered = recovery.thickness_sd / recovery.thickness
    searched, estimated = [], []
    identification = identify_films(films, oils, own_films=True, varnish="none")
    for row, name in enumerate(SHOWN):
        candidates = identification.ranked(row)
        named = next(c for c in candidates if set(c.paints) == set(recipes[name]))
        searched.append(named.thickness_sd / named.thickness)
        paints = [oils[paint] for paint in recipes[name]]
        summary = posterior_of_film(films.take([row]), paints, steps=0).summary()
        (thickness,) = [line for line in summary if line.quantity == "thickness"]
        estimated.append(thickness.sd / thickness.mean)
    assert_allclose(recovered, searched, rtol=0.1)
    assert_allclose(estimated, searched, rtol=0.1)
    assert_allclose(estimated, recovered, rtol=0.1)


def test_a_gauge_leaves_no_strength_to_tell_from_thickness():
    from glazefit.recover.joint.constraints import Gauge

    films = read_films(glazejax.samples.path()).select(["12A"])
    oils = catalogue.load("oils")
    gauge = Gauge({"12A": 11e-6}, error=0.05, common=0.01)
    recovery = recover_jointly(films, {"12A": {"CobaltBlue": 1.0}}, pigments=oils, gauge=gauge)
    assert recovery.thickness_sd[0] / recovery.thickness[0] < 0.1


@pytest.mark.parametrize("kind", ["posterior", "laplace"])
def test_strengths_of_paints_widen_what_the_readings_leave_open(kind):
    films = read_films(glazejax.samples.path()).select(["05B"])
    paints = [catalogue.load("oils")[name] for name in ("Minium", "ZincWhite")]
    posterior = posterior_of_film(films, paints, steps=0 if kind == "laplace" else 100)
    free = posterior.laplace.sample if kind == "laplace" else posterior.free
    draws = posterior.laplace_draws if kind == "laplace" else posterior.draws
    names = [f"fraction {paint.name}" for paint in paints]
    shown = {q.name: q.values(free) for q in posterior.problem.quantities}
    # The log of a ratio of two amounts is off by two independent strengths.
    before, after = (np.log(values[names[0]] / values[names[1]]) for values in (shown, draws))
    assert after.std() == pytest.approx(np.hypot(before.std(), STRENGTH * np.sqrt(2.0)), rel=0.1)
    assert after.mean() == pytest.approx(before.mean(), abs=0.1)
    # One strength for each paint moves all quantities together.
    amounts = [np.log(draws["thickness"] * draws[name]) for name in names]
    assert np.corrcoef(np.ravel(amounts[0]), np.ravel(amounts[1]))[0, 1] < 0.5
    assert_allclose(draws[names[0]] + draws[names[1]], 1.0, rtol=1e-12)
    # What strengths do not touch stays as drawn.
    assert_allclose(draws["gloss"], shown["gloss"], rtol=0)
    # Two looks at one posterior are alike.
    again = posterior.problem.draws(free)
    assert_allclose(again["thickness"], draws["thickness"], rtol=0)
