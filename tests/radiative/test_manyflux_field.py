"""The field inside: at the faces it is what goes in and comes out, in between flux is kept."""

import jax
import numpy as np
import pytest
from numpy.testing import assert_allclose

from glazejax.radiative.common.fresnel import cos_refracted, dielectric_reflectance
from glazejax.radiative.common.phase import henyey_greenstein
from glazejax.radiative.manyflux.field import manyflux_field
from glazejax.radiative.manyflux.media import interface_reflectance
from glazejax.radiative.manyflux.reflectance import (
    manyflux_hemispherical_reflectance,
    manyflux_reflectance_factor,
)
from tests.tolerances import ROUNDING

from ..refusals import refusal
from ..slow import slow

PHASE = henyey_greenstein(np.array([0.6, -0.3]), 4)


def check_surface(field, stack, given, azimuth, index, rounding):
    """Just below the surface the upward light is what is seen outside, and what goes in and does not
    come back is what flows down.
    """
    outside = manyflux_reflectance_factor(*stack, cos_viewing=0.6, azimuth=azimuth, **given)
    out = (1 - dielectric_reflectance(0.6, index)) / index**2
    assert_allclose(out * field.up[0, 0], outside, atol=rounding)
    kept = 1 - dielectric_reflectance(0.7, index)
    kept = kept - manyflux_hemispherical_reflectance(*stack, **given)
    assert_allclose(field.flux_down[0] - field.flux_up[0], kept, atol=rounding)


@pytest.mark.parametrize("solution", ["doubling", slow("modes")])
def test_field_meets_the_outside(solution):
    """Just below the surface the upward light is what is seen outside; on the ground it is the
    ground's.
    """
    stack = [0.9, 0.7], [0.4, 1.1], 0.5
    given: dict = {"phase": PHASE, "cos_incidence": 0.7, "streams": 4}
    seen = float(cos_refracted(0.6, 1.5))
    field = manyflux_field(
        *stack,
        depth=[0.0, 0.4, 0.8, 1.5],
        cos_direction=[seen, 0.2],
        azimuth=[0.0, 130.0],
        solution=solution,
        **given,
    )
    check_surface(field, stack, given, np.array([0.0, 130.0]), 1.5, ROUNDING)
    # What the surface sends back: Fresnel's share in a direction that leaves, all beyond the
    # critical angle.
    assert_allclose(
        field.down[0, 0], dielectric_reflectance(0.6, 1.5) * field.up[0, 0], atol=ROUNDING
    )
    assert_allclose(field.down[0, 1], field.up[0, 1], atol=ROUNDING)
    assert_allclose(field.up[-1], 0.5 * field.flux_down[-1], atol=ROUNDING)
    assert_allclose(field.flux_up[-1], 0.5 * field.flux_down[-1], atol=ROUNDING)
    entered = 1 - dielectric_reflectance(0.7, 1.5)
    assert_allclose(
        field.beam, entered * np.exp(-np.array([0, 0.4, 0.8, 1.5]) / cos_refracted(0.7, 1.5))
    )
    assert np.all(np.diff(field.flux_down - field.flux_up) < 0)


def test_errors_name_the_value(unchecked):
    with refusal("depth holds 2"):
        manyflux_field([0.5], [1.0], 0.3, depth=[2.0], cos_direction=[0.5])
    with refusal("azimuth holds inf"):
        manyflux_field([0.5], [1.0], 0.3, depth=[0.5], cos_direction=[0.5], azimuth=[np.inf])
    with refusal(r"the field is that of one stack; here are \(2,\)"):
        manyflux_field([[0.5], [0.6]], [1.0], 0.3, depth=[0.5], cos_direction=[0.5])
    given = {"depth": [0.5], "cos_direction": [0.5], "refractive_index": (1.5, 1.4), "streams": 8}
    with refusal("must be known, not traced"):
        jax.jit(lambda d: manyflux_field([0.5, 0.5], d, 0.3, **given).beam)(np.array([1.0, 1.0]))


@pytest.mark.parametrize(
    ("index", "lit", "directions", "streams"),
    [
        (1.5, 1.0, [1e-4, 1e-5], 4),
        # A beam that grazes, in a medium where it goes straight on.
        slow(1.0, 1e-5, [1.0], 4),
        # Just steeper than the critical angle: in the other layer this direction grazes.
        slow((1.5, 1.4), 1.0, [np.sqrt(1 - (1.4 / 1.5) ** 2) + 1e-10], 8),
    ],
)
def test_light_that_grazes_inside_is_followed(index, lit, directions, streams):
    count = np.size(index)
    doubled, exact = (
        manyflux_field(
            [0.9] * count,
            [1.0] * count,
            0.5,
            depth=[0.3],
            cos_direction=directions,
            refractive_index=index,
            cos_incidence=lit,
            streams=streams,
            solution=solution,
        )
        for solution in ("doubling", "modes")
    )
    for name in exact._fields:
        assert_allclose(getattr(doubled, name), getattr(exact, name), atol=1e-8)


INDICES = (1.6, 1.35, 1.5)
MORE = henyey_greenstein(np.array([0.6, -0.3, 0.2]), 8)


@pytest.mark.slow
def test_field_through_layers_of_different_index():
    """Outside it is what is seen there, on the ground the ground's, and at a surface inside
    Fresnel's law joins it.
    """
    stack = [0.9, 0.7, 0.95], [0.4, 1.1, 0.3], 0.5
    given: dict = {
        "phase": MORE,
        "cos_incidence": 0.7,
        "streams": 16,
        "refractive_index": INDICES,
    }
    turned = np.array([0.0, 130.0])
    seen = float(cos_refracted(0.6, 1.6))
    # Just above the first surface inside, in a direction that crosses it and in one beyond the
    # critical angle.
    steep, flat, away = 0.8, 0.3, np.nextafter(0.4, 0.0)
    across = float(np.sqrt(1 - (1.6 / 1.35) ** 2 * (1 - steep**2)))
    first = manyflux_field(
        *stack, depth=[0.0, away], cos_direction=[seen, steep, flat], azimuth=turned, **given
    )
    second = manyflux_field(*stack, depth=[0.4], cos_direction=[across], azimuth=turned, **given)
    last = manyflux_field(*stack, depth=[1.8], cos_direction=[0.9, 0.1], azimuth=turned, **given)
    check_surface(first, stack, given, turned, 1.6, 1e-10)
    assert_allclose(last.up[0], 0.5 * last.flux_down[0], atol=1e-10)
    net = first.flux_down - first.flux_up
    assert_allclose(net[1], (second.flux_down - second.flux_up)[0], atol=1e-10)
    r = np.asarray(interface_reflectance(1.6, 1.35, np.array([steep]), np.array([across])))[0]
    down, up = first.down[1, 1], first.up[1, 1]
    assert_allclose(
        second.down[0, 0], (1 - r) * (1.35 / 1.6) ** 2 * down + r * second.up[0, 0], atol=1e-8
    )
    assert_allclose(up, r * down + (1 - r) * (1.6 / 1.35) ** 2 * second.up[0, 0], atol=1e-8)
    assert_allclose(first.up[1, 2], first.down[1, 2], atol=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("thickness", "depth", "index", "rounding"),
    [
        ([0.4, 30.0], [0.0, 0.2, 5.0, 30.4], 1.5, 1e-11),
        ([0.4, 1.1, 0.3], [0.0, 0.3, 0.4, 0.9, 1.5, 1.6, 1.8], INDICES, 1e-9),
    ],
)
def test_no_flux_is_lost_without_absorption(thickness, depth, index, rounding):
    field = manyflux_field(
        np.ones(len(thickness)),
        thickness,
        0.3,
        depth=depth,
        cos_direction=[0.5],
        phase=MORE[: len(thickness)],
        streams=16,
        refractive_index=index,
    )
    net = np.asarray(field.flux_down - field.flux_up)
    assert_allclose(net, net[0], atol=rounding)
    assert_allclose(field.flux_up[-1], 0.3 * field.flux_down[-1], atol=rounding)
