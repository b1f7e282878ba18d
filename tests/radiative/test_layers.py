"""One layer's two-port, and beams that meet one of its eigenvalues, against integrals."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

from glazejax.radiative.common.directions import whole_range
from glazejax.radiative.common.kernels import decay_integral, phi, tanh_sech, two_decays
from glazejax.radiative.common.quadrature import gauss
from glazejax.radiative.ordinates.layers import Beams, two_ports
from glazejax.radiative.ordinates.modes import layer_modes
from glazejax.radiative.ordinates.resolution import resolve_known
from tests.tolerances import LAST_DIGITS, ROUNDING

from ..slow import slow

INDEX, TOLERANCE = 1.5, 1e-6
NODES = gauss(60)
# Both sides of the switch between slow and fast modes, and far from it.
SQUARES = (0.0, 1e-14, 1e-6, 0.01, 0.2, 0.2499999, 0.2500001, 0.3, 0.9, 1.0, 1.2, 2.25, 4.0, 30.0)
STEPS = (0.0, 1e-12, 1e-8, -1e-5, 1e-2)
DEPTHS = (0.0, 1e-6, 0.05, 0.7, 4.0)


def integrals(q, lam, zeta, depth, a, b, mirrored):
    """near and far for the beam a, and twice scattered light of beams a and b: the module's
    integrals, by quadrature.

    The two-port's own mode is Green's function of y'' = lambda y with y = 0 at both faces.
    """
    kappa = jnp.sqrt(lam)

    def sinhc(t) -> jax.Array:
        x = jnp.asarray(kappa * t)
        divisor = jnp.where(x == 0, 1.0, x)
        return jnp.where(x == 0, 1.0, jnp.sinh(x) / divisor)

    def rise(part):
        """The mode that is zero at one face and one at the other."""
        return part * sinhc(part * depth) / sinhc(depth)

    def beam(rate, t):
        return jnp.exp(-rate * (depth - t if mirrored else t))

    part, t, w = NODES[0], depth * NODES[0], depth * NODES[1]
    near = q * zeta * jnp.sum(w * rise(1.0 - part) * beam(a, t))
    far = q * zeta * jnp.sum(w * rise(part) * beam(a, t))
    inner, weights = t[:, None] * NODES[0], w[:, None] * t[:, None] * NODES[1]
    pairs = beam(a, inner) * beam(b, t[:, None]) + beam(b, inner) * beam(a, t[:, None])
    twice = jnp.sum(weights * inner * sinhc(inner) * rise(1.0 - part)[:, None] * pairs)
    once = jnp.sum(w * beam(a, t) * beam(b, t))
    return near, far, q * once + (q * zeta) ** 2 * twice


@pytest.mark.parametrize("mirrored", [slow(False), True])
def test_what_a_beam_excites_is_the_integral(mirrored: bool):
    """Value and slopes of every entry, beams at 1/mu = kappa and next to it included."""
    lam, depth, step, which = (
        x.ravel() for x in np.meshgrid(SQUARES, DEPTHS, STEPS, [0, 1], indexing="ij")
    )
    # One beam at the mode's decay (or the nearest that a beam can have), the other elsewhere.
    resonant = np.maximum(np.sqrt(lam) + step, 1.0)
    a, b = np.where(which == 0, resonant, 1.3), np.where(which == 0, 1.3, resonant)

    def ours(q, lam, depth, a, b):
        one = jnp.ones_like(a)
        beams = Beams(
            jnp.stack([a, b])[:, None], jnp.stack([one, one])[:, None], jnp.ones((2, 1, 1)), one
        )
        ports = two_ports(
            q[None, None],
            lam[None, None, None],
            jnp.full((1, 1, 1), 0.7),
            depth[None, None],
            beams,
            np.array([mirrored]),
        )
        return ports.near[0, 0, 0, 0], ports.far[0, 0, 0, 0], ports.direct[0, 0]

    def theirs(q, lam, depth, a, b):
        return integrals(q, lam, 0.7, depth, a, b, mirrored)

    q = np.full(lam.shape, 0.8)

    def value_and_slopes(function):
        def both(*x):
            return jnp.stack(function(*x)), jnp.stack(
                jax.jacfwd(lambda *y: jnp.stack(function(*y)), (1, 2, 3, 4))(*x)
            )

        return jax.jit(jax.vmap(both))(q, lam, depth, a, b)

    # The quadrature's own slope by lambda does not exist in this form at lambda = 0.
    found, expected = value_and_slopes(ours), value_and_slopes(theirs)
    assert_allclose(found[0], expected[0], rtol=2e-9, atol=1e-13)
    smooth = lam > 1e-8
    assert_allclose(found[1][smooth], expected[1][smooth], rtol=1e-6, atol=2e-8)
    assert np.all(np.isfinite(found[1]))


def test_the_slowest_mode_keeps_its_digits_as_absorption_goes():
    """Its eigenvalue goes with 1 - q; the difference that it is far from there has no digits left.
    Directions that are traced take another way than those that are known.
    """
    directions = whole_range(INDEX, resolve_known(TOLERANCE, INDEX))
    assert directions is not None
    mu, weights = (np.asarray(a) for a in directions[:2])
    absorbed = np.array([0.9, 0.31, 0.299, 0.1, 1e-3, 1e-6, 1e-9, 1e-12, 0.0])
    q = jnp.asarray(1.0 - absorbed)
    traced = jax.jit(lambda mu, weights: layer_modes(q, mu, weights).decay_squared)
    slowest = np.asarray(traced(mu[:, None], weights[:, None]))[0]
    # The dispersion relation of a slow mode, with its sums as they are: 1 - q = q lambda sum ...
    exact = []
    for albedo, lost in zip(np.asarray(q), 1.0 - np.asarray(q), strict=True):
        root = 0.0
        for _ in range(200):
            root = lost / (albedo * np.sum(weights * mu**2 / (1.0 - root * mu**2)))
        exact.append(root)
    assert_allclose(slowest[3:], exact[3:], rtol=2e-12)
    known = np.asarray(layer_modes(q, mu, weights).decay_squared)[0]
    assert_allclose(slowest, known, rtol=1e-11)


def test_kernels_are_their_integrals_on_both_sides_of_every_switch():
    """(1 - e^-x)/x, tanh, sech and two exponentials, with slopes, against Gauss quadrature of what
    they integrate.
    """
    x = np.concatenate([[0.0], np.geomspace(1e-9, 8.0, 60), [0.0999, 0.1001, 0.4999, 0.5001]])
    nodes, weights = NODES
    assert_allclose(phi(jnp.asarray(x)), np.exp(-np.outer(x, nodes)) @ weights, rtol=1e-13)
    slope = jax.vmap(jax.grad(phi))(jnp.asarray(x))
    assert_allclose(slope, np.exp(-np.outer(x, nodes)) @ (-nodes * weights), rtol=ROUNDING)
    assert float(
        jax.grad(lambda a: decay_integral(a, jnp.asarray(2.0)))(jnp.asarray(0.0))
    ) == pytest.approx(-2.0)

    def pair(a, b, depth):
        return two_decays(a, b, depth, jnp.expm1(-a * depth), jnp.expm1(-b * depth))

    a, depth = 1.7, 0.8
    for sign in (1.0, -1.0):
        b = a + sign * np.minimum(x, 1.5) / depth
        t = depth * nodes
        terms = np.exp(-a * (depth - t)) * np.exp(-np.outer(b, t)) * depth * weights
        found = jax.jit(jax.vmap(jax.value_and_grad(pair, (0, 1)), (None, 0, None)))(
            a, jnp.asarray(b), depth
        )
        assert_allclose(found[0], terms.sum(axis=1), rtol=2e-13)
        assert_allclose(found[1][1], terms @ -t, rtol=2e-11)
        assert_allclose(found[1][0], terms @ (t - depth), rtol=2e-11)

    # By lambda: d tanh(kappa D)/kappa = -int (sinh kappa t/kappa)^2 /cosh^2 kappa D, as of y'' =
    # lambda y.
    lam = np.concatenate([np.geomspace(1e-12, 5.0, 40), [0.01999, 0.02001]])
    kappa = np.sqrt(lam)
    tanh, by_lam = jax.vmap(jax.value_and_grad(lambda s: tanh_sech(s, jnp.asarray(1.0))[0]))(
        jnp.asarray(lam)
    )
    assert_allclose(tanh, np.tanh(kappa) / kappa, rtol=LAST_DIGITS)
    squares = (np.sinh(np.outer(kappa, nodes)) / kappa[:, None]) ** 2 @ weights
    assert_allclose(by_lam, -squares / np.cosh(kappa) ** 2, rtol=ROUNDING)
