"""The many-flux solver: conservation, reciprocity, limits, slopes."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

from glazejax.radiative.common.fresnel import cos_refracted, dielectric_reflectance
from glazejax.radiative.common.phase import henyey_greenstein, two_term_henyey_greenstein
from glazejax.radiative.common.quadrature import gauss
from glazejax.radiative.manyflux.reflectance import (
    brdf_table,
    manyflux_diffuse_reflectance,
    manyflux_hemispherical_reflectance,
    manyflux_reflectance_factor,
)
from glazejax.radiative.stack import split_reflectance_factor
from tests.tolerances import CONSERVED, ROUNDING

from ..checks import finite
from ..refusals import refusal
from ..slow import slow
from .cases import CENTRAL, between, closed_form

PHASES = {
    "forward": henyey_greenstein(0.8),
    "backward": henyey_greenstein(-0.5),
    "two lobes": two_term_henyey_greenstein(0.7, -0.4, 0.8),
}


@pytest.mark.parametrize("index", [slow(1.0), 1.5])
def test_nothing_is_lost_without_absorption(index):
    phase = jnp.stack([PHASES[name][:30] for name in PHASES])[:, None]
    given = {"phase": phase, "refractive_index": index, "streams": 6}
    cos = np.array([0.05, 0.6, 1.0])
    thickness = np.array([0.0, 1e-9, 0.3, 30.0, 1e4])[:, None]
    stack = np.ones(2), np.stack([thickness, np.full_like(thickness, 0.5)], axis=-1), 1.0
    flux = manyflux_hemispherical_reflectance(*stack, cos_incidence=cos, **given)
    assert flux.shape == (5, 3)
    assert_allclose(flux + dielectric_reflectance(cos, index), 1.0, atol=CONSERVED)
    # Even light loses what the surface reflects of it, twice the mean of R mu; six directions see
    # it to one per cent.
    nodes, weights = gauss(200)
    outer = 2.0 * weights @ (nodes * dielectric_reflectance(nodes, index))
    assert_allclose(
        manyflux_diffuse_reflectance(*stack, **given),
        1.0 - outer,
        atol=0.015 if index > 1 else 1e-10,
    )


@pytest.mark.slow
def test_reciprocity_and_table():
    """Light and eye change places; a table holds what single calls give."""
    cos, azimuth = np.array([1.0, 0.8, 0.3]), np.array([0.0, 70.0, 180.0])
    stack = [0.95, 0.6], [0.7, 2.0], 0.4
    given: dict = {
        "phase": jnp.stack([PHASES["forward"][:30], PHASES["backward"][:30]]),
        "streams": 6,
    }
    table = np.pi * np.asarray(
        brdf_table(*stack, cos_incidence=cos, cos_viewing=cos, azimuth=azimuth, **given)
    )
    assert_allclose(table, np.swapaxes(table, 0, 1), atol=ROUNDING)
    one = manyflux_reflectance_factor(
        *stack, cos_incidence=0.8, cos_viewing=0.3, azimuth=70.0, **given
    )
    assert_allclose(one, table[2, 1, 1], atol=ROUNDING)


@pytest.mark.parametrize("index", [slow(1.0), 1.5])
def test_thin_layer_scatters_once(index):
    """Over black, with the whole phase function: q p(T)/(4 mu mu') by the cosines inside, however
    thin.

    The surface lets its shares pass, and radiance falls by the square of the index on the way out.
    """
    g, lit, seen, turn = 0.8, 0.9, 0.5, 40.0
    mu_i, mu_v = (float(cos_refracted(cosine, index)) for cosine in (lit, seen))
    p = closed_form(g, between(mu_i, mu_v, turn))
    passing = (
        np.prod([1.0 - float(dielectric_reflectance(cosine, index)) for cosine in (lit, seen)])
        / index**2
    )
    for thickness in (1e-6, 1e-12):
        found = manyflux_reflectance_factor(
            [0.7],
            [thickness],
            0.0,
            phase=PHASES["forward"],
            refractive_index=index,
            cos_incidence=lit,
            cos_viewing=seen,
            azimuth=turn,
            streams=8,
        )
        assert found == pytest.approx(
            passing * 0.7 * p * thickness / (4 * mu_i * mu_v), rel=1e-5, abs=0
        )


def test_two_layers_scatter_once_through_each_other():
    """Seen aslant over black, with peaked phase functions: sum over the layers of
    q p(T)/(4 mu mu') t, t the integral of exp(-x/mu - x/mu') over the layer's depths.

    Of an albedo of 1e-9, what is scattered twice is some 3e-9 of that.
    """
    albedo, asymmetry = 1e-9 * np.array([1.0, 3.0]), np.array([0.8, 0.6])
    lit, seen, turn = 0.9, 0.4, 40.0
    p = closed_form(asymmetry, between(lit, seen, turn))
    path = 1 / lit + 1 / seen
    faces = np.exp(-path * np.array([0.0, 0.5, 1.3]))
    exact = np.sum(albedo * p * -np.diff(faces)) / (4 * lit * seen * path)
    found = manyflux_reflectance_factor(
        albedo,
        np.diff([0.0, 0.5, 1.3]),
        0.0,
        phase=henyey_greenstein(asymmetry),
        refractive_index=1.0,
        cos_incidence=lit,
        cos_viewing=seen,
        azimuth=turn,
        streams=6,
    )
    assert found == pytest.approx(exact, rel=1e-8, abs=0)


@pytest.mark.slow
def test_layers_of_equal_paint_join():
    phase = PHASES["two lobes"]
    given: dict = {
        "phase": phase,
        "cos_incidence": 0.7,
        "cos_viewing": 0.5,
        "azimuth": 30.0,
        "streams": 8,
    }
    whole = manyflux_reflectance_factor([0.9], [2.0], 0.3, **given)
    parts = manyflux_reflectance_factor([0.9, 0.4, 0.9], [0.3, 0.0, 1.7], 0.3, **given)
    assert_allclose(parts, whole, atol=ROUNDING)


@pytest.mark.slow
def test_slopes():
    """By albedo, thickness, ground and g, against differences; finite where albedo is one and a
    layer is empty.
    """

    def value(x):
        return manyflux_reflectance_factor(
            x[:2],
            x[2:4],
            x[4],
            phase=henyey_greenstein(x[5], 12),
            cos_incidence=0.8,
            cos_viewing=0.6,
            azimuth=50.0,
            streams=6,
        )

    slope = jax.jit(jax.grad(value))
    x = np.array([0.9, 0.6, 0.4, 1.2, 0.5, 0.6])
    steps = 1e-3 * np.eye(6)
    moved = jax.jit(jax.vmap(value))(
        jnp.asarray(x + CENTRAL[0][:, None, None] * steps).reshape(-1, 6)
    ).reshape(8, 6)
    assert_allclose(slope(x), CENTRAL[1] @ np.asarray(moved) / 1e-3, atol=1e-9)
    assert finite(slope(np.array([1.0, 0.0, 0.0, 5.0, 1.0, 0.0])))


def test_errors_name_the_value():
    stack = [0.5], [1.0], 0.3
    with refusal("does not split"):
        split_reflectance_factor(*stack, method="manyflux")
    with refusal("phase begins with 2"):
        manyflux_reflectance_factor(*stack, phase=[2.0, 0.5])
    with refusal("phase has 3 layers"):
        manyflux_reflectance_factor(*stack, phase=np.ones((3, 1)))
    with refusal("cos_incidence holds 45"):
        manyflux_reflectance_factor(*stack, cos_incidence=45.0)
    with refusal("azimuth holds nan; it must be a finite number of degrees"):
        manyflux_reflectance_factor(*stack, azimuth=[0.0, np.nan])
    with refusal("azimuth holds nan"):
        brdf_table(*stack, cos_incidence=[1.0], cos_viewing=[1.0], azimuth=[np.nan])
    with refusal("streams is 1"):
        manyflux_reflectance_factor(*stack, streams=1)
    with refusal("refractive_index must be a number"):
        manyflux_reflectance_factor(*stack, refractive_index=np.array([1.5, 1.6]))  # pyright: ignore[reportArgumentType]
    with refusal("cos_viewing must be one axis"):
        brdf_table(*stack, cos_incidence=[1.0], cos_viewing=1.0)
