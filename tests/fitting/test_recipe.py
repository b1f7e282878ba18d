from itertools import chain

import numpy as np
import pytest
from numpy.testing import assert_allclose

import glazejax as gj
from glazefit import find_recipes, lab_target, spectral_target
from glazefit.film.model.variation import STRENGTH
from glazejax import colour
from glazejax.paint.describe import parse_coats
from glazejax.paint.media import make_media

from ..checks import finite
from ..refusals import refusal
from .palette import GRID, PALETTE

SEEN = gj.Bidirectional(45, 0)
LIGHTS = ("D65", "A")
WHITE, BLACK, RED, YELLOW, BLUE = PALETTE


def delta_e(first, second):
    return float(colour.delta_e_2000(first, second))


def read(coats):
    """What coats over the usual ground reflect."""
    return np.asarray(gj.reflectance(gj.Glaze(coats, 0.9), SEEN))


def labs(spectrum):
    """Under daylight and under a lamp."""
    return {light: np.asarray(colour.lab(GRID, spectrum, illuminant=light)) for light in LIGHTS}


@pytest.fixture(scope="module")
def known():
    """What a coat of red and white over a coat of blue reflects."""
    return read([gj.Layer(gj.Mixture([RED, WHITE], [0.4, 0.6]), 4e-6), gj.Layer(BLUE, 9e-6)])


@pytest.fixture(scope="module")
def found(known):
    """Recipes for a spectrum that the paints make, black, white, a screen's green and a colour
    under two lights.
    """
    targets = [
        spectral_target(GRID, known, name="known"),
        lab_target((0, 0, 0), "black"),
        lab_target((100, 0, 0), "white"),
        lab_target((88, -86, 83), "green"),
        spectral_target(GRID, np.full(GRID.size, 0.2), name="grey"),
    ]
    return find_recipes(targets, PALETTE, count=4)


def test_a_colour_that_the_paints_make_is_found(found):
    best = found[0][0]
    assert best.in_gamut
    assert best.distance < 0.5
    assert best.rmse < 0.03
    assert best.metamerism is not None
    grey = found[4][0]
    assert grey.distance < 0.5


def test_every_number_is_finite_and_what_is_out_of_reach_says_so(found):
    for recipe in chain(*found):
        numbers = [recipe.reflectance, recipe.distance, recipe.unrounded, recipe.sensitivity]
        assert finite(numbers)
        assert recipe.in_gamut == (recipe.limit == "")
    green = found[3][0]
    assert not green.in_gamut
    assert green.gamut_distance == pytest.approx(min(r.distance for r in found[3]))
    assert green.gamut_distance > 1


def test_the_glaze_is_what_was_described(found):
    for recipe in (recipe for recipes in found for recipe in recipes[:2]):
        solved = gj.reflectance(recipe.glaze, SEEN)
        assert_allclose(recipe.reflectance, solved, atol=2e-5)
        coats = parse_coats(recipe.text)
        media = make_media(coats, {p.name: p for p in PALETTE})
        typed = [gj.Layer(m, c.thickness) for m, c in zip(media, coats, strict=True)]
        assert_allclose(read(typed), solved, atol=1e-6)


def test_colour_differences_are_those_of_colour_science(found, known):
    best = found[0][0]
    wanted, got = labs(known), labs(best.reflectance)
    assert best.delta_e["D65"] == pytest.approx(delta_e(got["D65"], wanted["D65"]), abs=1e-9)
    assert best.metamerism == pytest.approx(delta_e(got["A"], wanted["A"]), abs=1e-9)
    assert best.rmse == pytest.approx(np.sqrt(np.mean((best.reflectance - known) ** 2)), abs=1e-12)


def test_numbers_are_round_and_within_the_limits(found):
    for recipe in chain(*found):
        assert len(recipe.coats) <= 2
        assert len(recipe.paints) <= 3
        for coat in recipe.coats:
            size, shares = coat.thickness * 1e6, np.array([share for share, _ in coat.parts])
            assert 1.0 - 1e-9 <= size <= 50.0 + 1e-9
            assert size * 10 == pytest.approx(round(size * 10), abs=1e-6)
            assert_allclose(shares * 1000, np.round(shares * 1000), atol=1e-6)
            assert shares.sum() == pytest.approx(1.0)


def test_recipes_differ(found):
    for recipes in found:
        kinds = [
            tuple(frozenset(name for _, name in coat.parts) for coat in r.coats) for r in recipes
        ]
        assert len(set(kinds)) == len(kinds)


def test_sensitivity_is_what_a_tenth_more_or_less_does(found):
    recipe = found[0][0]
    own = colour.lab(GRID, read(recipe.glaze.coats))
    for i, sensitivity in enumerate(recipe.sensitivity):
        moved = []
        for factor in (1.1, 1 / 1.1):
            layers = [
                gj.Layer(la.medium, la.thickness * (factor if j == i else 1))
                for j, la in enumerate(recipe.glaze.coats)
            ]
            moved.append(delta_e(colour.lab(GRID, read(layers)), own))
        assert sensitivity == pytest.approx(np.mean(moved), abs=0.01)


def test_mixings_differ_as_their_paints_do(found):
    """Against mixings whose paints really are stronger or weaker, through the solver."""
    recipe = found[0][0]
    rng = np.random.default_rng(8)
    mixings = []
    for _ in range(60):
        layers = []
        for layer in recipe.glaze.coats:
            mixed = isinstance(layer.medium, gj.Mixture)
            paints = layer.medium.pigments if mixed else [layer.medium]
            shares = np.asarray(layer.medium.weights) if mixed else np.ones(1)
            amounts = shares * np.exp(STRENGTH * rng.standard_normal(len(paints)))
            medium = gj.Mixture(paints, amounts / amounts.sum()) if mixed else paints[0]
            layers.append(gj.Layer(medium, layer.thickness * amounts.sum()))
        mixings.append(colour.lab(GRID, read(layers)))
    first, second = np.split(np.array(mixings), 2)
    apart = np.mean(colour.delta_e_2000(first, second))
    assert recipe.between_mixings == pytest.approx(apart, rel=0.35)
    assert recipe.between_mixings > 0.2


@pytest.mark.slow
def test_one_target_gets_what_it_gets_in_a_batch(found, known):
    alone = find_recipes(spectral_target(GRID, known, name="known"), PALETTE, count=4)
    assert alone[0].text == found[0][0].text


@pytest.mark.slow
def test_thickness_that_limits_is_named():
    """White paint over a black ground: thicker would be whiter."""
    # As many targets and recipes as above: the same programs.
    targets = [lab_target((100, 0, 0), f"white {n}") for n in range(5)]
    recipes, *_ = find_recipes(targets, PALETTE, ground=0.0, thickness=(1e-6, 5e-6), count=4)
    assert not recipes[0].in_gamut
    assert "as thick as allowed" in recipes[0].limit
    assert max(coat.thickness for coat in recipes[0].coats) == pytest.approx(5e-6, abs=1e-7)


@pytest.mark.slow
def test_weighing_the_spectrum_brings_it_nearer():
    target = spectral_target(GRID, 0.3 + 0.1 * np.sin(GRID / 20.0), name="waves")
    errors = [
        find_recipes(target, PALETTE, metamerism=weight, count=1)[0].rmse for weight in (0.0, 5.0)
    ]
    assert errors[0] is not None
    assert errors[1] is not None
    assert errors[1] < errors[0]


@pytest.mark.slow
def test_a_colour_under_two_lights():
    target = labs(read([gj.Layer(gj.Mixture([BLUE, YELLOW, WHITE], [0.1, 0.2, 0.7]), 20e-6)]))
    best, *_ = find_recipes(target, PALETTE, max_coats=1)
    assert set(best.delta_e) == {*LIGHTS}
    assert best.distance < 0.5
    assert best.rmse is None


@pytest.mark.slow
def test_more_paints_and_more_coats_come_nearer():
    rng = np.random.default_rng(3)
    targets = [lab_target(lab) for lab in rng.uniform((25, -45, -45), (80, 45, 45), (4, 3))]
    nearest = []
    for paints, layers in ((1, 1), (3, 2), (4, 3)):
        recipes = find_recipes(targets, PALETTE, max_paints=paints, max_coats=layers)
        assert all(len(r.paints) <= paints and len(r.coats) <= layers for r in chain(*recipes))
        nearest.append([min(r.unrounded for r in some) for some in recipes])
    steps = np.diff(nearest, axis=0)
    assert np.all(steps < 0.3)
    assert np.mean(nearest[-1]) < np.mean(nearest[0]) - 3


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"target": (50, 0)}, "three numbers"),
        ({"target": (150, 0, 0)}, r"L\* is 150"),
        ({"target": (50, 0, float("nan"))}, "three numbers"),
        ({"target": []}, "there is no target"),
        ({"max_paints": 0}, "max_paints is 0"),
        ({"max_coats": 6}, "max_coats is 6; it must be a whole number from 1 to 4"),
        ({"thickness": (1, 50)}, "must ascend"),
        ({"thickness": (5e-6, 1e-6)}, "must ascend"),
        ({"ground": 90}, "must lie in"),
        ({"ground": np.array([0.5, 0.5])}, "shape"),
        ({"illuminants": ("A",)}, "is given under D65, not under A"),
        ({"metamerism": -1}, "metamerism is -1"),
        ({"refractive_index": 3.0}, "refractive index 3"),
        ({"observer": "5"}, "unknown observer"),
        ({"pigments": []}, "no pigments"),
        ({"pigments": [RED, RED]}, "two pigments are called 'Red'"),
        (
            {"pigments": [RED.renamed(f"red {n}") for n in range(101)]},
            "101 paints make too many sets to try them all: name 100",
        ),
    ],
)
def test_bad_input_is_refused(change, match):
    asked: dict = {"target": (50, 0, 0), "pigments": PALETTE, **change}
    with refusal(match):
        find_recipes(**asked)
