"""Layers by their eigenvectors, the same as by doubling in value and slope, and what both are made
of: inverses, Legendre functions, directions.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.linalg import expm
from scipy.special import factorial, lpmv

from glazejax.radiative.common.linalg import inverse, inverse_symmetric
from glazejax.radiative.common.phase import henyey_greenstein
from glazejax.radiative.manyflux.bordered import Bordered, Diagonal
from glazejax.radiative.manyflux.directions import NodeSpread, spread_directions
from glazejax.radiative.manyflux.doubling import doublings, layer_by_doubling
from glazejax.radiative.manyflux.eigenmodes import layer_by_modes, layer_modes
from glazejax.radiative.manyflux.jacobi import symmetric_eigen
from glazejax.radiative.manyflux.scattering import associated_legendre, rates, scattering
from glazejax.radiative.twoflux import two_flux_layer
from tests.tolerances import LAST_DIGITS, ROUNDING

from .cases import lapack_calls

RULE = spread_directions(1.5, NodeSpread(5, 5, 2.0))
MU = jnp.asarray(RULE.cosines)
# Equal directions of light and eye, one on a node, one at a right angle: where textbook forms
# divide by zero.
LIT, SEEN = jnp.array([0.75, float(MU[2]), 1.0]), jnp.array([0.75, 0.9])
ALBEDO = jnp.array([1.0, 1.0, 1.0, 1 - 1e-6, 0.9, 0.0, 0.5, 1.0])
THICKNESS = jnp.array([0.0, 1e-6, 1.0, 1e4, 1e6, 3.0, 1e-9, 100.0])
COSINE = jnp.array([0.8, -0.5, 0.0, 0.9, 0.7, 0.3, 0.5, 0.8])


@pytest.mark.parametrize("n", [1, 2, 7, 16])
def test_eigenvectors(n):
    a = np.random.default_rng(n).normal(size=(3, n, n))
    values, vectors = symmetric_eigen(jnp.asarray(a + np.swapaxes(a, -1, -2)))
    assert_allclose(values, np.linalg.eigvalsh(a + np.swapaxes(a, -1, -2)), atol=1e-13)
    assert_allclose(
        (vectors * values[:, None, :]) @ np.swapaxes(vectors, -1, -2),
        a + a.swapaxes(-1, -2),
        atol=1e-13,
    )


def test_small_eigenvalues_keep_their_digits():
    """A matrix of very unequal scales, whose eigenvalues are known."""
    scale = 10.0 ** -np.arange(6)
    basis = np.eye(6) + 1e-3 * np.random.default_rng(0).normal(size=(6, 6))
    a = scale[:, None] * (basis @ basis.T) * scale
    values, _ = symmetric_eigen(jnp.asarray(a))
    # The product of all of them, exact in relative terms.
    assert_allclose(np.prod(values / scale[::-1] ** 2), np.linalg.det(basis) ** 2, rtol=ROUNDING)


def operators(albedo, thickness, g, lit, seen):
    tables = [associated_legendre(c, 3, 10) for c in (MU, seen, lit)]
    even, odd = scattering(
        henyey_greenstein(g, 10),
        tables[0],
        tables[1],
        tables[2],
        jnp.sqrt(jnp.asarray(RULE.weights)),
    )
    return *rates(albedo[:, None], even, odd, Diagonal(MU, seen, lit)), thickness[:, None]


def by_doubling(a, b, thickness):
    return layer_by_doubling(a, b, thickness, doublings(1e6, float(np.min(RULE.cosines))))


def value_and_slope(solution):
    """R and U of layers, and their change when everything moves at random."""
    given = ALBEDO, THICKNESS, COSINE, LIT, SEEN
    rng = np.random.default_rng(1)
    moved = tuple(jnp.asarray(rng.normal(size=x.shape)) for x in given)

    def layer(*given):
        return solution(*operators(*given))

    return jax.jit(lambda x, dx: jax.jvp(layer, x, dx))(given, moved)


@pytest.mark.slow
def test_modes_are_doubling():
    """Albedo 0 to 1, thickness 0 to 1e6: values to 1e-10, slopes to 1e-8 of the largest, which is
    1e4.
    """
    parts = (
        jax.tree.leaves(part)
        for solution in (layer_by_modes, by_doubling)
        for part in value_and_slope(solution)
    )
    for value, slope, expected, steep in zip(*parts, strict=True):
        assert_allclose(value, expected, rtol=0, atol=1e-10)
        size = np.maximum(
            1.0, np.max(np.abs(steep), axis=tuple(range(1, steep.ndim)), keepdims=True)
        )
        assert np.max(np.abs(slope - steep) / size) < 1e-8


def test_the_slowest_mode():
    """It does not fade without absorption; else 1 = q artanh(kappa)/kappa for isotropic
    scattering.
    """

    @jax.jit
    def slowest(albedo, g):
        a, b, _ = operators(albedo, albedo, g, LIT[:0], SEEN[:0])
        return layer_modes(a.core, b.core).decay_squared[:, 0, 0]

    free, fading = slowest(jnp.array([1.0, 0.9]), jnp.array([0.8, 0.0]))
    assert free == pytest.approx(0.0, abs=ROUNDING)
    kappa = np.sqrt(fading)
    assert 0.9 * np.arctanh(kappa) / kappa == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("solution", [layer_by_modes, by_doubling])
def test_one_direction_is_kubelka_munk(solution):
    """The two-flux limit: u' = -(K + 2 S) v, v' = -K u."""
    k, s = np.array([0.3, 2.0, 0.0]), np.array([1.5, 0.2, 4.0])
    nothing = jnp.zeros((3, 0))

    def one(x):
        return Bordered(jnp.asarray(x)[:, None, None], nothing, nothing)

    reflection, loss = jax.jit(solution)(one(k + 2 * s), one(k), jnp.ones(3))
    expected = two_flux_layer(k, s)
    assert_allclose(reflection.core[:, 0, 0], expected[0], atol=LAST_DIGITS)
    assert_allclose(1 - loss.core[:, 0, 0], expected[1], atol=LAST_DIGITS)


@pytest.mark.parametrize("solution", [layer_by_modes, by_doubling])
def test_layers_are_the_exponential_of_the_rates(solution):
    """Paper C, equations (12) and (18): light at the bottom is exp(K z) times light at the top."""
    size, thickness = 6, 0.8
    a, b = np.random.default_rng(1).normal(size=(2, size, size)) / size
    a, b = a @ a.T + np.eye(size), b @ b.T + 0.1 * np.eye(size)
    nothing = jnp.zeros((1, 0))
    bordered = (Bordered(jnp.asarray(x)[None], nothing, nothing) for x in (a, b))
    reflection, loss = jax.jit(solution)(*bordered, jnp.array([thickness]))
    # Sums and differences of down- and upward light change by -A and -B.
    halves = np.kron([[0.5, 0.5], [0.5, -0.5]], np.eye(size))
    rates_of_both = -np.block([[np.zeros_like(a), a], [b, np.zeros_like(a)]])
    both = halves @ expm(rates_of_both * thickness) @ np.linalg.inv(halves)
    # No light comes from below: 0 = A21 down + A22 up.
    up = -np.linalg.solve(both[size:, size:], both[size:, :size])
    down = both[:size, :size] + both[:size, size:] @ up
    assert_allclose(reflection.core[0], up, atol=ROUNDING)
    assert_allclose(np.eye(size) - loss.core[0], down, atol=ROUNDING)


@pytest.mark.slow
@pytest.mark.parametrize("solution", [layer_by_modes, by_doubling])
def test_nothing_is_left_that_can_hang(solution):
    def layers(albedo):
        return jnp.sum(solution(*operators(albedo, albedo, albedo, LIT, SEEN))[0].body)

    assert not lapack_calls(jax.grad(layers), ALBEDO)


def test_inverses_and_their_slopes():
    a = np.random.default_rng(0).normal(size=(3, 9, 9))
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
