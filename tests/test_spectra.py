import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.interpolate import make_interp_spline

from glazejax.spectra import (
    DEFAULT_WAVELENGTHS,
    as_fraction,
    describe_grid,
    ranges,
    resample,
    scale_by_size,
    validate_wavelengths,
)

from .refusals import refusal


def test_default_grid_is_that_of_the_paper():
    assert DEFAULT_WAVELENGTHS[0] == 380
    assert DEFAULT_WAVELENGTHS[-1] == 780
    assert DEFAULT_WAVELENGTHS.size == 41
    with refusal("read-only"):
        DEFAULT_WAVELENGTHS[0] = 1


def test_grid_is_copied_and_locked():
    mine = np.array([400, 410])
    grid = validate_wavelengths(mine)
    mine[0] = 1
    assert grid.tolist() == [400.0, 410.0]
    assert grid.dtype == np.float64
    assert not grid.flags.writeable


@pytest.mark.parametrize(
    ("grid", "complaint"),
    [
        ([400, 420, 410], "number 3 is 410 nm after 420 nm"),
        ([400, 410, 400], "400 nm is given twice; leave one out"),
        ([400, np.nan], "number 2 is nan"),
        ([0, 400], "number 1 is 0 nm"),
        ([400, np.inf], "number 2 is inf"),
        ([], r"shape \(0,\)"),
        ([[400]], r"shape \(1, 1\)"),
        ([0.4, 0.7], "micrometres: multiply them by 1000"),
        ([4e-7, 7e-7], "7e-07 looks like metres: multiply them by 1e9"),
        (["red"], "must be numbers"),
    ],
)
def test_wrong_grid_is_named(grid, complaint):
    with refusal(complaint):
        validate_wavelengths(grid)


def test_traced_grid_is_refused():
    with refusal("traced"):
        jax.jit(lambda w: w + validate_wavelengths(w))(jnp.array([400.0, 410.0]))


def test_grid_described():
    assert describe_grid(np.array([400.0, 410.0, 420.0])) == "400-420 nm step 10 (3 bands)"
    assert describe_grid(np.array([400.0, 410.0, 430.0])) == "400-430 nm uneven (3 bands)"


@given(
    st.lists(st.floats(0.0, 1.0), min_size=3, max_size=8),
    st.lists(st.floats(0.0, 1.0), min_size=4, max_size=9),
)
def test_resampling_is_the_linear_spline(values, places):
    old = 400.0 + 7.0 * np.arange(len(values)) ** 1.3
    new = np.unique(old[0] + np.array(places) * (old[-1] - old[0]))
    new = new[np.concatenate([[True], np.diff(new) > 1e-6])]
    expected = make_interp_spline(old, values, k=1)(new)
    assert_allclose(resample(old, values, new), expected, atol=1e-12)


def test_resampling_keeps_kind_and_batch():
    old, new = np.array([400, 410, 420]), np.array([405, 415])
    stack = np.arange(12).reshape(2, 2, 3)
    assert isinstance(resample(old, stack, new), np.ndarray)
    there = resample(old, jnp.asarray(stack), new)
    assert isinstance(there, jax.Array)
    assert_allclose(there, stack[..., :-1] + 0.5)


def test_resampling_is_differentiable():
    slope = jax.grad(lambda r: resample([400, 410, 420], r, [404.0]).sum())(jnp.zeros(3))
    assert_allclose(slope, [0.6, 0.4, 0.0], atol=1e-12)


@pytest.mark.parametrize(
    ("new", "complaint"),
    [
        ([390, 400, 410], r"400-420 nm step 10 \(3 bands\) to 390-410 nm.*keep to 400-410 nm"),
        ([410, 430], "keep to 410-410 nm"),
        ([700, 710], "do not meet"),
    ],
)
def test_extrapolation_is_refused(new, complaint):
    with refusal(complaint):
        resample([400, 410, 420], [1, 2, 3], new)


def test_resampling_checks_shape():
    with refusal("do not end in 3 bands"):
        resample([400, 410, 420], [1, 2], [405])


def test_fraction_stays():
    assert as_fraction([1.65, 0.3], "bright").tolist() == [1.65, 0.3]


def test_percent_is_divided():
    assert_allclose(as_fraction([50.0, 4.0], "grey"), [0.5, 0.04])


def test_black_below_the_limit_of_one_band_is_still_percent():
    # A matt ultramarine dips to 2 %, but nowhere is its whole spectrum that dark.
    rows = np.array([[1.2, 6.0], [80.0, 90.0]])
    assert scale_by_size(rows, rows.max(axis=1), ["matt", "white"], [], "") == 100.0


def test_percent_and_fractions_are_not_mixed():
    rows = np.array([[0.3, 0.4], [50.0, 60.0], [0.1, 0.2]])
    with refusal("mixed: dark in percent.*white, tint in fractions"):
        scale_by_size(rows, rows.max(axis=1), ["white", "dark", "tint"], [], "")


@pytest.mark.parametrize(
    ("values", "complaint"),
    [
        ([0.5, np.nan], "white is not finite at band 2"),
        ([0.5, np.inf], "white is not finite at band 2"),
        ([-0.01, 0.6], "white is negative at band 1: -0.01"),
        ([0.5, 1.9], "white reaches 1.9"),
        ([50, 300], "white reaches 300"),
        ([[0.5, 0.6]], r"of shape \(bands,\), not \(1, 2\)"),
    ],
)
def test_wrong_reflectance_is_named(values, complaint):
    with refusal(complaint):
        as_fraction(values, "white")


def test_bands_in_words():
    w = np.arange(400.0, 480.0, 10.0)
    assert ranges(w, np.array([1, 1, 1, 0, 1, 0, 0, 1], bool)) == "400-420, 440, 470 nm"
    assert ranges(w, np.zeros(8, bool)) == "none"
