import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.interpolate import CubicSpline

from glazejax.io import SpectraTable, resample

from .samples import GRID, spectra


def table(grid, values=None):
    values = spectra(3, grid) if values is None else values
    return SpectraTable(grid, tuple("abc"[: len(values)]), values)


def test_same_wavelengths_change_nothing():
    assert_allclose(resample(table(GRID), GRID).reflectance, spectra(), atol=1e-12)


def test_even_grids_as_colour_science_does_it():
    import colour

    finer = np.arange(400.0, 701.0, 5.0)
    wanted = colour.SpectralDistribution(spectra()[1], GRID).interpolate(
        colour.SpectralShape(400, 700, 5)
    )
    assert_allclose(resample(table(GRID), finer).reflectance[1], wanted.values, atol=1e-7)


def test_uneven_grids_by_cubic_splines():
    grid = 400 + 300 * np.linspace(0, 1, 60) ** 1.3
    new = resample(table(grid), GRID)
    assert_allclose(new.reflectance[2], CubicSpline(grid, spectra(3, grid)[2])(GRID), atol=1e-12)
    # The true curve, which linear interpolation misses by more.
    assert np.abs(new.reflectance - spectra()).max() < 1e-3
    assert "cubic splines" in new.notes[-1]


def test_few_bands_are_joined_by_lines():
    new = resample(table(np.array([400.0, 500.0]), np.array([[0.2, 0.4]])), [400, 425, 500])
    assert_allclose(new.reflectance, [[0.2, 0.25, 0.4]])


def test_no_overshoot_below_zero_or_above_the_peak():
    step = np.where(GRID < 550, 0.0, 0.9)[None]
    new = resample(table(GRID, step), np.arange(400.0, 700.5, 0.5))
    assert new.reflectance.min() == 0
    assert new.reflectance.max() == 0.9


def test_picking_bands_is_said():
    fine = np.arange(400.0, 701.0, 1.0)
    assert "picked, not averaged" in str(resample(table(fine), GRID).notes)
    assert "picked" not in str(resample(table(GRID), fine).notes)


@pytest.mark.parametrize(
    ("new", "complaint"),
    [
        (
            np.arange(380, 701, 10),
            "cannot resample 400-700 nm step 10 .* to 380-700 nm .* keep to 400-700 nm",
        ),
        (np.arange(400, 721, 10), "to 400-720 nm"),
        ([800, 900], "they do not meet"),
        ([500, 400], "must ascend"),
        ([], "non-empty"),
        ([400, np.nan], "finite"),
    ],
)
def test_nothing_is_guessed(new, complaint):
    with pytest.raises(ValueError, match=complaint):
        resample(table(GRID), new)
