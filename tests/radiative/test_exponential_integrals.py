"""Exponential integrals and the interface's integrals against scipy and adaptive quadrature, values
and slopes.
"""

import functools
import itertools
import warnings

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import special
from scipy.integrate import quad

from glazejax.radiative.common.exponential_integrals import (
    cone_nodes,
    expn,
    internal_reflection_integral,
)
from glazejax.radiative.common.fresnel import dielectric_reflectance
from tests.tolerances import LAST_DIGITS

from ..checks import largest_difference
from .cases import CENTRAL

POINTS = np.r_[np.geomspace(1e-12, 700, 400), 1.0, np.nextafter(1.0, 0), np.nextafter(1.0, 2)]


@pytest.mark.parametrize("order", [1, 2, 3, 4, 8])
def test_values_and_slopes(order):
    value, slope = jax.vmap(jax.value_and_grad(lambda x: expn(order, x)))(jnp.asarray(POINTS))
    assert largest_difference(value / special.expn(order, POINTS), 1) < LAST_DIGITS
    below = np.exp(-POINTS) / POINTS if order == 1 else special.expn(order - 1, POINTS)
    assert largest_difference(-slope / below, 1) < LAST_DIGITS
    single = expn(order, jnp.asarray(POINTS, jnp.float32))
    assert single.dtype == jnp.float32
    shown = POINTS < 80  # e^-x is still a normal number in float32
    assert (
        largest_difference(np.asarray(single)[shown] / special.expn(order, POINTS[shown]), 1) < 2e-5
    )


def test_at_zero_and_far_out():
    assert expn(1, 0.0) == np.inf
    assert [float(expn(n, 0.0)) for n in (2, 3, 5)] == [1.0, 0.5, 0.25]
    assert float(jax.grad(lambda x: expn(3, x))(0.0)) == -1.0
    assert float(jax.grad(lambda x: jnp.where(x > 0, expn(1, x), 0.0))(0.0)) == 0.0
    assert float(jax.grad(lambda x: expn(2, x))(0.0)) < -600
    assert expn(1, jnp.array([800.0, 1e6, 1e300, np.inf])).tolist() == [0, 0, 0, 0]


def reference(power, x, index):
    """The same integral, adaptively, by the outside cosine."""
    critical = np.sqrt((index - 1) * (index + 1)) / index

    def cone(outside):
        mu = np.sqrt((index - 1) * (index + 1) + outside**2) / index
        return (
            dielectric_reflectance(outside, index)
            * mu ** (power - 2)
            * np.exp(-x / mu)
            * outside
            / index**2
        )

    edges = [0.0, *(critical * s for s in (1e-1, 1, 3, 10, 100) if critical * s < 1), 1.0]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # quad at its rounding level
        inside = sum(
            quad(cone, a, b, epsabs=1e-15, epsrel=1e-13)[0] for a, b in itertools.pairwise(edges)
        )
    return inside + critical**power * special.expn(power + 1, x / critical)


@pytest.mark.parametrize("power", [0, 1, 2, 3])
def test_internal_reflection(power):
    traced = jax.jit(functools.partial(internal_reflection_integral, power))
    x = np.array([1e-9, 1e-4, 0.03, 0.6, 4.0, 30.0])
    for index in (1.0000001, 1.0003, 1.05, 1.33, 1.5, 2.5):
        expected = np.array([reference(power, v, index) for v in x])
        scale = 1.0 + np.abs(expected)
        known = internal_reflection_integral(power, x, index)
        for found in (known, traced(x, jnp.asarray(index))):
            assert np.max(np.abs(found - expected) / scale) < LAST_DIGITS, index
    assert np.all(internal_reflection_integral(power, x, 1.0) == 0)
    assert np.all(internal_reflection_integral(power, np.r_[0, x], jnp.ones(7)) == 0)


def test_internal_reflection_slopes():
    @jax.jit
    def f(x, n):
        return internal_reflection_integral(1, x, n)

    for x, n in ((0.3, 1.5), (0.05, 1.02), (2.0, 2.2)):
        slopes = jax.grad(f, (0, 1))(jnp.asarray(x), jnp.asarray(n))
        h = 1e-3
        nodes, weights = CENTRAL
        by_x = weights @ np.array(f(x + h * nodes, n)) / h
        by_n = weights @ np.array(f(jnp.full(8, x), jnp.asarray(n + h * nodes))) / h
        assert slopes[0] == pytest.approx(by_x, abs=1e-10)
        assert slopes[1] == pytest.approx(by_n, abs=1e-7)


def test_cone_weights():
    # int dmu over the cone: 1 - mu_c.
    for n in (1.5, jnp.array([1.2, 1.5, 2.0])):
        _, weights, _ = cone_nodes(n)
        assert np.allclose(
            np.sum(weights, -1), 1 - np.sqrt(1 - 1 / np.asarray(n) ** 2), rtol=LAST_DIGITS
        )
