"""The store of a map: what was written reads back, and what was not finished is not there."""

import errno
import json
import os
import random
import time
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray
from numpy.testing import assert_allclose, assert_array_equal, assert_equal

from glazefit import Prior
from glazefit.mapping.solve.answers import Answers
from glazefit.mapping.store.atomic_files import KeyedResults
from glazefit.mapping.store.chunk import ChunkMaps, pack
from glazefit.mapping.store.layout import VARIABLES, Status
from glazefit.mapping.store.store import MapStore, open_map
from glazefit.mapping.store.windows import chunk_shape, windows

from ..refusals import refusal
from ..slow import slow
from .toy import (
    BANDS,
    CHUNK,
    PAINTS,
    WINDOWS,
    Counted,
    Said,
    Toy,
    full,
    run_chunks,
    start_run,
    store_at,
)


def sums_of(store):
    """All of a map but its arrays."""
    return pack(store.sums())


def same(one, other):
    """Two maps are the same, bit for bit."""
    ours, theirs = open_map(one.path), open_map(other.path)
    for variable in VARIABLES:
        assert_array_equal(ours[variable.name].values, theirs[variable.name].values)
        assert ours[variable.name].dtype == variable.dtype
    assert_equal(sums_of(one), sums_of(other))


@pytest.mark.parametrize("shape", [(1, 1), (300, 300), (257, 4000), (3, 100_000)])
def test_windows_fit_the_memory_whatever_the_size(shape):
    for memory in (2**30, 2**31, 2**33):
        rows, columns = chunk_shape(shape, 200, 64, memory)
        assert 1 <= rows <= min(512, shape[0])
        assert 1 <= columns <= min(512, shape[1])
        assert 600 * 2**20 + rows * columns * 200 * 64 <= memory
        # No window is a thin strip beside large ones.
        assert (-shape[0]) % rows < shape[0] / 2 + 1
    with refusal(r"memory bound is 300 MiB; with 200 bands it must be at least \d+ MiB"):
        chunk_shape(shape, 200, 64, 300 * 2**20)


@pytest.mark.parametrize("shape", [(60, 80), (480, 640), (16, 400), (1000, 1000)])
def test_a_small_image_has_twenty_windows(shape):
    """So that a stop loses little."""
    assert len(windows(shape, chunk_shape(shape, 61, 64, 2**31))) >= (
        16 if shape[0] == 1000 else 20
    )


def test_what_is_written_reads_back(undisturbed):
    dataset = open_map(undisturbed.path)
    assert dict(dataset.sizes) == {"y": 38, "x": 50, "place": 3, "paint": 3, "rgb": 3}
    assert dataset.paint.values.tolist() == list(PAINTS)
    assert dataset.x.values[:2].tolist() == [0.5, 1.5]
    assert dataset.thickness.attrs["units"] == "m"
    assert dataset.status.attrs["flag_meanings"].split()[1] == "mapped"
    assert dataset.attrs["options"]["noise"] == 0.003
    for window in undisturbed.windows():
        maps = Toy().solve(window)
        for variable in VARIABLES:
            there = dataset[variable.name][window.slices].values
            assert_array_equal(there, maps.arrays.get(variable.name, variable.fill))


def test_others_open_the_store_without_a_word(undisturbed):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        dataset = xarray.open_zarr(undisturbed.path, chunks=None)
        ours = open_map(undisturbed.path)
    assert set(dataset.data_vars) == {variable.name for variable in VARIABLES}
    # Whatever order the disk has them in.
    assert list(ours.data_vars) == sorted(variable.name for variable in VARIABLES)


def test_sums_are_those_of_the_windows_in_order(undisturbed):
    sums = undisturbed.sums()
    expected, third = {}, 0.0
    for window in undisturbed.windows():
        maps = Toy().solve(window)
        third += maps.tallies["third"]
        for members, one in maps.sets.items():
            expected[members] = expected[members] + one if members in expected else one
    assert sums.tallies == {"mapped": 1900.0, "third": third}
    largest = dict(sorted(expected.items(), key=lambda one: (-one[1].pixels, one[0])))
    assert_equal(pack(ChunkMaps({}, sets=sums.sets)), pack(ChunkMaps({}, sets=largest)))


def test_a_thickness_is_as_sure_as_the_prior_holds_it():
    """Two films of which the readings show little: a map's prior is not always the usual one."""
    film = replace(
        Answers.empty(2, len(PAINTS), BANDS),
        members=np.tile([0, -1, -1], (2, 1)),
        amounts=np.tile([np.log(1e-5), -np.inf, -np.inf], (2, 1)),
        covariance=np.diag([0.05**2, 0.0, 0.0]) * np.ones((2, 1, 1)),
    )
    maps = film.columns(Prior(spread=0.05))
    relative = maps["thickness_sd"] / maps["thickness"]
    assert_allclose(relative, 0.05, rtol=1e-3)
    usual = film.columns(Prior())
    assert (usual["thickness_sd"] > 5.0 * maps["thickness_sd"]).all()


def test_a_run_goes_on_with_what_is_not_done(store, undisturbed):
    first, second = Counted(most=3), Counted(most=3)
    with pytest.raises(KeyboardInterrupt):
        run_chunks(store, first)
    assert store.done() == set(first.asked)
    said = Said()
    with pytest.raises(KeyboardInterrupt):
        run_chunks(store_at(store.path), second, progress=said)
    assert not set(first.asked) & set(second.asked)
    assert said == [(done, WINDOWS, "mapping") for done in range(3, 7)]
    run_chunks(store_at(store.path), Toy())
    same(store, undisturbed)


def test_a_map_of_which_nothing_can_be_made_is_in_nobodys_way(store, tmp_path):
    with pytest.raises(ValueError, match="no pixel"), store.writing():
        raise ValueError("no pixel")
    assert os.listdir(tmp_path) == []
    # What a run has kept stays.
    begun = store_at(store.path)
    begun.work.put("survey", {"noise": np.zeros(2)})
    with pytest.raises(ValueError, match="no paint"), begun.writing():
        raise ValueError("no paint")


def test_a_map_begun_with_other_options_is_kept(store, tmp_path):
    run_chunks(store, Toy())
    with refusal(r"other options \(noise: 0.003 there, 0.01 now\).*--overwrite"):
        store_at(store.path, options={"noise": 0.01, "layers": 1})
    with refusal(r"shape: \[38, 50\] there, \[38, 51\] now; paints: "):
        store_at(store.path, shape=(38, 51), paints=PAINTS[:2])
    assert len(store_at(store.path).done()) == len(store.windows())
    # The windows of a map that is there stay, whatever a new memory bound would make of them.
    assert store_at(store.path, chunk=(10, 10)).chunk == CHUNK
    options = {"noise": 0.01, "path": Path("a"), "t": (1,)}
    fresh = store_at(store.path, chunk=(10, 10), options=options, overwrite=True)
    assert not fresh.done()
    assert fresh.chunk == (10, 10)
    assert fresh.options["path"] == "a"
    assert os.listdir(tmp_path) == ["map.zarr"]


def test_what_is_no_map_is_never_replaced(tmp_path):
    (tmp_path / "photos").mkdir()
    (tmp_path / "photos" / "one.jpg").write_bytes(b"precious")
    for overwrite in (False, True):
        with refusal("is no map of glazejax", FileExistsError):
            store_at(tmp_path / "photos", overwrite=overwrite)
    with refusal("does not exist", FileNotFoundError):
        store_at(tmp_path / "none" / "map.zarr")
    with refusal("is no map of glazejax"):
        open_map(tmp_path / "photos")
    assert (tmp_path / "photos" / "one.jpg").read_bytes() == b"precious"
    (tmp_path / "empty").mkdir()
    assert store_at(tmp_path / "empty").done() == set()


def test_a_map_of_another_format_is_refused(store):
    meta = json.loads((store.path / "zarr.json").read_text())
    for former in (4, 99):
        meta["attributes"]["glazejax"]["format"] = former
        (store.path / "zarr.json").write_text(json.dumps(meta))
        for reads in (open_map, store_at):
            with refusal(rf"format {former}, .* make the map again"):
                reads(store.path)
    assert not store_at(store.path, overwrite=True).done()


@pytest.mark.parametrize("number", [errno.ENOSPC, slow(errno.EDQUOT)])
@pytest.mark.parametrize(
    "failing",
    [3, slow(70), slow(120), 130],
)
def test_a_full_disk_keeps_what_is_finished(store, monkeypatch, undisturbed, number, failing):
    """Every n-th file that is put in place fails, whether of an array or of the sums."""
    replace, count = Path.replace, 0

    def replaced(path, target):
        nonlocal count
        count += 1
        if count >= failing:
            raise OSError(number, os.strerror(number), str(path))
        return replace(path, target)

    with monkeypatch.context() as patch:
        patch.setattr(Path, "replace", replaced)
        with refusal("the disk is full", OSError) as found:
            run_chunks(store, Toy())
    assert found.value.errno == number
    assert f"{len(store.done())} of {WINDOWS} windows are finished and kept" in str(found.value)
    assert found.value.filename == str(store.path)
    # A file for each array, and one for the sums.
    assert len(store.done()) == (failing - 1) // (len(VARIABLES) + 1)
    assert not list(store.path.rglob("*.part*"))
    for window in store.done():
        assert_array_equal(
            open_map(store.path).rmse[window.slices], open_map(undisturbed.path).rmse[window.slices]
        )
    run_chunks(store_at(store.path), Toy())
    same(store, undisturbed)


def test_a_disk_that_is_full_at_once_leaves_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr(Path, "replace", full)
    with refusal("nothing of the map was begun", OSError):
        store_at(tmp_path / "map.zarr")
    assert not os.listdir(tmp_path)


def test_a_disk_that_is_full_in_the_survey_names_the_file_and_the_remedy(tmp_path, monkeypatch):
    results = KeyedResults(tmp_path / "work")
    results.put("survey", {"a": np.zeros(3)})

    monkeypatch.setattr(Path, "replace", full)
    with refusal("the disk is full; make room, then run the same", OSError) as found:
        results.put("search-0000", {"a": np.zeros(3)})
    assert found.value.filename == str(tmp_path / "work" / "search-0000.npz")
    assert os.listdir(results.folder) == ["survey.npz"]
    # Nor is a half of one counted that a killed run left.
    (results.folder / "search-0001.npz.part").write_bytes(b"half")
    assert KeyedResults(results.folder).done() == {"survey"}
    assert results.get("survey")["a"].tolist() == [0.0, 0.0, 0.0]


def test_attributes_can_be_added(tmp_path):
    store = store_at(tmp_path / "map.zarr", attrs={"title": "a panel"})
    run_chunks(store, Toy())
    store.note(agreement={"pixels": 2000, "same": np.float64(0.97)}, nothing=float("nan"))
    dataset = open_map(store.path)
    assert dataset.attrs["title"] == "a panel"
    assert dataset.attrs["agreement"] == {"pixels": 2000, "same": 0.97}
    assert len(MapStore(store.path).done()) == WINDOWS


def finished(path):
    """Windows that have a status."""
    return sum(place.name.isdigit() for place in path.glob("status/c/*/*"))


@pytest.mark.slow
def test_a_run_killed_at_random_moments_ends_as_an_undisturbed_one(tmp_path, undisturbed):
    path, chance = tmp_path / "map.zarr", random.Random(18)
    kept, kills = 0, 0
    while kept < WINDOWS:
        run = start_run(path, 0.002)
        # A window is mostly written, not solved: some time after a status the next one is being
        #     written.
        wanted = kept + chance.randint(0, 4)
        while finished(path) < wanted and run.poll() is None:
            time.sleep(0.002)
        time.sleep(chance.uniform(0.0, 0.05))
        with run:
            run.kill()
        killed = run.returncode != 0
        done = MapStore(path).done()
        assert len(done) >= max(kept, min(wanted, WINDOWS))
        for window in done:
            assert (open_map(path).status[window.slices] == Status.MAPPED).all()
        kept, kills = len(done), kills + killed
        assert kills < 40
    assert kills >= 3
    same(MapStore(path), undisturbed)
    run_chunks(store_at(path), Toy())
    assert not list(path.rglob("*.part*"))
