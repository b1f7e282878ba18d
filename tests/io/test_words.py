import csv

import pytest
from hypothesis import given
from hypothesis import strategies as st

from glazejax.io import SpectraTable, read_spectra, write_spectra, write_table
from glazejax.io.words import shield_name, unshield_name
from glazejax.paint.pigment_table import read_pigments

from ..refusals import refusal
from .samples import CGATS, GRID, jcamp_block, spectra

FILE = "t.csv"
FORMULAS = ("=1+1", "+cmd", "-a", "@SUM(A1)", "'=1", "''+x")


@pytest.mark.parametrize("long", [False, True])
@pytest.mark.parametrize("ending", ["csv", "tsv"])
def test_no_name_is_a_formula_in_a_spreadsheet_and_all_read_back(tmp_path, ending, long):
    path = tmp_path / f"t.{ending}"
    write_spectra(SpectraTable(GRID, FORMULAS, spectra(len(FORMULAS))), path, long=long)
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.reader(file, delimiter="\t" if ending == "tsv" else ","))
    names = rows[0][1:] if long else [row[0] for row in rows[1:]]
    assert all(name.startswith("'") for name in names)
    assert read_spectra(path).names == FORMULAS


def test_texts_of_results_are_no_formulas_and_numbers_stay(tmp_path):
    path = tmp_path / "t.csv"
    write_table(path, ["=1+1", "value"], [["@a", -0.5], ["plain", "-0.5"]])
    assert path.read_text() == "'=1+1,value\n'@a,-0.5\nplain,-0.5\n"


@given(st.text())
def test_shields_come_off_again(name):
    assert unshield_name(shield_name(name)) == name


@pytest.mark.parametrize("word", ["1_0", "١٠", "１０"])
@pytest.mark.parametrize(
    "text",
    [
        "Name,400,410\nred,WORD,20\n",
        "Name,400,410\nred,20,WORD\nblue,20,30\n",
        "nm,red\n400,WORD\n410,20\n",
        "400 12\n410 20\n420 30\n430 WORD\n",
        CGATS.replace("0.60", "WORD"),
        jcamp_block().replace("400 ", "WORD ", 1),
    ],
)
def test_python_s_own_and_other_scripts_digits_are_no_numbers(read, text, word):
    with refusal(r"t\.csv"):
        read(text.replace("WORD", word))


def test_shields_come_off_in_every_layout(read):
    assert read("sample,wavelength,reflectance\n'=1,400,.1\n'=1,410,.2\n").names == ("=1",)
    assert read(CGATS.replace("blue", "'=1")).names[1] == "=1"


def test_a_pigment_s_name_is_no_formula_and_reads_back(tmp_path):
    path = tmp_path / "paints.csv"
    rows = [["=1+1", nm, 10.0, 20.0] for nm in (400, 500)]
    write_table(path, ["pigment", "wavelength_nm", "absorption", "scattering"], rows)
    assert path.read_text().splitlines()[1].startswith("'=1+1,")
    assert list(read_pigments(path)) == ["=1+1"]
