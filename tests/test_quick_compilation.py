"""Options of XLA by which commands compile quickly."""

import os

import pytest

from glazejax import program_cache
from glazejax.program_cache import compile_quickly

LOOPS = "--xla_cpu_use_fusion_emitters=false"


LOOK = "--xla_dump_to=here"
LEVEL = "--xla_backend_optimization_level="


@pytest.mark.parametrize(
    ("given", "level", "version", "platform", "options"),
    [
        ("", 0, "0.9.2", "cpu", f"{LOOPS} {LEVEL}0"),
        ("", 3, "0.9.2", "cpu", f"{LOOPS} {LEVEL}3"),
        (f"{LEVEL}2 {LOOK}", 1, "0.9.2", "cpu", f"{LOOPS} {LEVEL}2 {LOOK}"),
        (f"{LOOPS} {LEVEL}2", 1, "0.9.2", "cpu", f"{LOOPS} {LEVEL}2"),
        (LOOK, 1, "0.8.2", "cpu", LOOK),
        (LOOK, 1, "0.13.0", "cpu", LOOK),
        ("", 1, "0.9.2", "cuda", ""),
    ],
    ids=["level 0", "level 3", "a user's level", "loops", "too old", "too new", "another device"],
)
def test_a_command_asks_for_simple_loops_and_a_level(
    monkeypatch, given, level, version, platform, options
):
    """Unless the user states them, or nobody has looked at this jaxlib or device."""
    monkeypatch.setattr(program_cache, "version", lambda _: version)
    monkeypatch.setenv("XLA_FLAGS", given)
    monkeypatch.setenv("JAX_PLATFORMS", platform)
    compile_quickly(level)
    assert os.environ["XLA_FLAGS"] == options
