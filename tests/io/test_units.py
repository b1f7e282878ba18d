"""The sodium D line and two lines of mercury in every unit of wavelength that a file can state."""

import json
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from glazejax.commands import options
from glazejax.io import read_spectra
from glazejax.io.quantity import nanometres

from ..refusals import refusal
from . import test_envi
from .cubes.images import envi
from .samples import GRID, envi_list, jcamp_block

# Wavelengths in nm of Hg (green), Hg (yellow) and Na D2, and the same lines as tables print them in
# other units.
LINES = np.array([546.07, 579.07, 589.00])
PRINTED = {
    "nm Nanometers": LINES,
    "um Micrometers µm microns": [0.54607, 0.57907, 0.589],
    "A Å Angstrom ANGSTROMS": [5460.7, 5790.7, 5890.0],
    "m metres": [5.4607e-7, 5.7907e-7, 5.89e-7],
    "1/cm cm-1 Wavenumber": [18312.67, 17269.07, 16977.93],
}
IN_UNITS = {unit: values for units, values in PRINTED.items() for unit in units.split()}
VALUES = [0.2, 0.4, 0.6]


@pytest.mark.parametrize("format_name", ["envi", "jcamp", "json"])
@pytest.mark.parametrize("unit", IN_UNITS)
def test_lines_are_where_they_are(here, put, format_name, unit):
    values = np.asarray(IN_UNITS[unit], float)
    if format_name == "envi":
        path = test_envi.put(
            [VALUES],
            samples=3,
            lines=1,
            wavelength=envi_list(values),
            wavelength_units=unit,
            spectra_names="{lamp}",
        )
    elif format_name == "jcamp":
        path = put(jcamp_block("lamp", VALUES, grid=values, xunits=unit), "lamp.dx")
    else:
        grid = {"type": "wavelengths", "values": values.tolist(), "unit": unit}
        path = put(json.dumps([grid, {"name": "lamp", "reflectance": VALUES}]), "lamp.json")
    table = read_spectra(path)
    assert_allclose(table.wavelengths, LINES, rtol=1e-6)
    assert_allclose(table.reflectance[0], VALUES, atol=1e-6)


def test_without_a_unit_small_numbers_are_micrometres():
    for unit in (None, "", "Unknown"):
        assert_allclose(nanometres(np.array(IN_UNITS["um"]), unit)[0], LINES)
        assert_allclose(nanometres(LINES, unit)[0], LINES)
        # No spectrum of paint begins at 100 nm, and no spectrometer's ends below it in micrometres.
        assert nanometres(np.array([50.0, 100.0]), unit)[0][-1] == 100.0
        assert nanometres(np.array([0.5, 99.5]), unit)[0][-1] == 99500.0
        with refusal("band numbers"):
            nanometres(np.arange(1.0, 31.0), unit)


def test_units_that_are_none():
    with refusal("furlong"):
        nanometres(LINES, "furlong")
    for wrong in (0.0, -1.0):
        with refusal("must be positive"):
            nanometres(np.array([wrong, 16000.0]), "1/cm")


@pytest.mark.parametrize("scale", [0.0, -1.0, np.inf, np.nan])
def test_a_scale_must_be_positive_and_finite(here, put, scale):
    table = put("nm,red\n400,-0.5\n410,-0.5\n", "film.csv")
    library = test_envi.put()
    image = envi()
    for path in (table, library, image):
        with refusal(f"scale is {scale:g}; it must be positive and finite"):
            read_spectra(path, scale=scale)
    with refusal(f"^--scale is {scale:g}; it must be positive and finite"):
        options.stated(None, None, scale)


@pytest.mark.parametrize(
    ("stated", "words"),
    [
        ({"unit": "1/cm um"}, "unit 'um' contradicts '1/cm'"),
        ({"unit": "percent fraction"}, "unit 'fraction' contradicts 100.0"),
        ({"unit": "percent", "scale": 1.0}, "unit 'percent' contradicts 1.0"),
    ],
)
def test_units_that_contradict_each_other_are_refused(put, stated: Any, words):
    with refusal(words):
        read_spectra(put("wavelength,red\n400,0.5\n410,0.5\n", "film.csv"), **stated)


def test_units_of_both_kinds_may_be_stated_together(put):
    path = put("wavelength,red\n20000,50\n16000,40\n", "film.csv")
    for table in (
        read_spectra(path, unit="1/cm percent"),
        read_spectra(path, unit="1/cm, percent", scale=100.0),
    ):
        assert_array_equal(table.wavelengths, [500.0, 625.0])
        assert_allclose(table.reflectance, [[0.5, 0.4]])


def test_whole_wavelengths_in_wavenumbers_stay_whole():
    for decimals in (1, 2, 3):
        rounded = np.round(1e7 / GRID, decimals)
        assert_array_equal(nanometres(rounded, "1/cm")[0], GRID)
    fine = np.array([10000.0, 9998.0, 9996.0])
    assert_array_equal(nanometres(fine, "1/cm")[0], 1e7 / fine)
