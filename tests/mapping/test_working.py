"""Working bands, noise of their means, and which pixels say anything."""

import os

import numpy as np
import pytest
from numpy.testing import assert_allclose

from glazefit import Noise
from glazefit.film.noise import spectra_noise
from glazefit.mapping.solve.image import classify, working_bands
from glazefit.mapping.solve.task import map_task
from glazefit.mapping.store.layout import Status
from glazejax.io import CubeSource
from tests.mapping import small

from ..refusals import refusal

FINE = np.linspace(380.0, 760.0, 191)


def test_bands_are_means_of_what_the_paints_cover():
    image = small.at_bands(FINE, small.paints())
    bands = image.bands
    assert (bands.wavelengths >= 400).all()
    assert (bands.wavelengths <= 700).all()
    assert image.count.sum() == np.sum((FINE >= 400) & (FINE <= 700))
    assert np.median(np.diff(bands.wavelengths)) == pytest.approx(10.0, abs=0.1)
    # A mean of what is linear is what it is at the mean wavelength.
    assert_allclose(image.means((0.001 * FINE)[None])[0], 0.001 * bands.wavelengths, rtol=1e-6)


@pytest.mark.skipif(os.name == "nt", reason="an open file cannot be replaced there")
@pytest.mark.parametrize(
    ("replaced", "levels", "wanted"),
    [("cube.npy", (0.3, 0.6), (0.3, 0.6)), ("white.npy", (0.5, 1.0), (0.6, 0.3))],
)
def test_a_file_that_was_replaced_is_opened_again(here, replaced, levels, wanted):
    flat = np.ones((2, 3, FINE.size))
    np.save("cube.npy", 0.3 * flat)
    np.save("white.npy", flat)
    means = []
    for written, level in enumerate(levels):
        np.save("other.npy", level * flat)
        os.utime("other.npy", (written, written))
        os.replace("other.npy", replaced)
        source = CubeSource(here / "cube.npy", wavelengths=tuple(FINE), white="white.npy")
        task = map_task(source, small.paints(), opaque=True)
        means.append(task.image.cube().to_numpy().mean())
    assert_allclose(means, wanted, rtol=1e-6)


def test_paints_that_do_not_cover_the_image_are_named():
    with refusal(r"the image has 900.* from 400 to 700 nm: 0 bands lie there"):
        working_bands(np.linspace(900.0, 1700.0, 100), small.paints())


def test_noise_of_means_is_what_it_is():
    rng = np.random.default_rng(1)
    flat = 0.4 + 0.004 * rng.standard_normal((1000, FINE.size))
    told = spectra_noise(FINE, flat)
    assert float(told.sd(np.asarray(0.4))) == pytest.approx(0.004, rel=0.1)
    image = small.at_bands(FINE, small.paints(), told)
    seen = image.means(flat).std(axis=0)
    # What averaging does not take away is added.
    rest = np.sqrt(
        image.noise_sd(np.full(image.count.shape, 0.4)) ** 2 - Noise().sd(np.asarray(0.4)) ** 2
    )
    assert_allclose(seen, rest, rtol=0.15)


@pytest.mark.parametrize(("floor", "share"), [(0.001, 0.002), (0.003, 0.0), (0.0005, 0.01)])
def test_noise_of_many_spectra_is_told_from_some_of_them(floor, share):
    """More differences than are looked at: 400 spectra of some 180 windows."""
    rng = np.random.default_rng(2)
    height = rng.uniform(0.1, 0.9, (400, 1))
    smooth = height * (0.5 + 0.5 * np.sin(FINE / 90.0 + 6.0 * height))
    spectra = smooth + rng.standard_normal(smooth.shape) * (floor + share * smooth)
    told = spectra_noise(FINE, spectra)
    for level in (0.1, 0.8):
        # A step of the search is a tenth.
        assert float(told.sd(np.asarray(level))) == pytest.approx(floor + share * level, rel=0.12)


def test_a_spectrum_below_black_leaves_the_noise_of_all_others(recwarn):
    rng = np.random.default_rng(0)
    smooth = 0.3 + 0.2 * np.sin(FINE / 80.0)
    spectra = smooth * (1.0 + 0.02 * rng.standard_normal((600, FINE.size)))
    without = spectra_noise(FINE, spectra)
    spectra[0] -= 0.35
    told = spectra_noise(FINE, spectra)
    for level in (0.15, 0.5):
        sd = np.asarray(level)
        assert float(told.sd(sd)) == pytest.approx(float(without.sd(sd)), rel=0.05)
    assert not len(recwarn)


def test_pixels_that_say_nothing_are_marked():
    image = small.at_bands(FINE, small.paints(), saturated=0.98)
    good = 0.3 + 0.1 * np.sin(FINE / 50.0)
    pixels = np.tile(good, (9, 1))
    pixels[1, 60] = np.nan
    pixels[2, 60] = np.inf
    pixels[3] = 0.25
    pixels[4] = 1e-5 * np.arange(FINE.size) / FINE.size
    pixels[5, 60:70] = -0.5
    pixels[6] *= 5.0
    pixels[7, 60] = 0.99
    readings = image.means(pixels)
    use = np.ones(9, bool)
    use[8] = False
    status = classify(readings, image.noise_sd(readings), use)
    wanted = [
        Status.MAPPED,
        Status.NO_DATA,
        Status.SATURATED,
        Status.NO_DATA,
        Status.DARK,
        Status.NEGATIVE,
    ]
    wanted += [Status.SATURATED, Status.SATURATED, Status.MASKED]
    assert status.tolist() == wanted
    # Without a detector's end five times too bright is only that.
    sd = np.full((1, image.count.size), 1e-3)
    unlimited = small.at_bands(FINE, small.paints())
    assert classify(unlimited.means(pixels[6:7]), sd).tolist() == [Status.TOO_BRIGHT]
    # Noise about zero is no negative reading.
    assert classify(readings[:1] - readings[:1].min() - 0.005, sd)[0] == Status.MAPPED
