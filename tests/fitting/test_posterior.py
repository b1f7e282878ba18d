from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.stats import multivariate_normal

from glazefit import (
    CoatPrior,
    Instrument,
    Noise,
    Prior,
    SpectraPrior,
    posterior_of_bands,
    posterior_of_film,
    reading_over,
    simulate_films,
)
from glazefit.film.films import readings
from glazefit.film.problem import log_probability
from glazefit.film.sampling import Sampling
from glazefit.film.solve import Gaussians, Laplace, _distinct, climb, solve
from glazefit.posterior.bands import pose_bands
from glazefit.posterior.film import pose_stack
from glazefit.posterior.identifiability import directions
from glazefit.posterior.report import describe_misfit, describe_unsettled
from glazefit.posterior.summary import Numbers, Row, Summary, compare
from glazejax import Hemispherical, Pigment

from ..checks import finite
from ..refusals import refusal
from ..slow import slow
from .grids import every_pair
from .palette import GRID, optical_depths

INSTRUMENT, NOISE = Instrument(), Noise()


def paint(name, absorption, scattering):
    ones = np.ones(GRID.size)
    return Pigment(name, GRID, absorption * ones, scattering * ones)


BLUE = paint("blue", np.geomspace(2e3, 2e5, GRID.size), 2e4)
WHITE = paint("white", np.geomspace(2e3, 1e2, GRID.size), 4e5)


def film_of(fraction, thickness=20e-6):
    k, s = optical_depths([BLUE, WHITE], [[thickness * fraction, thickness * (1 - fraction)]])
    return simulate_films(GRID, k, s, names=["film"], seed=1)


def uniform_film(k, s):
    ones = np.ones((1, GRID.size))
    return simulate_films(GRID, k * ones, s * ones, names=["film"], seed=2)


@pytest.fixture(scope="module")
def mixed():
    """A film of two paints, sampled."""
    return posterior_of_film(film_of(0.3), [BLUE, WHITE], steps=400)


@pytest.fixture(scope="module")
def banded():
    """A film that is clear at one end and hides its card at the other, sampled band by band."""
    k, s = np.geomspace(0.05, 8.0, GRID.size), np.geomspace(1.0, 40.0, GRID.size)
    return posterior_of_bands(
        simulate_films(GRID, k[None], s[None], names=["film"], seed=4), steps=400
    )


def rows(posterior):
    return {(row.quantity, row.block): row for row in posterior.summary()}


def test_truth_is_found_and_laplace_agrees(mixed):
    found = rows(mixed)
    assert mixed.converged
    # As the readings show them; how strong the paint is in this film is not shown.
    shown = mixed.problem.shown(mixed.free)
    by_laplace = mixed.problem.shown(mixed.laplace.sample)
    for name, truth, most in (("fraction blue", 0.3, 0.02), ("thickness", 20e-6, 1e-6)):
        assert shown[name].std() < most
        assert shown[name].mean() == pytest.approx(truth, abs=4 * shown[name].std())
        assert by_laplace[name].std() == pytest.approx(shown[name].std(), rel=0.25)
        assert found[name, "film"].laplace == "agrees"
        assert found[name, "film"].sd > 2 * shown[name].std()
    # The film was made without an error of the paints.
    assert found["model error", "film"].upper < 0.05


def test_a_film_of_another_paint_is_said(mixed, banded):
    assert describe_misfit(mixed) == describe_misfit(banded) == ""
    red = paint("red", np.geomspace(2e5, 2e3, GRID.size), 2e4)
    wrong = posterior_of_film(film_of(0.3), [red])
    assert "These paints do not explain the film" in describe_misfit(wrong)


def fine_axis(draws, low_end, high_end, count):
    """Places that are dense where nearly all draws are and reach over all that is possible, and
    the length that each stands for.
    """
    low, high = np.quantile(draws, (0.01, 0.99))
    core = np.linspace(2 * low - high, 2 * high - low, count)
    places = np.unique(np.concatenate([core, np.linspace(low_end, high_end, count)]))
    return places, np.gradient(places)


@pytest.mark.slow
def test_bands_equal_a_sum_over_a_grid(banded):
    """The chain's means and intervals of log k/s and log s d, against a dense sum over both.

    Where the film hides its ground, log k/s has a sharp core and a long tail.
    """
    problem = banded.problem
    for band in (1, GRID.size // 2, GRID.size - 1):
        draws = banded.free[:, :, band].reshape(-1, 2)
        axes, lengths = zip(
            fine_axis(draws[:, 0], -14.0, 6.0, 2000),
            fine_axis(draws[:, 1], -6.0, 14.0, 400),
            strict=True,
        )
        grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
        data = jax.tree.map(lambda a, b=band: a[b : b + 1], problem.data)
        logs = np.asarray(
            log_probability(problem.residuals, data, problem.shared, grid.reshape(-1, 1, 2), 50_000)
        ).reshape(grid.shape[:2])
        weight = np.exp(logs - logs.max()) * np.outer(*lengths)
        weight /= weight.sum()
        for n, places in enumerate(axes):
            share = weight.sum(axis=1 - n)
            mean = share @ places
            sd = np.sqrt(share @ (places - mean) ** 2)
            error = sd / np.sqrt(banded.convergence.samples[band])
            assert abs(draws[:, n].mean() - mean) < 5 * error, (band, n)
            ends = np.interp(np.quantile(draws[:, n], (0.05, 0.95)), places, np.cumsum(share))
            assert_allclose(ends, (0.05, 0.95), atol=0.02, err_msg=f"{band}, {n}")


@pytest.mark.slow
def test_only_the_ratio_is_known_where_the_card_is_hidden(banded):
    (sentence,) = banded.identifiability.sentences
    assert "700 nm: only k/s is known" in sentence
    assert "400" not in sentence
    # The direction left open is that of s d at a given k/s.
    last_band = banded.free[:, :, -1].reshape(-1, 2)
    shares, vectors, _ = directions(last_band, banded.problem.prior_covariance)
    assert shares[0] < 1e-3 < 0.05 < shares[1]
    assert abs(vectors[1, 1]) > 0.9


@pytest.mark.slow
def test_summary_says_where_laplace_and_chain_agree(banded):
    assert rows(banded)["absorption", "400 nm"].laplace == "agrees"
    for row in banded.summary():
        ends = np.log([row.lower, row.upper, row.laplace_lower, row.laplace_upper])
        near = np.abs(ends[:2] - ends[2:]).max() <= 0.15 * (ends[1] - ends[0])
        assert near == (row.laplace == "agrees")


def row_of(quantity, block="film", **changed):
    given = {
        "mean": 0.2,
        "sd": 0.02,
        "lower": 0.17,
        "median": 0.2,
        "upper": 0.23,
        "laplace_mean": 0.2,
        "laplace_sd": 0.021,
        "laplace_lower": 0.16,
        "laplace_upper": 0.24,
        "effective_samples": 812.3,
        "autocorrelation_time": 30.0,
        "converged": True,
        "laplace": "agrees",
    }
    return Row(quantity, block, **(given | changed))


def test_a_summary_prints_as_a_table_in_the_units_of_a_painter():
    rows = [
        row_of("fraction A & B"),
        row_of(
            "thickness",
            lower=1e-5,
            median=2e-5,
            upper=3e-5,
            sd=5e-6,
            laplace_lower=9e-6,
            laplace_upper=2.5e-5,
            laplace_sd=4e-6,
            laplace="skewed",
        ),
    ]
    summary = Summary(rows, by="hmc")
    assert [*summary] == rows
    assert summary[1].median == 2e-5
    assert repr(summary).splitlines() == [
        "median [5 %, 95 %]",
        "                        hmc  sd   Laplace   sd  Laplace",
        "A & B (%)       20 [17, 23]   2  [16, 24]  2.1  agrees",
        "thickness (µm)  20 [10, 30]   5   [9, 25]    4  skewed",
    ]
    page = summary._repr_html_()
    assert page.count("<tr>") == 3
    assert page.count("<td>") == 12
    assert "<td>A &amp; B (%)</td><td>20 [17, 23]</td>" in page
    assert Summary(rows, by="").cells()[0] == ["", "Laplace", "sd", "its own test"]
    assert str(Summary([], by="")).splitlines()[0] == "median [5 %, 95 %]"


def test_a_summary_of_bands_has_a_line_for_each():
    names = ("absorption", "scattering", "ratio")
    rows = [row_of(name, f"{nm} nm") for name in names for nm in (400, 410)]
    rows[1] = replace(rows[1], laplace="skewed")
    titles, lines = Summary(rows, by="hmc").cells()
    assert titles == ["band", "k d", "s d", "k/s", "ESS", "Laplace"]
    number = "0.2 [0.17, 0.23]"
    assert lines == [
        ["400", *3 * [number], "812", "agrees"],
        ["410", *3 * [number], "812", "skewed"],
    ]
    assert Summary(rows, by="").cells()[1][0] == ["400", *3 * [number], "agrees"]


def test_how_laplace_fails_is_named():
    rng = np.random.default_rng(0)
    normal = rng.standard_normal(20_000)

    def words(sampled, laplace, share=False, many=False):
        """All but shares are looked at by their logarithms."""
        values = (sampled, laplace) if share else map(np.exp, (sampled, laplace))
        one, other = (Numbers.of(np.asarray(v)[:, None]) for v in values)
        return compare(one, other, logarithmic=not share, multimodal=np.array([many]))[0]

    assert words(normal, normal + 0.1) == "agrees"
    assert words(normal, normal + 0.8) == "shifted"
    assert words(normal, 2 * normal) == "Laplace too wide"
    assert words(normal, 0.4 * normal) == "Laplace too narrow"
    assert words(np.exp(normal), 1 + normal) == "skewed"
    assert (
        words(np.where(normal > 0, 3 + normal, -3 + normal), 3 + normal, many=True) == "two modes"
    )
    assert words(np.abs(0.01 * normal), 0.02 + 0.01 * normal, share=True) == "against a bound"
    # The fraction of a film's only paint.
    assert words(np.ones(100), np.ones(100), share=True) == "agrees"


def test_prior_is_what_the_log_probability_says():
    """Density of the prior's draws against the prior's residuals: means of a few functions, by a
    sum over a grid.
    """
    (reading,) = readings(uniform_film(1.0, 1.0), INSTRUMENT, NOISE)
    problem = pose_bands(reading, 1.0, INSTRUMENT)
    logs = np.linspace(-25, 30, 700)
    grid = every_pair(logs)
    one = jax.tree.map(lambda a: a[:1], problem.data)
    whole, data = (
        np.asarray(log_probability(off, one, problem.shared, grid[:, None], 20_000))[:, 0]
        for off in (problem.residuals, problem.misfit)
    )
    # Free unknowns are log k/s and log s.
    density = np.exp(whole - data)
    density /= density.sum()
    draws = problem.prior_draws(np.random.default_rng(3), 100_000)
    for function in (
        lambda f: f[:, 0],
        lambda f: f[:, 1],
        lambda f: f[:, 1] ** 2,
        lambda f: f[:, 0] * f[:, 1],
    ):
        values = function(draws)
        within = 5 * values.std() / np.sqrt(len(values)) + 0.02
        assert values.mean() == pytest.approx(density @ function(grid), abs=within)
    assert_allclose(np.cov(draws, rowvar=False), problem.prior_covariance, rtol=0.03, atol=0.2)


def test_likelihood_is_the_gaussian_it_is_said_to_be():
    """W, b and the offset against the covariance diag(v) + e^2 J K J^T written out, and the rise of
    its determinant to second order.
    """
    prior = Prior()
    (reading,) = readings(film_of(0.3), INSTRUMENT, NOISE)
    coats = [CoatPrior([BLUE, WHITE])]
    problem, found = solve(
        pose_stack(reading, coats, INSTRUMENT, prior, SpectraPrior(), kind="paints")
    )
    data = jax.tree.map(lambda a: np.asarray(a[0]), problem.data)
    errors = data.expansion
    root = np.linalg.inv(errors.whiten)
    caused = root * errors.spread
    shifted = data._replace(
        absorption=data.absorption * np.exp(errors.shift[0])[..., None],
        scattering=data.scattering * np.exp(errors.shift[1])[..., None],
    )
    points = found.points[0, 0] + np.random.default_rng(1).normal(size=(5, 4)) * 0.01
    expected = []
    for point in points:
        mean = problem.film.read(jnp.asarray(point), shifted, problem.shared)
        off = (reading.reflectance - mean - errors.offset).ravel()
        covariance = root @ root.T + np.exp(2 * point[-1]) * caused @ caused.T
        body = mean - problem.film.surface(jnp.asarray(point), problem.shared)
        gloss = problem.draws(point[None, None])["gloss"].ravel()
        rise = errors.tilt @ (
            np.concatenate([np.log(body).ravel(), gloss, point[-1:]]) - errors.place
        )
        rise += rise**2 / (2 * off.size)
        expected.append(multivariate_normal(cov=covariance).logpdf(off) - rise)
    got = problem.log_likelihood(points[:, None])[:, 0]
    assert_allclose(got - got[0], np.array(expected) - expected[0], rtol=1e-6, atol=1e-6)


def test_slopes_of_the_likelihood_are_those_with_paints_errors_integrated_out():
    """Of a dark film off its paints by a third: Laplace's integral over the errors, whose likeliest
    values are searched for again beside the mode.
    """
    wavelengths = np.linspace(400.0, 700.0, 7)
    ones = np.ones(7)
    paints = [
        Pigment("blue", wavelengths, np.geomspace(2e4, 2e5, 7), 2e4 * ones),
        Pigment("white", wavelengths, np.geomspace(2e3, 1e2, 7), 4e5 * ones),
    ]
    k, s = optical_depths(paints, [[16e-6, 4e-6]])
    k *= np.exp(0.3 * np.sin(wavelengths / 60.0))
    s *= np.exp(0.3 * np.cos(wavelengths / 80.0))
    (reading,) = readings(
        simulate_films(wavelengths, k, s, names=["film"], seed=1), INSTRUMENT, NOISE
    )
    problem, solved = solve(
        pose_stack(reading, [CoatPrior(paints)], INSTRUMENT, Prior(), SpectraPrior(), kind="paints")
    )
    mode = solved.points[0, 0]
    data = jax.tree.map(lambda a: a[0], problem.data)
    correlated = np.linalg.cholesky(problem.shared.smooth)

    @jax.jit
    def off(scores, free):
        """Readings over their standard deviations, and the errors' own scores, (errors bands,)."""
        shift = jnp.exp(free[-1]) * scores.reshape(2, 7) @ correlated.T
        misfit = data.reflectance - problem.film.read(free, data, problem.shared, shift[..., None])
        return jnp.concatenate([data.expansion.whiten @ misfit.reshape(-1), scores])

    slopes_of = jax.jit(jax.jacfwd(off))

    def integral(free):
        scores = np.zeros(14)
        for _ in range(30):
            scores -= np.linalg.lstsq(slopes_of(scores, free), off(scores, free))[0]
        slopes = np.asarray(slopes_of(scores, free))
        half_log_determinant = 0.5 * np.linalg.slogdet(slopes.T @ slopes)[1]
        return -0.5 * float(np.sum(off(scores, free) ** 2)) - half_log_determinant

    for n, unit in enumerate(np.eye(mode.size)):
        step = 1e-3 * unit
        expected = integral(mode + step) - integral(mode - step)
        after, before = (
            problem.log_likelihood(mode[None, None] + by)[0, 0] for by in (step, -step)
        )
        # With slopes J held, thickness is off by 1.6, gloss by 0.3 and error by 0.08.
        slope, name = (after - before) / 2e-3, problem.unknowns[n]
        assert slope == pytest.approx(expected / 2e-3, abs=0.02), name


@pytest.mark.parametrize(
    ("k", "s"), [(0.0, 1e-6), (1e-4, 1e-4), (60.0, 1e-3), (1e-3, 300.0), (90.0, 300.0), (5.0, 0.0)]
)
@pytest.mark.parametrize(("sampler", "walkers"), [("emcee", 64), slow("hmc", 12)])
def test_odd_films_stay_finite(k, s, sampler, walkers):
    result = posterior_of_bands(uniform_film(k, s), sampler=sampler, steps=20, walkers=walkers)
    assert result.chain is not None
    assert finite((result.draws, result.chain.log_probability))
    for row in result.summary():
        assert not row.converged  # so few steps say little
        assert finite([row.mean, row.sd, row.lower, row.upper, row.laplace_mean, row.laplace_sd])


@pytest.mark.slow
def test_odd_films_of_paints_stay_finite():
    for film in (uniform_film(0.0, 1e-6), uniform_film(80.0, 1e-3), uniform_film(1e-3, 300.0)):
        result = posterior_of_film(film, [BLUE, WHITE], steps=60, walkers=12, thin=1)
        assert finite(result.draws)


@pytest.mark.slow
def test_a_film_that_hides_its_ground_may_be_thicker():
    """Its posterior is narrow all the same: nobody expects so thick a film."""
    for thickness, hides in ((400e-6, True), (20e-6, False)):
        result = posterior_of_film(film_of(1.0, thickness), [BLUE], steps=0)
        said = " ".join(result.identifiability.sentences)
        assert ("thickness is open above" in said) == hides


@pytest.mark.slow
def test_one_spectrum_over_a_known_ground():
    films = film_of(0.3)
    single = reading_over(GRID, films.over_white[0], 0.93, name="single")
    result = posterior_of_film(single, [BLUE, WHITE], steps=0)
    fraction = rows(result)["fraction blue", "single"]
    assert finite(fraction.sd)
    assert result.chain is None
    assert not result.converged
    assert "nothing was sampled" in result.words()


@pytest.mark.slow
def test_without_the_specular_part_there_is_no_gloss():
    instrument = Instrument(Hemispherical(8.0, specular=False))
    k, s = optical_depths([BLUE], [[20e-6]])
    films = simulate_films(GRID, k, s, names=["film"], instrument=instrument)
    result = posterior_of_film(films, [BLUE], instrument=instrument, steps=0)
    assert result.problem.unknowns == ("thickness", "model error")


def test_weighted_draws_of_laplace_equal_the_chain(mixed):
    """Where its test trusts it, Laplace's approximation is more than a Gaussian: quantiles of
    skewed unknowns fit.
    """
    assert mixed.laplace.trusted.all()
    by_chain, by_laplace = map(mixed.problem.shown, (mixed.free, mixed.laplace.sample))
    for name in ("fraction blue", "thickness", "model error"):
        chain, weighted = by_chain[name].ravel(), by_laplace[name].ravel()
        low, high = np.quantile(chain, (0.05, 0.95))
        assert_allclose(np.quantile(weighted, (0.05, 0.95)), (low, high), atol=0.15 * (high - low))


def far_away(free, data, shared):
    """Residuals whose least sum of squares lies further away than the steps that are allowed."""
    return jnp.exp(-free) * data


def test_gaussians_of_laplace_have_the_density_of_their_mixture():
    rng = np.random.default_rng(6)
    modes = rng.standard_normal((2, 2, 3))
    roots = rng.standard_normal((2, 2, 3, 3))
    covariances = roots @ np.swapaxes(roots, -1, -2) + 0.5 * np.eye(3)
    weights = np.array([[0.3, 0.7], [1.0, 0.0]])
    roots = np.linalg.cholesky(covariances)
    with np.errstate(divide="ignore"):
        gaussians = Gaussians(modes, roots, np.linalg.inv(roots), np.log(weights))
    found = Laplace(
        gaussians,
        np.array([0.1, 0.9]),
        np.empty((0, 2, 3)),
        np.array([[True, True], [True, False]]),
        np.ones(2),
    )
    points = rng.standard_normal((5, 2, 3))
    for block in range(2):
        exact = sum(
            w * multivariate_normal(m, c).pdf(points[:, block])
            for w, m, c in zip(weights[block], modes[block], covariances[block], strict=True)
        )
        off = gaussians.log_density(np, points)[:, block] - np.log(exact)
        assert_allclose(off, 1.5 * np.log(2 * np.pi), rtol=1e-9)
    mean = np.einsum("bm,bmd->bd", weights, modes)
    assert_allclose(gaussians.draws(40_000, rng).mean(axis=0), mean, atol=0.05)
    # A mode without probability need not have settled; a second one counts from a hundredth.
    assert found.converged.tolist() == [True, True]
    assert found.trusted.tolist() == [True, False]
    assert found.many.tolist() == [True, False]


def test_modes_are_apart_and_not_hopelessly_lower():
    """Of starts that end at the same place the best counts; what is e^20 times less likely, or no
    number, does not.
    """
    found = np.array([[[0.0, 0.0], [0.0, 1e-3], [3.0, 0.0], [-3.0, 0.0], [0.0, 9.0], [9.0, 9.0]]])
    height = np.array([[0.0, -0.1, -5.0, -25.0, np.nan, -np.inf]])
    chosen, real = _distinct(found, np.broadcast_to(0.04 * np.eye(2), (1, 6, 2, 2)), height)
    assert chosen[0][real[0]].tolist() == [0, 2]


@pytest.mark.slow
def test_least_squares_that_did_not_settle_is_said(banded):
    problem = replace(
        banded.problem, misfit=far_away, data=jnp.full((len(banded.problem.blocks), 1), 1e100)
    )
    assert not climb(problem, np.zeros((len(problem.blocks), 1, problem.dims))).settled.any()

    assert banded.laplace.converged.all()
    assert describe_unsettled(banded) == ""
    marks = np.array(banded.laplace.settled)
    marks[1] = False
    stopped = replace(banded, laplace=replace(banded.laplace, settled=marks))
    assert stopped.laplace.converged.tolist() == [n != 1 for n in range(len(marks))]
    assert f"at the mode of {problem.blocks[1]}:" in describe_unsettled(stopped)
    assert stopped.inference_data.attrs["laplace_modes_settled"] == 0


def test_compiled_program_calls_no_library_for_linear_algebra():
    (reading,) = readings(film_of(0.3), INSTRUMENT, NOISE)
    problem = pose_bands(reading, 1.0, INSTRUMENT)
    free = np.zeros((4, len(problem.blocks), 2))
    text = log_probability.jitted.lower(
        problem.residuals, problem.data, problem.shared, free, 100
    ).as_text("hlo")
    assert "lapack_" not in text
    assert "gather" in text, "the table is missing: is this the program that runs?"


def bands_of_film(**options):
    return posterior_of_bands(film_of(0.3), **options)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: posterior_of_film(film_of(0.3), []), "0 paints were given"),
        (lambda: posterior_of_film(film_of(0.3), [BLUE, BLUE]), "'blue' is listed twice"),
        (lambda: posterior_of_film(film_of(0.3), [BLUE], steps=-1), "-1 steps"),
        (lambda: bands_of_film(sampler="emcee", walkers=7), "7 walkers"),
        (lambda: bands_of_film(sampler="emcee", steps=3), "3 steps are fewer"),
        (lambda: bands_of_film(thin=0), "thin is 0"),
        (
            lambda: bands_of_film(sampler="importance", walkers=0),
            "importance samples no chain: leave out walkers, or take hmc or emcee",
        ),
        (
            lambda: bands_of_film(sampler="importance", steps=4000),
            "importance samples no chain: leave out steps",
        ),
        (lambda: bands_of_film(steps=0, resume=True), "leave out resume"),
        (
            lambda: bands_of_film(sampler="importance", resume=True),
            "nothing is sampled: ask for steps of hmc or emcee",
        ),
        (lambda: bands_of_film(gloss=60.0), "gloss is 60; it must be in"),
        (lambda: bands_of_film(gloss=np.nan), "gloss is nan"),
        (lambda: Prior(error=0.0), "error is 0"),
        (lambda: reading_over(GRID, np.full(GRID.size, 0.5), 1.5), "must be in"),
        (lambda: reading_over(GRID, np.full(GRID.size, np.nan), 0.5), "is nan"),
        (lambda: Sampling(walkers=1), "1 walkers are not enough; take 2 or more"),
        # Only an ensemble is of two halves.
        (lambda: Sampling(sampler="emcee", walkers=33), "take an even number"),
        (lambda: Sampling(thin=300), "200 steps are fewer than one kept step"),
    ],
)
def test_bad_input(call, message):
    with refusal(message):
        call()


def test_single_precision_is_refused():
    """An opaque film's band, whose k and s are open, came out narrow and wrong in it."""
    with jax.enable_x64(False), refusal("need double precision"):
        posterior_of_bands(uniform_film(1.0, 10.0), steps=0)
