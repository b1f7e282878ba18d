"""A map as NetCDF and as ENVI: what other programs read is what the map holds."""

import json
import os
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from glazefit import set_labels
from glazefit.mapping.store.chunk import ChunkMaps
from glazefit.mapping.store.export import check_export, export_map
from glazefit.mapping.store.layout import VARIABLES, Status
from glazefit.mapping.store.store import MapStore, open_map

from ..refusals import refusal
from .toy import CHUNK, PAINTS, SHAPE, WINDOWS, Said, Toy, full, run_chunks, store_at

xarray = pytest.importorskip("xarray")

COORDS = {
    "y": (50.0 - 0.5 * np.arange(SHAPE[0]) - 0.25, {"units": "metre", "pixel_size": 0.5}),
    "x": (10.0 + 0.25 * np.arange(SHAPE[1]) + 0.125, {"units": "metre", "pixel_size": 0.25}),
}
PLACE = "UTM, 3, 4, 1, 2, 0.1, 0.1, 31, North, WGS-84, units=Meters, rotation=0.00"


class Sparse(Toy):
    """With pixels that were not mapped, and sets that a map can have."""

    def solve(self, window) -> ChunkMaps:
        maps = super().solve(window)
        random = np.random.default_rng(list(window))
        maps.arrays["status"] = random.choice([1, 1, 1, 2, 5], window.shape).astype(np.uint8)
        members = np.array(
            [[-1, -1, -1], [0, -1, -1], [1, 2, -1], [0, 1, 2], [0, 1, -1], [2, -1, -1]], np.int16
        )
        maps.arrays["members"] = members[random.integers(0, len(members), window.shape)]
        return maps


@pytest.fixture(scope="module")
def store(tmp_path_factory) -> MapStore:
    path = tmp_path_factory.mktemp("export") / "map.zarr"
    attrs = {
        "title": "a {panel}, Ghent",
        "map_info": PLACE,
        "crs_wkt": 'PROJCS["UTM"]',
        "nothing": None,
        "working_wavelengths": [400.0, 500.0],
        "notes": ["one", "two"],
        "mixed": [1, "a"],
    }
    store = store_at(path, attrs=attrs, coords=COORDS)
    run_chunks(store, Sparse())
    # One window is left as by a run that is killed before its status is written.
    (store.path / "status" / "c" / "1" / "0").unlink()
    return store


def test_netcdf_holds_all_that_the_map_holds(store, here):
    (path,) = export_map(store.path, "map.nc")
    ours = open_map(store.path)
    with xarray.open_dataset(path, engine="h5netcdf", mask_and_scale=False) as theirs:
        for variable in VARIABLES:
            assert_array_equal(theirs[variable.name].values, ours[variable.name].values)
            assert theirs[variable.name].dtype == variable.dtype
            assert theirs[variable.name].encoding["chunksizes"][:2] == CHUNK
        assert theirs.paint.values.tolist() == list(PAINTS)
        assert_array_equal(theirs.y.values, COORDS["y"][0])
        assert theirs.x.attrs["pixel_size"] == 0.25
        assert theirs.thickness.attrs["units"] == "m"
        assert theirs.attrs["working_wavelengths"].tolist() == [400.0, 500.0]
        assert json.loads(theirs.attrs["options"]) == store.options
        assert list(theirs.attrs["notes"]) == ["one", "two"]
        assert json.loads(theirs.attrs["mixed"]) == [1, "a"]
    with xarray.open_dataset(path, engine="h5netcdf") as theirs:
        assert theirs.status.dtype == np.uint8
        assert theirs.members.dtype == np.int16


def test_a_set_has_the_names_of_its_paints_before_and_after_export(store, here):
    ours = open_map(store.path)
    names = set_labels(ours)
    assert names.dims == ("y", "x")
    for members, words in (
        ([-1, -1, -1], ""),
        ([0, -1, -1], "ZincWhite"),
        ([1, 2, -1], "Eosin + Umber"),
        ([0, 1, 2], "ZincWhite + Eosin + Umber"),
        ([0, 1, -1], "ZincWhite + Eosin"),
        ([2, -1, -1], "Umber"),
    ):
        there = (ours.members.values == members).all(axis=-1)
        assert there.any()
        assert set(names.values[there]) == {words}
    (path,) = export_map(store.path, "map.nc")
    for options in ({}, {"mask_and_scale": False}, {"chunks": {"y": 16}}):
        with xarray.open_dataset(path, engine="h5netcdf", **options) as theirs:
            assert_array_equal(set_labels(theirs).values, names.values)
    # One pixel; and another order of the same paints.
    pixel = ours.isel(y=3, x=5).load()
    pixel["members"].values[:] = [2, -1, 0]
    assert set_labels(pixel).item() == "ZincWhite + Umber"
    with refusal("it has no members and no paint; open one by open_map"):
        set_labels(xarray.Dataset())


def test_numbers_that_stand_for_words_have_a_legend(store):
    told = open_map(store.path).members.attrs
    legend = dict(zip(told["flag_values"], told["flag_meanings"].split(), strict=True))
    assert legend == {-1: "none", 0: "ZincWhite", 1: "Eosin", 2: "Umber"}
    for name in ("status", "way", "condition"):
        told = open_map(store.path)[name].attrs
        assert len(told["flag_values"]) == len(told["flag_meanings"].split())


def planes(store: MapStore) -> dict[str, np.ndarray]:
    """Bands that are expected, by name."""
    ours = open_map(store.path).load()

    def of(paint: int, name: str) -> np.ndarray:
        return np.where(ours.members.values == paint, ours[name].values, 0.0).sum(axis=-1)

    wanted = {
        "probability of Eosin": ours.paint_probability.values[..., 1],
        "fraction of Eosin": of(1, "fraction"),
        "thickness (um)": ours.thickness.values * 1e6,
        "fraction standard deviation of Umber": of(2, "fraction_sd"),
    }
    status = ours.status.values
    mapped = {name: np.where(status == Status.MAPPED, a, np.nan) for name, a in wanted.items()}
    return mapped | {"status": status.astype(float)}


def test_envi_reads_back_in_another_program(store, here):
    spectral = pytest.importorskip("spectral")
    header, data = export_map(store.path, "map.hdr")
    assert (header.name, data.name) == ("map.hdr", "map.img")
    image = spectral.envi.open(header, data)
    names = image.metadata["band names"]
    assert image.shape == (*SHAPE, len(names))
    assert len(names) == 10 + 3 * len(PAINTS)
    for name, wanted in planes(store).items():
        assert_allclose(image.read_band(names.index(name)), wanted, rtol=1e-6, equal_nan=True)
    assert np.isnan(float(image.metadata["data ignore value"]))
    info = image.metadata["map info"]
    assert info[0] == "UTM"
    assert [float(value) for value in info[1:7]] == [1.0, 1.0, 10.0, 50.0, 0.25, 0.5]
    assert info[7:] == ["31", "North", "WGS-84", "units=Meters", "rotation=0.00"]
    assert image.metadata["coordinate system string"] == ['PROJCS["UTM"]']


def test_a_turned_image_and_bare_pixels_keep_what_is_sure(here):
    for info, coords, expected in (
        (PLACE.replace("0.00", "30"), COORDS, "pixel size = { 0.25, 0.5, units=metre }"),
        (PLACE, {}, None),
    ):
        path = f"{len(coords)}.zarr"
        store = store_at(
            path,
            shape=(2, 2),
            chunk=(2, 2),
            attrs={"map_info": info},
            coords={name: (v[:2], a) for name, (v, a) in coords.items()},
        )
        header, _ = export_map(store.path, f"{len(coords)}.img")
        text = header.read_text()
        assert "map info" not in text
        assert expected is None or expected in text.splitlines()


def test_files_are_checked_before(store, here):
    for name in ("map.tif", "map"):
        with refusal(r"--export .*NetCDF \(.nc\) or ENVI"):
            check_export(name, argument="--export")
    Path("map.img").touch()
    with refusal(r"map\.img exists", FileExistsError):
        export_map(store.path, "map.hdr")
    with pytest.raises(FileNotFoundError):
        export_map(store.path, "none/map.nc")
    export_map(store.path, "map.hdr", overwrite=True)
    assert sorted(os.listdir()) == ["map.hdr", "map.img"]


@pytest.mark.parametrize("name", ["map.nc", "map.hdr", "map.bsq"])
def test_a_full_disk_leaves_no_half_file(store, here, monkeypatch, name):
    monkeypatch.setattr("glazefit.mapping.store.export._bands", full)
    monkeypatch.setattr("xarray.Dataset.to_netcdf", full)
    with refusal("the disk is full; the map itself is kept", OSError):
        export_map(store.path, name)
    assert not os.listdir()


def test_progress_is_told(store, here):
    told = Said()
    export_map(store.path, "map.bsq", progress=told)
    assert told == [(number + 1, WINDOWS, "writing the bands") for number in range(WINDOWS)]
    assert sorted(os.listdir()) == ["map.bsq", "map.hdr"]
