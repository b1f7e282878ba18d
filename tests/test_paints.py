"""`glazejax paints`: families, their exemplars, and where these are from."""

import csv

import pytest
from typer.testing import CliRunner

from glazejax import catalogue
from glazejax.commands.main import make_app


def said(*words):
    done = CliRunner().invoke(make_app(), ["paints", *words])
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        raise done.exception
    return done.output


def test_all_families_are_listed():
    text = said()
    for family in ("azurite", "lead-tin yellow", "vermilion"):
        assert f"\n{family} " in text
    assert f"{len(catalogue.provenance())} exemplars of 51 families" in text
    assert "without an exemplar" in text


def test_a_family_is_listed_and_drawn(tmp_path):
    picture = tmp_path / "smalt.png"
    text = said("--family", "smalt", "--out", str(picture))
    assert text.startswith("smalt: K-Co glass; PB32; in use 15th-19th c.")
    assert "four thicknesses over white" in text
    assert "CC BY 4.0" in text
    assert picture.stat().st_size > 5000


def test_the_exemplars_as_a_table(tmp_path):
    path = tmp_path / "all.csv"
    said("--csv", str(path))
    with path.open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(catalogue.provenance())
    assert {row["licence"] for row in rows} == {"CC BY 4.0", "CC0 1.0", "MIT", "public domain"}


def test_a_family_that_there_is_not_is_one_sentence(tmp_path):
    with pytest.raises(ValueError, match="no family of pigments is called 'azurit'; nearest: azur"):
        said("--family", "azurit")
    with pytest.raises(ValueError, match="name it by --family"):
        said("--out", str(tmp_path / "x.png"))
