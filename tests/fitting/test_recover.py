from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

from glazefit import Instrument, Noise, read_films, recover_films, simulate_films
from glazefit.film.errors import ScaledReadings
from glazefit.film.films import readings
from glazefit.film.gloss import estimate_gloss
from glazefit.film.model.optics import Optics
from glazefit.film.noise import estimate_noise
from glazefit.film.readers import is_masstone, read_recipes, readable_names
from glazefit.posterior.bands import pose_bands
from glazefit.recover.films.film_by_film import (
    CHUNK,
    pose,
    recover_chunks,
    solve,
    starts,
)
from glazefit.recover.films.result import told_apart
from glazejax import Glaze, Hemispherical, Layer, Pigment, reflectance

from .palette import raise_readings
from .problems import side_by_side

GRID = np.arange(400.0, 701.0, 10.0)
INSTRUMENT = Instrument()
ONES = np.ones((1, GRID.size))


def log_uniform(rng, low, high, films):
    """Spectra of films, any order of magnitude as likely, (films, bands)."""
    return np.exp(rng.uniform(np.log(low), np.log(high), (films, GRID.size)))


def recovered(k, s, **told):
    return recover_films(simulate_films(GRID, k, s, names="x", **told), **told)


@pytest.fixture(scope="module")
def known():
    """Films of every kind that is not opaque, and what was recovered from their noisy spectra."""
    rng = np.random.default_rng(7)
    count = 24
    k = log_uniform(rng, 0.003, 2.0, count)
    s = log_uniform(rng, 0.05, 12.0, count)
    films = simulate_films(GRID, k, s, names=[str(i) for i in range(count)], seed=11)
    return k, s, recover_films(films)


def test_errors_are_as_large_as_stated(known):
    k, s, recovery = known
    lower, upper = recovery.interval()
    truth = np.stack([k, s], axis=-1)
    use = recovery.identifiable
    inside = ((truth >= lower) & (truth <= upper))[use].mean(axis=0)
    assert use.mean() > 0.8, "too few bands left to say anything"
    # Binomial error of 1300 values is 0.6 %.
    assert np.all((inside > 0.93) & (inside < 0.97)), inside
    # Not only in the tails.
    z = ((recovery.absorption - k) / recovery.absorption_sd)[use]
    assert np.percentile(np.abs(z), 68.3) == pytest.approx(1.0, abs=0.1)


def test_errors_are_those_that_the_posterior_says(known):
    """Standard deviations of log s and of log k/s, by the curvature of the posterior of bands at the
    solution: one film has one error bar.
    """
    recovery = known[-1]
    films = recovery.films
    assert np.all(recovery.gloss == 1.0)
    problem = side_by_side(
        pose_bands(reading, 1.0, INSTRUMENT)
        for reading in readings(films, INSTRUMENT, estimate_noise(films))
    )
    free = np.log(np.stack([recovery.ratio, recovery.scattering], axis=-1)).reshape(-1, 2)

    def height(free, data):
        return 0.5 * jnp.sum(problem.residuals(free, data, problem.shared) ** 2)

    curvature = jax.jit(jax.vmap(jax.hessian(height)))(free, problem.data)
    variance = np.diagonal(np.linalg.inv(curvature), axis1=1, axis2=2)
    expected = np.sqrt(np.maximum(variance, 0.0)).reshape(*recovery.ratio.shape, 2)
    relative = np.stack(
        [recovery.ratio_sd / recovery.ratio, recovery.scattering_sd / recovery.scattering], axis=-1
    )
    use = recovery.identifiable & np.all(relative < 0.1, axis=-1)
    assert use.mean() > 0.3
    assert_allclose(relative[use], expected[use], rtol=0.1)


def test_ratio_is_known_even_where_k_and_s_are_not(known):
    k, s, recovery = known
    use = recovery.ratio_sd < 0.3 * recovery.ratio
    inside = np.abs(recovery.ratio - k / s) < 1.96 * recovery.ratio_sd
    assert use.mean() > 0.9
    assert 0.92 < inside[use].mean() < 0.98


def test_every_reading_is_met(known):
    recovery = known[-1]
    # Two readings, two unknowns: what is identifiable has an exact solution.
    assert recovery.misfit[recovery.identifiable].max() < 0.1
    assert recovery.converged[recovery.identifiable].mean() > 0.99


def test_exact_spectra_give_exact_values():
    rng = np.random.default_rng(3)
    k = log_uniform(rng, 0.01, 1.0, 4)
    s = log_uniform(rng, 0.1, 4.0, 4)
    # Made by the forward package, which knows neither Films nor the fit.
    seen = Hemispherical(8.0)
    coats = [Layer(Pigment("x", GRID, k[i] / 2e-5, s[i] / 2e-5), 2e-5) for i in range(4)]
    spectra = {}
    for name, card in (("black", 0.03), ("white", 0.92)):
        over = [reflectance(Glaze([coat], card), seen, tolerance=1e-6) for coat in coats]
        bare = reflectance(Glaze([], card), seen)
        spectra[f"over_{name}"] = np.stack(over)
        spectra[f"bare_{name}"] = np.full((4, GRID.size), bare[0])
    films = replace(simulate_films(GRID, k, s, names="abcd"), **spectra)
    recovery = recover_films(films)
    use = recovery.identifiable
    assert use.mean() > 0.9
    assert_allclose(recovery.absorption[use], k[use], rtol=5e-3)
    assert_allclose(recovery.scattering[use], s[use], rtol=5e-3)
    assert recovery.rmse.max() < 2e-5


@pytest.mark.slow
def test_geometry_matters():
    without = Instrument(Hemispherical(8.0, specular=False))
    films = simulate_films(
        GRID, 0.1 * ONES, ONES, names="x", instrument=without, noise=Noise(1e-6, 0.0)
    )
    right = recover_films(films, instrument=without, noise=Noise(1e-5, 0.0))
    assert_allclose(right.absorption, 0.1, rtol=1e-2)
    with pytest.raises(ValueError, match="darker than its surface"):
        recover_films(films, instrument=INSTRUMENT)


def test_opaque_film_is_flagged_and_keeps_its_ratio():
    k, s = 4.0 * ONES, 20.0 * ONES
    # One end of the spectrum can be seen through.
    k[0, 20:], s[0, 20:] = 0.02, 3.0
    recovery = recovered(k, s)
    assert not recovery.identifiable[0, :20].any()
    assert recovery.identifiable[0, 20:].all()
    assert_allclose(recovery.ratio[0, :20], 0.2, rtol=0.1)
    # No telling where s is, but not at infinity.
    assert recovery.scattering[0, :20].max() < 60
    assert np.isfinite(recovery.covariance).all()


def test_k_and_s_are_told_apart_as_the_rule_says():
    """To half of their value or to .01, whichever is more, both of them, at five standard
    deviations of contrast.
    """
    optical = np.array([[1.0, 4.0], [0.005, 4.0]])

    def told(sd_k, sd_s, contrast=9.0):
        covariance = np.broadcast_to(np.diag([sd_k**2, sd_s**2]), (2, 2, 2))
        return told_apart(optical, covariance, np.full(2, contrast)).tolist()

    assert told(0.009, 1.99) == [True, True]
    assert told(0.49, 1.99) == [True, False]
    assert told(0.51, 1.99) == [False, False]
    assert told(0.009, 2.01) == [False, False]
    assert told(0.009, 0.1, contrast=5.0) == [True, True]
    assert told(0.009, 0.1, contrast=4.99) == [False, False]


def test_a_film_blacker_than_any_that_is_seen_through_keeps_its_ratio():
    """Its k d is no more than where films hide their ground, and s d goes with it."""
    k = np.where(GRID < 550, 0.5, 250.0)[None]
    recovery = recovered(k, 3.0 * ONES, noise=Noise(1e-5, 0.0))
    black = GRID >= 550
    assert not recovery.identifiable[0, black].any()
    assert_allclose(recovery.absorption[0, black], 100.0)
    assert_allclose(recovery.ratio[0, black], 250.0 / 3.0, rtol=0.05)


def test_clear_film_has_known_small_values():
    recovery = recovered(0.004 * ONES, 0.003 * ONES)
    assert recovery.identifiable.mean() > 0.9
    assert_allclose(recovery.absorption, 0.004, atol=0.005)


def test_gloss_only_where_readings_demand_it():
    k = np.geomspace(0.1, 30, GRID.size)[None].repeat(2, axis=0)
    films = simulate_films(GRID, k, np.full_like(k, 0.3), names=["matte", "smooth"])
    films = raise_readings(films, np.array([[-0.4], [0.0]]) * INSTRUMENT.surface)
    gloss = estimate_gloss(films, INSTRUMENT, Noise())
    assert gloss[0] == pytest.approx(0.6, abs=0.03)
    assert gloss[1] == 1.0
    recovery = recover_films(films)
    assert recovery.rmse.max() < 1e-3
    use = recovery.identifiable[0]
    assert use.sum() > 5
    assert_allclose(recovery.absorption[0, use], k[0, use], rtol=0.15)


def test_two_solutions_are_both_starts():
    """The starts of a band hold each local minimum that a dense search finds."""
    films = simulate_films(GRID, 2.3 * ONES, 0.06 * ONES, names="x", noise=Noise(1e-6, 0))
    film, data, shared = pose(films, np.ones(1), INSTRUMENT, Noise())
    first = jax.tree.map(lambda a: a[0], data)
    nothing = jnp.asarray(jnp.nan)
    found = jax.jit(starts, static_argnums=0)(ScaledReadings(film), first, shared, nothing)
    assert np.abs(np.exp(found.logs) - [2.3, 0.06]).min(axis=0).max() < 0.5
    k, s = jnp.exp(found.logs).T[..., None, None]
    read = Optics.of(INSTRUMENT).body(k, s, first.ground[0], 1e-5)
    assert np.abs(read - first.reflectance[0]).min(axis=0).max() < 2e-3


@pytest.mark.slow
def test_chunks_join_to_the_whole(known):
    """With a noise that is told: told nothing, it is taken from all films that are given."""
    films = known[-1].films
    some = films.take(slice(0, CHUNK + 3))
    whole, rest = recover_chunks(some, noise=Noise())
    assert (len(whole), len(rest)) == (CHUNK, 3)
    alone = recover_films(films.take(slice(CHUNK, CHUNK + 3)), noise=Noise())
    assert_allclose(rest.absorption, alone.absorption, rtol=1e-6)


@pytest.mark.slow
def test_masstones_of_the_revigo_data_are_reproduced_to_the_noise(shared_data):
    films = read_films(shared_data / "revigo" / "reflectance.tsv")
    recipes = read_recipes(shared_data / "revigo" / "mixtures.tsv")
    films = films.select([name for name in films.names if is_masstone(recipes[name])])
    films = replace(films, names=readable_names(films.names, recipes))
    recovery = recover_films(films)
    assert len(recovery) == 19
    assert recovery.rmse.max() < 1e-3
    assert recovery.delta_e("D65").max() < 0.6
    assert recovery.delta_e("A").max() < 0.6
    named = dict(zip(films.names, range(19), strict=True))
    # Found with another program (numerics.md, section 8).
    white, chalk = (recovery.scattering[named[n]] for n in ("ZincWhite", "CalciumCarbonate"))
    assert 8 < white[5:].min() < white[5:].max() < 21
    assert 0.11 < chalk.min() < chalk.max() < 0.21
    assert recovery.gloss[named["UltramarineBlue"]] == pytest.approx(0.52, abs=0.05)
    assert np.delete(recovery.gloss, named["UltramarineBlue"]).min() == 1.0
    assert not recovery.identifiable[named["Vermillion"]].any()


@pytest.mark.slow
def test_compiled_program_calls_no_library_for_linear_algebra():
    films = simulate_films(GRID, ONES, ONES, names="x")
    problem = pose(films, np.ones(1), INSTRUMENT, Noise())
    # What the compiler is given; it adds no library calls of its own, and compiling again takes
    # long.
    program = solve.jitted.lower(*problem, jnp.full(GRID.size, jnp.nan)).as_text("hlo")
    assert "lapack_" not in program
    assert "while" in program, "the solver's loop is missing: is this the program that runs?"


def test_black_film_stays_finite():
    recovery = recovered(50.0 * ONES, 0.01 * ONES)
    assert not recovery.identifiable.any()
    assert np.isfinite(recovery.covariance).all()
    assert recovery.rmse[0] < 1e-3
