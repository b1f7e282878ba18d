import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from glazejax.radiative.common.phase import henyey_greenstein
from glazejax.radiative.manyflux.reflectance import manyflux_diffuse_reflectance
from glazejax.radiative.twoflux import (
    TwoFluxSlab,
    kubelka_munk_from_radiative,
    radiative_from_kubelka_munk,
    saunderson,
    slab_from_transfer,
    transfer_from_slab,
    two_flux_field,
    two_flux_join,
    two_flux_layer,
    two_flux_reflectance,
    two_flux_slab,
    two_flux_stack,
    two_flux_surface,
)
from tests.checks import finite
from tests.refusals import refusal
from tests.tolerances import LAST_DIGITS, ROUNDING

amounts = st.floats(0.0, 50.0)


def test_equals_the_hyperbolic_form():
    k, s = np.array([0.3, 2.0, 1e-3]), np.array([1.5, 0.2, 7.0])
    a = 1 + k / s
    b = np.sqrt(a**2 - 1)
    below = a * np.sinh(b * s) + b * np.cosh(b * s)
    reflectance, transmittance = two_flux_layer(k, s)
    assert_allclose(reflectance, np.sinh(b * s) / below, rtol=ROUNDING)
    assert_allclose(transmittance, b / below, rtol=ROUNDING)


def test_limits():
    reflectance, transmittance = two_flux_layer(
        np.array([0.0, 2.0, 0.0, 1e4]), np.array([3.0, 0.0, 0.0, 0.0])
    )
    assert_allclose(reflectance, [3 / 4, 0, 0, 0], atol=ROUNDING)
    assert_allclose(transmittance, [1 / 4, np.exp(-2), 1, 0], atol=ROUNDING)
    # An opaque layer: Kubelka and Munk's 1 + K/S - sqrt((K/S)^2 + 2 K/S).
    ratio = 0.2
    assert two_flux_reflectance(200.0, 1000.0, 0.5) == pytest.approx(
        1 + ratio - np.sqrt(ratio**2 + 2 * ratio)
    )


@given(amounts, amounts, amounts, amounts, st.floats(0, 1))
def test_layers_join(k1, s1, k2, s2, ground):
    """A layer cut in two reflects as the whole: the upper one lies on what the lower one makes of
    the ground.
    """
    share = k1 / (k1 + k2) if k1 + k2 > 0 else 0.5
    k, s = k1 + k2, s1 + s2
    lower = two_flux_reflectance((1 - share) * k, (1 - share) * s, ground)
    assert_allclose(
        two_flux_reflectance(share * k, share * s, lower),
        two_flux_reflectance(k, s, ground),
        atol=1e-10,
    )


@given(amounts, amounts)
def test_energy(k, s):
    reflectance, transmittance = two_flux_layer(k, s)
    assert reflectance + transmittance <= 1 + 1e-12
    if k == 0:
        assert reflectance + transmittance == pytest.approx(1)


@pytest.mark.parametrize("depth", [1e3, 1e7, 1e9, 1e15, 1e17, 1e18])
def test_a_layer_that_absorbs_nothing_on_a_perfect_ground_reflects_all(depth):
    assert two_flux_reflectance(0.0, depth, 1.0) == pytest.approx(1.0)
    assert np.float32(two_flux_reflectance(jnp.float32(0.0), jnp.float32(depth), 1.0)) == (
        pytest.approx(1.0, rel=1e-5)
    )
    assert_allclose(two_flux_field(0.0, depth, 0.5, 1.0), 1.0)
    stack = two_flux_stack(np.zeros(2), np.full(2, depth))
    assert_allclose([stack.above, stack.below], 1.0, rtol=2e-3)
    assert 0.0 <= stack.down < 1e-3


@pytest.mark.parametrize(
    ("function", "values", "words"),
    [
        (two_flux_reflectance, (1.0, 2.0, 84.0), "substrate_reflectance holds 84.0.*not percent"),
        (two_flux_reflectance, (1.0, 2.0, -0.1), "substrate_reflectance holds -0.1"),
        (two_flux_layer, (-1.0, 2.0), "absorption holds -1.0"),
        (two_flux_stack, (np.ones(2), np.array([2.0, np.inf])), "scattering holds inf"),
        (two_flux_field, (1.0, 2.0, 30.0), "share holds 30.0"),
        (two_flux_field, (1.0, 2.0, 0.5, 84.0), "substrate_reflectance holds 84.0"),
        (saunderson, (50.0,), "reflectance holds 50.0; .*not percent"),
        (two_flux_surface, (4.0, 0.6), "outer holds 4.0"),
        (two_flux_surface, (0.04, 60.0), "inner holds 60.0"),
        (kubelka_munk_from_radiative, (1.0, 1.0, 2.0), r"mean_cosine holds 2.0; .*\(-1, 1\)"),
        (radiative_from_kubelka_munk, (-1.0, 1.0), "absorption holds -1.0"),
    ],
)
def test_what_is_out_of_range_is_named(function, values, words):
    with refusal(words):
        function(*values)
    # What is traced can't be refused.
    assert jax.eval_shape(function, *values) is not None


def test_a_ground_may_exceed_one_by_rounding():
    assert two_flux_reflectance(0.0, 2.0, 1.0 + 1e-12) == pytest.approx(1.0)


def test_slopes_at_the_ends():
    slopes = jax.grad(lambda k, s: jnp.sum(two_flux_reflectance(k, s, 0.8)), argnums=(0, 1))(
        jnp.array([0.0, 0.0, 1e5]), jnp.array([0.0, 2.0, 1e5])
    )
    assert finite(slopes)
    # A clear thin layer dims the ground by twice its K d.
    assert slopes[0][0] == pytest.approx(-2 * 0.8)


def test_saunderson_keeps_what_a_perfect_white_reflects():
    assert saunderson(1.0, 0.04, 0.6) == pytest.approx(0.96)
    assert saunderson(0.0) == 0.0


def test_saunderson_is_a_slab_over_the_paint():
    paint = two_flux_slab(0.3, 2.0)
    joined = two_flux_join(two_flux_surface(0.04, 0.6), paint)
    assert_allclose(joined.above, 0.04 + saunderson(paint.above, 0.04, 0.6), rtol=LAST_DIGITS)


def test_stack_is_the_product_of_transfers():
    """Equations (12)-(14) agree with each other: slabs that differ from both sides, in a row."""
    k, s = jnp.array([0.2, 1.0, 0.0]), jnp.array([2.0, 0.1, 3.0])
    surface = two_flux_surface()
    expected = transfer_from_slab(surface)
    for layer in range(3):
        expected = transfer_from_slab(two_flux_slab(k[layer], s[layer])) @ expected
    found = two_flux_join(surface, two_flux_stack(k, s))
    assert_allclose(found, slab_from_transfer(expected), rtol=ROUNDING)


def test_opaque_layers_join():
    found = two_flux_stack(jnp.array([1e4, 1.0]), jnp.array([1e3, 1.0]))
    assert finite(found)
    assert found.down == 0
    assert isinstance(found, TwoFluxSlab)


def test_field_is_the_printed_one():
    """Equation (9), on a black ground; on a white one the two fluxes meet at the ground."""
    k, s = 0.7, 1.9
    a = 1 + k / s
    b = np.sqrt(a * a - 1)
    rest = b * s * (1 - np.array([0.0, 0.3, 1.0]))
    below = a * np.sinh(b * s) + b * np.cosh(b * s)
    down, up = two_flux_field(k, s, np.array([0.0, 0.3, 1.0]))
    assert_allclose(down, (a * np.sinh(rest) + b * np.cosh(rest)) / below, rtol=ROUNDING)
    assert_allclose(up, np.sinh(rest) / below, atol=1e-15)
    down, up = two_flux_field(0.0, s, np.linspace(0, 1, 5), 1.0)
    assert_allclose(down, 1.0, rtol=ROUNDING)
    assert_allclose(up, 1.0, rtol=ROUNDING)


def test_conversion():
    k, s = kubelka_munk_from_radiative(2.0, 4.0)
    assert (k, s) == (4.0, 3.0)
    assert kubelka_munk_from_radiative(2.0, 8.0, 0.5) == (4.0, 3.0)
    assert radiative_from_kubelka_munk(4.0, 3.0, 0.5) == (2.0, 8.0)


def test_conversion_is_as_good_as_it_says():
    """Numbers of its docstring, in per cent: against the many-flux solution, diffuse light,
    scattering forward.
    """
    albedo = np.array([0.99, 0.9, 0.5, 0.99, 0.99])
    s = np.array([200.0, 200.0, 200.0, 3.0, 0.3])  # of s d; times 1 - g = .5
    k = s * (1 - albedo) / albedo
    found = two_flux_reflectance(*kubelka_munk_from_radiative(k, s, 0.5), 0.0)
    expected = manyflux_diffuse_reflectance(
        albedo[:, None],
        (k + s)[:, None],
        0.0,
        phase=henyey_greenstein(0.5),
        refractive_index=1.0,
        streams=8,
    )
    off = 100 * np.abs(np.asarray(found / expected) - 1)
    told = " ".join((kubelka_munk_from_radiative.__doc__ or "").split())
    said = re.search(
        r"error of the reflectance is (\S+) % at an albedo of \.99, (\d+) to (\d+) % below \.9, (\d+) % "
        r"at a thickness of 1\.5/\(s \(1 - g\)\) and (\d+) % at a tenth",
        told,
    )
    assert said
    numbers = [float(number) for number in said.groups()]
    assert np.abs(off - numbers) == pytest.approx(np.zeros(5), abs=0.7)
    assert off[0] == pytest.approx(numbers[0], abs=0.05)
