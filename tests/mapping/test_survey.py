"""Representatives near all spectra."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from glazefit.mapping.solve.features import Features, choose_representatives, spread_out
from glazefit.mapping.solve.image import Image, working_bands
from glazefit.mapping.solve.survey import survey
from glazefit.mapping.store.atomic_files import KeyedResults
from glazejax.progress import no_progress
from tests.mapping import small


def distances(points, chosen):
    """Of each point from those that are chosen."""
    return np.linalg.norm(points[:, None] - points[chosen], axis=-1)


@given(st.integers(2, 100), st.integers(0, 2**31))
def test_points_are_spread_out_to_a_reach(count, seed):
    points = np.random.default_rng(seed).standard_normal((count, 3))
    chosen = spread_out(points, count, 0.5)
    assert distances(points, chosen).min(axis=1).max() <= 0.5 + 1e-12
    # All that are chosen are farther from each other than the reach.
    between = distances(points, chosen)[chosen] + 10.0 * np.eye(len(chosen))
    assert between.min() > 0.5
    assert len(spread_out(points, 2, 1e-6)) == 2
    # Each within its own reach: noise makes no representative.
    noisy = np.where(np.arange(count) < count // 2, 100.0, 0.5)
    chosen = spread_out(points, count, noisy)
    apart = distances(points, chosen).min(axis=1)
    assert (apart <= noisy + 1e-12).all()
    assert (chosen[1:] >= count // 2).all()


def test_representatives_stand_in_the_middle_of_what_they_stand_for():
    rng = np.random.default_rng(2)
    kinds = 0.2 + 0.6 * rng.random((4, 12))
    spectra = (kinds[rng.integers(0, 4, 4000)] + 0.001 * rng.standard_normal((4000, 12))).astype(
        "f4"
    )
    readings, _ = choose_representatives(Features.of(spectra), spectra, 4, 0.1)
    assert len(readings) == 4
    apart = np.abs(readings[:, None] - kinds).max(axis=-1).min(axis=1)
    assert (apart < 2e-4).all()


def test_features_of_alike_spectra_differ_little():
    rng = np.random.default_rng(3)
    spectra = 0.05 + 0.9 * rng.random((300, 20))
    features = Features.of(spectra)
    # One number more or less everywhere, of three per cent and of what is near black, is a
    # difference of some units.
    brighter = features(spectra * 1.03) - features(spectra)
    assert 1.0 < np.median(np.linalg.norm(brighter, axis=1)) < np.sqrt(20)


def test_light_counts_once_where_the_level_of_a_spectrum_says_little():
    spectra = 0.2 + 0.6 * np.random.default_rng(4).random((300, 20))
    features = Features.of(spectra, brightness=False)
    brighter = features(spectra * 1.03) - features(spectra)
    assert np.median(np.linalg.norm(brighter, axis=1)) < 1.1
    # The shape counts in each band as before.
    shape = np.where(np.arange(20) % 2, 1.03, 1 / 1.03)
    bent = features(spectra * shape) - features(spectra)
    assert np.median(np.linalg.norm(bent, axis=1)) > 2.0


def test_noise_is_that_of_the_bands_that_a_map_uses(tmp_path):
    rng = np.random.default_rng(0)
    grid = np.arange(400.0, 1001.0, 10.0)
    smooth = 0.3 + 0.2 * np.sin(grid / 100.0) + 0.1 * rng.random((30, 30, 1))
    clean = (smooth + 0.005 * rng.standard_normal(smooth.shape)).astype("f4")
    noisy = clean.copy()
    noisy[..., grid > 900.0] += 0.1 * rng.standard_normal((30, 30, 10)).astype("f4")
    # As where a white is not above the dark.
    empty = clean.copy()
    empty[..., -1] = np.nan
    noise = []
    for number, spectra in enumerate((clean, noisy, empty)):
        image = Image(small.image(spectra, grid), working_bands(grid, small.paints()), None, None)
        work = KeyedResults(tmp_path / f"{number}")
        noise.append(survey(work, image, 50, True, no_progress).noise)
    assert noise[1] == noise[2] == noise[0]
    assert 0.004 < noise[0].sd(np.array(0.3)) < 0.006
