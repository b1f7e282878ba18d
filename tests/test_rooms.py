"""Which slow tests a change asks for."""

import subprocess

import pytest

from .rooms import MODULES, chosen, room_at, rooms_of, since

TESTS = [m for m in MODULES if m.startswith(("tests.radiative.test_", "tests.mapping.test_"))]


def test_a_file_is_of_the_nearest_room_above_it():
    assert room_at("src/glazejax/reflectance.py") == "glazejax.reflectance"
    assert room_at("src/glazejax/radiative/stack.py") == "glazejax.radiative"
    assert room_at("src/glazejax/studio/page/solver.js") == "glazejax.studio"
    assert room_at("fitting/glazefit/mapping/store/gone.py") == "glazefit.mapping.store"
    assert room_at("src/glazejax/py.typed") == room_at("docs/method.md") == ""


def test_a_test_is_of_the_highest_rooms_that_it_imports():
    assert rooms_of("tests.radiative.test_phase") == {"glazejax.radiative.common"}
    # By a name of the package: `from glazejax import stack_reflectance_factor`.
    assert rooms_of("tests.radiative.test_layers") == {"glazejax.radiative"}
    assert rooms_of("tests.studio.test_solver") == set()


def test_a_room_that_changed_asks_for_its_tests_and_then_for_those_of_rooms_that_import_it():
    groups = chosen(TESTS, ["src/glazejax/radiative/manyflux/field.py"], 0)
    assert "tests.radiative.test_manyflux_field" in groups["what changed"]
    assert "tests.radiative.test_stack" in groups["rooms that import what changed"]
    taken = [test for group in groups.values() for test in group]
    assert len(taken) == len(set(taken))
    # `plan` imports `radiative`, and not what `radiative` imports.
    assert "tests.radiative.test_plan" not in taken


def test_a_test_or_its_helper_that_changed_asks_for_the_test():
    files = ["tests/mapping/toy.py", "tests/radiative/test_plan.py", "benchmarks/peers/ours.py"]
    taken = chosen(TESTS, files, 0)["what changed"]
    assert "tests.mapping.test_cluster" in taken
    assert "tests.radiative.test_plan" in taken
    assert "tests.radiative.test_tolerance_kept" in taken
    assert "tests.radiative.test_stack" not in taken


def test_texts_ask_for_nothing_but_the_turn_which_comes_to_every_test():
    came = set()
    for count in range(100):
        groups = chosen(TESTS, ["README.md", "docs/method.md"], count)
        assert [bool(group) for group in groups.values()] == [False, False, True]
        came |= {test for group in groups.values() for test in group}
    assert came == set(TESTS)


@pytest.fixture
def history(tmp_path, monkeypatch):
    """A repository of three commits: of one day, of the next, and of an hour later; a function that
    runs git there.
    """
    monkeypatch.delenv("GLAZEJAX_SINCE", raising=False)

    def git(*words, **variables):
        for name, value in variables.items():
            monkeypatch.setenv(name, value)
        words = ["git", "-c", "user.name=a", "-c", "user.email=a@b", *words]
        return subprocess.run(
            words, cwd=tmp_path, capture_output=True, text=True, check=True
        ).stdout.strip()

    git("init", "-q")
    for time in ("01 10:00", "02 10:00", "02 11:00"):
        git("commit", "-q", "--allow-empty", "-m", time, GIT_COMMITTER_DATE=f"2026-01-{time} +0000")
    return git


def test_work_is_counted_from_what_was_half_a_day_old(history, tmp_path):
    assert since(tmp_path) == history("rev-parse", "HEAD~2")
    # A clone of the work has it as its `main`, which says nothing.
    history("update-ref", "refs/remotes/origin/main", "HEAD")
    assert since(tmp_path) == history("rev-parse", "HEAD~2")


def test_work_is_counted_from_where_it_left_main_or_from_what_is_said(
    history, tmp_path, monkeypatch
):
    history("update-ref", "refs/remotes/origin/main", "HEAD~1")
    assert since(tmp_path) == history("rev-parse", "HEAD~1")
    monkeypatch.setenv("GLAZEJAX_SINCE", "HEAD~3")
    assert since(tmp_path) == "HEAD~3"


def test_without_any_earlier_commit_every_file_differs(history, tmp_path):
    history("checkout", "-q", "--orphan", "first")
    history("commit", "-q", "--allow-empty", "-m", "first")
    assert since(tmp_path) == history("hash-object", "-t", "tree", "/dev/null")
