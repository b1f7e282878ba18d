"""The ray caster against closed forms: single rays, a Lambert sphere, shadow edges, mirrors in
mirrors, meshes.
"""

import importlib.util
import sys
from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest
import trimesh
from numpy.testing import assert_allclose, assert_array_equal

from glazejax.appearance.scene.draw.intersect import make_geometry, nearest, surface
from glazejax.appearance.scene.draw.rays import lamps, trace
from glazejax.appearance.scene.draw.render import render
from glazejax.appearance.scene.lights import ParallelLight, PointLight
from glazejax.appearance.scene.materials import Conductor, Lambert
from glazejax.appearance.scene.scene import Camera
from glazejax.appearance.scene.shapes import Box, Mesh, Plane, Sphere, rotation
from glazejax.radiative.common.fresnel import conductor_reflectance

from ..refusals import refusal
from .scenes import GRID, flat, rising, scene, unit

MATERIALS = {"m": 0}


def cast(geometry, origin, direction):
    return nearest(geometry, jnp.asarray(origin), jnp.asarray(direction))


def hit_of(shape, origin, direction):
    geometry = make_geometry([shape], MATERIALS)
    rays = jnp.asarray([origin], float), jnp.asarray(unit([direction]))
    hit = nearest(geometry, *rays)
    return hit, surface(geometry, hit, *rays)


@pytest.mark.parametrize(
    ("shape", "origin", "direction", "distance", "normal", "uv"),
    [
        (Sphere("m", (0, 0, 5), 2.0), (0, 0, 0), (0, 0, 1), 3.0, (0, 0, -1), (0.5, 0.0)),
        (Sphere("m", (1, 0, 0)), (1, 0, 0), (1, 0, 0), 1.0, (-1, 0, 0), (0.5, 0.5)),
        (Plane("m", (0, 0, -1)), (0, 0, 1), (0, 3, -4), 2.5, (0, 0, 1), (0.0, 1.5)),
        (
            Plane("m", (0, 2, 0), (0, -1, 0), (4, 2)),
            (1, 0, 0.5),
            (0, 1, 0),
            2.0,
            (0, -1, 0),
            (0.75, 0.75),
        ),
        (Box("m", size=(2, 4, 6)), (5, 1, 0), (-1, 0, 0), 4.0, (1, 0, 0), (0.75, 0.5)),
        (
            Box("m", size=(2, 2, 2), rotation=(0, 0, 45)),
            (5, 0, 0),
            (-1, 0, 0),
            5 - np.sqrt(2),
            None,
            None,
        ),
        (Box("m", size=(2, 4, 6)), (0, 0, 0), (0, 0, 1), 3.0, (0, 0, -1), (0.5, 0.5)),
    ],
)
def test_single_rays(shape, origin, direction, distance, normal, uv):
    hit, found = hit_of(shape, origin, direction)
    assert_allclose(hit.distance, [distance], rtol=1e-12)
    if normal is not None:
        assert_allclose(found.normal, [normal], atol=1e-12)
        assert_allclose(found.uv, [uv], atol=1e-12)


def test_missed_shapes():
    for shape in (Sphere("m", (0, 0, 5)), Plane("m", (0, 0, 5), size=(1, 1)), Box("m", (0, 0, 5))):
        hit, _ = hit_of(shape, (2, 0, 0), (0, 0, 1))
        assert np.isinf(hit.distance[0])
        assert hit.shape[0] == -1


def test_rotation_turns_as_it_says():
    x, y, z = np.eye(3)
    for angles, before, after in (
        ((90, 0, 0), y, z),
        ((0, 90, 0), z, x),
        ((0, 0, 90), x, y),
        ((90, 0, 90), y, z),
    ):
        assert_allclose(rotation(angles) @ before, after, atol=1e-15)


BALL = trimesh.creation.icosphere(subdivisions=4)
MESH = Mesh("m", BALL.vertices, BALL.faces)


def test_rays_meet_the_point_of_a_mesh_that_they_aim_at():
    """On each triangle of a ball, seen aslant from outside."""
    rng = np.random.default_rng(0)
    shares = rng.dirichlet(np.ones(3), len(BALL.faces))
    aim = np.sum(shares[..., None] * BALL.vertices[BALL.faces], axis=1)
    away = unit(BALL.face_normals + 0.5 * rng.uniform(-1, 1, aim.shape))
    hit = cast(make_geometry([MESH], MATERIALS), aim + 3.0 * away, -away)
    assert_allclose(hit.distance, 3.0, rtol=1e-9)


def test_rays_from_a_mesh_do_not_meet_where_they_start():
    """Embree counts in single precision: whether a ray leaves its triangle is not left to it."""
    for size, far in ((1.0, 0.0), (1e-3, 0.0), (30.0, 1000.0)):
        mesh = Mesh("m", size * BALL.vertices + far, BALL.faces)
        geometry = make_geometry([mesh], MATERIALS)
        middle = mesh.vertices[mesh.faces].mean(axis=1)
        outward = BALL.face_normals
        across = unit(np.cross(outward, [0.3, 0.5, 0.8]))
        off = geometry.clearance * outward
        for slope in (1.0, 1e-2, 1e-4):
            away = unit(across + slope * outward)
            assert np.all(cast(geometry, middle + off, away).shape == -1)
        # Straight through, to the other side of the ball.
        inward = cast(geometry, middle - off, -outward)
        assert np.all(inward.shape == 0)
        assert_allclose(inward.distance, 2 * size, rtol=0.02)


def test_triangles_that_touch_leave_no_gap_and_edges_seen_end_on_do_no_harm():
    cube = trimesh.creation.box((2, 2, 2))
    geometry = make_geometry([Mesh("m", cube.vertices, cube.faces)], MATERIALS)
    # Along the diagonal that two triangles share, through a corner, and past the cube in the plane
    # of a face.
    origin = [[5.0, y, y] for y in np.linspace(-0.99, 0.99, 23)] + [[5.0, 1.0 + 1e-5, 0.0]]
    hit = cast(geometry, origin, [[-1.0, 0.0, 0.0]] * 24)
    assert_allclose(hit.distance, [4.0] * 23 + [np.inf], rtol=1e-12)


def test_a_mesh_without_trimesh_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "trimesh", None)
    with refusal(r'pip install "glazejax\[scene\]"'):
        make_geometry([MESH], MATERIALS)


@pytest.mark.skipif(
    importlib.util.find_spec("rtree") is not None, reason="trimesh can cast rays without Embree"
)
def test_a_mesh_without_an_engine_says_what_to_install(monkeypatch):
    monkeypatch.setattr(trimesh.ray, "has_embree", False)
    with refusal(r'embreex.*pip install "glazejax\[scene\]"'):
        make_geometry([MESH], MATERIALS)


def test_smooth_normals_are_those_of_a_sphere():
    mesh = Mesh("m", BALL.vertices, BALL.faces, BALL.vertices)
    _, found = hit_of(mesh, (0.3, -5, 0.4), (0, 1, 0))
    exact = np.array([0.3, -np.sqrt(1 - 0.25), 0.4])
    assert_allclose(found.normal[0], exact, atol=3e-3)
    assert abs(found.face[0] @ exact) < 1


def test_lambert_sphere_is_the_cosine():
    spectrum = rising(0.2, 1.0)
    light = ParallelLight((0.3, 1.0, -0.5), spectrum)
    camera = Camera((0, -5, 0), field_of_view=30)
    made = scene([Sphere("m")], {"m": Lambert(0.6)}, [light], camera, background=0.125, antialias=1)
    picture = render(made).radiance
    across, down = np.meshgrid(np.arange(32) + 0.5, np.arange(24) + 0.5)
    origin, direction = made.rays(across.ravel(), down.ravel())
    along = -np.sum(origin * direction, axis=1)
    inside = 1 - np.sum((origin + along[:, None] * direction) ** 2, axis=1)
    normal = origin + (along - np.sqrt(np.maximum(inside, 0)))[:, None] * direction
    lit = np.maximum(-normal @ unit(light.direction), 0)
    exact = np.where(inside[:, None] > 0, 0.6 * lit[:, None] * spectrum, 0.125)
    assert_allclose(picture.reshape(-1, GRID.size), exact, atol=1e-6)


def test_shadow_edge_of_a_rectangle_is_where_it_falls():
    # A screen of 1 x 1 at height 1 under vertical light; a point light at height 2 doubles the
    # shadow.
    camera = Camera((0, 0, 0.9), up=(0, 1, 0), field_of_view=150)
    shapes = [Plane("m"), Plane("m", (0, 0, 1), size=(1, 1), up=(0, 1, 0))]
    for light, half in ((ParallelLight((0, 0, -1), 1.0), 0.5), (PointLight((0, 0, 2), 1.0), 1.0)):
        made = scene(shapes, {"m": Lambert(1.0)}, [light], camera, width=300, height=2, antialias=1)
        lit = render(made).radiance[0, :, 0] > 0
        x = np.tan(np.deg2rad(75)) * 0.9 * (2 * (np.arange(300) + 0.5) / 300 - 1)
        assert_array_equal(lit, np.abs(x) > half)


def test_point_light_falls_with_the_square_of_the_distance():
    camera = Camera((0, 0, 1), up=(0, 1, 0), field_of_view=1)
    made = render(flat(Lambert(1.0), PointLight((0, 3, 4), 2.0), camera)).radiance[0, 0, 0]
    # Distance 5, cosine 4/5.
    assert_allclose(made, 2.0 * 0.8 / 25, rtol=1e-4)


def test_mirror_of_mirror():
    # Two polished metals face each other at 45 degrees; a ray meets both, then a lit wall.
    n, k = rising(0.2, 1.0), rising(2.0, 4.0)
    wall = rising(0.3, 0.9)
    shapes = [
        Plane("metal", normal=(-1, 0, 1), size=(1, 1), up=(0, 1, 0)),
        Plane("metal", (0, 0, 2), (-1, 0, -1), (1, 1), (0, 1, 0)),
        Plane("wall", (-5, 0, 2), (1, 0, 0), (1, 1)),
    ]
    # From the left: at the first metal upwards, at the second back to the left.
    camera = Camera((-3, 0, 0), field_of_view=0.5)
    # Past the second metal, not through it.
    light = ParallelLight((-1, 1, 0), 1.0)
    materials = {"metal": Conductor(n, k), "wall": Lambert(wall)}
    made = scene(shapes, materials, [light], camera, width=1, height=1, antialias=1)
    once = conductor_reflectance(np.sqrt(0.5), n, k)
    assert_allclose(render(made).radiance[0, 0], once**2 * wall * np.sqrt(0.5), rtol=1e-6)
    assert_allclose(render(replace(made, bounces=1)).radiance[0, 0], 0.0, atol=1e-12)


def test_rays_that_carry_little_are_not_followed():
    made = scene(
        [Sphere("m")], {"m": Lambert(1.0)}, [ParallelLight((0, 1, 0), 1.0)], Camera((0, -4, 0))
    )
    rays = made.rays(np.array([16.0]), np.array([12.0]))
    arguments = (make_geometry(made.shapes, made.materials), lamps(made.lights), *rays)
    for share, levels in ((0.01, 2), (1e-4, 1)):

        def reflects(number, cosines, share=share):
            return share + 0 * cosines

        assert len(trace(*arguments, reflects=reflects, most_bounces=3)) == levels
