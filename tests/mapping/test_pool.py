"""Readings pooled with neighbours that noise alone makes different."""

import numpy as np

from glazefit.mapping.solve.features import ALONG, AROUND, REACH, Features, pooled

SD = 0.004


def two_fields():
    """A dark field beside one that is a little lighter, a line of one pixel in it, and noise."""
    rng = np.random.default_rng(0)
    bands = np.linspace(0.0, 1.0, 30)
    truth = np.empty((20, 24, 30), np.float32)
    truth[:, :12] = 0.03 + 0.01 * bands
    truth[:, 12:] = 0.06 - 0.01 * bands
    truth[:, 18] = 0.2 + 0.5 * bands
    noisy = truth + SD * rng.standard_normal(truth.shape).astype(np.float32)
    return truth.reshape(-1, 30), noisy.reshape(-1, 30)


TRUTH, NOISY = two_fields()


def test_noise_is_pooled_away_and_edges_stay_sharp():
    features = Features.of(NOISY)
    sd = np.full_like(NOISY, SD)
    for steps in (AROUND, ALONG):
        shape = (20, 24) if steps is AROUND else (1, 480)
        means, reach = pooled(NOISY, sd, features, shape, steps)
        off = (means - TRUTH).reshape(20, 24, 30)
        assert off.std() < SD / 2.5
        # Beside the edge as elsewhere, and on the thin line, which is like nothing around it.
        assert np.abs(off[:, 11:13].mean(axis=0)).max() < SD
        assert np.abs(off[:, 18].mean(axis=0)).max() < SD
        # What noise is left, and not the field beside, lies within a spectrum's reach.
        apart = np.linalg.norm(features(means) - features(TRUTH), axis=1)
        assert (apart < reach).mean() > 0.98
        between = np.linalg.norm(np.diff(features(TRUTH[[0, 12]]), axis=0))
        assert np.delete(reach.reshape(20, 24), 18, axis=1).max() < between / 2
        assert reach.min() > REACH


def test_a_pixel_that_says_nothing_is_in_no_mean():
    noisy = NOISY.copy()
    noisy[50] = np.nan
    features = Features.of(np.nan_to_num(noisy, nan=0.05))
    means, _ = pooled(noisy, np.full_like(noisy, SD), features, (20, 24), AROUND)
    assert np.isnan(means[50]).all()
    assert np.isfinite(np.delete(means, 50, axis=0)).all()


def test_an_image_may_be_thinner_than_its_neighbourhood():
    features = Features.of(NOISY)
    column, row = (
        pooled(NOISY[:5], np.full((5, 30), SD, np.float32), features, shape, AROUND)[0]
        for shape in ((5, 1), (1, 5))
    )
    np.testing.assert_allclose(column, row, rtol=1e-6)
