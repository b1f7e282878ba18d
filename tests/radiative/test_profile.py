"""Films that vary with depth: both methods against each other, and limits that are known."""

import warnings

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from glazejax import (
    profile_hemispherical_reflectance,
    profile_reflectance_factor,
    stack_hemispherical_reflectance,
    stack_reflectance_factor,
)
from glazejax.radiative.profile import _has_settled, _piecewise_linear

from ..checks import check_slopes, largest_difference
from ..refusals import refusal
from ..slow import slow

DEPTH = 2e-5
METHODS = ("ordinates", "auxiliary")


def absorption(z):
    return 1e4 * (1 + z / 1e-5)


def scattering(z):
    return 8e4 * jnp.exp(-z / 1e-5)


@pytest.mark.parametrize("method", ["ordinates", slow("auxiliary")])
def test_a_constant_profile_is_a_homogeneous_layer(method):
    k, s = np.array([[2e4], [0.0], [1e4]]), np.array([[5e4], [9e4], [0.0]])
    given = {"cos_incidence": 0.7, "tolerance": 1e-4}
    found = profile_reflectance_factor(k, s, DEPTH, 0.6, method=method, **given)
    expected = stack_reflectance_factor(
        s / (k + s), (k + s) * DEPTH, 0.6, cos_incidence=0.7, tolerance=1e-7
    )
    assert found.shape == (3,)
    assert largest_difference(found, expected) < 1e-4


@pytest.mark.slow
def test_both_methods_and_many_slices_agree():
    z = (np.arange(200) + 0.5) / 200 * DEPTH
    k, s = absorption(z), np.asarray(scattering(z))
    slices = stack_reflectance_factor(s / (k + s), (k + s) * DEPTH / 200, 0.6, tolerance=1e-7)
    for method in METHODS:
        found = profile_reflectance_factor(
            absorption, scattering, DEPTH, 0.6, method=method, tolerance=1e-5
        )
        assert found == pytest.approx(float(slices), abs=2e-5), method


@pytest.mark.slow
def test_samples_agree_and_tend_to_two_layers():
    # Linear between samples: a step over one interval of many is almost two layers.
    k, s = [1e4] * 16 + [4e4] * 16, [9e4] * 16 + [1e4] * 16
    found = profile_hemispherical_reflectance(k, s, DEPTH, 0.3, tolerance=1e-4)
    two = stack_hemispherical_reflectance([0.9, 0.2], np.array([1e5, 5e4]) * DEPTH / 2, 0.3)
    assert found == pytest.approx(float(two), abs=2e-3)
    few = [
        profile_reflectance_factor(
            [1e4, 5e4, 2e4], [9e4, 1e4, 0.0], DEPTH, 0.3, method=m, tolerance=1e-4
        )
        for m in METHODS
    ]
    assert few[0] == pytest.approx(float(few[1]), abs=2e-4)


def test_samples_are_joined_by_straight_lines():
    """Values at three depths, for two films at once, against numpy's interpolation."""
    samples, share = (
        np.array([[1.0, 3.0, 2.0], [0.0, 4.0, 4.0]]),
        np.array([0.0, 0.2, 0.5, 0.75, 1.0]),
    )
    found = _piecewise_linear(jnp.asarray(samples))(jnp.asarray(share))
    np.testing.assert_allclose(
        found, [np.interp(share, [0.0, 0.5, 1.0], row) for row in samples], atol=1e-15
    )
    np.testing.assert_array_equal(
        _piecewise_linear(jnp.asarray([7.0]))(jnp.asarray(share)), np.full(5, 7.0)
    )


def test_no_thickness_is_a_bare_ground():
    bare = stack_reflectance_factor([0.0], [0.0], 0.6)
    for method in METHODS:
        found = profile_reflectance_factor(
            [1e4, 2e4], [0.0, 3e4], 0.0, 0.6, method=method, tolerance=1e-4
        )
        assert found == pytest.approx(float(bare), abs=1e-4)


def test_single_precision_meets_the_default_without_a_warning():
    with jax.enable_x64(False), warnings.catch_warnings():
        warnings.simplefilter("error")
        value = profile_reflectance_factor([1e4, 1e4], [5e4, 5e4], DEPTH, 0.6)
        with pytest.raises(UserWarning, match="least there is in single precision"):
            profile_reflectance_factor([1e4, 1e4], [5e4, 5e4], DEPTH, 0.6, tolerance=1e-8)
    expected = stack_reflectance_factor([5 / 6], [6e4 * DEPTH], 0.6)
    assert value.dtype == jnp.float32
    assert largest_difference(value, expected) < 1e-5


def test_what_single_precision_leaves_counts_as_settled():
    for dtype, settled in ((jnp.float32, True), (jnp.float64, False)):
        change = np.array([0.0, -8e-6])
        assert _has_settled(change, jnp.zeros(2, dtype), 1e-6, last=False) == settled
    with refusal("the profile varies too fast"):
        _has_settled(np.array([2e-5]), jnp.zeros(1, jnp.float32), 1e-6, last=True)


@pytest.mark.slow
def test_gradients_under_jit():
    def f(k, d):
        return profile_reflectance_factor(1e4 * k, [9e4, 1e4, 2e4], DEPTH * d, 0.6, tolerance=1e-4)

    k = jnp.array([1.0, 2.0, 4.0])
    check_slopes(jax.jit(f), (k, 1.0), eps=1e-3, rtol=1e-3, atol=1e-8)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"absorption": [1e4, -1.0]}, "absorption holds -1.0"),
        ({"scattering": lambda z: -z - 1.0}, "scattering holds -1"),
        ({"absorption": 1e4}, "single number"),
        ({"absorption": []}, "no values"),
        (
            {"absorption": np.ma.array([1e4, 2e4], mask=[False, True])},
            "absorption has masked values",
        ),
        ({"thickness": np.ma.array([1e-5], mask=True)}, "thickness has masked values"),
        ({"absorption": [1.0, 2.0, 3.0]}, "3 depths .* 2"),
        ({"thickness": -1e-6}, "thickness holds -1e-06"),
        ({"scattering": lambda z: jnp.zeros(4)}, "returned shape"),
        ({"substrate_reflectance": 60.0}, "substrate_reflectance holds 60.0"),
        ({"method": "magic"}, "method 'magic' is unknown"),
        ({"method": "manyflux"}, "use one of 'ordinates', 'auxiliary'"),
        ({"tolerance": 0.0}, "tolerance is 0"),
    ],
)
def test_bad_input_says_what_and_how_to_mend(unchecked, change, message):
    given = {
        "absorption": [1e4, 2e4],
        "scattering": [1e4, 2e4],
        "thickness": 1e-5,
        "substrate_reflectance": 0.5,
    }
    with refusal(message):
        profile_reflectance_factor(**(given | change))
