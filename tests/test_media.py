import copy
import pickle

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from glazejax import Bidirectional
from glazejax.paint.media import Glaze, Layer, Mixture, Pigment

from .checks import finite
from .refusals import refusal

GRID = np.array([400.0, 500.0, 600.0])
RED = Pigment("red", GRID, [9e4, 6e4, 1e3], [1e4, 2e4, 9e4])
BLUE = Pigment("blue", GRID, [2e3, 4e4, 8e4], [5e4, 1e4, 0.0])


@pytest.mark.parametrize(
    ("absorption", "scattering", "complaint"),
    [
        ([1, 2], [1, 2, 3], r"absorption of 'x' has shape \(2,\)"),
        ([1, 2, 3], 1.0, "scattering of 'x' has shape"),
        ([1, -2, 3], [1, 2, 3], "absorption of 'x' must be finite and at least 0, not -2"),
        ([1, 2, 3], [1, np.nan, 3], "scattering of 'x' must be finite and at least 0, not nan"),
        ([1, 2, 3], [1, np.inf, 3], "not inf"),
        ([1, 2, 3j], [1, 2, 3], "real numbers"),
    ],
)
def test_wrong_coefficients_are_named(absorption, scattering, complaint):
    with refusal(complaint):
        Pigment("x", GRID, absorption, scattering)


@pytest.mark.parametrize("identifiable", [[1, 0, 1], [True]])
def test_identifiable_must_be_booleans_one_a_band(identifiable):
    with refusal("3 booleans"):
        Pigment("x", GRID, GRID, GRID, identifiable=identifiable)


def test_pigment_resampled_with_everything_it_carries():
    pigment = Pigment(
        "x",
        GRID,
        [1.0, 3.0, 5.0],
        [2.0, 2.0, 8.0],
        identifiable=[True, True, False],
        absorption_sd=[0.1, 0.2, 0.4],
        provenance="a jar",
    )
    fine = pigment.resample([400, 450, 500, 575])
    assert_allclose(fine.absorption, [1, 2, 3, 4.5])
    assert_allclose(fine.scattering, [2, 2, 2, 6.5])
    assert_allclose(np.asarray(fine.absorption_sd), [0.1, 0.15, 0.2, 0.35])
    assert fine.scattering_sd is None
    assert np.asarray(fine.identifiable).tolist() == [True, True, True, False]
    assert fine.provenance == "a jar"
    with refusal("without guessing"):
        pigment.resample([380, 400])


@given(
    st.lists(st.booleans(), min_size=2, max_size=7),
    st.lists(
        st.floats(0.0, 1.0) | st.sampled_from([0.0, 0.5, 1.0]), min_size=1, max_size=9, unique=True
    ),
)
def test_new_bands_are_identifiable_where_all_they_come_from_is(known, places):
    old = 400.0 + 10.0 * np.arange(len(known))
    new = np.unique(old[0] + np.array(places) * (old[-1] - old[0]))
    one = np.ones(old.size)
    found = Pigment("x", old, one, one, identifiable=np.array(known)).resample(new).identifiable
    assert found is not None
    for at, is_known in zip(new, found, strict=True):
        # On an old band that band alone counts, between two both.
        sources = [known[i] for i, w in enumerate(old) if w == at] or [
            known[i] for i, w in enumerate(old) if abs(w - at) < 10.0
        ]
        assert is_known == all(sources)
    assert Pigment("x", old, one, one).resample(new).identifiable is None


@given(st.floats(0.0, 1.0))
def test_mixture_is_linear(weight):
    mixture = Mixture([RED, BLUE], [weight, 1 - weight])
    for law in ("absorption", "scattering"):
        red, blue = (np.asarray(getattr(paint, law)) for paint in (RED, BLUE))
        expected = weight * red + (1 - weight) * blue
        assert_allclose(getattr(mixture, law), expected, rtol=1e-14, atol=1e-300)


def test_mixture_of_a_picture():
    weights = np.random.default_rng(1).dirichlet([1, 1], size=(4, 5))
    mixture = Mixture([RED, BLUE], weights)
    assert mixture.absorption.shape == (4, 5, 3)
    one = Mixture([RED, BLUE], weights[2, 3])
    assert_allclose(mixture.absorption[2, 3], one.absorption)


@pytest.mark.parametrize(
    ("weights", "complaint"),
    [
        ([0.5, 0.4], "sum to 0.9: divide them by their sum"),
        ([30, 70], "sum to 100: divide"),
        ([0, 0], "at least one must be positive"),
        ([1.5, -0.5], "weights must be finite and at least 0, not -0.5"),
        ([1.0], r"shape \(1,\) do not end in one for each of 2"),
    ],
)
def test_wrong_weights(weights, complaint):
    with refusal(complaint):
        Mixture([RED, BLUE], weights)


def test_weights_may_miss_one_by_rounding():
    assert Mixture([RED] * 3, [0.3333333] * 3).name == "red + red + red"
    with refusal("sum to"):
        Mixture([RED] * 3, [0.333333, 0.333333, 0.333332])


def test_empty_mixture():
    with refusal("at least one pigment"):
        Mixture([], [])


def test_grids_must_agree():
    other = Pigment("green", [400, 600], [1, 2], [3, 4])
    for build in (
        lambda: Mixture([RED, other], [0.5, 0.5]),
        lambda: Glaze([Layer(RED, 1e-5), Layer(other, 1e-5)], 0.5),
    ):
        with refusal(r"'red' has 400-600 nm step 100.*'green' has .*\.resample"):
            build()


@pytest.mark.parametrize(
    ("thickness", "complaint"),
    [(-1e-6, "not -1e-06"), (np.nan, "not nan"), (20.0, "in metres"), ([1e-5, -1.0], "not -1")],
)
def test_wrong_thickness(thickness, complaint):
    with refusal(f"thickness of 'red'.*{complaint}"):
        Layer(RED, thickness)


@pytest.mark.parametrize(
    ("ground", "index", "complaint"),
    [
        (83.5, 1.5, "percent"),
        (-0.1, 1.5, r"ground must be in \[0, 1\], not -0.1"),
        ([0.5, 0.6], 1.5, "the 3 bands of the coats"),
        (0.5, 0.9, r"refractive_index must be in \[1, 2.5\], not 0.9"),
        (0.5, np.nan, "not nan"),
        (0.5, [1.5, 1.6], "refractive_index has shape"),
    ],
)
def test_wrong_glaze(ground, index, complaint):
    with refusal(complaint):
        Glaze([Layer(RED, 1e-5)], ground, index)


@pytest.mark.parametrize(
    ("build", "complaint"),
    [
        (lambda: Layer("red", 1e-5), r"Pigment or a Mixture, not 'red'.*catalogue\.load"),  # pyright: ignore
        (lambda: Layer(RED, "10um"), "thickness of 'red' must be real numbers, not '10um'"),
        (lambda: Layer(RED, [[1e-5], [1e-5, 1e-5]]), "thickness of 'red' .* rows differ in length"),
        (lambda: Glaze(Layer(RED, 1e-5), 0.5), r"must be a list, top first: write \[layer\]"),  # pyright: ignore
        (lambda: Glaze([RED], 0.5), r"must each be a Layer, not a Pigment: write Layer\(paint"),  # pyright: ignore
        (lambda: Glaze([Layer(RED, 1e-5)], "white"), "ground must be real numbers, not 'white'"),
        (lambda: Mixture(["red", "blue"], [0.5, 0.5]), "a mixture is of Pigments, not of 'red'"),  # pyright: ignore
    ],
)
def test_what_is_no_paint_or_number_is_said_in_words(unchecked, build, complaint):
    with refusal(complaint):
        build()


def test_albedo_and_optical_thickness_by_hand():
    glaze = Glaze([Layer(RED, 2e-5), Layer(BLUE, 0.0)], 0.8)
    assert_allclose(glaze.albedo, [[0.1, 5 / 5.2], [0.25, 0.2], [9 / 9.1, 0]], rtol=1e-14)
    assert_allclose(glaze.optical_thickness, [[2.0, 0], [1.6, 0], [1.82, 0]], rtol=1e-14)


def test_batches_broadcast():
    weights = np.full((5, 2), 0.5)
    glaze = Glaze(
        [Layer(RED, np.full((4, 1), 1e-5)), Layer(Mixture([RED, BLUE], weights), 2e-5)], 0.5
    )
    assert glaze.optical_thickness.shape == (4, 5, 3, 2)
    assert glaze.albedo.shape == (5, 3, 2)


def test_bare_ground_has_no_layers():
    assert Glaze([], np.full(3, 0.5)).albedo.shape == (3, 0)
    assert Glaze([], 0.5).optical_thickness.shape == (1, 0)
    with refusal("no wavelengths of its own"):
        _ = Glaze([], 0.5).wavelengths


def test_clear_medium_has_finite_albedo_and_gradient():
    def total(k, s):
        glaze = Glaze([Layer(Pigment("clear", GRID, k, s), 1e-5)], 0.5)
        return glaze.albedo.sum() + glaze.optical_thickness.sum()

    for size in (0.0, 1e-300, 1e-30, 1e-11):
        both = jax.value_and_grad(total, argnums=(0, 1))
        assert finite(both(jnp.full(3, size), jnp.full(3, size)))
    assert total(jnp.zeros(3), jnp.zeros(3)) == 0


@given(st.floats(1e-3, 1e6), st.floats(0.0, 1e6))
def test_albedo_gradient_is_the_quotient_rule(k, s):
    def albedo(k, s):
        return Glaze([Layer(Pigment("p", [550.0], k[None], s[None]), 0.0)], 0.5).albedo[0, 0]

    slopes = jax.grad(albedo, argnums=(0, 1))(jnp.asarray(k), jnp.asarray(s))
    # The second is a difference of terms of size 1 / (k + s).
    expected = np.array([-s, k]) / (k + s) ** 2
    assert_allclose(slopes, expected, rtol=1e-12, atol=1e-15 / (k + s))


def test_objects_pass_through_transformations():
    glaze = Glaze([Layer(Mixture([RED, BLUE], [0.4, 0.6]), 1e-5)], 0.5, jnp.asarray(1.4))

    def depths(g):
        return g.optical_thickness

    plain = depths(glaze)
    assert_allclose(jax.jit(depths)(glaze), plain)
    assert_allclose(eqx.filter_jit(depths)(glaze), plain)
    batch = jax.tree.map(lambda leaf: jnp.stack([leaf, 2 * leaf]), glaze)
    both = jax.vmap(depths)(batch)
    assert_allclose(both[1], 2 * 2 * 2 * plain)  # weights, coefficients and thickness doubled
    slope = jax.grad(lambda g: depths(g).sum())(glaze)
    assert_allclose(slope.coats[0].thickness, plain.sum() / 1e-5)
    # Unflattening must not look at values: transformations put placeholders there.
    leaves, tree = jax.tree.flatten(glaze)
    assert jax.tree.leaves(jax.tree.unflatten(tree, [object()] * len(leaves)))


def test_traced_values_are_not_checked_but_shapes_are():
    def thick(d):
        return Glaze([Layer(RED, d)], 0.5).optical_thickness.sum()

    assert finite(jax.jit(thick)(-1.0))
    assert finite(jax.jit(lambda w: Mixture([RED, BLUE], [w, w]).absorption.sum())(3.0))
    with refusal("shape"):
        jax.jit(lambda k: Pigment("x", GRID, k, k).absorption)(jnp.zeros(2))


def test_plain_index_stays_a_constant():
    # What is not an array is static under equinox, which is the solver's fast path.
    for index, kind in ((1, float), (np.float32(1.5), float), (jnp.asarray(1.5), jax.Array)):
        assert isinstance(Glaze([], 0.5, index).refractive_index, kind)


def test_integers_become_floats():
    assert jnp.issubdtype(Layer(RED, 0).thickness.dtype, jnp.floating)
    assert jnp.issubdtype(Pigment("x", GRID, [1, 2, 3], [1, 2, 3]).absorption.dtype, jnp.floating)


def test_representations_are_short():
    assert repr(RED) == "Pigment('red', 400-600 nm step 100 (3 bands))"
    glaze = Glaze([Layer(RED, 2e-5)], 0.8)
    assert repr(glaze) == "Glaze([Layer('red', 20 um)], ground 0.8, n = 1.5)"
    single = Glaze([Layer(RED, np.float32(2e-5))], np.float32(0.85), np.full(3, 1.5))
    assert repr(single) == "Glaze([Layer('red', 20 um)], ground 0.85, n = (3,))"
    jax.jit(lambda g: (repr(g), g.albedo)[1])(glaze)


@pytest.mark.parametrize(
    "thing",
    [
        RED,
        Mixture([RED, BLUE], [0.2, 0.8]),
        Layer(RED, 1e-5),
        Glaze([Layer(RED, 1e-5)], 0.5),
        Bidirectional(45, 0),
    ],
    ids=lambda thing: type(thing).__name__,
)
def test_objects_can_be_pickled_and_copied(thing):
    for again in (pickle.loads(pickle.dumps(thing)), copy.deepcopy(thing)):
        assert eqx.tree_equal(again, thing)
        assert repr(again) == repr(thing)


def test_coats_of_different_batches_are_one_sentence():
    two, four = (Layer(RED, np.full(n, 1e-6)) for n in (2, 4))
    with refusal(r"shapes \(2,\), \(4,\) over .*thickness\[:, None\]"):
        Glaze([two, four], 0.9)
    with refusal(r"grounds of shape \(2,\)"):
        Glaze([four], np.full((2, 3), 0.9))
    with refusal("1 of 2 values are masked"):
        Layer(RED, np.ma.masked_array([1e-6, 2e-6], [False, True]))
    assert Glaze([Layer(RED, np.zeros(0))], 0.9).optical_thickness.shape == (0, 3, 1)
