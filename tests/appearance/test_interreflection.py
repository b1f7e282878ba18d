"""Two joined planes: the configuration factor, one bounce, all bounces."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

from glazejax import cie
from glazejax.appearance.interreflection import all_bounces, configuration_factor, one_bounce

from ..checks import check_slopes
from ..refusals import refusal
from ..slow import slow
from .test_interfaces import GRID, chromaticity

POSITIONS = np.linspace(0.0, 1.0, 41)
# Blue-green above, yellow below, as in paper B, figure 15.
ABOVE = 0.05 + 0.5 * np.exp(-(((GRID - 500) / 45) ** 2))
BELOW = 0.06 + 0.7 / (1 + np.exp((520 - GRID) / 10))


@pytest.mark.parametrize("angle", [10.0, 30.0, 90.0, 150.0])
def test_configuration_factor_is_what_a_point_sees(angle):
    """Against a sum over the directions of a half circle: cosine-weighted, in a plane across the
    edge.
    """
    gamma = np.deg2rad(angle)
    # An even angle phi in the plane across an infinitely long edge carries the weight cos(phi)/2.
    phi = (np.arange(200_000) + 0.5) / 200_000 * np.pi - np.pi / 2
    weight = np.cos(phi) / 2 * (np.pi / 200_000)
    for place in (0.05, 0.4, 1.0, 2.0):
        # A ray from (p, 0), towards (-sin phi, cos phi), meets the line from the edge under gamma
        # at distance t.
        sine = np.sin(gamma) * np.sin(phi) + np.cos(gamma) * np.cos(phi)
        with np.errstate(divide="ignore"):
            meets = place * np.cos(phi) / sine  # law of sines
        seen = (sine > 0) & (meets > 0) & (meets <= 1.0)
        assert configuration_factor(place, angle) == pytest.approx(np.sum(weight[seen]), abs=2e-5)


@pytest.mark.parametrize("bounces", [one_bounce, all_bounces])
def test_colours_move_to_the_product_towards_the_joint(bounces):
    """Paper B, section 6.3 and figure 16: gamma = 30 degrees, sunlight."""
    sunlight = cie.illuminants()["D55"]
    lamp = np.interp(GRID, sunlight.wavelengths, sunlight.values)
    planes = bounces(ABOVE, BELOW, 0.6, 0.8, lamp, POSITIONS, 30.0)
    product = chromaticity(ABOVE * BELOW * lamp, "E")
    for plane, body in ((planes.a, ABOVE), (planes.b, BELOW)):
        found = chromaticity(plane, "E")
        distance = np.linalg.norm(found - product, axis=1)
        assert np.all(np.diff(distance) > 0)  # nearer to the joint, nearer to the product
        if bounces is one_bounce:
            own = chromaticity(body * lamp, "E")
            along = product - own
            share = (found - own) @ along / (along @ along)
            assert_allclose(found, own + share[:, None] * along, atol=1e-12)
            assert np.all(np.diff(share) < 0)


def test_one_bounce_as_printed():
    found = one_bounce([0.3], [0.7], 0.6, 0.8, 2.0, 0.25, 30.0)
    alpha = float(configuration_factor(0.25, 30.0))
    assert found.a[0] == pytest.approx(0.3 * 0.6 * 2 + alpha * 0.3 * 0.7 * 0.8 * 2, rel=1e-14)
    assert found.b[0] == pytest.approx(0.7 * 0.8 * 2 + alpha * 0.7 * 0.3 * 0.6 * 2, rel=1e-14)


@pytest.mark.parametrize("angle", [slow(30.0), 60.0, 120.0])
def test_all_bounces_end_where_they_must(angle):
    """At the joint the light is a geometric series; black walls send nothing back."""
    a, b, lit_a, lit_b = 0.9, 0.8, 0.7, 0.4
    found = all_bounces([a], [b], lit_a, lit_b, 1.0, POSITIONS, angle)
    f = (1 + np.cos(np.deg2rad(angle))) / 2
    joint = (a * lit_a + a * f * b * lit_b) / (1 - a * b * f**2)
    assert found.a[0, 0] == pytest.approx(joint, rel=2e-4)
    black = all_bounces([a], [0.0], lit_a, lit_b, 1.0, POSITIONS, angle)
    assert_allclose(black.a, a * lit_a, rtol=1e-12)
    assert_allclose(black.b, 0.0, atol=1e-15)


def test_all_bounces_against_following_them_one_by_one():
    """Neumann's series on strips of its own, with printed configuration factors, no radiosity."""
    count, a, b, lit_a, lit_b = 600, 0.7, 0.6, 0.7, 0.4
    edges = np.linspace(0, 1, count + 1) ** 2
    places = 0.5 * (edges[1:] + edges[:-1])
    # Share of a point's view that one strip fills: the factor of a plane that ends at q is that of
    # P = p/q.
    to_edge = np.asarray(configuration_factor(places[:, None] / edges[1:], 60.0))
    to_edge = np.concatenate([np.zeros((count, 1)), to_edge], axis=1)
    kernel = np.diff(to_edge, axis=1)
    on_a, on_b = np.full(count, a * lit_a), np.full(count, b * lit_b)
    for _ in range(60):
        on_a, on_b = a * lit_a + a * kernel @ on_b, b * lit_b + b * kernel @ on_a
    found = all_bounces([a], [b], lit_a, lit_b, 1.0, places[::20], 60.0)
    assert_allclose(found.a[:, 0], on_a[::20], atol=2e-4)
    assert_allclose(found.b[:, 0], on_b[::20], atol=2e-4)


def test_slopes():
    def light(x):
        planes = all_bounces(x[:2], x[2:4], x[4], x[5], 1.0, np.array([0.0, 0.3]), 40.0)
        return jnp.sum(planes.a) + 2 * jnp.sum(planes.b)

    x = jnp.array([0.3, 0.8, 0.6, 0.2, 0.5, 0.9])
    check_slopes(jax.jit(light), (x,), eps=1e-6, rtol=1e-6, atol=1e-9)


def test_what_is_refused():
    with refusal("angle between the planes is 180"):
        configuration_factor(0.5, 180.0)
    with refusal(r"position is -0\.1"):
        one_bounce([0.1], [0.1], 1.0, 1.0, 1.0, -0.1, 30.0)
    for bounces in (one_bounce, all_bounces):
        with refusal(r"body_b holds 50\.0.*not percent"):
            bounces([0.5], [50.0], 1.0, 1.0, 1.0, [0.5], 30.0)
        with refusal(r"cos_light_a holds 45\.0.*not an angle"):
            bounces([0.5], [0.5], 45.0, 1.0, 1.0, [0.5], 30.0)
    with refusal("strips is 1"):
        all_bounces([0.1], [0.1], 1.0, 1.0, 1.0, 0.5, 30.0, strips=1)
