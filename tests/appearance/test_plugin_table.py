"""The table behind the plugin, in NumPy alone."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import glazejax as gj
from glazejax.appearance.mitsuba.coats import Axes, on_even_grid, read_coats
from glazejax.appearance.mitsuba.lookup import NUMPY, hermite
from glazejax.appearance.mitsuba.rough import Rough
from glazejax.appearance.mitsuba.smooth import Smooth
from glazejax.appearance.mitsuba.table import at_point, body_table, mean_albedo, reflectance_factor
from glazejax.radiative.rough import rough_ports


def looked_up(body, a, b, points, ground):
    count = a.size
    waves = [np.full(count, w) for w in body.wavelengths]
    given = None if ground is None else [np.full(count, ground)] * body.bands
    return np.stack(
        reflectance_factor(NUMPY, body, at_point(NUMPY, body, points, waves, given), a, b), axis=-1
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    "coats", ["UltramarineBlue:3um, ZincWhite:20um", "BoneBlack:3um, BoneBlack:2mm"]
)
def test_any_thickness_and_any_ground(coats):
    """Below 2 mm of black nothing of the ground is seen."""
    glaze = read_coats(coats)
    body = body_table(Smooth(1.5), glaze, 0, Axes(thickness=(0.0, 20e-6)))
    assert body.error <= body.tolerance == 1e-3
    rng = np.random.default_rng(7)
    a, b = rng.uniform(0.01, 1, (2, 40))
    depth = rng.uniform(0, 20e-6, 40) * rng.uniform(0, 1, 40)
    seen_by = gj.Bidirectional(*np.rad2deg(np.arccos([a, b])))
    points = {"thickness": depth}
    for ground in (0.0, 0.4, 1.0):
        layers = [gj.Layer(glaze.coats[0].medium, depth), glaze.coats[1]]
        found = looked_up(body, a, b, points, ground)
        exact = gj.reflectance(gj.Glaze(layers, ground), seen_by)
        assert_allclose(found, exact, rtol=0, atol=body.error)
        assert_allclose(looked_up(body, b, a, points, ground), found, rtol=1e-12, atol=1e-14)


def test_the_mean_albedo_is_that_of_the_table():
    body = body_table(Smooth(1.5), read_coats("Eosin:2um"), ground=np.full(31, 0.8))
    x, w = np.polynomial.legendre.leggauss(40)
    nodes = 0.5 * (x + 1)
    for cosine in (0.1, 0.8):
        factor = looked_up(body, np.full(40, cosine), nodes, {}, None).mean(axis=1)
        assert mean_albedo(NUMPY, body, cosine, {}) == pytest.approx(
            np.sum(w * nodes * factor), rel=1e-3
        )


def test_hermites_cubics_are_exact_for_cubics():
    t = np.linspace(0, 1, 7)
    (lower, lower_slope), (upper, upper_slope) = hermite(t)
    for coefficients in ([1.0, -2.0, 0.5, 3.0], [0.0, 1.0, 0.0, 0.0]):
        cubic = np.polynomial.Polynomial(coefficients)
        slope = cubic.deriv()
        found = (
            lower * cubic(0) + lower_slope * slope(0) + upper * cubic(1) + upper_slope * slope(1)
        )
        assert_allclose(found, cubic(t), atol=1e-14)


@pytest.mark.slow
def test_a_rough_surfaces_matrix_is_its_ports():
    surface, tolerance = Rough(1.5, 0.5), 1e-3
    albedo, depth = np.array([[0.9, 0.5], [0.99, 0.2]]), np.array([[0.3, 1.0], [5.0, 0.1]])
    cosines = np.array([0.05, 0.4, 0.9])
    stack = {"albedo": albedo, "optical_thickness": depth}
    parts = surface.expand(surface.terms(stack, cosines, tolerance), cosines, tolerance)
    for i, a in enumerate(cosines):
        ports = rough_ports(
            albedo[:, None],
            depth[:, None],
            roughness=0.5,
            cos_incidence=a,
            cos_viewing=cosines,
            tolerance=tolerance,
        )
        assert_allclose(parts.black[:, i], ports.dark, atol=1e-12)
        assert_allclose(parts.through, ports.viewing, atol=1e-12)
        assert_allclose(np.broadcast_to(parts.back[:, None], (2, 3)), ports.back, atol=1e-12)


def test_wavelengths_come_at_even_distances():
    grid = np.array([400.0, 420.0, 430.0, 460.0])
    paint = gj.Pigment("p", grid, [1e4] * 4, [2e5] * 4)
    even = on_even_grid(gj.Glaze([gj.Layer(paint, 1e-6)], np.array([0.1, 0.3, 0.4, 0.7])))
    assert_allclose(even.wavelengths, np.arange(400, 461, 10))
    assert_allclose(even.ground, np.linspace(0.1, 0.7, 7), atol=1e-9)
