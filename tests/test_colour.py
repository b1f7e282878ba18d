import itertools
import warnings
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from glazejax.colour import (
    colour_science,
    colour_weights,
    delta_e_2000,
    find_illuminant,
    find_observer,
    lab,
    srgb,
    srgb_to_lab,
    white_point,
    xyz,
)

from .checks import check_mapped, finite
from .fresh import run_python
from .refusals import refusal

colour = colour_science()
GRID = np.arange(400.0, 701.0, 10.0)

OBSERVERS = ["CIE 1931 2 Degree Standard Observer", "CIE 1964 10 Degree Standard Observer"]
LAMPS = ["D65", "A", "D50", "FL2", "FL11", "LED-B3"]
LIGHTS = [
    {"illuminant": lamp, "observer": observer}
    for lamp, observer in itertools.product(LAMPS, OBSERVERS)
]


def paints(wavelengths):
    """Smooth spectra with edges from 10 to 60 nm wide, as paints have."""
    rng = np.random.default_rng(7)
    centre, width = rng.uniform(450, 650, 6), rng.uniform(10, 60, 6)
    sign = rng.choice([-1, 1], 6)
    return 0.05 + 0.85 / (1 + np.exp(-sign * (wavelengths[:, None] - centre) / width)).T


def theirs(wavelengths, spectra, method, illuminant="D65", observer=OBSERVERS[0]):
    """XYZ by colour-science, a spectrum at a time."""
    matching = colour.MSDS_CMFS[observer].copy().align(colour.SpectralShape(360, 780, 1))
    light = colour.SDS_ILLUMINANTS[illuminant].copy().align(matching.shape)
    sds = [colour.SpectralDistribution(values, wavelengths) for values in spectra]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return np.array([colour.sd_to_XYZ(sd, matching, light, method=method) for sd in sds]) / 100


@pytest.mark.parametrize(
    ("start", "end", "step", "method", "error"),
    [
        # The same weights, where the grid covers what they cover.
        (360, 780, 10, "ASTM E308", 1e-14),
        (380, 780, 1, "ASTM E308", 1e-14),
        # Bands beyond the grid: ASTM adds whole weights to the end band, we repeat the end band.
        (380, 780, 10, "ASTM E308", 2e-6),
        (400, 700, 10, "ASTM E308", 5e-5),
        # colour interpolates to 10 nm first.
        (400, 700, 20, "ASTM E308", 2e-4),
        # colour skips to 5 nm matching functions, which is what misses the truth here.
        (380, 780, 5, "ASTM E308", 2e-3),
        (380, 780, 5, "Integration", 1e-5),
        (380, 780, 10, "Integration", 2e-4),
        (400, 700, 20, "Integration", 1e-3),
    ],
)
def test_xyz_is_that_of_astm_e308_and_nearly_the_integral(start, end, step, method, error):
    grid = np.arange(start, end + 1, float(step))
    finest = grid if method == "ASTM E308" else np.arange(360, 781, 1.0)
    for light in LIGHTS:
        expected = theirs(finest, paints(finest), method, **light)
        values = xyz(grid, paints(grid), **light)
        assert_allclose(values, expected, atol=error, rtol=0, err_msg=str(light))


def test_uneven_grid_of_a_camera():
    fine = np.arange(360, 781, 1.0)
    grid = np.linspace(385.4, 995.8, 192) + 0.3 * np.sin(np.arange(192))
    expected = theirs(fine, paints(fine), "Integration")
    assert_allclose(xyz(grid, paints(grid)), expected, atol=1e-5, rtol=0)


def test_white_point_is_the_tabulated_one():
    for light in LIGHTS:
        expected = colour.CCS_ILLUMINANTS[light["observer"]][light["illuminant"]]
        for grid in (np.arange(380, 781, 10), np.arange(400, 701, 20)):
            white = white_point(grid, **light)
            assert white[1] == pytest.approx(1, abs=1e-12)
            assert_allclose(colour.XYZ_to_xy(white), expected, atol=3e-4)


def test_perfect_diffuser_is_white():
    for light in LIGHTS:
        assert_allclose(lab(GRID, np.ones(31), **light), [100, 0, 0], atol=1e-11)
        assert_allclose(srgb(GRID, np.ones(31), **light, clip=False), 1, atol=1e-13)


def test_lab_is_that_of_colour():
    for light in LIGHTS:
        grid = np.arange(380, 781, 10.0)
        # The curve turns into a line at 216/24389: greys below, between it and its neighbours, and
        # above.
        dark = [np.full(41, level) for level in (0.0, 1e-3, 7e-3, 8.8e-3, 8.9e-3, 1.5e-2)]
        spectra = np.concatenate([paints(grid), dark])
        white = colour.XYZ_to_xy(white_point(grid, **light))
        expected = colour.XYZ_to_Lab(np.asarray(xyz(grid, spectra, **light)), white)
        assert_allclose(lab(grid, spectra, **light), expected, atol=1e-10, err_msg=str(light))


@pytest.mark.parametrize(
    "light", [{}, {"illuminant": "A"}, {"illuminant": "FL2", "observer": OBSERVERS[1]}]
)
def test_srgb_is_that_of_colour(light):
    grid = np.arange(380, 781, 10.0)
    spectra = paints(grid)
    values = np.asarray(xyz(grid, spectra, **light))
    white = colour.XYZ_to_xy(white_point(grid, **light))
    expected = colour.XYZ_to_sRGB(values, white, chromatic_adaptation_transform="Bradford")
    unclipped = srgb(grid, spectra, **light, clip=False)
    # colour keeps the matrix rounded to four digits that the standard prints; 2e-3 is half a step
    # of 8 bits.
    assert_allclose(unclipped, expected, atol=2e-3)
    assert_allclose(srgb(grid, spectra, **light), np.clip(unclipped, 0, 1), atol=1e-12)
    assert np.min(unclipped) < 0, (
        "one of the paints should lie outside the gamut, or clipping goes untested"
    )


@pytest.mark.parametrize("call", [xyz, lab, srgb])
def test_batches_transformations_and_slopes(call):
    spectra = jnp.asarray(paints(GRID)).reshape(2, 3, 31)
    whole = call(GRID, spectra)
    assert whole.shape == (2, 3, 3)
    assert_allclose(whole[1, 2], call(GRID, spectra[1, 2]), atol=1e-12)
    on_grid = partial(call, GRID)
    check_mapped(on_grid, spectra, atol=1e-12)
    dull = 0.3 + 0.2 * spectra[0, 0]
    jacobian = jax.jacobian(on_grid)(dull)
    step = 1e-6 * np.cos(np.arange(31))
    difference = (on_grid(dull + step) - on_grid(dull - step)) / 2
    assert_allclose(jacobian @ step, difference, rtol=1e-5, atol=1e-11)


@pytest.mark.parametrize("level", [0.0, 1e-12, (6 / 29) ** 3, 1.0])
@pytest.mark.parametrize("call", [lab, srgb])
def test_slopes_are_finite_at_the_edges(call, level):
    assert finite(jax.jacobian(partial(call, GRID))(jnp.full(31, level)))


def test_dark_slope_of_lightness_is_the_straight_line():
    slope = jax.grad(lambda y: lab(GRID, y * jnp.ones(31))[0])(0.0)
    assert slope == pytest.approx((29 / 3) ** 3)  # CIE's kappa


def test_names_in_short():
    base = colour_weights(GRID, "FL2", OBSERVERS[1])
    for lamp in ("fl2", "F2", "FL2"):
        for observer in (10, "10", "1964", 1964, "cie_10_1964"):
            assert colour_weights(GRID, lamp, observer) is base
    full = "CIE 2015 2 Degree Standard Observer"
    assert find_observer(full.lower()) == full
    assert not base.flags.writeable


@pytest.mark.parametrize(
    ("call", "name", "near"),
    [
        (find_illuminant, "D66", "D65"),
        (find_illuminant, "LED", "LED-B1"),
        (find_observer, "3", "CIE 1931 2 Degree"),
        (find_observer, "1932", "1931"),
    ],
)
def test_unknown_names_list_the_nearest(call, name, near):
    with refusal(f"unknown .*{name}.*nearest are .*{near}"):
        call(name)


@pytest.mark.parametrize("name", ["X", "!"])
def test_a_name_like_none_is_answered_by_some(name):
    with refusal(f"^unknown illuminant '{name}'; some are A, .*D50.{{,20}}$"):
        find_illuminant(name)


def test_every_lamp_and_observer_works():
    grid = np.arange(380, 781, 10)
    for lamp in colour.SDS_ILLUMINANTS:
        for observer in ("2", "CIE 2015 10 Degree Standard Observer"):
            assert white_point(grid, lamp, observer)[1] == pytest.approx(1)


@pytest.mark.parametrize(
    ("grid", "complaint"),
    [
        (np.arange(500, 701, 10), "misses.*of a tristimulus value.*from about 420 to 680 nm"),
        (np.arange(900, 1700, 10), "100% of a tristimulus value"),
        ([400, 550, 700], "too coarse"),
        (np.arange(380, 781, 50), "too coarse"),
        ([550], "of a tristimulus value"),
    ],
)
def test_useless_grids_are_refused(grid, complaint):
    with refusal(complaint):
        colour_weights(grid)


def test_single_precision_without_x64():
    code = """
import numpy as np, jax.numpy as jnp, sys
import glazejax.colour as c
assert not {'colour', 'matplotlib', 'emcee', 'optimistix'} & set(sys.modules)
lab = c.lab(np.arange(400, 701, 10), np.ones(31))
assert lab.dtype == jnp.float32, lab.dtype
assert abs(np.asarray(lab) - [100, 0, 0]).max() < 1e-3, lab
"""
    run_python(code, env={"PYTHONWARNINGS": "error"})


@pytest.mark.slow
def test_numpy_prints_as_before():
    code = """
import numpy as np
import glazejax.colour as c
before = np.get_printoptions()
c.colour_science()
assert np.get_printoptions() == before, np.get_printoptions()
"""
    run_python(code)


def test_far_bands_may_be_as_coarse_as_they_like():
    """What lies in the infrared has no colour, and its steps do not matter."""
    visible = np.arange(380.0, 781.0, 10.0)
    far = np.concatenate([visible, [900.0, 1200.0, 2500.0]])
    weights = colour_weights(far)
    assert_allclose(weights[: visible.size], colour_weights(visible), atol=1e-4)
    assert_allclose(weights[visible.size :], 0.0, atol=1e-4)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: delta_e_2000(np.zeros((3, 2)), np.zeros((3, 2))), r"\(3, 2\).*L\*, a\*, b\*"),
        (lambda: delta_e_2000(3.0, 2.0), "last axis"),
        (lambda: xyz(GRID, np.ones(30)), "31 bands"),
        (lambda: delta_e_2000(np.zeros((4, 3)), np.zeros((5, 3))), r"\(4, 3\) and \(5, 3\)"),
        (lambda: srgb_to_lab([138, 75, 45]), "divide it by 255"),
        *((lambda seen=seen: seen(GRID, np.full(31, 5.0)), "by 100") for seen in (lab, xyz, srgb)),
        (
            lambda: lab(GRID, np.ma.masked_less(np.linspace(0, 1, 31), 0.1)),
            "3 of 31 values are masked",
        ),
    ],
)
def test_what_is_no_colour_is_one_sentence(call, words):
    with refusal(words):
        call()


def test_empty_batches_and_masks_of_nothing_are_colours():
    assert lab(GRID, np.zeros((0, 31))).shape == (0, 3)
    assert srgb_to_lab(np.zeros((0, 3))).shape == (0, 3)
    assert delta_e_2000(np.zeros((0, 3)), np.zeros(3)).shape == (0,)
    assert_array_equal(lab(GRID, np.ma.masked_array(np.full(31, 0.5))), lab(GRID, np.full(31, 0.5)))
    # A bright one is no slip.
    assert lab(GRID, np.full(31, 1.2))[0] > 100


@pytest.mark.parametrize("dtype", [np.float16, jnp.bfloat16])
def test_half_precision_is_computed_in_single(dtype):
    half = jnp.asarray(np.linspace(0.1, 0.9, GRID.size), dtype)
    values = lab(GRID, half)
    assert values.dtype == jnp.float32
    assert_allclose(values, lab(GRID, half.astype(jnp.float32)), atol=1e-4)
    assert_allclose(lab(GRID, np.asarray(half)), values, atol=1e-4)
