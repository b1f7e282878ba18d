"""Windows, bins and limits are what NumPy makes of the whole image; little is read, by many threads
and processes.
"""

import pickle
import tracemalloc
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from glazejax.io import CubeSource, open_cube

from .images import (
    BANDS,
    KINDS,
    LINES,
    SAMPLES,
    WAVELENGTHS,
    binned,
    every,
    holes,
    image,
    labelled,
    tiff,
    zarr,
)


def gappy():
    """An image of which some readings, a pixel, and a line are missing."""
    values = image(3)
    values[np.random.default_rng(4).random(values.shape) < 0.1] = np.nan
    values[6, 7] = np.nan
    values[11] = np.nan
    return values


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    return every(tmp_path_factory.mktemp("files"), gappy())


def spans(size):
    """A first and an end; half of them wide, so that bins and steps have something to go over."""
    wide = st.tuples(st.integers(0, size // 4), st.integers(3 * size // 4, size))
    return wide | st.tuples(st.integers(0, size - 1), st.integers(1, size)).filter(
        lambda pair: pair[0] < pair[1]
    )


def parts(size):
    """Slices with steps both ways, whole numbers and lists."""
    steps = st.sampled_from([-3, -2, -1, 2, 3, 4]).map(lambda step: slice(None, None, step))
    lists = st.lists(st.integers(-size, size - 1), max_size=6)
    return steps | st.slices(size) | st.integers(-size, size - 1) | lists


@settings(max_examples=30)
@given(data=st.data(), kind=st.sampled_from(KINDS))
def test_windows_bins_and_slices_are_those_of_numpy(files, data, kind):
    (y0, y1), (x0, x1) = data.draw(spans(LINES), "y"), data.draw(spans(SAMPLES), "x")
    each = (
        data.draw(st.integers(1, min(5, y1 - y0))),
        data.draw(st.integers(1, min(5, x1 - x0))),
        data.draw(st.integers(1, 4)),
    )
    cube = open_cube(**files[kind], window=(y0, y1, x0, x1), binning=each)
    expected = binned(gappy()[y0:y1, x0:x1], each)
    assert cube.shape == expected.shape
    assert_allclose(cube, expected, rtol=0, atol=3e-7)
    key = tuple(data.draw(parts(n)) for n in expected.shape)
    part = cube.isel(dict(zip(cube.dims, key, strict=True)))
    for axis in (2, 1, 0):  # one axis at a time, as xarray does
        expected = expected[(slice(None),) * axis + (key[axis],)]
    assert_allclose(part, expected, rtol=0, atol=3e-7)
    if kind in ("envi", "npy", "hdf5", "tiff"):
        assert_allclose(cube["y"], y0 + (np.arange(cube.shape[0]) + 0.5) * each[0])
        assert_allclose(cube["x"], x0 + (np.arange(cube.shape[1]) + 0.5) * each[1])


def test_bins_of_wavelength_have_the_mean_wavelength(files):
    cube = open_cube(**files["envi"], binning=(1, 1, 3), bands=(400, 470))
    assert_allclose(cube["wavelength"], [410, 450])
    assert cube.attrs["binning"] == [1, 1, 3]


def test_what_does_not_fill_a_bin_is_said(files):
    notes = " | ".join(open_cube(**files["envi"], binning=(4, 4, 3)).attrs["notes"])
    for words in (
        f"{LINES % 4} lines at the end",
        f"{SAMPLES % 4} samples at the end",
        f"{BANDS % 3} bands at the red end",
    ):
        assert words in notes


@settings(max_examples=25)
@given(data=st.data(), kind=st.sampled_from(KINDS), each=st.sampled_from([1, 2]))
def test_scattered_points(files, data, kind, each):
    cube = open_cube(**files[kind], binning=(each, each, 1))
    expected = binned(gappy(), (each, each, 1))
    pairs = data.draw(
        st.lists(st.tuples(*(st.integers(-n, n - 1) for n in cube.shape)), min_size=0, max_size=9)
    )
    y, x, band = (
        xr.DataArray([pair[i] for pair in pairs], dims="point").astype(int) for i in range(3)
    )
    assert_allclose(cube.isel(y=y, x=x), expected[y.values, x.values], atol=3e-7)
    three = cube.isel(y=y, x=x, wavelength=band).values
    assert_allclose(three, expected[y.values, x.values, band.values], atol=3e-7)
    across = xr.DataArray(x.values, dims="other")
    two = cube.isel(y=y, x=across, wavelength=band).values
    assert_allclose(two, expected[y.values[:, None], x.values, band.values[:, None]], atol=3e-7)


@pytest.mark.parametrize("kind", KINDS)
def test_many_threads_read_the_same_cube(files, kind):
    cube, expected = open_cube(**files[kind]), gappy()

    def read(seed):
        rng = np.random.default_rng(seed)
        y, x = rng.integers(0, LINES - 3), rng.integers(0, SAMPLES - 3)
        found = cube.isel(y=slice(y, y + 3), x=slice(x, x + 3)).values
        return np.allclose(found, expected[y : y + 3, x : x + 3], atol=1e-6, equal_nan=True)

    with ThreadPoolExecutor(8) as pool:
        assert all(pool.map(read, range(200)))


@pytest.mark.parametrize("kind", KINDS)
def test_sources_and_cubes_can_be_sent(files, kind):
    source = CubeSource(**files[kind], window=(2, 20, 3, 30), binning=(2, 1, 2))
    expected = binned(gappy()[2:20, 3:30], (2, 1, 2))
    cube = source.open()
    cube.isel(y=0).load()
    sent = pickle.dumps((source, cube))
    assert len(sent) < 20_000
    again, open_again = pickle.loads(sent)
    assert again == source
    assert hash(again) == hash(source)
    assert_allclose(again.open().values, expected, atol=1e-6)
    assert_allclose(open_again, expected, atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("interleave", ["bsq", "bil", "bip"])
def test_a_window_of_a_large_image_takes_its_own_memory_only(here, interleave):
    path = holes(interleave, 8000, 2000, range(400, 1000, 3))  # 6 GB
    tracemalloc.start()
    cube = open_cube(path)
    opening = tracemalloc.get_traced_memory()[1]
    tracemalloc.reset_peak()
    values = cube.isel(y=slice(4000, 4256), x=slice(100, 356)).values
    reading = tracemalloc.get_traced_memory()[1]
    tracemalloc.reset_peak()
    coarse = open_cube(path, binning=(64, 64, 5)).isel(y=3, x=slice(2, 6)).values
    binning = tracemalloc.get_traced_memory()[1] - values.nbytes
    tracemalloc.stop()
    assert values.shape == (256, 256, 200)
    assert coarse.shape == (4, 40)
    assert opening < 20e6
    assert reading < values.nbytes + 16e6
    assert binning < 60e6


def counted(file, title):
    """A number that Linux counts of this process."""
    told = Path("/proc/self") / file
    if not told.exists():
        pytest.skip("the system does not count it")
    return int(told.read_text().split(title)[1].split()[0])


def mapped_now():
    """Bytes of mapped files that count as this process' memory."""
    return counted("status", "RssFile:") * 1024


@pytest.mark.parametrize("interleave", ["bsq", "bil", "bip"])
def test_a_mapped_file_does_not_pile_up_in_memory(here, interleave):
    cube = open_cube(holes(interleave, 900, 900, range(400, 1000, 6)))
    before, most = mapped_now(), 0
    for x in range(0, 900, 300):
        for y in range(0, 900, 300):
            cube.isel(y=slice(y, y + 300), x=slice(x, x + 300)).load()
            most = max(most, mapped_now() - before)
    assert most < 110e6  # of 162 MB


@pytest.mark.parametrize("kind", ["zarr", "netcdf", "tiff", "pages"])
def test_a_window_reads_its_own_chunks_only(here, kind):
    values = np.random.default_rng(0).random((256, 256, BANDS), np.float32)
    values[0, 0] = 0.5
    if kind == "zarr":
        path = zarr(labelled(values), encoding={"reflectance": {"chunks": (32, 32, BANDS)}})
    elif kind == "netcdf":
        path = Path("a.nc")
        chunks = {"chunksizes": (32, 32, BANDS), "zlib": True}
        labelled(values).to_netcdf(path, engine="h5netcdf", encoding={"reflectance": chunks})
    else:
        pieces: dict = {"tile": (32, 32)} if kind == "tiff" else {"rowsperstrip": 32}
        path = tiff(values, pages=True, compression="zlib", **pieces)
    cube = open_cube(path, scale=1)
    cube.isel(y=0, x=0).load()  # opens the file
    before = counted("io", "rchar: ")
    assert_array_equal(cube.isel(y=slice(64, 128), x=slice(32, 64)), values[64:128, 32:64])
    part = counted("io", "rchar: ") - before
    # Two chunks of 28 kB, or two strips of eight chunks' width; a little is the system's own.
    assert part < (8 if kind == "pages" else 1) * 2 * 32 * 32 * BANDS * 4 * 1.3 + 10_000
    assert part < 0.3 * values.nbytes


def test_pieces_that_a_file_stores_are_read_once(here, monkeypatch):
    """Strips of the reader end where chunks do."""
    values = image(lines=200, samples=400)
    path = Path("a.h5")
    with h5py.File(path, "w") as file:
        file.create_dataset("cube", data=values, chunks=(70, 400, BANDS))
    cube = open_cube(path, wavelengths=WAVELENGTHS, window=(30, 190, 0, 400))
    monkeypatch.setattr("glazejax.io.cubes.lazy._AT_ONCE", 1000)
    reading = cube.variable._data.array  # pyright: ignore
    strips = list(reading._strips(range(160), 400 * BANDS))
    assert [(part.start + 30, part.stop + 30) for part in strips] == [
        (30, 70),
        (70, 140),
        (140, 190),
    ]
    assert_allclose(cube, values[30:190], atol=1e-6)
    coarse = open_cube(path, wavelengths=WAVELENGTHS, window=(30, 190, 0, 400), binning=(3, 2, 1))
    assert_allclose(coarse, binned(values[30:190], (3, 2, 1)), atol=1e-6)


def test_nothing_is_read_before_it_is_asked_for(files, monkeypatch):
    from glazejax.io.raw_cube import RawCube

    cube = open_cube(**files["envi"])
    monkeypatch.setattr(RawCube, "block", None)
    part = cube.isel(y=slice(2, 9)).transpose("wavelength", "y", "x")
    assert part.shape == (BANDS, 7, SAMPLES)
    assert "values with dtype" in repr(cube)
