"""Coefficients of exemplars at bands at which they were not read."""

import numpy as np
from numpy.testing import assert_allclose, assert_array_equal

from glazefit.identify.families.templates import with_stand_ins

K_AND_S = np.exp(np.random.default_rng(3).normal(10.0, 1.0, (2, 5, 8)))
FAMILY_OF = np.array([0, 0, 0, 1, 1])


def known_between(first: int, last: int, row: int | slice) -> np.ndarray:
    """The coefficients with an exemplar, or some, known from one band to another."""
    k_and_s = K_AND_S.copy()
    k_and_s[:, row, :first] = np.nan
    k_and_s[:, row, last + 1 :] = np.nan
    return k_and_s


def test_what_is_known_stays():
    filled = with_stand_ins(known_between(2, 5, 0), FAMILY_OF)
    assert_allclose(filled[:, 0, 2:6], K_AND_S[:, 0, 2:6], rtol=1e-12)
    assert_allclose(filled[:, 1:], K_AND_S[:, 1:], rtol=1e-12)


def test_a_copy_of_a_relative_is_continued_as_it():
    """A weaker paint of the family's only other one: its spectrum, as much weaker."""
    k_and_s = known_between(2, 5, 4)
    factors = np.array([0.3, 0.8])[:, None]
    k_and_s[:, 4, 2:6] = factors * K_AND_S[:, 3, 2:6]
    filled = with_stand_ins(k_and_s, FAMILY_OF)
    assert_allclose(filled[:, 4], factors * K_AND_S[:, 3], rtol=1e-12)


def test_all_stand_in_for_a_family_that_is_known_nowhere_else():
    filled = with_stand_ins(known_between(0, 5, 4), np.array([0, 0, 0, 1, 2]))
    ratio = np.log(filled[0] / filled[1])
    change = ratio[:4, 6:] - ratio[:4, [5]]
    assert_allclose(ratio[4, 6:], ratio[4, 5] + np.median(change, axis=0), rtol=1e-12)


def test_what_is_known_nowhere_stays_unknown():
    k_and_s = K_AND_S.copy()
    k_and_s[:, 2] = np.nan
    assert_array_equal(
        np.isfinite(with_stand_ins(k_and_s, FAMILY_OF)[0]).all(axis=1), np.arange(5) != 2
    )


def test_what_nobody_knows_stays_unknown():
    k_and_s = known_between(0, 5, slice(None))
    assert_allclose(with_stand_ins(k_and_s, FAMILY_OF), k_and_s, rtol=1e-12)
