from typing import Any

import numpy as np
import pytest

from glazejax.io import write_spectra

from .samples import CXF as SAMPLE
from .samples import TABLE, refused, same

FILE = "chart.cxf"


def test_a_file_of_another_program(read):
    table = read(SAMPLE)
    same(table, [380, 390, 400], [[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]], ["red", "red (2)"])
    assert table.format == "CxF3"
    assert table.attributes["ColorSpecification"] == ("M0", "M0")


def test_text_between_the_tags_is_a_note(read, caplog):
    table = read(SAMPLE.replace("</cc:Object>", "</cc:Object> see below"))
    assert len(table) == 2
    assert [note for note in table.notes if note.startswith("text between the tags")]
    assert not caplog.records


def test_percent_against_the_standard_is_seen(read):
    text = SAMPLE.replace("0.1 0.2 0.3", "10 20 30").replace("0.4 0.5 0.6", "40 50 60")
    table = read(text)
    np.testing.assert_allclose(table.reflectance, [[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]])
    assert table.unit == "percent"


def test_what_is_written_follows_the_schema(tmp_path):
    colour_cxf = pytest.importorskip("colour_cxf")
    write_spectra(TABLE, tmp_path / "t.cxf")
    document: Any = colour_cxf.read_cxf_from_file(tmp_path / "t.cxf")
    (specification,) = document.resources.color_specification_collection.color_specification
    measured = specification.measurement_spec
    assert measured.measurement_type.value.value == "Spectrum_Reflectance"
    assert (measured.wavelength_range.start_wl, measured.wavelength_range.increment) == (400, 10)
    # The instrument is not known, and none is invented.
    assert measured.geometry_choice.choice == "unknown"
    assert b"UnknownGeometry" in (tmp_path / "t.cxf").read_bytes()
    things = document.resources.object_collection.object_value
    assert [thing.name for thing in things] == ["a", "b", "c"]
    assert all(
        thing.color_values.choice[0].color_specification == specification.id for thing in things
    )


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("<html></html>", "XML, but not CxF3"),
        (SAMPLE[:900], "not legal CxF3"),
        # As much of it as begins in the middle of an element, above a table of numbers.
        (
            SAMPLE[-200:] + "\n650 0.85\n660 0.85\n670 0.85\n",
            "looks like XML, such as CxF, whose beginning is missing",
        ),
        (SAMPLE.replace("0.4 0.5 0.6", ""), "spectrum of 'red' is empty"),
        (
            SAMPLE.replace("<cc:ColorValues>", "", 1)
            .replace("</cc:ColorValues></cc:Object>", "", 1)
            .replace("<cc:ReflectanceSpectrum", "</cc:Object><cc:ReflectanceSpectrum", 1),
            "a spectrum stands outside",
        ),
        (SAMPLE.replace("0.4 0.5 0.6", "0.4 0.5"), "a table has one grid"),
        (SAMPLE.replace("0.4 0.5 0.6", "0.4 high 0.6"), "holds 'high', not a number"),
        (SAMPLE.replace("0.4 0.5 0.6", "0.4 NaN 0.6"), "not finite at band 2"),
        (SAMPLE.replace("0.4 0.5 0.6", "40 50 60"), "mixed"),
        (SAMPLE.replace("ReflectanceSpectrum", "EmissiveSpectrum"), "without reflectance spectra"),
        (
            SAMPLE.replace('<cc:WavelengthRange StartWL="380" Increment="10"/>', ""),
            "no wavelengths for 'red'",
        ),
        (SAMPLE.replace('Increment="10"', 'Increment="ten"'), "no wavelengths for 'red'"),
        (SAMPLE.replace('Increment="10"', f'Increment="{"9" * 400}"'), "no wavelengths for 'red'"),
    ],
)
def test_errors_are_one_line(put, text, complaint):
    refused(put(text), complaint)
