"""Derivatives against high-order finite differences, at interior points and at the ends of every
range.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad

from glazejax import stack_reflectance_factor
from glazejax.radiative.common.fresnel import dielectric_reflectance
from tests.reference import slopes
from tests.tolerances import DTYPE, LAST_DIGITS, ROUNDING, within_reach

from ..checks import check_slopes
from ..slow import slow
from .cases import CENTRAL, FORWARD, LAYERS, factor, flux, from_inside, random_cases

pytestmark = pytest.mark.optimised


def difference(f, arguments, which, step, column=None):
    """Finite difference of every stack at once by one argument (one layer of it)."""
    total = np.zeros(len(arguments[2]))
    for node, weight in zip(*FORWARD, strict=True):
        moved = [np.array(a, dtype=float) for a in arguments]
        target = moved[which] if column is None else moved[which][:, column]
        target += node * np.broadcast_to(step, target.shape)
        total = total + weight * np.asarray(f(*moved))
    return total / step


# Rounding of one reflectance in the difference's sum of nine.
NOISE = 5e-14


def close(found, expected, scale):
    """Relative 1e-6, down to the rounding of the difference itself."""
    return np.all(np.abs(found - expected) <= 1e-6 * np.abs(expected) + scale)


def test_hemispherical_slopes_by_each_thickness_over_a_bright_ground():
    """Against differences: a layer also dims what its ground gets of the light and gives back."""
    thickness = np.array([0.3, 0.1, 0.5])

    def reflected(d):
        return flux([0.9, 0.3, 0.7], d, 0.5, 0.6, tolerance=1e-3)

    # Values at all nodes and slopes come from one program.
    step = 0.03 * thickness
    moved = thickness + CENTRAL[0][:, None, None] * np.diag(step)
    values, pull = jax.vjp(reflected, jnp.asarray([thickness, *moved.reshape(-1, 3)]))
    found = pull(jnp.ones_like(values))[0][0]
    expected = CENTRAL[1] @ np.asarray(values[1:]).reshape(-1, 3) / step
    assert close(found, expected, NOISE / step)


@pytest.mark.single
@pytest.mark.parametrize("tolerance", [1e-8, slow(1e-5)])
def test_stored_slopes(tolerance):
    """What directions for a tolerance, and rounding, leave of them."""
    tolerance = within_reach(tolerance)
    slope = jax.grad(lambda *stack: factor(*stack, tolerance=tolerance).sum(), (0, 1, 2, 3, 4))
    found = slope(*map(jnp.asarray, random_cases(20)))
    assert all(slope.dtype == DTYPE for slope in found)
    rows = np.concatenate([np.asarray(slope).reshape(20, -1) for slope in found], axis=1)
    assert np.all(np.abs(rows - slopes()) < 10 * tolerance * (1 + np.abs(slopes())))


@pytest.mark.slow
@pytest.mark.single
def test_slopes_of_opaque_layers_that_absorb_nothing():
    """By the albedo of all, they add up to that of one layer: no part of the size of the thickness
    cubed cancels.
    """

    def slope(layers):
        def f(q):
            albedo = jnp.broadcast_to(q[:, None], (4, layers))
            return stack_reflectance_factor(
                albedo, thickness / layers, 0.5, cos_incidence=0.7, tolerance=1e-4
            ).sum()

        thickness = np.repeat([[1.0], [10.0], [1e2], [1e3]], layers, axis=1)
        return jax.grad(f)(jnp.ones(4))

    whole = slope(1)
    for layers in (2, 3):
        assert np.allclose(slope(layers), whole, rtol=max(1e-10, 10 * ROUNDING), atol=0)


@pytest.mark.slow
@pytest.mark.parametrize("hemispherical", [False, True])
def test_ends_of_every_range(hemispherical):
    # Every combination of albedo 0, 1, thickness 0, ground 0, 1 in the upper of two layers.
    q1, d1, g = (
        a.ravel() for a in np.meshgrid([0.0, 1.0], [0.0, 0.4, 4.0], [0.0, 1.0], indexing="ij")
    )
    count = len(g)
    pad = np.zeros((count, LAYERS - 2))
    q = np.column_stack([q1, np.full(count, 0.7), pad])
    d = np.column_stack([d1, np.full(count, 0.5), pad])
    # Near zero thickness the reflectance bends within the smallest cosine, so few directions and
    # small steps.
    solve, cosines = (flux, [0.8]) if hemispherical else (factor, [0.8, 0.6])

    def f(q, d, g, n):
        return solve(q, d, g, *cosines, refractive_index=n, tolerance=1e-3)

    arguments = (q, d, g, np.full(count, 1.5))
    # One reverse pass: stacks do not mix.
    found = jax.grad(lambda *a: f(*a).sum(), argnums=(0, 1, 2, 3))(*arguments)
    step = np.where(q1 == 0, 5e-3, -5e-3 / (1 + d1**2))
    assert close(found[0][:, 0], difference(f, arguments, 0, step, 0), NOISE / np.abs(step))
    step = np.where(d1 == 0, 2e-5, 1e-3)
    assert close(found[1][:, 0], difference(f, arguments, 1, step, 0), NOISE / step)
    step = np.where(g == 0, 1e-2, -1e-2)
    assert close(found[2], difference(f, arguments, 2, step), NOISE / 1e-2)
    # Absent layers below: their albedo does not matter, their thickness does.
    assert np.max(np.abs(found[0][:, 2:])) < LAST_DIGITS
    assert close(found[1][:, 3], difference(f, arguments, 1, 2e-5, 3), NOISE / 2e-5)


FIRST_TRACE = 1e-6 if np.float64 == DTYPE else 1e-4
"""Of the slope by the thickness of nothing, which the steepest directions decide."""


@pytest.mark.single
def test_first_trace_of_an_absorbing_layer():
    # dR/dD at D = 0 over a white ground, in closed form: no scattering, R = T T rho e^(-aD)/(1 -
    # rho K(D)) / n^2.
    index, mu = 1.5, 1.0
    critical = np.sqrt(1 - 1 / index**2)

    def reflected(power):
        within = quad(lambda mu: from_inside(mu, index) * mu**power, critical, 1, epsabs=1e-13)[0]
        return within + critical ** (power + 1) / (power + 1)

    k, slope_k = 2 * reflected(1), -4 * reflected(0)
    enter = 1 - dielectric_reflectance(mu, index)
    value = enter**2 / index**2 / (1 - k)
    exact = value * (-2.0 + slope_k / (1 - k))
    found = jax.grad(
        lambda d: stack_reflectance_factor([0.0], d, 1.0, tolerance=within_reach(1e-8))
    )(jnp.zeros(1))
    assert found[0] == pytest.approx(exact, rel=FIRST_TRACE)


@pytest.mark.slow
def test_forward_mode_reverse_mode_and_second_derivatives_agree():
    q, d, g, ci, cv = (a[:4] for a in random_cases(4))

    def reflectances(q):
        return factor(q, d, g, ci, cv, tolerance=1e-8)

    q, slope = jnp.asarray(q), jax.grad(lambda q: reflectances(q).sum())
    direction = jnp.asarray(np.random.default_rng(0).normal(size=q.shape))
    _, forward = jax.jvp(reflectances, (q,), (direction,))
    assert np.allclose(forward, np.sum(slope(q) * direction, axis=1), rtol=ROUNDING)
    check_slopes(slope, (q,), modes=("fwd",), eps=1e-4, rtol=1e-5, atol=1e-6)
