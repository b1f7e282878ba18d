import csv
import hashlib
import json
import os
from functools import partial
from typing import Any

import numpy as np
import pytest

from glazefit import ModelError, read_films, simulate_films
from glazefit.identify import command, identify
from glazefit.identify.result.in_tests import came_true
from glazejax import catalogue
from glazejax.io import write_table
from tests.commands import commands, invoke, succeed

from .palette import optical_depths
from .tables import read_rows, write_films

GRID = np.arange(400.0, 701.0, 10.0)
run = partial(invoke, "identify")
find = partial(succeed, "identify")


def one_line(result):
    """All that a command prints, on one line."""
    return " ".join(result.output.split())


def flat(path, level=0.4, grid: Any = GRID, name="grey"):
    """A table of one spectrum, the same at all bands."""
    write_table(path, ["Name", *(f"{nm:g}" for nm in grid)], [[name, *[level] * len(grid)]])
    return path


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    """Films of a red and a tint of it, in a table of four rows each."""
    paints = [catalogue.pigment(name) for name in ("Vermillion", "ZincWhite")]
    k, s = optical_depths(paints, 25e-6 * np.array([[1.0, 0.0], [0.3, 0.7]]))
    films = simulate_films(GRID, k, s, names=["red", "tint"])
    return write_films(tmp_path_factory.mktemp("films") / "films.csv", films)


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        ("", "no FILE was given"),
        ("films.csv --max-paints 4", "--max-paints is 4"),
        ("films.csv --opaque --ground 0.9", "show no ground"),
        ("films.csv --bare", "give --ground too"),
        ("films.csv --thickness 0", "--thickness is 0"),
        ("films.csv --painted 16200", "--painted is 16200; it must be a whole number from -10000"),
        ("films.csv --csv same.csv --residuals same.csv", "are both same.csv"),
        (
            "films.csv --report report.pdf",
            "--report report.pdf: a report ends in .html, such as report.html",
        ),
        ("films.csv --report a.html --csv a.csv", "the table of --report and --csv are both a.csv"),
        (
            "films.csv --report films.html",
            "the table of --report is films.csv, a file that is read",
        ),
        (
            "films.csv --pigments mine.csv --catalogue pigments",
            "the paints of mine.csv have none: add --catalogue oils or acrylics",
        ),
    ],
)
def test_wrong_options_are_one_error_before_anything_is_computed(arguments, complaint, here):
    for name in ("films.csv", "mine.csv"):
        (here / name).touch()
    result = run(*arguments.split())
    assert isinstance(result.exception, ValueError | FileNotFoundError)
    assert complaint in str(result.exception)


def test_the_help_states_the_model_s_usual_error():
    (error,) = (one for one in commands()["identify"].params if one.name == "model_error")
    assert "a hundredth of the reflectance" in error.help
    assert ModelError.share == 0.01
    assert error.help.endswith(f"Default: {ModelError.amplitude:g}.")


def test_ground_must_be_a_reflectance_a_file_or_said(table, tmp_path):
    one = flat(tmp_path / "one.csv")
    short = flat(tmp_path / "short.csv", grid=(500, 600))
    infrared = flat(tmp_path / "infrared.csv", grid=(900, 1000, 1100))
    named = flat(tmp_path / "named.csv", name="grey-sky")
    oils = f"{one} --catalogue oils"
    for words, complaint in (
        (f"{oils} --ground {one}:white", "holds no spectrum 'white'; there are grey"),
        (f"{oils} --ground {short}", "short.csv: the ground: cannot resample 500-600 nm"),
        (oils, "no ground is stated"),
        (f"{one} --ground {infrared}", "infrared.csv: the ground: the readings'"),
        (f"{one} --ground {infrared}", "no three bands in common"),
        (f"{one} --ground 0.9 --samples x", "holds no spectrum 'x'"),
        (f"{table} --samples read", "unknown sample 'read'"),
        (f"{named} --opaque --samples gray-sky", "'gray-sky'; the nearest is grey-sky"),
    ):
        assert complaint in str(run(*words.split()).exception)


@pytest.fixture
def no_search(monkeypatch):
    """Catalogue, bands of spectra and of grounds, and candidates of what was to be searched; nothing
    is.
    """
    sought = []

    def answer(wavelengths, spectra, paints, options, *, ground, **named):
        bands = [np.shape(each)[-1:] for each in (spectra, ground)]
        sought.append((len(paints), *bands, options.keep))
        raise KeyError("reached")

    monkeypatch.setattr(identify, "identify_chunks", answer)
    return sought


def test_a_whole_image_is_told_of_maps_before_it_is_searched(table, no_search, monkeypatch):
    """Nothing is searched here: the note comes first."""
    monkeypatch.setattr(command, "_MANY", 3)
    words = one_line(run(table, "--opaque", "--catalogue", "oils"))
    assert len(no_search) == 1
    assert "8 spectra are searched one by one" in words
    assert "glazejax map" in words


def test_pigments_are_asked_unless_another_catalogue_is_named(tmp_path, no_search):
    file = flat(tmp_path / "grey.csv")
    for words in ([], ["--catalogue", "oils"], ["--only", "azurite"], ["--without", "Azurite"]):
        run(file, "--opaque", *words)
    everything, azurites = (
        sum(paint.family in family for paint in catalogue.load("pigments").values())
        for family in (catalogue.families(), ["azurite"])
    )
    counts = [count for count, *_ in no_search]
    assert counts == [everything, len(catalogue.load("oils")), azurites, everything - azurites]


def test_answers_are_of_as_many_candidates_whatever_is_shown(tmp_path, no_search):
    """Pigments have the sum of the candidates that are kept: more of them with a report."""
    file = flat(tmp_path / "grey.csv")
    for words in ("", "--top 1", "--top 20", f"--report {tmp_path / 'answer.html'}", "--top 50"):
        run(file, "--opaque", "--catalogue", "oils", *words.split())
    assert [kept for *_, kept in no_search] == [40, 40, 40, 40, 50]


@pytest.mark.usefixtures("no_search")
def test_what_families_make_nothing_of_is_said(tmp_path):
    """Once, and where it was asked for alone."""
    file = flat(tmp_path / "grey.csv")
    words = "--noise 0.01 --model-error 0.02 --thickness 40um --thorough"

    def said(*more):
        return one_line(run(file, "--opaque", *more))

    note = "no effect on families of pigments"
    assert f"--noise, --model-error, --thickness, --thorough: {note}" in said(*words.split())
    assert note not in said()
    assert note not in said("--catalogue", "oils", *words.split())


def test_spectra_beyond_the_catalogue_are_cut_with_a_word(tmp_path, no_search):
    ground = flat(tmp_path / "ground.csv", 0.8, np.arange(390, 721, 10))
    cropped, beyond = (
        run(
            flat(tmp_path / f"{start}.csv", grid=np.arange(start, 1001, 2)),
            *f"--ground {ground} --catalogue oils --only Vermillion".split(),
        )
        for start in (360, 722)
    )
    words = one_line(cropped)
    assert "cropped to 400-700 nm step 2 (151 bands): the paints are known there only" in words
    assert "151 bands averaged to steps of 10 nm" in words
    assert (
        "have 722-1000 nm step 2 (140 bands) and the paints are known from 400 to 700 nm: 0 bands "
        "lie there, at least 6 are needed" in str(beyond.exception)
    )
    assert no_search == [(1, (31,), (31,), 40)]


def test_readings_of_families_are_cut_where_the_ground_ends(tmp_path, no_search):
    ground = flat(tmp_path / "ground.csv", 0.8, np.arange(420, 701, 10))
    file = flat(tmp_path / "red.csv", 0.5, np.arange(380, 781, 2))
    assert "cropped to 420-700 nm step 2 (141 bands): the ground is known there only" in one_line(
        run(file, "--ground", ground)
    )
    ((_, *bands, _),) = no_search
    assert bands == [(141,), (141,)]


def test_films_of_a_pipe_are_read_once_and_with_the_specular_component(table, monkeypatch):
    """Of SCI and SCE rows the former are films, searched twice, from a file that can be read once."""
    header, *rows = csv.reader(table.open())
    both = [
        [f"{name} {kind}", *(f"{float(r) + gloss:.6f}" for r in spectrum)]
        for name, *spectrum in rows
        for kind, gloss in (("SCI", 0.04), ("SCE", 0.0))
    ]
    text = "\n".join(",".join(row) for row in (header, *both))
    searches = []
    monkeypatch.setattr(
        command, "_identify", lambda typed, films, *_: searches.append((typed["catalogue"], films))
    )
    end, start = os.pipe()
    with os.fdopen(start, "w") as pipe:
        pipe.write(text)
    result = find(f"/dev/fd/{end}")
    os.close(end)
    assert "with the specular component included (SCI) are used" in one_line(result)
    assert [catalogue for catalogue, _ in searches] == ["pigments", "oils"]
    read = read_films(table)
    for _, films in searches:
        assert films.names == read.names
        np.testing.assert_allclose(films.over_white, read.over_white + 0.04, atol=1e-6)


def test_references_are_read_by_the_search_for_families_alone(table, monkeypatch):
    """Of two searches that films over cards have; a report lists the files that its search read."""
    files = []
    monkeypatch.setattr(
        command, "_identify", lambda typed, films, read, *_: files.append(read["--references"])
    )
    find(table, "--references", table)
    assert files == [table, None]


@pytest.mark.slow
def test_films_over_cards_are_asked_for_pigments_and_for_films(table, tmp_path):
    """Families from the white card's readings, films from both cards, each in files of its own."""
    file = tmp_path / "found.csv"
    (tmp_path / "found-oils.csv").touch()
    assert "found-oils.csv" in str(run(table, "--csv", file).exception)
    assert not file.exists()
    # What is told of families is not asked of the oils.
    words = f"{table} --samples red --csv {file} --overwrite --painted 1620 --elements Hg"
    result = find(*words.split())
    asked = [line for line in result.output.splitlines() if line.startswith("Asked: ")]
    assert [line.split(",")[0] for line in asked] == ["Asked: pigments", "Asked: oils"]
    assert result.output.splitlines()[-1] == asked[1]
    assert "red: vermilion, probability" in result.output
    assert "read without the near infrared" in result.output
    assert "--catalogue oils asks for films" in asked[0]
    assert "--catalogue pigments asks" in asked[1]
    first = read_rows(file)[0]
    assert first["families"] == "vermilion"
    assert first["nearest_exemplars"].startswith("vermilion/")
    assert " of " in first["right_in_tests"]
    assert "Vermillion" in (tmp_path / "found-oils.csv").read_text()


@pytest.mark.slow
def test_a_report_by_family_is_filed(shared_data, tmp_path):
    """Families with formula, years and nearest exemplars; what a year forbids is marked."""
    page = tmp_path / "report.html"
    file = shared_data / "hyperdoc" / "reflectance.tsv"
    words = f"{file} --opaque --instrument 45:0 --catalogue pigments --samples 01A,10A"
    find(*f"{words} --painted 1200 --report {page}".split())
    text = page.read_text()
    assert "2CuCO3·Cu(OH)2" in text
    assert "PB30" in text
    assert "gum arabic" in text
    assert "not of 1200: lead-tin yellow was in use 14th-18th c." in text
    record = json.loads((tmp_path / "report.json").read_text())
    assert [spot["name"] for spot in record["spots"]] == ["01A", "10A"]
    first = record["spots"][0]
    assert first["families"][0]["families"][0] == "azurite"
    right, answers = came_true(first["families"][0]["probability"], infrared=True)
    assert first["in_tests"] == {"right": right, "answers": answers}
    assert f"in tests {right / answers:.0%} right" in first["words"]
    # Exemplars that are known in the visible alone are drawn there alone.
    known = [value is not None for value in first["explanations"][0]["fitted"][0]]
    assert any(known)
    assert len(known) == len(record["measurement"]["wavelengths_nm"])
    row = read_rows(tmp_path / "report.csv")[0]
    assert row["right_in_tests"] == f"{right} of {answers}"
    assert float(row["probability"]) == pytest.approx(first["families"][0]["probability"])


@pytest.mark.slow
def test_a_report_is_filed(table, tmp_path):
    page, ground = tmp_path / "report.html", flat(tmp_path / "ground.csv", 0.8)
    answers, residuals, picture = (tmp_path / name for name in ("a.csv", "r.csv", "a.png"))
    options = f"--ground {ground} --catalogue oils --max-paints 2 --report {page}".split()
    options += ["--samples", "red_ow,tint_ow", "--only", "Vermillion,ZincWhite,CobaltBlue"]
    subject = ("--object", "A <panel>", "--inventory", "A-1", "--spot", "sky")
    files = ("--csv", answers, "--residuals", residuals, "--out", picture)
    result = find(table, *options, *subject, "--operator", "N. N.", *files)
    assert f"Wrote the report to {page}" in one_line(result).replace("- ", "-")
    filed = json.loads(page.with_suffix(".json").read_text())
    assert [spot["name"] for spot in filed["spots"]] == ["red_ow", "tint_ow"]
    assert list(filed["subject"].values()) == ["A <panel>", "A-1", "sky", "N. N."]
    assert filed["options"]["--max-paints"] == 2
    assert filed["command"].startswith("glazejax identify ")
    assert "--max-paints 2" in filed["command"]
    assert "--top" not in filed["command"]
    sums = {each["role"]: each["sha256"] for each in filed["inputs"]}
    assert sums == {
        role: hashlib.sha256(path.read_bytes()).hexdigest()
        for role, path in (("FILE", table), ("--ground", ground))
    }
    assert filed["catalogue"]["sha256"] == catalogue.checksum()[1]
    assert set(filed["catalogue"]["paints"]) == {"Vermillion", "ZincWhite", "CobaltBlue"}
    tint = filed["spots"][1]
    names = [paint["name"] for paint in tint["explanations"][0]["paints"]]
    assert names == ["ZincWhite", "Vermillion"]
    assert "Most probable" in result.output
    first = {row["spectrum"]: row for row in read_rows(answers) if row["rank"] == "1"}
    assert first["red_ow"]["paint_1"] == "Vermillion"
    off, *others = read_rows(residuals)
    assert len(others) == 2 * GRID.size - 1
    left = float(off["measured"]) - float(off["fitted"])
    assert left == pytest.approx(float(off["residual"]), abs=1e-12)
    assert picture.stat().st_size > 10_000
