"""That annotations are checked while tests run, and how often."""

import os

import jaxtyping
import numpy as np
import pytest

from glazejax.radiative.common.fresnel import dielectric_reflectance

EVERY = os.environ.get("GLAZEJAX_CHECK_TYPES", "1")
pytestmark = pytest.mark.skipif(EVERY == "0", reason="annotations are not checked now")
WHOLE = np.array([1])
"""An array of whole numbers where the annotation says floating ones; the function would take it."""


@pytest.mark.parametrize("test", ["one", "the next"])
def test_each_test_checks_a_functions_first_hundred_calls(test):
    for _ in range(100):
        with pytest.raises(jaxtyping.TypeCheckError, match="dielectric_reflectance"):
            dielectric_reflectance(WHOLE, 1.5)
    if EVERY == "all":
        with pytest.raises(jaxtyping.TypeCheckError):
            dielectric_reflectance(WHOLE, 1.5)
    else:
        np.testing.assert_allclose(dielectric_reflectance(WHOLE, 1.5), 0.04)


@pytest.mark.usefixtures("unchecked")
def test_nothing_is_checked_where_a_test_says_so():
    np.testing.assert_allclose(dielectric_reflectance(WHOLE, 1.5), 0.04)
