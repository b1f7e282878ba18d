"""method="auxiliary": against shared values, the other method, conservation, edges, and its own
differences.
"""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from glazejax.radiative.common.fresnel import dielectric_reflectance
from tests.tolerances import BETWEEN_METHODS, ROUNDING

from ..checks import check_slopes, finite, largest_difference
from .cases import (
    EDGE_ALBEDO,
    EDGE_COSINE,
    EDGE_GROUND,
    EDGE_THICKNESS,
    factor,
    flux,
    lapack_calls,
    random_cases,
)

pytestmark = pytest.mark.optimised


AUXILIARY: dict = {"method": "auxiliary"}


def test_nothing_is_lost_without_absorption():
    d = np.array([[0.0, 1e-3], [0.1, 5.0], [3.0, 7.9], [1e-9, 2.5]])
    cosines = np.array([1.0, 0.3, 0.7, 0.05])
    body = flux(np.ones_like(d), d, 1.0, cosines, **AUXILIARY, tolerance=1e-4)
    assert largest_difference(body, 1 - dielectric_reflectance(cosines, 1.5)) < ROUNDING


@pytest.mark.parametrize("depth", [1.0, 100.0], ids=["thin", "thick"])
def test_both_precisions_serve_one_process(depth):
    """In turn, where tables of the first lie ready as the second is traced."""
    for double in (True, False, True):
        with jax.enable_x64(double):
            stack = [0.5], [depth], 0.5, 1.0, 1.0
            found = factor(*stack, **AUXILIARY, tolerance=1e-2)
            other = factor(*stack, tolerance=1e-2)
            assert found.dtype == (jnp.float64 if double else jnp.float32)
            assert abs(found - other) < 2e-2


@pytest.mark.slow
def test_edges_are_finite_and_right():
    edges = list(itertools.product(EDGE_ALBEDO, EDGE_THICKNESS, EDGE_GROUND, EDGE_COSINE[1:]))
    edges = np.array(edges)[np.random.default_rng(0).permutation(len(edges))[:80]]
    a, t, g, ci = map(jnp.asarray, edges.T)
    q, d = (
        jnp.stack([a, jnp.full_like(a, 0.6)], axis=1),
        jnp.stack([t, jnp.full_like(a, 0.2)], axis=1),
    )

    def solve(q, d, g, ci):
        return factor(q, d, g, ci, 0.5, **AUXILIARY, tolerance=1e-3)

    value, pull = jax.vjp(solve, q, d, g, ci)
    assert finite((value, pull(jnp.ones_like(value))))
    assert largest_difference(value, factor(q, d, g, ci, 0.5, tolerance=1e-6)) < 1e-3


@pytest.mark.slow
def test_gradient_against_differences_and_the_other_method():
    q, d, g, ci, cv = (a[:6] for a in random_cases(6, seed=2))
    q, g, ci = (jnp.asarray(np.clip(x, 0.1, 0.9)) for x in (q[:, :2], g, ci))
    d = jnp.asarray(d[:, :2])

    def slopes(**options):
        by_all = jax.grad(
            lambda q, d, g, ci: factor(q, d, g, ci, cv, **options).sum(), (0, 1, 2, 3)
        )
        return by_all(q, d, g, ci)

    found = slopes(**AUXILIARY, tolerance=1e-4)
    for one, two in zip(found, slopes(tolerance=1e-8), strict=True):
        assert np.allclose(one, two, atol=BETWEEN_METHODS)
    # Not by the thickness: the mesh's proportions depend on it.
    check_slopes(
        lambda q, g, ci: factor(q, d, g, ci, cv, **AUXILIARY, tolerance=1e-4),
        (q, g, ci),
        modes=("rev",),
        eps=1e-4,
        rtol=0.0,
        atol=1e-5,
    )


@pytest.mark.slow
def test_no_depth_overflows():
    q, d, ground = jnp.array([[0.5], [1.0], [0.0]]), jnp.array([1e300, 1e300, 1e6])[:, None], 0.7

    def f(q, d):
        light, view = [1.0, 1e-4, 1e-12], [1e-4, 1.0, 0.3]
        return factor(q, d, ground, light, view, **AUXILIARY, tolerance=1e-2)

    value, pull = jax.vjp(f, q, d)
    by_albedo, by_thickness = pull(jnp.ones(3))
    assert finite((value, by_albedo))
    assert np.all(by_thickness == 0)
    assert np.allclose(value, f(q, jnp.minimum(d, 1e9)), atol=1e-6)


@pytest.mark.slow
def test_a_beam_that_does_not_enter_is_no_nan():
    # So grazing that the surface reflects all of it, to rounding.
    for index in (1.0000001, 1.5):
        options = {"refractive_index": index, "tolerance": 1e-2}
        assert flux([0.5], [0.7], 0.7, 1e-30, **AUXILIARY, **options) == 0


@pytest.mark.slow
def test_no_lapack_call():
    q, d, g, ci, cv = (jnp.asarray(a) for a in random_cases(40))
    q, d = q[:, :2], d[:, :2]
    slope = jax.grad(lambda q: factor(q, d, g, ci, cv, **AUXILIARY, tolerance=1e-2).sum())
    assert not lapack_calls(slope, q)
