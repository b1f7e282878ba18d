"""Options of XLA by which a command's programs are compiled in half the time, on the processor."""

import os
from importlib.metadata import version
from importlib.util import find_spec

# XLA ends a process at an option that it does not know: versions of jaxlib looked at.
_KNOWN = (0, 9), (0, 13)
# Emitters of fused loops take a third of compilation, and what they emit here runs no faster.
_SIMPLE_LOOPS = "--xla_cpu_use_fusion_emitters=false"
# The first level of optimisation leaves the solver a tenth slower than the last, without any it
# takes several times as long.
_LEVEL = "--xla_backend_optimization_level"


def compile_quickly(level: int) -> None:
    """Put these options into ``XLA_FLAGS``, before JAX compiles anything; those that are there
    count.

    Args:
        level: of optimisation, from 0 to 3.
    """
    if not _alone() or not _KNOWN[0] <= _jaxlib() < _KNOWN[1]:
        return
    given = os.environ.get("XLA_FLAGS", "")
    new = [
        flag for flag in (_SIMPLE_LOOPS, f"{_LEVEL}={level}") if flag.partition("=")[0] not in given
    ]
    if new:
        os.environ["XLA_FLAGS"] = " ".join([*new, given]).strip()


def _alone() -> bool:
    """Whether JAX has the processor only: other devices' compilers have that level too."""
    asked = os.environ.get("JAX_PLATFORMS", "")
    return asked == "cpu" or (not asked and find_spec("jax_plugins") is None)


def _jaxlib() -> tuple[int, int]:
    major, minor = version("jaxlib").split(".")[:2]
    return int(major), int(minor)
