"""ENVI libraries and images, most of them written by Spectral Python."""

import re
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import spectral.io.envi as spy
from numpy.testing import assert_allclose

from glazejax.io import open_cube, read_spectra

from .cubes.images import holes
from .samples import ENVI as HEADER
from .samples import GRID, envi_header, envi_list, refused, same, spectra

pytestmark = pytest.mark.usefixtures("here")
NAMES = ["red", "green", "blue"]


def put(values=None, **changes):
    """Write a library by hand; fields that are None are left out."""
    header = HEADER | {title.replace("_", " "): text for title, text in changes.items()}
    path = Path("lib.hdr")
    path.write_text(envi_header(header), encoding="utf-8")
    values = spectra() if values is None else values
    path.with_suffix(".sli").write_bytes(np.asarray(values, "<f4").tobytes())
    return path


@pytest.fixture
def read():
    """Spectra of such a library."""

    def read_library(values=None, **changes):
        return read_spectra(put(values, **changes))

    return read_library


def spoilt(where, value, rows=3):
    """Spectra with another value there."""
    values = spectra(rows)
    values[where] = value
    return values


def test_library_written_by_spectral_python():
    library: Any = spy.SpectralLibrary(
        spectra().astype("f4"), {"wavelength": GRID, "spectra names": ["a", "b", "c"]}
    )
    library.bands.band_unit = "Nanometers"
    library.save("lib")
    for name in ("lib.hdr", "lib.sli"):
        same(read_spectra(name), GRID, spectra(), "abc", atol=1e-7)


def test_two_wavelengths_that_changed_places_are_no_overlap(read):
    order = [*range(10), 11, 10, *range(12, GRID.size)]
    table = read(spectra()[:, order], wavelength=envi_list(GRID[order]))
    same(table, GRID, spectra(), NAMES, atol=1e-7)
    assert table.notes == [
        "bands were sorted by wavelength",
        "no unit is stated: taken as fractions",
    ]


def test_long_headers_are_read_in_one_pass():
    path = put()
    path.write_text(path.read_text() + "note = 1\n" * 60_000)
    began = time.process_time()
    read_spectra(path)
    assert time.process_time() - began < 2


def test_fields_beyond_the_standard_are_attributes(read):
    table = read(pname="{Zinnober hell, Grün, Bleu d'outremer}", Author="Ö")
    same(table, GRID, spectra(), NAMES, atol=1e-7)
    assert table.attributes == {"pname": ("Zinnober hell", "Grün", "Bleu d'outremer")}


def test_spectra_may_lack_names(read):
    for names, right in {
        "{red, , blue}": ["red", "spectrum 2", "blue"],
        "{red, green, blue,}": NAMES,
        "{}": ["spectrum 1", "spectrum 2", "spectrum 3"],
    }.items():
        same(read(spectra_names=names), GRID, spectra(), right, atol=1e-7)


def test_old_headers_are_latin():
    path = put()
    path.write_bytes(path.read_text().replace("green", "grün").encode("latin-1"))
    assert read_spectra(path).names == ("red", "grün", "blue")


def test_units_scale_bad_bands_order_and_missing_data(read):
    values = spectra() * 10_000
    values[1, 5] = -999
    values[:, 7] = -999
    table = read(
        values[:, ::-1],
        wavelength="{" + ",\n ".join(f"{w / 1000:g}" for w in GRID[::-1]) + "}",
        wavelength_units="Micrometers",
        reflectance_scale_factor=10000,
        data_ignore_value=-999,
        bbl=envi_list([0] + [1] * 30),
        spectra_names="{red, red, blue}",
    )
    kept = np.delete(np.arange(30), 7)  # the first of the file is the last here, and bad
    same(table, GRID[kept], spectra()[[0, 2]][:, kept], ["red", "blue"], atol=1e-6)
    assert table.unit == "scaled"
    told = str(table.notes)
    for words in (
        "micrometres",
        "1 bands that the header marks as bad",
        "sorted",
        "1 bands without data",
        "red (2)",
    ):
        assert words in told


@pytest.mark.parametrize("zero", ["0.0", "0.00", "0e0", "-0"])
def test_bad_bands_are_those_whose_number_is_zero(read, zero):
    table = read(bbl=envi_list([zero, *[1.0] * 6, zero, *[1.0] * 23]))
    good = np.delete(np.arange(31), [0, 7])
    same(table, GRID[good], spectra()[:, good], NAMES, atol=1e-7)


def test_values_above_one_are_kept_and_said(read):
    names = envi_list(f"p{i}" for i in range(40))
    table = read(spoilt((3, 8), 2.4, rows=40), lines=40, spectra_names=names)
    assert table.unit == "fraction"
    assert table["p3"].max() == pytest.approx(2.4)
    assert "p3 exceeds a reflectance of 1, up to 2.4" in str(table.notes)


def test_percent_is_said(read):
    table = read(spectra() * 100)
    same(table, GRID, spectra(), NAMES, atol=1e-6)
    assert (table.format, table.unit) == ("ENVI spectral library", "percent")
    assert table.notes == ["values are in percent; divided by 100"]


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"wavelength": None}, "no wavelengths; add"),
        ({"wavelength": "{400, 410}"}, "2 wavelengths for 31 bands"),
        ({"wavelength": envi_list("x" * 31)}, "number 1 in the header is .x., not a number"),
        ({"wavelength": envi_list([500] * 31)}, "500 nm is given twice"),
        ({"wavelength_units": "GHz"}, "wavelengths are in 'GHz'"),
        ({"wavelength": envi_list(range(1, 32)), "wavelength_units": None}, "band numbers"),
        ({"wavelength_units": "Index"}, "wavelengths are in 'Index'"),
        ({"samples": None}, "lacks 'samples'"),
        ({"samples": "many"}, "not legal"),
        ({"data_type": 77}, "not legal"),
        ({"interleave": "xyz"}, "not legal"),
        ({"lines": 0}, "sizes below 1"),
        ({"data_type": 6}, "complex"),
        ({"data_type": 5}, "the file was cut short"),
        ({"lines": 4}, "the file was cut short"),
        (
            {"spectra_names": "{a, b, c, d}"},
            "4 spectra names for 3 spectra; does a name hold a comma",
        ),
        ({"bbl": "{0, 1}"}, "2 entries for 31 bands"),
        ({"bbl": "{1, good}"}, "'bbl' number 2 in the header is 'good', not a number"),
        ({"bbl": envi_list("0" * 31)}, "every band as bad"),
        ({"reflectance_scale_factor": 0}, "must be positive"),
        ({"reflectance_scale_factor": "ten"}, "not a number"),
        ({"reflectance_scale_factor": 0.01}, "is the file's unit or scale factor right"),
        ({"values": spoilt((1, 4), np.nan)}, "'green' is not finite at band 5"),
        ({"values": spoilt((1, 4), -0.5)}, "'green' is negative at band 5"),
        ({"values": spoilt(2, 60)}, "mixed: blue in percent .*, green in fractions"),
        ({"values": np.zeros((3, 31)), "data_ignore_value": 0}, "no spectrum has any data"),
    ],
)
def test_errors_are_one_line(changes, complaint):
    refused(put(**changes), complaint)


def test_header_cut_short():
    path = put()
    path.write_text(path.read_text()[:-9])
    refused(path, "not a legal ENVI header")


def test_header_without_data():
    path = put()
    Path("lib.sli").unlink()
    refused(path, "no data next to this ENVI header", error=FileNotFoundError)


def test_data_without_header():
    put().unlink()
    refused("lib.sli", r"lib\.sli: not")


def overwrite(dtype, place, value):
    """Change what stands in the file of such an image, its lines by bands and samples."""
    raw = np.memmap("image.img", dtype, "r+", shape=(4, 31, 5))
    raw[place] = value
    raw.flush()


def cube(interleave="bil", dtype="u2", scale=10_000, **fields):
    """Image of 4 lines x 5 samples, written by Spectral Python; what it holds as fractions."""
    image = spectra(20).reshape(4, 5, -1)
    spy.save_image(
        "image.hdr",
        (image * scale).astype(dtype),
        interleave=interleave,
        metadata={"wavelength": GRID.tolist(), "wavelength units": "nm"}
        | {title.replace("_", " "): value for title, value in fields.items()},
        byteorder="little",
    )
    return image


def test_image_as_a_table():
    image = cube(dtype="f4", scale=100)
    table = read_spectra("image.img")
    assert table.format == "ENVI image"
    assert table.unit == "percent"
    assert table.names[:6] == (*(f"line 1 sample {i}" for i in range(1, 6)), "line 2 sample 1")
    assert_allclose(table.reflectance, image.reshape(20, -1), atol=1e-6)


def test_missing_pixels_and_bad_bands_of_an_image():
    image = cube(reflectance_scale_factor=10000, data_ignore_value=0, bbl=[0] + [1] * 30)
    overwrite("<u2", np.s_[2, :, 3], 0)
    opened = open_cube("image.hdr")
    assert opened["wavelength"][0] == 410
    assert np.isnan(opened[2, 3]).all()
    table = read_spectra("image.hdr")
    assert len(table) == 19
    assert "line 3 sample 4" not in table.names
    assert_allclose(table["line 1 sample 1"], image[0, 0, 1:], atol=1e-4)


@pytest.mark.parametrize(("dtype", "mark"), [("u2", -999), ("f4", -1.23e34), ("i2", -999)])
def test_mark_of_missing_data_in_the_files_own_type(dtype, mark):
    image = cube(dtype=dtype, reflectance_scale_factor=10000, data_ignore_value=mark)
    if dtype != "u2":
        overwrite(f"<{dtype}", np.s_[0, :, 0], mark)
    opened = open_cube("image.hdr")
    assert np.isnan(opened[0, 0]).all() == (dtype != "u2")
    assert_allclose(opened[0, 1], image[0, 1], atol=1e-4)


def test_header_with_both_endings():
    put().rename("lib.sli.hdr")
    assert len(read_spectra("lib.sli.hdr")) == len(read_spectra("lib.sli")) == 3


def test_glare_does_not_decide_an_images_unit():
    image = np.tile(spectra(1), (200, 10, 1)).astype("f4")
    image[7, 3] *= 4
    spy.save_image("image.hdr", image, metadata={"wavelength": GRID.tolist()})
    table = read_spectra("image.hdr")
    assert table.unit == "fraction"
    assert table["line 8 sample 4"].max() > 3


def test_large_images_stay_on_disk():
    path = holes("bsq", 1000, 1000, [500, 600])
    assert open_cube(path).shape == (1000, 1000, 2)
    refused(path, "1000 x 1000 pixels are too many")


def test_images_without_a_scale():
    cube()
    refused("image.hdr", "neither fraction nor percent: add 'reflectance scale factor")


@pytest.mark.parametrize("dtype", ["u1", "u2", "i2"])
def test_whole_numbers_are_counts_until_a_scale_is_said(dtype):
    image = cube(dtype=dtype, scale=100)
    for read in (read_spectra, open_cube):
        refused("image.hdr", r"whole numbers up to \d+ are a camera's counts", read)
    assert_allclose(open_cube("image.hdr", scale=100), image, atol=0.01)


@pytest.mark.parametrize("words", ["data", "data reflectance"])
@pytest.mark.parametrize("interleave", ["bil", "bsq"])
def test_gains_and_offsets_of_a_header_are_applied(words, interleave):
    gains = np.linspace(0.5e-4, 1e-4, GRID.size)
    offsets = np.linspace(0.1, 0, GRID.size)
    fields = {f"{words} gain values": gains.tolist(), f"{words} offset values": offsets.tolist()}
    image = cube(interleave, bbl=[1, 0] + [1] * 29, **fields)
    right = (np.trunc(image * 10_000) * gains + offsets)[..., np.arange(31) != 1]
    opened = open_cube("image.hdr")
    assert_allclose(opened, right, atol=1e-6)
    assert opened.attrs["saturated"] == np.inf
    assert "gain and offset" in str(opened.attrs["notes"])
    table = read_spectra("image.hdr")
    assert_allclose(table.reflectance, right.reshape(20, -1), atol=1e-12)
    assert table.notes[: len(opened.attrs["notes"])] == opened.attrs["notes"]


def test_offsets_without_gains_are_applied():
    image = cube(data_offset_values=[-1000.0] * 31, reflectance_scale_factor=10_000)
    assert_allclose(open_cube("image.hdr"), image - 0.1, atol=1e-4)


def test_gains_of_another_length_are_refused():
    cube(data_gain_values=[1, 2, 3])
    refused("image.hdr", "'data gain values' has 3 entries for 31 bands", open_cube)


def test_a_header_without_byte_order_is_read_and_said():
    image = cube(dtype="f4", scale=1)
    header = Path("image.hdr")
    header.write_text(re.sub("byte order.*\n", "", header.read_text()))
    opened = open_cube(header)
    assert_allclose(opened, image, atol=1e-6)
    assert "byte order" in str(opened.attrs["notes"])


def test_deleted_channels_of_a_library_are_missing(read):
    """Marked by -1.23e34, by each spectrum elsewhere, and by no word of the header."""
    values = spectra()
    for row, channels in enumerate([slice(0, 4), slice(0, 2), slice(1, 2)]):
        values[row, channels] = -1.23e34
    table = read(values)
    same(table, GRID[4:], spectra()[:, 4:], NAMES, atol=1e-7)
    assert "4 bands without data" in str(table.notes)


def test_deleted_pixels_of_an_image_are_missing():
    cube(dtype="f4", scale=1)
    overwrite("<f4", np.s_[2, :, 3], -3.4e38)
    opened = open_cube("image.hdr")
    assert np.isnan(opened[2, 3]).all()
    assert np.isfinite(opened[:2]).all()
    assert "-3.4e+38" in str(opened.attrs["notes"])


def test_libraries_are_no_images():
    refused(put(), "use read_spectra", open_cube)


def test_pigment_charts(shared_data):
    folder = shared_data / "hyppigments"
    table = read_spectra(folder / "speclib_averages.hdr")
    assert table.reflectance.shape == (1592, 186)
    # The figures of its SOURCE.md: shades get lighter, values reach 1.65.
    shades = [table.reflectance[i::4].mean() for i in range(4)]
    assert_allclose(shades, [0.158, 0.217, 0.320, 0.488], atol=6e-4)
    assert table.reflectance.max() == pytest.approx(1.65, abs=0.005)
    assert table.unit == "fraction"
    assert "1.65" in str(table.notes)
    assert len(table.attributes["pname"]) == 1592
    assert read_spectra(folder / "speclib_averages.sli").names == table.names
