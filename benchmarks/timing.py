"""Warm timings of several programs on the same work, interleaved so that a noisy machine is fair to
all.
"""

import json
import os
import platform
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, TypeVar

import jax

Result = TypeVar("Result")
Programs = dict[str, Callable[[], Any]]
"""What is timed, by name."""

REPEATED = {
    "repetitions": (20, 3, "timed runs of each program"),
    "budget": (1.0, 0.1, "seconds of timed runs a program"),
}
"""Options of `command_line` that say how often programs run."""
# However slow a program is, its median rests on this many runs.
FEWEST = 3


def interleaved(
    programs: Programs,
    repetitions: int = 60,
    *,
    budget: float = float("inf"),
    rewarm: bool = False,
) -> dict[str, float]:
    """Median seconds of each program, run in turn `repetitions` times after two warm-up rounds.

    Args:
        programs: what to run; results of JAX are waited for.
        repetitions: timed runs of each.
        budget: seconds after which a program, once run three times, drops out of further rounds.
        rewarm: run each program once untimed before each timed run, so that among many programs
            none is charged for caches and thread pools that the one before it left in another
            state. Programs that take longer than a tenth of a second do not feel them and are not
            run twice.
    """
    seconds: dict[str, list[float]] = {name: [] for name in programs}
    last: dict[str, float] = {}

    def once(name: str) -> float:
        start = time.perf_counter()
        jax.block_until_ready(programs[name]())
        return time.perf_counter() - start

    for round_ in range(repetitions + 2):
        for name in programs:
            done = seconds[name]
            if len(done) >= FEWEST and sum(done) > budget:
                continue
            if round_ < 2:
                # A slow program is warm after one run.
                if last.get(name, 0.0) < 1.0:
                    last[name] = once(name)
                continue
            if rewarm and last[name] < 0.1:
                once(name)
            last[name] = once(name)
            done.append(last[name])
    return {name: statistics.median(times) for name, times in seconds.items()}


def time_call(program: Callable[[], Result]) -> tuple[Result, float]:
    """Result of a program, and the seconds that it took; results of JAX are waited for."""
    began = time.perf_counter()
    result = jax.block_until_ready(program())
    return result, time.perf_counter() - began


def in_a_process(*words: str) -> list[Any]:
    """Lines of JSON that Python prints in a process of its own, run with these words.

    Raises:
        RuntimeError: it failed; says what it printed last.
    """
    done = subprocess.run([sys.executable, *words], capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{' '.join(words)} failed:\n{done.stderr[-3000:]}")
    return [json.loads(line) for line in done.stdout.splitlines() if line[:1] in ("{", "[")]


def peak_memory() -> int:
    """Bytes that this process has had at most."""
    # No part of Python on every system.
    import resource

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def processor() -> str:
    """Name of the processor, where the system states it."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.machine()
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def machine() -> str:
    """Architecture, processor, cores and devices of JAX other than the processor."""
    devices = {device.device_kind for device in jax.local_devices() if device.platform != "cpu"}
    return ", ".join([platform.machine(), processor(), f"{os.cpu_count()} cores", *sorted(devices)])


def versions(*packages: str) -> dict[str, str]:
    """Version of Python, and of each of these packages that is installed."""
    installed = {name: version(name) for name in packages if _installed(name)}
    return {"Python": platform.python_version(), **installed}


def _installed(package: str) -> bool:
    try:
        return bool(version(package))
    except PackageNotFoundError:
        return False
