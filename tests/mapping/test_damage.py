"""A map that is not as it was written: what is damaged is named when it is read, and mapped anew."""

import json
import pickle
import shutil
import warnings
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from glazefit.mapping.store.chunk import ChunkMaps
from glazefit.mapping.store.export import export_map
from glazefit.mapping.store.layout import VARIABLES
from glazefit.mapping.store.run import run_chunks
from glazefit.mapping.store.store import DamagedWindow, MapStore, open_map
from glazefit.mapping.store.windows import Window

from .test_store import same, undisturbed  # noqa: F401
from .toy import PAINTS, SHAPE, WINDOWS, Toy, store_at

pytest.importorskip("zarr")

# Of the second row and column of windows.
WINDOW = Window(16, 32, 20, 40)


def copy(store: MapStore, folder: Path) -> Path:
    shutil.copytree(store.path, folder / "map.zarr")
    return folder / "map.zarr"


def cut(file: Path) -> None:
    file.write_bytes(file.read_bytes()[:-20])


def flip(file: Path) -> None:
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 1
    file.write_bytes(content)


def fill_in(file: Path) -> None:
    """A file where the array is all fill and has none."""
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(b"stray")


def read_all(path: Path) -> None:
    dataset = open_map(path)
    for name in dataset.data_vars:
        _ = dataset[name].values


@dataclass(frozen=True)
class Counted(Toy):
    """Keeps what it was asked for."""

    asked: list[Window] = field(default_factory=list)

    def solve(self, window: Window) -> ChunkMaps:
        self.asked.append(window)
        return super().solve(window)


@pytest.mark.parametrize(
    ("place", "damage", "words"),
    [
        ("misfit/c/1/1", cut, "misfit/c/1/1 is not as it was written"),
        ("status/c/1/1", flip, "status/c/1/1 is not as it was written"),
        ("paint_probability/c/1/1/0", Path.unlink, "paint_probability/c/1/1/0 is missing"),
        (".glazejax/marks/y16-32_x20-40.npz", cut, "its mark cannot be read"),
        (".glazejax/marks/y16-32_x20-40.npz", flip, "its mark cannot be read"),
    ],
)
def test_a_damaged_window_is_named_and_mapped_anew(
    tmp_path,
    undisturbed,  # noqa: F811
    place,
    damage,
    words,
):
    path = copy(undisturbed, tmp_path)
    damage(path / place)
    named = rf"^window y16-32_x20-40 of .*map\.zarr is damaged \({words}\)"
    with pytest.raises(ValueError, match=named + "; run the same `glazejax map` again, .*$"):
        read_all(path)
    # The others can be read.
    assert (open_map(path).status[:16].values == 1).all()
    solver = Counted()
    with pytest.warns(DamagedWindow, match=named + ", and is mapped anew$") as warned:
        run_chunks(store_at(path), solver)
    assert len(warned) == 1
    assert solver.asked == [WINDOW]
    same(MapStore.open(path), undisturbed)


def test_a_chunk_where_there_is_none_is_damage(tmp_path, undisturbed):  # noqa: F811
    path = copy(undisturbed, tmp_path)
    fill_in(path / "misfit" / "c" / "1" / "0")
    with pytest.raises(ValueError, match="misfit/c/1/0 is not as it was written"):
        read_all(path)


def test_an_array_that_was_removed_is_made_anew(tmp_path, undisturbed):  # noqa: F811
    path = copy(undisturbed, tmp_path)
    shutil.rmtree(path / "thickness")
    with pytest.raises(ValueError, match=r"map.zarr is damaged \(thickness/zarr.json is missing"):
        open_map(path)
    with pytest.warns(DamagedWindow) as warned:
        run_chunks(store_at(path), Toy())
    assert len(warned) == WINDOWS
    same(MapStore.open(path), undisturbed)
    assert sorted(file.name for file in tmp_path.iterdir()) == ["map.zarr"]


def test_metadata_are_mended_for_the_windows_that_the_map_has(tmp_path, undisturbed):  # noqa: F811
    """Whatever windows another bound of the memory would make."""
    path = copy(undisturbed, tmp_path)
    flip(path / "thickness" / "zarr.json")
    MapStore.create(path, SHAPE, (10, 10), PAINTS, options={"noise": 0.003, "layers": 1})
    same(MapStore.open(path), undisturbed)


def test_a_map_with_a_damaged_window_is_not_complete(tmp_path, undisturbed):  # noqa: F811
    path = copy(undisturbed, tmp_path)
    store = MapStore.open(path)
    store.note(complete=True)
    with store.writing():
        pass
    assert open_map(path).attrs["complete"] is True
    flip(path / "misfit" / "c" / "1" / "1")
    with pytest.warns(DamagedWindow), store.writing():
        pass
    assert open_map(path).attrs["complete"] is False


def test_damage_in_the_copy_of_all_metadata_harms_nothing(tmp_path, undisturbed):  # noqa: F811
    """Others read the arrays' metadata there at once; ours are checked where they lie."""
    path = copy(undisturbed, tmp_path)
    file = path / "zarr.json"
    document = json.loads(file.read_text())
    copied = document["consolidated_metadata"]["metadata"]["misfit"]
    copied["data_type"] = "float64"
    copied["chunk_grid"]["configuration"]["chunk_shape"] = [16, 10]
    file.write_text(json.dumps(document))
    (path / ".glazejax" / "marks" / f"{WINDOW}.npz").unlink()
    run_chunks(store_at(path), Toy())
    same(MapStore.open(path), undisturbed)


@pytest.mark.parametrize("place", ["x/c/0", "paint/c/0", "paint/zarr.json"])
def test_coordinates_are_written_anew(tmp_path, undisturbed, place):  # noqa: F811
    path = copy(undisturbed, tmp_path)
    flip(path / place)
    with pytest.raises(ValueError, match=rf"damaged \({place} is missing or not as it was"):
        open_map(path)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        run_chunks(store_at(path), Toy())
    same(MapStore.open(path), undisturbed)
    assert open_map(path).paint.values.tolist() == list(PAINTS)


def test_coordinates_that_are_others_are_not_written(tmp_path, undisturbed):  # noqa: F811
    path = copy(undisturbed, tmp_path)
    flip(path / "x" / "c" / "0")
    other = {"x": (np.arange(SHAPE[1]) + 7.0, {})}
    with pytest.raises(ValueError, match=r"damaged .* make the map again with overwrite=True"):
        store_at(path, coords=other)


def without(*names: str):
    def damage(file: Path) -> None:
        document = json.loads(file.read_text())
        owner = document["attributes"]
        for name in names[:-1]:
            owner = owner[name]
        del owner[names[-1]]
        file.write_text(json.dumps(document))

    return damage


def rename(file: Path) -> None:
    file.write_text(file.read_text().replace('"Umber"', '"Amber"'))


@pytest.mark.parametrize(
    "damage",
    [
        cut,
        without("glazejax", "format"),
        without("glazejax", "chunk"),
        without("options"),
        without("paints"),
        without("glazejax"),
        rename,
    ],
)
def test_a_map_that_does_not_say_what_it_is_is_refused(tmp_path, undisturbed, damage):  # noqa: F811
    path = copy(undisturbed, tmp_path)
    damage(path / "zarr.json")
    for reads in (open_map, store_at):
        with pytest.raises(
            ValueError, match=r"is a damaged map, .* overwrite=True \(--overwrite"
        ) as e:
            reads(path)
        assert "\n" not in str(e.value)
    assert not store_at(path, overwrite=True).done()


def test_windows_of_another_run_are_damage(tmp_path, undisturbed):  # noqa: F811
    path = copy(undisturbed, tmp_path)
    other = store_at(tmp_path / "other.zarr")
    run_chunks(other, Toy())
    place = Path(".glazejax", "marks", f"{WINDOW}.npz")
    shutil.copy(other.path / place, path / place)
    for reads in (read_all, lambda path: MapStore.open(path).sums()):
        with pytest.raises(ValueError, match="another run wrote it"):
            reads(path)


def test_a_map_that_is_replaced_while_it_is_read_is_not_mixed(tmp_path, undisturbed):  # noqa: F811
    path = copy(undisturbed, tmp_path)
    dataset = open_map(path)
    store = store_at(path, overwrite=True)
    run_chunks(store, Toy())
    with pytest.raises(ValueError, match="another run wrote it"):
        _ = dataset.misfit.values


@pytest.mark.parametrize("name", ["map.nc", "map.hdr"])
def test_a_damaged_window_is_not_exported(tmp_path, undisturbed, name):  # noqa: F811
    pytest.importorskip("h5netcdf")
    path = copy(undisturbed, tmp_path)
    flip(path / "misfit" / "c" / "1" / "1")
    with pytest.raises(ValueError, match="window y16-32_x20-40 of"):
        export_map(path, tmp_path / name)
    assert sorted(file.name for file in tmp_path.iterdir()) == ["map.zarr"]


def test_an_opened_map_can_be_sent_to_other_processes(undisturbed):  # noqa: F811
    dataset = open_map(undisturbed.path)
    there = pickle.loads(pickle.dumps(dataset))
    for variable in VARIABLES:
        np.testing.assert_array_equal(there[variable.name].values, dataset[variable.name].values)
