"""A glaze's reflectance factor from a table: its error, its limits, its slopes."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

from glazejax import Bidirectional, Glaze, Layer, catalogue, reflectance, stack_reflectance_factor
from glazejax.appearance.glaze.table import GlazeTable, glaze_table
from glazejax.paint.media import MAX_THICKNESS
from glazejax.radiative.common.fresnel import dielectric_reflectance
from glazejax.spectra import Numbers

from ..checks import check_slopes, largest_difference
from ..glazes import coated
from ..refusals import refusal

WAVELENGTHS = np.array([420.0, 480.0, 540.0, 600.0, 660.0])
RNG = np.random.default_rng(11)
COS_IN, COS_OUT = np.cos(np.deg2rad(RNG.uniform(0, 89.5, (2, 60))))


def glaze(top: Numbers = 15e-6, index=1.5, wavelengths=None):
    return coated(0.6, index, wavelengths, CobaltBlue=top, ZincWhite=20e-6)


def table_of(**how):
    return glaze_table(glaze(), WAVELENGTHS, **how)


def solved(top: Numbers = 15e-6, index=1.5):
    """By the solver, a hundred times finer than the table."""
    made = glaze(top, index, WAVELENGTHS)
    return stack_reflectance_factor(
        made.albedo,
        made.optical_thickness,
        made.ground,
        refractive_index=made.refractive_index,
        cos_incidence=COS_IN[:, None],
        cos_viewing=COS_OUT[:, None],
        tolerance=1e-6,
    )


def forward():
    """Paint that scatters forwards."""
    blue = catalogue.pigment("CobaltBlue")
    return Glaze([Layer(blue, 10e-6, phase=[1.0, 0.5, 0.25])], 0.6)


@pytest.fixture(scope="module")
def table():
    return table_of(tolerance=1e-4)


@pytest.fixture(scope="module")
def deep():
    return table_of(thickness=np.linspace(0, 30e-6, 7), tolerance=1e-4)


def test_a_map_of_one_thickness_may_be_the_thickest_there_is():
    thick = table_of(angles=((0, 0), (0, 0)), thickness=np.full((2, 2), MAX_THICKNESS))
    solved = reflectance(glaze(MAX_THICKNESS, wavelengths=WAVELENGTHS), Bidirectional())
    assert_allclose(thick.reflectance_factor(1.0, 1.0, MAX_THICKNESS), solved, atol=1e-3)


def test_error_is_what_it_says(table):
    found = table.reflectance_factor(COS_IN, COS_OUT)
    assert found.shape == (60, 5)
    assert table.error <= 1e-4
    assert largest_difference(found, solved()) < table.error
    assert "5 bands" in repr(table)


def test_thickness_is_an_axis(deep):
    depths = RNG.uniform(0, 30e-6, 60)
    depths[:3] = 0.0, 30e-6, 1e-8
    found = deep.reflectance_factor(COS_IN, COS_OUT, depths)
    assert deep.error <= 1e-4
    assert largest_difference(found, solved(depths)) < deep.error
    with refusal("give thickness, in metres"):
        deep.reflectance_factor(0.5, 0.5)


def test_grazing_light_vanishes_and_directions_can_be_exchanged(table):
    assert not np.any(table.reflectance_factor(0.0, 0.5))
    assert not np.any(table.reflectance_factor(-0.3, 0.5))
    forth = table.reflectance_factor(COS_IN, COS_OUT)
    assert_allclose(forth, table.reflectance_factor(COS_OUT, COS_IN), atol=1e-12)


def test_mirror_is_the_outer_surface(table):
    assert_allclose(table.mirror(COS_IN)[:, 2], dielectric_reflectance(COS_IN, 1.5), rtol=1e-13)
    assert np.all(np.asarray(table.mirror(-0.5)) == 1.0)


def test_only_angles_asked_for(table):
    """One direction of light makes one node; what a scene does not have is not computed."""
    narrow = table_of(angles=((45, 45), (0, 20)), tolerance=1e-4)
    assert narrow.table.shape[1] == 1
    assert narrow.table.size < 5 * 8
    viewing = np.cos(np.deg2rad(np.linspace(0, 20, 9)))
    lit = np.full(9, np.cos(np.pi / 4))
    assert_allclose(
        narrow.reflectance_factor(lit, viewing), table.reflectance_factor(lit, viewing), atol=2e-4
    )


@pytest.mark.slow
@pytest.mark.parametrize("index", [1.0, np.linspace(1.5, 1.6, 5)], ids=["no surface", "dispersion"])
def test_other_indices(index):
    made = glaze(index=index, wavelengths=WAVELENGTHS)
    found = glaze_table(made, WAVELENGTHS, tolerance=1e-3)
    assert found.error <= 1e-3
    factor = found.reflectance_factor(COS_IN, COS_OUT)
    assert largest_difference(factor, solved(index=index)) < found.error


def test_bare_ground():
    found = glaze_table(Glaze([], 0.5), WAVELENGTHS, tolerance=1e-4)
    expected = stack_reflectance_factor(
        [0.0], [0.0], 0.5, cos_incidence=COS_IN, cos_viewing=COS_OUT
    )
    assert_allclose(found.reflectance_factor(COS_IN, COS_OUT)[:, 3], expected, atol=1e-4)


def test_through_jit_vmap_and_slopes(deep):
    depths = RNG.uniform(1e-6, 29e-6, 60)
    plain = deep.reflectance_factor(COS_IN, COS_OUT, depths)
    arrays = [jnp.asarray(values) for values in (COS_IN, COS_OUT, depths)]
    assert_allclose(jax.jit(GlazeTable.reflectance_factor)(deep, *arrays), plain, atol=1e-12)
    assert_allclose(jax.vmap(deep.reflectance_factor)(*arrays), plain, atol=1e-12)

    def total(a, b, d):
        return jnp.sum(deep.reflectance_factor(a, b, d * 1e-6))

    check_slopes(total, (0.8, 0.6, 12.0), eps=1e-5, rtol=1e-5, atol=1e-8)


def test_slopes_at_the_ends(deep):
    """Normal incidence and no coat at all are ends of the table, and common: their slopes are
    whole.
    """

    def total(x):
        return jnp.sum(deep.reflectance_factor(x[0], 0.8, x[1] * 1e-6))

    slopes = jax.jit(jax.grad(total))
    for end, inside in (([1.0, 12.0], [1.0 - 1e-7, 12.0]), ([0.7, 0.0], [0.7, 1e-6])):
        assert_allclose(slopes(np.array(end)), slopes(np.array(inside)), rtol=1e-3)


def test_slopes_by_the_paint(table):
    """A table for_glaze for a glaze that JAX traces: like a difference of two whole solutions."""

    @jax.jit
    def seen(um):
        made = glaze(um * 1e-6, wavelengths=WAVELENGTHS)
        return jnp.sum(table.for_glaze(made, WAVELENGTHS).reflectance_factor(0.7, 0.9))

    slope = jax.grad(seen)(15.0)
    assert slope == pytest.approx(float((seen(15.01) - seen(14.99)) / 0.02), rel=1e-4)
    assert_allclose(
        table.for_glaze(glaze(), WAVELENGTHS).reflectance_factor(COS_IN, COS_OUT),
        table.reflectance_factor(COS_IN, COS_OUT),
        atol=1e-4,
    )


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda t: t.reflectance_factor(0.5, 0.5, 1e-6), "thickness is fixed"),
        (lambda t: table_of(tolerance=0), "tolerance is 0"),
        (lambda t: table_of(angles=((0, 100), (0, 90))), "angles of incidence are 0 to 100"),
        (lambda t: table_of(thickness=[1e-6], layer=2), "layer is 2, but the glaze has 2"),
        (lambda t: table_of(layer=5), "layer is 5, but the glaze has 2"),
        (lambda t: table_of(thickness=[12.0]), "thickness is in metres"),
        (
            lambda t: glaze_table(glaze(top=np.full(3, 1e-6)), WAVELENGTHS),
            "one glaze, without batch axes",
        ),
        (lambda t: glaze_table(glaze(), [300.0, 500.0]), "without guessing"),
        (lambda t: glaze_table(forward(), WAVELENGTHS), "takes isotropic scattering only"),
        (lambda t: t.for_glaze(forward(), WAVELENGTHS), "takes isotropic scattering only"),
        (
            lambda t: jax.grad(lambda d: glaze_table(glaze(d), WAVELENGTHS).table.sum())(1e-6),
            "JAX traces this glaze",
        ),
    ],
)
def test_what_is_refused(table, call, message):
    with refusal(message):
        call(table)
