"""Files as instruments' software exports them: their own lines above, colours beside the bands."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from ..refusals import refusal
from .samples import GRID, comma_rows, refused, rows, same, spectra

R = spectra(2)
RED, BLUE = (100 * R).round(3)
BANDS = ",".join(f"{w:g}" for w in GRID)


FILE = "film.txt"


def cells(values):
    return ",".join(f"{value:.3f}" for value in values)


SPECTRAMAGIC = (
    "Instrument name,CM-700d\nSerial No.,123,456\nMeasured (nm),400,700\n\n"
    "No.,Data Name,Date,L*(D65),a*(D65),"
    + ",".join(f"SCI_{w:g}nm" for w in GRID)
    + ","
    + ",".join(f"SCE_{w:g}nm" for w in GRID)
    + f"\n1,red,1/5/2024,40.1,-3.2,{cells(RED)},{cells(RED - 4)}"
    + f"\n2,blue,1/5/2024,30,0,{cells(BLUE)},{cells(BLUE - 4)}\n"
)


@pytest.mark.parametrize("delimiter", [",", "\t"])
def test_both_readings_of_spectramagic_are_rows(read, delimiter):
    table = read(SPECTRAMAGIC.replace(",", delimiter))
    values = np.stack([RED, RED - 4, BLUE, BLUE - 4]) / 100
    same(table, GRID, values, ["red SCI", "red SCE", "blue SCI", "blue SCE"], atol=1e-9)
    assert table.attributes["a*(D65)"] == ("-3.2", "-3.2", "0", "0")
    assert table.notes[:3] == [
        "4 lines above the table are not read",
        "columns that are no bands are kept with the spectra: No., Date, L*(D65), a*(D65)",
        "each line gives a spectrum for each kind of reading: NAME SCI (specular component "
        "included, d:8), NAME SCE (specular component excluded, de:8)",
    ]


def test_a_column_that_says_the_reading_tells_names_apart(read):
    text = f"Data Name,SCI/SCE,{BANDS}\nred,SCI,{cells(RED)}\nred,SCE,{cells(RED - 4)}\n"
    assert read(text).names == ("red SCI", "red SCE")


@pytest.mark.parametrize(
    "title",
    [
        "{} nm",
        "R{}",
        "%R {}",
        "R {} nm",
        "nm{}",
        "SPIN {}",
        "SCI {}[nm]",
        "{}nm(SCI)",
        "SPECTRAL_NM_{}",
        "{} nm (%)",
    ],
)
def test_titles_of_bands_as_makers_write_them(read, title):
    header = ",".join(title.format(f"{w:g}") for w in GRID)
    table = read(f"Sample,{header}\nred,{cells(RED)}\n")
    same(table, GRID, [RED / 100], ["red"], atol=1e-9)


def test_a_percent_behind_the_kind_of_reading_is_a_unit(read):
    dark = np.full(GRID.size, 0.9)
    lines = "".join(f"{w:g},{value}\n" for w, value in zip(GRID, dark, strict=True))
    for title in ("SCI %", "SCI (%)", "%SCE"):
        assert_allclose(read(f"nm,{title}\n{lines}").reflectance, [dark / 100])
    # A mixture's share is no unit.
    assert read(f"nm,red 10% SCI\n{lines}").reflectance.max() == 0.9


def test_one_kind_of_reading_keeps_names_and_is_said(read):
    table = read("Name,SCE 400,SCE 410\nred,10,20\n")
    assert table.names == ("red",)
    assert table.notes[0] == "all bands are taken as specular component excluded, de:8"


@pytest.mark.parametrize("count", [3, len(GRID)])
def test_colours_stand_beside_bands(read, count):
    text = f"Name,L*,a*,b*,X,Y,Z,{','.join(BANDS.split(',')[:count])}\n"
    text += f"red,40,30,-20,1,2,3,{cells(RED[:count])}\n"
    table = read(text)
    same(table, GRID[:count], [RED[:count] / 100], ["red"], atol=1e-9)
    assert table.attributes["b*"] == ("-20",)


@pytest.mark.parametrize(
    "text",
    [
        "nm,red\n" + rows(RED[::-1], grid=GRID[::-1]),
        f"Name,{','.join(BANDS.split(',')[::-1])}\nred,{cells(RED[::-1])}\n",
        '"red - RawData"\n"Wavelength nm.","R%"\n' + rows(RED[::-1], grid=GRID[::-1]),
    ],
)
def test_descending_wavelengths_are_sorted_and_said(read, text):
    table = read(text)
    assert_array_equal(table.wavelengths, GRID)
    assert_allclose(table.reflectance[0], RED / 100, atol=1e-5)
    assert "bands were sorted by wavelength" in table.notes


OCEAN = "Data from film.txt Node\n\nDate: Fri Jan 05 10:00:00 CET 2024\nScans to average: 10\n"
OCEAN += "Number of Pixels in Spectrum: 31\n>>>>>Begin Spectral Data<<<<<\n"


@pytest.mark.parametrize(
    "text",
    [
        rows(RED),
        rows(RED, by=";").replace(".", ","),
        comma_rows(RED),
        rows(RED, by="\t"),
        "red ochre\nmeasured in the church: 1/5/2024\n" + rows(RED),
        OCEAN + rows(RED, by="\t"),
        OCEAN.replace(".", ",") + comma_rows(RED),
        OCEAN + rows(RED, by="\t") + ">>>>>End Processed Spectral Data<<<<<\n",
    ],
)
def test_two_columns_without_a_header(read, text):
    table = read(text)
    same(table, GRID, [RED / 100], ["film"], atol=1e-9)
    above = "above the table" in str(table.notes)
    assert above == (not text.startswith("400"))


def test_bright_rows_of_numbers_are_no_header(read):
    text = "".join(f"{w:g},101,102,103,104\n" for w in GRID)
    assert len(read(text)) == 4


def test_titles_are_said_on_one_line(read):
    table = read(f"Name,\x7fa,{BANDS}\nred,1,{cells(RED)}\n")
    assert all(note.isprintable() for note in table.notes)


def test_two_or_three_numbers_may_be_the_instruments_own(read):
    text = "Scans,10\nSerial No.,123\nnm,red\n" + rows(RED)
    assert read(text).names == ("red",)


def test_samples_of_a_table_of_wavelengths_may_be_called_as_bands_are(read):
    table = read("wavelength,R400,R410\n400,10,20\n410,30,40\n")
    assert table.names == ("R400", "R410")


def test_lines_above_in_another_encoding(read):
    text = "Gerät;CM-700d;1;2\n\nWellenlänge;Weiß\n400;12,5\n410;13,5\n"
    table = read(text, encoding="cp1252")
    assert table.names == ("Weiß",)
    assert "2 lines above the table are not read" in table.notes


@pytest.mark.parametrize("way", [1, -1])
def test_ends_where_a_spectrometer_reads_noise_are_left_out(read, way):
    """Of wavelengths that ascend or descend."""
    values = RED.copy()
    values[[1, 28]] = -7.0, 900.0
    table = read(OCEAN + rows(values[::way], by="\t", grid=GRID[::way]))
    same(table, GRID[2:28], [RED[2:28] / 100], ["film"], atol=1e-9)
    noise = "5 bands at the ends are left out, at 400-410, 680-700 nm: they hold noise alone"
    assert noise in table.notes
    values[15] = -7.0
    with refusal("'film' is negative"):
        read(OCEAN + rows(values, by="\t"))


def test_what_a_person_may_have_written_keeps_its_ends(read):
    values = RED.copy()
    values[0] = -7.0
    with refusal("'film' is negative"):
        read(rows(values))


SVC = "/*** Spectra Vista SIG Data ***/\nname= HR.1.sig\ninstrument= HI: 1 (HR-1024i)\n"
SVC += "units= Radiance, Radiance\ncomm= red panel\ndata= \n"


def svc(grid, values):
    return SVC + "".join(f"{w:.1f}  2.0  1.0  {r:.3f}\n" for w, r in zip(grid, values, strict=True))


def test_svc_reads_its_last_column(read):
    table = read(svc(GRID, RED), "film.sig")
    same(table, GRID, [RED / 100], ["red panel"], atol=1e-9)
    assert table.format == "SVC text (.sig)"
    assert "last column" in table.notes[0]


def test_svc_is_percent_however_dark(read):
    table = read(svc(GRID, RED / 100))
    assert_allclose(table.reflectance[0], RED / 1e4, atol=1e-5)


OVERLAP = [*GRID[:21], *(GRID[17:] + 3)]
JUMP = [*RED[:21], *BLUE[17:]]


@pytest.mark.parametrize(
    "text", [svc(OVERLAP, JUMP), "wavelength,red panel\n" + rows(JUMP, grid=OVERLAP)]
)
def test_detectors_that_overlap_change_in_the_middle(read, text):
    table = read(text)
    # The overlap is 573 to 600 nm.
    assert "detectors overlap: the change is at 586.5 nm" in table.notes
    right = np.array([*RED[:19], *BLUE[19:]]) / 100
    same(table, [*GRID[:19], *(GRID[19:] + 3)], [right], ["red panel"], atol=1e-9)


ABOVE = "line 1: a row of the table stands above its beginning"
SPC = "a Galactic SPC file .* as JCAMP-DX or as text"
BELOW = r"line 6: no numbers below .* export it again"


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        (
            "Name,SCI 400,SCI 410,SCE 400,SCE 420\nred,10,20,5,15\n",
            "bands of SCE are others than those of SCI",
        ),
        # Below the line where the spectrum begins is nothing.
        (OCEAN, BELOW),
        (OCEAN + "# µ\n", BELOW),
        (OCEAN + ">>>>>End Processed Spectral Data<<<<<\n", BELOW),
        # Titles that lack something are no lines above.
        ("nm,red\n400,12,5\n410,13,5\n420,14,5\n", "header"),
        ("\n\nX,Y\n1,2\n", "header"),
        (f"red,{cells(RED)}\nName,{BANDS}\nblue,{cells(BLUE)}\n", ABOVE),
        ("640,50\nnm,red\n" + rows(RED), ABOVE),
        ("640;50;3\n\nred\n" + rows(RED, BLUE, by=";"), ABOVE),
        (SVC, "without numbers below 'data='"),
        (SVC + "400 1 2\n", "line 7: '400 1 2' are not four numbers"),
        (SVC + "400 1 2 1_0\n", "line 7: '400 1 2 1_0' are not four numbers"),
        *((b"\0%c" % version + bytes(600), SPC) for version in b"KLM"),
    ],
)
def test_errors_are_one_line(put, text, complaint):
    refused(put(text), complaint)


def test_i1profiler_names_with_blanks_stand_between_tabs(read):
    fields = "\t".join(["SAMPLE_ID", "SAMPLE_NAME", *(f"SPECTRAL_NM{w:g}" for w in GRID)])
    row = "\t".join(f"{value / 100:.5f}" for value in RED)
    text = (
        f'CGATS.17\nORIGINATOR\t"i1Profiler"\nNUMBER_OF_FIELDS\t33\nBEGIN_DATA_FORMAT\n{fields}\n'
    )
    text += f"END_DATA_FORMAT\nNUMBER_OF_SETS\t1\nBEGIN_DATA\n1\tlight red\t{row}\t\nEND_DATA\n"
    same(read(text), GRID, [RED / 100], ["light red"], atol=1e-9)


def test_three_rows_of_two_numbers_are_a_table_below_any_lines(read):
    above = "An instrument\nSerial 12\n400,0.10\n450,0.20\n"
    assert read(f"{above}500,0.30\n").wavelengths.tolist() == [400.0, 450.0, 500.0]
    with refusal("no wavelengths in the header"):
        read(above)
