"""The methods that maps are compared with find what their own theory makes, and scores count what
they say.
"""

import numpy as np
import pytest
from benchmarks.rivals.painting_rivals import (
    Answer,
    Truth,
    TwoFlux,
    films,
    linear,
    score,
    spectral_angle,
)
from numpy.testing import assert_allclose

from glazejax.catalogue import load
from glazejax.radiative.twoflux import saunderson, two_flux_reflectance

from .truth_map import GRID

NAMES = ("LeadWhite", "BoneBlack", "Vermillion", "UltramarineBlue", "ChromeYellow")
GROUND = np.full(GRID.size, 0.6)


@pytest.fixture(scope="module")
def paints():
    catalogue = load()
    return [catalogue[name].resample(GRID) for name in NAMES]


@pytest.fixture(scope="module")
def flux(paints):
    return TwoFlux(paints, GROUND)


def truth(members, amounts, foreign=None):
    members = np.array(members)
    foreign = np.zeros(len(members), bool) if foreign is None else np.array(foreign, bool)
    return Truth(members, np.array(amounts, float), foreign, np.ones(len(members), int))


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


def test_films_of_two_fluxes_are_those_of_the_package(flux):
    rng = np.random.default_rng(0)
    k, s = 10 ** rng.uniform(-8, 3, (2, 400))
    k, s = np.append(k, [0.0, 0.0, 3.0]), np.append(s, [0.0, 2.0, 0.0])
    body = saunderson(two_flux_reflectance(k, s, 0.7), *flux.surface)
    assert_allclose(flux.reading(k, s, 0.7), flux.surface.outer + np.asarray(body), atol=1e-9)
    inside = np.linspace(0.01, 0.95, 20)
    reading = flux.surface.outer + np.asarray(saunderson(inside, *flux.surface))
    assert_allclose(flux.surface.inside(reading), inside, rtol=1e-9)


def test_two_constants_are_fitted_to_films_over_black_and_white(flux, paints):
    assert flux.calibration_error < 0.01
    exact = films(paints, np.eye(5), 25e-6, np.full(GRID.size, 0.93))
    ours = flux.reading(flux.absorption * 25e-6, flux.scattering * 25e-6, 0.93)
    assert np.abs(ours - exact).max() < 0.03
    # Constants of radiative transfer turned into two are a worse start.
    k = 2.0 * np.array([np.asarray(p.absorption) for p in paints])
    s = 0.75 * np.array([np.asarray(p.scattering) for p in paints])
    assert (
        np.abs(flux.reading(k * 25e-6, s * 25e-6, 0.93) - exact).mean()
        > np.abs(ours - exact).mean()
    )


def test_unmixing_by_two_fluxes_finds_what_two_fluxes_made(flux):
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


def test_linear_unmixing_finds_areas_side_by_side(paints):
    ends = films(paints, np.eye(5), 0.005, GROUND)
    shares = np.array([[0.2, 0, 0.8, 0, 0], [0, 0.1, 0, 0.5, 0.4]])
    found = linear(paints, GROUND)(shares @ ends)
    assert_allclose(found.shares, shares, atol=1e-9)
    layered = linear(paints, GROUND, logarithm=True)(np.exp(shares @ np.log(ends)))
    assert_allclose(layered.shares, shares, atol=1e-9)
    assert found.misfit.max() < 1e-9


def test_the_spectral_angle_finds_an_entry_however_bright_it_is(paints):
    weights = np.array([[0, 0, 0.75, 0, 0.25], [0, 0, 0, 1.0, 0]])
    spectra = 0.7 * films(paints, weights, 8e-6, GROUND)
    found = spectral_angle(paints, GROUND)(spectra)
    assert_allclose(found.shares, weights)
    assert_allclose(found.thickness, 8e-6)
    assert found.misfit.max() < 1e-3
    pure = spectral_angle(paints, GROUND, pairs=False)(spectra)
    assert (pure.shares.max(axis=1) == 1).all()
    assert pure.misfit[0] > found.misfit[0]
