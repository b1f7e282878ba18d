"""The same work on a dask cluster: the same numbers, few pieces at a time, and dead workers
survived.
"""

import os
import re
import signal
import socket
import sys
import threading
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from glazefit.mapping.store.atomic_files import KeyedResults
from glazefit.mapping.store.chunk import ChunkMaps
from glazefit.mapping.store.run import client_in_scope, connect, finish
from glazefit.mapping.store.store import open_map

from ..refusals import refusal
from .test_store import same
from .toy import WINDOWS, Toy, local_cluster, run_chunks

distributed = pytest.importorskip("distributed")


@pytest.fixture(scope="module")
def client():
    """Two worker processes on this machine."""
    with (
        local_cluster(2, processes=True) as cluster,
        distributed.Client(cluster, set_as_default=False) as client,
    ):
        yield client


@dataclass(frozen=True)
class Noted(Toy):
    """Leaves a file for every window that a worker begins."""

    folder: str = ""

    def solve(self, window) -> ChunkMaps:
        Path(self.folder, f"{window}-{os.getpid()}").touch()
        return super().solve(window)


def test_a_cluster_finds_the_same_numbers(store, tmp_path, client, undisturbed):
    begun, ahead = tmp_path / "begun", []
    begun.mkdir()

    def note(done, total, words):
        assert len(store.done()) == done
        ahead.append(len(os.listdir(begun)) - done)

    run_chunks(store, Noted(0.01, str(begun)), client, note)
    same(store, undisturbed)
    processes = {path.name.rsplit("-", 1)[1] for path in begun.iterdir()}
    assert len(processes) == 2
    assert str(os.getpid()) not in processes
    assert len(os.listdir(begun)) == WINDOWS
    # Two workers have two pieces each and no more, however slowly they are fetched.
    assert max(ahead) <= 4

    def left(dask_scheduler):
        return [key for key in dask_scheduler.tasks if "glazejax" in str(key)]

    deadline = time.monotonic() + 10
    while client.run_on_scheduler(left):
        assert time.monotonic() < deadline


@pytest.mark.slow
def test_the_death_of_workers_is_survived(store, client, undisturbed):
    killed = []

    def kill(done, total, words):
        if done in (2, 5):
            process = next(iter(client.run(os.getpid).values()))
            os.kill(process, signal.SIGKILL)
            killed.append(process)

    run_chunks(store, Toy(0.05), client, kill)
    assert len(killed) == 2
    same(store, undisturbed)


@dataclass(frozen=True)
class Failing:
    """Work that fails so many times, then succeeds; files count across processes."""

    folder: str
    times: int
    kills: bool = False

    def __call__(self, key: str) -> dict[str, np.ndarray]:
        tried = len(list(Path(self.folder).glob(f"{key}-*")))
        Path(self.folder, f"{key}-{tried}").touch()
        if key == "b" and tried < self.times:
            if self.kills:
                os.kill(os.getpid(), signal.SIGKILL)
            raise ValueError("the disk of this worker stumbled")
        return {"key": np.array([key])}


def test_a_piece_that_fails_is_tried_again_but_not_for_ever(tmp_path, client):
    results = KeyedResults(tmp_path / "work")
    finish(["a", "b", "c"], Failing(str(tmp_path), 2), results.done(), results.put, client)
    assert results.done() == {"a", "b", "c"}
    assert len(list(tmp_path.glob("b-*"))) == 3
    other = KeyedResults(tmp_path / "other")
    with refusal("stumbled"):
        finish(["a", "b", "c"], Failing(str(tmp_path), 99), other.done(), other.put, client)
    assert "b" not in other.done()


@pytest.mark.slow
def test_a_piece_that_kills_every_worker_ends_in_a_sentence(tmp_path, client):
    results = KeyedResults(tmp_path / "work")
    with refusal("took on b died one after another: have they enough memory", RuntimeError):
        finish(
            ["a", "b"],
            Failing(str(tmp_path), 99, kills=True),
            results.done(),
            results.put,
            client,
        )


def test_a_cluster_that_is_lost_ends_in_a_sentence(store, undisturbed):
    with (
        local_cluster() as cluster,
        connect(cluster.scheduler_address, seconds=1) as client,
    ):
        assert client is not None
        assert client_in_scope() is None

        def close(done, total, words):
            if done == 3:
                cluster.close()

        with refusal("the dask cluster was lost", ConnectionError):
            run_chunks(store, Toy(0.01), client, close)
    assert 3 <= len(store.done()) < WINDOWS
    dataset = open_map(store.path)
    for window in store.done():
        assert (dataset.status[window.slices] == 1).all()
    run_chunks(store, Toy())
    same(store, undisturbed)


def test_a_cluster_without_workers_ends_in_a_sentence(tmp_path, monkeypatch):
    monkeypatch.setattr("glazefit.mapping.store.cluster._PATIENCE", 0.2)
    with (
        local_cluster(0) as cluster,
        distributed.Client(cluster, set_as_default=False) as client,
        refusal("has no workers; start some", RuntimeError),
    ):
        finish(["a"], Failing(str(tmp_path), 0), set(), KeyedResults(tmp_path).put, client)


@pytest.mark.parametrize(
    "address", ["tcp://127.0.0.1:1", "no://127.0.0.1:1", "127.0.0.1:port", "", "tls://127.0.0.1:1"]
)
def test_no_scheduler_is_said_in_one_line(address):
    words = re.escape(f"--scheduler {address}: no dask scheduler answers there")
    with refusal(words), connect(address, seconds=0.5):
        pass


def test_a_server_of_another_kind_is_no_scheduler():
    def answer():
        with suppress(OSError):
            while True:
                with server.accept()[0] as one:
                    one.sendall(b"HTTP/1.0 400 Bad Request\r\n\r\n")

    with socket.create_server(("127.0.0.1", 0)) as server:
        threading.Thread(target=answer, daemon=True).start()
        address = f"tcp://127.0.0.1:{server.getsockname()[1]}"
        with (
            refusal("no dask scheduler answers there"),
            connect(address, seconds=0.5),
        ):
            pass


def test_without_an_address_there_is_no_client():
    with connect(None) as client:
        assert client is None


@pytest.mark.slow
def test_the_client_of_the_program_is_found(monkeypatch):
    with distributed.Client(n_workers=0, processes=False, dashboard_address=None) as client:
        assert client_in_scope() is client
    assert client_in_scope() is None
    monkeypatch.delitem(sys.modules, "distributed")
    assert client_in_scope() is None
    assert "distributed" not in sys.modules
