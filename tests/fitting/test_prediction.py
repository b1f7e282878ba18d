"""What is foretold of a film: bands hold the share of the draws that they say, and errors enter as
they are stated.
"""

from dataclasses import replace

import jax
import numpy as np
import pytest
from numpy.testing import assert_allclose

from glazefit.film.films import Noise
from glazefit.film.model.errors import ModelError
from glazefit.film.model.variation import SIZES, Variation
from glazefit.recover.joint.joint import recover_jointly
from glazefit.recover.predict.prediction import Prediction, predict_films
from tests.fitting.test_joint import GRID, RECIPES, painted
from tests.refusals import refusal

OF_SIZE_ONE = Variation(np.equal(SIZES, 1.0).astype(float))
NONE = ModelError(coefficient=0.0, level=0.0, amplitude=0.0)


def flat(draws):
    grey = np.full(GRID.size, 0.5)
    off = (draws[:, None, None] - 0.5) * np.ones((1, 2, GRID.size))
    parts = {"scale": 0.0 * off, "paint": off, "film": 0.0 * off}
    return Prediction("flat", GRID, grey, grey, ("grey",), parts, OF_SIZE_ONE)


def test_a_band_holds_its_share_of_the_draws():
    found = flat(np.linspace(0.0, 1.0, 1001))
    for level in (0.9, 0.5):
        low, high = found.interval(level)
        assert low.shape == high.shape == (2, GRID.size)
        assert_allclose(low, (1 - level) / 2)
        assert_allclose(high, (1 + level) / 2)
    for wrong in (0.0, 1.0, 1.5):
        with refusal(f"the level is {wrong:g}; give a share between 0 and 1"):
            found.interval(wrong)


def test_the_expected_error_is_the_mean_over_draws_and_cards():
    """Greys differ by lightness alone; draws that hit the prediction add nothing."""
    one = flat(np.full(4, 0.55)).expected_error()
    dark, light = (116 * y ** (1 / 3) - 16 for y in (0.5, 0.55))
    off = (0.5 * (dark + light) - 50) ** 2
    assert one == pytest.approx((light - dark) / (1 + 0.015 * off / np.sqrt(20 + off)))
    assert flat(np.array([0.5, 0.55, 0.5, 0.55])).expected_error() == pytest.approx(one / 2)
    assert flat(np.full(3, 0.5)).expected_error() == pytest.approx(0.0, abs=1e-6)


@pytest.fixture(scope="module")
def recovered():
    return recover_jointly(painted(), RECIPES)


@pytest.fixture(scope="module")
def fit(recovered):
    """The same with few draws."""
    return replace(recovered, draws=jax.tree.map(lambda draws: draws[:8], recovered.draws))


def foretell(fit, films, **told):
    """The one film there is, from its recipe."""
    (found,) = predict_films(fit, films, RECIPES, **told)
    return found


def test_a_card_without_a_reading_does_not_matter(fit):
    """Thin films show which card they lie on; over white alone they are predicted as over both."""
    thin = painted(np.full(6, 0.25)).select(["half"])
    both = foretell(fit, thin)
    for copied in (thin.over_white, np.full_like(thin.over_black, 0.01)):
        white_only = replace(thin, over_black=copied, seen=np.array([[False, True]]))
        found = foretell(fit, white_only)
        assert_allclose(found.over_white, both.over_white, atol=0.01)
        assert_allclose(found.over_black, both.over_black, atol=0.02)


def test_an_opaque_film_hides_its_cards(fit):
    thick = painted(np.full(6, 100.0)).select(["half"])
    opaque = replace(thick, seen=np.array([[True, False]]), opaque=np.array([True]))
    found = foretell(fit, opaque)
    assert_allclose(found.over_black, thick.over_black[0], atol=0.01)
    assert_allclose(found.over_white, found.over_black, atol=1e-4)


def test_the_noise_is_that_of_the_fit(fit):
    """A card a little darker than its surface is refused only where the instrument is good."""
    films = painted().select(["half"])
    dark = replace(films, bare_black=np.full((1, GRID.size), 0.036))
    rough = Noise(floor=0.003)
    found = foretell(replace(fit, noise=rough), dark)
    expected = foretell(fit, dark, noise=rough)
    assert_allclose(found.reflectance, expected.reflectance)
    with refusal("darker than its surface alone"):
        foretell(replace(fit, noise=Noise()), dark)


def test_films_of_other_wavelengths_are_refused(fit):
    with refusal("the films are at 405-705 nm.*, the recovery is at 400-700 nm.*: bring the films"):
        foretell(fit, replace(painted(), wavelengths=GRID + 5.0))


def draws(recovered, name, **errors):
    film, error = recovered.films.select([name]), replace(NONE, **errors)
    return foretell(recovered, film, discrepancy=error, variation=OF_SIZE_ONE).draws


@pytest.mark.slow
def test_errors_of_the_model_are_added_to_both_cards(recovered):
    """What is added has the standard deviation that is stated, and goes together over black and
    white.
    """
    added = draws(recovered, "white", amplitude=0.02, shared=0.8) - draws(recovered, "white")
    count = len(added)
    assert_allclose(added.std(axis=0), 0.02, rtol=4 / np.sqrt(2 * count))
    alike = [np.corrcoef(added[:, 0, band], added[:, 1, band])[0, 1] for band in range(GRID.size)]
    assert np.mean(alike) == pytest.approx(0.8, abs=4 * 0.36 / np.sqrt(count))
    assert draws(recovered, "shade", amplitude=1.0).min() == 0.0


@pytest.mark.slow
def test_errors_of_paints_move_a_film_as_far_as_they_are_large(recovered):
    """To first order twice the error is twice the spread; a level is the same at all
    wavelengths.
    """
    few, many = (
        np.std(draws(recovered, "half", coefficient=c) - draws(recovered, "half"))
        for c in (0.01, 0.02)
    )
    assert many == pytest.approx(2.0 * few, rel=0.1)
    assert few > 1e-4
    level = draws(recovered, "half", level=0.05) - draws(recovered, "half")
    # One error of k and one of s for each paint: the moves of all bands span no more than these and
    # the thickness.
    size = np.linalg.svd((level - level.mean(axis=0)).reshape(len(level), -1), compute_uv=False)
    assert size[5] < 0.05 * size[0]
