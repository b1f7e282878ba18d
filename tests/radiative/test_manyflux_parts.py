"""Legendre functions, matrices with weightless directions, and the joining of slabs."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.special import factorial, lpmv

from glazejax.radiative.common.linalg import inverse, inverse_symmetric
from glazejax.radiative.manyflux.bordered import Bordered, Diagonal
from glazejax.radiative.manyflux.directions import fewest_directions
from glazejax.radiative.manyflux.scattering import associated_legendre
from glazejax.radiative.manyflux.star_product import (
    join_all,
    lambert,
    reflection_over,
    slab_of_layer,
    stack_reflection,
)
from tests.tolerances import LAST_DIGITS, ROUNDING

from .test_manyflux_modes import MU, RULE, by_doubling, operators

TINY = 2.0**-60


def random_bordered(seed):
    rng = np.random.default_rng(seed)
    body = 0.2 * rng.normal(size=(7, 6))
    return Bordered(
        jnp.asarray(body),
        jnp.asarray(rng.uniform(0.1, 0.5, 3)),
        jnp.asarray(rng.uniform(0.1, 0.5, 2)),
    )


def whole(a):
    """The same operator as one square matrix over 4 nodes, 3 viewing and 2 incidence of tiny
    weight.
    """
    root = np.sqrt(TINY)
    full = np.diag(np.concatenate([np.zeros(4), a.viewing, a.incidence]))
    full[:4, :4] += a.core
    full[:4, 7:] = root * a.columns
    full[4:7, :4] = root * a.rows
    full[4:7, 7:] = TINY * a.corner
    return full


def test_bordered_matrices_are_the_limit_of_small_weights():
    a, b = random_bordered(0), random_bordered(1)
    pairs = [
        (a @ b, whole(a) @ whole(b)),
        (a + b.scaled(2.0), whole(a) + 2 * whole(b)),
        (a.plus_identity().inverse(), np.linalg.inv(np.eye(9) + whole(a))),
    ]
    scale = np.sqrt(np.concatenate([np.ones(4), np.full(5, TINY)]))
    for found, expected in pairs:
        for rows, columns in (
            (slice(4), slice(4)),
            (slice(4), slice(7, 9)),
            (slice(4, 7), slice(4)),
            (slice(4, 7), slice(7, 9)),
        ):
            size = np.outer(scale, scale)[rows, columns]
            assert_allclose(
                whole(found)[rows, columns] / size, expected[rows, columns] / size, rtol=1e-9
            )


def test_inverses_and_their_slopes():
    rng = np.random.default_rng(0)
    a = rng.normal(size=(3, 9, 9))
    a = jnp.asarray(a @ np.swapaxes(a, -1, -2) + np.eye(9))
    for function in (inverse, inverse_symmetric):
        assert_allclose(jax.jit(function)(a), np.linalg.inv(a), atol=ROUNDING)
    moved = jax.jit(lambda a: jax.jvp(inverse, (a,), (jnp.ones_like(a),))[1])(a)
    expected = (np.linalg.inv(a + 1e-5) - np.linalg.inv(a - 1e-5)) / 2e-5
    assert_allclose(moved, expected, atol=1e-7)


def test_legendre_functions():
    mu = np.array([0.05, 0.5, 1.0])
    found = associated_legendre(jnp.asarray(mu), 6, 12)
    for m in range(6):
        for degree in range(12):
            scale = np.sqrt(factorial(degree - m) / factorial(degree + m)) if degree >= m else 0.0
            assert_allclose(found[m, degree], (-1) ** m * scale * lpmv(m, degree, mu), atol=1e-13)


@pytest.fixture(scope="module")
def layers():
    """Three layers' R and U in three azimuth modes, with one added direction, and the ground below."""
    added = jnp.array([0.7])

    @jax.jit
    def make():
        paints = (
            jnp.array([0.99, 0.5, 1.0]),
            jnp.array([0.3, 1.5, 0.6]),
            jnp.array([0.6, -0.3, 0.1]),
        )
        r, loss = by_doubling(*operators(*paints, added, added))
        roots = jnp.sqrt(MU * jnp.asarray(RULE.weights))
        roots = Diagonal(roots, jnp.sqrt(added), jnp.sqrt(added))
        return r, loss, lambert(jnp.asarray(0.7), roots, 3, MU.dtype)

    return make()


@pytest.mark.slow
def test_slabs_joined_are_the_layers_laid_one_by_one(layers):
    r, loss, ground = layers
    slab = join_all(slab_of_layer(r, loss))
    expected = stack_reflection(r, loss, ground)
    between = (slab.below @ ground).scaled(-1.0).plus_identity().inverse()
    found = slab.above + slab.up @ (ground @ (between @ slab.down))
    for one, other in zip(found, expected, strict=True):
        assert_allclose(one, other, atol=LAST_DIGITS)


def test_reciprocity_of_joined_slabs(layers):
    """Light and eye change places: down is up transposed."""
    r, loss, _ = layers
    slab = jax.jit(lambda r, loss: join_all(slab_of_layer(r, loss)))(r, loss)
    assert_allclose(slab.up.core, np.swapaxes(slab.down.core, -1, -2), atol=LAST_DIGITS)
    assert_allclose(slab.up.rows, np.swapaxes(slab.down.columns, -1, -2), atol=LAST_DIGITS)


def test_laying_over_black_is_the_layer(layers):
    r, loss, ground = layers
    first, lost = (jax.tree.map(lambda leaf: leaf[0], operator) for operator in (r, loss))
    found = reflection_over(slab_of_layer(first, lost), ground.scaled(0.0))
    assert_allclose(found.body, first.body, atol=1e-15)


def test_more_moments_and_tighter_tolerances_need_more_directions():
    def count(tolerance, terms):
        return sum(fewest_directions(tolerance, 1.5, tuple(0.6 ** np.arange(terms)))[:2])

    assert count(1e-3, 1) < count(1e-6, 1) < count(1e-6, 16)
