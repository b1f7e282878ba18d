"""Runs tests in forked children of one process that has imported what others wrote, and nothing of
ours.

Most of a short test run is importing JAX, SciPy and pytest. A fork has them at once. JAX starts its
threads with the first computation; the parent therefore computes nothing.
"""

import contextlib
import importlib
import json
import math
import os
import resource
import select
import signal
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

IMPORTED = (
    "jax",
    "jax.numpy",
    "jax.scipy.linalg",
    "jax.scipy.special",
    "jax.experimental",
    "equinox",
    "optimistix",
    "jaxtyping",
    "beartype",
    "numpy",
    "scipy.linalg",
    "scipy.optimize",
    "scipy.special",
    "scipy.integrate",
    "scipy.interpolate",
    "scipy.stats",
    "scipy.spatial",
    "colour",
    "emcee",
    "typer",
    "typer.testing",
    "rich.table",
    "rich.progress",
    "hypothesis",
    "hypothesis.strategies",
    "hypothesis.extra.numpy",
    "pytest",
    "matplotlib.pyplot",
    "coverage",
    "lazy_loader",
    "colour_cxf",
)
IDLE = 6.0
"""Times its seconds of processor time, by the clock, after which a child is stopped too."""
MEMORY = 12 << 30
"""Bytes of address space of a child."""
ENDED = (0, 1, 5)
"""What pytest says when it has run tests, some failed, or found none."""
PATIENCE = (25.0, 8.0)
"""A test that takes more than the first, s, and the second times its usual time, has no end."""


def prepare(core: int | None) -> None:
    """Import packages of others, on one core. XLA reads its flags when it starts, after conftest.py
    has set them.
    """
    if core is not None:
        os.sched_setaffinity(0, {core})
    os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MPLBACKEND="Agg")
    for name in IMPORTED:
        with contextlib.suppress(ImportError):
            importlib.import_module(name)
    import jax
    from jax._src import xla_bridge

    jax.config.update("jax_enable_x64", True)
    if xla_bridge.backends_are_initialized():
        raise RuntimeError(
            "a package starts JAX's backend when it is imported; leave it out of IMPORTED"
        )


@dataclass(eq=False)
class Plugin:
    """Tells the parent what happens to each test, as lines of JSON; with `coverage` also which
    lines it ran.
    """

    pipe: int
    coverage: Any = None
    failed: bool = False
    _began: float = field(default=0.0)

    def say(self, *words: object) -> None:
        """One line to the parent."""
        os.write(self.pipe, (json.dumps(words) + "\n").encode())

    def pytest_collection(self) -> None:
        """No example of an earlier run comes back, and a failure is not made simpler: failing is
        enough.
        """
        import hypothesis

        quick = [hypothesis.Phase.explicit, hypothesis.Phase.generate]
        hypothesis.settings.register_profile(
            "mutation", deadline=None, max_examples=50, database=None, phases=quick
        )
        hypothesis.settings.load_profile("mutation")

    def pytest_runtest_logstart(self, nodeid: str) -> None:
        """Before a test's fixtures."""
        self._began = time.process_time()
        self.say("start", nodeid)
        if self.coverage is not None:
            self.coverage.switch_context(nodeid)

    def pytest_runtest_logfinish(self, nodeid: str) -> None:
        """After a test's fixtures."""
        self.say("end", nodeid, time.process_time() - self._began)
        if self.coverage is not None:
            self.coverage.switch_context("")

    def pytest_runtest_logreport(self, report: Any) -> None:
        """A failure of the test or its fixtures."""
        if report.failed:
            self.failed = True
            self.say("fail", report.nodeid)

    def pytest_collectreport(self, report: Any) -> None:
        """A file that cannot be imported."""
        if report.failed:
            self.failed = True
            self.say("fail", report.nodeid)


def _pytest(plugin: Plugin, ids: Sequence[str], slow: bool) -> None:
    import pytest

    marks = "slow" if slow else "not slow"
    # Folders of tests are the scratch copy's own: other runs of pytest clean the common ones up.
    folder = f"--basetemp={Path.cwd().with_suffix('.tmp')}"
    options = ["-x", "-q", "--tb=no", "--no-header", folder, "-p", "no:cacheprovider", "-m", marks]
    code = pytest.main([*options, *ids], plugins=[plugin])
    if code not in ENDED:
        plugin.failed = True
        plugin.say("fail", f"{ids[0]} and others: pytest ended with {code!r}")


def in_child(
    scratch: Path, work: Callable[[int], None], usual: dict[str, float] | None, seconds: float
) -> tuple[str, str, list[tuple[str, float]]]:
    """Run `work(pipe)` in a fork, in the scratch tree.

    Args:
        scratch: copy of the repository.
        work: what the child does; it writes lines as `Plugin.say` does.
        usual: seconds of each test, which then has an end; without, a test has as much time as it
            takes.
        seconds: of processor time, after which the child is stopped.

    Returns:
        Outcome ("killed", "timeout", "passed", "budget"), the test concerned, and the tests that
        ended with seconds.
    """
    read, write = os.pipe()
    if (child := os.fork()) == 0:
        try:
            os.close(read)
            os.setsid()
            resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
            os.chdir(scratch)
            sys.path[:0] = [str(scratch / "src"), str(scratch / "fitting"), str(scratch)]
            log = os.open(scratch.with_suffix(".log"), os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
            os.dup2(log, 1)
            os.dup2(log, 2)
            work(write)
        except BaseException as error:
            os.write(write, (json.dumps(["fail", f"{type(error).__name__}"]) + "\n").encode())
        finally:
            os._exit(0)
    os.close(write)
    try:
        return _listen(read, usual, seconds, lambda: _spent(child))
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(child, signal.SIGKILL)
        os.waitpid(child, 0)
        os.close(read)


def _spent(process: int) -> float:
    """Seconds of processor time of a process and of those it has waited for; other programs do not
    count.
    """
    try:
        words = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return time.monotonic()
    return sum(map(int, words[11:15])) / os.sysconf("SC_CLK_TCK")


def _listen(
    pipe: int, usual: dict[str, float] | None, seconds: float, clock: Callable[[], float]
) -> tuple[str, str, list[tuple[str, float]]]:
    begun, first, now, since, kept = time.monotonic(), clock(), "", clock(), b""
    ended: list[tuple[str, float]] = []
    done = False
    while True:
        patience = math.inf if usual is None else PATIENCE[0] + PATIENCE[1] * usual.get(now, 0.0)
        if now and clock() - since > patience:
            return "timeout", now, ended
        if clock() - first > seconds or time.monotonic() - begun > IDLE * seconds:
            return "budget", now, ended
        if not select.select([pipe], [], [], 0.5)[0]:
            continue
        if not (piece := os.read(pipe, 1 << 16)):
            # A child that ends before it says so has crashed.
            return ("passed", "", ended) if done else ("killed", now or "crash", ended)
        kept += piece
        *lines, kept = kept.split(b"\n")
        for line in lines:
            match json.loads(line):
                case ["start", str(test)]:
                    now, since = test, clock()
                case ["end", str(test), float(took)]:
                    ended.append((test, took))
                    now = ""
                case ["fail", str(test)]:
                    return "killed", test, ended
                case ["done"]:
                    done = True
                case other:
                    raise RuntimeError(f"a child says {other}")


def run_tests(
    scratch: Path,
    groups: Sequence[Sequence[str]],
    usual: dict[str, float] | None,
    seconds: float,
    slow: bool = False,
) -> tuple[str, str, list[tuple[str, float]]]:
    """Run groups of tests (each of one file; if slow, files), one after the other, until one fails;
    see `in_child`.
    """

    def work(pipe: int) -> None:
        plugin = Plugin(pipe)
        for ids in groups:
            _pytest(plugin, ids, slow)
            if plugin.failed:
                return
        plugin.say("done")

    return in_child(scratch, work, usual, seconds)


def map_file(scratch: Path, file: str) -> dict[str, Any]:
    """Run one test file and see which tests run which lines: {"seconds": {test: s}, "lines":
    {source: {line: tests}}}.

    A line of a traced function counts for the test that has it traced first; other tests of the
    file may depend on it.
    """
    target = scratch.with_suffix(".lines.json")
    target.unlink(missing_ok=True)

    def work(pipe: int) -> None:
        # By name: a type checker takes `benchmarks/paint/coverage.py` for the package.
        coverage = importlib.import_module("coverage")

        # Byte code of files as they are serves every mutant.
        sys.dont_write_bytecode = False
        cover = coverage.Coverage(data_file=None, config_file=False, source=["src", "fitting"])
        cover.start()
        plugin = Plugin(pipe, cover)
        import pytest

        folder = f"--basetemp={scratch.with_suffix('.tmp')}"
        options = [
            "-q",
            "--tb=short",
            "--no-header",
            folder,
            "-p",
            "no:cacheprovider",
            "-m",
            "not slow",
        ]
        plugin_failures: list[str] = []
        say = plugin.say
        # Failing tests are noted here and do not end the file.
        plugin.say = lambda *words: (
            plugin_failures.append(str(words[1])) if words[0] == "fail" else say(*words)
        )
        if pytest.main([*options, file], plugins=[plugin]) not in ENDED:
            raise RuntimeError(f"pytest does not run {file}")
        cover.stop()
        data = cover.get_data()
        lines: dict[str, dict[int, list[str]]] = {}
        for path in data.measured_files():
            name = str(Path(path).relative_to(scratch))
            by_line = {
                line: [t for t in tests if t]
                for line, tests in data.contexts_by_lineno(path).items()
            }
            lines[name] = {line: tests for line, tests in by_line.items() if tests}
        target.write_text(json.dumps({"failed": plugin_failures, "lines": lines}))
        say("done")

    begun = time.monotonic()
    outcome, test, ended = in_child(scratch, work, None, 900.0)
    told = json.loads(target.read_text()) if target.exists() else {"failed": [test], "lines": {}}
    good = {name: took for name, took in ended if name not in told["failed"]}
    return {
        "outcome": outcome,
        "failed": told["failed"],
        "seconds": good,
        "lines": {
            source: {line: [t for t in tests if t in good] for line, tests in by_line.items()}
            for source, by_line in told["lines"].items()
            if by_line
        },
        "took": time.monotonic() - begun,
    }
