"""Scene files and the command: the example, every kind of value, and errors that name key and
value.
"""

import re
import tomllib
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from numpy.testing import assert_allclose, assert_array_equal

from glazejax.appearance.scene import file as scene_file
from glazejax.appearance.scene.draw.render import render
from glazejax.appearance.scene.lights import AreaLight, PointLight
from glazejax.appearance.scene.materials import Conductor, Glazed
from glazejax.appearance.scene.picture import light_white
from glazejax.appearance.scene.shapes import Box, Mesh, Plane, Sphere
from glazejax.colour import colour_weights
from glazejax.commands import scene as cli_scene
from tests.commands import invoke, succeed

from ..refusals import refusal

SMALL = """
[picture]
width = 12
height = 8
wavelengths = "400:700:20"
background = 0.2
[camera]
position = [0, -4, 2]
[lights.sun]
illuminant = "D65"
direction = [0, 1, -1]
[materials.grey]
kind = "lambert"
reflectance = 0.5
[materials.paint]
kind = "glaze"
coats = "UltramarineBlue:5um"
[objects.floor]
shape = "plane"
centre = [0, 0, 0]
normal = [0, 0, 1]
material = "grey"
[objects.ball]
shape = "sphere"
centre = [0, 0, 1]
radius = 1
material = "paint"
"""


@pytest.fixture
def write(tmp_path):
    def writer(text):
        path = tmp_path / "my.toml"
        path.write_text(text)
        return path

    return writer


@pytest.fixture
def read(write):
    return lambda text: scene_file.read_scene(write(text))


def test_the_example_shows_every_kind_of_thing(read):
    found = read(scene_file.example())
    scene = found.scene
    assert {type(shape) for shape in scene.shapes} == {Plane, Sphere, Box}
    kinds = {table["kind"] for table in tomllib.loads(scene_file.example())["materials"].values()}
    assert kinds == {"lambert", "phong", "metal", "glaze"}
    assert any(isinstance(light, PointLight) for light in scene.lights)
    assert np.asarray(scene.materials["canvas"].thickness_map).shape[1] > 100
    assert "6 objects" in scene_file.describe(found)


def test_light_between_surfaces_and_the_reflectance_of_a_metal_are_in_the_file(read):
    text = scene_file.example().replace("diffuse_bounces = 0", "diffuse_bounces = 2")
    scene = read(text.replace('fresnel = "exact"', 'fresnel = "hall"')).scene
    assert scene.diffuse_bounces == 2
    metal = scene.materials["copper"]
    assert isinstance(metal, Conductor)
    assert metal.fresnel == "hall"


def test_a_small_scene_is_what_its_file_says(read):
    found = read(SMALL)
    scene = found.scene
    assert (scene.width, scene.height, scene.antialias, scene.bounces) == (12, 8, 4, 3)
    assert_allclose(scene.wavelengths, np.arange(400, 701, 20))
    assert found.display == "sRGB"
    assert_allclose(found.white, scene.lights[0].spectrum)
    picture = render(scene).radiance
    assert np.isfinite(picture).all()
    # The floor in front of the ball, under light at 45 degrees.
    assert_allclose(picture[-1, 0], 0.5 * np.sqrt(0.5) * scene.lights[0].spectrum, rtol=1e-6)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            "width = 12",
            "width = -3",
            r"my.toml: width must be a whole number from 1 to 20000, not -3",
        ),
        (
            "width = 12",
            "width = 12\ndiffuse_bounces = -1",
            "diffuse_bounces must be a whole number from 0 to 20",
        ),
        ("width = 12", "width = 1.5", r"\[picture\] width: must be a whole number, not 1.5"),
        ("width = 12", "widht = 12", r"\[picture\]: unknown key 'widht'; did you mean 'width'\?"),
        ("[camera]", "[kamera]", r"my.toml: camera is missing"),
        ("position = [0, -4, 2]", "position = [0, -4]", r"\[camera\] position: must be 3 numbers"),
        (
            "position = [0, -4, 2]",
            "position = [0, 0, 0]",
            r"\[camera\]: the camera's target .* is its position",
        ),
        (
            'illuminant = "D65"',
            'illuminant = "D66"',
            r"\[lights.sun\] illuminant: unknown illuminant 'D66'",
        ),
        ('illuminant = "D65"', "", r"\[lights.sun\] illuminant: give either illuminant"),
        (
            'illuminant = "D65"',
            'spectrum = "lamp.csv"',
            r"\[lights.sun\] spectrum: there is no file .*lamp.csv",
        ),
        ("direction = [0, 1, -1]", "", r"\[lights.sun\] position: give either position"),
        (
            "direction = [0, 1, -1]",
            'shape = "disc"',
            r"\[lights.sun\] shape: 'disc' must be one of rectangle, sphere",
        ),
        (
            "direction = [0, 1, -1]",
            'shape = "rectangle"\ncentre = [0, 0, 9]\nnormal = [0, 0, -1]',
            r"\[lights.sun\]: size is missing: give a width and a height",
        ),
        (
            "direction = [0, 1, -1]",
            'shape = "sphere"\ncentre = [0, 0, 9]',
            r"\[lights.sun\]: radius is missing",
        ),
        (
            'coats = "U',
            'roughness = 2\ncoats = "U',
            r"\[materials.paint\] roughness: roughness must be 0 \(smooth\)",
        ),
        (
            "normal = [0, 0, 1]",
            'normal = [0, 0, 1]\nrelief = "no.npy"',
            r"\[objects.floor\] relief: there is no file",
        ),
        (
            "normal = [0, 0, 1]",
            'normal = [0, 0, 1]\nrelief = "no.png"',
            r"\[objects.floor\]: relief_height is missing",
        ),
        (
            "normal = [0, 0, 1]",
            "normal = [0, 0, 1]\nrelief_height = 1",
            r"relief_height: has no meaning without relief",
        ),
        (
            "direction = [0, 1, -1]",
            "direction = [0, 0, 0]",
            r"\[lights.sun\]: direction is \(0, 0, 0\)",
        ),
        (
            "reflectance = 0.5",
            "reflectance = 50",
            r"reflectance: must lie between 0 and 1, not 50; 50 percent is 0.5",
        ),
        (
            "reflectance = 0.5",
            'reflectance = "red.csv"',
            r"\[materials.grey\] reflectance: 'red.csv' is neither",
        ),
        (
            "reflectance = 0.5",
            "reflectance = true",
            r"\[materials.grey\] reflectance: must be a number from 0 to 1",
        ),
        (
            'kind = "lambert"',
            'kind = "lambret"',
            r"\[materials.grey\] kind: 'lambret' .* did you mean 'lambert'",
        ),
        (
            '"UltramarineBlue:5um"',
            '"UltramarineBlue"',
            r"\[materials.paint\] coats: .* has no thickness",
        ),
        (
            '"UltramarineBlue:5um"',
            '"Ultramarin:5um"',
            r"\[materials.paint\] coats: .*UltramarineBlue",
        ),
        (
            'coats = "U',
            'refractive_index = 3\ncoats = "U',
            r"\[materials.paint\]: refractive_index must be in \[1, 2.5\]",
        ),
        (
            'coats = "U',
            'thickness_range = ["0um","1um"]\ncoats = "U',
            r"thickness_range: has no meaning without",
        ),
        (
            'coats = "U',
            'thickness_layer = 1\ncoats = "U',
            r"thickness_layer: has no meaning without",
        ),
        (
            'coats = "U',
            'thickness_layer = "top"\ncoats = "U',
            r"thickness_layer: must be a whole number, not 'top'",
        ),
        (
            'coats = "U',
            'thickness_map = "wedge"\ncoats = "U',
            r"thickness_range: must be the thickness of black",
        ),
        (
            'coats = "U',
            'thickness_map = "m.png"\nthickness_range = ["0um","1um"]\ncoats = "U',
            r"thickness_map: there is",
        ),
        (
            'coats = "U',
            'thickness_map = "wedge"\nthickness_layer = 2\ncoats = "U',
            r"thickness_layer: is 2, but there are 1",
        ),
        (
            'kind = "lambert"\nreflectance = 0.5',
            'kind = "metal"\nmetal = "gold"\nroughness = 70',
            r"\[materials.grey\]: roughness must be 0 \(polished\) to 60 degrees, not 70",
        ),
        (
            'kind = "lambert"\nreflectance = 0.5',
            'kind = "metal"\nmetal = "gold"\nfresnel = "hal"',
            "did you mean 'hall'",
        ),
        ("radius = 1", "radius = 0", r"\[objects.ball\] radius: must be a number above 0, not 0"),
        (
            "radius = 1",
            "raduis = 1",
            r"\[objects.ball\]: radius is missing; is 'raduis' meant to be it\?",
        ),
        ("radius = 1", "", r"\[objects.ball\]: radius is missing"),
        (
            'material = "grey"',
            'material = "gray"',
            r"\[objects.floor\] material: 'gray' must be .* did you mean 'grey'",
        ),
        (
            'shape = "sphere"',
            'shape = "mesh"\nfile = "v.obj"',
            r"\[objects.ball\].*(v.obj|unknown key)",
        ),
        ('"400:700:20"', '"400-700"', r"\[picture\] wavelengths: '400-700' is not FROM:TO:STEP"),
        ('"400:700:20"', '"400:700:70"', r"\[picture\] wavelengths: .*(meet|coarse)"),
        ('"400:700:20"', '"380:700:20"', r"380"),
        (
            "width = 12",
            'width = 12\ndisplay = "CRT9"',
            r"\[picture\] display: unknown display 'CRT9'",
        ),
        (
            "width = 12",
            "width = 12\ntolerance = 2.0",
            r"\[picture\] tolerance: tolerance is 2.0; it must be between 0 and 1",
        ),
        (
            "width = 12",
            'width = 12\nwhite = "moon"',
            r"\[picture\] white: 'moon' is none of the lights \(sun\)",
        ),
        ("width = 12", "width = 12 12", r"my.toml: not a legal TOML file"),
    ],
)
def test_errors_name_place_and_value(read, old, new, words):
    assert old in SMALL
    with pytest.raises((ValueError, FileNotFoundError), match=words):
        read(SMALL.replace(old, new, 1))


def test_measured_reflectances_and_maps(read, tmp_path):
    table = "wavelength_nm,red,blue\n" + "\n".join(
        f"{w},{(w - 300) / 500:.4f},0.1" for w in range(380, 781, 10)
    )
    (tmp_path / "paints.csv").write_text(table)
    heights = np.linspace(0, 1, 12).reshape(3, 4)
    np.save(tmp_path / "map.npy", heights)
    text = SMALL.replace("reflectance = 0.5", 'reflectance = "paints.csv:red"')
    text = text.replace(
        'coats = "U',
        'thickness_map = "map.npy"\nthickness_range = ["2um", "6um"]\nground = 0.7\ncoats = "U',
    )
    scene = read(text).scene
    red = scene.materials["grey"].spectra()["reflectance"]
    assert_allclose(red, (np.asarray(scene.wavelengths) - 300) / 500)
    assert_allclose(scene.materials["paint"].thickness_map, 2e-6 + 4e-6 * heights)
    with refusal(r"holds 2 spectra: choose one, as paints.csv:red"):
        read(SMALL.replace("reflectance = 0.5", 'reflectance = "paints.csv"'))


def test_a_white_above_one_is_noise_or_refused(read, tmp_path):
    text = SMALL.replace("reflectance = 0.5", 'reflectance = "white.csv"')

    def read_white(top):
        rows = "\n".join(f"{w},{top if w == 500 else 0.98}" for w in range(380, 781, 10))
        (tmp_path / "white.csv").write_text("wavelength_nm,white\n" + rows)
        return read(text)

    noisy = read_white(1.02)
    assert np.max(noisy.scene.materials["grey"].spectra()["reflectance"]) == 1
    (note,) = noisy.notes
    assert "[materials.grey] reflectance: white.csv reflects 1.02 at 500 nm" in note
    with refusal(r"\[materials.grey\] reflectance: white.csv reflects 1.2 .*scale"):
        read_white(1.2)
    assert read(SMALL).notes == ()


def test_meshes_are_read_and_placed(read, tmp_path):
    trimesh.creation.box((1, 2, 4)).export(tmp_path / "v.obj")
    text = SMALL.replace(
        'shape = "sphere"\ncentre = [0, 0, 1]\nradius = 1',
        'shape = "mesh"\nfile = "v.obj"\nsize = 2\ncentre = [0, 0, 1]\nrotation = [0, 90, '
        "0]\nsmooth = false",
    )
    mesh = read(text).scene.shapes[1]
    assert isinstance(mesh, Mesh)
    assert_allclose(mesh.vertices.max(axis=0), [1, 0.5, 1.25], atol=1e-12)
    assert_allclose(mesh.vertices.min(axis=0), [-1, -0.5, 0.75], atol=1e-12)
    assert mesh.normals is None
    (tmp_path / "v.obj").write_text("not a mesh")
    with refusal(r"\[objects.ball\].*v.obj: .*triangles|\[objects.ball\].*cannot read"):
        read(text)


def test_area_lights_relief_and_roughness_are_read(read, tmp_path):
    heights = np.linspace(-1, 1, 12).reshape(3, 4)
    np.save(tmp_path / "strokes.npy", heights)
    text = SMALL.replace(
        "direction = [0, 1, -1]", 'shape = "sphere"\ncentre = [1, 2, 9]\nradius = 0.5\nstrength = 3'
    )
    text = text.replace(
        "[materials.grey]",
        '[lights.window]\nilluminant = "A"\nshape = "rectangle"\ncentre = [-4, 0, 3]\nnormal = '
        "[1, 0, 0]\n"
        "size = [2, 3]\n[materials.grey]",
    )
    text = text.replace('coats = "U', 'roughness = 0.25\ncoats = "U')
    relief = 'normal = [0, 0, 1]\nsize = [4, 3]\nrelief = "strokes.npy"\nrelief_height = 0.02'
    text = text.replace("normal = [0, 0, 1]\nmaterial", relief + "\nmaterial")
    scene = read(text).scene
    bulb, window = scene.lights
    assert isinstance(bulb, AreaLight)
    assert isinstance(window, AreaLight)
    assert isinstance(bulb.shape, Sphere)
    assert isinstance(window.shape, Plane)
    assert bulb.shape.radius == 0.5
    assert list(window.shape.size or ()) == [2, 3]
    # Luminance of the lamps themselves.
    luminance = scene.light_spectra() @ colour_weights(scene.wavelengths, "E")[:, 1]
    assert_allclose(luminance, [3.0, 1.0])
    paint = scene.materials["paint"]
    assert isinstance(paint, Glazed)
    assert paint.roughness == 0.25
    (floor,) = (shape for shape in scene.shapes if isinstance(shape, Plane))
    assert floor.relief is not None
    assert_allclose(floor.relief, 0.02 * heights)
    beyond = "area lights and relief and glazes with a rough surface"
    assert scene.needs_path_tracing() == beyond


run, draw = partial(invoke, "scene"), partial(succeed, "scene")


def test_the_command_writes_a_picture_and_its_spectra(write, tmp_path):
    out, spectra = tmp_path / "a.png", tmp_path / "a.npz"
    done = draw(write(SMALL), "-o", out, "--spectral", spectra)
    assert "left out" in done.output
    assert out.is_file()
    with np.load(spectra) as stored:
        assert stored["radiance"].shape == (8, 12, 16)
    again = run(write(SMALL), "-o", out)
    assert isinstance(again.exception, FileExistsError)
    assert "--overwrite" in str(again.exception)
    small = draw(write(SMALL), "-o", out, "--overwrite", "--size", "6x4")
    assert "6 x 4 pixels" in small.output


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ("", "name a scene file"),
        ("none.toml", "no scene file none.toml"),
        ("none.toml -o a.jpg", "written as .png"),
        ("none.toml --spectral a.txt", "written as .npz or .exr"),
        (
            "none.toml --renderer blender",
            "--renderer is 'blender'; it must be one of raycast, mitsuba",
        ),
        ("none.toml --samples 9", "--samples belongs to --renderer mitsuba"),
    ],
)
def test_what_the_command_refuses(here, arguments, words):
    assert words in str(run(*arguments.split()).exception)


LIT = SMALL.replace(
    "direction = [0, 1, -1]", 'shape = "sphere"\ncentre = [2, -3, 4]\nradius = 0.5\nstrength = 40'
)


PATHS = "--renderer", "mitsuba", "--samples", "16"


def test_the_command_path_traces(write, tmp_path):
    pytest.importorskip("mitsuba", reason="Mitsuba is not installed (extra render)")
    out = tmp_path / "a.png"
    done = draw(write(LIT), "-o", out, *PATHS)
    assert out.is_file()
    assert "paths: 16 of each pixel" in done.output
    assert "noise: " in done.output
    loose = LIT.replace("width = 12", "width = 12\ntolerance = 0.5")
    for text, arguments, words in (
        (LIT, ["--spectral", tmp_path / "s.npz"], "^--spectral belongs to --renderer raycast"),
        (LIT, ["--samples", 0], "^--samples is 0; it must be a whole number from 1 to 1048576"),
        (loose, [], "^tolerance is 0.5; it must be a number between 1e-05 and 0.1$"),
    ):
        refused = run(write(text), "-o", out, "--overwrite", *PATHS, *arguments)
        assert re.search(words, str(refused.exception))


def check_interrupted(words, *arguments):
    """Of the command: what is finished is written, and the rest is told."""
    done = run(*arguments, "-o", "a.png")
    assert done.exit_code == 130
    assert Path("a.png").is_file()
    assert words in done.output


def test_the_example_by_a_window_is_for_the_path_tracer():
    found = scene_file.read_scene(Path(__file__).parents[2] / "docs" / "window.toml")
    assert found.scene.needs_path_tracing() == "area lights and glazes with a rough surface"


def test_a_path_traced_picture_that_was_interrupted_says_so(write, here, monkeypatch):
    pytest.importorskip("mitsuba", reason="Mitsuba is not installed (extra render)")
    from glazejax.appearance.scene.path import path_trace as tracing

    mean = tracing._mean

    def interrupted(scene, report, each, one, told):
        def stops(number):
            if number == 1:
                raise KeyboardInterrupt
            return one(number)

        return mean(scene, report, each, stops, told)

    monkeypatch.setattr(tracing, "_mean", interrupted)
    words = "25% of the paths are followed, so that noise is left"
    check_interrupted(words, write(LIT), *PATHS)


def test_an_interrupted_command_writes_what_is_done(write, here, monkeypatch):
    from glazejax.appearance.scene.draw import render as scene_render

    shade = scene_render._Work._shade

    def interrupted(self, tiles, image, start, end):
        shade(self, tiles[:1], image, start, end)
        raise KeyboardInterrupt

    monkeypatch.setattr(scene_render, "TILE", 2**4)
    monkeypatch.setattr(scene_render._Work, "_shade", interrupted)
    check_interrupted("is finished, the rest is grey", write(SMALL))


def test_a_picture_is_shown_as_its_file_says(read, unchecked):
    """Exposure, the light the eye is adapted to, the display: of pixels that are half as bright as
    the white.
    """
    text = SMALL.replace(
        "background = 0.2", 'background = 0.2\nexposure = 2.0\nwhite = "A"\ndisplay = "Adobe RGB"'
    )
    found = read(text)
    wavelengths = found.scene.wavelengths
    half = 0.25 * light_white(found.white, wavelengths)  # of the exposure of two
    rendered = SimpleNamespace(spectral=False, values=np.tile(half, (2, 3, 1)))
    shown = found.on_screen(rendered)  # pyright: ignore[reportArgumentType]
    # Adobe RGB's curve is a power of 563/256; under A its white is the display's.
    assert_array_equal(shown.rgb, np.full((2, 3, 3), round(255 * 0.5 ** (256 / 563))))
    assert (shown.bright, shown.colourful) == (0.0, 0.0)


def test_without_llvm_the_time_and_the_way_out_are_said_first(read, monkeypatch):
    found = read(scene_file.example())
    for variant, told in (("scalar_spectral", True), ("llvm_ad_spectral", False)):
        monkeypatch.setattr(
            "glazejax.appearance.mitsuba.variants.usable_variant", lambda variant=variant: variant
        )
        words = cli_scene._without_llvm(found, 256)
        # 640 x 480 pixels, 256 paths each, 3,400 a second.
        assert ("about 6.4 hours" in words) == told
        assert ("libllvm19" in words) == told


def test_without_a_terminal_lines_say_how_far_a_picture_is(write, tmp_path, monkeypatch):
    from glazejax.commands import progress

    monkeypatch.setattr(progress, "lines", partial(progress.lines, 0.01))
    done = draw(write(SMALL), "-o", tmp_path / "a.png")
    assert re.search(r" of [\d,]+ \(\d+%\), after \d+ s", done.stderr)
