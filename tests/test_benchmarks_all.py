"""`python -m benchmarks.all`: names every benchmark, runs each by itself, and ends with a table
whatever happens.
"""

import ast
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from benchmarks import all as runner
from benchmarks import figures
from benchmarks.results import FOLDER, HERE, code_of, declared, modules

ROOT = Path(__file__).parents[1]

# Stands in for a benchmark: a line of a result, or what its name says.
MADE = '''"""Says {name}."""
# Results(
import os, sys, time
NEEDS = {needs}
PARTS_NEED = {parts}
assert "--quick" in sys.argv
out = sys.argv[sys.argv.index("--out") + 1]
{body}
open(os.path.join(out, "{name}.txt"), "w").write("1000000   1900   812   1032   481.8\\n")
{after}
'''
AFTER = {"late": "raise SystemExit('no end')"}
BODIES = {
    "broken": "raise SystemExit(3)",
    "endless": "open(os.path.join(out, 'pid'), 'w').write(str(os.getpid())); time.sleep(600)",
}


def listed(*words):
    return subprocess.run(
        [sys.executable, "-m", "benchmarks.all", *words],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.fixture
def made(tmp_path, monkeypatch):
    """Folder of a package `benchmarks` with modules of these names, which the runner takes for its
    own.
    """
    package = tmp_path / "benchmarks"
    package.mkdir()
    (package / "__init__.py").touch()

    def make(*names, needs=()):
        for name in names:
            given = {"body": BODIES.get(name, ""), "after": AFTER.get(name, "")}
            parts = ("json", "no_such_peer") if name == "parted" else ()
            text = MADE.format(
                name=name, needs=needs if name == "needy" else (), parts=parts, **given
            )
            (package / f"{name}.py").write_text(text)
        monkeypatch.setattr(runner, "HERE", package)
        monkeypatch.setattr(runner, "modules", lambda: [package / f"{name}.py" for name in names])
        monkeypatch.setenv("PYTHONPATH", "")
        return tmp_path / "out"

    return make


def ran(out, *words):
    """Run the command in this process; exit status and the table."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("sys.argv", ["all.py", "--quick", "--out", str(out), *words])
        before = [signal.getsignal(kind) for kind in (signal.SIGINT, signal.SIGTERM)]
        try:
            with pytest.raises(SystemExit) as ended:
                runner.main()
        finally:
            signal.signal(signal.SIGINT, before[0])
            signal.signal(signal.SIGTERM, before[1])
    return ended.value.code, (out / "all.txt").read_text() if out.exists() else ""


def test_the_list_names_every_benchmark():
    done = listed("--list")
    assert done.returncode == 0, done.stderr
    names = [
        line.split()[0]
        for line in done.stdout.splitlines()
        if line and not line.startswith("not run")
    ]
    assert len(names) == len(set(names))
    files = [*HERE.glob("*.py"), *(path.parent for path in HERE.glob("*/__main__.py"))]
    with_a_command = {path.stem for path in files if "\ndef main(" in code_of(path)}
    assert with_a_command == set(names)
    ours, _, others = done.stdout.partition("not run by this")
    for module in modules():
        assert f"\n{module.stem} " in f"\n{ours}", f"{module.stem} writes results and is not run"
        assert f"\n{module.stem} " not in others


def test_what_a_benchmark_needs_is_understood():
    for module in modules():
        for need in (*declared(module, "NEEDS", ()), *declared(module, "PARTS_NEED", ())):
            assert (
                need in ("gpu", "long")
                or need.startswith(("data/", "program/"))
                or need.isidentifier()
            ), module
            assert isinstance(runner.lacks(need), str)


# What is always there: this project, what pyproject.toml depends on, and what comes with another
# package.
PLAIN = {
    "glazejax",
    "glazefit",
    "benchmarks",
    "tests",
    "jax",
    "numpy",
    "scipy",
    "equinox",
    "jaxtyping",
} | {
    "optimistix",
    "colour",
    "emcee",
    "drjit",
}


def imported(path):
    """Packages that a module imports anywhere but for types, of those that may be missing."""
    tree = ast.parse(code_of(path))
    typing = {
        n
        for t in ast.walk(tree)
        if isinstance(t, ast.If) and "TYPE_CHECKING" in ast.dump(t)
        for n in ast.walk(t)
    }
    names = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import) and node not in typing:
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node not in typing and not node.level:
            names.add(node.module or "")
    return {name.partition(".")[0] for name in names} - PLAIN - set(sys.stdlib_module_names)


def test_benchmarks_say_which_packages_they_need():
    """Where one is missing, the benchmark is then left out, or a part of it is, and said."""
    for module in modules():
        said = {*declared(module, "NEEDS", ()), *declared(module, "PARTS_NEED", ())}
        assert not imported(module) - said, f"{module.name}: add these to NEEDS or PARTS_NEED"


def test_every_benchmark_has_a_small_size():
    """By its shared option; a benchmark without a smaller setting than `--quick`'s other folder is
    exempt by name.
    """
    texts = {module.stem: code_of(module) for module in modules()}
    without = {
        n
        for n, text in texts.items()
        if "options.quick" not in text and "add_option(parser, " not in text
    }
    assert without <= {"object_colour_figures", "many_flux_figures"}


def test_each_runs_and_what_fails_does_not_stop_the_rest(made):
    out = made(
        "one",
        "broken",
        "needy",
        "two",
        needs=("no_such_package", "data/none", "program/no-such-program"),
    )
    code, table = ran(out)
    assert code == 1
    rows = {line.split()[0]: line for line in table.splitlines() if line}
    assert rows["one"].endswith("  0")
    assert rows["two"].endswith("  0")
    assert rows["broken"].endswith("  3; see broken.log")
    missing = (
        "no package no_such_package, no measured data none (GLAZEJAX_DATA), no program "
        "no-such-program"
    )
    assert rows["needy"].endswith(f"left out: {missing}")
    assert "\n2 of 4 ran to the end; 1 failed: broken; 1 left out: needy\n" in table
    assert sorted(path.name for path in out.iterdir()) == [
        "all.txt",
        "broken.log",
        "one.log",
        "one.txt",
        "two.log",
        "two.txt",
    ]


def test_left_out_alone_is_no_failure(made):
    code, table = ran(made("one", "needy", needs=("gpu_of_nobody",)))
    assert code == 0
    assert "1 of 2 ran to the end; 1 left out: needy" in table


def test_parts_that_are_left_out_are_said(made):
    code, table = ran(made("parted"))
    assert code == 0
    assert "  0; without parts: no package no_such_peer\n" in table
    assert "1 of 1 ran to the end" in table


def test_what_fails_after_its_result_is_written_runs_again(made):
    out = made("late", "one")
    assert ran(out)[0] == 1
    stamp = (out / "late.txt").stat().st_mtime_ns
    code, table = ran(out, "--resume")
    assert code == 1
    assert (out / "late.txt").stat().st_mtime_ns > stamp
    rows = {line.split()[0]: line for line in table.splitlines() if line}
    assert rows["late"].endswith("  1; see late.log")
    assert rows["one"].endswith("  0, done before")


def test_what_takes_too_long_is_ended(made):
    code, table = ran(made("endless", "one"), "--limit", "2")
    assert code == 1
    assert "limit of 2 s; see endless.log" in table
    assert "\none " in table


def test_what_is_done_is_kept_and_left_out_when_resumed(made):
    out = made("one", "two")
    assert ran(out, "--only", "one")[0] == 0
    assert not (out / "two.txt").exists()
    stamp = (out / "one.txt").stat().st_mtime_ns
    took = (out / "all.txt").read_text().splitlines()[1].split()[1:3]
    code, table = ran(out, "--resume")
    assert code == 0
    row = table.splitlines()[1]
    assert row.startswith("one ")
    assert row.endswith("  0, done before")
    assert row.split()[1:3] == took, "the table tells what it took then"
    assert (out / "two.txt").exists()
    assert (out / "one.txt").stat().st_mtime_ns == stamp
    ran(out, "--only", "one")
    assert (out / "one.txt").stat().st_mtime_ns > stamp


def test_figures_that_are_far_off_are_told(made):
    code, table = ran(made("scaling"))
    assert code == 0
    assert f"scaling.million_seconds {figures.figure('scaling.million_seconds')} -> 1.9" in table
    assert "scaling.million_slopes" not in table
    assert "scaling.million_seconds" not in ran(made("scaling"), "--factor", "40")[1]


def test_stopped_by_a_signal_it_ends_its_child_and_says_what_is_done(made, tmp_path):
    out = made("one", "endless", "two")
    script = tmp_path / "elsewhere" / "stopped.py"
    script.parent.mkdir()
    script.write_text(
        # As under nohup: SIGINT ignored from the start.
        "import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)\n"
        "import sys; from pathlib import Path; from benchmarks import all as runner\n"
        f"package = Path({str(tmp_path / 'benchmarks')!r}); runner.HERE = package\n"
        "runner.modules = lambda: [package / f'{n}.py' for n in ('one', 'endless', 'two')]\n"
        f"sys.argv = ['all.py', '--quick', '--out', {str(out)!r}]; runner.main()\n"
    )
    paths = [str(ROOT), str(ROOT / "src"), str(ROOT / "fitting")]
    process = subprocess.Popen(
        [sys.executable, str(script)],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(paths)},
        cwd=script.parent,
        stdout=subprocess.PIPE,
        text=True,
    )
    until = time.monotonic() + 60
    while not (out / "pid").exists() or not (out / "pid").read_text():
        assert time.monotonic() < until
        assert process.poll() is None
        time.sleep(0.1)
    process.send_signal(signal.SIGTERM)
    said, _ = process.communicate(timeout=30)
    assert process.returncode == 130
    table = (out / "all.txt").read_text()
    rows = {line.split()[0]: line for line in table.splitlines() if line}
    assert rows["one"].endswith("  0")
    assert "stopped; see endless.log" in rows["endless"]
    assert "two" not in rows
    assert (
        "1 of 3 ran to the end; 1 stopped: endless; 1 not reached: two (--resume goes on from "
        "there)" in table
    )
    assert "stopped; see endless.log" in said
    with pytest.raises(ProcessLookupError):
        os.kill(int((out / "pid").read_text()), 0)


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ((), "say --quick, --list or --older"),
        (
            ("--quick", "--out", str(FOLDER)),
            "the committed results are of full size; choose another folder",
        ),
        (("--quick", "--only", "frontire"), "--only frontire: no such benchmark; frontier?"),
    ],
)
def test_a_wrong_call_ends_in_a_sentence(words, sentence):
    done = listed(*words)
    assert done.returncode != 0
    assert sentence in done.stderr
    assert "Traceback" not in done.stderr
