"""The command `glazejax render`, called through `glazejax.commands.main.main` as a user
calls it.
"""

import re

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import glazejax
from glazejax import Bidirectional, Glaze, Hemispherical, Layer, Mixture, Pigment
from glazejax.colour import lab, xyz
from glazejax.io import read_spectra
from glazejax.paint.pigment_table import read_pigments
from glazejax.stacks import read_stack

from .fresh import run_python
from .tables import rows

W = np.arange(400.0, 701.0, 20.0)
HEADER = "pigment,wavelength_nm,absorption,scattering,absorption_sd,scattering_sd,identifiable"


@pytest.fixture(scope="module")
def pigments_csv(tmp_path_factory):
    """Two made-up pigments; Red is not identifiable above 600 nm."""
    path = tmp_path_factory.mktemp("pigments") / "pigments.csv"
    lines = [HEADER]
    for name, centre, s in (("Red", 520, 3e3), ("DeepBlue", 600, 1e4)):
        k = 2e5 * np.exp(-0.5 * ((W - centre) / 45) ** 2) + 500
        lines += [
            f"{name},{w:g},{a},{s},1,1,{name != 'Red' or w <= 600}"
            for w, a in zip(W, k.tolist(), strict=True)
        ]
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.fixture
def run(command_line, pigments_csv):
    """Run a command line in an empty folder; returns stdout, stderr."""
    render = command_line("render", columns=100)

    def call(*arguments, pigments=pigments_csv, **fails):
        own = [] if pigments is None else ["--pigments", pigments]
        return render(*arguments, *own, **fails)

    return call


def spectrum(pigments_csv, geometry, ground: float | np.ndarray = 0.9, index=1.5):
    shelf = read_pigments(pigments_csv)
    glaze = Glaze([Layer(shelf["Red"], 1e-6), Layer(shelf["DeepBlue"], 2e-6)], ground, index)
    return np.asarray(glazejax.reflectance(glaze, geometry))


STACK = ("--coats", "Red:1um, deep blue:2um")


def check_glaze(path, expected):
    """The glaze in a table of spectra is this one, on the table's wavelengths."""
    assert_allclose(read_spectra(path)["glaze"], expected, atol=1e-6)


def first_colour(out):
    return re.findall(r"#[0-9a-f]{6}", out)[0]


def test_numbers_picture_and_table(run, tmp_path, pigments_csv):
    out, err = run(*STACK, "--csv", "spectra.csv")
    assert err == ""
    expected = spectrum(pigments_csv, Bidirectional(0.0, 0.0))
    table = read_spectra(tmp_path / "spectra.csv")
    assert table.names == (
        "glaze",
        "ground",
        "layer 1: Red 1 µm alone",
        "layer 2: DeepBlue 2 µm alone",
    )
    check_glaze(tmp_path / "spectra.csv", expected)
    assert_array_equal(table.wavelengths, W)
    assert (tmp_path / "glaze.png").read_bytes().startswith(b"\x89PNG")
    printed = [float(r) for line in re.findall(r"^  R  (.*)$", out, re.M) for r in line.split()]
    assert_allclose(printed, expected, atol=6e-5)
    for title, values, places in (
        ("XYZ", xyz(W, expected), 4),
        (r"L\*a\*b\*", lab(W, expected), 2),
    ):
        words = re.search(rf"^  {title} (.*?)  \(", out, re.M)
        assert words is not None
        assert_allclose([float(v) for v in words[1].split()], values, atol=10.0**-places)
    assert re.search(r"^  sRGB .*#[0-9a-f]{6}", out, re.M)
    assert out.index("Red") < out.index("DeepBlue") < out.index("ground: reflectance 0.9")
    assert "wrote glaze.png and spectra.csv in" in out


@pytest.mark.parametrize(
    ("options", "geometry", "words"),
    [
        (["--instrument", "45:0"], Bidirectional(45.0, 0.0), "light at 45°, view at 0°, no mirror"),
        (["--instrument", "20:de"], Hemispherical(20.0, False), "sphere at 20°, specular excluded"),
    ],
)
def test_geometries(run, tmp_path, pigments_csv, options, geometry, words):
    out, err = run(
        *STACK, *options, "--csv", "s.csv", "--refractive-index", "1.4", "--ground", "0.5"
    )
    assert err == ""
    assert words in out
    check_glaze(tmp_path / "s.csv", spectrum(pigments_csv, geometry, 0.5, 1.4))


def test_ground_from_a_file(run, tmp_path, pigments_csv):
    grid = np.arange(420.0, 681.0, 10.0)
    white = np.linspace(50, 90, grid.size)
    lines = [f"{w:g},{reading},5" for w, reading in zip(grid, white, strict=True)]
    (tmp_path / "cards.csv").write_text("\n".join(["wavelength,white card,black card", *lines]))
    out, err = run(*STACK, "--ground", "cards.csv:white card", "--csv", "s.csv")
    assert err == ""
    for words in ("ground: white card", "percent", "inside the paint", "420-680 nm step 20"):
        assert words in out
    ground = np.interp(W, grid, white / 100)
    inside = (W >= 420) & (W <= 680)
    check_glaze(tmp_path / "s.csv", spectrum(pigments_csv, Bidirectional(), ground)[inside])

    (tmp_path / "infrared.csv").write_text("wavelength,card\n1000,0.5\n1100,0.5\n")
    _, err = run(*STACK, "--ground", "infrared.csv", "--out", "b.png", fails=2)
    assert "infrared.csv: the ground: the paints and the ground share no wavelengths" in err


def test_mixtures_repeats_and_the_ladder(run, tmp_path, pigments_csv):
    layers = "0.5*Red+0.5*DeepBlue:1um x3, Red:0um, DeepBlue:1um"
    out, _ = run("--coats", layers, "--csv", "s.csv", "--ladder", "deepblue")
    shelf = read_pigments(pigments_csv)
    mixed = Mixture([shelf["Red"], shelf["DeepBlue"]], [0.5, 0.5])
    glaze = Glaze([Layer(mixed, 3e-6), Layer(shelf["DeepBlue"], 1e-6)], 0.9)
    check_glaze(tmp_path / "s.csv", glazejax.reflectance(glaze, Bidirectional()))
    assert re.search(r"3 x 1 µm +=? *3 µm", out)
    assert re.search(r"Red +0 µm +absent", out)
    assert "Ladder of DeepBlue, one coat 1 µm" in out
    assert out.count("40  #") == 1


def test_a_stack_is_written_and_drawn(run, tmp_path):
    """The studio's file: what one run wrote the next one draws, own paints included."""
    options = ["--ground", "0.5", "--instrument", "d:8", "--refractive-index", "1.4"]
    mixed = "Red:3um x2, 0.7*ZincWhite+0.3*DeepBlue:1um"
    run("--coats", mixed, *options, "--write-stack", "mixed.json", "--out", "mixed.png")
    first, _ = run("--coats", "Red:3um x2, DeepBlue:1um", *options, "--write-stack", "stack.json")
    stack = read_stack(tmp_path / "stack.json")
    assert [coat.name for coat in stack.coats] == ["Red", "DeepBlue"]
    assert [coat.thickness for coat in stack.coats] == [6e-6, 1e-6]
    assert (stack.ground, stack.instrument, stack.refractive_index) == (0.5, "d:8", 1.4)
    again = ("--stack", "stack.json", "--overwrite")
    second, _ = run(*again, pigments=None)
    # The ladder's coat is another: the two equal coats are one in the file.
    assert first_colour(second) == first_colour(first)
    third, _ = run(*again, "--ground", "0.1", pigments=None)
    assert first_colour(third) != first_colour(first)
    # Also where it is the usual one, an index that is stated counts before the file's.
    run(*again, "--refractive-index", "1.5", "--write-stack", "usual.json", pigments=None)
    assert read_stack(tmp_path / "usual.json").refractive_index == 1.5
    _, err = run("--stack", "stack.json", "--coats", "Red:1um", fails=2)
    assert err.startswith("error: --stack stack.json says what")
    _, err = run(*again, "--write-stack", "stack.json", fails=2)
    assert "a file that is read" in err


def test_own_paints_come_before_those_of_a_stack(run, tmp_path):
    """The studio's file says CobaltBlue, and one's own paint of that name is drawn."""
    own = tmp_path / "own.csv"
    lines = [f"CobaltBlue,{w:g},{1e5 if w < 600 else 1e2},1e3,1,1,True" for w in W]
    own.write_text("\n".join([HEADER, *lines]))
    (tmp_path / "stack.json").write_text(
        '{"glazejax": "stack", "ground": 0.9, "geometry": "0:0", '
        '"coats": [{"paint": {"CobaltBlue": 1}, "um": 5}]}'
    )
    coats, _ = run("--coats", "CobaltBlue:5um", pigments=own)
    stack, _ = run("--stack", "stack.json", "--overwrite", pigments=own)
    assert first_colour(coats) == first_colour(stack)
    _, err = run("--stack", "stack.json", "--catalogue", "oils", fails=2)
    assert err == "error: --stack stack.json says which paints it has: leave out --catalogue\n"


def test_a_paint_of_another_catalogue_has_the_studios_name_in_a_stack(run, tmp_path):
    coats = "acrylics:TitaniumWhite:9um, CobaltBlue:2um"
    out, _ = run("--coats", coats, "--write-stack", "two.json", pigments=None)
    assert "acrylics:TitaniumWhite" in out
    stack = read_stack(tmp_path / "two.json")
    assert [coat.name for coat in stack.coats] == ["acrylics/TitaniumWhite", "CobaltBlue"]
    assert dict(stack.pigments) == {}


def test_warnings_and_sources(run):
    out, _ = run(*STACK)
    assert re.search(r"warning: Red at 620-700 nm: measurements fix only k/s", out)
    assert "DeepBlue at" not in out
    assert re.search(r"source: +Red, DeepBlue: from .*pigments.csv", " ".join(out.split()))
    out, _ = run("--coats", "Red:0um,DeepBlue:1um", "--overwrite")
    assert "warning" not in out


def test_gamut_is_said(run):
    out, _ = run("--coats", "DeepBlue:10um")
    assert re.search(r"outside the sRGB gamut, clipped \(would need", out)
    out, _ = run("--coats", "Red:0um", "--overwrite")
    assert "outside the sRGB gamut" not in out


@pytest.mark.parametrize("width", [40, 60, 74, 80, 200])
def test_lines_fit_the_terminal(run, monkeypatch, width):
    monkeypatch.setenv("COLUMNS", str(width))
    out, _ = run(*STACK)
    assert max(map(len, out.splitlines())) <= width
    assert "…" not in out


REFUSED = r"""
| give the coats, such as --coats
--coats TWO --refractive-index 3 | --refractive-index is 3; it must be from 1 to 2.5
--coats TWO --ladder Green | 'Green' is none of the coats: choose one of Red, DeepBlue
--coats Red:0um,DeepBlue:1um --ladder Red | 0 thick, so there is nothing to repeat
--coats TWO --csv a.png --out a.png | --csv and --out are both a.png
--coats TWO --tolerance 0 | --tolerance is 0
--coats FIVE --write-stack s.json | --write-stack: a coat is of 5 paints, and a stack's file holds 4 at most
--coats MANY --write-stack s.json | --write-stack: there are 101 coats, and a stack's file holds 100 at most
"""


COATS = {
    "TWO": "Red:1um,deep-blue:2um",
    "FIVE": "0.2*Red+0.2*DeepBlue+0.2*Eosin+0.2*Minium+0.2*ZincWhite:1um",
    "MANY": ",".join(["Red:1um"] * 101),
}


@pytest.mark.parametrize(("line", "complaint"), rows(REFUSED))
def test_bad_input_is_one_clear_line(run, tmp_path, line, complaint):
    out, err = run(*(COATS.get(word, word) for word in line.split()), fails=2)
    assert out == ""
    assert re.fullmatch(rf"error: .*{complaint}.*\n", err)
    assert list(tmp_path.iterdir()) == []


def test_own_pigments_come_before_the_catalogue(run, monkeypatch, tmp_path):
    grid = np.arange(400.0, 701.0, 10.0)
    shelf = {
        name: Pigment(name, grid, np.full(31, k), 1e3 + 0 * grid, provenance=f"{name} of the shelf")
        for name, k in (("Red", 9e9), ("Ochre", 1e5))
    }
    monkeypatch.setattr("glazejax.catalogue.load", lambda _: shelf)
    monkeypatch.setattr("glazejax.catalogue.paint_families", lambda _: dict.fromkeys(shelf, ""))
    out, _ = run("--coats", "Red:1um, Ochre:1um", "--csv", "s.csv")
    assert "Ochre of the shelf" in out
    assert "Red of the shelf" not in out
    assert "differ in wavelengths; everything is computed at 400-700 nm step 20" in out
    assert_array_equal(read_spectra(tmp_path / "s.csv").wavelengths, W)
    _, err = run("--coats", "Ocre:1um", "--out", "b.png", fails=2)
    assert err == "error: there is no pigment 'Ocre': the nearest is Ochre\n"
    out, _ = run("--list")
    assert [line.split()[0] for line in out.splitlines()] == ["Red", "Ochre", "DeepBlue"]


def test_help_fits_and_tells_defaults(run):
    out, _ = run("--help", pigments=None)
    assert "Default: 0:0." in " ".join(re.sub("[│\n]", " ", out).split())
    assert "…" not in out


@pytest.mark.slow
def test_the_installed_command(tmp_path):
    """End to end, with the catalogue, in another process; also that nothing but its own words
    reaches the screen.
    """

    def call(words, status=0):
        return run_python(
            "from glazejax.commands.main import main; main()",
            "render",
            *words.split(),
            cwd=tmp_path,
            # The package that is installed, and not the one that the tests lie in.
            env={"COLUMNS": "80", "GLAZEJAX_CACHE": str(tmp_path / "cache"), "PYTHONPATH": ""},
            status=status,
        )

    coats = "--coats PrussianBlue:12um,Vermillion:12um"
    for _ in range(2):  # The second run takes its programs from the cache.
        done = call(f"{coats} --ground 0.9 --tolerance 1e-3 --overwrite")
        assert done.stderr == ""
        assert "taken as 25 µm" in " ".join(done.stdout.split())
        assert "warning: PrussianBlue at" in done.stdout
    wrong = call("--coats Ultramarin:12um --out other.png", status=2)
    assert wrong.stdout == ""
    assert (
        wrong.stderr == "error: there is no pigment 'Ultramarin': the nearest is UltramarineBlue\n"
    )
