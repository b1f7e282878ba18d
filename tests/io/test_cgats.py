import numpy as np
import pytest

from ..refusals import refusal
from .samples import CGATS as PLAIN
from .samples import refused, same

GRID, VALUES = [400, 410, 420], [[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]]
NAMES = ["red, light", "blue"]


FILE = "chart.txt"


@pytest.mark.parametrize(
    "text",
    [
        PLAIN,
        PLAIN.replace("SPECTRAL_NM", "SPECTRAL_NM_"),
        PLAIN.replace("SPECTRAL_NM", "SPEC_"),
        PLAIN.replace("SPECTRAL_NM", "nm"),
        PLAIN.replace("SPECTRAL_NM400", "R_400nm").replace("SPECTRAL_NM", "SPECTRAL_"),
        PLAIN.replace("\t", "  ").replace("\n", "\r\n"),
        PLAIN.replace("0.", "0,"),
        PLAIN.replace("CGATS.17", "IT8.7/4"),
    ],
)
def test_ways_to_name_bands(read, text):
    table = read(text)
    same(table, GRID, VALUES, NAMES, atol=1e-12)
    assert table.format == "CGATS text"
    assert table.notes == ["no unit is stated: taken as fractions"]
    # What is neither the name nor a band.
    assert set(table.attributes) == {"SAMPLE_ID", "LAB_L"}
    assert table.attributes["SAMPLE_ID"] == ("1", "2")


def scaled(text, factor):
    """The same with other values."""
    for value in np.ravel(VALUES):
        text = text.replace(f"{value:.2f}", f"{factor * value:g}")
    return text


def pairs(text, unit, factor):
    """The standard's own form: wavelengths in the sets, a field before each value."""
    head, _, sets = text.partition("BEGIN_DATA\n")
    for wavelength in GRID:
        head = head.replace(f"SPECTRAL_NM{wavelength}", f"SPECTRAL_NM\tSPECTRAL_{unit}")
    for wavelength, values in zip(GRID, np.transpose(VALUES), strict=True):
        for value in values:
            new = f"{wavelength}\t{factor * value:g}"
            sets = sets.replace(f"\t{value:.2f}", f"\t{new}", 1)
    return f"{head}BEGIN_DATA\n{sets}".replace("FIELDS\t6", "FIELDS\t9")


@pytest.mark.parametrize(("unit", "factor"), [("PCT", 100), ("DEC", 1)])
def test_units_said_by_fields_and_pairs_of_fields(read, unit, factor):
    """Dark ones: no size of numbers tells percent."""
    text = scaled(PLAIN.replace("SPECTRAL_NM", f"SPECTRAL_{unit}"), factor / 100)
    same(read(text), GRID, np.array(VALUES) / 100, NAMES, atol=1e-12)
    same(read(pairs(PLAIN, unit, factor)), GRID, VALUES, NAMES, atol=1e-12)


def test_pairs_of_other_wavelengths_are_refused(read):
    text = pairs(PLAIN, "PCT", 100)
    other = text[::-1].replace("014", "114", 1)[::-1]
    with refusal("the wavelength is 411 where the first set has 410"):
        read(other)
    with refusal("SPECTRAL_NM is followed by XYZ_X"):
        read(text.replace("SPECTRAL_PCT", "XYZ_X"))


def test_percent_by_name_by_norm_and_by_sight(read):
    percent = scaled(PLAIN, 100)
    for text in (
        percent,
        percent.replace("SPECTRAL_NM", "SPECTRAL_PCT_"),
        percent.replace("NUMBER_OF_SETS", 'SPECTRAL_NORM "100.0"\nNUMBER_OF_SETS'),
    ):
        table = read(text)
        same(table, GRID, VALUES, NAMES, atol=1e-12)
        assert table.unit == "percent"
        assert table.notes == ["values are in percent; divided by 100"]


def test_dark_percent_is_known_by_its_norm(read):
    text = PLAIN.replace("NUMBER_OF_SETS", "SPECTRAL_NORM 100\nNUMBER_OF_SETS")
    assert read(text).reflectance.max() == pytest.approx(0.006)


def test_names_that_repeat_are_numbered(read):
    table = read(PLAIN.replace('"red, light"', "blue"))
    assert table.names == ("blue", "blue (2)")
    assert table.notes[0] == "names that repeat were numbered: blue"


def test_old_text_is_latin(read):
    assert read(PLAIN.replace("blue", "grün").encode("latin-1")).names[1] == "grün"


def test_second_table_has_the_spectra(read):
    first = "CTI3\nBEGIN_DATA_FORMAT\nINDEX VALUE\nEND_DATA_FORMAT\nBEGIN_DATA\n1 2\nEND_DATA\n"
    table = read(first + PLAIN)
    assert np.shape(table.reflectance) == (2, 3)
    assert "2 tables" in table.notes[0]


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("CGATS.17\n", "without fields"),
        (PLAIN.replace("END_DATA\n", ""), "cut short"),
        (
            PLAIN.replace("2\tblue\t20.1\t0.40\t0.50\t0.60\n", ""),
            "promises 2 sets, and there are 1",
        ),
        (PLAIN.replace("\t0.60", ""), "line 11: 5 values where there are 6 fields"),
        (
            PLAIN.replace("0.60", "high"),
            "line 11: field SPECTRAL_NM420: 'high' is not a finite number",
        ),
        (PLAIN.replace("0.60", "nan"), "'nan' is not a finite number"),
        (
            PLAIN.replace("SPECTRAL_NM", "CMYK_"),
            "without spectra: no field such as SPECTRAL_NM_400",
        ),
        (PLAIN.replace("NM410", "NM400"), "400 nm is given twice"),
        (PLAIN.replace("0.10", "10").replace("0.40", "0.04"), "mixed"),
        (PLAIN.replace("0.10", "-0.3"), "'red, light' is negative"),
        (PLAIN.replace("NUMBER_OF_SETS", "SPECTRAL_NORM 0\nNUMBER_OF_SETS"), "must be positive"),
        (PLAIN + "NUMBER_OF_SETS 12\n", "NUMBER_OF_SETS promises 12 sets, and there are 2"),
        ("CGATS.17\nBEGIN_DATA\n1 2\nEND_DATA\n", "BEGIN_DATA without BEGIN_DATA_FORMAT"),
    ],
)
def test_errors_are_one_line(put, text, complaint):
    refused(put(text), complaint)
