"""Every result says when, by what and at which revision it was made, and none is behind the code that makes it."""

import argparse
import datetime
import re
from pathlib import Path

import pytest
from benchmarks import results
from benchmarks.results import FOLDER, QUICK_FOLDER, Results, add_option, declared, head, module_of, modules

ROOT = Path(__file__).parents[1]
NAMES = sorted(path.stem for path in FOLDER.glob("*.txt"))
# What README quotes is of today's revision; what only docs quote, or nobody, may be one behind.
QUOTED = set(re.findall(r"benchmarks/results/(\w+)\.txt", (ROOT / "README.md").read_text()))
BEHIND = 1


@pytest.mark.parametrize("name", NAMES)
def test_a_result_has_a_head(name):
    read = head(name)
    assert datetime.date.fromisoformat(read.date) <= datetime.date.today() + datetime.timedelta(days=1)
    assert read.command.split()[:3] == ["python", "-m", f"benchmarks.{module_of(name).stem}"]
    assert "--quick" not in read.command, "a result of small size is not committed"
    # What was made since heads are kept has all of it.
    assert read.machine or (
        not read.made and "machine and versions were not kept" in (FOLDER / f"{name}.txt").read_text()
    )


@pytest.mark.parametrize("name", NAMES)
def test_a_result_is_not_behind_its_code(name):
    module, allowed = module_of(name), 0 if name in QUOTED else BEHIND
    now, made = declared(module, "REVISION"), head(name).revision
    assert made <= now, f"{name}.txt is of revision {made}, and {module.name} of {now} only"
    assert now - made <= allowed, (
        f"{name}.txt is of revision {made}, {module.name} is at {now}: run `{head(name).command}` again, "
        f"commit what it writes, then change the text"
    )


@pytest.mark.parametrize("module", modules(), ids=lambda path: path.stem)
def test_a_benchmark_has_a_revision_and_a_result(module):
    assert isinstance(declared(module, "REVISION"), int), f"{module.name} needs a line `REVISION = 1` below its imports"
    made = [name for name in NAMES if module_of(name) == module]
    excuse = declared(module, "NO_RESULT", "")
    assert bool(made) != bool(excuse), f"{module.stem}: committed {made}, excused by NO_RESULT: {excuse!r}"


def test_what_readme_quotes_is_there():
    assert not QUOTED - set(NAMES)
    assert len(QUOTED) > 8


def test_a_result_without_a_module_or_a_head_is_told(tmp_path):
    (tmp_path / "frontier.txt").write_text("Run time against error\n")
    with pytest.raises(ValueError, match=r"frontier\.txt has no head: run `python -m benchmarks\.frontier` again"):
        head("frontier", tmp_path)
    with pytest.raises(ValueError, match="no module of benchmarks makes the result 'nothing'"):
        module_of("nothing")
    with pytest.raises(ValueError, match=r"there is no result nothing\.txt in"):
        head("nothing")


@pytest.mark.parametrize(
    ("result", "module"),
    [("scaling_gpu", "scaling"), ("painting_rivals", "painting_rivals"), ("mutation_77", "mutation")],
)
def test_a_result_belongs_to_the_longest_name_that_begins_it(result, module):
    assert module_of(result).stem == module


def test_what_is_written_has_a_head_that_reads(tmp_path, monkeypatch, capsys):
    given = ["tubes.py", "--paints", "5", "--before", "/home/somebody/checkout", "--out", str(tmp_path)]
    monkeypatch.setattr("sys.argv", given)
    say = Results("tubes", tmp_path, "numpy", "not-installed-anywhere")
    say("a line")
    say.save()
    read = head("tubes", tmp_path)
    assert read.made
    assert read.command == "python -m benchmarks.tubes --paints 5 --before checkout"
    assert read.revision == declared(module_of("tubes"), "REVISION")
    assert re.search(r"\d cores, load \d+\.\d; Python 3\.\d+\.\d+, jax \S+, numpy \S+$", read.machine)
    text = (tmp_path / "tubes.txt").read_text()
    assert text.splitlines()[2:] == ["", "a line"]
    assert text in capsys.readouterr().out


def options(*words):
    parser = argparse.ArgumentParser()
    parser.add_argument("--stacks", type=int, default=1000)
    add_option(parser, stacks=50)
    return parser.parse_args(words)


def test_quick_is_small_and_goes_elsewhere():
    assert (options().stacks, options().out, options().quick) == (1000, FOLDER, False)
    assert (options("--quick").stacks, options("--quick").out, options("--quick").quick) == (50, QUICK_FOLDER, True)
    for words in (("--quick", "--stacks", "7", "--out", "x"), ("--stacks", "7", "--out", "x", "--quick")):
        assert (options(*words).stacks, options(*words).out) == (7, Path("x"))


def test_a_small_result_says_that_it_is_small(tmp_path, monkeypatch):
    monkeypatch.setattr("sys.argv", ["tubes.py", "--quick", "--out", str(tmp_path)])
    say = Results("tubes", tmp_path)
    say("a line")
    say.save()
    lines = (tmp_path / "tubes.txt").read_text().splitlines()
    assert lines[3].startswith("Small size (--quick)")
    assert lines[5:] == ["a line"]
    assert head("tubes", tmp_path).revision == declared(module_of("tubes"), "REVISION")


def test_quick_never_takes_the_place_of_a_committed_result(monkeypatch):
    monkeypatch.setattr("sys.argv", ["tubes.py", "--quick", "--out", str(results.FOLDER)])
    with pytest.raises(SystemExit, match="--quick does not write to"):
        Results("tubes", options("--quick", "--out", str(results.FOLDER)).out)
