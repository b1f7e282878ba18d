"""Mixed, or laid one over another: odds against films that the forward solver made, against closed
forms, and on measured ones.
"""

from typing import Any

import numpy as np
import pytest
from benchmarks.measured import data_folder
from benchmarks.paintbench.sources import read_sources
from numpy.testing import assert_allclose
from scipy.integrate import quad
from scipy.stats import multivariate_normal, norm

from glazefit import Noise, Prior, identify
from glazefit.film.model.optics import Optics
from glazefit.film.model.response import film_response
from glazefit.identify.coats import evidence as evidence_module
from glazefit.identify.coats.arrangement import Arrangement, arrangements
from glazefit.identify.coats.choose_sets import nearest_pairs
from glazefit.identify.coats.evidence import log_prior, weigh_arrangement
from glazefit.identify.coats.readings import (
    LOG_AMOUNTS,
    NODES,
    CoatedFilms,
    GridReadings,
    grid_readings,
    node_logs,
)
from glazefit.identify.coats.weigh_coats import coats_of_families
from glazefit.identify.result.odds import DECIDED
from glazefit.identify.search.options import IdentificationOptions
from glazefit.identify.search.searcher import check_spectra
from glazejax import Bidirectional, Glaze, Layer, Mixture, catalogue, reflectance

from ..slow import slow
from .answers import made_up
from .grids import every_pair
from .palette import optical_depths

GRID = np.arange(420.0, 701.0, 20.0)
GROUND = np.linspace(0.6, 0.85, GRID.size)
MIXED = Arrangement(((0, 1),))
OVER = Arrangement(((0,), (1,)))
SEEN = Bidirectional(45, 0)


@pytest.fixture(scope="module")
def oils():
    names = ("CobaltBlue", "LeadWhite", "ChromeYellow")
    return [catalogue.pigment(name).resample(GRID) for name in names]


def in_usual_coats(paints, *grounds):
    return CoatedFilms(
        coefficients=np.array(optical_depths(paints, 25e-6 * np.eye(len(paints)))),
        grounds=np.array(grounds or [GROUND]),
        wavelengths=GRID,
        optics=Optics.of("45:0"),
        response=film_response("45:0"),
    )


def read(coats, ground=GROUND):
    return np.asarray(reflectance(Glaze(coats, ground), SEEN))


@pytest.mark.parametrize(
    ("paints", "coats", "count"), [(2, 2, 3), (3, 3, 13), (3, 2, 7), (3, 1, 1)]
)
def test_every_way_to_lie_is_there_once(paints, coats, count):
    ways = arrangements(paints, coats)
    assert len(set(ways)) == len(ways) == count
    assert all(way.paints == tuple(range(paints)) for way in ways)
    assert len(ways[0].coats) == 1


def test_ways_are_named_top_first():
    assert Arrangement(((1,), (0,))).words(["a", "b"]) == "b over a"
    assert Arrangement(((0, 2), (1,))).words("abc") == "(a + c) over b"
    assert MIXED.words("ab") == "a + b"


def test_readings_on_the_grid_are_those_of_the_forward_solver(oils):
    paints = oils[:2]
    table = grid_readings(OVER, in_usual_coats(paints))
    thickness = 25e-6 * np.exp(np.linspace(-3.6, 3.2, 15))
    for top, below in ((3, 9), (8, 4)):
        coats = [*map(Layer, paints, thickness[[top, below]])]
        assert_allclose(table.readings[15 * top + below], read(coats), atol=2e-3)
        # Where the upper coat is missing, the lower one is seen.
        assert_allclose(table.patches[0][15 * top + below], read(coats[1:]), atol=2e-3)


def test_slopes_are_those_of_the_readings(oils):
    """Over two grounds, by a change of k or s of one paint alone."""
    films = in_usual_coats(oils[:2], GROUND, np.full(GRID.size, 0.05))
    amounts = np.array([[0.3, 1.2], [1.0, 0.4]])
    slopes = films.read_and_slopes(OVER, amounts)[1]
    for number, at in enumerate(np.ndindex(2, 2)):

        def change(by, at=at):
            coefficients = films.coefficients.copy()
            coefficients[at] *= np.exp(by)
            return films._replace(coefficients=coefficients).read(OVER, amounts[None])

        assert_allclose(slopes[:, number], (change(0.1) - change(-0.1)) / 0.2, atol=0.01)


def test_coats_that_no_mixture_looks_like_are_among_the_nearest(oils):
    coats = [Layer(oils[1], 6e-6), Layer(oils[2], 25e-6)]
    for grounds in ([GROUND], [np.full(GRID.size, 0.03), GROUND]):
        bodies = np.array([[read(coats, ground) for ground in grounds]])
        # A paint that is hardly ever there comes after.
        for chance, nearest in ((1.0, [1, 2]), (1e-300, [0, 2])):
            common = np.log([1.0, chance, 1.0])
            pairs = nearest_pairs(bodies, in_usual_coats(oils, *grounds), common)
            assert pairs[0, 0].tolist() == nearest


def test_a_film_that_hides_does_not_know_its_ground(oils):
    table = grid_readings(MIXED, in_usual_coats(oils[:2])._replace(hides=True))
    same = read([Layer(Mixture(oils[:2], [0.5, 0.5]), 5e-3)], np.full(GRID.size, 0.1))
    assert_allclose(table.readings[15 * 7 + 7], same, atol=2e-3)


def test_the_prior_sums_to_one_and_fractions_are_uniform():
    for way in (MIXED, OVER):
        assert np.exp(log_prior(way)).sum() == pytest.approx(1.0)
    logs = evidence_module._finer(node_logs(2), 2)
    fraction = 1.0 / (1.0 + np.exp(logs[..., 1] - logs[..., 0]))
    weight = np.exp(log_prior(MIXED))
    for low, high in ((0.1, 0.3), (0.4, 0.6), (0.6, 0.9)):
        share = weight[(fraction > low) & (fraction < high)].sum()
        assert share == pytest.approx(high - low, abs=0.03)


def test_a_gain_is_integrated_as_a_gaussian(monkeypatch):
    computed, *readings = np.random.default_rng(1).normal(size=(4, 6))
    for name, value in {"_GAINS": {0.3: 1.0}, "_SCALES": {1.0: 1.0}, "_PATCHY": 0.0}.items():
        monkeypatch.setattr(evidence_module, name, value)
    spectra, films = np.array([readings]), computed[None, None]
    found = evidence_module._log_likelihood(spectra, films, [])[0, 0]
    covariance = np.eye(6) + 0.09 * np.outer(computed, computed)
    gaussian: Any = multivariate_normal
    exact = gaussian.logpdf(readings, computed, covariance)
    assert_allclose(found - 3.0 * np.log(2.0 * np.pi), exact, rtol=1e-10)


def test_what_lies_between_two_nodes_adds_covariance_along_each_amount():
    """Readings that are straight in the logs of both amounts: the outer product of either slope,
    times the square of .6 of the step between two places of the finer grid.
    """
    rng = np.random.default_rng(3)
    slopes = 0.1 * rng.normal(size=(2, GRID.size))
    nodes = np.linspace(*LOG_AMOUNTS, NODES[2])
    logs = every_pair(nodes)
    nothing = np.zeros((len(logs), *slopes.shape))
    flat, straight = (
        evidence_module._covariance(
            GridReadings(0.3 + logs @ each, nothing, []), np.ones_like(slopes), GRID
        )
        for each in (0.0 * slopes, slopes)
    )
    step = 0.6 * (nodes[1] - nodes[0]) / 4
    expected = np.broadcast_to(step**2 * slopes.T @ slopes, straight.shape)
    assert_allclose(straight - flat, expected, atol=1e-13)


def _better(share, length, product):
    moved = product * share - 0.5 * length * share**2
    return 2.0 * norm.pdf(share, scale=0.2) * np.exp(moved)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_patch_is_integrated_over_shares_above_zero(sign):
    patch, reading = np.random.default_rng(2).normal(size=(2, 5))
    sizes = patch @ patch, sign * patch @ reading
    exact = quad(_better, 0.0, 5.0, args=sizes)[0]
    (found,) = evidence_module._log_patch(*np.reshape(sizes, (2, 1, 1, 1))).ravel()
    assert found == pytest.approx(np.log(exact), abs=1e-8)


def test_evidence_tells_the_amounts(oils, monkeypatch):
    paints = oils[:2]
    coats = [*map(Layer, paints, (10e-6, 30e-6))]
    monkeypatch.setattr(evidence_module, "_AMPLITUDE", 0.002)
    monkeypatch.setattr(evidence_module, "_OFFSET", 0.001)
    monkeypatch.setattr(evidence_module, "coefficient_sd", lambda k, s: np.full(k.shape, 0.01))
    found = weigh_arrangement(read(coats)[None], OVER, in_usual_coats(paints))
    off = found.log_amounts[0] - np.log([0.4, 1.2])
    assert np.all(np.abs(off) < 3.0 * np.sqrt(np.diagonal(found.covariance[0])) + 0.05)
    assert off[0] == pytest.approx(0.0, abs=0.1)


def odds(spectrum, paints, **options):
    asked: dict = dict(ground=GROUND, instrument="45:0", max_paints=2, max_coats=2) | options
    return identify(GRID, spectrum, paints, **asked)


@pytest.mark.parametrize("count", [2, slow(3)])
def test_a_mixture_and_a_superposition_are_told(oils, count):
    """Films of so many paints."""
    blue, white, yellow = oils
    films = np.array(
        [
            read([Layer(Mixture([blue, white], [0.3, 0.7]), 30e-6)]),
            read([Layer(white, 6e-6), Layer(blue, 25e-6)]),
            read([Layer(blue, 4e-6), Layer(yellow, 40e-6)]),
        ][:count]
    )
    found = odds(films, oils[:count])
    assert found.coats_probability[0] < 1.0 - DECIDED
    assert found.coats_probability[1:].min() > DECIDED
    assert found.coats_odds[1][0].most_probable == "LeadWhite over CobaltBlue"
    if count == 3:
        assert found.coats_odds[2][0].most_probable == "CobaltBlue over ChromeYellow"
    for sets in found.coats_odds:
        assert sum(one.share for one in sets) == pytest.approx(1.0)
        for one in sets:
            assert sum(one.chances.values()) == pytest.approx(1.0)
    # What is named agrees with the odds.
    assert any(found.ranked(1)[0].coats)
    assert not any(found.ranked(0)[0].coats)
    assert "mixed" in found.coats_words(0)
    assert "laid one over another" in found.coats_words(1)


@pytest.mark.parametrize(("paints", "coats"), [(1, 2), slow(1, 3), (2, 3)])
def test_no_set_in_coats_is_larger_than_what_is_tried(oils, paints, coats):
    film = read([*map(Layer, oils, (8e-6, 20e-6))])
    found = odds(film, oils, max_paints=paints, max_coats=coats)
    sizes = {len(one.paints) for one in found.coats_odds[0]}
    assert sizes == ({2} if paints == 2 else set())
    assert (found.coats_probability[0] > 0) == (paints == 2)


def test_no_set_of_families_is_larger_than_what_is_tried():
    measured = check_spectra(GRID, GROUND, 0.9, None, Noise())
    sets = [({"a": 1e-5}, 0.5), ({"a": 1e-5, "b": 1e-5}, 0.4)]
    found = made_up(measured, ("a", "b"), sets, GROUND)
    for paints, count in ((1, 0), (2, 1)):
        options = IdentificationOptions(max_paints=paints, max_coats=2)
        assert len(coats_of_families(found, options).coats_odds[0]) == count


@pytest.mark.slow
def test_an_upper_coat_that_hides_leaves_it_open(oils):
    found = odds(read([Layer(oils[1], 400e-6), Layer(oils[0], 25e-6)]), oils[:2])
    assert 0.1 < found.coats_probability[0] < 0.9
    assert "hides" in found.coats_odds[0][0].reason
    assert "open" in found.coats_words(0)


def test_intervals_of_coats_are_of_the_stated_spread(oils):
    found = odds(read([Layer(oils[0], 20e-6)]), oils[:2], prior=Prior(spread=0.3))
    assert found.spread == 0.3


def test_one_coat_is_not_asked_unless_told(oils):
    found = odds(read([Layer(oils[0], 20e-6)]), oils, max_coats=1)
    assert found.coats_odds == ()
    assert found.coats_probability[0] == 0.0
    assert found.coats_words(0) == ""


@pytest.mark.slow
def test_three_coats_are_told(oils):
    film = read([*map(Layer, oils, (3e-6, 12e-6, 40e-6))])
    (sets,) = odds(film, oils, max_paints=3, max_coats=3).coats_odds
    three = next(one for one in sets if len(one.paints) == 3)
    assert len(three.chances) == 3 + 13
    assert three.layered > DECIDED


@pytest.mark.slow
def test_stated_probabilities_come_true_in_simulation(oils):
    """Draws of amounts, lies, gains and smooth errors as the odds expect them."""
    rng = np.random.default_rng(5)
    pair = oils[:2]
    paints = in_usual_coats(pair)
    ways = arrangements(2, 2)
    tables = {way: grid_readings(way, paints) for way in ways}
    errors = evidence_module
    smooth = errors._AMPLITUDE**2 * errors.smooth_kernel(GRID, errors._LENGTH)
    smooth += errors._NOISE**2 * np.eye(GRID.size) + errors._OFFSET**2
    films = []
    drawn = [ways[1], ways[0], ways[2], ways[0]] * 30
    for way in drawn:
        weight = np.exp(log_prior(way)).sum(axis=1)
        node = rng.choice(len(weight), p=weight)
        moved = tables[way].readings[node] * (1.0 + min(errors._GAINS) * rng.normal())
        films.append(moved + rng.multivariate_normal(np.zeros(GRID.size), smooth))
    found = odds(np.clip(films, 0.0, 1.4), pair)
    # None was drawn of one paint alone: these ways are left out of what is stated.
    both = [sets[0] for sets in found.coats_odds]
    mixed = np.array([one.chances["CobaltBlue + LeadWhite"] for one in both])
    layered = np.array([one.layered for one in both])
    chance = layered / (layered + mixed)
    truth = np.array([way != ways[0] for way in drawn])
    # Stated chances come true within their counting error, and tell.
    spread = np.sqrt(np.sum(chance * (1.0 - chance)))
    assert abs(chance.sum() - truth.sum()) < 3.0 * spread
    decided = np.maximum(chance, 1.0 - chance) > DECIDED
    assert decided.mean() > 0.3
    assert ((chance > 0.5) == truth)[decided].mean() > 0.85


@pytest.mark.slow
def test_of_families_it_is_open():
    try:
        sources = {source.name: source for source in read_sources(data_folder(), None)}
    except FileNotFoundError:
        pytest.skip("the measured data are not at hand")
    bath = sources["bath"]
    rows = [row for row in bath.chosen("mixture") if bath.samples[row].paints == ("RL", "LTY")]
    camera = bath.cameras[0]
    grid = np.arange(410.0, 981.0, 10.0)
    spectra = [np.interp(grid, camera.wavelengths, camera.readings[row]) for row in rows]
    found = identify(
        grid,
        np.clip(spectra, 0.0, 1.4),
        catalogue.load("pigments"),
        opaque=True,
        instrument="45:0",
        max_coats=2,
    )
    assert len(found.coats_odds) == len(rows)
    words = [found.coats_words(row) for row in range(len(rows))]
    assert all("is open" in one and "paints of other makers" in one for one in words)
