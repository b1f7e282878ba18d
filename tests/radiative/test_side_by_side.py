"""Small dense algebra on matrices that lie side by side."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

from glazejax.radiative.common.kernels import quotient
from glazejax.radiative.common.side_by_side import inverse_positive, product, transpose
from tests.tolerances import LAST_DIGITS, ROUNDING


def batch_first(a):
    return np.moveaxis(np.asarray(a), -1, -3)


@pytest.mark.parametrize("n", [1, 2, 3, 4, 7, 20])
def test_inverses_of_every_size(n: int):
    """Sizes that are halved down to one, two and three rows; rows of very different scale too."""
    rng = np.random.default_rng(n)
    a = rng.normal(size=(2, 5, n, n))
    scale = 10.0 ** rng.uniform(-3, 3, (2, 5, n))
    a = (a @ np.swapaxes(a, -1, -2) + np.eye(n)) * scale[..., :, None] * scale[..., None, :]
    found = batch_first(jax.jit(inverse_positive)(jnp.moveaxis(jnp.asarray(a), -3, -1)))
    unit = found * scale[..., :, None] * scale[..., None, :]
    expected = np.linalg.inv(a / scale[..., :, None] / scale[..., None, :])
    assert_allclose(unit, expected, atol=20 * ROUNDING)


@pytest.mark.parametrize(("rows", "terms"), [(2, 3), (2, 30), (7, 3), (7, 30)])
def test_products_by_either_way(rows: int, terms: int):
    rng = np.random.default_rng(0)
    a = rng.normal(size=(3, rows, terms, 5))
    b = rng.normal(size=(terms, 4, 5))
    found = batch_first(jax.jit(product)(jnp.asarray(a), jnp.asarray(b)))
    assert_allclose(found, batch_first(a) @ batch_first(b), atol=20 * ROUNDING)
    turned = batch_first(product(transpose(jnp.asarray(b)), transpose(jnp.asarray(a[0]))))
    assert_allclose(turned, np.swapaxes(found[0], -1, -2), atol=20 * ROUNDING)


def test_a_quotient_has_the_slopes_of_a_division():
    a = jnp.array([0.0, 2.0, -3.0])
    b = jnp.array([4.0, -0.5, 1e3])
    changes = jnp.array([0.3, -2.0, 5.0]), jnp.array([1.0, 0.7, -40.0])
    found = jax.jvp(quotient, (a, b), changes)
    assert_allclose(found, jax.jvp(jnp.divide, (a, b), changes), rtol=LAST_DIGITS)
