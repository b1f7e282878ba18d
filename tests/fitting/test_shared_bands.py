"""Spectra wider or finer than the paints are known: cut and averaged with a word, or refused with
one.
"""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from glazefit import IdentificationOptions
from glazefit.film.shared_bands import SEARCHED, means_of_steps, shared_bands
from glazefit.identify.search.searcher import Searcher
from glazejax import catalogue
from glazejax.spectra import common_range

KNOWN = common_range(paint.wavelengths for paint in catalogue.load().values())


def test_a_spectrum_from_the_ultraviolet_to_the_infrared_is_cut_and_averaged():
    grid = np.arange(360.0, 1000.5, 1.0)
    bands = shared_bands(grid, KNOWN)
    assert bands.notes == (
        "cropped to 400-700 nm step 1 (301 bands): the paints are known there only",
        "301 bands averaged to steps of 10 nm",
    )
    assert bands.wavelengths[0] >= 400
    assert bands.wavelengths[-1] <= 700
    assert_allclose(np.diff(bands.wavelengths)[1:-1], 10.0)
    # Means: a straight line stays one.
    assert_allclose((0.1 + grid / 2000) @ bands.mean, 0.1 + bands.wavelengths / 2000)


def test_bands_that_fit_stay_as_they_are():
    grid = np.arange(420.0, 651.0, 10.0)
    bands = shared_bands(grid, KNOWN)
    assert bands.notes == ()
    assert_array_equal(bands.wavelengths, grid)
    assert_array_equal(bands.mean, np.eye(grid.size))


@pytest.mark.parametrize("count", [61, 121, 151, 200, 301, 601])
def test_bands_that_were_averaged_are_not_averaged_again(count):
    """Means of 6 and 7 of 200 bands lie 9.8 nm apart: nearer than the steps of 10."""
    grid = np.linspace(400.0, 700.0, count)
    mean = means_of_steps(grid, SEARCHED)
    assert mean is not None
    averaged = grid @ mean
    assert means_of_steps(averaged, SEARCHED) is None
    assert Searcher.of(averaged, catalogue.load(), IdentificationOptions()).averaged is None
