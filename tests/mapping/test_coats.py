"""Two coats in maps: stacks from the table of films, sought where one coat leaves a spectrum in
doubt.
"""

import pickle
from dataclasses import replace

import numpy as np
import pytest

from glazefit import IdentificationOptions
from glazefit.film.films import Noise
from glazefit.film.model.optics import Optics
from glazefit.film.model.response import film_response
from glazefit.identify.search.searcher import Searcher
from glazefit.mapping.map_cube import map_cube
from glazefit.mapping.show.overview import overview
from glazefit.mapping.show.pictures import BLANK, numbers_of, upper_map
from glazefit.mapping.solve.atlas import Atlas
from glazefit.mapping.solve.coats import StackSearch, TableOptics, in_doubt, search_coats
from glazefit.mapping.solve.local import as_measured, search_locally
from glazefit.mapping.solve.survey import Features
from glazefit.mapping.solve.update import Answers
from glazefit.mapping.store.layout import Status
from glazejax import Glaze, Hemispherical, Layer, Mixture, catalogue, reflectance
from tests.mapping import small

GRID = np.linspace(400.0, 700.0, 31)
GROUND = np.full(GRID.size, 0.2)
NAMES = ("Eosin", "LeadWhite", "EmeraldGreen", "ChromeYellow")
NOISE = Noise(0.002, 0.0)


def spectra() -> np.ndarray:
    """A red glaze over white and over yellow, then the paints of the glaze mixed."""
    eosin, white, _, yellow = (catalogue.pigment(name).resample(GRID) for name in NAMES)
    films = [
        [Layer(eosin, 14e-6), Layer(white, 25e-6)],
        [Layer(eosin, 10e-6), Layer(yellow, 20e-6)],
        [Layer(Mixture([eosin, white], [0.3, 0.7]), 35e-6), Layer(white, 1e-9)],
    ]
    return np.array(
        [np.asarray(reflectance(Glaze(coats, GROUND, 1.5), Hemispherical())) for coats in films]
    )


@pytest.fixture(scope="module")
def searcher() -> Searcher:
    paints = [catalogue.pigment(name) for name in NAMES]
    return Searcher.of(GRID, paints, IdentificationOptions(max_paints=2))


@pytest.fixture(scope="module")
def found(searcher):
    readings = spectra()
    stacks = StackSearch.of(searcher.task, GROUND, Features.of(np.repeat(readings, 8, axis=0)))
    measured = as_measured(searcher, readings, np.full(readings.shape, 0.002), GROUND)
    return next(iter(search_coats(searcher, stacks, measured)))


def test_a_coat_sees_what_lies_below_as_one_diffuse_ground():
    table = TableOptics(film_response(Hemispherical()))
    solver = Optics.of(Hemispherical(), 1.5)
    rng = np.random.default_rng(0)
    k, s = np.exp(rng.uniform(-3, 1, (2, 40, 2)))
    ground = rng.uniform(0.1, 0.9, 40)
    np.testing.assert_allclose(
        table.body(k, s, ground, 0.0),  # pyright: ignore[reportArgumentType]
        solver.body(k, s, ground, 1e-5),  # pyright: ignore[reportArgumentType]
        atol=0.01,
    )


def test_a_glaze_is_told_from_a_mixture(found):
    _, pool, odds = found
    first = odds.candidates.argmax(axis=1)
    members = pool.members[np.arange(3), first]
    coats = pool.coats[np.arange(3), first]
    assert members[0].tolist() == [0, 1, -1]
    assert members[1].tolist() == [0, 3, -1]
    assert coats[:2, :2].tolist() == [[0, 1], [0, 1]]
    stacked = (pool.coats > 0).any(axis=-1)
    share = np.where(stacked, odds.candidates, 0.0).sum(axis=1) / odds.candidates.sum(axis=1)
    assert (share[:2] > 0.9).all()
    assert share[2] < 0.5


def test_thickness_of_the_upper_coat_is_found(found):
    _, pool, odds = found
    first = odds.candidates.argmax(axis=1)
    upper = np.exp(pool.logs[np.arange(3), first, 0])
    np.testing.assert_allclose(upper[:2], [14e-6, 10e-6], rtol=0.15)


def test_the_spread_of_the_upper_thickness_is_that_of_its_amounts():
    """Of two paints mixed over a third: by differences along each log amount, sd^2 = g C g."""
    logs = np.log([3e-6, 5e-6, 20e-6])
    root = np.array([[0.2, 0.0, 0.0], [-0.1, 0.3, 0.0], [0.05, 0.1, 0.2]])
    stacked = Answers.empty(1, paints=3, bands=4)
    stacked = replace(
        stacked,
        members=np.array([[0, 1, 2]]),
        coats=np.array([[0, 0, 1]]),
        amounts=logs[None],
        covariance=(root @ root.T)[None],
    )
    step = 1e-4
    ends = [
        replace(stacked, amounts=logs[None] + move).top()[0][0]
        for move in step * np.concatenate([np.eye(3), -np.eye(3)])
    ]
    slopes = (np.array(ends[:3]) - ends[3:]) / (2 * step)
    thickness, sd = stacked.top()
    assert thickness[0] == pytest.approx(8e-6)
    # A central difference of an exponential is off by a sixth of the step squared.
    assert sd[0] == pytest.approx(np.linalg.norm(slopes @ root), rel=step**2, abs=0)


def test_what_one_coat_explains_is_not_sought_again(searcher):
    white = catalogue.pigment("LeadWhite").resample(GRID)
    film = np.asarray(reflectance(Glaze([Layer(white, 40e-6)], GROUND, 1.5), Hemispherical()))
    measured = as_measured(searcher, film[None], np.full((1, 31), 0.002), GROUND)
    _, _, odds = next(iter(searcher.search(measured)))
    stacks = StackSearch.of(searcher.task, GROUND, Features.of(np.repeat(spectra(), 8, axis=0)))
    _, pool, _ = next(iter(search_coats(searcher, stacks, measured)))
    assert not in_doubt(odds).any()
    assert not (pool.coats > 0).any()


@pytest.fixture(scope="module")
def hidden():
    """A green that hides the white below, and a search for it among five paints."""
    names = (*NAMES, "UltramarineBlue")
    paints = [catalogue.pigment(name).resample(GRID) for name in names]
    coats = [Layer(paints[names.index("EmeraldGreen")], 90e-6), Layer(paints[1], 20e-6)]
    film = np.asarray(reflectance(Glaze(coats, GROUND, 1.5), Hemispherical()))
    searcher = Searcher.of(GRID, paints, IdentificationOptions(max_paints=3))
    stacks = StackSearch.of(searcher.task, GROUND, Features.of(np.repeat(spectra(), 8, axis=0)))
    return searcher, stacks, film[None]


@pytest.mark.slow
def test_what_an_upper_coat_hides_is_as_probable_as_beforehand(hidden):
    """Each stack with that green above is a little probable; all of them count."""
    searcher, stacks, film = hidden
    measured = as_measured(searcher, film, np.full(film.shape, 0.002), GROUND)
    _, pool, odds = next(iter(search_coats(searcher, stacks, measured)))
    assert (odds.candidates > 0).sum() > 40
    stacked = (pool.coats > 0).any(axis=-1)
    share = np.where(stacked, odds.candidates, 0.0).sum() / odds.candidates.sum()
    assert share == pytest.approx(searcher.task.prior.stacked, abs=0.15)
    # Whatever lies below, the green is above.
    above = stacked & (pool.members[..., 0] == NAMES.index("EmeraldGreen"))
    assert odds.candidates[above].sum() > 0.9 * odds.candidates[stacked].sum()


@pytest.mark.slow
def test_candidates_that_are_left_out_keep_their_coats(hidden, monkeypatch):
    searcher, stacks, film = hidden

    def coats_probability() -> np.ndarray:
        noise_sd = np.full(film.shape, 0.002)
        found = search_locally(searcher, film, noise_sd, GROUND, stacks=stacks)
        atlas = Atlas.of(stacks.features, found, searcher.task.prior)
        return atlas.answers(film.astype(np.float32))[0].coats_probability

    monkeypatch.setattr("glazefit.mapping.solve.local._MOST", 60)
    whole = coats_probability()
    monkeypatch.setattr("glazefit.mapping.solve.local._MOST", 1)
    np.testing.assert_allclose(coats_probability(), whole, atol=0.02)


def test_a_search_that_is_sent_makes_its_table_there(searcher):
    stacks = StackSearch.of(searcher.task, GROUND, Features.of(np.repeat(spectra(), 8, axis=0)))
    stacks.__dict__["tables"] = "large"
    again = pickle.loads(pickle.dumps((stacks.ground, stacks.features)))
    make, given = stacks.__reduce__()
    assert make is StackSearch
    assert given[1] is stacks.ground
    np.testing.assert_array_equal(again[0], stacks.ground)


@pytest.mark.slow
def test_a_map_shows_which_paint_lies_on_top(tmp_path, monkeypatch):
    monkeypatch.setattr("glazefit.mapping.map_cube._REPRESENTATIVES", (32, 4000))
    monkeypatch.setattr("glazefit.mapping.map_cube._CHECKED", 8)
    films = spectra()
    white = catalogue.pigment("LeadWhite").resample(GRID)
    thick = np.geomspace(20e-6, 60e-6, 8)
    plain = np.asarray(reflectance(Glaze([Layer(white, thick)], GROUND, 1.5), Hemispherical()))
    rows = [np.repeat(films[:1], 8, axis=0), np.repeat(films[1:2], 8, axis=0), plain]
    rng = np.random.default_rng(0)
    cube = np.array([row for row in rows for _ in range(3)])
    cube = (cube + 0.002 * rng.standard_normal(cube.shape)).astype(np.float32)
    found = map_cube(
        small.image(cube, GRID),
        [catalogue.pigment(name) for name in NAMES],
        ground=GROUND,
        out=tmp_path / "map.zarr",
        noise=NOISE,
        max_paints=2,
        max_coats=2,
    )
    assert (found["status"].values == Status.MAPPED).all()
    assert (found["coats_probability"].values[:6] > 0.5).mean() > 0.9
    assert (found["coats_probability"].values[6:] < 0.5).all()
    top = found["top_thickness"].values
    assert np.isnan(top[6:]).all()
    assert np.nanmedian(top[:3]) == pytest.approx(14e-6, rel=0.2)
    assert (found["top_thickness_sd"].values[:3] > 0).mean() > 0.9
    look = overview(found)
    assert look.upper[0][0] == (0,)
    keys = {each.key for each in numbers_of(look)}
    assert keys >= {"coats_probability", "top_thickness", "top_thickness_sd"}
    shown = upper_map(look)
    assert (shown[-1] == int(BLANK[1:3], 16)).all()
    assert not (shown[0] == int(BLANK[1:3], 16)).all()
