"""Files that tests write and read."""

import pytest

from glazejax.io import read_spectra


@pytest.fixture
def put(tmp_path, request):
    """Writes text or bytes, under the usual name of the module's files or another."""

    def write(content, name=None, encoding="utf-8"):
        path = tmp_path / (name or request.module.FILE)
        path.write_bytes(content.encode(encoding) if isinstance(content, str) else content)
        return path

    return write


@pytest.fixture
def read(put):
    """Spectra of such a file."""

    def read_file(content, name=None, encoding="utf-8", **how):
        return read_spectra(put(content, name, encoding), **how)

    return read_file
