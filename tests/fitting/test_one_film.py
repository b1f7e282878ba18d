"""One film, three tasks: how sure `recover`, `identify` and `posterior` say that they are."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.scipy.stats import gamma as gamma_density
from numpy.testing import assert_allclose
from scipy.stats import gamma, truncnorm

import glazejax.samples
from glazefit import (
    CoatPrior,
    Instrument,
    ModelError,
    Noise,
    Prior,
    SpectraPrior,
    identify_films,
    posterior_of_coats,
    posterior_of_film,
    read_films,
    recover_jointly,
)
from glazefit.film.films import readings
from glazefit.film.model.errors import draw_model_errors, smooth_modes
from glazefit.film.model.variation import STRENGTH, thickness_variance
from glazefit.film.numerics.weighted import variance_along
from glazefit.film.simulate import simulate_films
from glazefit.film.solve import solve
from glazefit.posterior.film import pose_stack
from glazefit.recover.joint.pose import Gauge
from glazefit.recover.joint.problem import Expectations
from glazejax import Pigment, catalogue

# Of the twelve samples all but 06A and 09B, where a posterior needs its chain.
ALIKE = ("12A", "10A", "08A", "02A", "15C", "05B", "13G", "04B", "14E", "07F")

FILMS = read_films(glazejax.samples.path())
OILS = catalogue.load("oils")


def test_three_tasks_state_the_same_spread_of_thickness():
    films = FILMS.select(ALIKE)
    recipes = {name: recipe for name, recipe in glazejax.samples.recipes().items() if name in ALIKE}
    # The same belief about thicknesses as a posterior's.
    expected = Expectations(thickness=0.7, scale=0.01)
    recovery = recover_jointly(films, recipes, pigments=OILS, expectations=expected)
    recovered = recovery.thickness_sd / recovery.thickness
    searched, estimated = [], []
    shelf = {paint: OILS[paint] for recipe in recipes.values() for paint in recipe}
    identification = identify_films(films, shelf, own_films=True, varnish="none")
    for row, name in enumerate(ALIKE):
        candidates = identification.ranked(row)
        named = next(c for c in candidates if set(c.paints) == set(recipes[name]))
        searched.append(named.thickness_sd / named.thickness)
        paints = [OILS[paint] for paint in recipes[name]]
        posterior = posterior_of_film(films.take([row]), paints, steps=0)
        estimated.append(np.log(posterior.draws["thickness"]).std())
    assert_allclose(recovered, searched, rtol=0.1)
    assert_allclose(estimated, searched, rtol=0.1)
    assert_allclose(estimated, recovered, rtol=0.1)


def test_a_search_reports_the_most_probable_amounts_as_a_posterior_does():
    """Of paints whose k and s are off as far as they state, the mixture that comes nearest is half
    as thick again.
    """
    size = 0.25
    grid = np.arange(400.0, 701.0, 10.0)
    blue, white = (OILS[name].resample(grid) for name in ("UltramarineBlue", "ZincWhite"))
    off = size * np.random.default_rng(0).standard_normal((2, 2, 12))
    (k, s), shelf = np.zeros((2, 1, grid.size)), []
    modes = smooth_modes(grid, ModelError().coefficient_length, 12)
    for paint, amount, (k_off, s_off) in zip(
        (blue, white), (2.5e-6, 22.5e-6), off @ modes, strict=True
    ):
        k += amount * paint.absorption * np.exp(k_off)
        s += amount * paint.scattering * np.exp(s_off)
        shelf.append(
            Pigment(
                paint.name,
                grid,
                paint.absorption,
                paint.scattering,
                absorption_sd=size * paint.absorption,
                scattering_sd=size * paint.scattering,
            )
        )
    film = simulate_films(
        grid, k, s, names=["film"], instrument=Instrument(), noise=Noise(), seed=1
    )
    candidates = identify_films(film, shelf, varnish="none", prior=Prior(concentration=1.0))
    named = next(c for c in candidates.ranked(0) if len(c.paints) == 2)
    draws = posterior_of_film(film, shelf, steps=0).draws
    assert named.thickness == pytest.approx(np.median(draws["thickness"]), rel=0.2)
    fraction = draws["fraction UltramarineBlue"]
    log_odds = np.median(np.log(fraction / (1.0 - fraction)))
    blue_share = named.fractions[named.paints.index("UltramarineBlue")]
    assert np.log(blue_share / (1.0 - blue_share)) == pytest.approx(log_odds, abs=0.1)


def test_a_paint_that_is_off_by_one_factor_leaves_the_thickness_open_by_that():
    # Errors count by the readings' first derivatives, so that larger ones come out too small.
    # And smaller ones are lost in what the readings leave open.
    size = 0.07
    blue = OILS["CobaltBlue"]
    # Stronger or weaker at all wavelengths: the same as a thicker or a thinner film.
    factor = np.full((1, 2, blue.wavelengths.size), size)
    film = FILMS.select(["12A"])

    def sd(modes=None):
        spectra = blue.wavelengths, blue.absorption, blue.scattering
        paint = Pigment("blue", *spectra, error_modes=modes)
        posterior = posterior_of_film(film, [paint], steps=0)
        return np.log(posterior.problem.shown(posterior.laplace.sample)["thickness"]).std()

    before = np.hypot(Prior().spread, STRENGTH)
    readings_alone = sd() ** 2
    assert readings_alone < 0.7 * size**2
    expected = 1.0 / (1.0 / before**2 + 1.0 / (readings_alone + size**2))
    assert sd(factor) == pytest.approx(np.sqrt(expected), rel=0.1)


def test_stated_errors_and_the_model_s_own_are_those_of_simulated_films():
    """V of `glazefit.film.errors` against films whose paints are off by what they state."""
    paints = [OILS["CobaltBlue"], OILS["ZincWhite"]]
    (reading,) = readings(FILMS.select(["12A"]), Instrument(), Noise())
    law = ModelError(unstated=0.0, amplitude=0.002, share=0.02)
    problem, modes = solve(
        pose_stack(
            reading, [CoatPrior(paints)], Instrument(), Prior(), SpectraPrior(), discrepancy=law
        )
    )
    point = jnp.asarray(modes.points[0, 0])
    data = jax.tree.map(lambda values: values[0], problem.data)
    rng = np.random.default_rng(0)
    # A tenth of the errors: they are as good as linear then.
    off = np.exp(0.1 * np.tensordot(rng.standard_normal((4000, len(data.stated))), data.stated, 1))
    shifted = np.exp(np.asarray(data.expansion.shift))

    def read(factors):
        k, s = (
            values * (factors[:, c] * shifted[c]).T
            for c, values in enumerate((data.absorption, data.scattering))
        )
        return problem.film.read(
            point, data._replace(absorption=k, scattering=s), problem.shared
        ).reshape(-1)

    drawn = np.asarray(jax.jit(jax.vmap(read))(jnp.asarray(off)))
    computed = drawn.mean(axis=0)
    model = draw_model_errors(rng, 4000, 2, reading.wavelengths, law)
    model = np.swapaxes(model, 1, 2).reshape(4000, -1) * (1.0 + 10.0 * computed)
    expected = 100.0 * np.cov(drawn, rowvar=False) + np.cov(model, rowvar=False)
    root = np.linalg.inv(np.asarray(data.expansion.whiten))
    got = root @ root.T - np.diag(np.asarray(data.sd).ravel() ** 2)
    assert_allclose(np.sqrt(np.diag(got)), np.sqrt(np.diag(expected)), rtol=0.05)
    assert_allclose(got, expected, atol=0.05 * np.diag(expected).max())


def test_variance_along_a_density():
    normal = variance_along(lambda step: -0.5 * step**2 / 0.49, jnp.array(0.49))
    assert float(normal) == pytest.approx(0.49, rel=1e-3)
    # Of a film that hides its ground, below some thickness it would not.
    cut = truncnorm(-0.6, np.inf)
    bounded = variance_along(
        lambda step: jnp.where(step < -0.6, -1e3, -0.5 * step**2), jnp.array(1.0)
    )
    assert float(bounded) == pytest.approx(cut.var(), rel=0.03)
    # Impossible where it has no number.
    endless = variance_along(
        lambda step: jnp.where(step < -0.6, jnp.nan, -0.5 * step**2), jnp.array(1.0)
    )
    assert float(endless) == pytest.approx(cut.var(), rel=0.03)
    # A long tail, of which the curvature says nothing.
    skewed = gamma(4.0)
    tailed = variance_along(lambda step: gamma_density.logpdf(3.0 + step, 4.0), jnp.array(3.0))
    assert float(tailed) == pytest.approx(skewed.var(), rel=0.05)


def test_a_gauge_counts_for_the_films_that_it_measured():
    films = FILMS.select(["12A", "10A"])
    recipes = {"12A": {"CobaltBlue": 1.0}, "10A": {"EmeraldGreen": 1.0}}

    def spreads(error):
        gauge = Gauge({"12A": 11e-6}, error=error, common=0.01)
        recovery = recover_jointly(films, recipes, pigments=OILS, gauge=gauge)
        return recovery.thickness_sd / recovery.thickness

    sharp, rough = spreads(0.05), spreads(0.6)
    assert sharp[0] < 0.06
    assert rough[0] > 0.25
    # The other film was not measured.
    assert min(sharp[1], rough[1]) > 0.2


def test_a_stated_thickness_holds():
    coat = CoatPrior([OILS["CobaltBlue"]], 25e-6, spread=0.05)
    posterior = posterior_of_coats(FILMS.select(["12A"]), [coat], steps=0)
    draws = posterior.draws["thickness of coat 1"]
    # The readings show 11 um: this paint is weak here.
    assert np.log(draws).std() == pytest.approx(0.05, rel=0.1)
    assert np.median(draws) == pytest.approx(25e-6, rel=0.05)


def test_variance_of_thickness_has_its_limits():
    # A film of which nothing is shown is as thick as expected, a clear one as strength allows.
    assert thickness_variance(0.49, 0.49, 1.0) == pytest.approx(0.49)
    assert thickness_variance(1e-9, 1e6, 1.0) == pytest.approx(STRENGTH**2, rel=1e-3)
    assert thickness_variance(0.01, 0.49, 0.0) == pytest.approx(0.01)
    # Normal thickness and strength, of which the sum is read without error.
    expected = 0.49 * STRENGTH**2 / (0.49 + STRENGTH**2)
    assert thickness_variance(1e-9, 0.49, 1.0) == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("kind", ["posterior", "laplace"])
def test_strengths_of_paints_widen_what_the_readings_leave_open(kind):
    films = FILMS.select(["05B"])
    paints = [OILS[name] for name in ("Minium", "ZincWhite")]
    posterior = posterior_of_film(films, paints, steps=0 if kind == "laplace" else 100)
    free = posterior.laplace.sample if kind == "laplace" else posterior.free
    draws = posterior.laplace_draws if kind == "laplace" else posterior.draws
    names = [f"fraction {paint.name}" for paint in paints]
    shown = posterior.problem.shown(free)
    thickness, shown_thickness = (np.log(values["thickness"]) for values in (draws, shown))
    # The log of a ratio of two amounts is off by two strengths.
    before, after = (np.log(values[names[0]] / values[names[1]]) for values in (shown, draws))
    assert after.std() == pytest.approx(np.hypot(before.std(), STRENGTH * np.sqrt(2.0)), rel=0.1)
    assert after.mean() == pytest.approx(before.mean(), abs=0.1)
    # The white is nearly all of the film: its strength is the thickness's, the red's is its own.
    fractions = np.stack([shown[name] for name in names])
    red = (after - before) + (thickness - shown_thickness) / fractions[1]
    assert abs(np.corrcoef(np.ravel(red), np.ravel(thickness))[0, 1]) < 0.2
    variance = thickness_variance(
        shown_thickness.var(), Prior().spread ** 2, np.mean(np.sum(fractions**2, axis=0))
    )
    assert thickness.var() == pytest.approx(variance, rel=0.15)
    assert_allclose(draws[names[0]] + draws[names[1]], 1.0, rtol=1e-12)
    # What strengths do not touch stays as drawn.
    assert_allclose(draws["gloss"], shown["gloss"], rtol=0)


def test_strengths_of_two_films_are_their_own():
    names = {"12A": "CobaltBlue", "10A": "EmeraldGreen"}
    logs = []
    for film, paint in names.items():
        posterior = posterior_of_film(FILMS.select([film]), [OILS[paint]], steps=0)
        logs.append(np.log(posterior.draws["thickness"]).ravel())
        # Two looks at one posterior are alike.
        again = posterior.problem.draws(posterior.free)
        assert_allclose(again["thickness"], posterior.draws["thickness"], rtol=0)
    assert abs(np.corrcoef(logs)[0, 1]) < 0.1
