"""Pictures of scenes: glazes as materials, what is left out, gradients, lamps, and files of
pictures.
"""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from glazejax import Bidirectional, Glaze, Layer, colour, reflectance
from glazejax.appearance.scene.draw.intersect import make_geometry
from glazejax.appearance.scene.draw.rays import lamps, trace
from glazejax.appearance.scene.draw.render import _Work, render
from glazejax.appearance.scene.draw.shade import radiance, sample_map
from glazejax.appearance.scene.lights import (
    ParallelLight,
    PointLight,
    lamp,
    lamp_on_bands,
    measured_lamp,
)
from glazejax.appearance.scene.materials import Conductor, Glazed, Lambert, Phong
from glazejax.appearance.scene.picture import (
    light_white,
    picture_xyz,
    save_png,
    save_spectral,
    screen_picture,
)
from glazejax.appearance.scene.scene import Camera, Scene
from glazejax.appearance.scene.shapes import Box, Mesh, Plane, Sphere
from glazejax.progress import no_progress
from glazejax.radiative.common.fresnel import conductor_reflectance, dielectric_reflectance

from ..checks import check_slopes
from ..glazes import coated
from ..refusals import refusal
from ..slow import slow
from .scenes import GRID, blue_glaze, flat, paint, rising, scene, unit

WHITE = np.array([0.95, 1.0, 1.09])


def straight_from(*place):
    """A camera that looks to the origin, along one line."""
    return Camera(place, up=(0, 1, 0), field_of_view=0.01)


def forward():
    """A glaze that scatters forwards, which tables of angles cannot hold."""
    return Glaze([Layer(paint("UltramarineBlue"), 3e-6, phase=[1.0, 0.5])], 0.8)


@pytest.mark.parametrize(("incidence", "viewing"), [(60, 30), slow(0, 45)])
def test_a_flat_glaze_is_the_solver_at_the_angles_of_the_scene(incidence, viewing):
    a, b = np.deg2rad([incidence, viewing])
    light = ParallelLight((np.sin(a), 0, -np.cos(a)), rising(0.5, 1.0))
    camera = straight_from(-np.sin(b), 0, np.cos(b))
    glaze = blue_glaze()
    made = render(flat(Glazed(glaze, gloss=False), light, camera), tolerance=1e-5).radiance[0, 0]
    exact = reflectance(glaze, Bidirectional(incidence, viewing)) * np.cos(a) * light.spectrum
    assert_allclose(made, exact, atol=1e-5)


def test_highlights_are_where_the_vectors_say():
    # One pixel of a plane, with the paper's vectors worked out one by one.
    light = ParallelLight((0.5, 0.3, -1.0), rising(0.5, 1.0))
    camera = straight_from(0.4, 0.5, 1.0)
    normal = np.array([0.0, 0.0, 1.0])
    towards, view = unit([[-0.5, -0.3, 1.0], [0.4, 0.5, 1.0]])
    half = unit(towards + view)
    body = rising(0.2, 0.6)
    mirrored = 2 * (normal @ view) * normal - view
    shiny = (body * (normal @ towards) + 0.7 * (mirrored @ towards) ** 8) * light.spectrum
    made = render(flat(Phong(body, 0.7, 8.0), light, camera)).radiance[0, 0]
    assert_allclose(made, shiny, rtol=1e-6)
    facing = np.exp(-np.log(2) * (np.arccos(half @ normal) / np.deg2rad(25)) ** 2)
    hidden = min(1, *(2 * (normal @ half) * (normal @ x) / (view @ half) for x in (view, towards)))
    fresnel = conductor_reflectance(view @ half, 0.3, 3.0)
    rough = facing * hidden * fresnel / (normal @ view) * light.spectrum
    made = render(flat(Conductor(0.3, 3.0, 25.0), light, camera)).radiance[0, 0]
    assert_allclose(made, rough, rtol=1e-6)


def test_gloss_adds_the_mirrored_surroundings():
    background = rising(0.2, 0.9)
    camera = straight_from(-1, 0, 1)
    light = ParallelLight((0, 0, -1), 1.0)
    glossy, dull = (
        render(flat(Glazed(blue_glaze(), gloss=gloss), light, camera, background=background))
        for gloss in (True, False)
    )
    added = (glossy.radiance - dull.radiance)[0, 0]
    assert_allclose(added, dielectric_reflectance(np.sqrt(0.5), 1.5) * background, rtol=1e-6)


def test_a_thickness_map_is_where_it_belongs():
    # Four quarters, seen straight from above: the first row of the map is on top, its first column
    # left.
    depths = np.array([[0.0, 1e-6], [3e-6, 8e-6]])
    glaze = coated(0.8, bands=GRID, UltramarineBlue=1e-6)
    camera = Camera((0, 0, 10), up=(0, 1, 0), field_of_view=np.rad2deg(2 * np.arctan(0.1)))
    light = ParallelLight((1, 0, -1), 1.0)
    material = Glazed(glaze, jnp.asarray(np.kron(depths, np.ones((8, 8)))), gloss=False)
    square = Plane("m", size=(2, 2), up=(0, 1, 0))
    made = scene([square], {"m": material}, [light], camera, width=4, height=4, antialias=1)
    picture = render(made, tolerance=1e-5).radiance
    down, across = np.meshgrid(range(4), range(4), indexing="ij")
    viewing = np.rad2deg(np.arctan(np.hypot(0.5 * across - 0.75, 0.75 - 0.5 * down) / 10))
    even = coated(0.8, bands=GRID, UltramarineBlue=depths[down // 2, across // 2])
    exact = reflectance(even, Bidirectional(45.0, viewing)) * np.sqrt(0.5)
    assert_allclose(picture, exact, atol=2e-5)


def test_maps_are_bilinear_between_the_middles_of_pixels():
    values = jnp.array([[0.0, 1.0], [2.0, 4.0]])
    uv = jnp.array(
        [[0.25, 0.75], [0.75, 0.25], [0.5, 0.5], [0.0, 1.0], [1.0, 0.0], [1.25, 0.75], [0.5, 0.75]]
    )
    assert_allclose(sample_map(values, uv), [0, 4, 1.75, 0, 4, 0, 0.5], atol=1e-12)


def still_life(**options):
    light = rising(0.5, 1.0)
    materials = {
        "floor": Lambert(0.5),
        "blue": Glazed(blue_glaze()),
        "shiny": Phong(0.3 * light, 0.4, 30.0),
        "metal": Conductor(0.3, 3.0),
        "rough": Conductor(0.3, 3.0, 15.0),
        "unseen": Glazed(blue_glaze(1e-6)),
    }
    shapes = [
        Plane("floor"),
        Sphere("blue", (-1, 0, 0.6), 0.6),
        Box("shiny", (0.9, 0.3, 0.4), (0.8, 0.8, 0.8), (0, 0, 30)),
        Sphere("metal", (0.1, -0.6, 0.3), 0.3),
        Sphere("rough", (0.9, -0.9, 0.25), 0.25),
        Sphere("unseen", (0, -20, 0.5), 0.5),
    ]
    lights = [ParallelLight((0.5, 1, -1), light), PointLight((-2, -2, 3), 4 * light[::-1])]
    camera = Camera((0, -4, 2), (0, 0, 0.4))
    return scene(
        shapes, materials, lights, camera, **({"width": 40, "height": 30, "antialias": 3} | options)
    )


@pytest.fixture(scope="module")
def rendered():
    return render(still_life(background=0.3))


@pytest.mark.slow
def test_adaptive_rays_are_close_to_many_rays_everywhere(rendered):
    few, many = rendered, render(still_life(background=0.3), adaptive=False)
    difference = np.abs(few.radiance - many.radiance).mean(axis=-1)
    assert difference.mean() < 0.003 * many.radiance.mean()
    assert difference.max() < 0.05
    assert few.report.rays < 0.75 * many.report.rays


@pytest.mark.slow
def test_only_what_is_in_view_is_prepared(rendered):
    made, report = still_life(), rendered.report
    # The sphere behind the camera is seen by no mirror either, being small; then its material is
    # not prepared.
    alone = render(replace(made, shapes=[made.shapes[0], made.shapes[5]])).report
    assert alone.materials == 1
    assert report.materials_full == 6
    assert 0 < report.pairs < report.pairs_full
    assert 0.3 < report.saved < 1
    assert "of" in report.describe()


def test_a_picture_without_spectra_has_the_same_colours():
    grid = np.arange(380.0, 781.0, 10.0)
    # A lamp that is off adds nothing at all.
    for spectrum in (lamp("A", grid), 0 * grid):
        body = Lambert(np.linspace(0.05, 0.6, grid.size))
        sun = ParallelLight((0, 0, -1), spectrum)
        made = Scene(grid, [Plane("m")], {"m": body}, [sun], Camera((0, -3, 2)), width=4, height=4)
        coloured = render(made, spectral=False)
        assert coloured.values.shape[-1] == 3
        with refusal("no spectra"):
            save_spectral("a.npz", coloured)
        with refusal("spectral=True for another"):
            picture_xyz(coloured, grid, 10)
        full = picture_xyz(render(made), grid)
        assert_allclose(picture_xyz(coloured, grid), full, rtol=1e-12)


def test_rays_of_finished_tiles_make_room():
    sun = ParallelLight((0, 0, -1), 1.0)
    made = flat(Lambert(0.5), sun, Camera((0, -3, 2)), width=8, height=8)
    work = _Work(scene=made, spectral=True, adaptive=True, tolerance=1e-3, progress=no_progress)
    work.run()
    assert work.kept == 0


def test_an_interrupted_picture_keeps_what_it_has(monkeypatch):
    made = still_life(width=160, height=120, antialias=1)

    def stop(done, total, words):
        if words == "computing spectra" and done > 0.5 * total:
            raise KeyboardInterrupt

    monkeypatch.setattr("glazejax.appearance.scene.draw.render.TILE", 2**11)
    rendered = render(made, progress=stop)
    done = np.isfinite(rendered.radiance[..., 0])
    assert 0 < done.mean() < 1
    assert 0 < rendered.done < 1
    assert done[0].all()
    shown = screen_picture(picture_xyz(rendered, GRID), WHITE)
    assert (shown.rgb[~done] == 128).all()


def test_gradient_of_a_pixel_by_the_spectrum_of_a_material():
    made = still_life(width=8, height=6, antialias=1, background=0.2)
    materials = list(made.materials.values())
    pixels = np.arange(48)
    levels = trace(
        make_geometry(made.shapes, made.materials),
        lamps(made.lights),
        *made.rays(pixels % 8 + 0.5, pixels // 8 + 0.5),
        reflects=lambda number, cosines: np.ones(len(cosines)) * (number == 3),
        most_bounces=2,
    )
    weights = jnp.asarray(np.random.default_rng(1).normal(size=(48, GRID.size)))

    def total(body, index, light):
        changed: list = [
            Lambert(body),
            None,
            materials[2],
            Conductor(index, 3.0),
            materials[4],
            None,
        ]
        spectra = jnp.asarray(made.light_spectra()).at[0].set(light)
        return jnp.sum(
            weights * radiance(levels, changed, spectra, jnp.asarray(made.background_spectrum()))
        )

    body = jnp.full(GRID.size, 0.5)
    point = body, 0.6 * body, jnp.asarray(made.light_spectra()[0])
    check_slopes(total, point, modes=("rev",), eps=1e-5, rtol=1e-5, atol=1e-8)


def test_lamps_have_luminance_one_and_keep_their_lines():
    for grid in (np.arange(400.0, 701.0, 10.0), np.arange(380.0, 781.0, 5.0)):
        for name in ("D65", "A", "FL2"):
            spectrum = lamp(name, grid)
            assert_allclose(spectrum @ colour.colour_weights(grid, "E")[:, 1], 1.0)
    # Against ASTM's weights of the illuminant itself: a paint under a fluorescent lamp.
    grid = np.arange(400.0, 701.0, 10.0)
    reading = reflectance(coated(0.8, Vermillion=25e-6), Bidirectional(45.0))
    for name, limit in (("D65", 0.05), ("A", 0.05), ("FL2", 0.6)):
        white = light_white(lamp(name, grid), grid)
        here = lamp(name, grid) * np.asarray(reading) @ colour.colour_weights(grid, "E")
        there = colour.lab(grid, reading, illuminant=name)
        difference = colour.delta_e_2000(colour.xyz_to_lab(here, white), there)
        assert difference < limit, name


def test_bands_between_whole_nanometres_have_the_power_of_the_lamp():
    fine = np.arange(400.0, 701.0)
    whole = lamp("D65", fine)
    uneven = np.concatenate([np.arange(400.0, 500.0, 0.7), np.arange(500.25, 700.0, 9.5)])
    for grid in (np.arange(400.0, 700.1, 0.5), np.arange(400.0, 700.0, 0.3), uneven):
        spectrum = lamp("D65", grid)
        assert_allclose(spectrum @ colour.colour_weights(grid, "E")[:, 1], 1.0)
        assert_allclose(light_white(spectrum, grid), light_white(whole, fine), atol=2e-3)
        assert_allclose(spectrum, np.interp(grid, fine, whole), rtol=0.03)


def test_measured_lamps(tmp_path):
    table, ramp = tmp_path / "lamps.csv", tmp_path / "ramp.csv"
    bands = range(380, 800, 5)
    table.write_text("nm,one,two\n" + "\n".join(f"{w},{w / 4},{2000 - w}" for w in bands))
    one = measured_lamp(f"{table}:one", GRID, 2.0)
    assert_allclose(one[1:] / one[:-1], GRID[1:] / GRID[:-1], rtol=2e-3)
    # A lamp whose power equals its wavelengths is no second column of them.
    ramp.write_text("nm,lamp\n" + "\n".join(f"{w},{w}" for w in bands))
    assert_allclose(measured_lamp(ramp, GRID, 2.0), one, rtol=1e-9)
    with refusal("holds 2 lamps: choose one"):
        measured_lamp(table, GRID)
    with refusal("no lamp 'three'; there are one, two"):
        measured_lamp(f"{table}:three", GRID)
    with refusal("no file", FileNotFoundError):
        measured_lamp(tmp_path / "none.csv", GRID)
    with refusal("known at 450-550 nm"):
        lamp_on_bands(np.arange(450.0, 551.0, 10), np.ones(11), GRID)
    with refusal("power above 0"):
        lamp_on_bands(np.arange(300.0, 800.0, 10), np.zeros(50), GRID)
    with refusal(r"power of 1e\+308, where sums overflow"):
        lamp_on_bands(np.arange(300.0, 800.0, 10), np.full(50, 1e308), GRID)


@pytest.fixture(scope="module")
def picture():
    """A ball in the light of the sun, before a grey background."""
    sun, camera = ParallelLight((0.3, 1.0, -0.5), 1.0), Camera((0, -5, 0), field_of_view=30)
    body = Lambert(rising(0.2, 0.6))
    return render(scene([Sphere("m")], {"m": body}, [sun], camera, background=0.3))


def test_pictures_and_spectra_are_written_by_the_name_that_was_given(tmp_path, picture):
    save_spectral(tmp_path / "a.NPZ", picture)
    assert [path.name for path in tmp_path.iterdir()] == ["a.NPZ"]
    with np.load(tmp_path / "a.NPZ") as stored:
        assert_allclose(stored["radiance"], picture.radiance, rtol=1e-6)
        assert_array_equal(stored["wavelengths"], GRID)
    screen = screen_picture(picture_xyz(picture, GRID), WHITE)
    save_png(tmp_path / "a.png", screen.rgb)
    from matplotlib.image import imread

    assert_array_equal(np.round(imread(tmp_path / "a.png")[..., :3] * 255), screen.rgb)
    assert 0 <= screen.bright < 0.5
    with refusal(r"as .npz or .exr"):
        save_spectral(tmp_path / "a.txt", picture)


def test_spectra_in_openexr(tmp_path, picture):
    OpenEXR = pytest.importorskip("OpenEXR")
    save_spectral(tmp_path / "a.exr", picture)
    with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
        channels = file.channels()
        assert sorted(channels) == [f"S0.{w:.0f},000000nm" for w in GRID]
        for k, wavelength in enumerate(GRID):
            pixels = channels[f"S0.{wavelength:.0f},000000nm"].pixels
            assert_allclose(pixels, picture.radiance[..., k], rtol=1e-6, atol=1e-9)


def triangle(*corners):
    return Mesh("m", np.eye(3), np.array([corners]))


def ball_of(material):
    return {"materials": {"m": material}, "shapes": [Sphere("m")]}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"shapes": []}, "at least one shape"),
        ({"lights": []}, "at least one light"),
        ({"shapes": [Sphere("none")]}, "material 'none'"),
        ({"background": np.ones(3)}, "background has shape"),
        ({"background": np.nan}, "background holds nan"),
        (ball_of(Lambert(np.ones(3))), "reflectance of material 'm' has shape"),
        (ball_of(Lambert(-0.5)), "holds -0.5"),
        (ball_of(Phong(0.5, -1.0)), "specular of material 'm' is -1"),
        (ball_of(Glazed(forward())), "material 'm': .* phase function"),
        (ball_of(Glazed(blue_glaze(np.array([1e-6, 2e-6])))), "'m': .* map of thicknesses"),
        (
            ball_of(Glazed(blue_glaze(), np.full((2, 2), 1e-6))) | {"shapes": [triangle(0, 1, 2)]},
            "material 'm' has a thickness map, but a mesh of it has no texture coordinates",
        ),
    ],
)
def test_scenes_that_cannot_be(change, words):
    with refusal(words):
        replace(still_life(), **change)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Sphere("m", radius=-1), "radius must be a number above 0, not -1"),
        (lambda: Sphere("m", (1, 2)), "centre must be three finite numbers"),
        (lambda: Plane("m", normal=(0, 0, 0)), "no direction"),
        (lambda: Plane("m", size=(1, 0)), "size must be a number above 0"),
        (lambda: triangle(0, 1, -1), "a face names vertex -1, but they are 0 to 2"),
        (lambda: triangle(0, 1, 3), "a face names vertex 3, but they are 0 to 2"),
        (lambda: triangle(0, 1, 1.5), "faces must be whole numbers"),
        (lambda: Camera((0, 0, 1), (0, 0, 0)), "looks along its up"),
        (
            lambda: Camera((0, -1, 0), field_of_view=200),
            "field_of_view must be between 0 and 170 degrees, not 200",
        ),
    ],
)
def test_things_that_cannot_be(unchecked, make, words):
    with refusal(words):
        make()
