"""Files as instruments and people write them: what they say of quantity and unit, and where their
columns stand. Cases of `shared/cases`, and twins of each kind with other names and values.
"""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from glazejax.io import read_spectra

from ..refusals import refusal
from .samples import CGATS, CXF, GRID, comma_rows, jcamp_block, refused, rows, same, spectra

RED, BLUE = spectra(2).round(4)
DARK = 0.3 + 0.9 * RED  # percent of a black


def are_dark(table):
    """Assert that all spectra are this black, read as percent."""
    assert_allclose(table.reflectance, [DARK / 100] * len(table))


EXPORT = "only reflectance can be read: export it"
ONLY = "and only reflectance can be read"
NOWHERE = "is no wavelength; write wavelengths in nm$"
APART = "have none in common"


FILE = "film.txt"


# Smallest and largest reflectance of the cases, where they are not the usual ones.
ENDS = {
    "03": (0.009, 0.012),
    "04": (0.009, 0.79),
    "09": (0.03, 1.18),
    "19": (0.011, 0.011),
    "22": (0.2, 0.4),
}


@pytest.mark.parametrize(
    ("file", "names", "note"),
    [
        ("03*/dark_km.csv", ["ivory black"], "in percent"),
        ("03*/dark_percent_header.csv", ["dark_percent_header"], "in percent"),
        ("03*/dark_percent_units.csv", ["dark_percent_units"], "in percent"),
        ("04*/dark_and_light.csv", ["black", "red"], "black: dark, in percent"),
        ("07*/counts.csv", ["counts"], "left out: Sample, Dark, Reference"),
        ("09*/ocean_nohead.txt", ["ocean_nohead"], "left out, at 180-229.34 nm"),
        ("11*/ava7.ttt", ["ava7"], "in percent"),
        ("11*/ava8.txt", ["ava8"], "taken as reflectance: Reflectance [%]"),
        ("12*/suite_es.txt", ["suite_es"], "read as Windows-1252"),
        ("15*/one.sed", ["one"], "left out: Norm. DN (Ref.)"),
        ("15*/rad.sed", ["rad"], "left out: Rad. (Ref.)"),
        ("17*/wiser.txt", ["Spot A", "Spot B"], "as fractions"),
        ("17*/x_pairs.xlsx", ["Spot 1", "Spot 2"], "no spectra: column 3"),
        ("18*/utf16.txt", ["Sample α", "Sample β"], "as fractions"),
        ("19*/jcamp_pct.jdx", ["black"], "in percent"),
        ("22*/splib_two.txt", ["splib_two"], "3 bands without data"),
        ("25*/x_emptycol.xlsx", ["s1", "s2", "AVERAGE"], "no spectra: column 4"),
        (
            "25*/x_merged.xlsx",
            ["Yellow", "Yellow (2)", "Yellow (3)", "Cyan", "Cyan (2)", "Cyan (3)"],
            "numbered: Yellow, Cyan",
        ),
        ("25*/x_notes.xlsx", ["s1"], "no spectra: notes"),
        ("25*/x_sheets.xlsx", ["x_sheets"], "there are Info, Spot A, Spot B"),
        ("27*/percent_cells.csv", ["red"], "in percent"),
    ],
)
def test_cases_that_are_read(shared_cases, file, names, note):
    (path,) = shared_cases.glob(file)
    table = read_spectra(path)
    assert table.names == tuple(names)
    ends = table.reflectance.min(), table.reflectance.max()
    assert ends == pytest.approx(ENDS.get(file[:2], (0.04, 0.79)), abs=5e-3)
    assert note in str(table.notes)


@pytest.mark.parametrize(
    ("file", "complaint"),
    [
        ("05*/ftir_desc.dpt", r"4000 ... 400 without a unit .* --unit 1/cm, or --unit nm"),
        ("05*/ftir_nohead.csv", r"400 ... 4000 without a unit .* --unit 1/cm, or --unit nm"),
        ("06*/argyll_EMISSION.sp", 'MEAS_TYPE "EMISSION".* is emission, .* a white standard'),
        ("06*/argyll_AMBIENT.sp", 'MEAS_TYPE "AMBIENT".* is emission'),
        ("06*/display.ti3", 'DEVICE_CLASS "DISPLAY".* is emission'),
        ("07*/absorbance.csv", f"'Absorbance' is absorbance, and {EXPORT}"),
        ("07*/ks.csv", f"'K/S red' is K/S, and {EXPORT}"),
        ("07*/transmittance.csv", f"'%T' is transmittance, and {EXPORT}"),
        ("19*/suite.jdx", r"'Transmission \(%\)' is transmittance, .* --quantity reflectance"),
        ("22*/splib07a*.txt", "their wavelengths stand in a file of their own"),
    ],
)
def test_cases_that_are_refused(shared_cases, file, complaint):
    (path,) = shared_cases.glob(file)
    refused(path, complaint)


def test_the_user_says_what_it_is(shared_cases):
    (suite,) = shared_cases.glob("19*/suite.jdx")
    assert read_spectra(suite, quantity="reflectance").reflectance.max() == pytest.approx(0.79)
    (infrared,) = shared_cases.glob("05*/ftir_desc.dpt")
    assert read_spectra(infrared, unit="1/cm").wavelengths[[0, -1]].tolist() == [2500.0, 25000.0]
    assert read_spectra(infrared, unit="nm").wavelengths[[0, -1]].tolist() == [400.0, 4000.0]
    refused(suite, "'colour' is not known, and only reflectance", quantity="colour")


@pytest.mark.parametrize(
    "title",
    ["Reflectance (%)", "%R", "R%", "R [%]", "Reflect. %", "PERCENT REFLECTANCE", "tile (%)"],
)
def test_percent_in_a_title_is_before_the_size_of_the_numbers(read, title):
    table = read(f"nm,{title}\n" + rows(DARK))
    are_dark(table)
    assert table.names == ("tile (%)" if "tile" in title else "film",)
    are_dark(read(f'##TITLE\nnm\t"{title}"\n' + rows(DARK, by="\t")))


@pytest.mark.parametrize(
    "name",
    [
        *("raw umber", "lamp black", "Reflex Blue", "dark", "white", "10% Scarlet", "red 50%", "T"),
        # With letters of quantities.
        *("DB 703", "OD green", "Std 1", "STD", "Fluorescent Red", "Trans. Oxide"),
        *("Flash green", "Display 3", "Absorbent ground"),
    ],
)
def test_names_of_paints_are_no_quantities(read, name):
    table = read(f"nm,{name},other\n" + rows(RED, BLUE))
    same(table, GRID, [RED, BLUE], [name, "other"])


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        *(
            (f"An instrument\n{line}\n" + rows(RED, by="\t"), ONLY)
            for line in (
                "YUNITS\tABSORBANCE",
                "%T",
                "Data units; Radiance",
                "K/S values",
                "Ordinate mode: %T",
                "Mode: Abs",
            )
        ),
        *(
            (f"Name,{','.join(map(band.format, GRID))}\nred,{','.join(map(str, RED))}\n", ONLY)
            for band in ("%T {:g}", "Abs {:g}nm", "K/S {:g}")
        ),
        ("nm,Sample,Dark\n" + rows(RED, BLUE), r"'Sample \(counts\)' is counts"),
        *(
            (CGATS.replace("# a comment", keyword), "is emission, and only reflectance")
            for keyword in (
                'MEASUREMENT_MODE "Emissive"',
                'LUMINANCE_XYZ_CDM2 "95 100 109"',
                'MEAS_TYPE "MONITOR"',
            )
        ),
        (CXF.replace("m_Reflectance", "m_Emissive"), "'Spectrum_Emissive' is emission"),
        (
            "[STANDARD_DATA 0]\nSTD_NAME=a\nSTD_REFLPOINTS=3\nSTD_REFLINTERVAL=10\n"
            "STD_REFLLOW=400\nSTD_VIEWING=TRANSMISSION\nSTD_R=1,2,3\n",
            "is transmittance",
        ),
        *(
            (f"{title};red\n" + rows(RED, by=";"), f"'{title[:4]}.* {NOWHERE}")
            for title in ("Frequency (THz)", "Raman shift (cm-1)")
        ),
        *(
            (rows(RED, grid=np.linspace(*ends, GRID.size)), "without a unit may be wavenumbers")
            for ends in ((100, 3500), (4000, 10_000), (650, 4000))
        ),
        # Columns of wavelengths in other units, which are no spectra.
        ("nm;a;um;b\n" + rows(RED, GRID / 1000, BLUE, by=";"), APART),
        *(
            (f"wavelength_nm,{title},red\n" + rows(GRID / 1000, RED), APART)
            for title in ("Wavelength (µm)", "Wavelength")
        ),
        ("nm,a,nm,b\n400,.1,401,.2\n410,.1,411,.2\n420,.1,421,.2\n", APART),
    ],
)
def test_what_is_no_reflectance_over_wavelengths_is_refused(read, text, complaint):
    with refusal(complaint):
        read(text)


@pytest.mark.parametrize(
    ("header", "others"),
    [
        ("W,D,R,S,P", (5, 900, 300)),
        ("Wavelength,Dark,Reference,Scope,Processed", (5, 900, 300)),
        ("Wave,Sample,Dark,White,Reflectance\n[nm],[counts],[counts],[counts],[-]", (300, 5, 900)),
        ("nm,Absorbance red,K/S red,%T red,%R red", (1.0, 2.0, 30.0)),
    ],
)
def test_of_what_an_instrument_gives_reflectance_is_taken(read, header, others):
    others = [np.full(GRID.size, value) for value in others]
    scale = 100 if "%R" in header else 1
    table = read(f"Jaz\n{header}\n" + rows(*others, scale * RED))
    assert len(table) == 1
    assert_allclose(table.reflectance[0], RED)
    assert any(note.startswith("taken as reflectance: ") for note in table.notes)


@pytest.mark.parametrize("unit", ["", " (nm)"])
def test_what_nobody_states_is_said_once(read, unit):
    table = read(f"wavelength{unit},red\n" + rows(RED))
    taken = "as fractions" if unit else "as nm, as fractions"
    assert table.notes == [f"no unit is stated: taken {taken}"]
    table = read(f"wavelength{unit},R (0-1)\n" + rows(RED))
    assert table.notes == ([] if unit else ["no unit is stated: taken as nm"])


def test_units_in_titles_are_used(read):
    for title, factor in (
        ("Wavelength (µm)", 1e-3),
        ("lambda/nm", 1.0),
        ("wave [angstrom]", 10.0),
        ("Wavelength (m)", 1e-9),
    ):
        text = f"{title},red\n" + rows(RED, grid=factor * GRID)
        assert_allclose(read(text).wavelengths, GRID)


def test_one_unit_for_a_file_told_by_its_brightest_spectrum(read):
    text = CGATS.replace("0.40\t0.50\t0.60", "40\t50\t60").replace(
        "0.10\t0.20\t0.30", "0.4\t0.6\t0.7"
    )
    table = read(text)
    assert_allclose(table["red, light"], [0.004, 0.006, 0.007])
    assert "red, light: dark, in percent as blue is" in table.notes
    with refusal(r"mixed: blue in percent .*, red, light in"):
        read(text.replace("0.4\t0.6", "0.04\t0.6"))


@pytest.mark.parametrize(
    ("begin", "end"),
    [
        (">>>>>Debut Des Donnees Spectrales Traitees<<<<<", ">>>>>Fin Des Donnees<<<<<"),
        (">>>>> Anfang <<<<< der Daten", ">>>>> Schluss der Daten <<<<<"),
    ],
)
def test_marks_of_any_language(read, begin, end):
    text = f"Fichier\nPixels: 31\n{begin}\n" + comma_rows(RED) + f"{end}\nx\n"
    same(read(text), GRID, [RED], ["film"], atol=1e-9)


def test_blocks_of_their_own_wavelengths_are_read_where_all_have_some(read):
    text = "Glaze 1\t\tGlaze 2\t\nnm\tR\tnm\tR\n"
    long = np.arange(380.0, 731.0, 10.0)
    values = np.interp(long, GRID, BLUE)
    blank = [""] * 5
    table = read(text + rows([*RED, *blank], long, values, by="\t", grid=[*GRID, *blank]))
    same(table, GRID, [RED, BLUE], ["Glaze 1", "Glaze 2"], atol=1e-9)
    assert "spectra share 400-700 nm step 10 (31 bands), and are read there" in table.notes


def test_cary_descends_and_says_more_below(read):
    down = GRID[::-1]
    text = "Red,,Blue,,\nWavelength (nm),%R,Wavelength (nm),%R,\n"
    text += rows(100 * RED[::-1], down, 100 * BLUE[::-1], [""] * 31, grid=down)
    text += "\nRed\nCollection Time: 3/1/2021\nInstrument,Cary 5000\nStart (nm),700.0\n"
    same(read(text), GRID, [RED, BLUE], ["Red", "Blue"], atol=1e-9)


def test_the_column_of_wavelengths_is_found_where_nothing_titles_it(read):
    number = np.arange(1, GRID.size + 1)
    table = read("Nr;x;red\n" + rows(GRID, RED, by=";", grid=number).replace(".", ","))
    same(table, GRID, [RED], ["red"], atol=1e-9)
    assert "left of the wavelengths, and not read: Nr" in table.notes


def test_samples_left_of_the_wavelengths_are_said_to_be_left_out(read):
    text = "A,B,seen,wavelength_nm,C\n" + rows(RED, ["fine"] * 31, GRID, RED, grid=BLUE)
    table = read(text)
    same(table, GRID, [RED], ["C"])
    assert "left of the wavelengths, and not read: A, B" in table.notes
    assert "left out, as they hold no spectra: seen" in table.notes


def test_empty_and_text_columns_and_means_below_are_left_out(read):
    text = "nm,red,,seen,blue\n" + rows(RED, [""] * 31, ["fine"] * 31, BLUE)
    table = read(text + "\nmean,0.4,,,0.5\n")
    same(table, GRID, [RED, BLUE], ["red", "blue"])
    assert "left out, as they hold no spectra: column 3, seen" in table.notes
    assert "the table ends above line 34: mean,0.4,,,0.5" in table.notes
    with refusal("line 33: column 'nm': 'mean' is not a wavelength"):
        read(text + "mean,0.4,,,0.5\n")


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-be"])
def test_utf_16_of_any_format(put, read, encoding):
    mark = "\ufeff" if encoding == "utf-16-be" else ""
    text = mark + "Wellenlänge\tWeiß α\r\n" + comma_rows(RED)
    same(read(text, encoding=encoding), GRID, [RED], ["Weiß α"], atol=1e-9)
    path = put(mark + jcamp_block(), encoding=encoding)
    assert read_spectra(path).format == "JCAMP-DX"


def test_names_are_padded_by_nul_above_a_table_only(read):
    text = "S1\0\0\0\nWave   ;Reflectance\n[nm]   ;[% reflectance]\n" + rows(DARK, by=";")
    are_dark(read(text))
    with refusal("not a text file"):
        read(text.replace("500.0;", "500.0;\0"))


@pytest.mark.parametrize("factor", [1, 100])
def test_a_sample_may_be_called_as_wavelengths_are(read, factor):
    table = read("wavelength_nm,Wave blue,WL 1\n" + rows(factor * BLUE, factor * RED))
    same(table, GRID, [BLUE, RED], ["Wave blue", "WL 1"], atol=1e-9)


def test_percent_cells_are_percent_and_all_alike(read):
    cells = [f"{value}%" for value in DARK]
    text = "nm,red,blue\n" + rows(cells, cells)
    are_dark(read(text))
    with refusal("some cells are in percent, with %, and some are not"):
        read(text.replace("%\n", "\n", 1))


def test_percent_cells_are_counted_before_bands_are_dropped(read):
    """Spectra that share some bands only, of which one ends above the other."""
    red = [f"{100 * value}%" for value in RED]
    blue = [*(f"{100 * value}%" for value in BLUE[:-2]), "", ""]
    shifted = [*(GRID[:-2] + 10), "", ""]
    text = "nm,red,nm,blue\n" + rows(red, shifted, blue)
    same(read(text), GRID[1:-1], [RED[1:-1], BLUE[:-2]], ["red", "blue"], atol=1e-9)
    with refusal("some cells are in percent, with %, and some are not"):
        read(text.replace("%", "", 1))


def test_deleted_channels_and_noisy_ends_of_a_titled_table(read):
    grid = np.arange(330.0, 951.0, 10.0)
    values = np.full(grid.size, 0.4)
    values[[1, 61]] = -5.0, 7.0
    values[30] = -1.23e34
    table = read("nm,tile\n" + rows(values, grid=grid))
    assert table.wavelengths.tolist() == [*grid[2:30], *grid[31:61]]
    assert "4 bands at the ends are left out, at 330-340, 940-950 nm: they hold noise alone" in (
        table.notes
    )
    values[20] = -5.0
    with refusal(r"'tile' is negative at band \d+ \(530 nm\): -5"):
        read("nm,tile\n" + rows(values, grid=grid))


@pytest.mark.parametrize("unit", ["%R", "R%", "% REFLECTANCE", "Reflectance (%)"])
def test_jcamp_percent_and_labels_of_a_maker_s_own(read, unit):
    text = jcamp_block(values=DARK, yunits=unit).replace("##XUNITS", "##$CONTENT$\n##XUNITS")
    are_dark(read(text))
    assert read(jcamp_block(yunits="Reflectivity")).unit == "fraction"


def test_a_workbook_without_spectra_names_its_sheets(tmp_path):
    book = pytest.importorskip("openpyxl").Workbook()
    book.active.title = "Painting"
    book.active.append(["Project", "X"])
    book.create_sheet("Places").append(["sky", "left"])
    book.save(tmp_path / "film.xlsx")
    with refusal("no sheet holds a table of spectra; there are Painting, Pl"):
        read_spectra(tmp_path / "film.xlsx")


@pytest.mark.parametrize(
    "text",
    [
        "Wavelength;black\nnm;%\n" + rows(DARK, by=";"),
        "\tblack\nnm\t%R\n" + rows(DARK, by="\t"),
        "Wavelength (nm)\tblack\n\t%R\n" + comma_rows(DARK),
        "# reflectance in percent\nnm,black\n" + rows(DARK),
        "nm;black, %\n" + rows(DARK, by=";"),
        "Software 2\nYUNITS\t%R\n" + rows(DARK, by="\t"),
        '"nm","R pct"\n'
        + "".join(f'"{w:g},0","{d}"\n'.replace(".", ",") for w, d in zip(GRID, DARK, strict=True)),
        "nm;black\n" + rows([f"{value}\u00a0%" for value in DARK], by=";"),
        *(
            f"Name;{';'.join(map(band.format, GRID))}\nblack;{';'.join(map(str, DARK))}\n"
            for band in ("R{:g}%", "{:g} %", "R_{:g}nm_%", "R% {:g}", "SPECTRAL_PCT_{:g}")
        ),
        f"Name;Unit;{';'.join(map('{:g}'.format, GRID))}\nblack;%;{';'.join(map(str, DARK))}\n",
    ],
)
def test_percent_of_a_row_of_units_a_line_above_a_band_or_a_cell(read, text):
    are_dark(read(text))


QUANTITIES = {
    "absorbance": ["Absorbance red", "log(1/R)", "-log R", "A.U.", "O.D.", "Assorbanza"],
    "K/S": ["K/S", "k over s"],
    "transmittance": ["Transmittance [%]"],
    "radiance": ["Radiance (W/m^2/sr/nm)", "Strahldichte"],
    "irradiance": ["uW/cm^2/nm", "Abs. Irradiance", "µW/cm²/nm"],
    "emission": ["Emission", "Emittance"],
    "counts": ["S1 [counts]", "Norm. DN", "Raw DN", "S1 (cts)"],
    "decibels": ["Level (dB)"],
    "intensity": ["Intensity (a.u.)"],
    "a deviation": ["Standard deviation"],
    "a derivative": ["First derivative"],
}


@pytest.mark.parametrize("quantity", QUANTITIES)
def test_quantities_in_a_title_a_row_of_units_and_a_line_above(put, quantity):
    """They are refused by name, unless the user says that it is reflectance."""
    for title in QUANTITIES[quantity]:
        for text in (
            f"nm;{title}\n",
            f"Wavelength;sample 1\nnm;{title}\n",
            f"Jaz\nY Axis: {title}\nWavelength;sample 1\n",
        ):
            path = put(text + rows(RED, by=";"))
            refused(path, f"is {quantity}, and only reflectance can be read")
        table = read_spectra(path, quantity="reflectance", unit="fraction")
        assert_array_equal(table.reflectance[0], RED)


def test_percent_of_a_sample_stays_in_its_name(read):
    text = "nm;white (%R);red (%R)\n" + rows(DARK, DARK, by=";")
    assert read(text).names == ("white (%R)", "red (%R)")


@pytest.mark.parametrize(
    "header",
    ["nm;mean;std", "nm;Reflectance;Reflectance SD", "Lambda;Reflexion;Dunkel", "nm;R red;St.dev."],
)
def test_deviations_and_readings_are_no_spectra(read, header):
    table = read(f"{header}\n" + rows(RED, 0.01 * BLUE, by=";"))
    same(table, GRID, [RED], table.names)


def test_titles_stand_above_decimal_commas_and_numbers(read):
    text = "x (nm)\tred\tblue\n" + comma_rows(RED, BLUE)
    same(read(text), GRID, [RED, BLUE], ["red", "blue"], atol=1e-9)
    text = "\tred\t\tblue\t\nnm\t1\t2\t1\t2\n" + rows(RED, RED, BLUE, BLUE, by="\t")
    names = ["red 1", "red 2", "blue 1", "blue 2"]
    same(read(text), GRID, [RED, RED, BLUE, BLUE], names)


def test_what_is_no_wavelength_is_left_out(read):
    text = "Wavenumber (cm-1);nm;Energy (eV);red\n"
    table = read(text + rows(GRID, 1240 / GRID, RED, by=";", grid=1e7 / GRID))
    same(table, GRID, [RED], ["red"])
    assert "left out, as they hold no spectra: Wavenumber (cm-1), Energy (eV)" in table.notes


def test_the_usual_mark_of_missing_data_in_a_table(read):
    values = RED.copy()
    values[[3, 4]] = -9999
    table = read("nm,red\n" + rows(values))
    assert table.wavelengths.tolist() == [*GRID[:3], *GRID[5:]]
    assert "-9999 was taken for missing data" in table.notes


def test_cxf_may_be_utf_16(read):
    assert "red" in read(CXF.replace("UTF-8", "UTF-16"), encoding="utf-16").names
