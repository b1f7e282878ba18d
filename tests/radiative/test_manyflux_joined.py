"""Layers of different refractive index, free-standing layers, grounds by table, the series: limits
and conservation.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

from glazejax.radiative.common.fresnel import dielectric_reflectance
from glazejax.radiative.common.phase import henyey_greenstein
from glazejax.radiative.common.quadrature import gauss
from glazejax.radiative.manyflux.free import (
    free_diffuse,
    free_factor,
    free_hemispherical,
    free_regular,
)
from glazejax.radiative.manyflux.ground import ground_table
from glazejax.radiative.manyflux.media import SharedSpread, in_medium, shared_directions
from glazejax.radiative.manyflux.reflectance import (
    brdf_table,
    manyflux_diffuse_reflectance,
    manyflux_hemispherical_reflectance,
    manyflux_reflectance_factor,
)
from tests.tolerances import CONSERVED, LAST_DIGITS, ROUNDING

from ..checks import check_slopes, finite
from ..refusals import refusal
from ..slow import slow
from .cases import between, closed_form

PHASE = henyey_greenstein(jnp.array([0.6, -0.3]), 12)
COS = np.array([0.05, 0.6, 1.0])
THICKNESS = np.array([[0.3, 2.0], [0.0, 1e-9], [1e3, 0.0]])[:, None]


def test_directions_of_all_media():
    """Fluxes are exact in each medium; a cosine does not depend on the way to it."""
    pieces = SharedSpread((1.0, 1.3, 1.6), (5, 6, 7), 2.0, (1.6, 1.3))
    common = shared_directions(pieces)
    for index in (1.0, 1.3, 1.6):
        mu, weights, exists = in_medium(common, index)
        assert np.sum(weights * mu) == pytest.approx(0.5, abs=LAST_DIGITS)
        assert np.all(weights[~exists] == 0)
        kept = index**2 * (1 - mu[exists] ** 2)
        assert_allclose(kept, (common.end**2 - common.beyond)[exists], atol=1e-13)


@pytest.mark.parametrize("index", [(1.5, 1.3), slow((1.3, 1.6))])
def test_nothing_is_lost_between_media(index):
    """Without absorption all light comes back from a white ground, whatever the indices."""
    given: dict = {
        "phase": PHASE,
        "refractive_index": index,
        "cos_incidence": COS,
        "streams": 9,
    }
    outer = dielectric_reflectance(COS, index[0])
    flux = manyflux_hemispherical_reflectance([1.0, 1.0], THICKNESS, 1.0, **given)
    assert_allclose(flux + outer, np.ones((3, 3)), atol=CONSERVED)


def through_two_faces(cosines, upper: float, lower: float):
    """Share of light from the air that gets below both faces, with all reflections between them,
    and slant below.
    """
    below = np.sqrt(1.0 - (1.0 - cosines**2) / upper**2)
    outer, inner = (
        dielectric_reflectance(cosines, upper),
        dielectric_reflectance(below, lower / upper),
    )
    return (1.0 - outer) * (1.0 - inner) / (1.0 - outer * inner), np.sqrt(
        1.0 - (1.0 - cosines**2) / lower**2
    )


@pytest.mark.slow
def test_ground_below_faces_alone_is_the_closed_form():
    """Clear layers of two indices on grey: T T' r/(n^2 (1 - r) + r t), with t the T of even light,
    n of the lower.

    Of what the ground sends out t/n^2 gets through the faces: the cone of refraction, whatever lies
    between. Nine directions give t to one per cent.
    """
    ground, upper, lower = 0.6, 1.5, 1.3
    given: dict = {"phase": PHASE, "refractive_index": (upper, lower), "streams": 9}
    stack = [1.0, 1.0], 0.0 * THICKNESS, ground
    nodes, weights = gauss(200)
    even = 2.0 * np.sum(weights * nodes * through_two_faces(nodes, upper, lower)[0])
    beam, _ = through_two_faces(COS, upper, lower)
    left = lower**2 * (1.0 - ground) + ground * even
    flux = manyflux_hemispherical_reflectance(*stack, cos_incidence=COS, **given)
    assert_allclose(flux, np.tile(beam * ground * even / left, (3, 1)), rtol=0.02)
    diffuse = manyflux_diffuse_reflectance(*stack, **given)
    assert_allclose(diffuse, np.full((3, 1), ground * even**2 / left), rtol=0.02)
    factor = manyflux_reflectance_factor(*stack, cos_incidence=COS, cos_viewing=0.4, **given)
    seen, _ = through_two_faces(np.array(0.4), upper, lower)
    assert_allclose(factor, np.tile(beam * seen * ground / left, (3, 1)), rtol=0.02)


@pytest.mark.slow
def test_thin_layer_below_a_face_scatters_once():
    """Over black, with the whole phase function: T T' q p/(4 n^2 mu mu') times the depth, n and mu
    of that layer.
    """
    g, upper, lower, turn, thin = 0.8, 1.5, 1.3, 40.0, 1e-7
    (lit, seen), cosines = through_two_faces(np.array([0.9, 0.5]), upper, lower)
    p = closed_form(g, between(cosines[0], cosines[1], turn))
    found = manyflux_reflectance_factor(
        [0.0, 0.7],
        [0.0, thin],
        0.0,
        phase=henyey_greenstein(g),
        refractive_index=(upper, lower),
        cos_incidence=0.9,
        cos_viewing=0.5,
        azimuth=turn,
        streams=9,
    )
    # Light mirrored between the faces is followed with the moments that are kept, the rest with the
    # whole function.
    assert found == pytest.approx(
        lit * seen * 0.7 * p * thin / (4 * lower**2 * np.prod(cosines)), rel=1e-3
    )


@pytest.mark.slow
@pytest.mark.parametrize("index", [(1.5, 1.3), (1.3, 1.6), (1.5, 1.5)])
def test_what_does_not_come_back_goes_through(index):
    given: dict = {
        "phase": PHASE,
        "refractive_index": index,
        "cos_incidence": COS,
        "streams": 9,
    }
    outer = dielectric_reflectance(COS, index[0])
    both = [
        free_hemispherical([1.0, 1.0], THICKNESS, transmitted=t, **given) for t in (False, True)
    ]
    assert_allclose(both[0] + both[1] + outer, np.ones((3, 3)), atol=CONSERVED)


@pytest.mark.slow
def test_reciprocity_between_media():
    given: dict = {
        "phase": PHASE,
        "refractive_index": (1.5, 1.3),
        "azimuth": 50.0,
        "streams": 9,
    }
    stack = [0.9, 0.8], [0.3, 2.0]
    there: dict = {"cos_incidence": 0.8, "cos_viewing": 0.3}
    back: dict = {"cos_incidence": 0.3, "cos_viewing": 0.8}
    one, other = (free_factor(*stack, transmitted=False, **way, **given) for way in (there, back))
    assert float(one) == pytest.approx(float(other), abs=ROUNDING)
    through = free_factor(*stack, transmitted=True, **there, **given)
    given |= {"phase": PHASE[::-1], "refractive_index": (1.3, 1.5)}
    turned = free_factor([0.8, 0.9], [2.0, 0.3], transmitted=True, **back, **given)
    assert float(through) == pytest.approx(float(turned), abs=ROUNDING)


def test_clear_slab_is_the_closed_form():
    """Fresnel's reflections back and forth: (1 - r)^2 e/(1 - r^2 e^2)."""
    r, e = dielectric_reflectance(COS, 1.5), np.exp(-0.4 / np.sqrt(1 - (1 - COS**2) / 2.25))
    found = free_regular([0.0], [0.4], cos_incidence=COS)
    assert_allclose(found, (1 - r) ** 2 * e / (1 - (r * e) ** 2), atol=1e-11)


@pytest.mark.slow
def test_factor_sums_to_the_flux():
    """Over all directions of viewing the factor makes the hemispherical flux; incidences make the
    diffuse one.
    """
    cos, weights = gauss(40)
    given: dict = {"phase": PHASE, "refractive_index": 1.4, "streams": 16}
    stack = [0.9, 0.8], [0.3, 2.0]
    for transmitted in (False, True):
        each = free_factor(
            *stack,
            transmitted=transmitted,
            cos_incidence=0.7,
            cos_viewing=cos,
            azimuth=np.arange(0, 360, 12.0)[:, None],
            **given,
        )
        flux = free_hemispherical(*stack, transmitted=transmitted, cos_incidence=0.7, **given)
        # What goes straight through, or is mirrored by the faces.
        beam: dict = {"refractive_index": 1.4, "cos_incidence": 0.7}
        sharp = (
            free_regular(*stack, **beam)
            if transmitted
            else free_hemispherical([0.0, 0.0], stack[1], transmitted=False, streams=4, **beam)
        )
        assert np.mean(each, axis=0) @ (2 * cos * weights) + sharp == pytest.approx(
            float(flux), abs=1e-5
        )
        fluxes = free_hemispherical(*stack, transmitted=transmitted, cos_incidence=cos, **given)
        whole = free_diffuse(*stack, transmitted=transmitted, **given)
        assert fluxes @ (2 * cos * weights) == pytest.approx(float(whole), abs=1e-4)


@pytest.mark.slow
def test_white_table_is_a_lambertian_ground():
    """The joined program with a table of ones against the one for a single index."""
    table = ground_table([1.0, 0.5, 0.0], np.ones((3, 3)))
    stack = [0.95, 0.6], [0.7, 2.0], 0.4
    given: dict = {
        "phase": PHASE,
        "cos_incidence": [0.8],
        "cos_viewing": [0.6, 0.1],
        "azimuth": [50.0],
        "tolerance": 1e-5,
    }
    assert_allclose(
        brdf_table(*stack, ground=table, **given), brdf_table(*stack, **given), atol=2e-6
    )


def test_ground_seen_through_nothing():
    """No layer, no surface: what is seen is the table itself, between its points and azimuths."""
    cosines, azimuth = np.array([1.0, 0.6, 0.2]), np.deg2rad(np.linspace(0, 180, 9))
    level = np.array([[0.5, 0.4, 0.3], [0.4, 0.3, 0.2], [0.3, 0.2, 0.1]])
    factor = level[..., None] * (1 + 0.5 * np.cos(azimuth) + 0.2 * np.cos(3 * azimuth))
    found = brdf_table(
        [0.5],
        [0.0],
        0.9,
        ground=ground_table(cosines, factor),
        phase=PHASE[0],
        refractive_index=1.0,
        cos_incidence=[0.6, 0.8],
        cos_viewing=[0.6, 0.1],
        azimuth=[0.0, 100.0],
        streams=8,
    )
    wave = 1 + 0.5 * np.cos(np.deg2rad([0, 100])) + 0.2 * np.cos(np.deg2rad([0, 300]))
    expected = 0.9 * np.array([[0.3, 0.35], [0.2, 0.25]])[..., None] * wave
    assert_allclose(np.pi * found, expected, atol=1e-10)


@pytest.mark.slow
def test_slopes_between_media():
    def value(x):
        return manyflux_reflectance_factor(
            x[:2],
            x[2:4],
            x[4],
            phase=PHASE,
            refractive_index=(1.5, 1.3),
            cos_incidence=0.8,
            cos_viewing=0.6,
            streams=8,
        )

    x = jnp.array([0.9, 0.6, 0.4, 1.2, 0.5])
    check_slopes(jax.jit(value), (x,), modes=("rev",), eps=1e-5, rtol=1e-7, atol=1e-7)
    assert finite(jax.jit(jax.grad(value))(jnp.array([1.0, 0.0, 0.0, 5.0, 1.0])))


def test_errors_name_the_value(unchecked):
    with refusal("refractive_index has 3 values"):
        manyflux_diffuse_reflectance([0.5], [1.0], 0.3, refractive_index=(1.5, 1.4, 1.3))
    with refusal(r"refractive_index holds 0\.9"):
        manyflux_diffuse_reflectance([0.5, 0.5], [1.0, 1.0], 0.3, refractive_index=(1.5, 0.9))
    with refusal(r"index_below is 1\.6"):
        free_diffuse([0.5], [1.0], transmitted=True, index_below=1.6)
    with refusal("need at least 6"):
        manyflux_diffuse_reflectance(
            [0.5, 0.5], [1.0, 1.0], 0.3, refractive_index=(1.5, 1.4), streams=4
        )
    with refusal("solution 'exact' is unknown"):
        manyflux_diffuse_reflectance([0.5], [1.0], 0.3, solution="exact")  # pyright: ignore[reportArgumentType]
    with refusal("is not reciprocal"):
        ground_table([1.0, 0.0], [[0.5, 0.2], [0.4, 0.5]])
    with refusal(r"the ground reflects 1\.5"):
        ground_table([1.0, 0.0], np.full((2, 2), 1.5))
    with refusal("cosines must descend"):
        ground_table([0.0, 1.0], np.ones((2, 2)))
