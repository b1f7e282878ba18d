"""Interpolation in thicknesses: error as asked, derivatives, few points, and errors that help."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from glazejax.chebyshev_table import Axis, thickness_table


def paint(points: np.ndarray) -> np.ndarray:
    """Two channels that behave as reflectances do: a logarithm at zero, saturation where opaque."""
    x = points[:, 0] * 1e6
    y = points[:, -1] * 1e6
    thin = np.where(x > 0, x * np.log(np.maximum(x, 1e-300)), 0.0)
    return np.stack([np.exp(-0.7 * x) / (1 + y), 0.3 + 0.05 * thin * np.exp(-x) - 0.2 * np.exp(-3 * y)], axis=1)


@pytest.mark.parametrize("axes", [1, 2, 3])
@pytest.mark.parametrize("tolerance", [1e-3, 1e-5])
def test_error_is_as_asked_and_points_are_few(axes: int, tolerance: float):
    low, high = np.zeros(axes), np.array([40e-6, 5e-6, 30e-6])[:axes]
    table = thickness_table(paint, low, high, tolerance)
    assert table.error <= tolerance
    points = np.random.default_rng(1).uniform(low, high, (5000, axes))
    np.testing.assert_allclose(table(jnp.asarray(points)), paint(points), rtol=0, atol=tolerance)
    assert table.evaluations < {1: 600, 2: 3000, 3: 20000}[axes]


def test_check_points_come_from_the_samples_and_distance_counts():
    """A kink where no sample lies does not matter; a distance that ignores a channel does not refine for it."""

    def kinked(points: np.ndarray) -> np.ndarray:
        return np.stack([np.exp(-points[:, 0]), 0 * points[:, 0] + (points[:, 0] > 2.9)], axis=1)

    samples = np.linspace(0, 2, 50)[:, None]
    table = thickness_table(
        kinked, np.zeros(1), np.array([3.0]), 1e-6, distance=lambda a, b: np.abs(a - b)[:, 0], samples=samples
    )
    assert table.error <= 1e-6
    assert table.coefficients.shape[0] < 129


def test_what_cannot_be_reached_is_said():
    table = thickness_table(lambda p: (p > 0.37).astype(float), np.zeros(1), np.ones(1), 1e-6)
    assert table.error > 1e-6
    assert "error" in repr(table)


def test_derivatives_by_thickness():
    table = thickness_table(paint, np.zeros(2), np.array([20e-6, 10e-6]), 1e-7)

    def total(point):
        return table(point)[0]

    at = jnp.array([3e-6, 2e-6])
    x, y = 3.0, 2.0
    exact = 1e6 * np.exp(-0.7 * x) * np.array([-0.7 / (1 + y), -1 / (1 + y) ** 2])
    np.testing.assert_allclose(jax.grad(total)(at), exact, rtol=1e-3)
    assert np.all(np.isfinite(jax.jacobian(table)(jnp.zeros(2))))


def test_coordinates_and_back():
    x = np.linspace(1e-6, 3e-5, 7)
    for curvature in (0.0, 10.0, 1e4):
        axis = Axis(1e-6, 3e-5, curvature)
        u = axis.coordinate(x, np)
        assert u[0] == pytest.approx(-1)
        assert u[-1] == pytest.approx(1)
        np.testing.assert_allclose(axis.point(u), x, rtol=1e-9)


@pytest.mark.parametrize(
    ("low", "high", "words"),
    [
        ([0.0] * 4, [1.0] * 4, "1 to 3 axes"),
        ([1.0], [1.0], "range 1 to 1"),
        ([-1.0], [1.0], "range -1 to 1"),
        ([0.0], [np.nan], "range 0 to nan"),
    ],
)
def test_what_is_wrong_is_named(low: list, high: list, words: str):
    with pytest.raises(ValueError, match=words):
        thickness_table(paint, np.array(low), np.array(high), 1e-3)
    table = thickness_table(paint, np.zeros(1), np.ones(1) * 1e-5, 1e-2)
    with pytest.raises(ValueError, match="do not end in"):
        table(jnp.zeros((3, 2)))
