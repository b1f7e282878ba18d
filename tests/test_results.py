"""Every result says when, at which commit and by what it was made; small ones never take the place
of these.
"""

import argparse
import datetime
import re
import subprocess
from pathlib import Path

import pytest
from benchmarks import older, results
from benchmarks.results import (
    FOLDER,
    QUICK_FOLDER,
    Results,
    add_option,
    commit,
    declared,
    git,
    head,
    module_of,
    modules,
)

NAMES = sorted(path.stem for path in FOLDER.glob("*.txt"))


def test_every_result_has_a_head():
    for name in NAMES:
        read = head(name)
        assert datetime.date.fromisoformat(read.date) <= datetime.date.today() + datetime.timedelta(
            days=1
        ), name
        assert read.command.split()[:3] == ["python", "-m", f"benchmarks.{module_of(name).stem}"]
        assert "--quick" not in read.command, f"{name}: a result of small size is not committed"
        assert read.commit, f"{name}: it was made outside of git"


def test_the_commit_of_every_result_exists():
    if git("rev-parse", "--is-shallow-repository") != "false" or commit() == "no commit":
        pytest.skip("the history is not here")
    assert not [name for name in NAMES if older.changes(head(name).commit) is None]


def test_a_benchmark_has_a_result_or_an_excuse():
    made = {module_of(name) for name in NAMES}
    for module in modules():
        excuse = declared(module, "NO_RESULT", "")
        assert (module in made) != bool(excuse), f"{module.stem}: excused by NO_RESULT: {excuse!r}"


def test_a_result_without_a_module_or_a_head_is_told(tmp_path):
    (tmp_path / "frontier.txt").write_text("Run time against error\n")
    with pytest.raises(
        ValueError, match=r"frontier\.txt has no head: run `python -m benchmarks\.frontier` again"
    ):
        head("frontier", tmp_path)
    with pytest.raises(ValueError, match="no module of benchmarks makes the result 'nothing'"):
        module_of("nothing")
    with pytest.raises(ValueError, match=r"there is no result nothing\.txt in"):
        head("nothing")


@pytest.mark.parametrize(
    ("result", "module"),
    [
        ("scaling_gpu", "scaling"),
        ("painting_rivals", "painting_rivals"),
    ],
)
def test_a_result_belongs_to_the_longest_name_that_begins_it(result, module):
    assert module_of(result).stem == module


def test_what_is_written_has_a_head_that_reads(tmp_path, monkeypatch, capsys):
    given = [
        "tubes.py",
        "--paints",
        "5",
        "--before",
        "/home/somebody/checkout",
        "--out",
        str(tmp_path),
    ]
    monkeypatch.setattr("sys.argv", given)
    say = Results("tubes", tmp_path, "numpy", "not-installed-anywhere")
    say("a line")
    say.save()
    read = head("tubes", tmp_path)
    assert read.date == str(datetime.date.today())
    assert read.commit == commit().removesuffix(" with changes").rpartition(" ")[2].replace(
        "commit", ""
    )
    assert read.command == "python -m benchmarks.tubes --paints 5 --before checkout"
    text = (tmp_path / "tubes.txt").read_text()
    assert f" at {commit()} by python" in text
    _, machine, *lines = text.splitlines()
    assert re.search(r"\d cores, load \d+\.\d; Python 3\.\d+\.\d+, jax \S+, numpy \S+$", machine)
    assert lines == ["", "a line"]
    assert text in capsys.readouterr().out


def options(*words):
    parser = argparse.ArgumentParser()
    parser.add_argument("--stacks", type=int, default=1000)
    add_option(parser, stacks=50)
    return parser.parse_args(words)


def test_quick_is_small_and_goes_elsewhere():
    assert (options().stacks, options().out, options().quick) == (1000, FOLDER, False)
    assert (options("--quick").stacks, options("--quick").out, options("--quick").quick) == (
        50,
        QUICK_FOLDER,
        True,
    )
    for words in (
        ("--quick", "--stacks", "7", "--out", "x"),
        ("--stacks", "7", "--out", "x", "--quick"),
    ):
        assert (options(*words).stacks, options(*words).out) == (7, Path("x"))


def test_a_small_result_says_that_it_is_small(tmp_path, monkeypatch):
    monkeypatch.setattr("sys.argv", ["tubes.py", "--quick", "--out", str(tmp_path)])
    say = Results("tubes", tmp_path)
    say("a line")
    say.save()
    lines = (tmp_path / "tubes.txt").read_text().splitlines()
    assert lines[3].startswith("Small size (--quick)")
    assert lines[5:] == ["a line"]
    assert head("tubes", tmp_path).command.endswith("--quick")


def test_quick_never_takes_the_place_of_a_committed_result(monkeypatch):
    monkeypatch.setattr("sys.argv", ["tubes.py", "--quick", "--out", str(results.FOLDER)])
    with pytest.raises(SystemExit, match="--quick does not write to"):
        Results("tubes", options("--quick", "--out", str(results.FOLDER)).out)


@pytest.mark.parametrize(
    ("begin", "commit"),
    [
        ("made 2026-11-23 at commit 1a2b3c4 by", "1a2b3c4"),
        ("made 2026-11-23 at commit 1a2b3c4 with changes by", "1a2b3c4"),
        ("made 2026-11-23 at no commit by", ""),
        ("made 2026-11-23, kept at commit 1a2b3c4, by", "1a2b3c4"),
        ("made 2026-11-22 or before, kept at commit 1a2b3c4, by", "1a2b3c4"),
    ],
)
def test_heads_of_all_ages_are_read(tmp_path, begin, commit):
    for end in ("", "; glazejax 0.1.0"):
        (tmp_path / "tubes.txt").write_text(f"{begin} python -m benchmarks.tubes --paints 5{end}\n")
        read = head("tubes", tmp_path)
        assert (read.commit, read.command) == (commit, "python -m benchmarks.tubes --paints 5")


@pytest.fixture
def repository(tmp_path, monkeypatch):
    """A history of its own: writes these files into it, commits them, and gives the commit."""
    if not git("--version"):
        pytest.skip("git is not installed")

    def changed(files: dict[str, str]) -> str:
        for name, text in files.items():
            path = tmp_path / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
        subprocess.run(["git", "add", "-A"], cwd=tmp_path, check=True)
        author = ["-c", "user.name=a", "-c", "user.email=a@b"]
        subprocess.run(["git", *author, "commit", "-qm", "a change"], cwd=tmp_path, check=True)
        return git("rev-parse", "--short", "HEAD")

    subprocess.run(["git", "init", "-q"], cwd=tmp_path, check=True)
    monkeypatch.setattr(results, "HERE", tmp_path / "benchmarks")
    monkeypatch.setattr(older, "FOLDER", tmp_path / "benchmarks" / "results")
    monkeypatch.setattr(older, "ROOT", tmp_path)
    older.changes.cache_clear()
    yield changed
    older.changes.cache_clear()


def test_results_older_than_what_they_measure_are_listed(repository):
    assert (
        older.table()
        == "this copy of the code has no history (git), so it cannot tell which results are older"
    )
    measures = "import glazejax as gj\nfrom benchmarks import helper\ngj.solve()\nResults()"
    code = {
        "benchmarks/results.py": "",
        "benchmarks/speed.py": measures,
        "benchmarks/still.py": "Results()",
        "benchmarks/helper.py": "from glazejax.paint import Paint",
        "src/glazejax/__init__.py": "",
        "src/glazejax/__init__.pyi": "from .solver.stack import solve as solve",
        "src/glazejax/solver/stack.py": "",
        "src/glazejax/paint/__init__.py": "",
        "src/glazejax/other/part.py": "",
    }
    begin = repository(code)
    assert commit() == f"commit {begin}"
    heads = {
        f"benchmarks/results/{name}.txt": f"made 2026-11-23 at commit {begin} by x"
        for name in ("speed", "still")
    }
    repository(
        heads | {"benchmarks/results/speed_gpu.txt": "made 2026-11-23 at commit 0123456 by x"}
    )
    repository({"src/glazejax/solver/stack.py": "1", "src/glazejax/paint/__init__.py": "1"})
    repository(
        {
            "src/glazejax/solver/stack.py": "2",
            "benchmarks/speed.py": measures + "  # again",
            "README.md": "words",
        }
    )
    repository({"src/glazejax/other/part.py": "1", "src/glazejax/solver/deeper/part.py": "1"})
    told = older.table()
    rooms = "glazejax.solver 2, benchmarks.speed 1, glazejax.paint 1"
    assert re.search(rf"^speed +{begin}  2026-11-23 +2  {rooms}$", told, re.MULTILINE)
    assert told.endswith(
        "\n\nnothing changed since: still\n\nno commit of this history made: speed_gpu"
    )
    (results.HERE / "speed.py").write_text("changed")
    assert commit().endswith(" with changes")


@pytest.mark.parametrize(
    ("module", "names", "where"),
    [
        ("glazejax", ["stack_reflectance_factor"], "glazejax.radiative.stack"),
        ("glazejax", ["catalogue", "load"], "glazejax.catalogue"),
        ("glazejax", ["radiative", "manyflux"], "glazejax.radiative.manyflux"),
        ("glazejax.colour", ["lab"], "glazejax.colour"),
        ("glazefit", ["read_films"], "glazefit.film.readers"),
        ("glazejax", ["__version__"], "glazejax"),
    ],
)
def test_names_of_lazy_packages_lead_to_their_rooms(module, names, where):
    assert older.home(module, names) == where
