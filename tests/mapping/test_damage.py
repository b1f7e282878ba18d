"""A map that is not as it was written: what is damaged is named when it is read, and mapped again."""

import json
import os
import pickle
import shutil
from pathlib import Path

import numpy as np
import pytest
import xarray

from glazefit.mapping.store.export import export_map
from glazefit.mapping.store.layout import Status
from glazefit.mapping.store.store import DamagedWindow, MapStore, open_map
from glazefit.mapping.store.windows import Window

from ..refusals import refusal
from .test_store import same
from .toy import WINDOWS, Counted, Toy, run_chunks, store_at

# Of the second row and column of windows.
WINDOW = Window(16, 32, 20, 40)


@pytest.fixture
def path(undisturbed, tmp_path):
    """A whole map, to be damaged."""
    return shutil.copytree(undisturbed.path, tmp_path / "map.zarr")


def cut(file: Path) -> None:
    file.write_bytes(file.read_bytes()[:-20])


def flip(file: Path) -> None:
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 1
    file.write_bytes(content)


def empty(file: Path) -> None:
    file.write_bytes(b"")


def read_all(path: Path) -> None:
    dataset = open_map(path)
    for name in dataset.data_vars:
        _ = dataset[name].values


def check_again(path, whole, match: str, solver: Toy) -> int:
    """Assert that what is damaged is named and mapped again; how many windows that are."""
    with pytest.warns(DamagedWindow, match=match) as warned:
        run_chunks(store_at(path), solver)
    same(MapStore(path), whole)
    return len(warned)


@pytest.mark.parametrize(
    ("place", "damage", "words"),
    [
        ("misfit/c/1/1", cut, "misfit/c/1/1 is not as it was written"),
        ("status/c/1/1", flip, "status/c/1/1 is not as it was written"),
        ("paint_probability/c/1/1/0", Path.unlink, "paint_probability/c/1/1/0 is missing"),
        ("paint_probability/c/1/1/0", empty, "paint_probability/c/1/1/0 is not as it was written"),
    ],
)
def test_a_damaged_window_is_named_and_mapped_again(path, undisturbed, place, damage, words):
    damage(path / place)
    named = rf"^window y16-32_x20-40 of .*map\.zarr is damaged \({words}\)"
    with refusal(named + "; run the same `glazejax map` again, .*$"):
        read_all(path)
    # The others can be read.
    assert (open_map(path).status[:16].values == 1).all()
    solver = Counted()
    assert check_again(path, undisturbed, named + ", and is mapped again$", solver) == 1
    assert solver.asked == [WINDOW]


@pytest.mark.parametrize("damage", [cut, flip, empty, Path.unlink])
def test_a_window_whose_sums_are_damaged_is_mapped_again(path, undisturbed, damage):
    damage(path / ".glazejax" / "sums" / f"{WINDOW}.npz")
    words = rf"^window {WINDOW} of .*map\.zarr is damaged \(its sums cannot be read\)"
    with refusal(words):
        MapStore(path).sums()
    check_again(path, undisturbed, words + ", and is mapped again$", Toy())


def test_a_status_that_is_missing_in_a_complete_map_is_damage(path, undisturbed):
    """Elsewhere a window without status is one that is not finished."""
    (path / "status" / "c" / "1" / "1").unlink()
    dataset = open_map(path)
    assert (dataset.status[WINDOW.slices] == Status.UNDONE).all()
    assert np.isnan(dataset.paint_probability[WINDOW.slices].values).all()
    # A region that crosses it, too.
    assert np.unique(dataset.status[: WINDOW.y1].values).tolist() == [Status.UNDONE, Status.MAPPED]
    assert set(MapStore(path).windows()) - MapStore(path).done() == {WINDOW}
    MapStore(path).note(complete=True)
    with refusal(r"is damaged \(status/c/1/1 is missing\)"):
        read_all(path)
    check_again(path, undisturbed, "status/c/1/1 is missing", Toy())


def test_an_array_that_was_removed_is_made_again(path, tmp_path, undisturbed):
    shutil.rmtree(path / "thickness")
    with refusal(r"is damaged \(thickness/c/./. is missing"):
        read_all(path)
    assert check_again(path, undisturbed, "", Toy()) == WINDOWS
    assert os.listdir(tmp_path) == ["map.zarr"]


def test_a_map_with_a_damaged_window_is_not_complete(path):
    store = MapStore(path)
    store.note(complete=True)
    with store.writing():
        pass
    assert open_map(path).attrs["complete"] is True
    flip(path / "misfit" / "c" / "1" / "1")
    with pytest.warns(DamagedWindow), store.writing():
        pass
    assert open_map(path).attrs["complete"] is False


def test_a_map_with_damaged_coordinates_is_refused(path):
    flip(path / "x" / "c" / "0")
    with refusal(r"is a damaged map, .* overwrite=True \(--overwrite"):
        open_map(path)


def without(*names: str):
    def damage(file: Path) -> None:
        document = json.loads(file.read_text())
        owner = document["attributes"]
        for name in names[:-1]:
            owner = owner[name]
        del owner[names[-1]]
        file.write_text(json.dumps(document))

    return damage


@pytest.mark.parametrize(
    "damage",
    [
        cut,
        without("glazejax", "format"),
        without("glazejax", "chunk"),
        without("options"),
        without("paints"),
        without("glazejax"),
    ],
)
def test_a_map_that_does_not_say_what_it_is_is_refused(path, damage):
    damage(path / "zarr.json")
    for reads in (open_map, store_at):
        with refusal(r"is a damaged map, .* overwrite=True \(--overwrite"):
            reads(path)
    assert not store_at(path, overwrite=True).done()


@pytest.mark.parametrize("name", ["map.nc", "map.hdr"])
def test_a_damaged_window_is_not_exported(path, tmp_path, name):
    flip(path / "misfit" / "c" / "1" / "1")
    with refusal("window y16-32_x20-40 of"):
        export_map(path, tmp_path / name)
    assert os.listdir(tmp_path) == ["map.zarr"]


def test_an_opened_map_can_be_sent_to_other_processes(undisturbed):
    dataset = open_map(undisturbed.path)
    xarray.testing.assert_equal(pickle.loads(pickle.dumps(dataset)), dataset)
