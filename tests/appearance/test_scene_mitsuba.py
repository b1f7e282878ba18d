"""Scenes in Mitsuba 3, where it is installed: lights that have a size, relief, noise, and which
variant is used.
"""

from dataclasses import replace

import numpy as np
import pytest
from benchmarks.render.mitsuba_compare import (
    LIMIT,
    Case,
    cases,
    differences,
    on_objects,
    ours,
    theirs,
)
from numpy.testing import assert_allclose, assert_array_equal

from glazejax.appearance.mitsuba import variants
from glazejax.appearance.scene.draw.render import render
from glazejax.appearance.scene.lights import AreaLight, ParallelLight, PointLight, lamp
from glazejax.appearance.scene.materials import Conductor, Glazed, Lambert, Material, Phong
from glazejax.appearance.scene.path.mitsuba_shapes import relief_mesh, repeats, write_ply
from glazejax.appearance.scene.path.path_trace import passes_of, path_trace
from glazejax.appearance.scene.picture import light_white
from glazejax.appearance.scene.scene import Camera, Scene
from glazejax.appearance.scene.shapes import Box, Mesh, Plane, Sphere

from ..fresh import run_python
from ..glazes import coated
from ..refusals import refusal
from ..slow import slow

WAVELENGTHS = np.arange(400.0, 701.0, 20.0)
UP = (0.0, 1.0, 0.0)
ABOVE = Camera((0.0, 0.0, 10.0), up=UP, field_of_view=1.0)
GROUND = [Plane("m", size=(4.0, 4.0), up=UP)]
GREY = {"m": Lambert(0.5)}
SUN = ParallelLight((0.0, 0.0, -1.0), 1.0)
BALL = AreaLight(Sphere("", (0.0, 0.0, 3.0), 0.3), 50.0)


@pytest.fixture
def mi():
    """Mitsuba in the fastest variant that works here, whichever another test has left."""
    found = pytest.importorskip("mitsuba", reason="Mitsuba is not installed (extra render)")
    before = found.variant()
    found.set_variant(variants.usable_variant())
    yield found
    if before is not None:
        found.set_variant(before)


def made(shapes, materials, lights, camera=ABOVE, **how):
    """A small scene, dark around."""
    return Scene(WAVELENGTHS, shapes, materials, lights, camera, **{"width": 8, "height": 8} | how)


def luminance(scene, samples=4096, **how):
    """Y of every pixel."""
    return path_trace(scene, samples=samples, **how).values[..., 1]


@pytest.mark.optimised
@pytest.mark.parametrize("name", ["diffuse", *map(slow, ("copper", "glaze", "map"))])
def test_pictures_are_those_of_the_ray_caster(name, mi):
    case = cases(32, 24)[name]
    mine, traced = ours(case, antialias=10), theirs(case, samples=1024)
    mean, bias = differences(mine, traced.values)
    assert mean < LIMIT
    assert abs(bias) < LIMIT / 2
    assert differences(mine, traced.values, on_objects(case))[0] < LIMIT


def over_a_floor(size, aside):
    """A ball over an endless, tilted floor: all lengths times `size`, and all but the floor so far
    to the side.
    """

    def place(*point):
        return size * (np.array(point) + aside * np.array([1.0, 0.0, -0.1]))

    return made(
        [Plane("m", normal=(0.1, -0.2, 1.0)), Sphere("m", place(0.0, 0.0, 0.9), 0.6 * size)],
        GREY,
        [ParallelLight((0.6, 1.0, -1.2), 0.6), PointLight(place(-2.0, -2.0, 3.5), 5.0 * size**2)],
        Camera(place(0.0, -6.0, 2.5), place(0.0, 0.0, 0.6)),
        width=24,
        height=18,
    )


def direct_light(scene):
    """How the two renderers differ."""
    case = Case(scene, max_depth=2)
    return differences(ours(case, antialias=8), theirs(case, samples=256).values)


@pytest.mark.parametrize(
    ("size", "aside"), [(1e-3, 0.0), (1.0, 0.0), (50.0, 0.0), (2000.0, 0.0), (1.0, 500.0)]
)
def test_pictures_are_the_same_in_any_unit_of_length(mi, size, aside):
    mean, bias = direct_light(over_a_floor(size, aside))
    assert mean < LIMIT
    assert abs(bias) < LIMIT / 2


@pytest.mark.slow
def test_a_map_repeats_on_an_endless_plane_and_on_a_mesh(mi):
    # Smooth and periodic, so that nothing depends on what is taken between two of them.
    u, v = np.meshgrid(np.arange(32) / 32, np.arange(32) / 32)
    depths = 1e-6 * (1.3 + np.sin(2 * np.pi * u) + 0.2 * np.cos(2 * np.pi * v))
    blue = Glazed(coated(0.8, bands=WAVELENGTHS, UltramarineBlue=1e-6), depths, gloss=False)
    corners = np.array([[-1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [1.0, 1.0, 2.0], [-1.0, 1.0, 2.0]])
    turns = np.array([[-0.5, 0.0], [1.5, 0.0], [1.5, 2.0], [-0.5, 2.0]])
    board = Mesh("m", corners, np.array([[0, 1, 2], [0, 2, 3]]), uv=turns)
    floor = Plane("m", (0.3, 40.2, 0.0), up=UP)
    sun = ParallelLight((0.3, 1.0, -1.0), 1.0)
    camera = Camera((0.0, -4.0, 2.0), (0.0, 0.0, 0.5))
    scene = made([floor, board], {"m": blue}, [sun], camera, width=32, height=24)
    assert direct_light(scene)[0] < LIMIT


@pytest.mark.parametrize(
    "grid",
    [
        np.arange(420.0, 681.0, 10.0),
        np.append(np.arange(420.0, 560.0, 10.0), np.arange(560.0, 681.0, 20.0)),
    ],
    ids=["even", "uneven"],
)
def test_white_is_white_where_the_bands_end_early(mi, grid):
    light = lamp("D65", grid)
    sun = replace(SUN, spectrum=light)
    white = Scene(grid, GROUND, {"m": Lambert(1.0)}, [sun], ABOVE, width=16, height=16)
    xyz = path_trace(white, samples=4096).values.mean(axis=(0, 1))
    assert_allclose(xyz, light_white(light, grid), atol=2e-3)


def test_a_sphere_that_shines_lights_as_its_solid_angle_says(mi):
    # A small ball straight above: irradiance / pi = L sin^2 of its half angle.
    camera = Camera((3.0, 0.0, 3.0), field_of_view=0.5)
    found = luminance(made(GROUND, GREY, [BALL], camera))
    assert_allclose(found.mean(), 0.5 * 50.0 * (0.3 / 3.0) ** 2, rtol=4e-3)


def test_a_rectangle_that_shines_is_bright_in_front_and_black_behind(mi):
    light = AreaLight(Plane("", (0.0, 0.0, 2.0), (0.0, 0.0, -1.0), (1.0, 2.0), UP), 2.0)
    below = Camera((0.0, 0.0, 0.0), (0.0, 0.0, 2.0), UP, field_of_view=2.0)
    # The ground is far away, and so as good as black.
    ground = [Plane("m", (0.0, 0.0, -1000.0), size=(0.1, 0.1))]
    assert_allclose(luminance(made(ground, GREY, [light], below), 64), 2.0, rtol=2e-2)
    assert luminance(made(ground, GREY, [light], ABOVE), 64).max() < 1e-6


def test_a_hollow_sphere_adds_a_power_of_its_albedo_with_each_bounce(mi):
    # Every point sends every other the same share: all bounces are a geometric series.
    lamp = PointLight((0.0, 0.0, 0.0), 1.0)
    camera = Camera((0.5, 0.0, 0.0), (0.0, 0.0, -1.0), field_of_view=30.0)
    scene = made([Sphere("m")], {"m": Lambert(0.6)}, [lamp], camera)
    everything, direct = luminance(scene, 1024).mean(), luminance(scene, 64, max_depth=2).mean()
    assert everything == pytest.approx(direct / (1.0 - 0.6), rel=0.01)


@pytest.mark.parametrize("tilt", [0.0, 0.5])
def test_a_relief_tilts_what_the_lamp_lights(mi, tilt):
    # Heights that rise evenly upwards in the picture: a tilted plane, whose cosine to the lamp is
    # known.
    rows = np.linspace(1.0, -1.0, 5)[:, None]
    relief = tilt * np.broadcast_to(rows, (5, 4))
    towards = np.array([0.0, 0.6, 0.8])
    light = ParallelLight(-towards, 1.0)
    plane = Plane("m", size=(2.0, 2.0), up=UP, relief=relief)
    found = luminance(made([plane], GREY, [light]), 64)
    normal = np.array([0.0, -tilt, 1.0]) / np.hypot(tilt, 1.0)
    assert_allclose(found.mean(), 0.5 * normal @ towards, rtol=4e-3)
    assert_allclose(found, 0.5 * normal @ towards, rtol=3e-2)


def test_a_relief_stands_out_by_its_heights(mi):
    # Light along the surface meets a raised half from the side, and its shadow falls beyond.
    relief = np.zeros((40, 40))
    relief[:, :20] = 0.2
    light = ParallelLight((1.0, 0.0, -0.5), 1.0)
    plane = Plane("m", size=(2.0, 2.0), up=UP, relief=relief)
    camera = Camera((0.0, 0.0, 20.0), up=UP, field_of_view=np.rad2deg(2 * np.arctan(0.05)))
    found = luminance(made([plane], GREY, [light], camera, width=20, height=20), 64, max_depth=2)
    row = found[10]
    lit = 0.5 * 0.5 / np.hypot(1.0, 0.5)
    assert_allclose(row[:9], lit, rtol=1e-2)
    # The shadow is 0.4 long: two pixels of ten a side each 0.1.
    assert (row[11:13] < 0.02 * lit).all()
    assert_allclose(row[15:], lit, rtol=1e-2)


def test_noise_is_what_seeds_differ_by(mi):
    light = AreaLight(Sphere("", (1.0, 0.5, 1.0), 0.4), 5.0)
    shapes = [*GROUND, Sphere("m", (0.3, 0.0, 0.2), 0.2)]
    camera = replace(ABOVE, field_of_view=8.0)
    scene = made(shapes, {"m": Lambert(0.6)}, [light], camera, width=16, height=16)
    found = [path_trace(scene, samples=64, seed=seed) for seed in range(8)]
    pictures = np.stack([f.values[..., 1] for f in found])
    spread = np.sqrt(pictures.var(axis=0, ddof=1).mean()) / pictures.mean()
    assert 0.6 < np.mean([f.report.pixel_noise for f in found]) / spread < 1.6
    assert_array_equal(path_trace(scene, samples=64, seed=3).values, found[3].values)
    report = found[0].report
    words = report.describe()
    assert f"{report.samples} of each pixel" in words
    assert "standard error" in words
    assert report.samples >= 64


def test_passes_are_whole_squares_and_enough():
    for samples in (1, 2, 3, 16, 100, 256, 1000):
        each, passes = passes_of(samples, 640 * 480)
        assert round(np.sqrt(each)) ** 2 == each
        assert passes >= 2
        assert each * passes >= samples
    # A large picture goes through in more passes, not in larger ones.
    assert passes_of(1024, 10**7) == (1, 1024)


def test_an_interrupted_picture_is_the_mean_of_its_passes(mi):
    scene = made(GROUND, GREY, [SUN])

    def stop(done, total, words):
        if done == total / 2:
            raise KeyboardInterrupt

    found = path_trace(scene, samples=64, progress=stop)
    assert found.done == 0.5
    off = found.values[..., 1] / 0.5 - 1.0
    # Random numbers differ from variant to variant; the noise that it tells says how far pixels may
    # be off.
    assert found.report.pixel_noise < 5e-3
    assert np.abs(off).max() < 5.0 * found.report.pixel_noise
    assert abs(off.mean()) < 5.0 * found.report.pixel_noise / np.sqrt(off.size)


def test_a_picture_interrupted_before_its_first_pass_is_empty(mi):
    def stop(done, total, words):
        if words == "following paths" and done == 0:
            raise KeyboardInterrupt

    found = path_trace(made(GROUND, GREY, [SUN], width=2, height=2), samples=4, progress=stop)
    assert found.done == 0
    assert np.isnan(found.values).all()


def test_a_users_own_variant_stays(mi):
    scene = made(GROUND, GREY, [SUN], width=2, height=2)
    usable = variants.usable_variant()
    for users, drawn_in in (("scalar_rgb", usable), ("scalar_spectral", "scalar_spectral")):
        mi.set_variant(users)
        assert path_trace(scene, samples=4).report.variant == drawn_in
        assert mi.variant() == users


def test_a_variant_that_aborts_is_not_taken(mi, monkeypatch):
    variants.usable_variant.cache_clear()
    variants.works.cache_clear()
    monkeypatch.setattr(variants, "_PROBE", "import os; os.abort()")
    try:
        assert variants.usable_variant() == "scalar_spectral"
        assert not variants.works("llvm_ad_spectral")
        # A user's own choice is refused before its first picture, where LLVM is one of those.
        monkeypatch.setattr("drjit.detail.llvm_version", lambda: (15, 0, 6))
        with refusal(r"with LLVM 15 .* ends the process here: install LLVM"):
            variants.check_llvm("llvm_ad_spectral")
        monkeypatch.setattr("drjit.detail.llvm_version", lambda: (19, 1, 7))
        variants.check_llvm("llvm_ad_spectral")
        variants.check_llvm("scalar_spectral")
        variants.check_llvm(None)
    finally:
        variants.usable_variant.cache_clear()
        variants.works.cache_clear()
    assert not variants.is_spectral("llvm_ad_rgb")
    assert not variants.is_spectral("scalar_spectral_polarized")
    assert not variants.is_spectral(None)


def test_materials_without_a_counterpart_become_the_nearest_and_that_is_said(mi):
    materials = {
        "a": Phong(0.5),
        "b": Conductor(0.2, 3.0, 20.0),
        "c": Conductor(0.2, 3.0, 0.0, "hall"),
    }
    shapes = [Sphere(name, (k, 0.0, 0.0), 0.4) for k, name in enumerate(materials)]
    notes = path_trace(made(shapes, materials, [SUN]), samples=4).report.notes
    assert len(notes) == 3
    for words in ("Phong", "rough metal", "'hall'"):
        assert words in " ".join(notes)


def rough_glaze(roughness):
    return Glazed(coated(0.8, bands=WAVELENGTHS, ZincWhite=1e-5), roughness=roughness)


def square(relief=None):
    return Plane("m", size=(1.0, 1.0), relief=relief)


SQUARE = made([square()], GREY, [SUN])


def test_the_ray_caster_says_what_it_cannot_draw():
    for change, words in (
        ({"lights": [BALL]}, "area lights"),
        ({"shapes": [square(np.zeros((3, 3)))]}, "relief"),
        ({"materials": {"m": rough_glaze(0.1)}}, "glazes with a rough surface"),
        ({"diffuse_bounces": 2}, r"light between surfaces \(diffuse_bounces = 2\)"),
    ):
        with refusal(
            rf"draw {words}: use path_trace, or glazejax scene --renderer mitsuba "
            r"\(pip install 'glazejax\[render\]'\)"
        ):
            render(replace(SQUARE, **change))


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (
            lambda: square(np.zeros(5)),
            r"a relief must be a map of heights \(h, w\), at least 2 x 2, not of shape \(5,\)",
        ),
        (lambda: square(np.zeros((1, 5))), r"at least 2 x 2, not of shape \(1, 5\)"),
        (lambda: square(np.full((3, 3), np.nan)), "finite heights"),
        (lambda: square(np.zeros((5000, 5000), bool)), "5000 x 5000 heights is too fine"),
        (lambda: Plane("m", relief=np.zeros((2, 2))), "a plane with a relief needs a size"),
        (lambda: AreaLight(Plane(""), 1.0), "an area light needs a size"),
        (lambda: rough_glaze(np.nan), r"roughness must be 0 \(smooth\) to 1, GGX's alpha, not"),
        (lambda: AreaLight(Box(""), 1.0), "a rectangle or a sphere, not a Box"),
        (lambda: AreaLight(square(np.zeros((2, 2))), 1.0), "leave its relief out"),
    ],
)
def test_what_is_no_relief_and_no_area_light(make, words):
    with refusal(words):
        make()


def test_samples_and_a_tolerance_out_of_range_are_refused():
    for samples in (0, 2**21, True):
        with refusal("samples must be a whole number from 1 to"):
            path_trace(SQUARE, samples=samples)
    for tolerance in (0.0, 1.0, np.nan):
        with refusal("tolerance is .*; it must be between 0 and 1"):
            render(SQUARE, tolerance=tolerance)


def test_meshes_keep_their_coordinates(tmp_path):
    relief = np.arange(12.0).reshape(3, 4)
    mesh = relief_mesh(Plane("m", size=(4.0, 2.0), up=UP, relief=relief))
    vertices = mesh.vertices.reshape(3, 4, 3)
    # The first row is on top, u and v run right and up.
    assert_allclose(vertices[0, :, 1], 1.0)
    assert_allclose(vertices[:, 0, 0], -2.0)
    assert_allclose(vertices[..., 2], relief)
    assert mesh.uv is not None
    assert_allclose(mesh.uv.reshape(3, 4, 2)[0, -1], [1.0, 1.0])
    points = mesh.vertices[mesh.faces]
    assert (np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])[:, 2] > 0).all()
    assert write_ply(tmp_path / "m.ply", mesh)["type"] == "ply"
    again = pytest.importorskip("trimesh").load(tmp_path / "m.ply", process=False)
    assert_allclose(again.vertices, mesh.vertices, rtol=1e-6)
    assert_array_equal(again.faces, mesh.faces)


def test_reading_scenes_needs_no_mitsuba():
    run_python("""
import sys, glazejax.appearance.scene.path.path_trace, glazejax.appearance.scene.file
assert 'mitsuba' not in sys.modules
""")


class Velvet(Material):
    """A material of the user's own."""

    def spectra(self):
        return {}


def test_which_shapes_repeat_a_map():
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]])
    mesh = Mesh("m", np.eye(3), np.array([[0, 1, 2]]), uv=corners)
    assert repeats(Plane("m"))
    assert repeats(replace(mesh, uv=2.0 * corners))
    assert repeats(replace(mesh, uv=corners - 1.0))
    for once in (mesh, replace(mesh, uv=(1.0 + 1e-9) * corners), square(), Sphere("m"), Box("m")):
        assert not repeats(once)


def test_what_mitsuba_has_no_counterpart_of(mi):
    scene = cases(8, 6)["diffuse"].scene
    own = replace(scene, materials={**scene.materials, "ball": Velvet()})
    with refusal("'ball': Mitsuba has no counterpart of Velvet"):
        path_trace(own, samples=4)
