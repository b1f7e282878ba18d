"""The tables that ship are colour-science's, and the formulas say what its formulas say."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from glazejax import cie
from glazejax import colour as gc
from glazejax.cie.difference import ciede2000

from .checks import check_slopes
from .fresh import run_python

colour = gc.colour_science()
GRID = np.arange(400.0, 701.0, 10.0)


def test_illuminants_are_all_of_colour_science():
    ours = cie.illuminants()
    assert list(ours) == [str(name) for name in colour.SDS_ILLUMINANTS]
    for name, curve in ours.items():
        theirs = colour.SDS_ILLUMINANTS[name]
        assert_array_equal(curve.wavelengths, theirs.wavelengths)
        assert_array_equal(curve.values, theirs.values)
        # Joined by lines there too.
        assert theirs.interpolator is colour.LinearInterpolator


def test_observers_are_those_of_colour_science():
    assert tuple(cie.observers()) == cie.OBSERVERS
    for name, curves in cie.observers().items():
        theirs = colour.MSDS_CMFS[name]
        for curve, values in zip(curves, theirs.values.T, strict=True):
            assert_array_equal(curve.wavelengths, theirs.wavelengths)
            assert_array_equal(curve.values, values)


def test_charts_are_those_of_colour_science():
    ours = cie.charts() | {short: cie.charts()[full] for short, full in cie.SHORT_CHARTS.items()}
    assert set(ours) == {str(name) for name in colour.SDS_COLOURCHECKERS}
    for name, patches in ours.items():
        theirs = colour.SDS_COLOURCHECKERS[name]
        assert list(patches) == [str(patch) for patch in theirs]
        for patch, curve in patches.items():
            assert_array_equal(curve.wavelengths, theirs[patch].wavelengths)
            assert_array_equal(curve.values, theirs[patch].values)


def test_difference_is_that_of_colour_science():
    rng = np.random.default_rng(3)
    one, other = (rng.uniform((0, -120, -120), (100, 120, 120), (20000, 3)) for _ in range(2))
    near = one + rng.normal(0, 0.5, one.shape)
    grey = one * (1, 0, 0)
    for a, b in (
        (one, other),
        (one, near),
        (one, grey),
        (grey, one),
        (grey, grey[::-1]),
        (one, one),
    ):
        assert_allclose(
            ciede2000(a, b), colour.delta_E(a, b, method="CIE 2000"), atol=2e-12, rtol=0
        )


@pytest.mark.parametrize(
    ("one", "other", "apart"),
    [
        # Sharma, Wu, Dalal (2005), table 1: across the jump of hue, through grey, far apart.
        ((50, 2.6772, -79.7751), (50, 0, -82.7485), 2.0425),
        ((50, 2.4900, -0.0010), (50, -2.4900, 0.0009), 7.1792),
        ((50, 2.5, 0), (73, 25, -18), 27.1492),
    ],
)
def test_difference_of_published_pairs(one, other, apart):
    assert gc.delta_e_2000(one, other) == pytest.approx(apart, abs=5e-5)


def test_differences_broadcast():
    assert ciede2000(np.ones((4, 1, 3)), np.ones((5, 3))).shape == (4, 5)


def test_bradford_is_that_of_colour_science():
    one, other = np.array([0.95, 1.0, 1.09]), np.array([1.1, 1.0, 0.35])
    theirs = colour.adaptation.matrix_chromatic_adaptation_VonKries(
        one, other, transform="Bradford"
    )
    assert_allclose(gc.bradford(one, other), theirs, atol=1e-14)


def test_back_from_srgb_and_lab():
    encoded = np.random.default_rng(4).uniform(0, 1, (500, 3))
    encoded[0] = 0.0404
    white = gc.srgb_to_xyz(np.ones(3))
    there = gc.srgb_to_xyz(encoded)
    assert_allclose(gc.xyz_to_srgb(there, white), encoded, atol=1e-12)
    lab = np.asarray(gc.xyz_to_lab(there, white))
    assert_allclose(gc.lab_to_xyz(lab, white), there, atol=1e-13)
    assert_allclose(
        gc.lab_to_xyz(lab, white), colour.Lab_to_XYZ(lab, colour.XYZ_to_xy(white)), atol=1e-13
    )
    assert_allclose(white, colour.xy_to_XYZ(np.array(gc.SRGB_WHITE)), atol=1e-14)


def test_lab_of_srgb_is_that_of_colour_science():
    encoded = np.random.default_rng(6).uniform(0, 1, (500, 3))
    encoded[:4] = [[0, 0, 0], [1, 1, 1], [0.04, 0.0404, 0.0405], [0.001, 0.02, 0.9]]
    light = colour.models.eotf_sRGB(encoded)
    matrix = colour.models.RGB_COLOURSPACE_sRGB
    to_xyz = colour.models.normalised_primary_matrix(matrix.primaries, np.array(gc.SRGB_WHITE))
    theirs = colour.XYZ_to_Lab(light @ to_xyz.T, np.array(gc.SRGB_WHITE))
    assert_allclose(gc.srgb_to_lab(encoded), theirs, atol=1e-11)
    assert_allclose(gc.srgb_to_lab([1, 1, 1]), [100, 0, 0], atol=1e-12)


def test_lab_of_srgb_runs_under_jit_and_grad():
    encoded = np.random.default_rng(7).uniform(0.01, 0.99, (6, 3))
    assert_allclose(jax.jit(gc.srgb_to_lab)(encoded), gc.srgb_to_lab(encoded), atol=1e-11)
    check_slopes(gc.srgb_to_lab, (encoded,), eps=1e-6, rtol=1e-6, atol=1e-6)
    assert np.isfinite(jax.jacfwd(gc.srgb_to_lab)(jnp.array([0.0, 1.0, 0.0]))).all()
    with pytest.raises(ValueError, match=r"shape \(2,\) does not end in the three numbers"):
        gc.srgb_to_lab([0.5, 0.5])


def test_numpy_and_jax_compute_the_same_colours():
    spectra = np.random.default_rng(5).uniform(0, 1.2, (7, GRID.size))
    spectra[0] = 0.0
    for function in (gc.xyz, gc.lab, gc.srgb, lambda *given: gc.srgb(*given, clip=False)):
        small, compiled = function(GRID, spectra), function(GRID, jnp.asarray(spectra))
        assert (type(small), small.dtype) == (type(compiled), compiled.dtype)
        assert_allclose(small, compiled, atol=1e-13)


def test_numpy_colours_compile_nothing():
    """A hundred small programs, of 20 ms each, are what a command would wait for."""
    code = """
import numpy as np, jax.monitoring
compiled = []
def count(event, seconds, **_):
    if "backend_compile" in event:
        compiled.append(event)
jax.monitoring.register_event_duration_secs_listener(count)
from glazejax import colour
grid = np.arange(400.0, 701.0, 10.0)
lab = np.asarray(colour.lab(grid, np.ones((3, 31))))
colour.srgb(grid, np.ones(31)), colour.xyz(grid, np.ones(31)), colour.delta_e_2000(lab, lab)
colour.xyz_to_lab(np.ones(3), np.ones(3)), colour.xyz_to_srgb(np.ones(3), np.ones(3))
assert not compiled, compiled
"""
    run_python(code)
