"""Light between surfaces: furnaces in which nothing is lost, bounces counted, and two joined
planes.
"""

from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

import glazejax as gj
from glazejax.appearance.interreflection import all_bounces, one_bounce
from glazejax.appearance.scene.draw import gather
from glazejax.appearance.scene.draw.gather import above
from glazejax.appearance.scene.draw.render import render
from glazejax.appearance.scene.lights import ParallelLight, PointLight
from glazejax.appearance.scene.materials import Conductor, FresnelModel, Glazed, Lambert, Phong
from glazejax.appearance.scene.scene import Camera
from glazejax.appearance.scene.shapes import Plane, Sphere
from glazejax.radiative.common.fresnel import (
    conductor_reflectance,
    cook_torrance_reflectance,
    hall_extinction,
    hall_reflectance,
)

from .scenes import GRID, scene

BODY = np.linspace(0.3, 0.9, GRID.size)
INSIDE = Camera((0.5, 0.0, 0.2), (1.0, 0.3, 0.1), field_of_view=60.0)


def picture(shapes, materials, lights, camera, **options):
    small = {"width": 8, "height": 6, "antialias": 1, "gather_rays": 64}
    return render(
        scene(shapes, materials, lights, camera, **(small | options)), tolerance=1e-4
    ).radiance


@pytest.mark.parametrize("bounces", [0, 1, 2, 3])
def test_a_hollow_sphere_adds_a_power_of_its_albedo_with_each_bounce(bounces):
    lamp = PointLight((0, 0, 0), 2.0)
    made = picture([Sphere("m")], {"m": Lambert(BODY)}, [lamp], INSIDE, diffuse_bounces=bounces)
    exact = 2.0 * sum(BODY ** (k + 1) for k in range(bounces + 1))
    np.testing.assert_allclose(made, np.broadcast_to(exact, made.shape), rtol=1e-5)


def test_a_hollow_sphere_spreads_all_the_light_of_a_lamp_that_is_not_in_the_middle():
    # Every point of a sphere sends every other the same share, so a bounce adds the mean of what
    # the last one left.
    lamp = PointLight((0, 0, 0.5), 1.0)
    options: dict = {"gather_rays": 4096, "width": 3, "height": 2}
    lit = picture([Sphere("m")], {"m": Lambert(BODY)}, [lamp], INSIDE, diffuse_bounces=0, **options)
    made = picture(
        [Sphere("m")], {"m": Lambert(BODY)}, [lamp], INSIDE, diffuse_bounces=2, **options
    )
    # A point lamp of strength 1 sends 4 pi in all, over the sphere's 4 pi.
    added = BODY**2 + BODY**3
    found = (made - lit).reshape(-1, GRID.size)
    # What a point sees varies by half its mean: 4096 rays leave 1 %, and six points less.
    np.testing.assert_allclose(found, np.broadcast_to(added, found.shape), rtol=1.5e-2)
    np.testing.assert_allclose(found.mean(axis=0), added, rtol=5e-3)


@pytest.mark.parametrize(
    ("material", "off"),
    [
        (Lambert(1.0), 1e-5),
        (Phong(1.0, 0.0), 1e-5),
        # White paint without loss on a white ground: what the surface does not mirror comes back
        #     diffusely.
        (Glazed(gj.Glaze([], 1.0)), 2e-3),
        (Conductor(1e-6, 50.0), 1e-5),
    ],
    ids=["lambert", "phong", "glazed", "mirror"],
)
def test_a_white_thing_cannot_be_told_from_even_surroundings(material, off):
    sky = np.linspace(0.5, 1.0, GRID.size)
    made = picture(
        [Sphere("m")],
        {"m": material},
        [ParallelLight((0, 0, 1), 0.0)],
        Camera((0, -4, 0)),
        background=sky,
        diffuse_bounces=1,
    )
    np.testing.assert_allclose(made, np.broadcast_to(sky, made.shape), atol=off)


def test_a_white_bowl_and_its_ball_are_lost_only_in_the_last_bounce():
    # Two white things that see each other in a white room: what is missing falls with each bounce.
    shapes = [Sphere("m", (0, 0, 1.0)), Plane("m")]
    light = [ParallelLight((0, 0, -1), 0.0)]
    missing = []
    for bounces in (1, 2, 4):
        made = picture(
            shapes,
            {"m": Lambert(1.0)},
            light,
            Camera((0, -5, 1.5), (0, 0, 0.3)),
            background=1.0,
            diffuse_bounces=bounces,
        )
        assert np.all(made < 1 + 1e-5)
        missing.append(float(np.mean(1 - made)))
    assert missing[0] > 2.5 * missing[1] > 6 * missing[2] > 0


@pytest.mark.slow
@pytest.mark.parametrize(("bounces", "truth"), [(1, one_bounce), (8, all_bounces)])
def test_two_joined_planes_are_those_of_paper_b(bounces, truth):
    # A lies flat from the joint to x = 1; B rises at 60 degrees; both long enough to seem endless.
    angle, a, b = np.deg2rad(60.0), BODY, BODY[::-1]
    rise, normal = (
        np.array([np.cos(angle), 0, np.sin(angle)]),
        np.array([np.sin(angle), 0, -np.cos(angle)]),
    )
    length = 200.0
    shapes = [
        Plane("a", (0.5, 0, 0), size=(length, 1.0), up=(1, 0, 0)),
        Plane("b", tuple(0.5 * rise), tuple(normal), size=(length, 1.0), up=tuple(rise)),
    ]
    light = np.array(
        [np.cos(np.deg2rad(30)), 0, np.sin(np.deg2rad(30))]
    )  # halves the angle: neither shadows the other
    found = []
    for x in (0.25, 0.75):
        eye = np.array([x, 0, 0]) + 0.2 * light
        camera = Camera(tuple(eye), (x, 0, 0), up=(0, 1, 0), field_of_view=0.01)
        made = picture(
            shapes,
            {"a": Lambert(a), "b": Lambert(b)},
            [ParallelLight(tuple(-light), 1.0)],
            camera,
            width=1,
            height=1,
            diffuse_bounces=bounces,
            gather_rays=8192,
        )
        found.append(made[0, 0])
    exact = truth(a, b, light[2], light @ normal, 1.0, np.array([0.25, 0.75]), 60.0).a
    np.testing.assert_allclose(found, exact, atol=4e-3)


@pytest.mark.slow
def test_interpolation_is_near_gathering_everywhere(monkeypatch):
    # A floor and a wall: many pixels share the points, and still follow the shade into the corner.
    shapes = [Plane("m", size=(4, 4)), Plane("m", (0, 2, 1), (0, -1, 0), size=(4, 2))]
    light = [ParallelLight((0.2, 0.6, -1), 1.0)]
    camera = Camera((0, -4, 2), (0, 1, 0.3))
    given = (shapes, {"m": Lambert(0.8)}, light, camera)
    options: dict = {"width": 96, "height": 72, "diffuse_bounces": 1, "gather_rays": 512}
    shared = render(scene(*given, antialias=1, **options))
    assert shared.report.gathered < 0.1 * 96 * 72
    assert (
        f"1 diffuse bounce, 512 rays at {shared.report.gathered} points" in shared.report.describe()
    )
    direct = render(scene(*given, antialias=1, **(options | {"diffuse_bounces": 0}))).radiance
    # The same with a point for every pixel.
    monkeypatch.setattr(gather, "_REACH", 1e-3)
    monkeypatch.setattr(gather, "_ROUNDS", (1.0, 0.3, 0.1))
    own = render(scene(*given, antialias=1, **options))
    assert own.report.gathered > 0.9 * np.count_nonzero(direct[..., 0])
    added = own.radiance - direct
    assert added.max() > 0.1
    off = np.abs(shared.radiance - own.radiance) / added.max()
    # Pixels are 5 cm wide here: those in the corner itself cannot be right.
    assert np.mean(off) < 0.01
    assert np.quantile(off, 0.97) < 0.05


def test_directions_are_above_and_as_often_as_their_cosine():
    rng = np.random.default_rng(0)
    normal = rng.normal(size=(4, 3))
    normal = np.concatenate([normal / np.linalg.norm(normal, axis=1, keepdims=True), [[0, 0, -1]]])
    many = np.repeat(normal, 20000, axis=0)
    found = above(many, rng.random((len(many), 2)))
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0, atol=1e-12)
    cosine = np.sum(found * many, axis=1).reshape(5, -1)
    assert cosine.min() >= -1e-12
    np.testing.assert_allclose(cosine.mean(axis=1), 2 / 3, atol=0.01)  # int 2 cos^2
    np.testing.assert_allclose(found.reshape(5, -1, 3).mean(axis=1), 2 / 3 * normal, atol=0.015)


@pytest.mark.slow
@pytest.mark.usefixtures("unchecked")
def test_metals_reflect_as_the_estimate_says():
    n, k = np.linspace(0.2, 1.2, GRID.size), np.linspace(3.5, 2.4, GRID.size)
    cosine = jnp.array([1.0, 0.5, 0.1])
    c, normal = np.array(cosine)[:, None], conductor_reflectance(1.0, n, k)
    wanted: dict[FresnelModel, Any] = {
        "exact": conductor_reflectance(c, n, k),
        "hall": hall_reflectance(c, normal, hall_extinction(normal.mean())),
        "cook-torrance": cook_torrance_reflectance(c, normal),
    }
    for model, exact in wanted.items():
        metal = Conductor(n, k, fresnel=model)
        np.testing.assert_allclose(metal.mirror(cosine), exact, rtol=1e-12)
        # Bands left out do not change the average metal.
        keep = np.arange(GRID.size) % 2 == 0
        np.testing.assert_allclose(
            metal.only_bands(keep, GRID.size).mirror(cosine), exact[:, keep], rtol=1e-12
        )
    with pytest.raises(ValueError, match="fresnel 'schlick' is unknown"):
        Conductor(n, k, fresnel="schlick")  # type: ignore[arg-type]
