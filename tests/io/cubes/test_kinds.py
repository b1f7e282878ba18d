"""Images of every kind, written by Spectral Python, xarray, h5netcdf, h5py, SciPy and tifffile."""

import gc
import itertools
import warnings
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import spectral.io.envi as spy
import tifffile
import zarr as zarr_package
from numpy.testing import assert_allclose, assert_array_equal

from glazejax.io import open_cube, probe, read_spectra

from .images import (
    IMAGE,
    KINDS,
    LINES,
    PACKED,
    SAMPLES,
    WAVELENGTHS,
    envi,
    hdf5,
    image,
    labelled,
    tiff,
    tiffs,
    zarr,
)

pytestmark = pytest.mark.usefixtures("here")


def agree(cube, values, atol=2e-7):
    """Assert that a cube holds this, as a whole and in windows."""
    assert cube.dims == ("y", "x", "wavelength")
    assert cube.dtype == np.float32
    assert_array_equal(cube["wavelength"], WAVELENGTHS)
    assert_allclose(cube, values, rtol=0, atol=atol)
    window = cube.isel(y=slice(5, 20, 4), x=slice(3, 17))
    assert_allclose(window, values[5:20:4, 3:17], rtol=0, atol=atol)
    assert_allclose(
        cube.isel(y=-2, wavelength=[4, 1]).values, values[-2][:, [4, 1]], rtol=0, atol=atol
    )


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_is_the_same_image(files, kind):
    cube = open_cube(**files[kind])
    agree(cube, IMAGE)
    assert cube.attrs["shape_in_file"] == [*IMAGE.shape]
    assert cube.attrs["unit"] == "fraction"
    assert "saturated" not in cube.attrs


@pytest.mark.parametrize(
    ("interleave", "order", "dtype"),
    [
        *itertools.product(("bsq", "bil", "bip"), (0, 1), ("i2",)),
        *(("bil", 1, dtype) for dtype in ("u1", "i4", "f4", "f8", "u2", "u4", "i8", "u8")),
    ],
)
def test_envi_of_every_interleave_order_and_type(interleave, order, dtype):
    values = np.round(IMAGE * 100) / 100 if dtype == "u1" else IMAGE
    path = envi(values, interleave=interleave, dtype=dtype, order=order)
    agree(open_cube(path), values)
    agree(open_cube(path.with_suffix(".img")), values)
    pixels = read_spectra(path).reflectance.reshape(values.shape)
    assert_allclose(pixels, values, rtol=0, atol=1e-6)
    theirs: Any = spy.open(str(path))
    read = np.asarray(theirs.load(scale=True))
    assert_allclose(open_cube(path), read, rtol=0, atol=1e-6)


def test_envi_as_a_table_of_its_pixels():
    fields = {
        "bbl": [1, 0, 1, 1, 1, 1, 1],
        "data ignore value": 5,
        "wavelength units": "Micrometers",
    }
    micrometres = np.array(WAVELENGTHS[::-1]) / 1000
    path = envi(wavelengths=micrometres, **fields)
    table, new = read_spectra(path), open_cube(path)
    assert_allclose(new["wavelength"], table.wavelengths)
    pixels = new.values.reshape(-1, table.wavelengths.size)
    full = np.isfinite(pixels).all(axis=1)
    assert_allclose(pixels[full], table.reflectance, atol=1e-6)
    assert table.notes[: len(new.attrs["notes"])] == new.attrs["notes"]
    for words in ("micrometres", "marks as bad", "sorted"):
        assert words in str(new.attrs["notes"])


def test_data_after_a_header_of_their_own():
    path = envi(interleave="bil", dtype="i2")
    data = path.with_suffix(".img")
    data.write_bytes(b"x" * 77 + data.read_bytes())
    path.write_text(path.read_text().replace("header offset = 0", "header offset = 77"))
    agree(open_cube(path), IMAGE)


@pytest.mark.parametrize("dtype", ["u2", "f4"])
def test_missing_data_are_nan(dtype):
    values = image()
    values[2, 3] = values[4, 5, 1] = 9 / 10_000 if dtype == "u2" else 0.25
    cube = open_cube(
        envi(values, dtype=dtype, **{"data ignore value": 9 if dtype == "u2" else 0.25})
    ).values
    assert np.isnan(cube[2, 3]).all()
    assert np.isnan(cube[4, 5, 1])
    assert np.isfinite(cube[4, 5, 2])


@pytest.mark.parametrize("dtype", ["i2", "f4"])
def test_a_mark_that_is_not_declared_is_missing_and_said(dtype):
    values = image()
    clean = envi(values, dtype=dtype, name="clean")
    mark = -9999.0 if dtype == "f4" else -0.9999
    values[:3, :4] = mark
    path = envi(values, dtype=dtype)
    cube = open_cube(path)
    assert np.isnan(cube.values[:3, :4]).all()
    assert np.isfinite(cube.values[3:]).all()
    table = read_spectra(path)
    assert len(table) == LINES * SAMPLES - 12
    for notes in (cube.attrs["notes"], table.notes):
        assert "-9999, which no reading is" in str(notes)
    assert "-9999" not in str(open_cube(clean).attrs["notes"])


def test_a_mark_in_a_corner_alone_is_said(monkeypatch):
    monkeypatch.setattr(probe, "_TILE", 2)
    values = image()
    values[0, 0] = -9999.0
    cube = open_cube(envi(values, dtype="f4"))
    assert "-9999" in str(cube.attrs["notes"])


def test_percent_and_given_scales():
    assert open_cube(envi(IMAGE * 100, dtype="f4")).attrs["unit"] == "percent"
    assert_allclose(open_cube("image.hdr").values, IMAGE, atol=1e-6)
    envi(IMAGE * 5000, dtype="f4")
    with pytest.raises(ValueError, match=r"too much for .* percent .*; give the scale"):
        open_cube("image.hdr")
    assert_allclose(open_cube("image.hdr", scale=5000), IMAGE, atol=1e-6)


def test_a_given_scale_goes_before_the_files_own():
    cube = open_cube(envi(), scale=20_000)
    assert_allclose(cube, IMAGE / 2, atol=1e-6)
    assert "10000 is a reflectance of 1; 20000 was given" in str(cube.attrs["notes"])


@pytest.mark.parametrize(
    ("dtype", "top"), [("u1", 2.55), ("u2", 6.5535), ("i2", 3.2767), ("f4", None), ("i4", None)]
)
def test_saturated_is_the_types_largest_number(dtype, top):
    assert open_cube(envi(IMAGE * 0.9, dtype=dtype)).attrs.get("saturated") == (
        None if top is None else pytest.approx(top)
    )


def test_a_mark_of_missing_data_is_not_saturated():
    assert "saturated" not in open_cube(envi(**{"data ignore value": 65535})).attrs


def test_map_info_gives_coordinates():
    info = ["UTM", "1", "1", "500000", "4000000", "2", "3", "33", "North", "WGS-84", "units=Meters"]
    cube = open_cube(
        envi(
            **{"map info": info, "coordinate system string": ['PROJCS["x"', "y]"]},
        )
    )
    assert_allclose(cube["x"], 500_001 + 2 * np.arange(SAMPLES))
    assert_allclose(cube["y"], 3_999_998.5 - 3 * np.arange(LINES))
    assert cube["x"].attrs == {"units": "meters", "pixel_size": 2.0}
    assert cube["y"].attrs["pixel_size"] == 3.0
    assert cube.attrs["crs_wkt"] == 'PROJCS["x",y]'
    part = open_cube("image.hdr", window=(4, 12, 6, 20), binning=(2, 2, 1))
    assert_allclose(part["x"], 500_000 + 2 * (6 + 1 + 2 * np.arange(7)))
    assert part["x"].attrs["pixel_size"] == 4.0


def test_without_coordinates_pixels_are_counted():
    cube = open_cube(envi(), window=(4, 12, 6, 20))
    assert_allclose(cube["y"], np.arange(4, 12) + 0.5)
    assert cube["x"].attrs == {"units": "pixel", "pixel_size": 1.0}
    turned = ["Arbitrary", "1", "1", "0", "0", "0.1", "0.1", "units=Millimeters", "rotation=30"]
    cube = open_cube(envi(**{"map info": turned}))
    assert_allclose(cube["x"], (np.arange(SAMPLES) + 0.5) * 0.1)
    assert cube["x"].attrs == {"units": "millimeters", "pixel_size": 0.1}
    cube = open_cube(envi(**{"pixel size": ["0.2", "0.3", "units=Meters"]}))
    assert_allclose(cube["y"], (np.arange(LINES) + 0.5) * 0.3)
    for damaged in (["UTM", "x"], ["UTM"], ["UTM", "1", "1", "0", "0", "0", "0"]):
        cube = open_cube(envi(**{"map info": damaged}))
        assert_allclose(cube["y"], np.arange(LINES) + 0.5)


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("dims", list(itertools.permutations(("y", "x", "wavelength"))))
def test_zarr_of_both_versions_in_any_order(version, dims):
    values = image()
    values[3, 4] = np.nan
    dataset = labelled(values).transpose(*dims)
    cube = open_cube(zarr(dataset, version=version, encoding=PACKED))
    agree(cube, values)
    agree(open_cube(zarr(dataset, version=version, name="plain.zarr")), values)
    assert_allclose(cube["x"], np.arange(SAMPLES) * 0.5 + 7)
    assert cube["y"].attrs == {"units": "mm", "pixel_size": 0.5}


@pytest.mark.parametrize("version", [2, 3])
def test_zarr_that_is_an_array(version):
    values = image()
    values[1, 1] = 0
    store = zarr_package.create_array(
        "a.zarr", shape=values.shape, dtype="u2", chunks=(7, 9, 7), zarr_format=version
    )
    store[...] = np.round(values * 10_000)
    cube = open_cube("a.zarr", wavelengths=WAVELENGTHS, scale=10_000)
    agree(cube, values)  # the fill value of a plain array, 0, is no mark of missing data
    assert cube.encoding["preferred_chunks"] == {"y": 7, "x": 9, "wavelength": 7}


def test_zeros_of_xarrays_integers_are_data():
    values = np.round(IMAGE * 100).astype("u1")
    values[1, 1] = 0
    for version in (2, 3):
        path = zarr(labelled(values, units="percent"), version=version, name=f"{version}.zarr")
        agree(open_cube(path), values / 100)


@pytest.mark.parametrize("engine", ["h5netcdf", "scipy"])
def test_netcdf_with_packed_numbers(engine):
    values = image()
    values[3, 4] = np.nan
    packing = {"dtype": "i2", "scale_factor": 1 / 30_000, "add_offset": 0.01, "_FillValue": -1}
    labelled(values).to_netcdf("a.nc", engine=engine, encoding={"reflectance": packing})
    agree(open_cube("a.nc"), values, atol=2e-5)


def test_netcdf_without_coordinates():
    labelled(IMAGE).drop_vars(["y", "x"]).to_netcdf("a.nc", engine="h5netcdf")
    cube = open_cube("a.nc")
    agree(cube, IMAGE)
    assert_allclose(cube["y"], np.arange(LINES) + 0.5)


def test_hdf5_in_groups_with_its_own_scale():
    values = image()
    path = hdf5(np.round(values * 10_000), dtype="i2", chunks=(8, 8, 7))
    with h5py.File(path, "a") as file:
        data: Any = file["SITE/Reflectance/Reflectance_Data"]
        data[2, 3] = -9999
        data.attrs["Scale_Factor"], data.attrs["Data_Ignore_Value"] = 10_000.0, -9999.0
        file.create_dataset("SITE/Reflectance/Metadata/angles", data=np.zeros((LINES, SAMPLES, 2)))
    values[2, 3] = np.nan
    agree(open_cube(path), values)
    agree(open_cube(path, dataset="Reflectance_Data"), values)
    agree(open_cube(path, dataset="/SITE/Reflectance/Reflectance_Data"), values)


def test_bands_that_a_file_marks_as_bad():
    path = hdf5()
    with h5py.File(path, "a") as file:
        file.create_dataset("SITE/bbl", data=[1, 1, 0, 1, 1, 1, 1])
    assert open_cube(path)["wavelength"].values.tolist() == [400, 410, 430, 450, 470, 500]


def test_pages_of_tiff_that_are_not_packed():
    agree(open_cube(tiff(pages=True)), IMAGE)


def test_tiff_with_all_bands_in_each_pixel():
    tifffile.imwrite("a.tif", IMAGE.astype("f4"), planarconfig="contig", photometric="minisblack")
    agree(open_cube("a.tif", wavelengths=WAVELENGTHS), IMAGE)


@pytest.mark.parametrize(
    "form", ["band_{:g}nm.tif", "{:g} nm exposure 12.TIF", "2024-05-03_{:g}.tiff"]
)
def test_folder_of_tiffs_named_by_wavelength(form):
    agree(open_cube(tiffs(form=form)), IMAGE)


def test_folder_of_tiffs_with_given_wavelengths():
    path = tiffs(form="f{:04.0f}.tif", compression="zlib")
    Path("nm.txt").write_text("# filters\n" + "\n".join(str(w + 5) for w in WAVELENGTHS))
    cube = open_cube(path, wavelengths="nm.txt")
    assert_allclose(cube["wavelength"], np.array(WAVELENGTHS) + 5)
    assert_allclose(cube, IMAGE, atol=1e-6)


def test_packed_tiffs_are_closed_with_their_cube():
    cube = open_cube(tiffs(form="{:g}nm.tif", compression="zlib"))
    cube.isel(y=0).load()
    del cube
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        gc.collect()
    assert not [one for one in said if ".tif" in str(one.message)]


def test_pictures_are_counted_as_people_count(here):
    for band in range(12):
        tifffile.imwrite(f"b{band}.tif", np.full((2, 3), band / 20, "f4"))
    cube = open_cube(here, wavelengths=np.arange(400.0, 520.0, 10.0))
    assert_allclose(cube.values[0, 0], np.arange(12) / 20)


def test_geotiff():
    tags = [
        (33550, "d", 3, (2.0, 3.0, 0.0), True),
        (33922, "d", 6, (0, 0, 0, 5000.0, 900.0, 0), True),
        (42113, "s", 0, "-1", True),
    ]
    values = image()
    values[0, 0] = -1
    cube = open_cube(tiff(values, extratags=tags))
    assert_allclose(cube["x"], 5001 + 2 * np.arange(SAMPLES))
    assert_allclose(cube["y"], 898.5 - 3 * np.arange(LINES))
    assert np.isnan(cube.values[0, 0]).all()


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_npy_with_the_wavelength_on_any_axis(axis):
    np.save("a.npy", np.moveaxis(IMAGE, 2, axis))
    agree(open_cube("a.npy", wavelengths=WAVELENGTHS), IMAGE)


def test_repeated_and_unsorted_wavelengths():
    path = envi(wavelengths=(500, 400, 410, 410, 450, 430, 470))
    cube = open_cube(path)
    assert cube["wavelength"].values.tolist() == [400, 410, 430, 450, 470, 500]
    assert_allclose(cube, IMAGE[..., [1, 2, 5, 4, 6, 0]], atol=1e-6)
    assert "1 bands repeat a wavelength (410 nm) and are left out" in cube.attrs["notes"]


def test_limits_of_wavelength():
    cube = open_cube(envi(), bands=(410, 450))
    assert cube["wavelength"].values.tolist() == [410, 420, 430, 450]
    assert_allclose(cube, IMAGE[..., 1:5], atol=1e-6)
