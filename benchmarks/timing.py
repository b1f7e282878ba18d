"""Warm timings of several programs on the same work, interleaved so that a noisy machine is fair to all."""

import platform
import statistics
import time
from collections.abc import Callable
from importlib.metadata import version

import jax


def interleaved(programs: dict[str, Callable[[], object]], repetitions: int = 60) -> dict[str, float]:
    """Median seconds of each program, run in turn `repetitions` times after two warm-up rounds."""
    seconds: dict[str, list[float]] = {name: [] for name in programs}
    for round_ in range(repetitions + 2):
        for name, program in programs.items():
            start = time.perf_counter()
            jax.block_until_ready(program())
            if round_ >= 2:
                seconds[name].append(time.perf_counter() - start)
    return {name: statistics.median(times) for name, times in seconds.items()}


def environment(*packages: str) -> str:
    """One line: machine, Python and package versions."""
    installed = ", ".join(f"{name} {version(name)}" for name in ("jax", *packages))
    return f"{platform.machine()}, {jax.local_device_count()} {jax.default_backend()} device, {installed}"
