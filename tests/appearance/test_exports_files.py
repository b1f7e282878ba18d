"""What is exported: MaterialX files, textures, and the command that writes them."""

import io
import json
import re
from functools import partial
from xml.etree import ElementTree as xml

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import glazejax as gj
from glazejax.appearance.exports import OpenPBR, fit_openpbr, texture_set, write_materialx
from glazejax.appearance.exports.materialx import ImageNode
from glazejax.appearance.image_files import normals, png
from glazejax.colour import encoded_srgb
from glazejax.commands import progress
from glazejax.paint.describe import Coat
from glazejax.stacks import Stack, write_stack
from tests.commands import invoke, succeed

from ..glazes import coated
from ..refusals import refusal
from .scenes import blue_glaze, paint

COATS = "UltramarineBlue:3um, ZincWhite:20um"


run, export = partial(invoke, "export"), partial(succeed, "export")


@pytest.fixture(scope="module")
def fit():
    return fit_openpbr(blue_glaze(), space="acescg", coat=False, tolerance=1e-3)


def read_png(path):
    """Values of a PNG from 0 to 1, by matplotlib and Pillow, which keeps the upper 8 bits of each
    colour.
    """
    from matplotlib.image import imread

    return np.asarray(imread(path), float)


def inputs(path, node):
    found = xml.parse(path).getroot().find(node)
    assert found is not None
    return {one.attrib["name"]: one.attrib for one in found}


def test_a_materialx_file_holds_the_material(fit, tmp_path):
    path = write_materialx(fit, tmp_path / "blue.mtlx", name="blue")
    root = xml.parse(path).getroot()
    assert root.tag == "materialx"
    assert root.attrib["version"] == "1.39"
    assert root.attrib["colorspace"] == "acescg"
    assert f"albedo {fit.errors.albedo:.4f}" in root.attrib["doc"]
    given = inputs(path, "open_pbr_surface")
    for name, value in fit.material.parameters().items():
        written = [float(part) for part in given[name]["value"].split(",")]
        assert_allclose(written, value, rtol=1e-5)
    assert inputs(path, "surfacematerial")["surfaceshader"]["nodename"] == "blue_surface"


def test_materialx_takes_the_files(fit, tmp_path):
    mx = pytest.importorskip("MaterialX")
    library = mx.createDocument()
    mx.loadLibraries(mx.getDefaultDataLibraryFolders(), mx.getDefaultDataSearchPath(), library)
    images = {
        "base_color": ImageNode("a.png", "srgb_texture"),
        "specular_roughness": ImageNode("b.png"),
    }
    files = [
        write_materialx(fit, tmp_path / "plain.mtlx"),
        write_materialx(
            OpenPBR(), tmp_path / "pictures.mtlx", images=images, normal=ImageNode("n.png")
        ),
    ]
    for path in files:
        document = mx.createDocument()
        mx.readFromXmlFile(document, str(path))
        document.setDataLibrary(library)
        assert document.validate() == (True, "")
        (material,) = document.getMaterialNodes()
        (shader,) = mx.getShaderNodes(material)
        definition = shader.getNodeDef()
        assert definition.getNodeString() == "open_pbr_surface"
        # A name that the definition does not have would be ignored in silence by a renderer.
        known = {one.getName() for one in definition.getActiveInputs()}
        assert {one.getName() for one in shader.getInputs()} <= known


def test_bad_names_are_refused(tmp_path):
    with refusal("the material's name is 'my glaze'; use letters"):
        write_materialx(OpenPBR(), tmp_path / "a.mtlx", name="my glaze")
    with refusal("a MaterialX file ends in .mtlx"):
        write_materialx(OpenPBR(), tmp_path / "a.xml")


def test_png_has_sixteen_bits():
    grey = np.linspace(0, 1, 60).reshape(5, 12)
    pillow = pytest.importorskip("PIL.Image")
    found = np.asarray(pillow.open(io.BytesIO(png(grey))))
    assert_array_equal(found, np.round(grey * 65535).astype(np.uint16))
    colour = np.random.default_rng(0).uniform(size=(4, 3, 3))
    file = io.BytesIO(png(colour, encoded=True))
    assert_allclose(read_png(file), colour, atol=1.01 / 255)
    assert pillow.open(file).info["srgb"] == 0


def test_normals_of_a_slope_point_down_it():
    rise = np.broadcast_to(np.arange(4.0) * 1e-6, (3, 4))
    n = 2 * normals(rise, 1e-6) - 1
    # A height that rises to the right by one pixel a pixel: 45 degrees, towards the left.
    assert_allclose(n, np.broadcast_to([-np.sqrt(0.5), 0, np.sqrt(0.5)], n.shape), atol=1e-12)
    # Rising downwards: green points up the picture.
    assert np.all((2 * normals(rise.T, 1e-6) - 1)[..., 1] > 0.7)


def test_textures_come_with_words_and_a_material(tmp_path):
    thickness = np.linspace(0, 8e-6, 12).reshape(3, 4)
    found = texture_set(blue_glaze(), tmp_path / "glaze", thickness=thickness, pixel=50e-6)
    assert all(path.exists() for path in found.files.values())
    record = json.loads(found.files["json"].read_text())
    assert record["textures"]["base_color"] == {
        "file": "glaze_base_color.png",
        "colour": True,
        "encoded": "sRGB",
        "blender": "Base Color",
    }
    assert record["textures"]["roughness"]["encoded"] == "linear"
    assert record["height"] == {"black_m": 0.0, "white_m": 8e-6, "pixel_m": 5e-05}
    assert record["share_outside_gamut"] == found.outside > 0
    text = found.files["readme"].read_text()
    assert "glaze_base_color.png" in text
    assert "-> Base Color (image colour space: sRGB)" in text
    assert "Scale 8e-06" in text
    pillow = pytest.importorskip("PIL.Image")
    height = np.asarray(pillow.open(found.files["height"]), float) / 65535
    assert_allclose(height * 8e-6, thickness, atol=1e-10)
    assert np.asarray(pillow.open(found.files["roughness"])).max() == 0
    mx = pytest.importorskip("MaterialX")
    document = mx.createDocument()
    mx.readFromXmlFile(document, str(found.files["materialx"]))
    file = document.getNode("glaze_base_color").getInput("file")
    assert file.getValueString() == "glaze_base_color.png"
    assert file.getColorSpace() == "srgb_texture"


@pytest.mark.slow
def test_a_large_map_is_interpolated(tmp_path):
    thickness = np.linspace(0, 8e-6, 600).reshape(20, 30)
    many = texture_set(blue_glaze(), tmp_path / "many", thickness=thickness, delta_e=0.5)
    assert 0 < many.interpolation <= 0.5
    picture = read_png(many.files["base_color"])
    few = texture_set(blue_glaze(), tmp_path / "few", thickness=thickness[:, ::29])
    assert few.interpolation == 0
    # Half a unit of Delta E is a few steps of eight bits at most.
    assert_allclose(picture[:, ::29], read_png(few.files["base_color"]), atol=3 / 255)


@pytest.mark.slow
def test_fractions_and_grounds(tmp_path):
    mixed = gj.Mixture([paint("ZincWhite"), paint("Vermillion")], [0.5, 0.5])
    glaze = gj.Glaze([gj.Layer(mixed, 20e-6)], 0.5)
    fractions, grounds = [0.0, 0.25, 1.0], [0.1, 0.9, 0.9]
    files = texture_set(
        glaze, tmp_path / "f", fraction=np.array([fractions]), ground=np.array([grounds])
    ).files
    [row] = read_png(files["base_color"])
    for fraction, ground, pixel in zip(fractions, grounds, row, strict=True):
        parts = gj.Mixture(mixed.pigments, [1 - fraction, fraction])
        alone = fit_openpbr(gj.Glaze([gj.Layer(parts, 20e-6)], ground), coat=False)
        assert_allclose(pixel, encoded_srgb(np.array(alone.material.base_color)), atol=1e-2)


@pytest.mark.slow
def test_a_coat_is_a_picture_of_its_own(tmp_path):
    found = texture_set(
        blue_glaze(), tmp_path / "c", thickness=np.array([[0.0, 2e-6, 6e-6]]), coat=True
    )
    base, coat = (read_png(found.files[what])[0] for what in ("base_color", "coat_color"))
    assert np.ptp(base, axis=0).max() == 0
    assert np.all(np.diff(coat[:, 2]) < 0)
    assert found.material.coat_weight == 1
    assert "Coat > Tint" in found.files["readme"].read_text()
    assert "glaze_coat_color" in found.files["materialx"].read_text()


@pytest.mark.slow
def test_exr_holds_acescg(fit, tmp_path):
    exr = pytest.importorskip("OpenEXR")
    thickness = np.linspace(0, 3e-6, 12).reshape(3, 4)
    found = texture_set(
        blue_glaze(), tmp_path / "e", thickness=thickness, kind="exr", space="acescg"
    )
    assert found.outside == 0
    with exr.File(str(found.files["base_color"])) as file:
        pixels = file.channels()["RGB"].pixels
    assert_allclose(pixels[2, 3], fit.material.base_color, atol=2e-3)
    assert 'colorspace="acescg"' in found.files["materialx"].read_text()


MAP = np.full((2, 2), 3e-6)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({}, "textures need a map that says what changes"),
        (
            {"thickness": MAP * 1e6},
            r"thickness must be in \[0, 0.01\], not 3: thickness is in metres \(20 micrometres",
        ),
        ({"thickness": -MAP}, r"thickness must be in \[0, 0.01\], not -3e-06"),
        ({"thickness": MAP * np.nan}, r"thickness must be in \[0, 0.01\], not nan"),
        ({"thickness": MAP[0]}, r"thickness has shape \(2,\); it must be a map \(h, w\)"),
        (
            {"thickness": MAP, "ground": np.ones((3, 2))},
            r"maps differ in shape: thickness \(2, 2\), ground \(3, 2\)",
        ),
        ({"thickness": MAP, "layer": 2}, "layer is 2, but the glaze has 2 coats"),
        ({"fraction": MAP}, "fraction is the share of the second paint of coat 0"),
        ({"ground": MAP, "pixel": 1e-5}, "height and normals are those of a thickness map"),
        ({"thickness": MAP, "pixel": 50.0}, "pixel is 50.0; it is a pixel's width in metres"),
        ({"thickness": MAP, "kind": "jpg"}, "kind is 'jpg'; choose png or exr"),
        ({"thickness": MAP, "space": "acescg"}, "PNG holds sRGB: write kind='exr' for ACEScg"),
        ({"thickness": MAP, "delta_e": 0.0}, "delta_e is 0.0; it must be positive"),
        ({"thickness": MAP, "name": "my glaze"}, "the material's name is 'my glaze'; use letters"),
    ],
)
def test_maps_that_cannot_be_meant_are_refused(tmp_path, given, words):
    with refusal(words):
        texture_set(blue_glaze(), tmp_path / "t", **given)
    assert not (tmp_path / "t").exists()


@pytest.mark.slow
def test_the_command_fits_openpbr(here):
    done = export(COATS, "--space", "ACEScg")
    for words in (
        "UltramarineBlue 3 µm over ZincWhite 20 µm",
        "wrote    glaze.mtlx",
        "without the fit",
        "Delta E",
    ):
        assert words in done.output
    fit = fit_openpbr(coated(0.9, UltramarineBlue=3e-6, ZincWhite=20e-6), space="acescg")
    assert f"RMS {fit.errors.rms:.3f}" in done.output
    given = inputs(here / "glaze.mtlx", "open_pbr_surface")["base_color"]["value"]
    assert_allclose([float(part) for part in given.split(",")], fit.material.base_color, rtol=1e-4)
    assert "--out glaze.mtlx exists" in str(run(COATS).exception)


def test_the_command_reads_a_stack_and_maps(here):
    stack = Stack((Coat(((1.0, "UltramarineBlue"),), 5e-6, 1),), (), "card")
    write_stack(here / "one.json", stack)
    np.save("thin.npy", np.array([[0.0, 1e-6, 4e-6]]))
    np.save("share.npy", np.array([[0.0, 0.2, 0.8]]))
    words = "one.json", "--to", "textures", "--thickness-map"
    thin = *words, "thin.npy", "--out", "a"
    assert "card of white and black: exported over white" in export(*thin).output
    export(*words, "share.npy", "--thickness-range", "0-5um", "--pixel", "50um", "--out", "b")
    pictures = [read_png(here / folder / "glaze_base_color.png") for folder in ("a", "b")]
    assert_array_equal(pictures[0], pictures[1])
    assert (here / "b" / "glaze_normal.png").exists()
    assert "exists" in str(run(*thin).exception)
    export(*thin, "--overwrite", "--ground", "0.1")
    assert np.all(read_png(here / "a" / "glaze_base_color.png")[0, 0] < pictures[0][0, 0])


@pytest.mark.parametrize(("low", "high"), [(0.0, 4.0), (-1e-6, 1e-6)])
def test_a_map_that_is_not_in_metres_is_told_so(tmp_path, low, high):
    np.save(tmp_path / "um.npy", np.array([[low, high]]))
    words = str(run(COATS, "--to", "textures", "--thickness-map", tmp_path / "um.npy").exception)
    assert f"um.npy: holds {low:g} to {high:g}; thicknesses are in metres, 0 to 0.01" in words
    assert "--thickness-range" in words


def test_a_map_in_metres_takes_no_range(tmp_path):
    np.save(tmp_path / "m.npy", np.array([[0.0, 5e-6]]))
    words = "--to", "textures", "--thickness-map", tmp_path / "m.npy", "--thickness-range", "0-20um"
    said = str(run(COATS, *words).exception)
    assert "m.npy: holds 0 to 5e-06, which looks like metres: leave out --thickness-range" in said


def test_a_ground_that_no_paint_meets_is_named(here):
    (here / "infrared.csv").write_text("wavelength,card\n1000,0.5\n1100,0.5\n")
    said = str(run(COATS, "--ground", "infrared.csv").exception)
    assert said.startswith("infrared.csv: the ground: the paints and the ground share no")


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        ("--to unreal", "--to is 'unreal'; it must be one of openpbr, textures"),
        ("--layering arnold", "--layering is 'arnold'; it must be one of materialx"),
        ("--format tga", "--format is 'tga'; it must be one of png, exr"),
        ("--to textures", "textures need a map that says what changes: add --thickness-map FILE"),
        ("--space ACEScg --pixel 5um", "--pixel is for textures: add --to textures"),
        ("--space rgb", "the colour space 'rgb' is not known"),
        ("--thickness-map a.npy", "--thickness-map is for textures"),
        ("--layer 2", "--layer is for textures: add --to textures"),
        ("--format exr", "--format is for textures"),
        ("--delta-e 1", "--delta-e is for textures"),
        (
            "--to textures --thickness-map a.npy --layering reciprocal",
            "--layering is for openpbr: leave it out, or give --to openpbr",
        ),
        ("--to textures --thickness-map a.npy --tolerance 1e-3", "--tolerance is for openpbr"),
    ],
)
def test_wrong_options_are_one_sentence(here, words, complaint):
    (here / "a.npy").touch()
    assert complaint in str(run(COATS, *words.split()).exception)
    assert [path.name for path in here.iterdir()] == ["a.npy"]


@pytest.mark.parametrize(
    ("words", "stages"),
    [
        (
            "--roughness 0.3 --no-coat --tolerance 0.01",
            ["computing pairs of angles", "fitting the material"],
        ),
        (
            "--to textures --thickness-map ramp.npy --delta-e 1",
            [r"computing glazes, round \d+,", "comparing pixels at all angles"],
        ),
    ],
)
def test_without_a_terminal_lines_say_how_far_an_export_is(here, monkeypatch, words, stages):
    monkeypatch.setattr(progress, "lines", partial(progress.lines, 0.001))
    np.save("ramp.npy", np.linspace(1e-6, 4e-6, 80)[None])
    done = export("Eosin:3um", *words.split())
    for stage in stages:
        shares = re.findall(rf"^{stage} \d+ of \d+ \((\d+)%\), after", done.stderr, re.MULTILINE)
        assert len({*shares}) > 1, stage
