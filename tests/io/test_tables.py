import csv
import time

import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from glazejax.io import read_spectra, write_table
from glazejax.io.quantity import not_stated

from ..refusals import refusal
from .samples import GRID, lines, rows, same, spectra

VALUES = [[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]]
WIDE = "Name,400,410,420\nred,0.1,0.2,0.3\nblue,0.4,0.5,0.6\n"
TRIPLES = "sample,wavelength,reflectance\nred,400,0.1\nblue,410,0.5\nred,410,0.2\nblue,400,0.4\n"
COLUMNS = "# spectrometer\n400.5 0.10 0.40\n410.7 0.20 0.50\n420.2 0.30 0.60\n"


FILE = "t.csv"


@pytest.mark.parametrize(
    "text",
    [
        WIDE,
        WIDE.replace(",", "\t"),
        WIDE.replace(",", ";"),
        WIDE.replace(",", "  "),
        WIDE.replace(",", ";").replace("0.", "0,"),
        WIDE.replace("410", "410 nm").replace("420", "420nm"),
        WIDE.replace("\n", "\r\n"),
        "\ufeff" + WIDE,
        "# a comment, with 3 commas, or more\n\n" + WIDE.replace("\n", ",\n"),
        '"Name","400","410","420"\n"red",0.1,0.2,0.3\n"blue",0.4,0.5,0.6',
        "wavelength,red,blue\n400,0.1,0.4\n410,0.2,0.5\n420,0.3,0.6\n",
        "Wavelength (nm);red;blue\n400;0,1;0,4\n410;0,2;0,5\n420;0,3;0,6\n",
        "nm red blue\n400 .1 .4\n410 .2 .5\n420 .3 .6\n",
        "[nm],red,blue\n400,.1,.4\n410,.2,.5\n420,.3,.6\n",
        "## date = today\n" + WIDE,
    ],
)
def test_every_layout_reads_the_same(read, text):
    table = read(text)
    assert table.names == ("red", "blue")
    assert_array_equal(table.wavelengths, [400, 410, 420])
    assert_array_equal(table.reflectance, VALUES)
    assert_array_equal(table["blue"], VALUES[1])
    assert set(table.notes) <= {not_stated("fractions"), not_stated("nm", "fractions")}
    assert len(table) == 2


@pytest.mark.parametrize(
    "text",
    [
        "wavelength,1,2\n400,0.1,0.4\n410,0.2,0.5\n",
        "wavelength,400,410\n1,0.1,0.4\n2,0.2,0.5\n",
    ],
)
def test_numbers_of_samples_are_no_wavelengths(read, text):
    table = read(text)
    assert table.names == ("1", "2")
    assert table.wavelengths.tolist() == [400, 410]


def test_samples_may_be_called_by_numbers_like_wavelengths(read):
    rows = "400,.1,.2,.3\n410,.1,.2,.3\n420,.1,.2,.3\n"
    for header in ("wavelength,412,518,603", "wavelength,518,412,603", ",518,412,603"):
        table = read(f"{header}\n{rows}")
        assert table.names == tuple(header.split(",")[1:])
        assert table.wavelengths.tolist() == [400, 410, 420]
    table = read("wavelength,400,410,420\n101,.1,.2,.3\n105,.1,.2,.3\n107,.1,.2,.3\n")
    assert table.names == ("101", "105", "107")
    with refusal("titles 410, 420, 430 and the column below 'wavelength' may both be wavelengths"):
        read(f"wavelength,410,420,430\n{rows}")


@pytest.mark.parametrize(
    "header",
    [
        "wavelength,1201,1202,mean",
        "wavelength_nm,101,102,102b",
        "Wavelength (nm),401,402,403,blank",
        "nm,403,401,402,blank",
        ",wavelength,1201,1202,1203",
    ],
)
def test_numbered_samples_may_stand_next_to_a_mean_or_a_blank(read, header):
    """An unnamed first column counts lines, as pandas writes it."""
    counted = header[0] == ","
    names = header.split(",")[1 + counted :]
    values = spectra(len(names))
    cells = rows(GRID, *values, grid=range(31)) if counted else rows(*values)
    table = read(f"{header}\n{cells}")
    same(table, GRID, values, names)


def test_numbered_samples_of_a_wide_table_may_have_a_further_column(read):
    numbered = ([number, *[0.1] * 31, "high"] for number in (101, 105, 107))
    table = read(lines([["wavelength", *range(400, 701, 10), "gloss"], *numbered]))
    assert table.names == ("101", "105", "107")
    assert table.attributes["gloss"] == ("high",) * 3


def test_percent_is_said(read):
    table = read("Name,400,410\nred,5,90\n")
    assert_allclose(table.reflectance, [[0.05, 0.9]])
    assert table.notes == [not_stated("nm"), "values are in percent; divided by 100"]


@pytest.mark.parametrize(
    "title",
    [
        "Wellenlänge [nm]",
        "Wellenlaenge",
        "Longueur d'onde (nm)",
        "Lunghezza d’onda",
        "golflengte",
        "Våglängd",
    ],
)
def test_a_table_of_a_european_spreadsheet(read, title):
    text = f"{title};Mantel, links;Weiß\n400;12,5;80\n410;13,5;81,25\n"
    for content in (text, text.encode("cp1252")):
        table = read(content)
        assert table.names == ("Mantel, links", "Weiß")
        assert_allclose(table.reflectance, [[0.125, 0.135], [0.8, 0.8125]])
        told = "read as Windows-1252" in str(table.notes)
        assert told == (isinstance(content, bytes))


def test_slightly_negative_readings_are_noise(read):
    table = read("nm,red\n400,-.002\n410,.2\n")
    assert table["red"].tolist() == [0.0, 0.2]
    assert table.notes[-1] == "1 value slightly below 0 (noise, down to -0.002) became 0"


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "the file is empty"),
        ("\n , ,\n", "the file is empty"),
        ("Name,400,410\n", "no data below"),
        (b"\xff\xfd\x81a", "not UTF-8 text"),
        (b"a,400\0\n", "not a text file"),
        ("Name,red,blue\nx,1,2\n", "no wavelengths in the header; expected 'Name,400,410"),
        ("hello\nworld\n", "one column only"),
        ("400,0.1,0.2\n410,0.1,0.2\n", "line 1: numbers only, where a header should be"),
        ("Name,400,410,4l0\nx,1,2,3\n", "line 1: column '4l0' is not a wavelength"),
        ("Name,400,420,410\nx,1,2,3\n", "must ascend: number 3 is 410 nm after 420 nm"),
        ("wavelength,a\n400,.1\n390,.2\n395,.2\n", "must ascend: number 2"),
        (
            "Name,400,410,410\nx,1,2,3\n",
            "wavelengths must differ: 410 nm is given twice; leave one",
        ),
        ("wavelength,a\n400,.1\nx,.2\n", "line 3: column 'wavelength': 'x' is not a wavelength"),
        ("Name,400,410\nred,.1,.2\nblue,.1\n", "line 3: 2 cells where the header has 3"),
        ("Name,400,410\nred,.1,.2\nblue,.1,.2,.3\n", "line 3: 4 cells where the header has 3"),
        (
            "Name,400,410\nred,.1,high\n",
            "line 2: sample 'red', column '410': 'high' is not a finite number",
        ),
        ("Name,400,410\nred,.1,nan\n", "sample 'red', column '410': 'nan' is not a finite number"),
        ("Name,400,410\nred,.1,inf\n", "'inf' is not a finite number"),
        ("Name,400,410\nred,,.1\n", "sample 'red', column '400': the cell is empty"),
        (
            "Name,400,410\nred,-.1,.1\n",
            "'red' is negative at band 1 .400 nm.: -0.1, more than noise .* write 0",
        ),
        (
            "wavelength,a,b\n400,.1,-2\n",
            "'b' is negative at band 1 .400 nm.: -2",
        ),
        ("Name,400,410\nred,.1,.1\nblue,10,20\n", "mixed: blue in percent .*, red in fractions"),
        ("nm,a (%),b\n400,10,.2\n500,20,.3\n", "'b' states nothing and is 0.3 at most"),
        ("Name,400,410\nred,.1,.1\n\nred,.1,.2\n", "line 4: sample 'red' is already on line 2"),
        ("wavelength,a,a\n400,.1,.2\n", "line 1: sample 'a' is already"),
        ("Name,400,410\n,.1,.1\n", "line 2: a sample has no name"),
        (
            "nm,red\n400,12,34\n",
            "line 2: 3 cells where the header has 2; if commas are decimal points, separate",
        ),
        (
            "wavenumber,red\n25000,.1\n",
            "'wavenumber' is no wavelength; write wavelengths in nm, or call the column "
            "'wavelength' and say --unit 1/cm",
        ),
        (b"\x89PNG\r\n\x1a\n\0\0", "a picture .PNG., which holds no spectra"),
        (b"\xff\xd8\xff\xe0\0", "a picture .JPEG."),
        ("nm,red\n400,2000\n410,3000\n", "too much for a fraction .* divide by what stands for"),
        (
            TRIPLES.replace("blue,410,0.5\n", ""),
            "'blue' has no value at 410 nm, where others have one",
        ),
        (
            TRIPLES.replace("red,410", "red,400"),
            "line 4: sample 'red' has a value at 400 nm already",
        ),
        (
            TRIPLES.replace("red,410", "red,x"),
            "line 4: column 'wavelength': 'x' is not a wavelength",
        ),
        (TRIPLES.replace("0.5", "nan"), "line 3: .* not a finite number"),
        (TRIPLES.replace("blue,410", ",410"), "line 3: a sample has no name"),
        (COLUMNS.replace("410.7", "430"), "the first column does not run through wavelengths"),
        ("1 0.1\n2 0.2\n3 0.3\n", "1, ... 3 look like band numbers"),
        ("0.01 0.1\n0.02 0.2\n0.03 0.3\n", "the first column does not run through wavelengths"),
        (COLUMNS + "430 0.1\n", "line 5: 2 cells where the first row has 3"),
        (
            COLUMNS + "430 0.1 high\n",
            "line 5: sample 'column 3', .*: 'high' is not a finite number",
        ),
        (COLUMNS + "430 0.1 nan\n", "line 5: sample 'column 3', .*: 'nan' is not a finite number"),
        (COLUMNS.replace(" 0.60", " -0.60"), "'column 3' is negative at band 3"),
    ],
)
def test_errors_are_one_line_that_says_where(put, text, complaint):
    path = put(text)
    with refusal(complaint) as caught:
        read_spectra(path)
    assert str(path) in str(caught.value)


def test_missing_file_and_folder(tmp_path):
    with refusal("there is no such file", FileNotFoundError):
        read_spectra(tmp_path / "none.csv")
    with refusal("folder"):
        read_spectra(tmp_path)


@pytest.mark.parametrize(
    "text", [TRIPLES, TRIPLES.replace("sample,w", "Paint,W").replace(",", "\t")]
)
def test_a_value_a_row(read, text):
    table = read(text)
    assert table.names == ("red", "blue")
    assert_array_equal(table.reflectance, [[0.1, 0.2], [0.4, 0.5]])


@pytest.mark.parametrize(
    "text", [COLUMNS, COLUMNS.replace(" 0", "\t0"), "\n".join(COLUMNS.splitlines()[::-1])]
)
def test_columns_without_a_header(read, text):
    table = read(text)
    assert table.names == ("column 2", "column 3")
    assert_array_equal(table.wavelengths, [400.5, 410.7, 420.2])
    assert_array_equal(table.reflectance, VALUES)
    assert "no header" in table.notes[0]


def test_declared_unit(read):
    dark = "Name,400,410\nblack,0.5,0.6\n"
    table = read("# unit: percent\n" + dark)
    assert_allclose(table.reflectance, [[0.005, 0.006]])
    assert table.notes == [not_stated("nm"), "values are in percent; divided by 100"]
    assert read(dark).reflectance.max() == 0.6


def test_names_do_not_decide_the_format(read):
    assert read(WIDE, "t.cxf").format == "CSV table, a sample a row"
    assert read(WIDE.replace("Name", "ENVI"), "t.hdr").names == (
        "red",
        "blue",
    )


@pytest.mark.parametrize("line", ["\n", "   \n", "##\n", "$$ \n"])
def test_blank_files_are_refused_in_time_of_their_length(read, line):
    seconds = []
    # The first is a warm-up; a square of the length would take sixteen times as long.
    for count in (100, 4_000, 16_000):
        start = time.thread_time()
        with refusal(r"empty|header"):
            read(line * count)
        seconds.append(time.thread_time() - start)
    assert seconds[2] < 8 * seconds[1] + 0.05


@given(st.text(alphabet="0123456789.,;\t\n nmNaeE-+\"'#", max_size=120))
def test_near_tables_never_surprise(tmp_path_factory, content):
    path = tmp_path_factory.mktemp("near") / "t.csv"
    path.write_text(content)
    try:
        table = read_spectra(path)
    except ValueError as error:
        said = str(error).splitlines()
        assert len(said) == 1
    else:
        assert table.reflectance.shape == (len(table.names), table.wavelengths.size)


def test_measured_van_gogh_paints(shared_data):
    table = read_spectra(shared_data / "revigo" / "reflectance.tsv")
    assert table.reflectance.shape == (len(table.names), 31)
    assert len(table.notes) == 2
    black = np.mean([table[name].mean() for name in table.names if name.endswith("_b")])
    white = np.mean([table[name].mean() for name in table.names if name.endswith("_w")])
    # The figures of its SOURCE.md.
    assert black == pytest.approx(0.0501, abs=5e-4)
    assert white == pytest.approx(0.835, abs=5e-3)


@given(st.lists(st.tuples(st.text("ab,\"' ;é"), st.floats(allow_nan=False)), max_size=5))
def test_tables_read_back(tmp_path_factory, rows):
    path = tmp_path_factory.mktemp("out") / "t.csv"
    write_table(path, ["name", "value, in m"], rows)
    with path.open(encoding="utf-8", newline="") as file:
        header, *body = csv.reader(file)
    assert header == ["name", "value, in m"]
    assert [(name, float(value)) for name, value in body] == rows


def test_array_cells_are_plain_numbers(tmp_path):
    path = tmp_path / "t.tsv"
    write_table(
        path,
        ["a", "b", "c", "d"],
        [[np.float64(1e-7), jnp.asarray(1 / 3), np.float32(0.1), np.int64(3)]],
    )
    cells = path.read_text().splitlines()[1].split("\t")
    assert cells == ["1e-07", repr(1 / 3), "0.1", "3"]


def test_nothing_is_written_on_error(put, tmp_path):
    path = put("mine")
    with refusal("row 2 has 2 cells where the header has 1"):
        write_table(path, ["a"], [[1], [1, 2]], overwrite=True)
    assert path.read_text() == "mine"
    with refusal("folder", FileNotFoundError):
        write_table(tmp_path / "no" / "t.csv", ["a"], [[1]])
