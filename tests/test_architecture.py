"""Imports follow ARCHITECTURE.md: every arrow is on the page, every arrow there is used, no file is
in a circle.
"""

import ast
import re
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter

import pytest

from .rooms import HERE, MODULES, PACKAGES, arrows, imports

FILES = {name: path for name, path in MODULES.items() if name.split(".")[0] in PACKAGES}


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


def test_no_file_is_in_a_circle():
    graph = {module: {o for o in imports(module) if o != module and o in FILES} for module in FILES}
    # A package's own __init__ names what is below it; importing a name from it is no arrow to the
    # file itself.
    graph = {
        m: {o for o in others if FILES[o].name != "__init__.py"} for m, others in graph.items()
    }
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        pytest.fail(" -> ".join(error.args[1]))


def test_forward_never_imports_inverse():
    wrong = [
        m
        for m in FILES
        if m.startswith("glazejax") and any(o.startswith("glazefit") for o in imports(m))
    ]
    assert wrong == []


def test_ways_through_name_files_that_exist():
    page = (HERE / "ARCHITECTURE.md").read_text(encoding="utf-8")
    table = page[page.index("| step |") : page.index("Each inverse room")]
    rooms = {"recover": "recover", "identify": "identify", "recipe": "recipe", "render": "commands"}
    header, _, *rows = [line.strip("| ").split("|") for line in table.strip().splitlines()]
    for row in rows:
        for title, cell in zip(header[1:], row[1:], strict=True):
            room = rooms[title.strip(" `").split()[-1]]
            for name in re.findall(r"`([\w/]+\.py)`", cell):
                places = [
                    folder / part / name for folder in PACKAGES.values() for part in ("", room)
                ]
                assert any(place.is_file() for place in places), f"{title}: {name}"


def _positional_calls(module: str) -> Iterator[tuple[str, str]]:
    """Calls with more than six positional arguments, and the names of what is called."""
    for node in ast.walk(ast.parse(FILES[module].read_text(encoding="utf-8"))):
        if isinstance(node, ast.Call) and len(node.args) > 6:
            name = (
                node.func.attr
                if isinstance(node.func, ast.Attribute)
                else getattr(node.func, "id", "")
            )
            yield name, f"{module}:{node.lineno} {name}"


# What takes any number of like things.
_OF_ANY_NUMBER = {"fingerprint", "plain_table", "pack"}


def test_records_and_functions_of_many_arguments_are_called_by_keyword():
    """Two arrays of one shape that change places are a wrong answer without a sign."""
    calls = [call for module in FILES for call in _positional_calls(module)]
    assert [where for name, where in calls if name not in _OF_ANY_NUMBER] == []
