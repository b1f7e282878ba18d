"""Imports follow ARCHITECTURE.md: every arrow is on the page, every arrow there is used, no file is
in a circle.
"""

import ast
import functools
import re
from collections.abc import Iterable, Mapping
from graphlib import CycleError, TopologicalSorter

import pytest

from .rooms import (
    BY_NAME,
    HERE,
    MODULES,
    PACKAGES,
    arrows,
    asked_for,
    called,
    chosen,
    imports,
)

FILES = {name: path for name, path in MODULES.items() if name.split(".")[0] in PACKAGES}


@functools.cache
def nodes() -> list[tuple[str, ast.AST]]:
    """Syntax of all files with the module of each node; read when a test asks for it."""
    return [
        (module, node)
        for module, path in FILES.items()
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
    ]


def _allowed() -> dict[str, set[str]]:
    page = (HERE / "ARCHITECTURE.md").read_text(encoding="utf-8")
    blocks = re.findall(r"```rooms\n(.*?)```", page, re.DOTALL)
    rooms = {}
    for line in "".join(blocks).splitlines():
        left, _, right = line.partition("->")
        room = left.split()[0]
        package = room.split(".")[0]
        full = {name if name == "glazejax" else f"{package}.{name}" for name in right.split()}
        rooms[room] = full
    return rooms


def _shown(room: str) -> set[str]:
    """What a room imports, as the page says it: the inverse package may use all of the forward one."""
    if room.startswith("glazejax"):
        return set(arrows()[room])
    return {"glazejax" if other.startswith("glazejax") else other for other in arrows()[room]}


def test_every_room_is_on_the_page():
    assert set(arrows()) == set(_allowed())


@pytest.mark.parametrize("room", sorted(_allowed()))
def test_a_room_imports_what_the_page_says(room: str):
    assert _shown(room) == _allowed()[room]


def _graph() -> dict[str, frozenset[str]]:
    """Files that each file imports. A lazy package is a door: whoever asks it for a name imports the
    file that defines it, so that the door itself stands above all that it names.
    """
    doors = {module for module, path in FILES.items() if path.with_suffix(".pyi").is_file()}
    return {module: (imports(module) & FILES.keys()) - doors - {module} for module in FILES}


def _circle(graph: Mapping[str, Iterable[str]]) -> str:
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return " -> ".join(error.args[1])
    return ""


def test_no_file_is_in_a_circle():
    assert _circle(_graph()) == ""


def test_no_room_is_in_a_circle():
    assert _circle(arrows()) == ""


def test_a_change_asks_for_the_tests_of_its_room():
    """Helpers that start a program which imports them again are in the walk, too."""
    tests = [module for module in MODULES if ".test_" in module]
    reasons = chosen(tests, ["src/glazejax/radiative/rough/lobes.py"], 0)
    assert "tests.radiative.test_rough" in reasons["what changed"]
    assert "tests.studio.test_server" not in reasons["what changed"]


def test_imports_by_name_say_the_name():
    """Only the worker of the studio is told what to import: by the entry points of what is
    installed.
    """
    silent = [
        module
        for module, node in nodes()
        if isinstance(node, ast.Call) and called(node) in BY_NAME and not asked_for(node, module)
    ]
    assert silent == ["glazejax.studio.worker"]


def test_forward_never_imports_inverse():
    """But for the door `glazejax.fit`, which is for users: no file goes through it."""
    forward = [m for m in FILES if m.startswith("glazejax")]
    wrong = [m for m in forward if any(o.startswith("glazefit") for o in imports(m))]
    assert wrong == ["glazejax"]


# What takes any number of like things.
_OF_ANY_NUMBER = {"fingerprint", "plain_table", "pack"}


def test_records_and_functions_of_many_arguments_are_called_by_keyword():
    """Two arrays of one shape that change places are a wrong answer without a sign."""
    calls = [
        f"{module}:{node.lineno} {called(node)}"
        for module, node in nodes()
        if isinstance(node, ast.Call) and len(node.args) > 6 and called(node) not in _OF_ANY_NUMBER
    ]
    assert calls == []
