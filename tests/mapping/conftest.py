"""A map of the toy's, begun and whole."""

import pytest

from .toy import Toy, run_chunks, store_at


@pytest.fixture
def store(tmp_path):
    return store_at(tmp_path / "map.zarr")


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    store = store_at(tmp_path_factory.mktemp("undisturbed") / "map.zarr")
    run_chunks(store, Toy())
    return store
