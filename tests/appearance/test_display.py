"""Displays: paper B's monitor, round trips, gamut, tone curves."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from glazejax.appearance.display.display import Display
from glazejax.appearance.display.tone import ToneCurve
from glazejax.colour import colour_science

from ..checks import check_slopes, largest_difference
from ..refusals import refusal

PRINTED = np.array([[4.784, -2.342, -0.694], [-1.481, 2.592, 0.037], [0.045, -0.169, 0.894]])
SRGB = Display.preset("sRGB")
PRIMARIES = [[0.6, 0.35], [0.3, 0.6], [0.15, 0.07]]
GREYS = np.repeat(np.arange(256)[:, None], 3, axis=1)
COLOURS = np.random.default_rng(0).integers(0, 256, (10_000, 3))


def measured():
    """A display measured at few levels, each channel its own curve."""
    levels = np.array([0, 8, 16, 32, 48, 64, 96, 128, 160, 192, 224, 255])
    tones = tuple(
        ToneCurve.from_readings(levels, 0.3 + (levels / 255.0) ** g) for g in (2.1, 2.25, 2.4)
    )
    return Display(
        [[0.64, 0.33], [0.29, 0.61], [0.15, 0.06]], [60.0, 190.0, 20.0], tones, name="measured"
    )


@pytest.fixture(params=["sRGB", "Display P3", "Adobe RGB", "paper B", "measured"])
def display(request):
    special = {"paper B": Display.paper_monitor, "measured": measured}
    return special.get(request.param, lambda: Display.preset(request.param))()


@pytest.mark.parametrize("colours", [GREYS, COLOURS], ids=["greys", "colours"])
def test_round_trip_is_exact(display, colours):
    found = display.to_rgb(display.to_xyz(colours))
    assert_array_equal(found.rgb, colours)
    assert not np.any(found.outside)
    # Nothing is lost in either way of bringing colours in, either.
    for gamut in ("dim", "desaturate"):
        assert_array_equal(display.to_rgb(display.to_xyz(colours), gamut=gamut).rgb, colours)


@pytest.mark.parametrize("dtype", [jnp.float64, jnp.float32])
def test_round_trip_in_jax(display, dtype):
    found = display.to_rgb(display.to_xyz(jnp.asarray(COLOURS, dtype)))
    assert isinstance(found.rgb, jax.Array)
    assert_array_equal(found.rgb, COLOURS)
    assert not np.any(found.outside)


def test_matrix_of_the_papers_monitor():
    """Printed T, to 2 % of its largest number; and eq (3), corrected, to rounding."""
    found = Display.paper_monitor().matrix
    assert largest_difference(found, PRINTED) < 0.02 * np.abs(PRINTED).max()
    x, y = np.array([[0.614, 0.306, 0.149], [0.350, 0.607, 0.074]])
    top = np.array([42.7, 138.7, 27.3])
    corrected = np.diag(255 / top) @ np.linalg.inv(np.array([x / y, [1, 1, 1], (1 - x - y) / y]))
    assert_allclose(found, corrected, rtol=1e-12, atol=1e-12)


def test_srgb_against_colour_science():
    colour = colour_science()
    rng = np.random.default_rng(3)
    xyz = np.asarray(SRGB.to_xyz(rng.uniform(0, 255, (500, 3))))
    space = colour.RGB_COLOURSPACES["sRGB"].copy()
    space.use_derived_transformation_matrices(True)  # those of the standard are rounded
    expected = 255 * colour.XYZ_to_RGB(xyz, space, apply_cctf_encoding=True)
    # Straight lines between levels against the formula.
    assert largest_difference(SRGB.encode(SRGB.linear(xyz)), expected) < 0.01


def test_gamut_is_named(unchecked):
    xyz = np.array([[0.3, 0.3, 0.3], [0.1, 0.4, 0.02], [1.5, 1.6, 1.7]])
    for gamut in ("clip", "dim", "desaturate"):
        found = SRGB.to_rgb(xyz, gamut=gamut)
        assert_array_equal(found.outside, [False, True, True])
        assert np.all((np.asarray(found.rgb) >= 0) & (np.asarray(found.rgb) <= 255))
        assert_array_equal(found.rgb[0], SRGB.to_rgb(xyz[0]).rgb)
    with refusal(r"2 of 3 colours lie outside sRGB, the first with XYZ \[ ?0.1"):
        SRGB.to_rgb(xyz, gamut="error")
    assert not np.any(SRGB.to_rgb(xyz[:1], gamut="error").outside)
    with refusal("gamut is 'squash'"):
        SRGB.to_rgb(xyz, gamut="squash")  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize("xp", [np, jnp], ids=["numpy", "jax"])
def test_a_colour_that_is_no_number_lies_outside(xp):
    xyz = xp.asarray([[np.nan, 0.5, 0.5], [0.3, 0.3, 0.3]])
    every_way = [SRGB.to_rgb(xyz, gamut=gamut) for gamut in ("clip", "dim", "desaturate")]
    for found in (*every_way, SRGB.look_up(xyz)):
        assert_array_equal(found.outside, [True, False])
        assert_array_equal(found.rgb[0], [0, 0, 0])
    with refusal("1 of 2 colours lie outside sRGB"):
        SRGB.to_rgb(xyz, gamut="error")


def test_dimming_keeps_chromaticity_and_desaturating_luminance():
    bright = np.asarray(SRGB.to_xyz(np.array([200.0, 120.0, 40.0]))) * 3
    dimmed = np.asarray(SRGB.to_xyz(SRGB.to_rgb(bright, gamut="dim").rgb))
    assert_allclose(dimmed / dimmed.sum(), bright / bright.sum(), atol=2e-3)
    saturated = np.array([0.1, 0.4, 0.02])
    paled = np.asarray(SRGB.to_xyz(SRGB.to_rgb(saturated, gamut="desaturate").rgb))
    assert paled[1] == pytest.approx(0.4, abs=3e-3)
    assert np.asarray(SRGB.to_xyz(SRGB.to_rgb(saturated).rgb))[1] != pytest.approx(0.4, abs=2e-2)


def test_adaptation_brings_white_to_white():
    lamp = np.array([1.0985, 1.0, 0.3558])
    found = SRGB.to_rgb(SRGB.adapt(lamp * np.array([[1.0], [0.2]]), lamp))
    assert_array_equal(found.rgb[0], [255, 255, 255])
    assert np.ptp(np.asarray(found.rgb[1])) == 0


def test_fine_table_below_14():
    """Paper B, section 2B: what the second table is for."""
    tone = ToneCurve.from_gamma(2.2)
    coarse, fine = tone.tables()
    assert coarse.shape == (256,)
    assert fine.shape == (141,)
    # Read as knots they make a curve again, the same where it has any light.
    curve = ToneCurve.from_tables(coarse, fine)
    light = np.linspace(1, 255, 2001) / 255
    assert_allclose(curve.level(light), tone.level(light), atol=0.15)
    again = Display(PRIMARIES, [1.0, 3.0, 0.5], curve)
    assert_array_equal(again.to_rgb(again.to_xyz(COLOURS)).rgb, COLOURS)


def test_readings_are_met():
    levels = np.array([0, 30, 90, 200, 255])
    readings = 0.4 + 50 * (levels / 255.0) ** 2.3
    tone = ToneCurve.from_readings(levels, readings)
    assert_allclose(tone.light(levels), (readings - readings[0]) / np.ptp(readings), atol=1e-12)
    assert np.all(np.diff(tone.lights) > 0)


def test_display_from_readings_is_the_one_that_was_read():
    display = measured()
    levels = np.arange(0, 256, 15)
    room = np.array([0.3, 0.31, 0.28])
    readings = np.asarray(display.to_xyz(levels[:, None] * np.eye(3)[:, None])) + room
    found = Display.from_readings(levels, readings)
    assert_allclose(found.chromaticities, display.chromaticities, atol=1e-12)
    assert_allclose(found.luminances, display.luminances, rtol=1e-12)
    # Between the readings both interpolate, this one from 18 and the other from 12 levels.
    wanted = np.asarray(display.to_xyz(COLOURS))
    assert_allclose(found.to_xyz(COLOURS), wanted, atol=0.004 * display.white.max())
    with refusal(r"18 levels need readings \(3, 18, 3\)"):
        Display.from_readings(levels, readings[:, 1:])


def test_looking_up_is_as_near_as_levels_allow():
    """By two tables, light below 14 of 255 is met as by interpolation; by one it is not. Above,
    tables are coarse.
    """
    display = Display.paper_monitor()
    wanted = display.to_xyz(np.random.default_rng(5).uniform(5, 60, (2000, 3)))

    def missed(found, xyz):
        return np.abs(255 * np.asarray(display.linear(display.to_xyz(found.rgb) - xyz))).max()

    two, one = (display.look_up(wanted, fine=fine) for fine in (True, False))
    nearest = missed(display.to_rgb(wanted), wanted)
    assert nearest <= missed(two, wanted) < 0.5 * missed(one, wanted)
    for colours in (GREYS, COLOURS):
        # The table's step of 1 in light and the level's: two roundings.
        xyz = display.to_xyz(colours)
        assert missed(display.look_up(xyz), xyz) < 0.5 + 1.2
    colours = np.array([[0.0, 80.0, 0.0], [60.0, 60.0, 60.0], [900.0, 900.0, 900.0]])
    assert_array_equal(display.look_up(colours).outside, [True, False, True])


def test_colours_can_be_differentiated():
    display = measured()
    xyz = display.to_xyz(jnp.array([120.3, 50.6, 200.2]))
    check_slopes(
        lambda v: display.encode(display.linear(v)), (xyz,), eps=1e-6, rtol=1e-5, atol=1e-5
    )


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Display.preset("Trinitron"), "unknown display 'Trinitron': there are sRGB"),
        (lambda: Display([[0.3, 0.3], [0.4, 0.4], [0.5, 0.5]], [1, 1, 1]), "lie on one line"),
        (lambda: Display(PRIMARIES[:2], [1, 1]), r"chromaticities \(3, 2\)"),
        (lambda: Display(PRIMARIES, [1, 0, 1]), "must be positive"),
        (lambda: Display(PRIMARIES, [1, 1, 1], -2.2), "gamma is -2.2"),
        (
            lambda: Display(PRIMARIES, [1, 1, 1], ToneCurve.from_gamma(2.2), levels=1023),
            "ends at level 255, but the display's highest is 1023: give Display levels=255",
        ),
        (
            lambda: ToneCurve(np.array([0.0, 1, 2]), np.array([0.0, 0.5, 0.4])),
            "number 3 is 0.4 after 0.5",
        ),
        (lambda: ToneCurve.from_readings([10, 255], [0.0, 1.0]), "measure levels 0 and 255"),
        (
            lambda: ToneCurve.from_tables(np.arange(256.0), np.linspace(0, 60, 141)),
            "does not meet the coarse one",
        ),
    ],
)
def test_what_is_refused(make, message):
    with refusal(message):
        make()
