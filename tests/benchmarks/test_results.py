"""Numbers of README and docs are those that the benchmarks recorded."""

import datetime
import importlib.util
import json
from pathlib import Path

import pytest
from benchmarks import performance, results
from benchmarks.fill import documents, filled, with_marks
from benchmarks.results import FOLDER, QUICK_FOLDER, Results, command_line, git, quantity, read


def test_no_number_of_the_texts_is_stale():
    for page in documents():
        text = page.read_text("utf-8")
        assert filled(text) == text, "python -m benchmarks.fill puts it right; read what changed"


def test_the_table_of_performance_states_where_its_numbers_come_from():
    text = performance.PAGE.read_text("utf-8")
    assert performance.refreshed(text) == text, "python -m benchmarks.performance puts it right"


def test_every_result_is_of_full_size_and_of_a_commit_and_command_that_exist():
    names = results.names()
    assert {path.stem for path in FOLDER.glob("*.txt")} == set(names)
    shallow = git("rev-parse", "--is-shallow-repository") != "false"
    for name in names:
        made = read(name)["made"]
        tomorrow = datetime.date.today() + datetime.timedelta(days=1)
        assert datetime.date.fromisoformat(made["date"]) <= tomorrow
        module, *options = made["command"].removeprefix("python -m ").split()
        assert importlib.util.find_spec(module), f"{name}: {module}"
        assert "--quick" not in options
        assert shallow or git("cat-file", "-t", made["commit"].rstrip("+")) == "commit", name


def test_a_recorded_number_is_written_where_its_mark_stands(tmp_path, monkeypatch):
    monkeypatch.setattr("sys.argv", ["scaling.py", "--out", str(tmp_path), "--before", "/a/b"])
    say = Results("scaling", tmp_path)
    say("1000000   1.9 s")
    say.record(million=quantity(1.8964, "s", digits=1), error=quantity(9.1e-10, digits=0, form="e"))
    say.record(times=quantity(546.4, "times", digits=2, form="s", n=5))
    with pytest.raises(ValueError, match="recorded twice: times"):
        say.record(times=quantity(1.0))
    say.save()
    kept = json.loads((tmp_path / "scaling.json").read_text())
    assert kept["values"]["times"] == {
        "value": 546.4,
        "unit": "times",
        "digits": 2,
        "form": "s",
        "n": 5,
    }
    assert kept["made"]["versions"]["jax"]
    assert "--out" not in kept["made"]["command"]
    assert "/a" not in kept["made"]["command"]
    assert kept["made"]["command"] in (tmp_path / "scaling.txt").read_text()
    text = "0.6<!--scaling.million--> s, .62<!--scaling.million .3f-->, 1e1<!--scaling.error-->, 5<!--scaling.times-->"
    assert filled(text, tmp_path) == (
        "1.9<!--scaling.million--> s, 1.896<!--scaling.million .3f-->, "
        "9e-10<!--scaling.error-->, 550<!--scaling.times-->"
    )
    code = "`0.6<!--scaling.million-->`\n```text\n\n0.6<!--scaling.million-->\n```"
    assert filled(code, tmp_path) == code


def test_every_recorded_number_of_a_committed_result_is_quoted():
    quoted = set()
    for page in documents():
        with_marks(page.read_text("utf-8"), lambda mark: quoted.add(mark["name"]) or mark[0])
    recorded = {f"{name}.{key}" for name in results.names() for key in read(name)["values"]}
    assert recorded == quoted


def test_quick_is_small_and_never_takes_the_place_of_a_committed_result(monkeypatch):
    parser = command_line("what it measures", stacks=(1000, 50, "random stacks"))
    quick = parser.parse_args(["--quick"])
    assert (quick.stacks, quick.out) == (50, QUICK_FOLDER)
    chosen = parser.parse_args(["--stacks", "7", "--out", "x", "--quick"])
    assert (chosen.stacks, chosen.out) == (7, Path("x"))
    monkeypatch.setattr("sys.argv", ["scaling.py", "--quick"])
    with pytest.raises(SystemExit, match="--quick does not write to"):
        Results("scaling", FOLDER)
