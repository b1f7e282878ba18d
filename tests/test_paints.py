"""`glazejax paints`: families, their exemplars, and where these are from."""

import csv

import pytest

from glazejax import catalogue

from .commands import invoke
from .refusals import refusal
from .tables import rows


def said(*words):
    done = invoke("paints", *words)
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
    text = said("--family", "smalt", "--out", picture)
    assert text.startswith("smalt: K-Co glass; PB32; in use 15th-19th c.")
    assert "k/s alone; s is that of other families" in text
    assert "k and s by a coat over black, greys and white" in said("--family", "cadmium red")
    assert "CC BY 4.0" in text
    assert picture.stat().st_size > 5000


def test_the_exemplars_as_a_table(tmp_path):
    path = tmp_path / "all.csv"
    said("--csv", path)
    with path.open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(catalogue.provenance())
    assert {row["licence"] for row in rows} == {"CC BY 4.0", "CC0 1.0", "MIT", "public domain"}


REFUSED = """
--family azurit | no family of pigments is called 'azurit'; nearest: azur
--out x.png | name it by --family
--references TABLE --family smalt | leave out --family and --out
--instrument 45:0 | ^--instrument has no meaning without --references FILE$
--quantity reflectance | ^--quantity has no meaning without --references FILE$
--unit nm | ^--unit has no meaning without --references FILE$
--scale 100 | ^--scale has no meaning without --references FILE$
"""


@pytest.mark.parametrize(("words", "complaint"), rows(REFUSED))
def test_what_is_refused_is_one_sentence(here, words, complaint):
    (here / "TABLE").touch()
    with refusal(complaint):
        said(*words.split())


def test_references_are_listed_as_they_are_understood(tmp_path):
    library, table = tmp_path / "own.csv", tmp_path / "listed.csv"
    bands = range(400, 701, 10)
    rows = {"Lapis [no 3], PB29": 0.3, "yellow PY999": 0.5, "smalt, 2": 0.4}
    lines = [f'"{name}",' + ",".join([str(value)] * len(bands)) for name, value in rows.items()]
    library.write_text("\n".join([",".join(["Name", *map(str, bands)]), *lines]))
    text = said("--references", library, "--instrument", "45:0", "--csv", table)
    assert (
        "ultramarine            400-700   PB29          k/s alone          Lapis [no 3], PB29"
        in text
    )
    assert "2 references of 2 families" in text
    assert "not understood: yellow PY999: no family has the Colour Index number PY999; name" in text
    with table.open() as file:
        assert [row["family"] for row in csv.DictReader(file)] == ["ultramarine", "smalt"]
