"""Paint under a rough surface: energy, reciprocity, limits and gradients; paths that are followed one
by one are in `tests/oracles`.
"""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

import glazejax as gj
from glazejax.radiative.common.fresnel import dielectric_reflectance
from glazejax.radiative.rough import (
    rough_hemispherical_reflectance,
    rough_ports,
    rough_reflectance_factor,
    surface_albedo,
    surface_loss,
    surface_reflectance_factor,
)
from glazejax.radiative.rough.resolution import resolve
from tests.tolerances import ROUNDING

from ..checks import check_mapped, check_slopes, finite, largest_difference
from ..refusals import refusal
from ..slow import slow

COSINES = np.array([0.05, 0.2, 0.5, 0.8, 1.0])
ALBEDO = np.array([[0.9, 0.5], [1 - 1e-6, 0.9], [0.3, 0.99], [1.0, 1.0], [0.0, 0.7]])
THICKNESS = np.array([[0.3, 2.0], [0.01, 0.05], [0.0, 30.0], [1.0, 1e3], [0.2, 0.0]])
GROUND = np.array([0.5, 0.9, 0.0, 1.0, 0.8])
STACKS = ALBEDO, THICKNESS, GROUND


# The usual surface, then the ends of both ranges.
ENDS = [slow(*each) for each in ((0.02, 1.5), (0.02, 2.5), (1.0, 1.05), (1.0, 2.5))]


@pytest.mark.parametrize(("roughness", "index"), [(0.3, 1.5), slow(0.1, 1.5), *ENDS])
def test_white_paint_on_white_ground_gives_all_light_back(roughness, index):
    cosines = np.linspace(0.05, 1, 5)
    given = {"roughness": roughness, "refractive_index": index, "cos_incidence": cosines}
    body = rough_hemispherical_reflectance([1.0, 1.0], [0.3, 2.0], 1.0, tolerance=1e-4, **given)
    assert largest_difference(body + surface_albedo(**given), 1.0) < 1e-4


@pytest.mark.parametrize(("roughness", "index"), [(0.3, 1.5), *ENDS])
def test_surface_keeps_all_energy_on_both_sides(roughness, index):
    made = resolve(index, roughness, 1e-4).operators()
    mu, weights = made.basis.cosines, made.basis.weights
    # From the paint: back, or out. Out is what enters, by reciprocity, integrated over air by
    # another rule.
    y, w = np.polynomial.legendre.leggauss(200)
    air = (0.5 * (y + 1)) ** 2
    flux = 2 * air * 0.5 * w * 2 * np.sqrt(air)
    leaves = flux @ np.asarray(made.enters(air)) / index**2
    assert np.allclose(made.back.sum(axis=0) + leaves, 2 * weights * mu, atol=2e-5)
    assert np.allclose(made.leaves, index**2 * leaves, atol=2e-5 * index**2)
    assert np.array_equal(made.back, made.back.T)
    # From air: reflected, by the surface's own BRDF integrated over the hemisphere, or let in.
    if roughness >= 0.3:
        azimuth = 180 * 0.5 * (y[None] + 1)
        for cosine in (0.3, 0.9):
            factor = surface_reflectance_factor(
                cosine, air[:, None], azimuth, roughness=roughness, refractive_index=index
            )
            total = float(flux @ (np.asarray(factor) @ (0.5 * w)))
            expected = surface_albedo(cosine, roughness=roughness, refractive_index=index)
            assert abs(total - float(expected)) < 5e-5


def test_incidence_and_viewing_exchanged_give_the_same():
    pairs = (0.3, COSINES), (COSINES, 0.3)
    body = [
        rough_reflectance_factor(*STACKS, roughness=0.3, cos_incidence=a, cos_viewing=b)
        for a, b in pairs
    ]
    assert np.allclose(*body, rtol=ROUNDING, atol=0)
    surface = [surface_reflectance_factor(*pair, 40.0, roughness=0.3) for pair in pairs]
    assert np.allclose(*surface, rtol=ROUNDING, atol=0)


def test_smooth_surface_is_the_smooth_solver_to_the_last_digit():
    cosines = {"cos_incidence": COSINES, "tolerance": 1e-4}
    ours = rough_reflectance_factor(*STACKS, roughness=0.0, **cosines)
    assert np.array_equal(ours, gj.stack_reflectance_factor(*STACKS, **cosines))
    ours = gj.rough_hemispherical_reflectance(*STACKS, roughness=0, **cosines)
    assert np.array_equal(ours, gj.stack_hemispherical_reflectance(*STACKS, **cosines))


@pytest.mark.slow
def test_a_little_roughness_changes_little():
    cosines = {"cos_incidence": COSINES[::-1], "cos_viewing": COSINES, "tolerance": 1e-4}
    smooth = gj.stack_reflectance_factor(*STACKS, **cosines)
    steps = [
        largest_difference(rough_reflectance_factor(*STACKS, roughness=a, **cosines), smooth)
        for a in (0.03, 0.003, 3e-4)
    ]
    # At these angles it changes as the square of the roughness and, at the critical angle, faster;
    # grazing, slower.
    assert steps[0] > 3 * steps[1]
    assert steps[1] < 3e-3
    assert steps[2] < 3e-4


@pytest.mark.slow
def test_ports_are_the_reflectance_over_any_ground():
    grounds = np.array([0.0, 0.3, 1.0])[:, None]
    given = {"roughness": 0.2, "cos_incidence": COSINES, "cos_viewing": 0.6}
    ports = rough_ports(ALBEDO, THICKNESS, **given)
    assert np.allclose(
        ports.reflectance(grounds),
        rough_reflectance_factor(ALBEDO, THICKNESS, grounds, **given),
        atol=ROUNDING,
    )
    other = rough_ports(ALBEDO, THICKNESS, roughness=0.2, cos_incidence=0.6, cos_viewing=COSINES)
    assert np.allclose(ports.incidence, other.viewing, rtol=1e-10, atol=1e-300)
    assert np.allclose(ports.back, other.back, rtol=ROUNDING)
    assert np.all((ports.back >= 0) & (ports.back < 1))
    # A ground of one keeps what is not absorbed: S + out = 1 for clear layers.
    clear = rough_ports([1.0], [0.5], roughness=0.2, cos_viewing=None)
    assert abs(float(clear.back + clear.viewing / 1.5) - 1) < 1e-4


@pytest.mark.slow
@pytest.mark.parametrize("index", [1.0, 1.5])
def test_ports_of_a_smooth_surface_are_those_of_the_smooth_solver(index):
    given = {"cos_incidence": COSINES, "cos_viewing": 0.6}
    ports = rough_ports(ALBEDO, THICKNESS, refractive_index=index, tolerance=1e-5, **given)
    theirs = gj.stack_reflectance_factor(*STACKS, refractive_index=index, **given)
    assert largest_difference(ports.reflectance(GROUND), theirs) < 2e-5


def _value(albedo, thickness, ground, light, view):
    return rough_reflectance_factor(
        albedo,
        thickness,
        ground,
        roughness=0.2,
        cos_incidence=light,
        cos_viewing=view,
        tolerance=1e-3,
    )


POINT = (
    jnp.array([0.9, 0.6]),
    jnp.array([0.4, 1.5]),
    jnp.array(0.7),
    jnp.array(0.8),
    jnp.array(0.35),
)


def test_gradients_are_those_of_differences():
    check_slopes(jax.jit(_value), POINT, eps=1e-5, rtol=1e-6, atol=1e-7)


@pytest.mark.slow
def test_gradients_of_ports_are_those_of_differences():
    def total(q, d):
        ports = rough_ports(q, d, roughness=0.2, cos_incidence=0.8, cos_viewing=0.4, tolerance=1e-3)
        return 2.0 * ports.dark + ports.incidence - 3.0 * ports.viewing + ports.back

    check_slopes(jax.jit(total), POINT[:2], eps=1e-5, rtol=1e-6, atol=1e-8)


def test_values_and_gradients_are_finite_at_the_edges():
    rows = list(itertools.product((0.0, 0.5, 1.0), (0.0, 1e-9, 1.0, 1e6), (0.0, 1.0), (1e-4, 1.0)))
    q, d, g, c = (jnp.array(x) for x in zip(*rows, strict=True))
    q, d = (jnp.stack([x, x[::-1]], axis=1) for x in (q, d))
    value = jax.jit(_value)(q, d, g, c, c[::-1])
    assert np.all(np.asarray(value) >= -1e-4)
    height = jax.jit(jax.grad(lambda *a: jnp.sum(_value(*a)), argnums=(0, 1, 2, 3)))
    assert finite((value, height(q, d, g, c, c[::-1])))


@pytest.mark.slow
def test_jit_and_vmap_and_loop_give_the_same():
    stacks = [jnp.asarray(a) for a in (*STACKS, COSINES, COSINES[::-1])]
    check_mapped(_value, *stacks, rtol=ROUNDING, atol=1e-8)
    alone = _value(*(a[1] for a in stacks))
    assert np.isclose(alone, _value(*stacks)[1], rtol=ROUNDING)


@pytest.mark.slow
def test_an_index_for_each_band_is_each_index_by_itself():
    index = np.array([1.5, 1.5, 1.7, 1.5, 1.7])
    given = {"roughness": 0.2, "cos_incidence": COSINES, "tolerance": 1e-3}
    both = rough_reflectance_factor(*STACKS, refractive_index=index, **given)
    for one in (1.5, 1.7):
        alone = rough_reflectance_factor(*STACKS, refractive_index=one, **given)
        assert np.array_equal(np.asarray(both)[index == one], np.asarray(alone)[index == one])
    surface = surface_albedo(COSINES, roughness=0.2, refractive_index=index)
    assert np.isclose(surface[2], surface_albedo(COSINES[2], roughness=0.2, refractive_index=1.7))


@pytest.mark.slow
@settings(max_examples=20)
@given(
    st.lists(st.tuples(st.floats(0, 1), st.floats(0, 50)), min_size=2, max_size=2),
    st.floats(0, 0.9),
    st.floats(0.02, 1),
)
def test_body_lies_between_nothing_and_what_enters(layers, ground, cosine):
    q, d = np.array(layers).T
    flux = [
        float(
            rough_hemispherical_reflectance(
                q, d, g, roughness=0.2, cos_incidence=cosine, tolerance=1e-3
            )
        )
        for g in (ground, ground + 0.1)
    ]
    most = 1 - float(surface_albedo(cosine, roughness=0.2))
    assert -1e-3 <= flux[0] <= flux[1] + 1e-12 <= most + 1e-3


@pytest.mark.slow
def test_single_precision_is_as_good_as_it_can_be():
    given = {"roughness": 0.2, "cos_viewing": COSINES, "tolerance": 1e-3}
    exact = rough_reflectance_factor(*STACKS, **given)
    with jax.enable_x64(False):
        single = rough_reflectance_factor(*STACKS, **given)
    assert single.dtype == jnp.float32
    assert largest_difference(single, exact) < 3e-5


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"roughness": 1.2}, "roughness is 1.2; it must be in"),
        ({"roughness": -0.1}, "roughness is -0.1"),
        ({"roughness": float("nan")}, "roughness is nan"),
        ({"roughness": np.array([0.1, 0.2])}, "one known number"),
        ({"refractive_index": 1.0}, "refractive_index holds 1.0; under a rough surface"),
        ({"refractive_index": 2.6}, "refractive_index holds 2.6"),
        ({"albedo": [1.5]}, "albedo holds 1.5"),
        ({"tolerance": 0.0}, "tolerance is 0.0"),
    ],
)
def test_bad_input_is_one_clear_sentence(unchecked, change, words):
    arguments = {
        "albedo": [0.5],
        "optical_thickness": [1.0],
        "substrate_reflectance": 0.5,
        "roughness": 0.2,
    } | change
    with refusal(words):
        rough_reflectance_factor(**arguments)


@pytest.mark.parametrize("trace", [jax.jit, jax.grad])
def test_what_must_be_known_is_not_traced(unchecked, trace):
    """A slope by either would come out as 0."""
    with refusal("roughness must be one known number"):
        trace(lambda a: rough_reflectance_factor([0.5], [1.0], 0.5, roughness=a))(0.2)
    with refusal("refractive_index is traced"):
        trace(
            lambda n: rough_reflectance_factor([0.5], [1.0], 0.5, roughness=0.2, refractive_index=n)
        )(1.5)
    with refusal("refractive_index is traced"):
        trace(lambda n: rough_ports([0.5], [1.0], refractive_index=n))(1.5)


def test_what_no_rough_surface_has_is_refused(unchecked):
    with refusal("mirror direction only"):
        surface_reflectance_factor(0.5, 0.5, roughness=0.0)
    with refusal("azimuth holds nan"):
        surface_reflectance_factor(0.5, 0.5, np.nan, roughness=0.1)
    with refusal("side 'below' is unknown"):
        surface_loss(0.5, roughness=0.1, side="below")  # pyright: ignore[reportArgumentType]


def test_a_smooth_surface_takes_a_traced_index():
    def albedo(n):
        return surface_albedo(0.7, roughness=0.0, refractive_index=n)

    assert_allclose(jax.jit(albedo)(1.5), dielectric_reflectance(0.7, 1.5), rtol=1e-12)
    check_slopes(albedo, (jnp.array(1.5),))
    lost = jax.jit(lambda n: surface_loss([0.2, 0.7], roughness=0.0, refractive_index=n))(1.5)
    assert_array_equal(lost, [0.0, 0.0])
