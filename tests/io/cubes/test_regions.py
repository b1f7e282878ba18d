"""Masks from pictures and polygons, spectra of spots, quick hashes."""

import json
import os
import shutil
from pathlib import Path

import h5py
import matplotlib.path
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from PIL import Image

from glazejax.io import open_cube, quick_source_hash, read_mask, read_spot
from glazejax.io.cubes.hashes import time_of_change
from glazejax.io.cubes.regions import inside

from ...refusals import refusal
from .images import BANDS, IMAGE, LINES, SAMPLES, bright_image, envi, image, labelled, zarr

SHAPE = (LINES, SAMPLES)
USED = np.random.default_rng(0).random(SHAPE) < 0.5
BOX = [[4, 3], [10, 3], [10, 8], [4, 8]]


def png(values):
    path = Path("mask.png")
    Image.fromarray(values).save(path)
    return path


@pytest.mark.parametrize(
    "kind", ["grey", "16 bit", "1 bit", "rgb", "rgba", "palette", "grey alpha"]
)
def test_pictures_of_all_kinds(here, kind):
    grey = Image.fromarray(np.where(USED, 7, 0).astype("u1"))
    made = {
        "grey": grey,
        "16 bit": Image.fromarray(np.where(USED, 256, 0).astype("u2")),
        "1 bit": Image.fromarray(USED),
        "rgb": Image.fromarray((USED[..., None] * [0, 1, 0]).astype("u1")),
        "rgba": Image.fromarray(np.where(USED[..., None], 255, [9, 9, 9, 0]).astype("u1")),
        "palette": grey.convert("P"),
        "grey alpha": grey.convert("LA"),
    }[kind]
    made.save("mask.png")
    assert_array_equal(read_mask("mask.png", SHAPE), USED)


def test_mask_of_another_size(here):
    path = png(np.ones((SAMPLES, LINES), "u1"))
    with refusal(f"has {SAMPLES} lines x {LINES} samples; the image has {LINES} lines"):
        read_mask(path, SHAPE)
    cube = open_cube(envi(), binning=(2, 3, 1))
    with refusal("opened as 11 x 10"):
        read_mask(path, cube)


def test_masks_are_windowed_and_binned_as_the_cube_is(here):
    cube = open_cube(envi(), window=(2, 21, 3, 30), binning=(2, 3, 1))
    expected = USED[2:20, 3:30].reshape(9, 2, 9, 3).mean((1, 3)) >= 0.5
    assert_array_equal(read_mask(png(USED), cube), expected)
    assert_array_equal(read_mask(png(expected), cube), expected)


@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize(
    "form", ["polygon", "feature", "collection", "multi", "list", "csv", "titled"]
)
def test_polygons_of_all_forms(here, form, closed):
    ring = [*BOX, BOX[0]] if closed else BOX
    polygon = {"type": "Polygon", "coordinates": [ring]}
    rows = "\n".join(f"{x}, {y}" for x, y in ring)
    made = {
        "polygon": json.dumps(polygon),
        "feature": json.dumps({"type": "Feature", "properties": {}, "geometry": polygon}),
        "collection": json.dumps(
            {"type": "FeatureCollection", "features": [{"type": "Feature", "geometry": polygon}]}
        ),
        "multi": json.dumps({"type": "MultiPolygon", "coordinates": [[ring]]}),
        "list": json.dumps(ring),
        "csv": rows,
        "titled": f"x,y\n{rows}\n",
    }[form]
    Path("shape.txt").write_text(made)
    expected = np.zeros(SHAPE, bool)
    expected[3:8, 4:10] = True
    assert_array_equal(read_mask("shape.txt", SHAPE), expected)


def test_holes_and_polygons_that_overlap(here):
    hole, other = [[5, 4], [7, 4], [7, 6], [5, 6]], [[8, 6], [12, 6], [12, 12], [8, 12]]
    Path("a.json").write_text(
        json.dumps({"type": "MultiPolygon", "coordinates": [[BOX, hole], [other]]})
    )
    expected = np.zeros(SHAPE, bool)
    expected[3:8, 4:10] = expected[6:12, 8:12] = True
    expected[4:6, 5:7] = False
    assert_array_equal(read_mask("a.json", SHAPE), expected)
    Path("b.csv").write_text(
        "\n\n".join("\n".join(f"{x};{y}" for x, y in ring) for ring in (BOX, other))
    )
    expected[4:6, 5:7] = True
    assert_array_equal(read_mask("b.csv", SHAPE), expected)


@given(
    st.lists(
        st.tuples(st.floats(-5, SAMPLES + 5), st.floats(-5, LINES + 5)), min_size=3, max_size=7
    )
)
def test_simple_polygons_as_matplotlib_has_them(points):
    ring = np.array(points) + 0.001
    centre = ring.mean(0)
    ring = ring[
        np.argsort(np.arctan2(*(ring - centre).T))
    ]  # a star about its centre crosses itself nowhere
    x, y = ring.T
    # A ring that runs back on itself encloses nothing, and which of its points are inside is
    # anybody's guess.
    assume(abs(np.sum(x * np.roll(y, 1) - y * np.roll(x, 1))) > 1e-6)
    y, x = np.mgrid[:LINES, :SAMPLES] + 0.5
    places = np.stack([x.ravel(), y.ravel()], 1)
    path = matplotlib.path.Path(ring)
    # Those that lie on an edge, as far as rounding goes, are anybody's guess too. (By matplotlib's
    # own `radius` a ring thinner than that has places that are certain and are not.)
    edge = np.roll(ring, -1, axis=0) - ring
    ahead = places[:, None] - ring
    length = np.maximum(np.sum(edge**2, axis=-1), 1e-300)
    share = np.clip(np.sum(ahead * edge, axis=-1) / length, 0.0, 1.0)
    certain = np.linalg.norm(ahead - share[..., None] * edge, axis=-1).min(axis=1) > 1e-3
    found = inside([ring], SHAPE).ravel()
    assert_array_equal(found[certain], path.contains_points(places)[certain])


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("1,2\n3,4\n", "needs three vertices; one has 2"),
        ("", "holds no polygon"),
        ("1,2\n3,4,5\n", "line 2: 3 numbers where a vertex has x,y"),
        ("x,y\n1,2\nno,9\n", "line 3: 'no,9' is not x,y"),
        ("{bad", "not GeoJSON"),
        ('{"type": "Point", "coordinates": [1, 2]}', "'Point' is neither Polygon nor MultiPolygon"),
        ('{"type": "Polygon", "coordinates": [[1, 2], [3, 4], [5, 6]]}', "list of x, y pairs"),
        ('{"type": "Polygon", "coordinates": [[["a", 2], [3, 4], [5, 6]]]}', "list of x, y pairs"),
        ("100,100\n110,100\n110,110", "uses no pixel"),
    ],
)
def test_polygons_that_are_none(here, text, complaint):
    Path("shape.json").write_text(text)
    with refusal(complaint) as caught:
        read_mask("shape.json", SHAPE)
    assert "shape.json" in str(caught.value)


def test_damaged_and_black_pictures(here):
    path = png(np.random.default_rng(0).integers(0, 255, SHAPE).astype("u1"))
    path.write_bytes(path.read_bytes()[:200])
    with refusal("not a whole picture"):
        read_mask(path, SHAPE)
    with refusal("uses no pixel"):
        read_mask(png(np.zeros(SHAPE, "u1")), SHAPE)


def test_spots(here):
    values = image()
    values[3, 4, 1] = np.nan
    cube = open_cube(envi(values, dtype="f4"))
    spot = read_spot(cube, "4,3")
    assert_allclose(spot.reflectance, values[3, 4], atol=1e-6)
    assert spot.pixels == 1
    assert np.isnan(spot.deviation).all()
    for place, pixels in (
        (" 2:9, 1:6 ", values[1:6, 2:9].reshape(-1, BANDS)),
        (png(USED), values[USED]),
    ):
        spot = read_spot(cube, place)
        assert_allclose(spot.reflectance, np.nanmean(pixels, 0), atol=1e-6)
        assert_allclose(spot.deviation, np.nanstd(pixels, 0, ddof=1), atol=1e-6)
        assert spot.pixels == len(pixels)
        assert_array_equal(spot.wavelengths, cube["wavelength"])


def test_spots_in_parts_and_near_one_value(here, monkeypatch):
    values = 0.7 + 1e-5 * IMAGE
    cube = open_cube(envi(values, dtype="f8"))
    monkeypatch.setattr("glazejax.io.cubes.regions._AT_ONCE", SAMPLES * BANDS)
    spot = read_spot(cube, f"0:{SAMPLES},0:{LINES}")
    part = values.astype("f4").reshape(-1, BANDS).astype(float)
    assert_allclose(spot.reflectance, part.mean(0), rtol=1e-12)
    assert_allclose(spot.deviation, part.std(0, ddof=1), rtol=1e-6)


def test_spots_leave_saturated_readings_out(here):
    spot = read_spot(open_cube(bright_image()), "6:8,5")
    assert_allclose(spot.reflectance[2], IMAGE[5, 7, 2], atol=1e-6)


def test_spots_elsewhere(here):
    values = image()
    values[3, 4] = np.nan
    cube = open_cube(envi(values, dtype="f4"))
    with refusal(f"x goes from 0 to {SAMPLES}, y from 0 to {LINES}"):
        read_spot(cube, f"{SAMPLES},2")
    with refusal("does not lie in the image"):
        read_spot(cube, "5:2,3")
    with refusal("has no data"):
        read_spot(cube, "4,3")
    with refusal("neither a place such as 120,45", FileNotFoundError):
        read_spot(cube, "here")


def test_hash_follows_header_data_and_nothing_else(here):
    path = envi()
    first = quick_source_hash(path)
    assert quick_source_hash(path.with_suffix(".img")) == first
    Path("other").mkdir()
    for file in (path, path.with_suffix(".img")):
        shutil.copy(file, "other")
    assert quick_source_hash("other/image.hdr") == first
    path.write_text(path.read_text() + "; a remark\n")
    second = quick_source_hash(path)
    raw = np.memmap(path.with_suffix(".img"), "u1", "r+")
    raw[-1] ^= 1
    raw.flush()
    assert len({first, second, quick_source_hash(path)}) == 3


def overwrite(path, place, content):
    with path.open("r+b") as file:
        file.seek(place)
        file.write(content)


def test_hash_of_a_large_file_and_of_a_folder(here):
    big = Path("big.npy")
    with big.open("wb") as file:
        file.truncate(10 << 30)
    hashes = {quick_source_hash(big)}
    # Both ends, and a hundredth of it far from them.
    for place, count in (((10 << 30) - 5, 1), (5, 1), (3 << 30, 100 << 20)):
        overwrite(big, place, b"x" * count)
        hashes.add(quick_source_hash(big))
    assert len(hashes) == 4
    path = zarr(labelled(IMAGE))
    first = quick_source_hash(path)
    assert quick_source_hash(path) == first
    metadata = path / "zarr.json"
    metadata.write_text(metadata.read_text() + " ")
    assert quick_source_hash(path) != first
    with pytest.raises(FileNotFoundError):
        quick_source_hash("none")


@pytest.mark.parametrize("size", [10, 1 << 20])
def test_hash_of_a_folder_follows_all_its_files(here, size):
    for number in range(9):
        Path(f"band{number}").write_bytes(bytes([number]) * size)
    first = quick_source_hash(here)
    for number in range(9):
        file = Path(f"band{number}")
        file.write_bytes(b"x" * size)
        assert quick_source_hash(here) != first
        file.write_bytes(bytes([number]) * size)
    assert quick_source_hash(here) == first


def test_hash_and_time_of_an_image_beside_the_header_of_another(here):
    header = envi()
    other = header.with_suffix(".nc")
    with h5py.File(other, "w") as file:
        file["cube"] = IMAGE
    alone = Path("alone", other.name)
    alone.parent.mkdir()
    shutil.copy(other, alone)
    assert quick_source_hash(other) == quick_source_hash(alone)
    os.utime(header, ns=(9, 2**61))
    assert time_of_change(other) == other.stat().st_mtime_ns
    assert time_of_change(header) == 2**61


def test_time_of_change_is_that_of_the_newest_file(here):
    header = envi()
    for file, time in ((header, 5_000), (header.with_suffix(".img"), 7_000)):
        os.utime(file, ns=(0, time))
    assert time_of_change(header) == time_of_change(header.with_suffix(".img")) == 7_000
    path = zarr(labelled(IMAGE))
    file = max(path.rglob("c/*"))
    os.utime(file, ns=(0, 2**61))
    assert time_of_change(path) == 2**61
    with pytest.raises(FileNotFoundError):
        time_of_change("none")
