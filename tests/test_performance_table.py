"""`python -m benchmarks.performance`: one table of results, that of the page, and its results made
anew.
"""

import os
import re
import signal
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import pytest
from benchmarks import fill, performance, performance_run
from benchmarks import results as heads
from benchmarks.performance import LINES, on_page, page_table, report, standing
from benchmarks.performance_lines import Line
from benchmarks.results import FOLDER

ROOT = Path(__file__).parents[1]
NEWER = "made 2026-11-25 at commit 1a2b3c4 by python -m benchmarks.scaling; glazejax 0.1.0"
OLDER = "made 2026-11-22 or before, kept at commit 9a8b7c6, by python -m benchmarks.savings"
MACHINE = "x86_64, {}, 2 cores; Python 3.11.7, jax 0.9.2"
STACKS = "1000000   2000   812   1000   500\n"
PICTURE = "seconds: 0.50, the first time 9.0\npixel by pixel it would take 57 s (from 9), 114 times as long"

TABLE = (
    Line(
        result="scaling",
        what="a million stacks",
        time="{scaling.million_seconds .2f} s",
        no_error="none is measured",
        no_peer="none was timed",
    ),
    Line(
        result="scaling",
        what="the same in single precision",
        time="{scaling.million_single} s",
        no_error="none is measured",
        peer="double precision",
        peer_time="{scaling.million_seconds .2f} s",
        ratio="{scaling.million_single_times}",
    ),
    Line(
        result="savings",
        what="a picture",
        time="{savings.picture} s",
        error="ΔE00 {savings.delta_e_most} at most",
        peer="pixel by pixel",
        peer_time="{savings.pixel_by_pixel} s",
        ratio="{savings.times}",
    ),
)


def results(folder, **texts):
    for name, text in texts.items():
        (folder / f"{name}.txt").write_text(text)
    return folder


def rows(folder, lines=TABLE):
    """Cells of the table's lines."""
    table = "\n".join(report(folder, lines)).partition("what is computed")[2].splitlines()[1:]
    return [re.split(r" {2,}", line.strip()) for line in table[: len(lines)]]


def made(machine="A", load=""):
    return f"{NEWER}\n{MACHINE.format(machine).replace('cores;', f'cores{load};')}\n\n{STACKS}"


def test_the_committed_table_is_that_of_the_committed_results():
    text = (FOLDER / "performance.txt").read_text().splitlines()[3:]
    assert text == report(FOLDER), "python -m benchmarks.performance writes it anew"
    page = performance.PAGE.read_text("utf-8")
    assert page_table() in page, "python -m benchmarks.performance writes it into the page"
    assert on_page(page) == page


def test_no_number_stands_twice_on_the_page():
    names: list[str] = []
    fill.with_marks(
        performance.PAGE.read_text("utf-8"), lambda mark: names.append(mark["name"]) or mark[0]
    )
    assert names
    assert not [name for name, count in Counter(names).items() if count > 1]


def test_numbers_of_a_line_are_of_its_result():
    for line in LINES:
        words = " ".join((line.time, line.error, line.peer, line.peer_time, line.ratio))
        used = {match["name"] for match in performance._NUMBER.finditer(words)}
        assert {name.partition(".")[0] for name in used} == {line.result}
        assert words.count("{") == len(performance._NUMBER.findall(words)), words
        assert bool(line.error) != bool(line.no_error), line.what
        assert bool(line.peer) != bool(line.no_peer), line.what
        assert bool(line.peer) == bool(line.peer_time) == bool(line.ratio), line.what


def test_a_table_of_one_run(tmp_path):
    folder = results(tmp_path, scaling=made())
    assert standing(folder, TABLE[:2]) == [
        "All lines are of one commit, 1a2b3c4, and one processor, A."
    ]
    assert rows(folder, TABLE[:2]) == [
        ["a million stacks", "2.00 s", "- (a)", "- (b)", "-", "-", "2026-11-25 1a2b3c4, scaling"],
        [
            "the same in single precision",
            "0.50 s",
            "- (a)",
            "double precision",
            "above",
            "4",
            "2026-11-25 1a2b3c4, scaling",
        ],
    ]
    assert report(folder, TABLE[:2])[-1] == (
        "'-': (a) no error: none is measured; (b) no peer: none was timed."
    )


def test_an_older_result_another_machine_and_a_busy_one_are_named(tmp_path):
    savings = f"{OLDER}\n\n{MACHINE.format('B')}\n{PICTURE}\n"
    folder = results(tmp_path, scaling=made("A", ", load 3.8"), savings=savings)
    assert standing(folder, TABLE) == [
        "The lines are not all of one commit and one processor: there are 2 commits and "
        "2 processors.",
        "Older than the newest, 2026-11-25, by more than a day: savings (2026-11-22).",
        "Most are of A; of B: savings.",
        "Busy when they began (load above 0.7), so that times may be too long: scaling (3.8).",
    ]
    # The result does not hold the error.
    assert rows(folder)[-1][1:] == [
        "0.50 s",
        "ΔE00 ? at most",
        "pixel by pixel",
        "57 s",
        "110",
        "2026-11-22 9a8b7c6, savings",
    ]
    assert report(folder, TABLE)[-1] == "'?': the result does not hold this number."


def test_a_missing_result_is_said(tmp_path):
    folder = results(tmp_path, savings=f"{OLDER}\nmachine and versions were not kept\n{PICTURE}\n")
    assert standing(folder, TABLE)[0] == "Without a result: scaling."
    assert rows(folder)[0] == ["a million stacks", *"?????", "no result scaling"]
    assert standing(tmp_path / "none", TABLE) == ["Without a result: scaling, savings."]


def test_the_page_is_not_written_with_gaps(tmp_path):
    page = performance.PAGE.read_text("utf-8")
    with pytest.raises(ValueError, match=r"the page needs all numbers; not there: frontier: 41"):
        on_page(page, results(tmp_path, scaling=made()))
    with pytest.raises(ValueError, match=r"performance\.md has no place for the table"):
        on_page("# Performance\n")


def test_options_are_those_of_the_first_line(monkeypatch, tmp_path):
    monkeypatch.setattr(performance_run, "FOLDER", tmp_path)
    results(
        tmp_path,
        samplers=NEWER.replace("scaling", "samplers --films 4") + "\n",
        prediction=NEWER.replace("scaling", "prediction") + "\n",
        prediction_readings=NEWER.replace("scaling", "prediction") + "\n",
        cold_start=NEWER.replace("scaling", "cold_start --before old") + "\n",
    )
    names = ["samplers", "prediction", "prediction_readings", "cold_start", "savings"]
    found = performance_run.commands(names, quick=False)
    assert [(path.stem, options, its) for (path, options), its in found.items()] == [
        ("samplers", ("--films", "4"), ["samplers"]),
        ("prediction", (), ["prediction", "prediction_readings"]),
        ("cold_start", (), ["cold_start"]),
        ("savings", (), ["savings"]),
    ]
    assert {options for _, options in performance_run.commands(names, quick=True)} == {("--quick",)}


def test_every_quoted_result_can_be_made_anew():
    """Its benchmark is there, and where it was compared with a commit it says which."""
    names = performance_run.quoted()
    assert {line.result for line in LINES} <= {*names}
    for (_, options), its in performance_run.commands(names, quick=False).items():
        if "--before" in options:
            text = (FOLDER / f"{its[0]}.txt").read_text()
            assert re.search(r"^Before: commit [0-9a-f]+", text, re.MULTILINE), its


def test_before_is_a_checkout_of_the_commit_that_the_result_names(monkeypatch, tmp_path):
    if heads.commit() == "no commit":
        pytest.skip("the history is not here")
    at = heads.git("rev-parse", "--short", "HEAD")
    monkeypatch.setattr(performance_run, "FOLDER", results(tmp_path, one=f"Before: commit {at}."))
    with performance_run.with_checkouts("one", ("--before", "old", "--few")) as words:
        assert words[::2] == ["--before", "--few"]
        assert (Path(words[1]) / "pyproject.toml").is_file()
    assert not Path(words[1]).exists()
    assert words[1] not in heads.git("worktree", "list")
    results(tmp_path, one="nothing")
    with (
        pytest.raises(ValueError, match=r"one\.txt does not say which commit"),
        performance_run.with_checkouts("one", ("--before", "old")),
    ):
        pass


# Stands in for a benchmark: writes its result, fails after that, or goes on for ever.
MADE = '''"""Says {name}."""
# Results(
import os, sys, time
out = sys.argv[sys.argv.index("--out") + 1]
NEEDS = {needs}
open(os.path.join(out, "{name}.txt"), "w").write({head!r} + "\\nx86_64, A, 2 cores, load 3.0\\n")
{after}
'''
AFTER = {
    "broken": "raise SystemExit(3)",
    "endless": "open(os.path.join({out!r}, 'pid'), 'w').write(str(os.getpid())); time.sleep(600)",
}


@pytest.fixture
def package(tmp_path):
    """Makes a package `benchmarks` of these modules, and the code that runs them as ours."""
    folder = tmp_path / "benchmarks"
    folder.mkdir()
    (folder / "__init__.py").touch()

    def make(*names):
        for name in names:
            needs = ("no_such_package",) if name == "needy" else ()
            after = AFTER.get(name, "").format(out=str(tmp_path))
            (folder / f"{name}.py").write_text(
                MADE.format(name=name, needs=needs, head=NEWER, after=after)
            )
        script = tmp_path / "elsewhere" / "run.py"
        script.parent.mkdir()
        script.write_text(
            "import os, sys\n"
            "from pathlib import Path\n"
            "from benchmarks import all as runner, performance_run, results\n"
            f"runner.HERE = Path({str(folder)!r})\n"
            "performance_run.module_of = lambda name: runner.HERE / f'{name}.py'\n"
            "os.environ['PYTHONPATH'] = ''\n"
            f"sys.exit(performance_run.run_all({list(names)!r}, Path({str(tmp_path / 'out')!r}), "
            "patience=0.0, quick=True))\n"
        )
        return subprocess.Popen(
            [sys.executable, str(script)],
            env=os.environ
            | {"PYTHONPATH": os.pathsep.join(map(str, (ROOT, ROOT / "src", ROOT / "fitting")))},
            cwd=script.parent,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )

    return make


def test_what_fails_changes_nothing_and_does_not_stop_the_rest(package, tmp_path):
    results_of = tmp_path / "out"
    results_of.mkdir()
    (results_of / "broken.txt").write_text("as before\n")
    process = package("one", "broken", "needy", "two")
    said, _ = process.communicate(timeout=120)
    assert process.returncode == 1, said
    assert (results_of / "broken.txt").read_text() == "as before\n"
    assert sorted(path.name for path in results_of.iterdir()) == [
        "broken.txt",
        "one.txt",
        "two.txt",
    ]
    assert "one: made: load 3.0; others used the machine: times may be too long\n" in said
    assert re.search(r"^broken: failed: exit status 3; see .*broken\.log$", said, re.MULTILINE)
    assert "needy: left out: no package no_such_package\n" in said
    assert said.endswith("2 of 4 results were made anew\n")


def test_stopped_it_keeps_what_is_made_and_ends_its_child(package, tmp_path):
    process = package("one", "endless", "two")
    until = time.monotonic() + 120
    while not (tmp_path / "pid").exists() or not (tmp_path / "pid").read_text():
        assert time.monotonic() < until
        assert process.poll() is None, process.communicate()[0]
        time.sleep(0.1)
    process.send_signal(signal.SIGINT)
    said, _ = process.communicate(timeout=60)
    assert process.returncode == 130, said
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["one.txt"]
    assert "endless: stopped\nnot reached: two\n1 of 3 results were made anew\n" in said
    with pytest.raises(ProcessLookupError):
        os.kill(int((tmp_path / "pid").read_text()), 0)


def test_it_waits_for_an_idle_machine(monkeypatch):
    loads = iter([3.0, 1.2, 0.5])
    naps = []
    monkeypatch.setattr(os, "getloadavg", lambda: (next(loads), 0.0, 0.0))
    monkeypatch.setattr(time, "sleep", naps.append)
    assert performance_run.idle(600.0) == 0.5
    assert len(naps) == 2
    monkeypatch.setattr(os, "getloadavg", lambda: (3.0, 0.0, 0.0))
    assert performance_run.idle(0.0) == 3.0
    assert len(naps) == 2


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("--only", "savings"), "--quoted and --only choose what --run makes anew"),
        (
            ("--run", "--only", "savngs"),
            "--only savngs: no result of this name is made here; savings",
        ),
    ],
)
def test_a_wrong_call_ends_in_a_sentence(words, sentence, monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["performance.py", *words])
    with pytest.raises(SystemExit) as ended:
        performance.main()
    assert sentence in f"{ended.value} {capsys.readouterr().err}"
