"""What to add to a mixture that was made and read."""

import numpy as np
import pytest

from glazefit import Noise
from glazefit.recipe.addition import next_addition
from glazefit.recipe.report import in_painters_terms
from glazefit.recipe.targets import lab_target
from glazefit.recover.predict.mixture import calibrate_mixture, predict_mixture
from glazejax import colour

from ..refusals import refusal
from .tables import write_films
from .test_variation import GRID, TINT, at_bands, painted

COMMAND = "recipe"
WHITE_GROUND = 0.9


@pytest.fixture(scope="module")
def weak(paints):
    """The mixture of which only six tenths of the colour came through, read over both cards."""
    return painted(paints, 25e-6, strength=0.6, noise=Noise())


@pytest.fixture(scope="module")
def calibrated(paints, weak):
    return calibrate_mixture(paints, TINT, weak, noise=Noise())


@pytest.fixture(scope="module")
def metres(calibrated):
    """Of the film that was read."""
    return calibrated.thickness[0] * 25e-6


def add(calibrated, paints, colour, batch=100.0):
    """To meet a colour over white."""
    return next_addition(
        calibrated, lab_target(colour), [*paints.values()], batch, ground=WHITE_GROUND
    )


def colour_of(paints, recipe, metres):
    (film,) = predict_mixture(
        paints, recipe, [metres], wavelengths=GRID, ground=(0.0, WHITE_GROUND)
    )
    return np.asarray(colour.lab(GRID, film.over_white))


def test_what_was_too_weak_gets_more_colour(paints, calibrated, metres):
    """100 g with 6 parts that count and 90 of white: 4 g more are what was meant."""
    aim = colour_of(paints, TINT, metres)
    found = add(calibrated, paints, aim)
    assert found.grams["Vermillion"] == pytest.approx(4.0, rel=0.25)
    assert found.before > 3.0
    assert found.after < 0.3 * found.before
    assert 0.0 < found.expected < found.before
    half = add(calibrated, paints, aim, 50.0)
    assert half.grams["Vermillion"] == pytest.approx(0.5 * found.grams["Vermillion"])
    assert found.film.delta_e(found.film.over_black, found.film.over_white)[1] < 1e-6


def test_what_is_right_gets_nothing(paints, calibrated, metres):
    name = calibrated.paints[0]
    made = {name: calibrated.pigment(name, 25e-6)}
    aim = colour_of(made, {name: 1.0}, metres)
    found = add(calibrated, paints, aim)
    assert found.grams == {}
    assert found.after == found.before < 0.2


def test_a_colour_between_two_paints_needs_both(paints, calibrated, metres):
    """Darker and redder: one paint alone does either."""
    name = calibrated.paints[0]
    made = paints | {name: calibrated.pigment(name, 25e-6)}
    aim = colour_of(made, {name: 100.0, "Vermillion": 20.0, "BoneBlack": 3.0}, metres)
    found = add(calibrated, paints, aim)
    assert found.grams == pytest.approx({"Vermillion": 20.0, "BoneBlack": 3.0}, rel=0.05)
    assert found.after < 0.1


@pytest.mark.parametrize("batch", [0.0, -1.0, np.nan, np.inf])
def test_a_batch_weighs_something(paints, calibrated, batch):
    with refusal("the batch is"):
        add(calibrated, paints, (50, 20, 30), batch)


def test_what_is_added_must_be_known_where_the_mixture_is(paints, calibrated):
    narrow = paints["BoneBlack"].resample(GRID[3:13])
    with refusal("leave BoneBlack out of what may be added"):
        next_addition(calibrated, lab_target((50, 20, 30)), [paints["Vermillion"], narrow], 10.0)


@pytest.mark.parametrize(
    ("metres", "words"),
    [
        (2.4e-6, "2.4 µm, about 3.6 g/m², one coat thinned about 1:9 with medium"),
        (25e-6, "25 µm, about 38 g/m², one brushed coat"),
        (100e-6, "100 µm, about 150 g/m², 4 brushed coats"),
    ],
)
def test_a_thickness_in_painters_terms(metres, words):
    said = in_painters_terms(metres)
    assert words in said
    assert "guess" in said


def correction(file):
    """Words that ask for it."""
    words = f"--lab 60,45,30 --after {file} --instrument d:8 --mixed".split()
    return *words, "10 Vermillion + 90 ZincWhite"


def test_command_says_what_to_add(run, check_refusal, tmp_path, weak):
    asked = correction(write_films(tmp_path / "mine.tsv", weak))
    out, err = run(*asked, "--only", "Vermillion,BoneBlack", "--batch", 20)
    assert err == ""
    assert "g Vermillion" in out
    assert "to 20 g of it, weighed as they come from the tube" in out
    assert "as it came out" in out
    assert "after the addition" in out
    for words, said in (
        (asked[:-2], "--mixed MIXTURE"),
        (asked[:2] + asked[-2:], "--after FILE"),
        ((*asked, "--csv", "x.csv"), "--csv is for recipes"),
        ((*asked, "--out", "x.png"), "--out is for recipes"),
        ((*asked, "--batch", "-3"), "the batch is -3 g"),
    ):
        check_refusal(said, *words)


@pytest.mark.slow
def test_a_film_is_read_as_for_predict_unless_another_instrument_is_named(run, tmp_path, weak):
    asked = correction(write_films(tmp_path / "mine.tsv", weak))
    default = [word for word in asked if word not in ("--instrument", "d:8")]
    (as_stated, _), (by_default, _) = run(*asked), run(*default)
    assert by_default == as_stated
    assert "seen by, an integrating sphere at 8" in as_stated


@pytest.mark.slow
def test_command_takes_a_reading_of_few_bands(run, tmp_path, weak):
    """Filters of a camera: what they leave open the paints tell, and as much is added within a
    seventh.
    """

    def grams(bands):
        file = write_films(tmp_path / f"{len(bands)}.tsv", at_bands(weak, bands))
        out, err = run(*correction(file), "--only", "Vermillion", "--batch", 20)
        assert err == ""
        return float(out.split("Add ")[1].split(" g Vermillion")[0])

    all_bands = grams(range(GRID.size))
    assert all_bands > 1.0
    for few in ([2, 6, 10], [8], range(3, 13)):
        assert grams(few) == pytest.approx(all_bands, rel=0.15), few
