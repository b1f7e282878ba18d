"""Phase functions on paints and layers, and what `reflectance` makes of them."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

from glazejax import (
    Bidirectional,
    Glaze,
    Hemispherical,
    Layer,
    Mixture,
    Pigment,
    picture,
    reflectance,
)
from glazejax.radiative.common.phase import henyey_greenstein
from glazejax.radiative.manyflux.reflectance import manyflux_reflectance_factor

from .refusals import refusal

GRID = [500.0, 600.0]
FORWARD = Pigment("forward", GRID, [1e4, 2e4], [2e5, 1e5], phase=henyey_greenstein(0.5, 6))
PLAIN = Pigment("plain", GRID, [1e4, 5e4], [1e5, 3e5])
BACK = Pigment(
    "back", GRID, [1e4, 2e4], [1e5, 0.0], phase=henyey_greenstein(np.array([-0.2, -0.4]), 3)
)


def test_mixtures_weigh_by_scattering():
    mixed = Mixture([FORWARD, BACK, PLAIN], [0.5, 0.3, 0.2])
    phase = np.asarray(mixed.phase)
    s = np.array([[0.5 * 2e5, 0.5 * 1e5], [0.3 * 1e5, 0.0], [0.2 * 1e5, 0.2 * 3e5]])
    mean = (s[0] * 0.5 + s[1] * np.array([-0.2, -0.4])) / s.sum(axis=0)
    assert phase.shape == (2, 6)
    assert_allclose(phase[:, 0], 1.0)
    assert_allclose(phase[:, 1], mean)
    assert Mixture([PLAIN, PLAIN], [0.5, 0.5]).phase is None
    clear = Pigment("clear", GRID, [1.0, 1.0], [0.0, 0.0], phase=henyey_greenstein(0.5, 2))

    def total(weight):
        phase = Mixture([clear, clear], jnp.stack([weight, 1 - weight])).phase
        assert phase is not None
        return jnp.sum(phase)

    assert np.isfinite(jax.grad(total)(0.5))


def test_layers_may_have_their_own():
    own = Layer(FORWARD, 1e-6, phase=henyey_greenstein(0.2, 2))
    assert own.phase is not None
    assert own.phase.shape == (2,)
    glaze = Glaze([own, Layer(BACK, 1e-6), Layer(PLAIN, 1e-6)], 0.5)
    assert glaze.phase is not None
    assert glaze.phase.shape == (2, 3, 3)
    assert_allclose(glaze.phase[1], [[1, 0.2, 0], [1, -0.4, 0.16], [1, 0, 0]], atol=1e-7)
    assert Glaze([Layer(PLAIN, 1e-6)], 0.5).phase is None


def test_resampling_keeps_the_phase():
    assert FORWARD.resample([550.0]).phase is FORWARD.phase
    between = BACK.resample([550.0]).phase
    assert between is not None
    assert_allclose(between, [[1.0, -0.3, 0.1]], atol=1e-7)


def test_reflectance_is_the_many_flux_one():
    """A phase function is followed, in its azimuth too; without one all stays as it was."""
    glaze = Glaze([Layer(FORWARD, 3e-6)], 0.4)
    found = reflectance(glaze, Bidirectional(45.0, 30.0, azimuth=180.0), tolerance=1e-3)
    expected = manyflux_reflectance_factor(
        glaze.albedo,
        glaze.optical_thickness,
        0.4,
        phase=henyey_greenstein(0.5, 6),
        cos_incidence=np.cos(np.pi / 4),
        cos_viewing=np.cos(np.pi / 6),
        azimuth=180.0,
        tolerance=1e-3,
    )
    assert_allclose(found, expected, atol=1e-12)
    isotropic = Glaze([Layer(FORWARD, 3e-6, phase=[1.0])], 0.4)
    plain = Pigment("plain", GRID, FORWARD.absorption, FORWARD.scattering)
    assert_allclose(
        reflectance(isotropic, Hemispherical(), tolerance=1e-4),
        reflectance(Glaze([Layer(plain, 3e-6)], 0.4), Hemispherical(), tolerance=1e-4),
        atol=1e-4,
    )


@pytest.mark.slow
def test_slopes_under_jit():
    """The moments stay known under jit, so that it takes no more directions than outside."""

    def spectrum(thickness):
        return jnp.sum(
            reflectance(Glaze([Layer(FORWARD, thickness)], 0.4), Hemispherical(), tolerance=1e-3)
        )

    outside = (spectrum(3.01e-6) - spectrum(2.99e-6)) / 0.02e-6
    assert float(jax.jit(jax.grad(spectrum))(3e-6)) == pytest.approx(float(outside), rel=1e-4)


def test_a_full_turn_of_azimuth_changes_nothing():
    """Either way round: of the paint's part, and of whether the view is the mirror direction."""
    glaze = Glaze([Layer(BACK, 3e-6)], 0.4)
    geometry = Bidirectional(30.0, 30.0, specular=True, azimuth=[0.0, 360.0, -360.0])
    found = np.asarray(reflectance(glaze, geometry, tolerance=1e-2))
    assert_allclose(found[1:], found[[0, 0]], rtol=1e-12)


def test_errors_name_the_value():
    with refusal("'p': phase begins with 3"):
        Pigment("p", GRID, [1.0, 1.0], [1.0, 1.0], phase=[3.0, 1.0])
    with refusal(r"phase of 'p' has shape \(3, 2\)"):
        Pigment("p", GRID, [1.0, 1.0], [1.0, 1.0], phase=np.ones((3, 2)))
    glaze = Glaze([Layer(FORWARD, 1e-6)], 0.4)
    with refusal("'ordinates' takes isotropic scattering only"):
        reflectance(glaze, Hemispherical(), method="ordinates")
    with refusal("a picture takes paint that scatters isotropically"):
        picture([FORWARD], [np.full((2, 2), 1e-6)], 0.5)
    with refusal("azimuth must be a finite number"):
        Bidirectional(45.0, 30.0, azimuth=np.nan)
    with refusal("refractive_index must be a number"):
        reflectance(Glaze(glaze.coats, 0.4, np.array([1.5, 1.6])), Hemispherical())
