"""Two runs never write one map, and no dead run keeps a living one from it."""

import os
from pathlib import Path

from glazefit.mapping.store.lock import hold

from ..refusals import refusal
from .test_store import finished
from .toy import Toy, run_chunks, start_run, store_at


def test_a_map_that_was_replaced_before_it_was_written_is_left_alone(tmp_path):
    first = store_at(tmp_path / "map.zarr")
    second = store_at(tmp_path / "map.zarr", overwrite=True)
    with refusal(r"another run has replaced .*map.zarr"):
        run_chunks(first, Toy())
    assert not second.done()


def test_a_run_in_another_process_holds_its_map_until_it_dies(tmp_path):
    path = tmp_path / "map.zarr"
    with start_run(path, 0.2) as run:
        while not finished(path):
            assert run.poll() is None
        for overwrite in (False, True):
            with refusal("another run is writing"):
                store_at(path, overwrite=overwrite)
        run.kill()
    # The file of the killed run is still there, and holds nothing.
    assert (tmp_path / ".map.zarr.lock").exists()
    assert store_at(path, overwrite=True).done() == set()
    assert os.listdir(tmp_path) == ["map.zarr"]


def test_a_map_is_held_by_whatever_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "same").symlink_to("map.zarr")
    with hold(Path("map.zarr")):
        for name in ("map.zarr", tmp_path / "map.zarr", "same"):
            with refusal("another run is writing"), hold(Path(name)):
                pass
        with hold(Path("other.zarr")):
            pass
    assert os.listdir(tmp_path) == ["same"]
