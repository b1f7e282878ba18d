"""Paint in the hands of JAX and Equinox: what is compiled anew, what may stand in place of a leaf,
what an optimiser is given.
"""

import io

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import glazejax as gj
from glazejax import Glaze, Layer, Mixture, reflectance

PAINTS = gj.catalogue.load()
BLUE, WHITE = PAINTS["CobaltBlue"], PAINTS["ZincWhite"]
MIXTURE = Mixture([BLUE, WHITE], [0.3, 0.7])
GLAZE = Glaze([Layer(BLUE, 2e-6), Layer(MIXTURE, 1e-5)], 0.6)


@pytest.mark.parametrize("catalogue", ["oils", "acrylics", "pigments"])
def test_one_program_serves_all_paints_of_a_shape(catalogue):
    traced = []

    def depth(glaze):
        traced.append(glaze.wavelengths.size)
        return glaze.optical_thickness

    compiled = eqx.filter_jit(depth)
    paints = gj.catalogue.load(catalogue).values()
    for paint in paints:
        found = compiled(Glaze([Layer(paint, 1e-5)], 0.6))
        assert_allclose(found[:, 0], 1e-5 * (paint.absorption + paint.scattering), rtol=1e-6)
    assert len(traced) == len({paint.absorption.shape for paint in paints})


def test_labels_stay_with_their_paint():
    moved = jax.tree.map(lambda leaf: 2 * leaf, BLUE)
    assert (moved.name, moved.provenance) == (BLUE.name, BLUE.provenance)
    assert_array_equal(moved.identifiable, BLUE.identifiable)
    assert jax.tree.structure(BLUE) == jax.tree.structure(WHITE)
    assert BLUE.name not in repr(jax.tree.structure(BLUE))


@pytest.mark.parametrize(
    "leaf",
    [(), (1, 2), None, True, "word", object(), jax.ShapeDtypeStruct((3,), float)],
    ids=lambda leaf: type(leaf).__name__,
)
def test_whatever_stands_in_place_of_leaves_is_shown(leaf):
    for tree in (GLAZE, *GLAZE.coats, MIXTURE, BLUE):
        assert BLUE.name in repr(jax.tree.map(lambda _: leaf, tree))
    shown = repr(jax.tree.map(lambda _: leaf, GLAZE.coats[0]))
    assert str(getattr(leaf, "shape", leaf)) in shown


def test_parts_and_shapes_of_a_glaze_are_shown():
    dynamic, static = eqx.partition(GLAZE, eqx.is_array)
    assert "None" in repr(static)
    assert "2 um" in repr(dynamic)
    made = eqx.filter_eval_shape(lambda: Glaze([Layer(BLUE, jnp.ones(5))], 0.3))
    assert "(5,)" in repr(made)
    found = eqx.filter_eval_shape(reflectance, GLAZE, gj.Hemispherical())
    assert found.shape == (31,)


@pytest.mark.parametrize("number", [3e-6, np.float64(3e-6), np.array(3e-6)])
def test_a_number_stands_in_place_of_an_array(number):
    moved = eqx.tree_at(lambda glaze: glaze.coats[0].thickness, GLAZE, number)
    made = Glaze([Layer(BLUE, 3e-6), GLAZE.coats[1]], 0.6)
    assert_array_equal(moved.optical_thickness, made.optical_thickness)
    assert_array_equal(reflectance(moved, "d:8"), reflectance(made, "d:8"))
    assert repr(moved) == repr(made)


def test_what_is_computed_once_belongs_to_one_glaze():
    before = reflectance(GLAZE, "d:8")
    thicker = eqx.tree_at(lambda glaze: glaze.coats[0].thickness, GLAZE, jnp.asarray(5e-6))
    assert np.abs(reflectance(thicker, "d:8") - before).max() > 0.01
    assert_array_equal(reflectance(GLAZE, "d:8"), before)


def test_a_glaze_goes_through_a_file():
    file = io.BytesIO()
    eqx.tree_serialise_leaves(file, GLAZE)
    file.seek(0)
    empty = jax.tree.map(lambda leaf: 0 * leaf, GLAZE)
    read = eqx.tree_deserialise_leaves(file, empty)
    for one, other in zip(*map(jax.tree.leaves, (read, GLAZE)), strict=True):
        assert_array_equal(one, other)
    assert repr(read) == repr(GLAZE)


def test_amounts_are_what_is_fitted():
    fitted, fixed = eqx.partition(GLAZE, gj.amounts(GLAZE))
    assert [leaf.shape for leaf in jax.tree.leaves(fitted)] == [(), (2,), ()]
    assert fixed.coats[0].thickness is None
    assert fixed.coats[1].medium.weights is None
    slopes = jax.grad(lambda some: jnp.sum(eqx.combine(some, fixed).optical_thickness))(fitted)
    assert len(jax.tree.leaves(slopes)) == 3


@pytest.mark.parametrize("room", ["radiative", "geometry", "paint", "cie", "io", "plots"])
def test_rooms_are_there(room):
    assert getattr(gj, room).__name__ == f"glazejax.{room}"


@pytest.mark.parametrize("instrument", [gj.Bidirectional(45, 0), "d:8"])
def test_a_batch_of_none_has_gradients_of_none(instrument):
    glaze = eqx.tree_at(lambda it: it.coats[0].thickness, GLAZE, jnp.zeros(0))
    slopes = eqx.filter_grad(lambda it: reflectance(it, instrument).sum())(glaze)
    assert slopes.coats[0].thickness.shape == (0,)
