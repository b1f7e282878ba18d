import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.core import Tracer
from numpy.testing import assert_allclose, assert_array_equal

from glazejax.radiative.common.phase import (
    check_moments,
    delta_m,
    evaluate,
    henyey_greenstein,
    isotropic,
    tabulated,
    two_term_henyey_greenstein,
)
from tests.tolerances import LAST_DIGITS, ROUNDING

from ..refusals import refusal
from .cases import closed_form

COSINES = np.linspace(-1, 1, 41)


@pytest.mark.parametrize("g", [-0.5, 0.0, 0.3, 0.9])
def test_moments_make_henyey_and_greensteins_function(g):
    assert_allclose(
        evaluate(henyey_greenstein(g), COSINES), closed_form(g, COSINES), rtol=0, atol=1e-8
    )


def test_two_lobes_and_batches():
    g = np.array([0.2, 0.8])
    found = evaluate(two_term_henyey_greenstein(g, -0.4, 0.7)[:, None], COSINES)
    expected = [0.7 * closed_form(a, COSINES) + 0.3 * closed_form(-0.4, COSINES) for a in g]
    assert_allclose(found, expected, atol=1e-8)


def test_table_is_its_own_function():
    """Linear pieces: 1 + x/2 has the moments 1, 1/6; a table of Henyey and Greenstein's comes near
    g^l.
    """
    assert_allclose(tabulated([-1, 0.3, 1], [1.0, 2.3, 3.0], 4), [1, 1 / 6, 0, 0], atol=1e-15)
    x = np.cos(np.linspace(0, np.pi, 2001))
    assert_allclose(tabulated(x, 7 * closed_form(0.6, x), 20), 0.6 ** np.arange(20), atol=1e-5)


def test_isotropic_is_one_everywhere():
    assert_array_equal(evaluate(isotropic(), COSINES), np.ones(41))


def test_delta_m_keeps_absorption_and_what_it_can():
    q, d = jnp.array([0.9]), jnp.array([2.0])
    moments = henyey_greenstein(np.array([0.9]))
    albedo, thickness, kept = delta_m(q, d, moments, 16)
    assert kept.shape == (1, 16)
    assert_allclose((1 - albedo) * thickness, (1 - q) * d, rtol=LAST_DIGITS)
    # What is turned away from its direction, to each order that is kept.
    assert_allclose(
        albedo * thickness * (1 - kept[0]), q * d * (1 - moments[0, :16]), rtol=ROUNDING, atol=1e-15
    )
    assert delta_m(q, d, moments[:, :10], 16)[2].shape == (1, 10)


def test_errors_name_the_value():
    with refusal(r"g holds 1\.2"):
        henyey_greenstein(1.2)
    with refusal(r"share holds 1\.5"):
        two_term_henyey_greenstein(0.5, -0.5, 1.5)
    with refusal("give the number of terms"):
        jax.jit(henyey_greenstein)(0.5)
    with refusal("from 0 to 1"):
        tabulated([0, 1], [1, 1])
    with refusal(r"holds -1\.0"):
        tabulated([-1, 1], [1, -1])
    with refusal(r"holds 1\.5"):
        check_moments([1, 1.5])


def test_known_moments_stay_known_under_jit():
    seen = []

    @jax.jit
    def f(x):
        seen.append((henyey_greenstein(0.5, 8), two_term_henyey_greenstein(0.7, -0.2, 0.9, 8)))
        return x * seen[0][0].sum()

    f(1.0)
    assert not any(isinstance(moments, Tracer) for moments in seen[0])
    # The slope by g is not lost by that.
    slope = jax.jit(jax.grad(lambda g: henyey_greenstein(g, 8)[3]))(0.5)
    assert slope == pytest.approx(3 * 0.5**2)
