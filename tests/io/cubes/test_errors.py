"""What is wrong with a file or an option is one sentence that names it."""

from functools import partial
from pathlib import Path

import h5py
import numpy as np
import pytest
import tifffile
import xarray as xr
import zarr as zarr_package
from numpy.testing import assert_allclose

from glazejax.io import CubeSource, open_cube, write_table
from tests.io import samples

from ...refusals import refusal
from .images import (
    BANDS,
    IMAGE,
    KINDS,
    LINES,
    SAMPLES,
    WAVELENGTHS,
    envi,
    hdf5,
    labelled,
    tiff,
    tiffs,
    zarr,
)

pytestmark = pytest.mark.usefixtures("here")
refused = partial(samples.refused, read=open_cube)


def test_header_that_promises_more_than_there_is():
    path = envi()
    data = path.with_suffix(".img")
    data.write_bytes(data.read_bytes()[:-1])
    refused(path, "promises .* the file was cut short")
    refused(data, "promises .* the file was cut short")
    data.unlink()
    refused(path, "no data next to this ENVI header", error=FileNotFoundError)


@pytest.mark.parametrize(
    ("wavelengths", "complaint"),
    [
        (None, "no wavelengths for 7 bands; give them"),
        ([1, 2, 3, 4, 5, 6, 7], "look like band numbers"),
        ([400, 410, 420, 430, 450, 470, -3], "finite and positive"),
    ],
)
def test_wavelengths_that_are_none(wavelengths, complaint):
    refused(envi(wavelengths=wavelengths), complaint)


def test_given_wavelengths():
    path = envi(wavelengths=None)
    assert_allclose(open_cube(path, wavelengths=WAVELENGTHS), IMAGE, atol=1e-6)
    micrometres = np.array(WAVELENGTHS) / 1000
    assert_allclose(open_cube(path, wavelengths=micrometres)["wavelength"], WAVELENGTHS)
    envi(wavelengths=range(1, 8))
    assert_allclose(open_cube(path, wavelengths=WAVELENGTHS), IMAGE, atol=1e-6)
    refused(path, "6 wavelengths were given for 7 bands", wavelengths=WAVELENGTHS[:-1])
    Path("image.txt").write_text("400 410 x")
    refused("image.txt", "not an image of spectra")
    with refusal(r"image\.txt: not a list of numbers"):
        open_cube(path, wavelengths="image.txt")
    with refusal("finite numbers: there are none"):
        open_cube(path, wavelengths=[])
    with pytest.raises(FileNotFoundError):
        open_cube(path, wavelengths="none.txt")


def test_windows_bins_and_limits_that_do_not_fit():
    path = envi()
    for window in (
        (0, LINES + 1, 0, 3),
        (5, 5, 0, 3),
        (0, 3, 9, 4),
        (-1, 3, 0, 3),
        (0, 3, 0, SAMPLES + 1),
    ):
        refused(
            path, f"does not lie in the image of {LINES} lines x {SAMPLES} samples", window=window
        )
    refused(path, f"bins of 24 lines are larger than the {LINES} lines", binning=(24, 1, 1))
    refused(
        path,
        "bins of 5 samples are larger than the 4 samples",
        window=(0, 9, 3, 7),
        binning=(1, 5, 1),
    )
    refused(path, "bins of 8 bands are larger than the 7 bands", binning=(1, 1, 8))
    refused(path, "no band lies from 1000 to 1700 nm; the image has 400-500 nm", bands=(1000, 1700))
    for binning in ((0, 1, 1), (1, 1, -2)):
        with refusal("must be three whole numbers"):
            CubeSource(path, binning=binning).open()
    for scale in (0.0, -1.0, np.inf, np.nan):
        with refusal(r"scale is .*; it must be positive"):
            open_cube(path, scale=scale)


def test_datasets_that_are_not_there():
    path = hdf5()
    refused(
        path,
        "no dataset 'cube' with three axes of numbers; there are SITE/Reflectance/Refl",
        dataset="cube",
    )
    with h5py.File(path, "a") as file:
        for group in "ab":
            file.create_dataset(f"{group}/raw", data=IMAGE)
    assert open_cube(path)["wavelength"].size == BANDS  # one is called reflectance
    refused(
        path, "'raw' is the name of 2 arrays: say which with its groups: .*a/raw", dataset="raw"
    )
    with h5py.File(path, "a") as file:
        file.move("SITE/Reflectance/Reflectance_Data", "SITE/Reflectance/data")
    refused(path, r"3 arrays can be meant, choose a dataset: .*SITE/Reflectance/data \(23, 31, 7\)")
    assert_allclose(open_cube(path, dataset="b/raw"), IMAGE, atol=1e-6)
    refused(envi(), "has no datasets; leave 'x' out", dataset="x")


def test_files_without_an_image():
    xr.Dataset({"a": ("x", [1.0, 2.0])}).to_netcdf("flat.nc", engine="h5netcdf")
    refused("flat.nc", "no array has three axes of numbers")
    refused(
        "flat.nc",
        "no dataset 'a' with three axes of numbers; there is none",
        dataset="a",
    )
    zarr_package.open_group("empty.zarr", mode="w")
    refused("empty.zarr", "no array has three axes of numbers")
    Path("nothing").mkdir()
    refused("nothing", "a folder without an image")
    refused("nothing", "no datasets", dataset="a")
    refused("gone.hdr", "gone.hdr", error=FileNotFoundError)
    write_table("table.csv", ["name", "400"], [["a", 0.5]])
    refused("table.csv", "not an image of spectra that is known: ENVI, zarr")
    np.save("flat.npy", np.ones((4, 5)))
    refused("flat.npy", "not an image of y, x, wavelength")
    np.save("complex.npy", np.ones((4, 5, 6), complex))
    refused("complex.npy", "type complex128")
    tifffile.imwrite("one.tif", np.ones((9, 9), "u1"))
    refused("one.tif", "not an image of several bands")
    with tifffile.TiffWriter("two.tif") as writer:
        writer.write(np.ones((9, 9), "u1"))
        writer.write(np.ones((9, 8), "u1"))
    refused("two.tif", "not an image of several bands of one size and type: 2 pages")


@pytest.mark.parametrize(
    "kind", ["npy", "netcdf", "classic", "hdf5", "tiff", "packed tiff", "pages"]
)
def test_files_cut_short(files, kind):
    path = files[kind]["path"]
    content = path.read_bytes()
    for length in (20, len(content) // 3, len(content) // 2):
        path.write_bytes(content[:length])
        with pytest.raises((ValueError, OSError)) as caught:
            open_cube(**files[kind]).load()
        assert path.name in str(caught.value)
        assert "\n" not in str(caught.value)
    path.write_bytes(content)


@pytest.mark.parametrize("kind", KINDS)
def test_damaged_files_are_read_or_refused_in_one_line(files, kind):
    path = files[kind]["path"]
    rng = np.random.default_rng(0)
    for _ in range(12):
        file = (
            path
            if path.is_file()
            else rng.choice(sorted(f for f in path.rglob("*") if f.is_file()))
        )
        content = file.read_bytes()
        damaged = np.frombuffer(content, "u1").copy()
        damaged[rng.integers(0, min(damaged.size, 600), 3)] = rng.integers(0, 256, 3)
        file.write_bytes(damaged.tobytes())
        try:
            open_cube(**files[kind]).load()
        except (ValueError, OSError) as error:
            message = str(error)
            assert "\n" not in message
            assert path.stem in message or file.stem in message
        file.write_bytes(content)


def test_folders_of_tiffs_that_do_not_belong_together():
    path = tiffs(form="f{:g}.tif")
    tifffile.imwrite(path / "f480.tif", np.ones((LINES, SAMPLES), "u1"))
    refused(path, "uint8 where f400.tif has")
    (path / "f480.tif").write_bytes(b"no")
    refused(path, "f480.tif: cannot be read; is the file whole?")


def test_folder_of_tiffs_without_wavelengths():
    path = Path("bands")
    path.mkdir()
    for name in "abc":
        tifffile.imwrite(path / f"{name}.tif", np.full((9, 9), 0.5, "f4"))
    refused(path, "no wavelengths for 3 bands")
    assert open_cube(path, wavelengths=[500, 400, 600])["wavelength"].values.tolist() == [
        400,
        500,
        600,
    ]


def test_image_without_any_data():
    path = zarr(labelled(np.full((9, 9, BANDS), np.nan, "f4")))
    refused(path, "no pixel that was looked at has data: give the scale")
    assert np.isnan(open_cube(path, scale=1).values).all()


def test_wavelengths_of_another_number_of_pages_are_not_used():
    refused(tiff(IMAGE[..., :3], name="three.tif"), "no wavelengths for 3 bands")
