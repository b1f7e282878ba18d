"""A home folder that is read-only, missing or full costs the cache of compiled programs, never the
run.
"""

import os
import re

import pytest

from .fresh import run_python

_NOTE = re.compile(
    r"note: compiled programs are not kept \([^)]+\), so that .* names another folder\n"
)
_RUN = """
import resource, sys
from glazejax.commands.main import start_jax
start_jax()
if len(sys.argv) > 1:
    size = int(sys.argv[1])
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))
import jax, jax.numpy as jnp
for power in range(3):
    assert float(jax.jit(lambda x: jnp.sin(x) ** power + x)(jnp.zeros(()))) == (power == 0)
print("done")
"""


@pytest.fixture(autouse=True)
def _no_folder_is_named(monkeypatch):
    for name in ("GLAZEJAX_CACHE", "JAX_COMPILATION_CACHE_DIR", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)


def run(home, *words, **more):
    done = run_python(_RUN, *words, env={"HOME": str(home), **more})
    assert done.stdout == "done\n"
    return done.stderr


def programs(home):
    return sorted((home / ".cache" / "glazejax" / "xla").glob("*-cache"))


def test_a_home_that_takes_it_keeps_programs(tmp_path):
    assert run(tmp_path) == ""
    assert len(programs(tmp_path)) >= 3


@pytest.mark.parametrize("home", ["/dev/null", "/proc/nothing"])
def test_a_home_that_is_none(home):
    assert _NOTE.fullmatch(run(home))


def test_a_read_only_home(tmp_path):
    if os.geteuid() == 0:
        pytest.skip("root may write anywhere")
    tmp_path.chmod(0o500)
    assert _NOTE.fullmatch(run(tmp_path))


def test_a_folder_that_is_named_counts(tmp_path):
    assert run("/dev/null", GLAZEJAX_CACHE=str(tmp_path / "new")) == ""
    assert list((tmp_path / "new").glob("*-cache"))


def test_a_relative_folder_stays_where_it_was_named(tmp_path):
    (tmp_path / "elsewhere").mkdir()
    code = """
import os, glazejax
glazejax.enable_program_cache("cache")
os.chdir("elsewhere")
import jax
jax.jit(lambda x: x + 1)(1.0)
"""
    run_python(code, cwd=tmp_path)
    assert list((tmp_path / "cache").glob("*-cache"))
    assert not any((tmp_path / "elsewhere").iterdir())


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="folders have no such owners here")
def test_a_folder_that_others_may_write_is_not_taken(tmp_path):
    """Who can put a program there has it run."""
    shared = tmp_path / "shared"
    shared.mkdir()
    for mode in (0o777, 0o770):
        shared.chmod(mode)
        said = run(tmp_path, GLAZEJAX_CACHE=str(shared))
        assert _NOTE.fullmatch(said)
        assert f"{shared} may be written by others" in said
        assert not list(shared.iterdir())
    shared.chmod(0o700)
    if os.geteuid() == 0:
        os.chown(shared, 12345, -1)
        assert "belongs to another user" in run(tmp_path, GLAZEJAX_CACHE=str(shared))
    # One's own, which an older version has made, is closed.
    own = tmp_path / ".cache" / "glazejax" / "xla"
    own.mkdir(parents=True)
    own.chmod(0o775)
    assert run(tmp_path) == ""
    assert own.stat().st_mode & 0o777 == 0o755
    assert programs(tmp_path)


@pytest.mark.slow
def test_a_disk_that_fills_up_and_is_emptied(tmp_path):
    """What could be written in part only is taken out again: the next run would stumble over it for
    ever.
    """
    assert _NOTE.fullmatch(run(tmp_path, "600"))
    assert all(path.stat().st_size < 600 for path in programs(tmp_path))
    assert run(tmp_path) == ""
    assert len(programs(tmp_path)) >= 3


def test_an_entry_cut_short_is_told_once_and_mended(tmp_path):
    run(tmp_path)
    for path in programs(tmp_path):
        path.write_bytes(path.read_bytes()[:50])
    assert _NOTE.fullmatch(run(tmp_path))
    assert run(tmp_path) == ""
