"""The solver as it runs without `jax_enable_x64`: the same values and slopes, to the 2e-4 that its rounding allows."""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from glazejax import stack_hemispherical_reflectance, stack_reflectance_factor
from glazejax.radiative.manyflux.reflectance import manyflux_reflectance_factor
from glazejax.radiative.stack import split_reflectance_factor

from .cases import EDGE_ALBEDO, EDGE_COSINE, EDGE_GROUND, EDGE_THICKNESS, random_cases, reference_cases

ROUNDING = 2e-4
slow = pytest.mark.slow


# JAX keeps parts of derivatives by shape, whatever their precision: one process may not mix what it kept.
@pytest.fixture(autouse=True, scope="module")
def _in_single_precision():
    jax.clear_caches()
    with jax.enable_x64(False):
        yield
    jax.clear_caches()


def in_double(f, *arguments):
    """The value of f with its arguments, in double precision, as NumPy arrays."""
    jax.clear_caches()
    with jax.enable_x64(True):
        found = jax.tree.map(np.asarray, f(*arguments))
    jax.clear_caches()
    return found


@pytest.mark.parametrize("index", [1.33, pytest.param(1.0, marks=slow), pytest.param(1.7, marks=slow)])
@pytest.mark.parametrize("method", ["ordinates", pytest.param("auxiliary", marks=slow)])
def test_reference_values(index, method):
    c = reference_cases()[index]
    stack = c.albedo, c.optical_thickness, c.ground
    given = {"refractive_index": index, "cos_incidence": c.cos_incidence, "method": method}
    factor = stack_reflectance_factor(*stack, cos_viewing=c.cos_viewing, **given)
    flux = stack_hemispherical_reflectance(*stack, **given)
    assert factor.dtype == flux.dtype == jnp.float32
    assert np.max(np.abs(factor - c.reflectance_factor)) < ROUNDING
    assert np.max(np.abs(flux - c.hemispherical_reflectance)) < ROUNDING


@pytest.mark.parametrize("given", [{}, pytest.param({"refractive_index": np.linspace(1.2, 1.8, 20)}, marks=slow)])
def test_slopes_are_those_of_double_precision(given):
    q, d, g, ci, cv = random_cases(20)

    def f(q, d, g, ci, cv):
        return stack_reflectance_factor(q, d, g, cos_incidence=ci, cos_viewing=cv, tolerance=1e-5, **given).sum()

    slopes = jax.value_and_grad(f, argnums=(0, 1, 2, 3, 4))
    for found, true in zip(
        jax.tree.leaves(slopes(q, d, g, ci, cv)), jax.tree.leaves(in_double(slopes, q, d, g, ci, cv)), strict=True
    ):
        assert found.dtype == jnp.float32
        assert np.all(np.abs(found - true) < ROUNDING * (10 + np.abs(true)))


@pytest.mark.parametrize("index", [1.5, pytest.param(1.0, marks=slow)])
def test_every_combination_of_edges_is_finite(index):
    edges = list(itertools.product(EDGE_ALBEDO, EDGE_THICKNESS, EDGE_GROUND, EDGE_COSINE, EDGE_COSINE))
    a, t, g, ci, cv = np.array(edges, np.float32).T
    q = np.stack([a, np.full_like(a, 0.6), a], axis=1)
    d = np.stack([t, np.full_like(a, 0.2), t], axis=1)

    def f(q, d, g, ci, cv):
        return stack_reflectance_factor(
            q, d, g, refractive_index=index, cos_incidence=ci, cos_viewing=cv, tolerance=1e-4
        )

    value, pull = jax.vjp(f, q, d, g, ci, cv)
    assert all(np.all(np.isfinite(x)) for x in (value, *pull(jnp.ones_like(value))))
    assert np.all(value >= -ROUNDING)


def test_nothing_is_lost_without_absorption():
    thickness = np.geomspace(1e-3, 1e3, 13, dtype=np.float32)[:, None]
    flux = stack_hemispherical_reflectance(np.ones_like(thickness), thickness, 1.0)
    surface = 0.04  # of the light at normal incidence
    assert np.max(np.abs(flux - (1 - surface))) < ROUNDING


@slow
def test_parts_add_up():
    q, d, g, ci, cv = random_cases(20)
    parts = split_reflectance_factor(q, d, g, cos_incidence=ci, cos_viewing=cv, tolerance=1e-4)
    whole = stack_reflectance_factor(q, d, g, cos_incidence=ci, cos_viewing=cv, tolerance=1e-4)
    assert np.max(np.abs(sum(parts) - whole)) < ROUNDING


@slow
def test_many_fluxes_agree_with_ordinates():
    q, d, g, ci, cv = (array[:6] for array in random_cases(6))
    ours = stack_reflectance_factor(q, d, g, cos_incidence=ci, cos_viewing=cv)
    theirs = manyflux_reflectance_factor(q, d, g, cos_incidence=ci, cos_viewing=cv)
    assert theirs.dtype == jnp.float32
    assert np.max(np.abs(ours - theirs)) < 5 * ROUNDING
