"""Films of several coats: what is found of each, against films that the public solver makes, and
limits.
"""

from dataclasses import replace
from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.stats import multivariate_normal

from glazefit import (
    CoatPrior,
    Instrument,
    ModelError,
    Noise,
    Prior,
    Reading,
    SpectraPrior,
    posterior_of_coats,
    posterior_of_film,
)
from glazefit.film.errors import ScaledReadings
from glazefit.film.forward import slopes
from glazefit.film.model.errors import smooth_kernel
from glazefit.film.model.variation import STRENGTH
from glazefit.film.solve import solve
from glazefit.posterior.bands import pose_bands
from glazefit.posterior.coats import parse_coats
from glazefit.posterior.film import pose_stack
from glazejax import Glaze, Hemispherical, Layer, Mixture, Pigment, reflectance

from ..refusals import refusal

GRID = np.arange(400.0, 701.0, 50.0)
INSTRUMENT, NOISE, PRIOR = Instrument(), Noise(), Prior()


def paint(name, absorption, scattering):
    ones = np.ones(GRID.size)
    return Pigment(name, GRID, absorption * ones, scattering * ones)


RED = paint("red", np.geomspace(3e5, 3e3, GRID.size), 5e3)
BLUE = paint("blue", np.geomspace(2e3, 2e5, GRID.size), 2e4)
WHITE = paint("white", np.geomspace(2e3, 1e2, GRID.size), 4e5)
FORWARD = Pigment("forward", GRID, RED.absorption, RED.scattering, phase=[1.0, 0.5])
SHELF = {p.name: p for p in (RED, BLUE, WHITE)}


def over_grounds(layers, grounds=(0.03, 0.93), **how):
    """What the public solver says of the layers without their surface, (bands, grounds)."""
    geometry = Hemispherical(8.0, specular=False)
    return np.stack([reflectance(Glaze(layers, g), geometry, **how) for g in grounds], axis=-1)


def read(layers, grounds=(0.03, 0.93), gloss=0.6):
    """What a noisy instrument reads on the layers, by a method of the solver that the posterior
    does not use.
    """
    bare = over_grounds(layers, grounds, tolerance=1e-5, method="manyflux")
    exact = bare + gloss * INSTRUMENT.seen_surface
    seen = exact + NOISE.sd(exact) * np.random.default_rng(0).standard_normal(exact.shape)
    under = np.broadcast_to(grounds, exact.shape)
    names = tuple(f"ground {g:g}" for g in grounds)
    return Reading("film", GRID, seen, under, NOISE.sd(exact), np.zeros_like(exact), names)


BODY = Layer(Mixture([BLUE, WHITE], [0.3, 0.7]), 30e-6)
GLAZED = [Layer(RED, 8e-6), BODY]
COATS = [CoatPrior([RED]), CoatPrior([BLUE, WHITE])]


@pytest.fixture(scope="module")
def sampled():
    """A glaze over a body of two paints, nothing known but the paints; read without an error of
    the model.
    """
    exact = ModelError(amplitude=0.0, share=0.0)
    # As long as the other chain: one program.
    return posterior_of_coats(usual_reading(), COATS, discrepancy=exact, steps=900, thin=3)


def rows(posterior):
    return {row.quantity: row for row in posterior.summary()}


@pytest.mark.slow
def test_every_coat_is_found(sampled):
    found = rows(sampled)
    truth = {
        "thickness of coat 1": 8e-6,
        "fraction blue of coat 2": 0.3,
        "fraction white of coat 2": 0.7,
        "thickness of coat 2": 30e-6,
        "gloss": 0.6,
    }
    assert set(found) == {*truth, "model error"}
    # As the readings show them; how strong the paints are in this film is not shown.
    shown = sampled.problem.shown(sampled.free)
    for name, value in truth.items():
        assert np.median(shown[name]) == pytest.approx(value, abs=4 * shown[name].std()), name
    assert shown["thickness of coat 1"].std() < 0.05 * 8e-6
    assert shown["thickness of coat 2"].std() < 0.2 * 30e-6
    assert found["thickness of coat 1"].sd > 0.2 * 8e-6
    assert sampled.chain is not None
    assert np.isfinite(sampled.chain.log_probability).all()
    assert_allclose(
        sampled.draws["fraction blue of coat 2"] + sampled.draws["fraction white of coat 2"],
        1.0,
        rtol=1e-12,
    )


@pytest.mark.slow
def test_arviz_has_every_coat(sampled):
    data = sampled.inference_data
    assert {"thickness_of_coat_1", "thickness_of_coat_2", "gloss", "fraction"} <= set(
        data.posterior
    )
    assert list(data.posterior["paint"].values) == ["blue of coat 2", "white of coat 2"]
    spectra = data.posterior_predictive["reflectance"].values.reshape(-1, GRID.size, 2)
    assert_allclose(np.median(spectra, axis=0), sampled.films[0].reflectance, atol=0.01)


@pytest.mark.slow
def test_what_a_hiding_coat_hides_is_named():
    """Under a coat that hides everything the lower coat's posterior is its prior, and the answer
    says so.
    """
    tar = paint("tar", 3e5, 5e5)
    film = read([Layer(tar, 60e-6), BODY])
    result = posterior_of_coats(film, [CoatPrior([tar], 60e-6, 0.3), COATS[1]], steps=900, thin=3)
    sentences = result.identifiability.sentences
    for name in ("thickness of coat 2", "fraction blue of coat 2"):
        assert f"{name}: not constrained by these readings: its posterior is its prior" in sentences
    low, high = np.quantile(result.draws["thickness of coat 2"], (0.05, 0.95))
    assert np.log(high / low) == pytest.approx(2 * 1.645 * PRIOR.spread, rel=0.15)


@pytest.mark.slow
def test_nothing_of_a_told_stack_is_called_open(sampled):
    assert not [s for s in sampled.identifiability.sentences if "thickness" in s or "fraction" in s]


@pytest.fixture(scope="module")
def single():
    """The body alone, by the film's own posterior."""
    film = read([BODY])
    return film, posterior_of_film(film, [BLUE, WHITE], steps=0)


def assert_same(result, expected, coat, *names):
    """Of this coat what was found of the film, and the same gloss."""
    found, single = rows(result), rows(expected)
    for name in (*names, "thickness", "fraction blue", "gloss"):
        mine = name if name in found else f"{name} of coat {coat}"
        here, there = (
            np.array([row.lower, row.median, row.upper]) for row in (found[mine], single[name])
        )
        assert_allclose(here, there, atol=0.1 * (there[2] - there[0]), err_msg=mine)


@pytest.mark.slow
def test_a_stack_of_one_coat_is_a_film(single):
    film, expected = single
    result = posterior_of_coats(film, COATS[1:], steps=0)
    assert_same(result, expected, 1, "fraction white", "model error")
    assert_allclose(result.laplace.modes[0, 0], expected.laplace.modes[0, 0], atol=3e-3)


@pytest.mark.slow
def test_a_coat_of_hardly_any_thickness_changes_nothing_and_is_not_told(single):
    film, expected = single
    result = posterior_of_coats(film, [CoatPrior([RED], 1e-11, 0.5), COATS[1]], steps=0)
    assert_same(result, expected, 2)
    assert "thickness of coat 1: not constrained by these readings: its posterior is its prior" in (
        result.identifiability.sentences
    )


@cache
def usual_reading():
    return read(GLAZED)


def problem_of(coats, film=None, discrepancy=None):
    settings = INSTRUMENT, PRIOR, SpectraPrior()
    return pose_stack(film or usual_reading(), coats, *settings, discrepancy=discrepancy)


def values_at(free, problem):
    """Quantities by their names."""
    return {quantity.name: float(quantity.values(free)) for quantity in problem.quantities}


def first_of(problem):
    """The data of its first film."""
    return jax.tree.map(lambda a: a[0], problem.data)


UNKNOWN = [CoatPrior(), CoatPrior([BLUE, WHITE], 30e-6, fractions=[0.3, 0.7])]


def spectra_of(named, *coefficients):
    """Of the unknown coat, each (bands,)."""
    return np.array([[named[f"{what} at {w:g} nm"] for w in GRID] for what in coefficients])


def assert_reads(problem, free, layers, gloss):
    """At these unknowns the model says of its film what the public solver says of these layers."""
    data = first_of(problem)
    fitted = jax.jit(lambda free: problem.film.read(free, data, problem.shared))(free)
    expected = over_grounds(layers) + INSTRUMENT.seen_surface * gloss
    assert_allclose(fitted, expected, atol=2e-4)


def test_readings_are_the_public_solvers():
    """At the truth, of known coats and of an unknown one whose spectra are sums of the modes."""
    free = jnp.array([np.log(8e-6 / 25e-6), np.log(0.3 / 0.7), np.log(30e-6 / 25e-6), 0.4, 0.0])
    assert_reads(problem_of(COATS), free, GLAZED, 1 / (1 + np.exp(-0.4)))
    problem = problem_of(UNKNOWN)
    free = np.random.default_rng(0).standard_normal(problem.dims)
    named = values_at(free, problem)
    k, s = spectra_of(named, "absorption", "scattering") / 1e-5
    assert_reads(problem, jnp.asarray(free), [Layer(paint("x", k, s), 1e-5), BODY], named["gloss"])
    assert_allclose(named["ratio at 400 nm"], k[0] / s[0])


@pytest.mark.parametrize("coats", [COATS, UNKNOWN], ids=["known", "unknown"])
def test_prior_is_what_the_log_probability_says(coats):
    problem = problem_of(coats)
    free = problem.prior_draws(np.random.default_rng(0), 3000)
    prior = (
        problem.log_probability(free[:, None])[:, 0] - problem.log_likelihood(free[:, None])[:, 0]
    )
    expected = np.zeros(len(free))
    for name, x in zip(problem.unknowns, free.T, strict=True):
        if name.startswith("thickness"):
            # Readings show thickness times strength: of one paint, and of two whose squared shares
            # sum to 2/3 on average.
            squares = {1: 1.0, 2: 2.0 / 3.0}[len(coats[int(name[-1]) - 1].paints)]
            expected -= 0.5 * x**2 / (PRIOR.spread**2 + STRENGTH**2 * squares)
        elif name.startswith("mode "):
            expected -= 0.5 * x**2
        elif name == "model error":
            expected -= 0.5 * ((x - np.log(PRIOR.error)) / PRIOR.error_spread) ** 2
        else:
            share = 1 / (1 + np.exp(-x))
            expected += np.log(share * (1 - share))
    far = np.isfinite(prior)
    assert far.mean() > 0.99
    assert_allclose(prior[far], expected[far], atol=1e-5)
    assert_allclose(np.cov(free, rowvar=False), problem.prior_covariance, atol=0.3)


def caused_by(slopes):
    """Covariance of the readings by errors that are smooth along the bands, from the readings'
    slopes by each error at their own band, (bands, grounds).
    """
    smooth = smooth_kernel(GRID, PRIOR.error_length)
    wide = [
        np.einsum("bg,bc->bgc", slope, np.eye(GRID.size)).reshape(-1, GRID.size) for slope in slopes
    ]
    return sum(matrix @ smooth @ matrix.T for matrix in wide)


def of_noise_and_model(film, computed):
    """Covariance of readings, (bands, grounds), by noise and by the model's own error, which two
    grounds share by .6.
    """
    size = (0.001 + 0.01 * computed).ravel()
    grounds = 0.6 + 0.4 * np.eye(computed.shape[1])
    model = np.outer(size, size) * np.kron(smooth_kernel(GRID, 60.0), grounds)
    return np.diag(film.sd.ravel() ** 2) + model


@pytest.mark.slow
def test_likelihood_holds_the_paints_errors():
    """W and b against diag(v) + A + e^2 J K J^T, with J by finite differences of the public solver."""
    film = usual_reading()
    problem, found = solve(problem_of(COATS, film))
    data = first_of(problem).expansion
    point = found.points[0, 0]
    named = values_at(point, problem)
    blue = named["fraction blue of coat 2"]
    off = np.exp(data.shift).reshape(2, 2, -1)
    body = Mixture([BLUE, WHITE], [blue, 1 - blue])
    coats = off * np.array([[coat.absorption, coat.scattering] for coat in (RED, body)])
    thick = [named["thickness of coat 1"], named["thickness of coat 2"]]

    def readings(errors):
        layers = [
            Layer(paint("coat", k, s), thickness)
            for (k, s), thickness in zip(coats * np.exp(errors), thick, strict=True)
        ]
        return over_grounds(layers, tolerance=1e-8)

    size = 1e-3
    # Bands do not meet, so one step of all bands gives the whole slope.
    caused = caused_by(
        (readings(step) - readings(-step)) / (2 * size)
        for step in size * np.eye(4).reshape(4, 2, 2, 1)
    )
    back = np.linalg.inv(data.whiten)
    computed = readings(np.zeros((2, 2, 1))) + named["gloss"] * INSTRUMENT.seen_surface
    assert_allclose(back @ back.T, of_noise_and_model(film, computed), rtol=1e-3, atol=1e-8)
    assert_allclose((back * data.spread**2) @ back.T, caused, atol=0.02 * np.abs(caused).max())


def test_an_unknown_paint_has_no_error_of_its_coefficients():
    """Its spectra are sought: an error of them would be counted twice. Those of the body stay."""
    logs = np.log(np.full((1, 4, GRID.size), 0.5))
    grounds = np.full((1, GRID.size, 2), 0.5)
    known, unknown = (
        np.asarray(slopes(problem_of(coats).film, None, logs, grounds).by_log).reshape(2, -1)
        for coats in (COATS, UNKNOWN)
    )
    assert np.all(known != 0)
    assert_array_equal(unknown[0], 0)
    assert_allclose(unknown[1], known[1], rtol=1e-6)


SMOOTH = paint("glaze", np.geomspace(2e4, 1e5, GRID.size), 3e4)


@pytest.mark.slow
@pytest.mark.parametrize("grounds", [(0.03, 0.93), (0.93,)], ids=["two grounds", "one ground"])
def test_an_unknown_paint_over_a_known_body(grounds):
    """k and s of the upper coat, with the solver's films; what one ground does not tell of s stays
    wide.
    """
    film = read([Layer(SMOOTH, 10e-6), Layer(WHITE, 15e-6)], grounds, gloss=0.9)
    prior = Prior(error=0.003, error_spread=0.5)
    result = posterior_of_coats(
        film, [CoatPrior(), CoatPrior([WHITE], 15e-6)], prior=prior, steps=0
    )
    found = rows(result)
    for band, wavelength in enumerate(GRID):
        row = found[f"absorption at {wavelength:g} nm"]
        assert row.lower / 1.3 < 10e-6 * SMOOTH.absorption[band] < row.upper * 1.3
    for name in ("absorption", "ratio"):
        assert result.spectra()[name].shape == (len(result.laplace.sample), GRID.size)
    assert result.inference_data.posterior["absorption"].dims[-1] == "wavelength"
    # One reading a band cannot tell two numbers; two tell both, but for a band at the edge at most.
    open_bands = [s for s in result.identifiability.sentences if s.startswith("unknown paint")]
    if len(grounds) == 1:
        assert any("400-700 nm: neither k nor s" in words for words in open_bands)
    else:
        assert not any("neither" in words or "-" in words.split(":")[0] for words in open_bands)


def test_modes_hold_the_spectra_of_the_prior():
    """Their covariance is that of the process, but for a fiftieth of k or s at most; written out at
    two bands.
    """
    prior, grid = SpectraPrior(), np.arange(400.0, 701.0, 10.0)
    for modes, level, shape in zip(
        prior.modes(grid),
        (prior.absorption_level, prior.scattering_level),
        (prior.absorption_shape, prior.scattering_shape),
        strict=True,
    ):
        assert np.any(modes != 0, axis=0).sum() < grid.size
        covariance = modes @ modes.T
        assert_allclose(np.diag(covariance), level**2 + shape**2, atol=0.02**2)
        x = np.sqrt(5.0) * 100.0 / prior.length
        alike = (1 + x + x**2 / 3) * np.exp(-x)
        assert covariance[5, 15] == pytest.approx(level**2 + shape**2 * alike, abs=0.02**2)


def test_words_for_coats():
    coats = parse_coats("red:~5um x2, 0.25*blue + 0.75*white:20um, Blue+white:?", SHELF, 0.4)
    both = ["blue", "white"]
    assert [[p.name for p in coat.paints] for coat in coats] == [["red"], both, both]
    assert [coat.thickness for coat in coats] == [pytest.approx(10e-6), pytest.approx(20e-6), None]
    assert [coat.spread for coat in coats] == [0.4, 0.0, 0.0]
    assert [coat.open_thickness for coat in coats] == [True, False, True]
    assert [coat.open_fractions for coat in coats] == [False, False, True]
    assert_allclose(coats[1].shares, [0.25, 0.75])
    unknown, body = parse_coats("?, white:1mm", SHELF, 0.4)
    assert unknown.unknown
    assert unknown.thickness is None
    assert not body.open_thickness


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "list of coats is empty"),
        ("red", "write PAINT:THICKNESS"),
        ("red:", "write PAINT:THICKNESS"),
        ("red:~", "after ~ comes a thickness"),
        ("red:~?", "after ~ comes a thickness"),
        ("red:5", "has no unit"),
        ("blue+:5um", "a \\+ too many"),
        ("0.5*blue+0.6*white:5um", "fractions sum to 1.1"),
        ("reed:5um", "no pigment 'reed'"),
        ("?:?,?:?", "paints of coats 1 and 2 are unknown"),
        ("?:~5um", "leave its thickness out"),
        ("?:12um, white:1mm", "leave its thickness out"),
        ("red:5um," * 6 + "red:5um", "7 coats"),
        ("blue+blue:5um", "'blue' is listed twice"),
    ],
)
def test_wrong_words_are_refused(text, message):
    with refusal(message):
        parse_coats(text, SHELF, 0.4)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: CoatPrior([RED], -1e-6), "must be in \\[0, 0.01\\]"),
        (lambda: CoatPrior([RED], 20.0), "in metres"),
        (lambda: CoatPrior([RED], 1e-6, -0.1), "spread -0.1"),
        (lambda: CoatPrior([RED], spread=0.3), "no thickness to spread about"),
        (lambda: CoatPrior([RED], 0.0, 0.3), "cannot be about 0 thick"),
        (lambda: CoatPrior([RED, BLUE], fractions=[1.0]), "2 paints but 1 fractions"),
        (lambda: CoatPrior([RED, BLUE], fractions=[0.9, 0.2]), "sum to 1"),
        (lambda: CoatPrior([RED, RED]), "listed twice"),
        (lambda: CoatPrior([paint("batch", np.ones((2, 1)), 1.0)]), "'batch' is a batch"),
        (
            lambda: CoatPrior([FORWARD]),
            "'forward' has a phase function",
        ),
        (lambda: SpectraPrior(length=0.0), "length is 0"),
        (lambda: posterior_of_coats(usual_reading(), []), "0 coats"),
        (
            lambda: posterior_of_coats(usual_reading(), [CoatPrior(), CoatPrior()]),
            "coats 1 and 2 are unknown",
        ),
    ],
)
def test_bad_input(call, message):
    with refusal(message):
        call()


@pytest.fixture(scope="module")
def unknown_over_white():
    """A red coat of which nothing is told, over white: the problem, the film, and from unknowns the
    optical thickness and what its table says.
    """
    film = read([Layer(RED, 8e-6), Layer(WHITE, 15e-6)])
    problem = problem_of([CoatPrior(), CoatPrior([WHITE], 15e-6)], film)
    data = first_of(problem)

    @jax.jit
    def looked_up(free):
        thickness = problem.film.optical(free, data, problem.shared)
        return thickness, problem.film.look_up(thickness[..., 0], data, problem.shared)

    return problem, film, looked_up


def test_a_table_of_an_unknown_coat_reads_as_the_solver(unknown_over_white):
    """Readings, and slopes by errors of the coat below, at draws of the prior; by the solver."""
    problem, _, looked_up = unknown_over_white
    model = problem.film
    data = first_of(problem)
    solved = jax.jit(lambda thickness: model.body(None, thickness[:, :, None], data.ground))
    for free in problem.prior_draws(np.random.default_rng(1), 4):
        thickness, seen = looked_up(free)
        assert seen.by_log is not None
        assert_allclose(seen.body, solved(thickness), atol=2e-4)
        for which in range(2):
            factor = thickness.at[which, :, 1]
            more, less = (solved(factor.multiply(np.exp(step))) for step in (0.05, -0.05))
            slope = (more - less) / 0.1
            assert_allclose(seen.by_log[which], slope, atol=2e-3)
    # A coat beyond the table's end reads by its k/s.
    beyond = jnp.outer(jnp.array([3000.0, 60.0]), jnp.ones(GRID.size))
    stack = looked_up(jnp.zeros(problem.dims))[0].at[..., 0].set(beyond)
    found = model.look_up(beyond, data, problem.shared)
    assert_allclose(found.body, solved(stack), atol=2e-4)


def test_slopes_of_an_unknown_coats_readings_are_their_derivatives(unknown_over_white):
    problem, *_ = unknown_over_white
    data = first_of(problem)
    scaled = problem.scaled
    assert isinstance(scaled, ScaledReadings)
    expected = jax.jit(jax.jacfwd(lambda free: scaled(free, data, problem.shared)))
    found = jax.jit(lambda free: scaled.slopes(free, data, problem.shared))
    for free in problem.prior_draws(np.random.default_rng(2), 3):
        assert_allclose(found(free), expected(free), rtol=1e-9, atol=1e-9)


def test_the_likelihood_of_an_unknown_coat_is_the_gaussian_of_noise_and_errors(unknown_over_white):
    """Against SciPy's density with the covariance diag(v) + A + e^2 J K J^T, differences of two
    places.
    """
    problem, film, looked_up = unknown_over_white
    place = problem.prior_draws(np.random.default_rng(4), 1)
    places = place + np.array([[0.0], [0.02]]) * np.ones(problem.dims)
    heights = []
    for free in places:
        seen = looked_up(free)[1]
        assert seen.by_log is not None
        caused = caused_by(np.asarray(seen.by_log))
        mean = np.asarray(seen.body + problem.film.surface(jnp.asarray(free), problem.shared))
        covariance = np.exp(2 * free[-1]) * caused + of_noise_and_model(film, mean)
        heights.append(
            multivariate_normal(mean.ravel(), covariance).logpdf(film.reflectance.ravel())
        )
    likelihood = problem.log_likelihood(places[:, None])[:, 0]
    assert likelihood[1] - likelihood[0] == pytest.approx(heights[1] - heights[0], rel=1e-4)


def test_a_coat_of_unknown_paint_is_its_bands():
    """Its likelihood is the product of those of the bands, posed one by one at the same gloss."""
    film = read([Layer(RED, 8e-6)])
    film = replace(film, ground_sd=np.full_like(film.sd, 0.01))
    # Errors of the model are similar in neighbouring bands.
    problem = problem_of([CoatPrior()], film, ModelError(amplitude=0.0, share=0.0))
    constants = []
    for free in problem.prior_draws(np.random.default_rng(5), 3):
        named = values_at(free, problem)
        ratio, s = spectra_of(named, "ratio", "scattering")
        bands = pose_bands(film, named["gloss"], INSTRUMENT)
        logs = np.log(np.stack([ratio, s], axis=-1))
        found = {q.name: q.values(logs) for q in bands.quantities}
        assert_allclose(found["absorption"], ratio * s)
        assert_allclose([found["ratio"], found["scattering"]], [ratio, s])
        apart = bands.log_likelihood(logs[None])
        whole = problem.log_likelihood(free[None, None])
        constants.append(whole[0, 0] - apart.sum())
    assert_allclose(constants, constants[0], rtol=1e-6)
