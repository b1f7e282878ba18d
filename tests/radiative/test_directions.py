"""Directions: what they must integrate, against adaptive quadrature, and how few they are."""

import itertools

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import expn

from glazejax.radiative.common.directions import Resolution, half_range, resolve
from glazejax.radiative.common.fresnel import dielectric_reflectance
from glazejax.radiative.common.simultaneous import fine_half_range, simultaneous_rule
from glazejax.radiative.ordinates.resolution import flux_error, flux_sums, resolve_known
from tests.tolerances import LAST_DIGITS, ROUNDING

INDICES = (1.0, 1.0001, 1.07, 1.33, 1.5, 2.5)


def sums_by_quadrature(index: float, depth: float) -> tuple[float, float]:
    """Integrals of mu e^(-t/mu) and of R(mu) mu e^(-t/mu) over the half range."""

    def let_out(outside):  # mu dmu = outside d outside/n^2
        mu = np.sqrt(1 - (1 - outside**2) / index**2)
        through = 1 - float(dielectric_reflectance(outside, index))
        return through * np.exp(-depth / mu) * outside / index**2 if mu > 0 else 0.0

    rise = 4 * np.sqrt(index**2 - 1)
    edges = (0.0, min(rise, 0.5), 1.0) if rise else (0.0, 1.0)
    passing = sum(
        quad(let_out, a, b, epsabs=1e-13, epsrel=1e-12, limit=400)[0]
        for a, b in itertools.pairwise(edges)
    )
    everything = float(expn(3, depth))
    return everything, everything - passing


@pytest.mark.parametrize("index", INDICES)
def test_fine_sums_are_the_integrals(index):
    fine = fine_half_range(index, 6.0)
    for depth in (0.0, 0.01, 0.3, 2.0):
        terms = fine.weights * fine.cosines * np.exp(-depth / fine.cosines)
        assert (terms.sum(), terms @ fine.reflectance) == pytest.approx(
            sums_by_quadrature(index, depth), abs=ROUNDING
        )


@pytest.mark.parametrize("index", INDICES)
@pytest.mark.parametrize("tolerance", [1e-2, 1e-6, 1e-10])
def test_chosen_directions_meet_their_share_of_the_tolerance(index, tolerance):
    chosen = half_range(index, resolve_known(tolerance, index))
    assert np.all(chosen.weights > 0)
    assert np.sum(chosen.weights) == pytest.approx(1, abs=LAST_DIGITS)
    assert np.sum(chosen.weights * chosen.cosines) == pytest.approx(0.5, abs=LAST_DIGITS)
    assert np.all((chosen.cosines > 0) & (chosen.cosines < 1))
    # What each direction reflects only has a meaning in sums; their first one is the flux that
    # comes back.
    for depth in (0.0, 0.02, 0.5, 3.0):
        terms = chosen.weights * chosen.cosines * np.exp(-depth / chosen.cosines)
        exact = sums_by_quadrature(index, depth)
        assert (terms.sum(), terms @ chosen.reflectance) == pytest.approx(
            exact, abs=0.17 * tolerance + 1e-12
        )


@pytest.mark.parametrize("range_of_indices", [(1.5, 1.5), (1.0, 1.5), (1.3, 2.4)])
def test_a_coarser_tolerance_takes_fewer_directions(range_of_indices):
    """A step of the table for each power of ten, and what is finer than all takes the last."""
    counts = [sum(resolve(10.0**-n, *range_of_indices)[:2]) for n in range(3, 11)]
    assert np.all(np.diff(counts) > 0)
    assert sum(resolve(0.5e-3, *range_of_indices)[:2]) == counts[1]
    assert sum(resolve(1e-13, *range_of_indices)[:2]) == counts[-1]


def test_fewer_directions_than_a_rule_split_at_the_critical_angle():
    exact = flux_sums(fine_half_range(1.5, 6.0))
    ours = simultaneous_rule(1.5, 8, 2, 4.0)
    split = half_range(1.5, Resolution(4, 6))
    assert ours is not None
    assert flux_error(ours, exact) < 0.02 * flux_error(split, exact)


def test_degree_of_exactness():
    # n + whole - 1 powers of y under dy and n + cone - 1 under (1 - R) dy, by which the rule is
    # defined.
    whole, cone, crowding = 4, 2, 2.5
    rule = simultaneous_rule(1.5, whole, cone, crowding)
    assert rule is not None
    fine = fine_half_range(1.5, crowding)
    for which, degree in (
        (lambda r: 1.0, 2 * whole + cone),
        (lambda r: 1.0 - r.reflectance, whole + 2 * cone),
    ):
        for power in range(degree + 1):
            found, exact = (
                np.sum(
                    (np.log1p(r.cosines * np.expm1(crowding)) / crowding) ** power
                    * r.weights
                    * which(r)
                    / (1 + r.cosines * np.expm1(crowding))
                )
                for r in (rule, fine)
            )
            agrees = abs(found / exact - 1) < ROUNDING
            assert agrees == (power < degree), (power, degree)
