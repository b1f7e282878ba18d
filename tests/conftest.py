"""What every test runs under: precision, quick compilation, limits of memory and time, measured
data.
"""

import ctypes
import gc
import os
import sys
import time
from pathlib import Path

# Most of the suite's time and memory is compilation. Fast code is for users; here it is compiled
# quickly instead. The slow tests take the usual optimisation level, but for the emitters of fused
# loops, a third of its time. What users run is tested as they run it: `GLAZEJAX_TEST_OPTIMISED=1`
# (`.ci/run` does all this).
ELSEWHERE = os.environ.get("JAX_PLATFORMS", "cpu").split(",")[0] not in ("", "cpu")
"""Whether the tests run on a GPU: JAX_PLATFORMS=cuda, docs/gpu.md."""

_SIMPLE_LOOPS = "--xla_cpu_use_fusion_emitters=false"
_FLAGS = {
    "0": (
        f"{_SIMPLE_LOOPS} --xla_backend_optimization_level=0 "
        "--xla_cpu_parallel_codegen_split_count=1"
    ),
    "level": _SIMPLE_LOOPS,
    "1": "",
}
OPTIMISED = os.environ.get("GLAZEJAX_TEST_OPTIMISED", "0")
flags = _FLAGS[OPTIMISED]
# XLA takes a value without any option for the name of a file.
if flags and not ELSEWHERE:
    os.environ["XLA_FLAGS"] = f"{os.environ.get('XLA_FLAGS', '')} {flags}"

# Linear algebra of small matrices in NumPy: threads of two workers would wait for each other, each
# spinning, and take four times as long. For workers, which begin after this; NumPy may be loaded
# here already.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

try:
    import resource

    _PROCESSES = resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN
except ModuleNotFoundError:  # Windows
    resource = None

import hypothesis
import jax
import jaxtyping
import pytest

# GLAZEJAX_TEST_X64=0 runs the tests marked `single`, which hold in both precisions, without it.
DOUBLE = os.environ.get("GLAZEJAX_TEST_X64") != "0"
jax.config.update("jax_enable_x64", DOUBLE)
jax.config.update(
    "jax_logging_level", "CRITICAL"
)  # XLA calls a program taken from the cache an error
# Programs compiled by one worker or run serve the others.
jax.config.update(
    "jax_compilation_cache_dir", str(Path(__file__).parents[1] / ".pytest_cache" / "xla")
)
jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.1)

# Annotations of the forward package, shapes too, are checked in the quick suite, where that takes
# some hundredths of its time, and not where programs are compiled as users' are.
CHECKED = os.environ.get("GLAZEJAX_CHECK_TYPES", "1" if OPTIMISED == "0" else "0") == "1"
if CHECKED:
    # A whole number counts as a float, as for type checkers (PEP 484).
    jaxtyping.install_import_hook(
        "glazejax", "beartype.beartype(conf=beartype.BeartypeConf(is_pep484_tower=True))"
    )

hypothesis.settings.register_profile("glazejax", deadline=None, max_examples=50)
# Of damaged files, tests/io/test_hostile.py; it takes some minutes.
hypothesis.settings.register_profile("fuzz", deadline=None, max_examples=20_000)
hypothesis.settings.load_profile("glazejax")


# Tracing makes a million small objects; looking for circles among them less often saves a fifth of
# its time.
gc.set_threshold(100_000, 20, 50)

_MANY_MAPPINGS = 20_000
"""Of memory by one process; Linux allows 65530, and LLVM, which takes some for each program,
crashes beyond.
"""
_MUCH_MEMORY = 1.1e9, 1.35e9
"""Bytes held by one process between two modules, and between two tests of one, whose programs the
next test may want again; the heaviest tests take some .4e9 more.
"""
_GROWN = 0.35e9
"""Bytes that must have come since programs were let go last: what stays then is no program, and
would stay again.
"""
_stayed = 0.0


@pytest.fixture(autouse=True)
def _dtypes_are_said(request):
    """No dtype becomes another by itself, in the forward package."""
    loose = {"fitting", "mapping"} & {*request.path.parts}
    with jax.numpy_dtype_promotion("standard" if loose else "strict"):
        yield


@pytest.hookimpl(wrapper=True)
def pytest_runtest_teardown(item, nextitem):
    """Throws compiled programs away before there are too many, or too large ones."""
    yield
    module_ends = nextitem is None or nextitem.path != item.path
    maps = Path("/proc/self/maps")
    if _memory() > max(_MUCH_MEMORY[not module_ends], _stayed + _GROWN) or (
        module_ends and maps.exists() and maps.read_bytes().count(b"\n") > _MANY_MAPPINGS
    ):
        _let_programs_go()


def _memory() -> int:
    """Bytes that this process holds now; 0 where Linux does not tell."""
    told = Path("/proc/self/statm")
    return int(told.read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") if told.exists() else 0


def _let_programs_go() -> None:
    # Not before the annotations' hook, above.
    from glazejax.programs import let_programs_go

    global _stayed
    let_programs_go()
    gc.collect()
    if os.name == "posix" and hasattr(
        libc := ctypes.CDLL(None), "malloc_trim"
    ):  # What glibc keeps goes back too.
        libc.malloc_trim(0)
    _stayed = _memory()


@pytest.fixture(autouse=True, scope="session")
def _tests_set_jax_up_themselves():
    """A command called in this process would have every later test trace each program twice, hold
    it and keep it in the user's folder.
    """
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.setattr("glazejax.commands.main.start_jax", lambda **_: None)
        yield


@pytest.fixture
def here(monkeypatch, tmp_path):
    """The folder of the test, in which it works."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def command_line(monkeypatch, tmp_path, capsys):
    """Runs `glazejax` in an empty folder: from first words and a width, a function of the words that
    follow and of the exit status they must have, which gives output and errors.
    """
    import glazejax.commands.main as program
    from glazejax.commands import progress

    # Lines of progress, which only slow machines print, are no errors.
    as_it_is = progress.lines
    monkeypatch.setattr(progress, "lines", lambda seconds=3600.0: as_it_is(seconds))

    def begin(*first, columns=200, on_one_line=False):
        monkeypatch.chdir(tmp_path)
        monkeypatch.setenv("COLUMNS", str(columns))

        def call(*words, fails=0):
            monkeypatch.setattr(sys, "argv", ["glazejax", *first, *map(str, words)])
            with pytest.raises(SystemExit) as stop:
                program.main()
            out, err = capsys.readouterr()
            assert (stop.value.code or 0) == fails, (words, err)
            assert fails != 2 or err.count("\n") == 1, err
            return " ".join(out.split()) if on_one_line else out, err

        return call

    return begin


@pytest.fixture
def unchecked():
    """For calls that a type checker refuses: what the function itself says to those who
    use none.
    """
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
def shared_cases() -> Path:
    """Folder of made-up files, a folder for each kind of fault that was met."""
    return _shared("GLAZEJAX_CASES", "cases")


@pytest.fixture(scope="session")
def shared_reference() -> Path:
    """Folder of values that other programs computed."""
    return _shared("GLAZEJAX_REFERENCE", "reference")


# Files whose tests share the tables of one grid of wavelengths, which one worker makes then.
_TOGETHER = {f"tests/mapping/test_{name}.py" for name in ("page", "painting_rivals", "pictures")}


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """A worker takes whole files, in their order: each fixture and each program is made once."""
    from xdist.scheduler import LoadFileScheduling

    class Files(LoadFileScheduling):
        def _split_scope(self, nodeid: str) -> str:
            file = super()._split_scope(nodeid)
            return "tests/mapping" if file in _TOGETHER else file

    # The files that end a run are the short ones.
    config.option.loadscopereorder = False
    return Files(config, log)


def pytest_collection_finish():
    """What was loaded until now stays, and no search for circles needs to look at it."""
    gc.collect()
    gc.freeze()


def pytest_collection_modifyitems(config, items):
    if not DOUBLE:
        config.hook.pytest_deselected(
            items=[item for item in items if not item.get_closest_marker("single")]
        )
        items[:] = [item for item in items if item.get_closest_marker("single")]


_STARTED = time.monotonic()
_BUDGET = float(os.environ.get("GLAZEJAX_TEST_SECONDS") or "inf")
"""Seconds after which no further test begins; those left out are skipped, and named at the end."""
_TOO_LATE = "not begun: its time was up"


def pytest_runtest_setup(item):
    if ELSEWHERE and item.get_closest_marker("processor"):
        pytest.skip("of a CPU's programs, and JAX_PLATFORMS asks for another device")
    if time.monotonic() - _STARTED > _BUDGET:
        pytest.skip(f"{_TOO_LATE}, {_BUDGET:.0f} s (GLAZEJAX_TEST_SECONDS)")


def pytest_terminal_summary(terminalreporter):
    late = [
        test.nodeid
        for test in terminalreporter.stats.get("skipped", [])
        if _TOO_LATE in str(test.longrepr)
    ]
    if late:
        terminalreporter.section(f"{len(late)} tests {_TOO_LATE}")
        terminalreporter.write_line("\n".join(sorted(late)))
    if resource is not None:
        # Workers have ended by now, and count with all that they ran.
        peak = max(resource.getrusage(who).ru_maxrss for who in _PROCESSES)
        unit = 1 if sys.platform == "darwin" else 1024
        terminalreporter.write_line(f"peak memory of a worker: {peak * unit / 1e9:.1f} GB")
