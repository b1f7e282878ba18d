"""Files that are written read back bit for bit, and nothing is replaced unasked."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from glazejax.io import SpectraTable, read_spectra, write_spectra
from glazejax.io.files.write import WIDE_TITLE

from ..refusals import refusal
from .samples import GRID, NAMES, TABLE, same, spectra, tables

EVEN = st.builds(
    lambda start, step, count: start + step * np.arange(count),
    st.integers(360, 400),
    st.integers(1, 20),
    st.integers(2, 40),
)


@pytest.mark.parametrize(
    ("name", "layout", "kind"),
    [
        ("t.csv", {}, tables()),
        (
            "t.tsv",
            {"long": True},
            tables(
                names=NAMES.filter(lambda name: name[0] not in ".," and not name[0].isdecimal())
            ),
        ),
        ("t.cxf", {}, tables(EVEN)),
        ("t.hdr", {}, tables(names=NAMES.filter(lambda name: not set(name) & set(",{}")))),
    ],
    ids=["wide", "long", "CxF", "ENVI library"],
)
@given(data=st.data())
def test_files_read_back(tmp_path_factory, name, layout, kind, data):
    table = data.draw(kind)
    path = tmp_path_factory.mktemp("out") / name
    assert write_spectra(table, path, **layout) == []
    same(read_spectra(path), table.wavelengths, table.reflectance, table.names)


def test_envi_is_legal_for_spectral_python(here):
    import spectral.io.envi as spy

    write_spectra(TABLE, "t.sli")
    library: Any = spy.open("t.hdr")
    np.testing.assert_array_equal(library.spectra, spectra())
    assert library.names == ["a", "b", "c"]
    assert library.bands.centers == GRID.tolist()


@pytest.mark.parametrize("other", ["t", "t.img"])
def test_no_library_is_written_that_another_file_would_stand_for(here, other):
    Path(other).write_bytes(b"mine")
    with refusal(
        f"{other} lies next to t.hdr and would be read in place of t.sli", FileExistsError
    ):
        write_spectra(TABLE, "t.hdr", overwrite=True)
    assert sorted(path.name for path in here.iterdir()) == [other]
    assert Path(other).read_bytes() == b"mine"


def test_bright_spectra_survive_csv(here):
    table = SpectraTable(GRID, ("glare",), np.full((1, GRID.size), 2.5))
    write_spectra(table, "t.csv")
    assert Path("t.csv").read_text().startswith(f'"{WIDE_TITLE}",400,')
    same(read_spectra("t.csv"), GRID, table.reflectance, ["glare"])


@pytest.mark.parametrize("name", ["t.csv", "t.tsv", "t.cxf", "t.hdr"])
def test_own_files_state_what_they_hold(here, name):
    write_spectra(dataclasses.replace(TABLE, reflectance=spectra() / 100), name)
    assert read_spectra(name).notes == []


def test_names_that_a_format_cannot_hold(here):
    table = SpectraTable(GRID, ("a,{b}", " x\ny ", "", "x y"), spectra(4))
    notes = write_spectra(table, "t.hdr")
    assert read_spectra("t.sli").names == ("a;(b)", "x y", "spectrum 3", "x y (2)")
    assert len(notes) == 3


@pytest.mark.parametrize("name", ["t.csv", "t.cxf", "t.hdr"])
def test_existing_files_are_kept(here, name):
    path = Path(name)
    write_spectra(TABLE, path)
    before = {file.name: file.read_bytes() for file in here.iterdir()}
    brighter = dataclasses.replace(TABLE, reflectance=spectra() * 1.01)
    with refusal("--overwrite", FileExistsError):
        write_spectra(brighter, path)
    assert {file.name: file.read_bytes() for file in here.iterdir()} == before
    write_spectra(brighter, path, overwrite=True)
    same(read_spectra(path), GRID, brighter.reflectance, TABLE.names)


@pytest.mark.parametrize(
    ("grid", "names", "name", "how", "complaint"),
    [
        (GRID, "ab", "t.png", {}, "no format is known"),
        (GRID, "ab", "t.csv", {"format": "xml"}, "no format is known by 'xml'"),
        (GRID, "ab", "t.cxf", {"long": True}, "only CSV has a long layout"),
        (GRID, ("450", "b"), "t.csv", {"long": True}, "names that are numbers"),
        (GRID + 0.5, "ab", "t.cxf", {}, "not 400.5-700.5 nm step 10"),
        (GRID**2 / 400, "ab", "t.cxf", {}, "resample first, to 400:700:10"),
        (GRID + 10, "ab", "t.cxf", {}, "write CSV or ENVI"),
    ],
)
def test_what_cannot_be_written_is_said(here, grid, names, name, how, complaint):
    with refusal(complaint):
        write_spectra(SpectraTable(grid, tuple(names), spectra(2, grid)), name, **how)
    assert list(here.iterdir()) == []
    with refusal("folder", FileNotFoundError):
        write_spectra(SpectraTable(GRID, ("a",), spectra(1)), "no/t.csv")


@pytest.mark.parametrize("value", [np.nan, np.inf, -0.1, 4.0])
def test_only_legal_fractions_are_written(here, value):
    values = spectra()
    values[1, 2] = value
    with refusal(r"'b' is .* at 420 nm; it must be a fraction from 0 to 3"):
        write_spectra(dataclasses.replace(TABLE, reflectance=values), "t.csv")
    with refusal("make no table"):
        write_spectra(SpectraTable(GRID, ("a",), spectra()), "t.csv")


def test_what_is_left_behind_is_said(here):
    table = SpectraTable(GRID, ("a",), spectra(1), attributes={"grams": ("2.5",)})
    assert write_spectra(table, "t.csv") == ["only names and spectra are written, not grams"]
