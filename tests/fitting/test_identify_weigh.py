"""Probabilities of candidates and of none: Bayes' rule, what is seen and what is not."""

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from glazefit.film.model.errors import Prior
from glazefit.identify.result import Identification
from glazefit.identify.search.pool import NOBODY, Pool
from glazefit.identify.search.task import Measured
from glazefit.identify.search.weigh import odds_of

GRID = np.arange(1000.0, 1701.0, 50.0)
"""No colour is seen here: a root mean square of .01 counts as a Delta E00 of 1."""


def film(noise=0.0):
    half = np.full((1, 1, GRID.size), 0.5)
    sd, doubt = np.full_like(half, noise), np.empty((1, 0, 1, GRID.size))
    return Measured(("film",), GRID, half, half, sd, doubt)


def pool(misfit, log_weight: Any = 0.0, sets=None):
    """Candidates of one spectrum, off by so many Delta E00; of one paint each, if not told."""
    count = len(misfit)
    sets = sets or [[paint] for paint in range(count)]
    members = np.array([[[*paints, *[NOBODY] * (3 - len(paints))] for paints in sets]])
    readings = 0.5 + 0.01 * np.array(misfit)[None, :, None, None] * np.ones(GRID.size)
    nothing = np.zeros(members.shape)
    return Pool(
        members,
        nothing.astype(int),
        nothing,
        nothing,
        np.zeros((1, count, 3, 3)),
        np.full((1, count), log_weight),
        readings,
        readings,
        np.ones((1, count)),
        np.zeros((1, count), int),
    )


def none_to_one(misfit, unknown=0.4, noise=0.0):
    """Odds of none against the only candidate."""
    odds = odds_of(film(noise), pool([misfit]), Prior(unknown=unknown))
    return odds.none[0] / odds.candidates[0, 0]


def test_none_by_bayes_rule():
    """Odds beforehand times what the misfit says; that does not depend on what was expected."""
    for misfit in (1.0, 2.0, 3.5):
        said = [none_to_one(misfit, unknown) * (1.0 / unknown - 1.0) for unknown in (0.1, 0.4, 0.8)]
        assert_allclose(said, said[0], rtol=1e-12)


def test_a_fit_that_looks_the_same_speaks_for_its_paints_and_one_that_is_seen_to_be_off_against():
    """Of two films in five beforehand: less than one in four where no difference is seen, three of
    four at 4.
    """
    chance = [1.0 / (1.0 + 1.0 / none_to_one(misfit)) for misfit in (0.25, 0.5, 1.0, 2.0, 3.999)]
    assert np.all(np.diff(chance) > 0)
    assert chance[2] < 0.25
    assert chance[-1] == pytest.approx(0.75, abs=0.02)


def test_what_a_person_rejects_is_at_most_as_probable_as_none():
    rejected = odds_of(film(), pool([3.99, 4.01]), Prior()).rejected
    assert rejected.tolist() == [[False, True]]
    for unknown in (0.01, 0.4):
        odds, none, *_ = odds_of(film(), pool([5.0, 6.0], [0.0, 1.0]), Prior(unknown=unknown))
        assert odds.sum() <= none[0]


def test_what_the_noise_explains_is_no_misfit():
    """A residual as large as the noise is not seen; the same residual of a quiet instrument is."""
    assert none_to_one(2.0, noise=0.02) < none_to_one(1.0)
    assert none_to_one(2.0) > 5.0 * none_to_one(2.0, noise=0.02)


def test_a_fit_without_any_residual_is_as_good_as_one_of_a_tenth():
    """Nothing of a film is known so well; the misfit stays a number whose logarithm counts."""
    for misfit in (0.0, 0.05, 0.1):
        _, none, met, *_ = odds_of(film(), pool([misfit]), Prior())
        assert met[0] == pytest.approx(0.1)
        assert 0.0 < none[0] < 0.01


def test_evidence_ranks_candidates_that_look_alike():
    """Below what is seen only the evidence counts: its ratio is that of the probabilities."""
    odds = odds_of(film(), pool([0.2, 0.9], [0.0, np.log(3.0)]), Prior()).candidates
    assert odds[0, 1] / odds[0, 0] == pytest.approx(3.0)


def test_probabilities_of_paints_are_those_of_the_sets_they_are_in():
    candidates = pool([1.0, 1.0, 1.0], sets=[[0, 1], [1, 2], [2]])
    judged = odds_of(film(), candidates, Prior())
    found = Identification.of(
        film(), candidates, judged, paints=("a", "b", "c"), opaque=False, keep=2, spread=0.7
    )
    assert found.members.shape == (1, 2, 3)
    odds, none, *_ = judged
    one, two, three = odds[0] / (odds.sum() + none[0])
    assert_allclose(found.paint_probability[0], [one, one + two, two + three])
    assert found.none[0] == pytest.approx(1.0 - one - two - three)
