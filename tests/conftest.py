"""Double precision, checked annotations, hypothesis without deadlines (the first call compiles), measured data."""

import ctypes
import gc
import math
import os
import resource
import sys
import time
from pathlib import Path

# Most of the suite's time and memory is compilation. Fast code is for users; here it is compiled quickly instead,
# unless the programs that users run are what is to be tested. Without the emitters of fused loops compiling takes a
# quarter of the time and memory.
ELSEWHERE = os.environ.get("JAX_PLATFORMS", "cpu").split(",")[0] not in ("", "cpu")
"""Whether the tests run on a GPU: JAX_PLATFORMS=cuda, docs/gpu.md."""

if os.environ.get("GLAZEJAX_TEST_OPTIMISED") != "1" and not ELSEWHERE:
    quick = "--xla_backend_optimization_level=0 --xla_cpu_use_fusion_emitters=false"
    os.environ["XLA_FLAGS"] = f"{os.environ.get('XLA_FLAGS', '')} {quick} --xla_cpu_parallel_codegen_split_count=1"

import hypothesis
import jax
import jaxtyping
import pytest

from tests.checked import begin_test, check_annotations

jax.config.update("jax_enable_x64", True)
jax.config.update("jax_logging_level", "CRITICAL")  # XLA calls a program taken from the cache an error
# Programs compiled by one worker or run serve the others.
jax.config.update("jax_compilation_cache_dir", str(Path(__file__).parents[1] / ".pytest_cache" / "xla"))
jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.1)

# Annotations of the forward package are checked while the tests run, shapes too, in the first calls of each function in
# each test. GLAZEJAX_CHECK_TYPES=0 leaves that out, "all" checks every call, and the inverse package.
_CHECKED = os.environ.get("GLAZEJAX_CHECK_TYPES", "1")
if _CHECKED == "all":
    check_annotations(["glazejax", "glazefit"], math.inf)
elif _CHECKED != "0":
    check_annotations(["glazejax"], 100)

hypothesis.settings.register_profile("glazejax", deadline=None, max_examples=50)
hypothesis.settings.load_profile("glazejax")


# Tracing makes a million small objects; looking for circles among them less often saves a fifth of its time.
gc.set_threshold(100_000, 20, 50)

_MANY_MAPPINGS = 20_000
"""Of memory by one process; Linux allows 65530, and LLVM, which takes some for each program, crashes beyond."""
_MUCH_MEMORY = 1.2e9
"""Bytes held by one process between two modules; the heaviest tests take some .6e9 more."""
_TOO_MUCH_MEMORY = 1.5e9
"""The same between two tests of a module, whose programs the next one may want again."""
_GROWN = 0.25e9
"""Bytes that must have come since programs were let go last: what stays then is no program, and would stay again."""
_stayed = 0.0


@pytest.fixture(autouse=True)
def _dtypes_are_said(request):
    """No dtype becomes another by itself, in the forward package; in the inverse one where all types are checked."""
    forward = "fitting" not in request.path.parts or _CHECKED == "all"
    with jax.numpy_dtype_promotion("strict" if forward else "standard"):
        yield
    if _memory() > max(_TOO_MUCH_MEMORY, _stayed + _GROWN):
        _let_programs_go()


@pytest.fixture(autouse=True, scope="module")
def _programs_are_let_go():
    """Throws compiled programs away before there are too many, or too large ones."""
    yield
    maps = Path("/proc/self/maps")
    mappings = len(maps.read_bytes().splitlines()) if maps.exists() else 0
    if mappings > _MANY_MAPPINGS or _memory() > max(_MUCH_MEMORY, _stayed + _GROWN):
        _let_programs_go()


def _memory() -> int:
    """Bytes that this process holds now; 0 where Linux does not tell."""
    told = Path("/proc/self/statm")
    return int(told.read_text().split()[1]) * resource.getpagesize() if told.exists() else 0


def _let_programs_go() -> None:
    global _stayed
    jax.clear_caches()
    gc.collect()
    if hasattr(libc := ctypes.CDLL(None), "malloc_trim"):  # What glibc keeps of it goes back too.
        libc.malloc_trim(0)
    _stayed = _memory()


@pytest.fixture
def unchecked():
    """For calls that a type checker refuses: what the function itself says to those who use none."""
    jaxtyping.config.update("jaxtyping_disable", True)
    yield
    jaxtyping.config.update("jaxtyping_disable", False)


def _shared(variable: str, folder: str) -> Path:
    path = Path(os.environ.get(variable) or Path(__file__).parents[2] / "shared" / folder)
    if not path.is_dir():
        pytest.skip(f"no shared {folder} at {path}; set {variable}")
    return path


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of measured spectra."""
    return _shared("GLAZEJAX_DATA", "data")


@pytest.fixture(scope="session")
def shared_reference() -> Path:
    """Folder of values that other programs computed."""
    return _shared("GLAZEJAX_REFERENCE", "reference")


_STARTED = time.monotonic()
_BUDGET = float(os.environ.get("GLAZEJAX_TEST_SECONDS") or "inf")
"""Seconds after which no further test begins; those left out are counted as skipped."""


def pytest_runtest_setup(item):
    begin_test()
    if ELSEWHERE and item.get_closest_marker("processor"):
        pytest.skip("of a CPU's programs, and JAX_PLATFORMS asks for another device")
    if time.monotonic() - _STARTED > _BUDGET:
        pytest.skip(f"not begun: {_BUDGET:.0f} s had gone (GLAZEJAX_TEST_SECONDS)")


def _peak_memory() -> float:
    """Largest memory that this process has held, GB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024) / 1e9


def pytest_sessionfinish(session):
    """A worker of xdist tells its peak memory to the process that prints the summary."""
    if (output := getattr(session.config, "workeroutput", None)) is not None:
        output["peak_memory"] = _peak_memory()


_PEAKS: list[float] = []


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node, error):
    if peak := getattr(node, "workeroutput", {}).get("peak_memory"):
        _PEAKS.append(peak)


def pytest_terminal_summary(terminalreporter):
    terminalreporter.write_line(f"peak memory of a worker: {max(_PEAKS or [_peak_memory()]):.1f} GB")
