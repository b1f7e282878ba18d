"""The command `glazejax convert`."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from glazejax.io import SpectraTable, read_spectra, write_spectra
from glazejax.io.words import parse_grid

from .commands import invoke, succeed
from .io.samples import GRID, spectra
from .tables import rows


@pytest.fixture
def chart(tmp_path):
    """Table of percent."""
    path = tmp_path / "chart.csv"
    lines = [["Name", *(f"{w:g}" for w in GRID)]]
    lines += [
        [name, *(f"{100 * r:.4f}" for r in row)] for name, row in zip("abc", spectra(), strict=True)
    ]
    path.write_text("\n".join(map(",".join, lines)))
    return path


convert = partial(succeed, "convert")


def refuse(complaint, *words):
    error = invoke("convert", *words).exception
    assert isinstance(error, ValueError)
    assert complaint in str(error)


def test_flags_take_no_value_in_the_help():
    for words in ([], ["convert"]):
        shown = invoke(*words, "--help").output
        assert "--help" in shown
        assert "<bool>" not in shown


@pytest.mark.parametrize("name", ["out.csv", "out.tsv", "out.cxf", "out.hdr"])
def test_every_format(chart, tmp_path, name):
    done = convert(chart, tmp_path / name)
    assert_allclose(read_spectra(tmp_path / name).reflectance, spectra(), atol=1e-6)
    assert "CSV table, a sample a row, 3 spectra, 400-700 nm step 10 (31 bands)" in done.output
    assert "stored in percent" in done.output
    assert f"wrote  {tmp_path / name}" in done.output


def test_resampled_and_long(chart, tmp_path):
    convert(chart, tmp_path / "out.csv", "--resample", "410:690:5", "--long")
    table = read_spectra(tmp_path / "out.csv")
    assert table.format == "CSV table, a sample a column"
    assert_array_equal(table.wavelengths, np.arange(410, 691, 5))
    assert_allclose(table.reflectance, spectra(3, table.wavelengths), atol=1e-3)


@pytest.mark.parametrize(
    ("kind", "written"), [("cxf", ["out.dat"]), ("envi", ["out.hdr", "out.sli"])]
)
def test_format_by_name_of_the_option(chart, tmp_path, kind, written):
    """A library is two files."""
    done = convert(chart, tmp_path / "out.dat", "--to", kind)
    paths = [tmp_path / name for name in written]
    assert f"wrote  {' and '.join(map(str, paths))}: 3 spectra" in done.output
    assert sorted(tmp_path.glob("out.*")) == paths
    assert read_spectra(paths[0]).format.startswith({"cxf": "CxF3", "envi": "ENVI"}[kind])


@pytest.mark.parametrize(
    "line", ["refl.hdr refl.sli", "refl.img refl.sli", "refl.hdr refl.img --to csv"]
)
def test_neither_half_of_a_library_that_is_read_is_replaced(chart, here, line):
    convert(chart, "refl.hdr")
    Path("refl.sli").rename("refl.img")
    before = {path: path.read_bytes() for path in here.iterdir()}
    complaint = "a file that is read: give the result another name"
    refuse(complaint, *line.split(), "--overwrite")
    assert {path: path.read_bytes() for path in here.iterdir()} == before


def test_a_table_beside_a_library_may_be_converted_again(chart, tmp_path):
    convert(chart, tmp_path / "chart.hdr")
    convert(chart, tmp_path / "chart.hdr", "--overwrite")


WRONG_GRIDS = """
400:700 | is not FROM:TO:STEP
a:b:c | is not FROM:TO:STEP
400:700:0 | STEP above 0
700:400:10 | TO not below it
400:705:10 | end at 700
400:inf:10 | FROM must be positive
400:700:1e-9 | too many
380:700:10 | --resample 380:700:10: cannot resample 400-700 nm
"""


@pytest.mark.parametrize(("grid", "complaint"), rows(WRONG_GRIDS))
def test_wrong_grids(chart, tmp_path, grid, complaint):
    refuse(complaint, chart, tmp_path / "out.csv", "--resample", grid)
    assert not (tmp_path / "out.csv").exists()


def test_both_ends_belong_to_a_grid():
    assert parse_grid("400:402:0.5") == [400, 400.5, 401, 401.5, 402]
    assert parse_grid("550:550:10") == [550]


def test_one_spectrum_is_one(tmp_path):
    write_spectra(SpectraTable(GRID, ("a",), spectra(1)), tmp_path / "in.csv")
    assert "1 spectrum, 400-700" in convert(tmp_path / "in.csv", tmp_path / "out.csv").output


def test_instruments_columns(shared_data, tmp_path):
    done = convert(
        shared_data / "rrt" / "pigment_panel_reference.csv",
        tmp_path / "out.cxf",
        "--resample",
        "400:700:10",
    )
    assert (
        "columns of numbers without a header, 13 spectra, 349.542-2196.58 nm uneven (1009 bands)"
        in done.output
    )
    table = read_spectra(tmp_path / "out.cxf")
    assert table.names[0] == "column 2"
    reference = np.loadtxt(shared_data / "rrt" / "pigment_panel_reference.csv")
    nearest = np.abs(reference[:, :1] - GRID).argmin(axis=0)
    assert_allclose(table.reflectance, reference[nearest, 1:].T, atol=0.01)
