"""Answers in closed form, beside searches of the same spectra."""

import dataclasses
import functools

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from glazefit import Noise
from glazefit.film.colour_metric import reading_metric
from glazefit.identify.result import Identification
from glazefit.identify.search.options import IdentificationOptions
from glazefit.identify.search.searcher import Searcher
from glazefit.mapping.solve.atlas import Atlas
from glazefit.mapping.solve.by_paint import PaintSearcher
from glazefit.mapping.solve.features import Features
from glazefit.mapping.solve.local import Searched
from glazejax.colour import delta_e_of_spectra
from tests.mapping import small

from ..slow import slow

COUNTS = {"over a ground": 96, "hiding": 40}
"""Of spectra; few of those over a ground leave more than one candidate to compare."""


@dataclasses.dataclass
class Problem:
    searcher: PaintSearcher
    readings: np.ndarray
    sd: np.ndarray
    known: Searched

    @property
    def atlas(self):
        features = Features.of(self.readings)
        return Atlas(features, self.readings.astype("f4"), self.known, self.searcher)

    @functools.cached_property
    def found(self):
        """Of the readings themselves."""
        return self.search(self.readings)

    def search(self, readings):
        return list(self.searcher.searcher.search(self.searcher.measure(readings, self.sd)))


def sd_of(readings):
    return np.hypot(0.001, Noise().sd(readings))


# That a map agrees with searches of its pixels, test_map_cube.py tells quickly.
@pytest.fixture(
    scope="module",
    params=[slow(each) for each in ("over a ground", "hiding")],
)
def problem(request):
    scene = small.scene()
    image = small.at_bands(scene.wavelengths, small.paints())
    bands = image.bands
    searcher = Searcher.of(
        bands.wavelengths,
        small.paints(),
        IdentificationOptions(max_paints=2),
        opaque=request.param == "hiding",
    )
    ground = None if request.param == "hiding" else scene.ground @ bands.mean
    spectra = scene.rows(0, 24, noise=False).reshape(-1, scene.wavelengths.size)
    chosen = np.random.default_rng(0).choice(len(spectra), COUNTS[request.param], replace=False)
    readings = image.means(spectra)[chosen].astype(float)
    sd = sd_of(readings)
    over = PaintSearcher(searcher, ground)
    return Problem(over, readings, sd, over.search(readings, sd))


def probabilities(problem, found):
    measured, pool, odds = found[0]
    searcher = problem.searcher.searcher
    return Identification.of(
        measured,
        pool,
        odds,
        paints=searcher.paints,
        opaque=searcher.task.hides,
        keep=3,
        spread=searcher.spread,
    )


def same_sets(answers, whole):
    """Which spectra have the same paints."""
    return (np.sort(answers.members, axis=1) == np.sort(whole.members[:, 0], axis=1)).all(axis=1)


def test_at_a_representative_it_is_the_search(problem):
    found, apart = problem.atlas.answers(problem.readings.astype("f4"))
    whole = probabilities(problem, problem.found)
    assert apart.max() < 0.2  # single precision
    assert same_sets(found, whole).all()
    assert_allclose(found.probability, whole.probability[:, 0], atol=0.02)
    assert_allclose(found.none, whole.none, atol=0.04)
    assert_allclose(found.paint_probability, whole.paint_probability, atol=0.04)
    assert_allclose(found.fitted, whole.fitted[:, 0, 0], atol=1e-4)
    assert_allclose(np.exp(found.amounts), whole.amounts[:, 0], rtol=1e-3, atol=1e-12)
    assert_array_equal(found.explained, whole.explained)


def test_candidates_that_were_left_out_keep_their_share(problem):
    """Of all odds of candidates a share r is of those left out: the others have 1 - r, and none
    against all of them has less.
    """
    readings = problem.readings.astype("f4")
    left_out = 0.3

    def answers(rest):
        known = dataclasses.replace(problem.known, rest=np.full_like(problem.known.rest, rest))
        atlas = Atlas(Features.of(readings), readings, known, problem.searcher)
        return atlas.answers(readings)[0]

    without, found = answers(0.0), answers(left_out)
    whole = (1.0 - without.none) / (1.0 - left_out) + without.none
    assert_allclose(found.probability, without.probability / whole, rtol=1e-5)
    assert_allclose(found.none, without.none / whole, rtol=1e-5)


@pytest.mark.slow
def test_spectra_between_representatives_are_answered_as_searched(problem):
    rng = np.random.default_rng(2)
    noisy = np.maximum(problem.readings + 0.001 * rng.standard_normal(problem.readings.shape), 0.0)
    found, _ = problem.atlas.answers(noisy.astype("f4"))
    whole = probabilities(problem, problem.search(noisy))
    same = same_sets(found, whole)
    assert same.mean() >= 0.85
    # Without what the spectrum changes in weights, amounts or films these are off by more.
    apart = np.abs(found.paint_probability - whole.paint_probability).max(axis=1)
    assert np.median(apart) < 0.0055
    assert np.median(np.abs(found.fitted - whole.fitted[:, 0, 0]).max(axis=1)[same]) < 3e-4
    there = (found.members == whole.members[:, 0]) & (found.members >= 0)
    off = np.exp(found.amounts[there]) / whole.amounts[:, 0][there] - 1.0
    assert np.median(np.abs(off)) < 0.0035


def test_colours_differ_as_the_metric_says():
    rng = np.random.default_rng(3)
    grid = np.arange(400.0, 701.0, 10.0)
    base = 0.1 + 0.6 * rng.random((6, 1)) * (1 + 0.5 * np.sin(grid / 40.0 + 6 * rng.random((6, 1))))
    metric = reading_metric(grid, base)
    step = 0.004 * np.cos(grid / 70.0 + 6 * rng.random((6, 1)))
    told = np.linalg.norm(np.einsum("scb,sb->sc", metric, step), axis=1)
    seen = np.asarray(delta_e_of_spectra(grid, base, base + step, observer=10))
    assert_allclose(told, seen, rtol=0.08)
    # Without a colour it is a hundred times the root mean square.
    few = np.linspace(900.0, 1000.0, 11)
    flat = reading_metric(few, np.full((1, 11), 0.4))
    assert np.linalg.norm(flat[0] @ np.full(11, 0.01)) == pytest.approx(1.0)
