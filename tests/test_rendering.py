"""Rendering against glazes built one by one, and the ladder's two comparisons against their
definitions.
"""

from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from glazejax import Bidirectional, Glaze, Hemispherical, Layer, Mixture, Pigment, reflectance
from glazejax.colour import lab
from glazejax.commands.rendering import render
from glazejax.radiative.common.fresnel import dielectric_reflectance

W = np.arange(400.0, 701.0, 20.0)
TOLERANCE = 1e-6
COATS = 4
"""Of all ladders, so that they are one program."""


def hump(centre, width, height):
    return height * np.exp(-0.5 * ((W - centre) / width) ** 2)


RED = Pigment("Red", W, hump(520, 40, 2e5) + 500, np.full(W.size, 3e3))
BLUE = Pigment("Blue", W, hump(600, 60, 1.5e5) + 500, np.full(W.size, 1e4))
GREEN = Mixture([RED, BLUE], [0.25, 0.75])
GROUND = np.linspace(0.6, 0.9, W.size)
GEOMETRY = Bidirectional(45.0, 0.0)
STACK = Glaze([Layer(RED, 1e-6), Layer(GREEN, 3e-6)], GROUND)


@pytest.fixture(scope="module")
def result():
    return render(STACK, GEOMETRY, layer=0, coat=1e-6, coats=COATS)


def ladder_of(paint, thickness, ground):
    glaze = Glaze([Layer(paint, thickness)], ground)
    return render(glaze, GEOMETRY, layer=0, coat=thickness, coats=COATS).ladder


def alone(layers, ground: Any = GROUND):
    return np.asarray(reflectance(Glaze(layers, ground), GEOMETRY))


def test_stack_ground_and_single_layers(result):
    assert_allclose(result.glaze, alone(STACK.coats), atol=TOLERANCE)
    assert_allclose(result.ground, alone([]), atol=TOLERANCE)
    for i, layer in enumerate(STACK.coats):
        assert_allclose(result.alone[i], alone([layer]), atol=TOLERANCE)


def test_ladder_is_a_stack_of_equal_layers(result):
    assert result.ladder.counts.tolist() == list(range(COATS + 1))
    for n in (0, 1, 3):
        stack = [Layer(RED, 1e-6)] * n + [Layer(GREEN, 3e-6)]
        assert_allclose(result.ladder.glaze[n], alone(stack), atol=TOLERANCE)


def test_ladder_of_a_lower_layer_and_another_coat():
    ladder = render(STACK, GEOMETRY, layer=1, coat=2e-6, coats=COATS).ladder
    stack = [Layer(RED, 1e-6), Layer(GREEN, 2e-6), Layer(GREEN, 2e-6)]
    assert_allclose(ladder.glaze[2], alone(stack), atol=TOLERANCE)


def test_multiply_is_the_power_law_of_one_coat_on_the_ground(result):
    below, ratio = alone([Layer(GREEN, 3e-6)]), alone([Layer(RED, 1e-6)]) / alone([])
    for n in (0, 1, 2, COATS):
        assert_allclose(result.ladder.multiply[n], below * ratio**n, atol=1e-5)


def test_multiply_never_brightens():
    white = Pigment("White", W, np.full(W.size, 10.0), np.full(W.size, 2e5))
    ladder = ladder_of(white, 5e-6, 0.05)
    assert np.all(np.diff(ladder.glaze, axis=0) > 0)
    assert_allclose(ladder.multiply - ladder.glaze[0], 0, atol=1e-9)


def test_multiply_leaves_the_surface_reflection_alone():
    glossy, matt = (
        render(STACK, Hemispherical(8.0, specular), layer=0, coat=1e-6, coats=COATS).ladder
        for specular in (True, False)
    )
    surface = float(dielectric_reflectance(np.cos(np.deg2rad(8.0)), 1.5))
    assert_allclose(glossy.multiply, matt.multiply + surface, atol=1e-5)
    # The ratio that looks nearest depends a little on the gloss.
    assert_allclose(glossy.mixing, matt.mixing + surface, atol=5e-3)


def test_mixing_is_opaque_paint_of_mixed_coefficients():
    """Rebuilt from its definition: opaque white found by Newton-free search, mixed, and solved as a
    thick film.
    """
    coat = 1e-6
    ratio = 0.0
    ladder = ladder_of(RED, coat, 0.8)

    def opaque(k, s):
        return alone([Layer(Pigment("opaque", W, k, s), 5e-3)], ground=1.0)

    # The white whose opaque film looks like the ground: k/s by bisection.
    low, high = 1e-8, 1.0
    target = ladder.glaze[0][0]
    for _ in range(40):
        ratio = np.sqrt(low * high)
        low, high = (
            (ratio, high) if opaque(1e7 * ratio + 0 * W, 1e7 + 0 * W)[0] > target else (low, ratio)
        )
    k, s = np.asarray(RED.absorption) * coat, np.asarray(RED.scattering) * coat

    def mixed(n, amount):
        scale = 1e7 / amount
        return opaque((n * k + amount * ratio) * scale, (n * s + amount) * scale)

    amounts = np.geomspace(1e-2, 1e3, 40)
    seen = np.asarray(lab(W, jnp.asarray(np.stack([mixed(1, a) for a in amounts]))))
    first = np.asarray(lab(W, ladder.glaze[1]))
    best = amounts[np.linalg.norm(seen - first, axis=-1).argmin()]
    for n in (1, 4):
        apart = lab(W, mixed(n, best)) - lab(W, ladder.mixing[n])
        assert np.linalg.norm(apart) < 2.5  # The search above has steps of a third.
    assert_array_equal(ladder.mixing[0], ladder.glaze[0])
    finer = np.linalg.norm(np.asarray(lab(W, ladder.mixing[1])) - first)
    assert finer <= np.linalg.norm(seen - first, axis=-1).min() + 0.05


@pytest.mark.parametrize("ground", [0.0, 1.0])
@pytest.mark.parametrize("thickness", [0.0, 1e-9, 0.01])
def test_edges_stay_finite(ground, thickness):
    clear = Pigment("Clear", W, np.zeros(W.size), np.zeros(W.size))
    for paint in (RED, clear):
        ladder = ladder_of(paint, thickness, ground)
        assert ladder.capped == (thickness == 0.01)
        for way in (ladder.glaze, ladder.multiply, ladder.mixing):
            assert np.all(np.isfinite(way))
            assert np.all(way >= 0)


def test_absent_paint_changes_nothing():
    ladder = ladder_of(RED, 0.0, 0.7)
    for way in (ladder.glaze, ladder.multiply, ladder.mixing):
        assert_allclose(way - ladder.glaze[0], 0, atol=2e-5)
