"""Lambert, Phong and Torrance-Sparrow: paper B's formulas, their limits and slopes."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

from glazejax.appearance import shading
from glazejax.radiative.common.fresnel import conductor_reflectance
from tests.checks import check_slopes, finite

from .scenes import unit


def test_phong_as_printed_and_several_lights():
    body, lamp = np.array([0.2, 0.5]), np.array([2.0, 3.0])
    expected = body * 0.6 * lamp + 0.4 * 0.8**11 * lamp
    assert_allclose(shading.phong(body, lamp, 0.6, 0.8, specular=0.4), expected, rtol=1e-13)
    # Eq (24): lights add.
    two = sum(shading.phong(body, lamp, c, m, specular=0.4) for c, m in ((0.6, 0.8), (0.3, -0.1)))
    assert_allclose(two, expected + body * 0.3 * lamp, rtol=1e-13)
    # Neither the back nor a highlight below the horizon shows.
    assert not np.any(shading.phong(body, lamp, -0.2, 0.9))
    assert not np.any(shading.lambert(body, -0.2, lamp))


def test_torrance_sparrow_as_printed():
    rng = np.random.default_rng(1)
    normal = np.array([0.0, 0.0, 1.0])
    light, view = unit(rng.normal(size=(2, 300, 3)))
    light[:, 2], view[:, 2] = abs(light[:, 2]), abs(view[:, 2])
    half = unit(light + view)
    nl, nv, nh, vh = light @ normal, view @ normal, half @ normal, np.sum(view * half, axis=1)
    width = 0.3
    d = np.exp(-np.log(2) * np.arccos(nh) ** 2 / width**2)
    g = np.minimum(1, np.minimum(2 * nh * nv / vh, 2 * nh * nl / vh))
    fresnel = conductor_reflectance(vh[:, None], np.array([0.3, 1.2]), np.array([3.2, 2.4]))
    body, lamp = np.array([0.1, 0.2]), np.array([1.0, 2.0])
    expected = (body * nl[:, None] + (d * g / nv)[:, None] * fresnel) * lamp
    found = jax.jit(shading.torrance_sparrow)(fresnel, lamp, nl, nv, nh, vh, width=width, body=body)
    assert_allclose(found, expected, rtol=1e-11)
    # At half width D is one half.
    assert shading.facet_distribution(np.cos(width), width) == pytest.approx(0.5, rel=1e-12)


def test_facets_behind_the_surface_show_nothing():
    for light, view in ((-0.1, 0.5), (0.5, -0.1), (0.5, 0.0), (0.0, 0.5)):
        found = jax.jit(shading.torrance_sparrow)(0.9, 1.0, light, view, 0.9, 0.8, width=0.2)
        assert np.all(np.asarray(found) == 0), (light, view)
    assert shading.masking(0.0, 1.0, 1.0, 0.0) == 0.0


def test_squared_angle_is_seamless():
    """The series near the normal, and its slope where arccos has none."""
    u = np.concatenate([[0.0], np.geomspace(1e-12, 1.99, 400)])
    exact = (2 * np.arcsin(np.sqrt(u / 2))) ** 2
    found = jax.jit(shading._squared_angle)(1 - u)
    assert_allclose(found, exact, rtol=1e-9, atol=1e-15)
    assert jax.jit(jax.grad(shading._squared_angle))(1.0) == pytest.approx(-2.0, rel=1e-12)


@pytest.mark.parametrize(
    "angles", [(0.7, 0.6, 0.95, 0.8), (1.0, 1.0, 1.0, 1.0), (0.2, 0.9, 0.8, 0.7)]
)
def test_slopes(angles):
    """Forward and reverse, by spectra, cosines and width, against differences; finite where cosines
    are 1.
    """

    @jax.jit
    def picture(x):
        metal = shading.torrance_sparrow(
            x[:2], x[2:4], x[4], x[5], x[6], x[7], width=x[8], body=x[9:11]
        )
        plastic = shading.phong(x[9:11], x[2:4], x[4], x[7], specular=x[11], exponent=x[12])
        return jnp.sum(metal * jnp.array([1.0, 0.3])) + jnp.sum(plastic * jnp.array([0.2, 0.7]))

    x = jnp.array([0.8, 0.5, 1.0, 2.0, *angles, 0.3, 0.1, 0.2, 0.4, 11.0])
    assert finite(jax.jit(jax.grad(picture))(x))
    if max(angles) < 1.0:
        check_slopes(picture, (x,), eps=1e-6, rtol=1e-5, atol=1e-7)


def test_dark_side_has_finite_slopes():
    @jax.jit
    def dark(x):
        fresnel = jnp.array([0.5])
        shine = shading.torrance_sparrow(fresnel, 1.0, x[0], x[1], 0.5, x[2], width=0.2)
        return jnp.sum(shading.phong(0.5, 1.0, x[0], x[2], exponent=x[3]) + shine)

    slopes = jax.jit(jax.grad(dark))
    for values in ((-0.5, 0.5, -0.5, 11.0), (0.5, -0.5, 0.0, 11.0), (0.0, 0.0, 0.0, 0.5)):
        assert finite(slopes(jnp.array(values)))


def test_float32_stays_float32():
    x = jnp.float32(0.5)
    found = shading.phong(jnp.ones(3, jnp.float32), jnp.float32(1), x, x, specular=x, exponent=x)
    assert found.dtype == jnp.float32
