"""Options of XLA by which commands compile quickly."""

import os

import pytest

from glazejax import program_cache
from glazejax.program_cache import compile_quickly

LOOPS = "--xla_cpu_use_fusion_emitters=false"


@pytest.fixture
def flags(monkeypatch):
    """What a command's options become, of those that are given."""

    monkeypatch.setattr(program_cache, "version", lambda _: "0.9.2")

    def become(given="", level=1, **variables):
        monkeypatch.setenv("XLA_FLAGS", given)
        monkeypatch.setenv("JAX_PLATFORMS", "cpu")
        for name, value in variables.items():
            monkeypatch.setenv(name, value)
        compile_quickly(level)
        return os.environ["XLA_FLAGS"]

    return become


@pytest.mark.parametrize("level", [0, 1, 3])
def test_a_command_asks_for_simple_loops_and_its_level(flags, level):
    assert flags(level=level) == f"{LOOPS} --xla_backend_optimization_level={level}"


def test_what_the_user_says_counts(flags):
    given = "--xla_backend_optimization_level=2 --xla_dump_to=here"
    assert flags(given) == f"{LOOPS} {given}"
    assert flags(f"{LOOPS} {given}") == f"{LOOPS} {given}"


@pytest.mark.parametrize("version", ["0.8.2", "0.13.0"])
def test_a_jaxlib_that_nobody_looked_at_gets_none(flags, monkeypatch, version):
    monkeypatch.setattr(program_cache, "version", lambda _: version)
    assert flags("--xla_dump_to=here") == "--xla_dump_to=here"


def test_other_devices_get_none(flags):
    assert flags(JAX_PLATFORMS="cuda") == ""
