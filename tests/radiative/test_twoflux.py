import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from glazejax.radiative.twoflux import kubelka_munk_from_radiative, saunderson, two_flux_layer, two_flux_reflectance

amounts = st.floats(0.0, 50.0)


def test_equals_the_hyperbolic_form():
    k, s = np.array([0.3, 2.0, 1e-3]), np.array([1.5, 0.2, 7.0])
    a = 1 + k / s
    b = np.sqrt(a**2 - 1)
    below = a * np.sinh(b * s) + b * np.cosh(b * s)
    reflectance, transmittance = two_flux_layer(k, s)
    np.testing.assert_allclose(reflectance, np.sinh(b * s) / below, rtol=1e-12)
    np.testing.assert_allclose(transmittance, b / below, rtol=1e-12)


def test_limits():
    reflectance, transmittance = two_flux_layer(np.array([0.0, 2.0, 0.0, 1e4]), np.array([3.0, 0.0, 0.0, 0.0]))
    np.testing.assert_allclose(reflectance, [3 / 4, 0, 0, 0], atol=1e-12)
    np.testing.assert_allclose(transmittance, [1 / 4, np.exp(-2), 1, 0], atol=1e-12)
    # An opaque layer: Kubelka and Munk's 1 + K/S - sqrt((K/S)^2 + 2 K/S).
    ratio = 0.2
    assert two_flux_reflectance(200.0, 1000.0, 0.5) == pytest.approx(1 + ratio - np.sqrt(ratio**2 + 2 * ratio))


@given(amounts, amounts, amounts, amounts, st.floats(0, 1))
def test_layers_join(k1, s1, k2, s2, ground):
    """A layer cut in two reflects as the whole: the upper one lies on what the lower one makes of the ground."""
    share = k1 / (k1 + k2) if k1 + k2 > 0 else 0.5
    k, s = k1 + k2, s1 + s2
    lower = two_flux_reflectance((1 - share) * k, (1 - share) * s, ground)
    np.testing.assert_allclose(
        two_flux_reflectance(share * k, share * s, lower), two_flux_reflectance(k, s, ground), atol=1e-10
    )


@given(amounts, amounts)
def test_energy(k, s):
    reflectance, transmittance = two_flux_layer(k, s)
    assert reflectance + transmittance <= 1 + 1e-12
    if k == 0:
        assert reflectance + transmittance == pytest.approx(1)


def test_slopes_at_the_ends():
    slopes = jax.grad(lambda k, s: jnp.sum(two_flux_reflectance(k, s, 0.8)), argnums=(0, 1))(
        jnp.array([0.0, 0.0, 1e5]), jnp.array([0.0, 2.0, 1e5])
    )
    assert np.all(np.isfinite(slopes))
    # A clear thin layer dims the ground by twice its K d.
    assert slopes[0][0] == pytest.approx(-2 * 0.8)


def test_saunderson_keeps_what_a_perfect_white_reflects():
    assert saunderson(1.0, 0.04, 0.6) == pytest.approx(0.96)
    assert saunderson(0.0) == 0.0


def test_conversion():
    k, s = kubelka_munk_from_radiative(2.0, 4.0)
    assert (k, s) == (4.0, 3.0)
