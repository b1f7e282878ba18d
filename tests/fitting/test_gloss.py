"""Gloss of films, by readings with the specular part and without it."""

from dataclasses import replace

import numpy as np
import pytest

from glazefit import Films, Instrument, ModelError, Noise, identify, recover_jointly, simulate_films
from glazefit.film.gloss import measure_gloss
from glazefit.film.model.response import film_response
from glazejax import Hemispherical, catalogue

from .palette import GRID, optical_depths, raise_readings

RECIPES = {"blue": {"Blue": 1.0}, "white": {"White": 1.0}, "tint": {"Blue": 1.0, "White": 9.0}}


@pytest.fixture(scope="module")
def films() -> tuple[Films, Films]:
    """Films of gloss .75, with the specular part and without it. Their paints have no dark band
    that would tell.
    """
    k = np.stack([np.linspace(1.5, 0.3, GRID.size), np.full(GRID.size, 0.02)])
    s = np.stack([np.full(GRID.size, 0.6), np.linspace(3.0, 2.0, GRID.size)])
    share = np.array([[1.0, 0.0], [0.0, 1.0], [0.1, 0.9]])
    smooth = simulate_films(GRID, share @ k, share @ s, names=list(RECIPES), noise=Noise(1e-5, 0.0))
    surface = Instrument().seen_surface
    return raise_readings(smooth, -0.25 * surface), raise_readings(smooth, -surface)


def test_the_difference_is_the_gloss(films):
    with_it, without = films
    assert measure_gloss(with_it, without, Instrument()) == pytest.approx(
        dict.fromkeys(RECIPES, 0.75), abs=1e-3
    )


def test_films_not_read_twice_are_left_out(films):
    assert list(measure_gloss(films[0], films[1].take([2]), Instrument())) == ["tint"]


def test_measured_gloss_is_kept_and_the_paint_is_nearer_to_the_truth(films):
    """Guessed, the gloss is 1 and a paint looks more absorbing than it is."""
    with_it, without = films
    truth = np.log(np.linspace(1.5, 0.3, GRID.size) / 0.6)
    off = []
    for told in (None, measure_gloss(with_it, without, Instrument())):
        found = recover_jointly(with_it, RECIPES, gloss=told, noise=Noise())
        blue = found.row("Blue")
        ratio = np.log(found.absorption[blue] / found.scattering[blue])
        off.append((np.abs(ratio - truth).mean(), np.abs(found.gloss - 0.75).max()))
    (guessed, guessed_gloss), (measured, measured_gloss) = off
    assert measured_gloss < 0.02
    assert guessed_gloss > 0.1
    assert measured < 0.5 * guessed


@pytest.mark.parametrize(
    ("change", "specular", "words"),
    [
        (lambda a, b: (b, a), True, "are the files swapped"),
        (lambda a, b: (a, replace(b, names=("x", "y", "z"))), True, "no film was read both ways"),
        (lambda a, b: (a, replace(b, wavelengths=GRID + 1)), True, "on one grid"),
        (lambda a, b: (a, b), False, "leaves the specular part out"),
    ],
)
def test_readings_that_do_not_go_together(films, change, specular, words):
    with_it, without = change(*films)
    with pytest.raises(ValueError, match=words):
        measure_gloss(with_it, without, Instrument(Hemispherical(8.0, specular=specular)))


@pytest.mark.parametrize("haze", [0.0, 0.01, 0.02])
def test_haze_at_45_0_refuses_no_film_that_is_known(haze):
    """An instrument that leaves out the mirror reflection sees some of a matt surface's."""
    oils = catalogue.load("oils")
    names = ("Vermillion", "CobaltBlue", "LeadWhite", "ChromeYellow", "BoneBlack", "Minium")
    paints = [oils[name] for name in names]
    depths = optical_depths(paints, 60e-6 * np.eye(len(paints)))
    films = film_response("45:0").body(*depths, 0.8) + haze
    grid = paints[0].wavelengths
    found = identify(grid, films, oils, ground=0.8, instrument="45:0", max_paints=1)
    for row, name in enumerate(names):
        assert found.explained[row], found.words(row)
        assert name in found.ranked(row, 1)[0].paints[0]


def test_haze_widens_no_surface_that_is_seen_whole():
    usual = ModelError()
    assert usual.surface_sd(0.04) == pytest.approx(0.35 * 0.04)
    assert usual.surface_sd(0.0) == usual.haze > 0
