"""The parts of an identification, each against an independent calculation."""

from types import SimpleNamespace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.special import gamma, kv, logsumexp

from glazefit.film.model.errors import (
    ModelError,
    Prior,
    draw_model_errors,
    model_correlation,
    principal_modes,
    relative_errors,
    smooth_kernel,
    whitening,
)
from glazefit.film.model.response import film_response
from glazefit.film.numerics.least_squares import inverse_small
from glazefit.identify.search.fit import (
    Fitted,
    Weights,
    fit_films,
    log_prior,
    log_set_prior,
    pool_of,
)
from glazefit.identify.search.options import IdentificationOptions
from glazefit.identify.search.pool import NOBODY
from glazefit.identify.search.screen import grow, score
from glazefit.identify.search.searcher import Searcher
from glazefit.identify.search.table import Paints, film_table, sets_of
from glazefit.identify.search.task import Expected
from glazefit.mapping.solve.by_paint import PaintSearcher
from glazejax import Hemispherical, Pigment

from ..refusals import refusal
from .grids import every_pair

GRID = np.linspace(400.0, 700.0, 7)
BOTH = jnp.asarray([[0, 1]], dtype=jnp.int32)


@pytest.mark.parametrize("size", [1, 2, 3])
def test_small_inverse_is_numpys(size):
    root = np.random.default_rng(size).standard_normal((size, size + 2))
    matrix = root @ root.T
    inverse, log_det = inverse_small(jnp.asarray(matrix))
    assert_allclose(inverse, np.linalg.inv(matrix), rtol=1e-9)
    assert float(log_det) == pytest.approx(np.linalg.slogdet(matrix)[1], abs=1e-9)


def test_errors_at_two_wavelengths_go_together_as_materns():
    """Order 3/2, by its definition with a Bessel function; one at no distance, and less the farther
    apart.
    """
    grid = np.array([400.0, 410.0, 450.0, 700.0])
    d = np.sqrt(3.0) * np.abs(grid[:, None] - grid)[np.triu_indices(4, 1)] / 80.0
    kernel = smooth_kernel(grid, 80.0)
    assert_allclose(kernel[np.triu_indices(4, 1)], 2.0**-0.5 / gamma(1.5) * d**1.5 * kv(1.5, d))
    assert_array_equal(np.diagonal(kernel), 1.0)
    assert_array_equal(kernel, kernel.T)


def test_modes_of_errors_are_the_same_where_eigenvectors_have_other_signs(monkeypatch):
    kernel = smooth_kernel(GRID, 80.0)
    modes = principal_modes(kernel)
    assert_allclose(modes.T @ modes, kernel, atol=1e-12)
    values, vectors = np.linalg.eigh(kernel)
    monkeypatch.setattr(np.linalg, "eigh", lambda _: (values, -vectors))
    assert_array_equal(principal_modes(kernel), modes)


def test_random_errors_of_the_model_have_its_covariance():
    d = ModelError()
    errors = draw_model_errors(np.random.default_rng(2), 40_000, 2, GRID, d).reshape(40_000, -1)
    expected = model_correlation(GRID, 2, d.length, d.shared)
    assert_allclose(np.cov(errors.T) / d.amplitude**2, expected, atol=0.03)


def test_errors_of_pigments_count_as_far_as_they_mean_something():
    k, s = np.array([0.0, 100.0, 100.0]), np.full(3, 50.0)
    stated = Pigment(
        "a", GRID[:3], k, s, absorption_sd=np.array([1.0, 10.0, 1e4]), scattering_sd=np.full(3, 5.0)
    )
    silent = Pigment("b", GRID[:3], k, s)
    d = ModelError()
    first, second = relative_errors([stated, silent], d)
    assert_allclose(first, [[0.0, 0.1, d.most], [0.1, 0.1, 0.1]])
    assert_allclose(second, d.unstated)


@pytest.mark.parametrize(
    "wrong", [{"coefficient": -1}, {"most": float("nan")}, {"apart": 0}, {"length": 0.0}]
)
def test_a_discrepancy_out_of_range_is_named(wrong):
    (name,) = wrong
    with refusal(f"the discrepancy's {name} is .*; it must be"):
        ModelError(**wrong)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"thickness": 0.0}, "usual thickness of 0 m"),
        ({"thickness": 0.02}, "usual thickness of 0.02 m"),
        ({"spread": 0.0}, "must be positive"),
        ({"spread": 30.0}, "5 at most"),
        ({"concentration": -1.0}, "must be positive"),
        ({"sizes": (0.5, 0.5, 0.0)}, "three positive numbers"),
        ({"sizes": (0.5, 0.5)}, r"sizes are \(0.5, 0.5\); they must be three positive numbers"),
        ({"sizes": (0.5, 0.5, float("nan"))}, "three positive numbers"),
        ({"unknown": 1.0}, "between 0 and 1"),
        ({"stacked": 0.0}, "between 0 and 1"),
        ({"extender": 1.5}, "between 0 and 1"),
    ],
)
def test_what_cannot_be_expected_is_named(wrong, words):
    with refusal(words):
        Prior(**wrong)
    assert Prior(thickness=0.01, extender=1.0).extender == 1.0


def test_prior_of_fractions_and_thickness_integrates_to_one():
    u = np.linspace(-14.0, 6.0, 401)
    density = jax.vmap(
        lambda logs: log_prior(logs, jnp.ones(2, bool), jnp.asarray(0.7), jnp.asarray(1.0))
    )(every_pair(u))
    assert np.exp(density).sum() * (u[1] - u[0]) ** 2 == pytest.approx(1.0, abs=2e-3)


def depths(grid, peak, height):
    """k d with one band."""
    return 0.02 + height * np.exp(-(((grid - peak) / 60.0) ** 2))


@pytest.fixture(scope="module")
def problem():
    """One film of two paints, its errors, and the paints."""
    k = np.stack([depths(GRID, 450.0, 2.0), depths(GRID, 620.0, 1.5)])
    paints = Paints(jnp.asarray(k), jnp.full(k.shape, 1.5))
    response = film_response(Hemispherical())
    ground = np.array([[0.03], [0.9]]) * np.ones(GRID.size)
    body = np.asarray(response.body(0.7 * k[0] + 0.5 * k[1], 1.8, ground))
    smooth = 0.005**2 * model_correlation(GRID, 2, 100.0, 0.8)
    errors = whitening((smooth + 0.004**2 * np.eye(2 * GRID.size))[None])
    target = body.reshape(1, -1)
    # Log-normal total, uniform fractions, errors next to Gaussian.
    expected = Expected(spread=0.7, concentration=1.0, freedom=1e9, independent=1.0 * target.size)
    weights = Weights(jnp.asarray(target), *map(jnp.asarray, errors), expected=expected)
    return response, paints, jnp.asarray(ground)[None], weights


def fitted_to(problem, start, steps=14, along=False):
    """The film of both paints, from log amounts `start`."""
    response, paints, ground, weights = problem
    return fit_films(
        response,
        paints,
        BOTH,
        jnp.broadcast_to(start, (1, 2)),
        ground,
        weights,
        steps=jnp.asarray(steps),
        along=jnp.asarray(along),
    )


def test_evidence_is_the_integral_of_the_posterior(problem):
    fitted = fitted_to(problem, 0.0)
    centre = np.asarray(fitted.logs[0])
    assert_allclose(np.exp(centre), [0.7, 0.5], rtol=0.03)
    sd = np.sqrt(np.diagonal(fitted.covariance[0]))
    offsets = np.linspace(-6.0, 6.0, 81)
    points = centre + sd * every_pair(offsets)
    total = np.asarray(jax.jit(jax.vmap(lambda logs: _log_joint(logs, problem)))(points))
    volume = np.log(np.prod(sd) * (offsets[1] - offsets[0]) ** 2)
    assert float(fitted.log_evidence[0]) == pytest.approx(logsumexp(total) + volume, abs=0.05)


# So thick that thicker films read nearly the same; of little of one paint, the step of whose share
# is another at each thickness.
@pytest.mark.parametrize("amounts", [(6.0, 6.0), (0.3, 3.0)])
def test_variance_of_a_thickness_that_the_readings_bound_on_one_side(problem, amounts):
    response, paints, ground, weights = problem
    k, s = (np.array(amounts) @ values for values in paints)
    hiding = weights._replace(target=response.body(k, s, ground[0]).reshape(1, -1))
    hidden = response, paints, ground, hiding
    fitted, laplace = (fitted_to(hidden, np.log(amounts), along=along) for along in (True, False))
    centre = np.asarray(fitted.logs[0])
    # Over thickness and the log of the ratio.
    places = np.linspace(-3.0, 3.0, 161)
    points = centre + every_pair(places) @ np.array([[1.0, 1.0], [0.5, -0.5]])
    total = np.asarray(jax.jit(jax.vmap(lambda logs: _log_joint(logs, hidden)))(points))
    shares = np.exp(total - total.max())
    log_thickness = np.log(np.exp(points).sum(axis=1))
    mean = np.average(log_thickness, weights=shares)
    expected = np.average((log_thickness - mean) ** 2, weights=shares)
    fractions = np.exp(centre) / np.exp(centre).sum()
    along, by_laplace = (
        float(fractions @ result.covariance[0] @ fractions) for result in (fitted, laplace)
    )
    assert along == pytest.approx(expected, rel=0.05)
    assert by_laplace < 0.85 * expected


def _log_joint(logs, problem):
    response, paints, ground, weights = problem
    amounts = jnp.exp(logs)
    off = (
        weights.target[0]
        - response.body(amounts @ paints.absorption, amounts @ paints.scattering, ground[0]).ravel()
    )
    misfit = jnp.sum((weights.basis[0] @ off) ** 2)
    total = jnp.log(jnp.sum(amounts))
    prior = -0.5 * (total / 0.7) ** 2 - np.log(0.7 * np.sqrt(2 * np.pi)) + jnp.sum(logs - total)
    return weights.height[0] - 0.5 * misfit + prior


def test_a_paint_that_is_not_there_is_let_go_in_few_steps(problem):
    response, paints, ground, weights = problem
    k, s = (0.9 * part[0] for part in paints)
    alone = weights._replace(target=response.body(k, s, ground[0]).reshape(1, -1))
    lonely = response, paints, ground, alone
    few, many = (fitted_to(lonely, np.log(0.45), steps) for steps in (8, 60))
    assert np.exp(many.logs[0, 1]) < 0.02
    assert_allclose(few.log_evidence, many.log_evidence, atol=0.01)
    assert_allclose(few.logs, many.logs, atol=0.01)


def test_few_components_lose_only_what_films_have_in_common():
    """A table of more readings than components: misfits differ by the same for all films, next to
    what tells them.
    """
    grid = np.linspace(400.0, 700.0, 41)
    k = np.stack([depths(grid, peak, 2.0) for peak in (430.0, 520.0, 640.0)])
    paints = Paints(jnp.asarray(k), jnp.full(k.shape, 1.5))
    ground = np.full((1, grid.size), 0.9)
    response = film_response(Hemispherical())
    table = film_table(response, paints, 2, 0.7, ground, np.eye(grid.size) / 0.01)
    assert len(table.project) < grid.size
    film = np.asarray(response.body(0.6 * k[0] + 0.3 * k[2], 1.4, ground))
    spectrum = film + 0.003 * np.cos(grid)
    # Those of two, after each paint by itself.
    sets, amounts_of_sets = (values[0, len(k) :] for values in table.nearest(spectrum, 3))
    assert sets[0].tolist() == [0, 2]
    read = [
        np.asarray(response.body(amounts @ k[members], 1.5 * amounts.sum(), ground)).ravel()
        for amounts, members in zip(amounts_of_sets, sets, strict=True)
    ]
    exact = np.sum(((spectrum - np.array(read)) / 0.01) ** 2, axis=-1)
    # The least of each set by the components of its films.
    pairs = table.sizes[1]
    films = pairs.films[:-1].reshape(-1, len(pairs.grid), len(pairs.sets))
    components = (spectrum @ table.project.T - table.middle)[0]
    least = np.sum((components[:, None, None] - films) ** 2, axis=0).min(axis=0)
    misfit = least[[pairs.sets.tolist().index(members) for members in sets.tolist()]]
    assert_allclose(np.diff(misfit), np.diff(exact), rtol=0.02)


def test_triples_are_scored_by_the_least_misfit_of_what_is_tried(problem):
    response, paints, ground, _ = problem
    ground = np.asarray(ground[0])
    rng = np.random.default_rng(4)
    white = np.tril(rng.uniform(1.0, 50.0, (ground.size, ground.size)))
    spectra = rng.uniform(0.05, 0.9, (2, ground.size))
    sets = np.array([[[0, 1], [1, 0]], [[1, 0], [0, 1]]])
    tries = rng.uniform(0.05, 2.0, (2, 2, 4, 2))
    films = map(jnp.asarray, (sets, tries, np.stack([ground] * 2), spectra @ white.T, white))
    least, where = score(response, paints, *films)
    for row, n in np.ndindex(2, 2):
        k, s = (tries[row, n] @ np.asarray(each)[sets[row, n]] for each in paints)
        films = np.asarray(response.body(k[:, None], s[:, None], ground)).reshape(4, -1)
        every = np.sum(((spectra[row] - films) @ white.T) ** 2, axis=1)
        assert float(least[row, n]) == pytest.approx(every.min(), rel=1e-9)
        assert int(where[row, n]) == every.argmin()


def test_what_grows_keeps_its_pair_and_tries_some_of_the_third():
    pairs = np.array([[[0, 2], [1, 3]], [[2, 3], [0, 1]]])
    amounts = np.array([[[0.5, 1.5], [0.2, 0.8]], [[1.0, 2.0], [0.1, 0.4]]])
    sets, tries = grow(pairs, amounts, 4)
    assert sets.shape == (2, 4, 3)
    assert_array_equal(sets[..., :2], np.repeat(pairs, 2, axis=1))
    for members in sets.reshape(-1, 3).tolist():
        assert set(members) < {0, 1, 2, 3}
        assert len(set(members)) == 3
    paired = np.repeat(amounts, 2, axis=1)[:, :, None]
    assert_array_equal(tries[..., :2], np.broadcast_to(paired, tries[..., :2].shape))
    # The same shares of what there is of the pair, whatever it is.
    share = tries[..., 2] / tries[..., :2].sum(axis=-1)
    assert_allclose(share, np.broadcast_to(share[0, 0], share.shape))
    assert np.all(np.diff(share[0, 0]) > 0)
    assert 0.0 < share[0, 0, 0] < 0.01 < 1.0 < share[0, 0, -1]


def expecting(prior, largest, extenders) -> Any:
    """What of a task is asked for what is expected of sets."""
    return SimpleNamespace(
        prior=prior, max_paints=largest, paint_count=len(extenders), extenders=extenders
    )


@pytest.mark.parametrize("largest", [1, 2, 3])
def test_sets_of_a_size_share_what_is_expected_of_it(largest):
    """Every set of a size is as probable, but with an extender in it by `Prior.extender`; alone an
    extender is a paint like others.
    """
    prior = Prior(sizes=(0.5, 0.3, 0.2), extender=0.25)
    extenders = np.array([False, True, False, False, True])
    task = expecting(prior, largest, extenders)
    shares = np.array(prior.sizes[:largest]) / sum(prior.sizes[:largest])
    for size in range(1, largest + 1):
        sets = sets_of(len(extenders), size)
        found = np.exp(log_set_prior(task, sets))
        hardly = extenders[sets].sum(axis=1) if size > 1 else np.zeros(len(sets))
        assert_allclose(found, shares[size - 1] / len(sets) * 0.25**hardly)
        # Room that no paint fills changes nothing.
        wide = np.pad(sets, ((0, 0), (0, 3 - size)), constant_values=-1)
        assert_allclose(np.exp(log_set_prior(task, wide)), found)
    assert np.exp(log_set_prior(task, np.full((1, 3), -1)))[0] == 0


def test_a_place_without_a_paint_has_no_amount():
    """Sets of one paint are fitted in two places, of which the second starts at a usual amount."""
    amounts = np.array([[[0.5, 1.0], [0.2, 0.3]]])
    fitted = Fitted(
        logs=np.log(amounts),
        covariance=np.zeros((1, 2, 2, 2)),
        log_evidence=np.zeros((1, 2)),
        readings=np.zeros((1, 2, GRID.size)),
    )
    task = expecting(Prior(), 2, np.zeros(3, bool))
    pool = pool_of(task, np.array([[[0, NOBODY], [1, 2]]]), fitted)
    for logs in (pool.logs, pool.weighed):
        assert_allclose(np.exp(logs), [[[0.5, 0.0, 0.0], [0.2, 0.3, 0.0]]])


def test_what_is_expected_of_sets_is_in_the_weight_of_every_candidate():
    """As they are first fitted, and again with errors of their own: another prior of the number of
    paints moves the weights by the ratio of the two, and nothing else.
    """
    paints = [
        Pigment(name, GRID, np.full(GRID.size, k) * np.linspace(1, turn, GRID.size), np.full(7, s))
        for name, k, s, turn in (("a", 2e4, 4e4, 3), ("b", 5e4, 2e4, 0.2), ("c", 1e3, 9e4, 1))
    ]
    reading = np.linspace(0.5, 0.25, GRID.size)[None]
    weights = []
    sizes = (0.8, 0.2, 0.1), (0.2, 0.8, 0.1)
    # Errors are made linear where the most probable film of a group is, which moves a little.
    for shares in sizes:
        options = IdentificationOptions(max_paints=2, prior=Prior(sizes=shares))
        searcher = Searcher.of(GRID, paints, options)
        over_card = PaintSearcher(searcher, np.full(7, 0.8))
        spectra = over_card.measure(reading, np.full_like(reading, 0.003))
        ((_, pool, _),) = searcher.search(spectra)
        weights.append(
            {
                (*pool.members[0, n], pool.condition[0, n]): pool.log_weight[0, n]
                for n in np.flatnonzero(np.isfinite(pool.log_weight[0]))
            }
        )
    few, many = weights
    tried = set()
    for key in few.keys() & many.keys():
        place = sum(paint > NOBODY for paint in key[:3]) - 1
        expected = np.log(sizes[1][place] / sizes[0][place])
        assert many[key] - few[key] == pytest.approx(expected, abs=0.05), key
        tried.add(place)
    assert tried == {0, 1}


@pytest.mark.parametrize("readings", [1, 8, 9, 31, 62])
def test_whitening_is_the_inverse_of_a_covariance(readings):
    rng = np.random.default_rng(readings)
    root = rng.normal(size=(2, 3, readings, readings + 2))
    covariance = root @ np.swapaxes(root, -1, -2)
    white, height = whitening(covariance)
    assert_array_equal(white, np.tril(white))
    unit = white @ covariance @ np.swapaxes(white, -1, -2)
    assert_allclose(unit, np.broadcast_to(np.eye(readings), unit.shape), atol=1e-9)
    expected = -0.5 * np.linalg.slogdet(2 * np.pi * covariance)[1]
    assert_allclose(height, expected, rtol=1e-10)
