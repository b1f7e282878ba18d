"""Imports follow ARCHITECTURE.md: every arrow is on the page, every arrow there is used, no file is
in a circle.
"""

import ast
import functools
import re
from collections import defaultdict
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

HERE = Path(__file__).parents[1]
PACKAGES = {"glazejax": HERE / "src" / "glazejax", "glazefit": HERE / "fitting" / "glazefit"}


def _modules() -> dict[str, Path]:
    found = {}
    for package, folder in PACKAGES.items():
        for path in sorted(folder.rglob("*.py")):
            parts = path.relative_to(folder).with_suffix("").parts
            found[".".join((package, *(part for part in parts if part != "__init__")))] = path
    return found


MODULES = _modules()


@functools.cache
def _imports(module: str) -> frozenset[str]:
    """Modules of ours that a module imports anywhere in its text, also for types only."""
    return frozenset(_imported(module))


def _imported(module: str) -> Iterator[str]:
    path = MODULES[module]
    package = module.split(".") if path.name == "__init__.py" else module.split(".")[:-1]
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in MODULES)
        elif isinstance(node, ast.ImportFrom):
            above = package[: len(package) - node.level + 1] if node.level else []
            source = ".".join([*above, *([node.module] if node.module else [])])
            if source.split(".")[0] in PACKAGES:
                for alias in node.names:
                    inner = f"{source}.{alias.name}"
                    yield inner if inner in MODULES else source


def _room(module: str) -> str:
    """Folder of a module; files on top of `glazejax` are rooms of their own."""
    if MODULES[module].name == "__init__.py" or module.count(".") == 1:
        return module
    return module.rpartition(".")[0]


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


@functools.cache
def _arrows() -> dict[str, set[str]]:
    arrows: dict[str, set[str]] = defaultdict(set)
    for module in MODULES:
        room = _room(module)
        if room in PACKAGES:
            continue
        for other in map(_room, _imports(module)):
            # The inverse package may use all of the forward one.
            seen = (
                "glazejax"
                if room.startswith("glazefit") and other.startswith("glazejax")
                else other
            )
            if seen != room:
                arrows[room].add(seen)
    return arrows


def test_every_room_is_on_the_page():
    rooms = {_room(module) for module in MODULES} - set(PACKAGES)
    assert rooms == set(_allowed())


@pytest.mark.parametrize("room", sorted(_allowed()))
def test_a_room_imports_what_the_page_says(room: str):
    assert _arrows()[room] == _allowed()[room]


def test_no_file_is_in_a_circle():
    graph = {module: {other for other in _imports(module) if other != module} for module in MODULES}
    # A package's own __init__ names what is below it; importing a name from it is no arrow to the
    # file itself.
    graph = {
        m: {o for o in others if MODULES[o].name != "__init__.py"} for m, others in graph.items()
    }
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        pytest.fail(" -> ".join(error.args[1]))


def test_forward_never_imports_inverse():
    wrong = [
        m
        for m in MODULES
        if m.startswith("glazejax") and any(o.startswith("glazefit") for o in _imports(m))
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
    for node in ast.walk(ast.parse(MODULES[module].read_text(encoding="utf-8"))):
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
    calls = [call for module in MODULES for call in _positional_calls(module)]
    assert [where for name, where in calls if name not in _OF_ANY_NUMBER] == []
