"""Joint recovery against films whose paints are known, and its linear solver against dense
matrices.
"""

from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.flatten_util import ravel_pytree
from numpy.testing import assert_allclose, assert_array_equal

from glazefit.film.films import Instrument, Noise
from glazefit.film.model.mixing import MixingLaw, weight_table
from glazefit.film.model.response import film_response
from glazefit.film.simulate import simulate_films
from glazefit.recover.joint.joint import UNIT, recover_jointly
from glazefit.recover.joint.pose import Gauge, curvature_matrix, nearly_black, pose
from glazefit.recover.joint.problem import (
    Expectations,
    Unknowns,
    heavy_tail,
    residuals,
    totals,
)
from glazefit.recover.joint.solver import (
    JointCovariance,
    factorise,
    look,
    solve,
    solve_jointly,
)
from glazefit.recover.predict.crossvalidation import cross_validate
from glazefit.recover.predict.prediction import predict_films
from glazefit.recover.show.report import left_out_table
from glazejax import Pigment

from ..refusals import refusal
from ..slow import slow
from .palette import raise_readings

PAINTS = ("CobaltBlue", "ZincWhite", "BoneBlack")
RECIPES = {
    "blue": {"CobaltBlue": 100.0},
    "white": {"ZincWhite": 100.0},
    "tint": {"CobaltBlue": 10.0, "ZincWhite": 90.0},
    "half": {"CobaltBlue": 50.0, "ZincWhite": 50.0},
    "grey": {"ZincWhite": 95.0, "BoneBlack": 5.0},
    "shade": {"CobaltBlue": 95.0, "BoneBlack": 5.0},
}
GRID = np.arange(400.0, 701.0, 30.0)


def truth() -> tuple[np.ndarray, np.ndarray]:
    """k and s of the three paints for unit thickness, (paints, bands): a blue, a white
    and a black.
    """
    hue = np.exp(-(((GRID - 590) / 70) ** 2))
    k = np.stack(
        [0.02 + 4.0 * hue, 0.01 + 0.05 * np.exp(-(GRID - 400) / 40), np.full(GRID.size, 12.0)]
    )
    s = np.stack([np.full(GRID.size, 1.0), 12.0 - (GRID - 400) / 50, np.full(GRID.size, 0.3)])
    return k, s


THICKNESS = np.array([1.0, 0.8, 1.2, 1.0, 0.9, 1.1])


def painted(thickness=THICKNESS, recipes=RECIPES):
    k, s = truth()
    order, weights = weight_table(tuple(recipes), recipes)
    shares = weights / weights.sum(axis=1, keepdims=True)
    amounts = thickness[:, None] * shares[:, [order.index(paint) for paint in PAINTS]]
    return simulate_films(
        GRID, amounts @ k, amounts @ s, names=tuple(recipes), noise=Noise(), seed=1
    )


def posed(films, recipes, *, references=None, gauge=None, unit=UNIT):
    """The problem of a joint fit."""
    paints, weights = weight_table(films.names, recipes)
    problem, _ = pose(
        films,
        paints,
        MixingLaw().shares(weights, paints),
        response=film_response("d:8"),
        instrument=Instrument(),
        noise=Noise(),
        expected=Expectations(thickness=0.3),
        references=references or {},
        gauge=gauge,
        gloss={},
        unit=unit,
        used=np.ones(len(films), bool),
    )
    return problem


@pytest.fixture(scope="module", params=["", slow("told")])
def small(request):
    """A problem of three paints, six films and seven bands, at a point that is not its solution.

    Alone, and told the white, a thickness and that one card was not measured and one film is
    opaque.
    """
    films = painted()
    told = {}
    rng = np.random.default_rng(3)
    if request.param:
        assumed, opaque = np.zeros((6, 2), bool), np.zeros(6, bool)
        assumed[2:4, 1], opaque[5] = True, True
        films = replace(films, assumed=assumed, opaque=opaque)
        k, s = truth()
        modes = 0.1 * rng.standard_normal((3, 2, GRID.size))
        white = Pigment(
            "ZincWhite", GRID, k[1] / UNIT, s[1] / UNIT, error_modes=modes, provenance="mine"
        )
        told = {"references": {"ZincWhite": white}, "gauge": Gauge({"tint": 30e-6})}
    problem = posed(films, RECIPES, **told)
    # The blue's own film is nearly black at some bands.
    assert np.any(problem.steepness)
    point = Unknowns(
        jnp.asarray(rng.normal(-0.5, 0.7, (GRID.size, 6))),
        jnp.asarray(rng.normal(0, 0.1, problem.scale.films.shape)),
        jnp.asarray(rng.normal(0, 0.1, problem.scale.paints.shape)),
        jnp.asarray(rng.normal(0, 0.5, len(problem.thickness_modes))),
    )
    return problem, point


@pytest.fixture(scope="module")
def dense_jacobian(small):
    problem, point = small
    flat, unravel = ravel_pytree(point)
    jacobian = jax.jit(jax.jacfwd(lambda y: ravel_pytree(residuals(unravel(y), problem))[0]))
    return np.asarray(jacobian(flat))


@pytest.fixture(scope="module")
def whole(small, dense_jacobian):
    """Covariance of coefficients and thicknesses as they are, with what errors of the known add."""
    problem, point = small
    flat, unravel = ravel_pytree(point)
    slopes = jax.jit(jax.jacfwd(lambda y: ravel_pytree(totals(unravel(y), problem))[0]))
    added = np.asarray(slopes(flat))
    return added @ np.linalg.inv(dense_jacobian.T @ dense_jacobian) @ added.T


def test_steps_equal_a_dense_solve(small, dense_jacobian):
    problem, point = small
    right, _ = ravel_pytree(residuals(point, problem))
    seen = look(problem, point)
    step = solve(factorise(seen.normal), np.asarray(seen.gradient))
    assert float(seen.cost) == pytest.approx(0.5 * np.sum(right**2))
    expected = np.linalg.lstsq(dense_jacobian, right, rcond=None)[0]
    assert_allclose(step, expected, rtol=1e-6, atol=1e-8)


@pytest.fixture(scope="module")
def covariance(small):
    problem, point = small
    return JointCovariance.of(problem, factorise(look(problem, point).normal))


def test_covariance_equals_the_dense_inverse(small, covariance, whole):
    problem, point = small
    count = point.bands.size
    close = partial(assert_allclose, rtol=1e-6, atol=1e-10)
    for band, block in enumerate(covariance.of_bands(GRID.size)):
        rows = slice(6 * band, 6 * band + 6)
        close(block, whole[rows, rows])
    close(covariance.of_shared, whole[count:, count:])
    close(covariance.times(np.eye(len(whole))), whole)
    others = len(problem.thickness_modes)
    slopes, across = covariance.regress(range(others))
    first = len(whole) - others
    close(across, whole[first:, :count])
    close(whole[first:, first:] @ slopes, across)


def test_error_modes_are_the_largest_of_the_dense_inverse(small, covariance, whole):
    """All bands together, errors of what is known among them; and what is left where the others are
    known.
    """
    problem, point = small
    count, others = point.bands.size, len(problem.thickness_modes)
    first = len(whole) - others
    inner, across, own = whole[:count, :count], whole[first:, :count], whole[first:, first:]

    size = np.linspace(0.1, 1.0, count).reshape(point.bands.shape)
    for some, expected, given in (
        (6, inner, ()),
        (count, inner, ()),
        (6, inner - across.T @ np.linalg.solve(own, across), tuple(range(others))),
    ):
        modes = covariance.largest(size, some, given)
        scaled = expected * np.outer(size, size)
        values, vectors = np.linalg.eigh(scaled)
        best = (vectors[:, -some:] * values[-some:]) @ vectors[:, -some:].T
        found = modes.reshape(some, -1)
        assert modes.shape == (some, *point.bands.shape)
        assert_allclose(found.T @ found, best, atol=1e-4 * values[-1])


def test_steps_end_where_the_cost_has_no_slope(small):
    problem, point = small
    end, descent = solve_jointly(problem, point, 1.0, 100, lambda steps: None)
    assert descent.settled
    assert descent.steps < 90
    before, after = look(problem, point), look(problem, end)
    assert after.cost < 0.1 * before.cost
    assert np.abs(after.gradient).max() < 1e-3 * np.abs(before.gradient).max()


def test_what_is_known_is_added_and_taken_away(small):
    problem, point = small
    there = totals(point, problem)
    for first, second in zip(point, totals(there, problem, sign=-1.0), strict=True):
        assert_allclose(first, second, atol=1e-12)
    if len(problem.thickness_modes):
        assert np.abs(there.bands - point.bands).max() > 0.01
        assert np.abs(there.films - point.films).max() > 0.01


def test_a_prior_counts_in_its_own_units(small):
    problem, point = small
    at_scale = point._replace(
        films=problem.scale.films, paints=problem.mean.paints + problem.scale.paints
    )
    off = residuals(at_scale, problem).prior
    assert_allclose(off.films[:, :2], 1.0)
    assert_allclose(off.paints, 1.0)
    freedom = float(problem.tail)
    used = np.asarray(problem.minor).any(axis=2)
    assert_allclose(np.asarray(off.films)[:, 2:][used] ** 2, (freedom + 1) * np.log1p(1 / freedom))


def test_a_film_of_its_own_gloss_and_a_wrong_weight_are_found():
    """A film is a tenth less glossy than its paint, a recipe is off by a tenth: the joint fit says
    which and how.
    """
    films = painted(np.ones(6))
    dull, wrong = 1, 2
    less = 0.1 * Instrument().seen_surface * (np.arange(6)[:, None] == dull)
    tight = Expectations(
        model_floor=0.0, model_share=0.0, gloss=0.1, weight_share=0.03, weight_floor=0.0
    )
    said = RECIPES | {"tint": {"CobaltBlue": 10.0 / 1.1, "ZincWhite": 90.0}}
    result = recover_jointly(raise_readings(films, -less), said, expectations=tight)
    gloss = result.unknowns.films[:, 1]
    assert gloss[dull] == gloss.min()
    assert gloss[dull] - gloss[wrong] == pytest.approx(np.log(0.9), abs=0.04)
    assert result.unknowns.films[wrong, 2] == pytest.approx(np.log(1.1), abs=0.04)
    assert result.rmse.max() < 0.003


def test_recovers_paints_within_their_errors():
    tight = Expectations(model_floor=0.0, model_share=0.0, weight_share=0.003, weight_floor=0.0)
    told = []
    result = recover_jointly(
        painted(), RECIPES, expectations=tight, progress=lambda *how: told.append(how)
    )
    assert result.converged
    # Each step of either stage is told before it is taken.
    last = [done for done, _, words in told if words.startswith("fitting all together")]
    assert last == [*range(result.steps)]
    assert len(last) < len(told)
    assert result.rmse.max() < 0.003
    assert result.delta_e().max() < 0.3
    order = [result.row(paint) for paint in PAINTS]
    k, s = truth()
    off = np.log(np.stack([result.absorption[order] / k, result.scattering[order] / s]))
    # Thickness, and with it k and s, is known up to a common factor only.
    known = result.log_sd[:, order] < 0.3
    assert known.mean() > 0.8
    assert np.abs(off / result.log_sd[:, order])[known].max() < 4.5
    ratio = off[0] - off[1]
    assert np.mean(np.abs(ratio) < 2 * result.log_ratio_sd[order]) > 0.85


def test_bronzing_is_not_taken_for_scattering():
    """A black whose surface reflects more in the red: less of it is taken for scattering."""
    recipes = {
        "black": {"BoneBlack": 100.0},
        "white": {"ZincWhite": 100.0},
        "grey": {"ZincWhite": 90.0, "BoneBlack": 10.0},
        "pale": {"ZincWhite": 98.0, "BoneBlack": 2.0},
        "blue": {"CobaltBlue": 100.0},
        "tint": {"CobaltBlue": 20.0, "ZincWhite": 80.0},
    }
    bronze = np.outer(np.arange(6) == 0, 0.01 * ((GRID - 400) / 300) ** 2)
    films = raise_readings(painted(np.ones(6), recipes), bronze)

    def rise(expectations: Expectations) -> dict[str, float]:
        found = recover_jointly(films, recipes, expectations=expectations)
        return {
            paint: float(np.ptp(np.log(found.scattering[found.row(paint)]))) for paint in PAINTS
        }

    steep, flat = rise(Expectations(slope_s=100.0)), rise(Expectations())
    assert steep["BoneBlack"] > 1.0
    assert flat["BoneBlack"] < 0.6 * steep["BoneBlack"]
    # Paints that are seen are as they were.
    for paint in ("CobaltBlue", "ZincWhite"):
        assert flat[paint] == pytest.approx(steep[paint], abs=0.05)


def test_draws_spread_as_laplace_says(small, covariance):
    problem, point = small
    middle = jax.tree.map(np.asarray, totals(point, problem))
    drawn = covariance.draw(middle, 3000)
    off = np.asarray(drawn.bands) - middle.bands
    for band in (0, GRID.size - 1):
        assert_allclose(
            np.std(off[:, band], axis=0),
            np.sqrt(np.diagonal(covariance.of_bands(GRID.size)[band])),
            rtol=0.07,
        )
    films = np.asarray(drawn.films).reshape(3000, -1) - middle.films.ravel()
    assert_allclose(
        np.std(films, axis=0),
        np.sqrt(np.diagonal(covariance.of_shared))[: films.shape[1]],
        rtol=0.07,
    )
    # Errors of one band go with those of the next: the curvature ties them.
    assert np.corrcoef(off[:, 3, 0], off[:, 4, 0])[0, 1] > 0.5


@pytest.fixture(scope="module")
def recovered():
    films = painted()
    return recover_jointly(films, RECIPES), films


@pytest.mark.slow
def test_films_left_out_lie_within_their_bands(recovered):
    whole, films = recovered
    seen = []
    out = cross_validate(whole, films, RECIPES, progress=lambda *step: seen.append(step[2]))
    assert out.names == ("tint", "half", "grey", "shade")
    assert seen == [f"leaving out {name}" for name in out.names]
    assert out.complete
    # Nothing is wrong with the recipes of painted films: they are predicted better than real ones
    # are.
    assert np.median(out.predicted) < 2.0
    assert out.inside.mean() > 0.9
    assert np.all(out.expected > 0.3)
    with refusal("no film can be left out"):
        cross_validate(whole, films, RECIPES, only=lambda name: False)


def test_an_interrupt_keeps_the_films_that_are_done(recovered):
    whole, films = recovered

    def stop(done, total, words):
        if words == "leaving out half":
            raise KeyboardInterrupt

    out = cross_validate(whole, films, RECIPES, progress=stop)
    assert out.names == ("tint",)
    assert not out.complete


def test_a_reading_that_there_is_not_judges_no_prediction(recovered):
    """Its place holds what was read over the other card, or anything."""
    whole, films = recovered
    seen = np.ones((len(films), 2), bool)
    seen[films.names.index("tint"), 0] = False
    first, second = (
        cross_validate(
            whole,
            replace(films, over_black=np.where(seen[:, :1], films.over_black, copied), seen=seen),
            RECIPES,
            only=lambda name: name == "tint",
        )
        for copied in (films.over_white, 0.01)
    )
    assert_allclose(second.predicted, first.predicted, rtol=1e-6)
    assert first.predicted[0, 0] == first.predicted[0, 1]
    assert_allclose(second.inside, first.inside)
    assert_allclose(second.variation.weights, first.variation.weights, rtol=1e-6)
    # The table has no field for it.
    _, (row,) = left_out_table(whole, second)
    assert [field == "" for field in row[2:]] == [True, False, False, False, True, False]


def test_a_film_left_out_does_not_matter_and_is_predicted():
    films = painted()
    use = np.array([1.0, 1.0, 1.0, 0.0, 1.0, 1.0])
    # Over black it would demand that its largest paint is matt.
    spoilt = replace(
        films,
        over_black=np.where(use[:, None], films.over_black, 0.02),
        over_white=np.where(use[:, None], films.over_white, 0.5),
    )
    first, second = (recover_jointly(f, RECIPES, use=use) for f in (films, spoilt))
    assert_allclose(first.absorption, second.absorption, rtol=1e-6)
    (found,) = predict_films(first, films.select(["half"]), RECIPES)
    assert_allclose(found.reflectance, films.over_cards[3], atol=0.01)


def test_a_film_left_out_does_not_say_that_its_paint_is_nearly_black():
    films = painted()
    pale = np.where(np.equal(films.names, "blue")[:, None], 0.5, films.over_white)
    use = np.array([0.0, 1.0, 1.0, 1.0, 1.0, 1.0])
    first, second = (
        recover_jointly(f, RECIPES, use=use, noise=Noise(), max_steps=1).problem.steepness
        for f in (films, replace(films, over_white=pale))
    )
    assert_array_equal(first, second)
    # Without its own film the shade says so.
    assert np.any(first)


def test_which_of_two_equal_films_comes_first_says_nothing_of_a_paint():
    readings = np.array([[[0.045]], [[0.3]], [[0.05]]])
    shares = np.array([[1.0, 0.0], [1.0, 0.0], [0.2, 0.8]])
    for order in ([0, 1, 2], [1, 0, 2], [2, 1, 0]):
        # A paint is nearly black where all its purest films are.
        dark = nearly_black(readings[order], shares[order], 0.04)
        assert_array_equal(dark, [[False, True]])


def test_curvature_is_the_same_integral_on_any_grid():
    sums = [
        np.sum((curvature_matrix(grid) @ np.sin(grid / 40)) ** 2)
        for grid in (
            np.arange(400.0, 701, 10),
            np.arange(400.0, 701, 5),
            np.unique(np.r_[400:550:5, 550:701:10.0]),
        )
    ]
    assert max(sums) / min(sums) < 1.06


def test_heavy_tail_is_students_t():
    from scipy.stats import t

    x = jnp.array([-30.0, -1.0, 0.0, 1e-5, 0.5, 8.0])
    freedom = jnp.asarray(3.0)
    assert_allclose(heavy_tail(x, freedom) ** 2, 2 * (t.logpdf(0, 3) - t.logpdf(x, 3)), atol=1e-9)
    slopes = jax.jit(jax.vmap(jax.grad(heavy_tail), (0, None)))
    assert np.isfinite(slopes(x, freedom)).all()


def test_laws():
    weights = np.array([[90.0, 10.0]])
    assert MixingLaw().shares(weights, ("a", "b")) == pytest.approx(np.array([[0.9, 0.1]]))
    dense = MixingLaw("volume", densities={"a": 2.0, "b": 1.0})
    assert dense.shares(weights, ("a", "b")) == pytest.approx(np.array([[45 / 55, 10 / 55]]))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"name": "weight"}, "unknown mixing law 'weight'"),
        ({"name": "volume"}, "needs the densities"),
        ({"name": "volume", "densities": {"a": -1.0}}, "density of 'a' is -1"),
    ],
)
def test_bad_laws(arguments, message):
    with refusal(message):
        MixingLaw(**arguments)


def test_bad_recipes():
    films = painted(np.ones(6))
    with refusal("film 'blue' is made of"):
        recover_jointly(films, {})
    with refusal("no density was given for 'ZincWhite'"):
        MixingLaw("volume", densities={"CobaltBlue": 3.0}).shares(
            np.ones((1, 2)), ("CobaltBlue", "ZincWhite")
        )
    with refusal("must be 0 or more"):
        recover_jointly(films, RECIPES | {"half": {"CobaltBlue": -1.0, "ZincWhite": 2.0}})
