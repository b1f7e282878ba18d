import json
import re
from collections import defaultdict
from functools import partial
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import matplotlib.image
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from rich.console import Console

from glazefit import colourchecker_targets
from glazefit.recipe import command, recipe, report
from glazefit.recipe.task import make_task
from glazefit.recover.predict import mixture, prediction
from glazejax import Pigment
from glazejax.commands import progress
from glazejax.io import SpectraTable, read_spectra, write_spectra
from glazejax.paint.describe import parse_coats
from glazejax.paint.pigment_table import write_pigments

from .palette import GRID, PALETTE
from .tables import read_rows


@pytest.fixture
def run(command_line):
    """Run the command on the made-up paints; gives output and errors."""
    recipe = command_line("recipe", columns=100)
    write_pigments("paints.csv", PALETTE)

    def call(*words, **fails):
        paints = () if "--pigments" in words else ("--pigments", "paints.csv")
        return recipe(*words, *paints, **fails)

    return call


@pytest.mark.slow
def test_patches_of_a_chart(run, tmp_path):
    """Two patches with two paints in one coat at most, to the screen, a picture, a table and a file
    of all.
    """
    search = "--max-coats 1 --max-paints 2 --count 2"
    files = "--csv r.csv --json r.json --spectra s.csv --out found.png"
    out, _ = run("--patch", "dark skin,white", *f"{search} {files}".split())
    assert "dark skin" in out
    assert "white 9.5" in out
    assert min(matplotlib.image.imread(tmp_path / "found.png").shape[:2]) > 300

    rows = read_rows(tmp_path / "r.csv")
    recipes = defaultdict(list)
    for row in rows:
        recipes[row["target"], row["recipe"]].append(row)
    assert len(recipes) == 4
    for parts in recipes.values():
        assert len(parts) <= 2
        assert {part["coat"] for part in parts} == {"1"}
        assert sum(float(part["share"]) for part in parts) == pytest.approx(1)
        assert 1 <= float(parts[0]["thickness_um"]) <= 50
    found = json.loads((tmp_path / "r.json").read_text())
    reached = sum(recipes[0]["delta_e_2000"]["D65"] < 1 for recipes in found)
    assert f"{reached} of 2 targets within a ΔE00 of 1" in out
    first = found[0][0]
    assert first["target"] == "dark skin"
    assert first["delta_e_2000"]["D65"] == pytest.approx(float(rows[0]["delta_e_2000"]), abs=1e-3)
    assert len(first["reflectance"]) == len(first["wavelengths_nm"]) == GRID.size

    table = read_spectra("s.csv")
    assert list(table.names) == ["dark skin", "white 9.5"]
    target = colourchecker_targets(["dark skin"])[0]
    assert target.wavelengths is not None
    assert target.reflectance is not None
    assert_array_equal(table.wavelengths, GRID)
    assert_allclose(table["dark skin"], np.interp(GRID, target.wavelengths, target.reflectance))


@pytest.mark.slow
def test_an_interrupt_keeps_what_is_finished(run, tmp_path, monkeypatch):
    def cut_short(task, progress):
        yield next(real(task))
        raise KeyboardInterrupt

    real = recipe.recipe_chunks
    monkeypatch.setattr(recipe, "recipe_chunks", cut_short)
    monkeypatch.setattr(recipe, "_GROUP", 1)
    words = "--patch red,blue --max-coats 1 --max-paints 2 --count 1 --csv r.csv"
    out, _ = run(*words.split(), fails=130)
    assert "wrote r.csv" in out
    assert "Interrupted: 1 of 2 targets were finished" in out
    assert [row["target"] for row in read_rows(tmp_path / "r.csv")] == ["red"]


def test_a_wrong_line_is_said_before_a_file_that_exists(check_refusal, tmp_path):
    (tmp_path / "recipes.png").write_bytes(b"mine")
    for words, message in (
        ("--lab 50", "three numbers"),
        ("--lab 50,20,30 --only Mauve", "Mauve"),
        ("--lab 50,20,30", "recipes.png exists"),
    ):
        check_refusal(message, *words.split(), "--out", "recipes.png")
    assert (tmp_path / "recipes.png").read_bytes() == b"mine"


@pytest.mark.parametrize(
    "words",
    [
        "--glazes",
        "--max-paints 1",
        "--max-coats 2",
        "--coat-thickness 2-7",
        "--test-illuminant FL11",
        "--metamerism 0.5",
        "--count 2",
        "--seed 1",
    ],
)
def test_what_a_correction_does_not_use_is_refused(check_refusal, words):
    line = f"--lab 50,0,0 --after paints.csv --mixed White {words}"
    check_refusal(f"{words.split()[0]} is for recipes; --after adds", *line.split())


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("", "give one target"),
        ("--lab 50,0,0 --unit um", "--unit is of spectra of a file"),
        ("--srgb #fff --scale 7", "--scale is of spectra of a file"),
        ("--lab 50,0,0 --srgb #fff", "give one target"),
        ("--lab 50;0;0", "--lab is '50;0;0'"),
        ("--spectrum none.csv", "none.csv"),
        ("--lab 50,0,0 --samples a", "--samples names spectra of a file"),
        (
            "--lab 50,0,0 --catalogue oils --only LeadWhite,Minium --modern",
            "--modern leaves no paint (LeadWhite: poisonous (lead), rarely sold; Minium:",
        ),
        ("--lab 50,0,0 --spectra s.csv", "has no spectrum"),
        (
            "--srgb #8a4b2d --illuminants D65,A",
            "--illuminants D65,A needs a target with a spectrum",
        ),
        ("--lab 50,0,0 --illuminants D65,A", "--illuminants D65,A needs a target with a spectrum"),
        (
            "--lab 50,0,0 --glazes --max-coats 7",
            "--max-coats is 7; it must be a whole number from 1 to 6",
        ),
        (
            "--patch red --illuminants D65,A --after paints.csv --mixed White",
            "--illuminants D65,A: --after corrects a colour under one light",
        ),
    ],
)
def test_mistakes_get_one_line(run, words, message):
    out, err = run(*words.split(), fails=2)
    assert out == ""
    assert message in err


@pytest.mark.slow
def test_one_target_shows_how_far_its_search_is(run, tmp_path, monkeypatch):
    """Without a terminal: percent of both stages, and the time left. No file is written unasked."""
    monkeypatch.setattr(progress, "lines", partial(progress.lines, 0.001))
    before = set(tmp_path.iterdir())
    out, err = run("--lab", "50,20,30", "--max-coats", 2, "--max-paints", 2)
    assert "ΔE00" in out
    assert "wrote" not in out
    assert set(tmp_path.iterdir()) == before
    for stage in ("looking through all sets of paints", "refining recipes"):
        shares = re.findall(rf"^{stage} \d+ of \d+ \((\d+)%\), after", err, re.MULTILINE)
        assert len({*shares}) > 1, stage
    assert re.search(r"refining recipes .* about \d+ s left", err)


def test_a_ground_is_used_where_it_and_the_paints_are_measured(check_refusal, monkeypatch):
    """Paints of 380-750 nm over a card of 400-700 nm."""
    wide = np.arange(380.0, 751.0, 10.0)
    one = np.full(wide.size, 1e5)
    write_pigments("wide.csv", [Pigment(name, wide, one, one) for name in ("One", "Two")])

    def card(first, last):
        bands = np.arange(first, last + 1, 10.0)
        table = SpectraTable(bands, ("card",), np.full((1, bands.size), 0.7))
        write_spectra(table, "card.csv", overwrite=True)
        return ["--lab", "50,0,0", "--pigments", "wide.csv", "--ground", "card.csv"]

    def stop(task, **_):
        searched.append(task)
        raise ValueError("the search begins")

    searched = []
    monkeypatch.setattr(recipe, "recipe_chunks", stop)
    check_refusal("the search begins", *card(400, 700))
    (task,) = searched
    assert_array_equal(task.wavelengths, np.arange(400.0, 701.0, 10.0))
    assert_allclose(task.ground, np.full(31, 0.7))
    check_refusal("card.csv: the ground: 500-600 nm", *card(500, 600))
    check_refusal("they do not meet; choose another spectrum", *card(800, 900))


def test_an_unknown_strength_is_told_of_a_coat_that_has_the_paint(monkeypatch):
    """A thin glaze of it over a thick white: the white's coat says nothing of it."""
    predict = Mock()
    monkeypatch.setattr(mixture, "predict_mixture", predict)
    monkeypatch.setattr(prediction, "say_paint_errors", lambda *_: "2.0")
    white, _, red, *_ = PALETTE
    untold = Pigment("Red", GRID, red.absorption, red.scattering, identifiable=GRID < 0)
    best: Any = SimpleNamespace(
        paints=("Red", "White"), coats=parse_coats("Red:2um, 0.5*Red+0.5*White:5um, White:40um")
    )
    task: Any = SimpleNamespace(pigments=(white, untold), instrument=None, illuminants=("D65",))
    said = command._say_unknown_strength(best, task, "2")
    assert "strength of Red is unknown, which adds ΔE00 2.0" in said
    (((_, parts, thickness), _),) = predict.call_args_list
    assert parts == {"Red": 0.5, "White": 0.5}
    assert thickness == pytest.approx([5e-6])


@pytest.mark.parametrize(("lights", "told"), [(("D65",), True), (("D65", "A"), False)])
def test_brackets_are_explained_where_there_are_some(monkeypatch, capsys, lights, told):
    monkeypatch.setattr(report, "print_recipes", lambda *_: None)
    target = colourchecker_targets(["red"])[0]
    task = make_task([target], PALETTE, illuminants=lights)
    best: Any = SimpleNamespace(
        target=target, test_illuminant="A", delta_e=dict.fromkeys(task.illuminants, 0.5)
    )
    command._print([[best]], task, 1.0, Console(width=200), "")
    said = capsys.readouterr().out
    assert ("In brackets ΔE00 under A; per 10 %" in said) is told
    assert ("Per 10 %" in said) is not told
