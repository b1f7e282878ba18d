"""Workbooks that openpyxl and xlwt write, and one of LibreOffice's kind by hand."""

import io
import re
import sys
import zipfile
from html import escape

import numpy as np
import pytest

from glazejax.io import read_sample, read_spectra

from ..refusals import refusal
from .samples import ENVI, GRID, envi_header, old_workbook, refused, rows, same, spectra

openpyxl = pytest.importorskip("openpyxl")
R = spectra(2)


@pytest.fixture
def book(tmp_path):
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
    assert table.format == "workbook, a sample a row"
    assert table.attributes["L*"] == ("50.5", "50.5")
    assert "sheet 'Films' was read; there are Films, Spots, Bare" in table.notes


def test_tables_may_have_the_name_of_an_image(book):
    """Made from it, and next to its header; neither is its data."""
    book.with_suffix(".hdr").write_text(envi_header(ENVI))
    book.with_suffix(".sli").write_bytes(spectra().astype("<f4").tobytes())
    assert read_spectra(book).format == "workbook, a sample a row"
    for ending in (".csv", ".tsv", ".TXT"):
        table = book.with_suffix(ending)
        table.write_text("wavelength_nm\tWeiß\n" + rows(R[0], by="\t"), encoding="cp1252")
        same(read_spectra(table), GRID, R[:1], ["Weiß"], atol=1e-12)
    same(read_spectra(book.with_suffix(".sli")), GRID, spectra(), ["red", "green", "blue"], 1e-7)


def test_a_sheet_may_be_named(book):
    same(read_spectra(f"{book}:Spots"), GRID, R, ["a", "b"], atol=1e-12)
    same(read_spectra(f"{book}:Bare"), GRID, R[:1], ["films"], atol=1e-12)
    one = read_sample(f"{book}:Spots:b")
    np.testing.assert_allclose(one.reflectance, R[1:], atol=1e-12)


def test_errors_name_sheets_rows_and_files(book):
    refused(book, "no sheet 'Spot'; there are Spots", lambda _: read_spectra(f"{book}:Spot"))
    changed = openpyxl.load_workbook(book)
    changed["Films"]["D5"] = "high"
    changed.save(book)
    with refusal("line 5: sample 'red light 1', column '410': 'high'"):
        read_spectra(book)


def test_damaged_workbooks_and_other_archives_are_refused(book):
    content = book.read_bytes()
    other = io.BytesIO()
    with zipfile.ZipFile(other, "w") as archive:
        archive.writestr("a.txt", "b")
    for wrong in (content[:-500], b"PK\x03\x04rest", other.getvalue(), b"\xd0\xcf\x11\xe0rest"):
        book.write_bytes(wrong)
        refused(book, "not a whole workbook")


def test_what_unpacks_to_too_much_is_refused_before_it_is_unpacked(book):
    with zipfile.ZipFile(book, "a", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("zeros", bytes(1 << 28))
    with refusal("larger than is read of a workbook"):
        read_spectra(book)


def test_a_size_that_a_sheet_claims_is_not_believed(book):
    changed = book.with_name("claims.xlsx")
    with zipfile.ZipFile(book) as old, zipfile.ZipFile(changed, "w") as new:
        for name in old.namelist():
            claim = re.sub(rb'<dimension ref="[^"]*"', b'<dimension ref="A1:B2"', old.read(name))
            new.writestr(name, claim)
    same(read_spectra(changed), GRID, R, ["red light 0", "red light 1"], atol=1e-12)


@pytest.mark.parametrize(
    ("row", "column", "words"),
    [(1_000_000, 8, "more than 5000000 cells"), (1_048_576, 16_384, "far too many cells")],
)
def test_more_cells_than_a_table_has_are_refused(book, row, column, words):
    """The second takes all memory that a reader may have, and ends it."""
    changed = openpyxl.load_workbook(book)
    changed["Films"].cell(row, column, 0.5)
    changed.save(book)
    refused(book, words)


@pytest.mark.parametrize("ending", [".xls", ".ods"])
def test_old_workbooks_and_those_of_libreoffice_are_read(tmp_path, ending):
    path = tmp_path / f"films{ending}"
    sheets = {
        "Notes": [["measured by", "A"]],
        "Films": [["Name", *GRID], ["7", *R[0]], ["red & light", *R[1]]],
    }
    path.write_bytes((old_workbook if ending == ".xls" else _ods)(sheets))
    same(read_spectra(f"{path}:Films"), GRID, R, ["7", "red & light"], atol=1e-12)
    refused(path, "no sheet 'Film'; there are Films", lambda _: read_spectra(f"{path}:Film"))


def _ods(sheets):
    """ODF 1.2, part 1, 9.1: of a table what a reader needs."""
    names = "urn:oasis:names:tc:opendocument:xmlns:"
    kind = "application/vnd.oasis.opendocument.spreadsheet"

    def cell(value):
        if isinstance(value, str):
            return f'<t:table-cell o:value-type="string"><x:p>{escape(value)}</x:p></t:table-cell>'
        return f'<t:table-cell o:value-type="float" o:value="{value}"/>'

    tables = "".join(
        f'<t:table t:name="{name}">'
        + "".join(f"<t:table-row>{''.join(map(cell, row))}</t:table-row>" for row in rows)
        + "</t:table>"
        for name, rows in sheets.items()
    )
    for short, long in (("o", "office"), ("t", "table"), ("x", "text")):
        tables = tables.replace(f"<{short}:", f"<{long}:").replace(f"</{short}:", f"</{long}:")
        tables = tables.replace(f" {short}:", f" {long}:")
    content = (
        f'<office:document-content xmlns:office="{names}office:1.0" xmlns:table="{names}table:1.0" '
        f'xmlns:text="{names}text:1.0"><office:body><office:spreadsheet>{tables}'
        "</office:spreadsheet></office:body></office:document-content>"
    )
    manifest = (
        f'<manifest:manifest xmlns:manifest="{names}manifest:1.0"><manifest:file-entry '
        f'manifest:full-path="/" manifest:media-type="{kind}"/></manifest:manifest>'
    )
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("mimetype", kind)
        archive.writestr("META-INF/manifest.xml", manifest)
        archive.writestr("content.xml", content)
    return file.getvalue()


def test_without_calamine_one_sentence_names_the_extra(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "python_calamine", None)
    path = tmp_path / "films.xlsx"
    path.write_bytes(b"PK\x03\x04")
    refused(path, r'pip install "glazejax\[formats\]"')
