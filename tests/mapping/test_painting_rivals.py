"""The methods that maps are compared with find what their own theory makes, and scores count what
they say.
"""

import numpy as np
import pytest
from benchmarks.rivals.painting_rivals import Answer, Truth, TwoFlux, score
from numpy.testing import assert_allclose

from glazejax.catalogue import load

from .truth_map import GRID

NAMES = ("LeadWhite", "BoneBlack", "Vermillion", "UltramarineBlue", "ChromeYellow")
GROUND = np.full(GRID.size, 0.6)


def truth(members, amounts):
    members = np.array(members)
    strange = np.zeros(len(members), bool)
    return Truth(members, np.array(amounts, float), strange, np.ones(len(members), int))


def test_what_is_wrong_counts_by_how_much():
    known = truth([[0, 1, -1]] * 4, [[1e-5, 3e-5, 0]] * 4)
    answer = Answer(
        np.array([[1, -1, -1], [0, 1, 2], [1, 0, -1], [2, -1, -1]]),
        np.array([[1, 0, 0], [0.2, 0.7, 0.1], [0.5, 0.5, 0], [1, 0, 0]]),
        np.array([4e-5, 4e-5, 8e-5, np.nan]),
        np.array([True, False, False, False]),
    )
    found = score(known, answer, ("a", "b", "c"))
    assert found.right_set == 0.25
    assert found.right_main == pytest.approx(0.5)  # a tie goes to the lower number
    assert found.share_error == pytest.approx(np.mean([0.25, 0.1, 0.25, 1.0]))
    # 2/4, .4/4 + ..., and 1 of 4e-5 m; that without a thickness does not count.
    assert found.amount_error == pytest.approx(np.median([0.5, 0.2, 1.0]))
    assert found.false_none == 0.25
    assert np.isnan(found.none_found)


def test_unmixing_by_two_fluxes_finds_what_two_fluxes_made():
    catalogue = load()
    flux = TwoFlux([catalogue[name].resample(GRID) for name in NAMES], GROUND)
    amounts = np.array([[2e-5, 0, 4e-6, 0, 0], [0, 1e-7, 0, 8e-6, 0], [1e-5, 0, 0, 3e-6, 2e-6]])
    spectra = flux.reading(amounts @ flux.absorption, amounts @ flux.scattering, GROUND)
    found = flux.film(spectra, rounds=300)
    assert_allclose(found.shares * found.thickness[:, None], amounts, atol=2e-8)
    assert found.misfit.max() < 1e-5
    shares = amounts / amounts.sum(axis=1, keepdims=True)
    thick = flux.reading(shares @ flux.absorption * 0.01, shares @ flux.scattering * 0.01, GROUND)
    hiding = flux.opaque(thick)
    assert_allclose(hiding.shares, shares, atol=2e-3)
    assert hiding.misfit.max() < 1e-4
