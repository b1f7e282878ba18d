"""The same image in every kind of file."""

import pytest

from .images import IMAGE, every


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    return every(tmp_path_factory.mktemp("files"), IMAGE)
