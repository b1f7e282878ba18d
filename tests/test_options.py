"""The vocabulary of the commands: readers of options, old spellings, the version, and packages that
are missing.
"""

import shlex
import subprocess
import sys
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import numpy as np
import pytest

from glazejax import catalogue, extras, samples
from glazejax.commands import main as cli
from glazejax.commands import options, progress

from .commands import commands
from .refusals import refusal
from .tables import rows
from .test_first_second import environment
from .test_pigment_table import HEADER


@pytest.fixture
def run(command_line):
    return command_line()


def test_version(run):
    assert run("--version") == (f"glazejax {version('glazejax')}\n", "")


WRONG_LINES = """
nonsense | no such command 'nonsense'
render --lairs x | no such option: --lairs
render --tolerance low | '--tolerance' must be a number
recipe --count 2.5 | '--count' must be a whole number
render Eosin:2um,Minium:1um | glazejax render --coats 'Eosin:2um,Minium:1um'
recipe #8a4b2d | as in: glazejax recipe --srgb '#8a4b2d'
convert | missing argument 'IN'
"""


@pytest.mark.parametrize(("words", "message"), rows(WRONG_LINES))
def test_a_wrong_command_line_is_one_line(run, words, message):
    out, err = run(*words.split(), fails=2)
    assert out == ""
    assert err.startswith("error: ")
    assert message in err
    assert "--help)" in err


BOXES = ["Common", "Input", "Method", "Output", "Advanced"]


@pytest.mark.parametrize(
    "command", ["export", "identify", "map", "posterior", "predict", "recipe", "recover", "render"]
)
def test_help_has_the_five_usual_options_first_and_all_others_in_boxes(run, command):
    made = commands()[command]
    boxes = made.callback.help_groups
    named = [name for names in boxes.values() for name in names]
    there = [p.opts[0] for p in made.params if p.opts[0][:1] == "-"]
    assert named == there, "each option stands in one box, and the help has their order"
    assert len(boxes["Common"]) == 5
    out, _ = run(command, "--help")
    places = [out.find(f"─ {title} ─") for title in BOXES if boxes[title]]
    assert -1 not in places
    assert places == sorted(places)
    assert "─ Options ─" not in out
    for name in boxes["Common"]:
        assert places[0] < out.index(f" {name} ", places[0]) < places[1]


def test_commands_with_many_options_have_boxes():
    for command in commands().values():
        assert len(command.params) < 10 or hasattr(command.callback, "help_groups"), command.name


def test_a_shell_completes_commands_and_options(run, monkeypatch):
    """What `--install-completion` puts into a shell asks for completions in this way."""
    for typed, expected in (("glazejax iden", "identify"), ("glazejax map --cata", "--catalogue")):
        monkeypatch.setenv("_GLAZEJAX_COMPLETE", "complete_bash")
        monkeypatch.setenv("COMP_WORDS", typed)
        monkeypatch.setenv("COMP_CWORD", str(typed.count(" ")))
        assert run()[0] == f"{expected}\n"


LENGTHS = """
25um | 25e-6
25 | 25e-6
0.1 mm | 1e-4
500nm | 5e-7
2.5µm | 2.5e-6
1e-5 m | 1e-5
10mm | 0.01
"""
RANGES = """
1-50um | 1e-6 | 50e-6
1-50 | 1e-6 | 50e-6
500nm-0.1mm | 5e-7 | 1e-4
1 um - 50 µm | 1e-6 | 50e-6
20um | 20e-6 | 20e-6
"""


@pytest.mark.parametrize(("text", "metres"), rows(LENGTHS))
def test_lengths(text, metres):
    assert options.read_length(text) == float(metres)


@pytest.mark.parametrize(("text", "low", "high"), rows(RANGES))
def test_ranges_of_lengths(text, low, high):
    assert options.read_lengths(text, "--coat-thickness") == (float(low), float(high))


BAD_LENGTHS = """
read_length | thick | write a number and a unit
read_length | nan | write a number and a unit
read_length | | write a number and a unit
read_length | 25 furlongs | the unit 'furlongs' is unknown
read_length | 0 | above 0
read_length | -1um | above 0
read_length | 1m | at most 10 mm
read_lengths | thick | write the thinnest
read_lengths | 50-1 | must ascend
read_lengths | 0-1 | must ascend
read_lengths | 1-2ells | 'ells' is unknown
"""


@pytest.mark.parametrize(("reader", "text", "complaint"), rows(BAD_LENGTHS))
def test_bad_lengths(reader, text, complaint):
    with refusal(f"^--thickness is .*{complaint}"):
        getattr(options, reader)(text, "--thickness")


def test_ground_is_a_number_or_a_spectrum(tmp_path):
    ground = options.read_ground("0.5")
    assert ground.level == ground.on(np.arange(3.0)) == 0.5
    assert ground.words == "reflectance 0.5"
    path = tmp_path / "cards.csv"
    path.write_text("wavelength,white,bright\n400,0.8,1.1\n500,0.9,1.1\n600,1,1.1\n")
    ground = options.read_ground(f"{path}:white")
    np.testing.assert_allclose(ground.on(np.array([450.0, 550.0])), [0.85, 0.95], atol=0.01)
    assert ground.words == "white (cards.csv, mean 0.90)"
    assert "inside the paint" in ground.notes[-1]
    with refusal(r"cards\.csv: the ground: .* 300-500 nm .* keep to 400"):
        ground.on(np.array([300.0, 400.0, 500.0]))
    with refusal("a ground reflects 1 at most"):
        options.read_ground(f"{path}:bright")
    bare = options.read_ground(f"{path}:bright", bare=True)
    assert not any("inside the paint" in note for note in bare.notes)
    with refusal(r"--ground is 90; .* \(90 looks like percent: write 0.9\)"):
        options.read_ground("90")
    with refusal("--ground is -1"):
        options.read_ground("-1")
    with refusal(r"'none\.csv' is neither a number", FileNotFoundError):
        options.read_ground("none.csv")


def own_paints(folder, *names, header=HEADER, encoding=None):
    """A table of paints that are alike."""
    lines = [f"{name},{nm},1,1,0,0,True" for name in names for nm in (400, 500)]
    path = folder / "mine.csv"
    path.write_text("\n".join([header, *lines]), encoding=encoding)
    return path


def chosen_names(*words):
    return [paint.name for paint in options.choose_paints(*words)]


def test_paints_of_a_shelf(tmp_path):
    shelf = options.read_shelf(own_paints(tmp_path, "Red", "ZincWhite", "Blue"))
    assert list(shelf) == ["Red", "ZincWhite", "Blue"]
    for only, without, kept in (
        ("", "", ["Red", "ZincWhite", "Blue"]),
        ("blue, zinc white,Blue", "", ["Blue", "ZincWhite"]),
        ("", "Red", ["ZincWhite", "Blue"]),
    ):
        assert chosen_names(shelf, only, without) == kept
    with refusal("leave no paint"):
        options.choose_paints(shelf, "Red", "Red")
    with refusal("no pigment 'Mauve'"):
        options.choose_paints(shelf, "Mauve")


@pytest.mark.parametrize("name", ["Titanium", "titanium white", "TitanumWhite"])
def test_a_paint_of_another_catalogue_is_pointed_out(name):
    oils = catalogue.load("oils")
    with refusal("acrylics:TitaniumWhite") as elsewhere:
        options.choose_paints(oils, name)
    assert "--catalogue" not in str(elsewhere.value)
    with refusal("there is no pigment 'Nonsense'") as nowhere:
        options.choose_paints(oils, "Nonsense")
    assert "acrylics" not in str(nowhere.value)
    with refusal(r"the nearest are ZincWhite, ZincWhiteLinseed$"):
        options.choose_paints(oils, "Zinc")


@pytest.mark.parametrize("name", ["acrylics:TitaniumWhite", "acrylics/titanium white"])
def test_a_paint_of_another_catalogue_is_found_by_both(name, capsys):
    oils = catalogue.load("oils")
    white, zinc = options.choose_paints(oils, f"{name},ZincWhite")
    assert (white.name, zinc.name) == ("acrylics:TitaniumWhite", "ZincWhite")
    acrylics = catalogue.load("acrylics")
    np.testing.assert_array_equal(white.scattering, acrylics["TitaniumWhite"].scattering)
    assert "its own scale of length" in capsys.readouterr().err
    assert chosen_names(acrylics, f"{name},TitaniumWhite") == ["TitaniumWhite"]
    assert chosen_names(oils, "", "oils:ZincWhite") == [
        name for name in oils if name != "ZincWhite"
    ]
    assert capsys.readouterr().err == ""


def test_own_paints_stand_beside_a_catalogue_that_is_named(tmp_path, capsys):
    path = own_paints(tmp_path, "ZincWhite", "Mine")
    assert list(options.read_shelf(path)) == ["ZincWhite", "Mine"]
    assert capsys.readouterr().err == ""
    both = options.read_shelf(path, "oils")
    assert list(both) == [*catalogue.load("oils"), "Mine"]
    assert float(both["ZincWhite"].absorption[0]) == 1
    assert capsys.readouterr().err == (f"note: ZincWhite: that of {path} is taken, not of oils\n")
    theirs = options.choose_paints(both, "oils:ZincWhite,ZincWhite")
    assert [paint.name for paint in theirs] == ["oils:ZincWhite", "ZincWhite"]
    assert float(theirs[0].absorption[0]) != 1


def test_scales_of_two_catalogues_are_said_where_both_are_searched(capsys):
    shelf = catalogue.load("pigments")
    options.choose_paints(shelf, "cobalt blue,vermilion", "azurite")
    assert capsys.readouterr().err == ""
    options.choose_paints(catalogue.load("oils"), "ZincWhite,acrylics:TitaniumWhite", "")
    assert "assumes its own scale of length" in capsys.readouterr().err


def test_a_loosely_typed_name_is_that_of_an_own_paint(tmp_path):
    both = options.read_shelf(own_paints(tmp_path, "Cobalt Blue"), "oils")
    assert list(options.find_paints(["cobalt blue"], both)) == ["Cobalt Blue"]
    assert list(options.find_paints(["CobaltBlue"], both)) == ["CobaltBlue"]


@pytest.mark.parametrize(
    ("encoding", "header"),
    [
        ("utf-8-sig", HEADER),
        ("cp1252", HEADER),
        ("utf-16", HEADER),
        ("utf-8", f"# a comment\n\n{HEADER}"),
        ("utf-8", " " + HEADER.replace(",", " , ")),
    ],
)
def test_own_paints_are_there_in_whatever_form_they_are_read(tmp_path, encoding, header):
    path = own_paints(tmp_path, "Grün", header=header, encoding=encoding)
    assert list(options.read_shelf(path)) == ["Grün"]
    options.check_coats("Grün:5um", path)
    with refusal("no pigment 'Mauve'"):
        options.check_coats("Mauve:5um", path)


def test_a_table_without_pigments_is_refused_where_it_is_read(tmp_path):
    path = own_paints(tmp_path, "Red", header="name,nm")
    options.check_coats("Red:5um", path)
    with refusal("no column pigment"):
        options.read_shelf(path)


def test_no_two_options_write_one_file(here):
    options.check_outputs({"--out": Path("a.png"), "--csv": None, "--json": Path("b")}, False)
    with refusal(r"--csv and --out are both a\.png, the same file"):
        options.check_outputs({"--out": here / "a.png", "--csv": Path("./a.png")}, False)


def test_a_result_of_no_legal_name_leaves_no_folder(here):
    with refusal(r"--out new/a\.txt: pictures end in .png"):
        options.check_outputs({"--csv": Path("new/a.csv"), "--out": Path("new/a.txt")}, False)
    assert list(here.iterdir()) == []
    options.check_outputs({"--out": Path("new/a.png")}, False)
    assert (here / "new").is_dir()


def test_no_result_replaces_a_workbook_of_which_a_sheet_is_read(tmp_path):
    book = tmp_path / "book.xlsx"
    book.touch()
    with refusal(r"--csv is \S*book\.xlsx, a file that is read"):
        options.check_outputs({"--csv": book}, True, inputs=[Path(f"{book}:Films")])


def test_folders(tmp_path):
    assert options.check_folder(tmp_path / "new", False) == tmp_path / "new"
    (tmp_path / "x").touch()
    with refusal(r"not empty; choose another, or sing, or add --overwrite", FileExistsError):
        options.check_folder(tmp_path, False, instead=", or sing")
    assert options.check_folder(tmp_path, True) == tmp_path
    measured = tmp_path / "films.csv"
    with refusal("a file that is read"):
        options.check_folder(tmp_path, True, inputs=[None, measured])
    assert options.check_folder(tmp_path / "new", True, inputs=[measured]) == tmp_path / "new"
    with refusal("is a file", FileExistsError):
        options.check_folder(tmp_path / "x", True)
    with refusal("--out FOLDER"):
        options.check_folder(None, False)


def test_an_interrupt_keeps_what_is_finished():
    def chunks(stop):
        if stop == 0:
            raise KeyboardInterrupt
        yield [1, 2]
        if stop == 1:
            raise KeyboardInterrupt
        yield [3]

    for stop, finished in ((2, [[1, 2], [3]]), (1, [[1, 2]])):
        pieces, how = progress.collect(lambda _, stop=stop: chunks(stop), 3, "a", "b")
        assert pieces == finished
        assert how.interrupted == (stop == 1)
        assert 0 < how.first <= how.seconds
    with pytest.raises(KeyboardInterrupt):
        progress.collect(lambda _: chunks(0), 3, "a", "b")


def test_no_typer_is_one_sentence(monkeypatch, run):
    monkeypatch.setitem(sys.modules, "typer", None)
    _, err = run("--version", fails=2)
    assert 'pip install "glazejax[commands]"' in err


def test_a_slip_of_our_own_is_no_missing_extra(monkeypatch):
    def fail():
        raise ModuleNotFoundError("No module named 'glazejax.nonsense'", name="glazejax.nonsense")

    monkeypatch.setattr(cli, "make_app", fail)
    with refusal("nonsense", ModuleNotFoundError):
        cli.main()


def test_a_picture_is_refused_before_it_is_computed(monkeypatch, run, tmp_path):
    """colour-science puts a stand-in where matplotlib is missing: drawing would fail late, or not
    at all.
    """

    def without(name):
        raise PackageNotFoundError(name)

    monkeypatch.setattr(extras, "distribution", without)
    for words in (
        "render --coats Eosin:1um",
        "recipe --lab 50,0,0 --out a.png",
        "recover --simulate --out r",
        "posterior --simulate --paints Eosin --out r",
        f"identify {samples.path()} --out a.png",
    ):
        out, err = run(*words.split(), fails=2)
        assert out == ""
        assert err.endswith('pip install "glazejax[plots]"\n')
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("path", [None, Path("own.csv")])
def test_a_catalogue_of_no_name_is_refused(path):
    with refusal("there is no catalogue 'oil'; choose from oils, acrylics"):
        options.read_shelf(path, "oil")


@pytest.mark.parametrize("error", [RuntimeError("Unknown backend foo"), AssertionError()])
def test_a_device_that_is_not_there_is_said(monkeypatch, error):
    """JAX fails in two ways: for a name that it does not know, and for CUDA without its plug-in."""
    import jax

    def fail():
        raise error

    monkeypatch.setenv("JAX_PLATFORMS", "foo")
    monkeypatch.setattr(jax, "devices", fail)
    with refusal("JAX_PLATFORMS is 'foo', and JAX finds no such device"):
        cli._check_platforms()
    monkeypatch.delenv("JAX_PLATFORMS")
    cli._check_platforms()


def test_a_family_is_told_from_a_name_that_nobody_knows(run):
    _, err = run("recipe", "--lab", "50,20,30", "--only", "Azurite", fails=2)
    assert "azurite is a family of --catalogue pigments" in err
    _, err = run("predict", "10% Scarlet, 90% Titan", fails=2)
    assert "write '10 Scarlet + 90 Titan'" in err


def test_output_that_nobody_reads_is_no_error(tmp_path):
    """As before ``| head``: all that is computed is written to files all the same."""
    program = "from glazejax.commands.main import run_command; run_command()"
    words = [sys.executable, "-c", program, "paints", "--csv", "new/paints.csv"]
    for redirected in ("", ">&-"):
        line = f"set -o pipefail; {shlex.join(words)} --overwrite {redirected} | true"
        done = subprocess.run(
            ["bash", "-c", line],
            cwd=tmp_path,
            env=environment(tmp_path),
            capture_output=True,
            text=True,
            check=False,
        )
        assert (done.returncode, done.stderr) == (0, "")
        table = tmp_path / "new" / "paints.csv"
        assert table.read_text().startswith("exemplar")
        table.unlink()
