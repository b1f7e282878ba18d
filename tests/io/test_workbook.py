"""Excel workbooks that openpyxl writes."""

import io
import re
import sys
import zipfile

import numpy as np
import pytest

from glazejax.io import read_sample, read_spectra
from glazejax.io.formats import workbook

from .samples import GRID, complains, same, spectra

R = spectra(2)


@pytest.fixture
def book(tmp_path):
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    wide = book.active
    wide.title = "Films"
    rows = [["Measured by", "A"], [], ["Name", "L*", *map(float, GRID)]]
    rows += [[f"red\nlight {i}", 50.5, *row.tolist()] for i, row in enumerate(R)]
    long = book.create_sheet("Spots")
    bare = book.create_sheet("Bare")
    for row in rows:
        wide.append(row)
    long.append(["wavelength", "a", "b"])
    for w, values in zip(GRID, R.T * 100, strict=True):
        long.append([int(w), *values.tolist()])
        bare.append([w, values[0]])
    path = tmp_path / "films.xlsx"
    book.save(path)
    return path


def test_the_first_sheet_is_read(book):
    table = read_spectra(book)
    same(table, GRID, R, ["red light 0", "red light 1"], atol=1e-12)
    assert table.format == "Excel workbook, a sample a row"
    assert table.attributes["L*"] == ("50.5", "50.5")
    assert "sheet 'Films' was read; there are Films, Spots, Bare" in table.notes


def test_a_sheet_may_be_named(book):
    same(read_spectra(f"{book}:Spots"), GRID, R, ["a", "b"], atol=1e-12)
    same(read_spectra(f"{book}:Bare"), GRID, R[:1], ["films"], atol=1e-12)
    one = read_sample(f"{book}:Spots:b")
    np.testing.assert_allclose(one.reflectance, R[1:], atol=1e-12)


def test_errors_name_sheets_rows_and_files(book):
    with pytest.raises(ValueError, match="no sheet 'Spot'; there are Spots") as error:
        read_spectra(f"{book}:Spot")
    assert complains(error, book)
    import openpyxl  # pyright: ignore[reportMissingModuleSource]

    changed = openpyxl.load_workbook(book)
    changed["Films"]["D5"] = "high"
    changed.save(book)
    with pytest.raises(ValueError, match="line 5: sample 'red light 1', column '410': 'high'"):
        read_spectra(book)


def test_damaged_workbooks_and_other_archives_are_refused(book):
    content = book.read_bytes()
    other = io.BytesIO()
    with zipfile.ZipFile(other, "w") as archive:
        archive.writestr("a.txt", "b")
    for wrong in (content[:-500], b"PK\x03\x04rest", other.getvalue()):
        book.write_bytes(wrong)
        with pytest.raises(ValueError, match="not a whole Excel workbook") as error:
            read_spectra(book)
        assert complains(error, book)


def test_what_unpacks_to_too_much_is_refused_before_it_is_unpacked(book):
    with zipfile.ZipFile(book, "a", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("zeros", bytes(1 << 28))
    with pytest.raises(ValueError, match="larger than is read of a workbook"):
        read_spectra(book)


def test_a_size_that_a_sheet_claims_is_not_believed(book):
    changed = book.with_name("claims.xlsx")
    with zipfile.ZipFile(book) as old, zipfile.ZipFile(changed, "w") as new:
        for name in old.namelist():
            claim = re.sub(rb'<dimension ref="[^"]*"', b'<dimension ref="A1:B2"', old.read(name))
            new.writestr(name, claim)
    same(read_spectra(changed), GRID, R, ["red light 0", "red light 1"], atol=1e-12)


def test_more_cells_than_a_table_has_are_refused(book, monkeypatch):
    monkeypatch.setattr(workbook, "_MOST_CELLS", 50)
    with pytest.raises(ValueError, match="more than 50 cells"):
        read_spectra(book)


def test_without_openpyxl_one_sentence_names_the_extra(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "openpyxl", None)
    path = tmp_path / "films.xlsx"
    path.write_bytes(b"PK\x03\x04")
    with pytest.raises(ValueError, match=r'pip install "glazejax\[formats\]"') as error:
        read_spectra(path)
    assert complains(error, path)
