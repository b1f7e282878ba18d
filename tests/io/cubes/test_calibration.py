"""Reflectance from raw readings: against the formula on whole arrays, and where there is nothing to
divide by.
"""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from glazejax.io import open_cube, write_table

from ...refusals import refusal
from .images import BANDS, IMAGE, LINES, SAMPLES, WAVELENGTHS, binned, bright_image, envi

pytestmark = pytest.mark.usefixtures("here")


@pytest.fixture
def scene():
    """Readings of 16 bits of the usual image by a camera with a dark signal and an uneven light."""
    rng = np.random.default_rng(1)
    dark = rng.integers(80, 120, (LINES, SAMPLES, BANDS))
    white = dark + rng.integers(20_000, 40_000, (1, SAMPLES, BANDS))
    raw = np.round(dark + IMAGE * (white - dark)).astype(int)
    return raw, white, dark


def counts(values, name="path", **further):
    """Counts as they are."""
    return envi(values, name=name, **{"reflectance scale factor": 1} | further)


def readings(*scene) -> dict:
    """Counts of a cube and its references, as arguments of `open_cube`."""
    names = ("path", "white", "dark")
    return {name: counts(values, name) for name, values in zip(names, scene, strict=True)}


def test_references_of_the_cubes_size(scene):
    raw, white, dark = scene
    cube = open_cube(**readings(*scene), white_reflectance=0.98)
    expected = (raw - dark) / (white - dark) * 0.98
    assert_allclose(cube, expected, rtol=2e-6)
    assert_allclose(cube, IMAGE * 0.98, atol=4e-5)
    part = cube.isel(y=slice(3, 19, 5), x=slice(4, 9))
    assert_allclose(part, expected[3:19:5, 4:9], rtol=2e-6)


def test_frames_of_a_line_camera_are_averaged_over_their_lines(scene):
    raw, white, dark = scene
    cube = open_cube(
        counts(raw, interleave="bil"),
        white=counts(white[:9], "white", interleave="bip", dtype="i4"),
        dark=counts(np.tile(dark, (8, 1, 1)), "dark", dtype="f4"),
        window=(2, 20, 5, 25),
        binning=(2, 2, 2),
        bands=(400, 470),
    )
    zero, one = dark.mean(0), white[:9].mean(0)
    expected = binned(((raw - zero) / (one - zero))[2:20, 5:25], (2, 2, 2))
    assert_allclose(cube, expected, rtol=1e-5)
    notes = str(cube.attrs["notes"])
    assert "the white reference is the mean of its 9 lines" in notes
    assert f"the dark reference is the mean of its {8 * LINES} lines" in notes


def test_one_spectrum_as_text_npy_or_a_pixel(scene):
    raw, white, dark = scene
    path = counts(raw)
    one, zero = white[0, 0].astype(float), dark[0, 0].astype(float)
    Path("white.txt").write_text("# counts\n" + "\n".join(map(str, one)))
    np.save("dark.npy", zero)
    expected = (raw - zero) / (one - zero)
    for reference in ("white.txt", counts(one[None, None], "pixel")):
        cube = open_cube(path, white=reference, dark="dark.npy")
        assert_allclose(cube, expected, rtol=2e-6)
    # A header of the same name is of another file.
    counts(white, "white")
    assert_allclose(open_cube(path, white="white.txt"), raw / one, rtol=2e-6)


def test_the_whites_own_spectrum(scene):
    raw, white, dark = scene
    own = np.linspace(0.9, 0.99, 12)
    grid = np.linspace(390, 510, 12)
    write_table(
        "own.csv",
        ["name", *(f"{w:.12g}" for w in grid)],
        [["tile", *own], ["other", *own / 2]],
    )
    paths = readings(*scene)
    cube = open_cube(**paths, white_reflectance="own.csv:tile")
    expected = (raw - dark) / (white - dark) * np.interp(WAVELENGTHS, grid, own)
    assert_allclose(cube, expected, rtol=3e-6)
    with refusal("holds 2 spectra: choose one"):
        open_cube(**paths, white_reflectance="own.csv")
    write_table("short.csv", ["name", "450", "460"], [["tile", 0.9, 0.9]])
    with refusal("white's own reflectance: cannot resample"):
        open_cube(**paths, white_reflectance="short.csv")


def test_no_light_gives_nan_and_saturation_gives_infinity(scene):
    raw, white, dark = scene
    white[:, 3, 2] = dark[:, 3, 2]
    white[:, 4, 2] = dark[:, 4, 2] - 1
    white[:, 5, 2] = 65535
    raw[6, 7, 1] = 65535
    raw[0, 0] = 50
    paths = readings(*scene)
    cube = open_cube(**paths)
    values = cube.values
    assert np.isnan(values[:, 3:6, 2]).all()
    assert np.isposinf(values[6, 7, 1])
    assert (values[0, 0, :2] < 0).all()
    assert np.isfinite(np.delete(values, [3, 4, 5, 7], axis=1)).all()
    assert cube.attrs["saturated"] == np.inf
    # A bin that holds a saturated reading is saturated, one that holds a missing reading is the
    # mean of the others.
    coarse = open_cube(**paths, binning=(2, 2, 1)).values
    assert np.isposinf(coarse[3, 3, 1])
    assert_allclose(coarse[2, 3, 2], values[4:6, 6:8, 2].mean(), rtol=1e-5)
    assert_allclose(coarse[1, 1, 2], values[2:4, 2, 2].mean(), rtol=1e-5)


def test_saturated_readings_in_bins_without_calibration():
    path = bright_image()
    assert open_cube(path).values[5, 6, 2] >= open_cube(path).attrs["saturated"]
    coarse = open_cube(path, binning=(2, 2, 1))
    assert coarse.attrs["saturated"] == np.inf
    assert np.isposinf(coarse.values[2, 3, 2])
    assert np.isposinf(coarse.values).sum() == 1


@pytest.mark.parametrize(
    ("stated", "correction"),
    [
        (np.array(WAVELENGTHS) + 3, {"wavelengths": WAVELENGTHS}),
        (np.array(WAVELENGTHS) / 1000, {"unit": "um"}),
        (None, {"wavelengths": WAVELENGTHS}),
        (WAVELENGTHS, {"unit": "nm"}),
    ],
)
def test_references_state_what_is_corrected_of_the_cube(scene, stated, correction):
    raw, white, _ = scene
    fields = {"wavelengths": stated, "wavelength units": "Nanometers"}
    path = counts(raw, **fields)
    # A reference may be right where the cube is not.
    for reference in (counts(white, "white", **fields), counts(white, "right")):
        cube = open_cube(path, white=reference, **correction)
        assert_allclose(cube["wavelength"], WAVELENGTHS)
        assert_allclose(cube, raw / white, rtol=2e-6)
    other = counts(white, "other", wavelengths=np.array(WAVELENGTHS) - 3)
    with refusal("other wavelengths than the cube"):
        open_cube(path, white=other, **correction)


@pytest.mark.parametrize(
    ("size", "complaint"),
    [
        ((4, SAMPLES - 1, BANDS), "give a frame of the same width"),
        ((4, SAMPLES, BANDS - 1), "6 bands; the cube has 7"),
        ((BANDS - 1,), "6 readings; the cube has 7 bands"),
    ],
)
def test_references_of_another_size(size, complaint):
    path = counts(IMAGE * 10_000)
    np.save("white.npy", np.full(size, 20_000, "u2"))
    with refusal(rf"white\.npy.*{complaint}"):
        open_cube(path, white="white.npy")


def test_references_of_one_column():
    np.save("white.npy", np.full((LINES, 1, BANDS), 20_000, "u2"))
    cube = open_cube(counts(IMAGE * 10_000), white="white.npy")
    assert_allclose(cube, IMAGE / 2, rtol=1e-5)


WHITE = {"white": "white.npy"}


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        ({"dark": "white.npy"}, "a dark reference alone"),
        *(
            (
                {"white_reflectance": value},
                "reflectance alone calibrates nothing; give a white reference too",
            )
            for value in (0.98, "tile.csv")
        ),
        *(
            (WHITE | stated, "not both")
            for stated in ({"scale": 3}, {"unit": "percent"}, {"unit": "nm fraction"})
        ),
        *(
            (WHITE | {"white_reflectance": value}, "the white's own reflectance is")
            for value in (0, -1, 99, np.nan)
        ),
    ],
)
def test_calibrations_that_mean_nothing(options, complaint):
    np.save("white.npy", np.full(BANDS, 20_000.0))
    with refusal(complaint):
        open_cube(counts(IMAGE * 10_000), **options)
