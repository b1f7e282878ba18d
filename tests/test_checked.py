"""Annotations are checked in the quick suite, unless GLAZEJAX_CHECK_TYPES=0."""

import jaxtyping
import numpy as np
import pytest

from glazejax.radiative.common.fresnel import dielectric_reflectance

from .conftest import CHECKED

WHOLE = np.array([1])
"""An array of whole numbers where the annotation says floating ones; the function would take it."""


@pytest.mark.skipif(not CHECKED, reason="annotations are not checked now")
def test_an_array_of_another_dtype_is_refused():
    with pytest.raises(jaxtyping.TypeCheckError, match="dielectric_reflectance"):
        dielectric_reflectance(WHOLE, 1.5)


@pytest.mark.usefixtures("unchecked")
def test_nothing_is_checked_where_a_test_says_so():
    np.testing.assert_allclose(dielectric_reflectance(WHOLE, 1.5), 0.04)
