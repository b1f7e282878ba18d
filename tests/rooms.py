"""The rooms of ARCHITECTURE.md as the files import each other, and the tests that a change asks
for.

`python -m tests.rooms` prints the files of slow and optimised tests that `.ci/run` takes: of the
rooms that changed, then of the rooms that import these, then of one more room, another with each
commit. `python -m tests.rooms --since` prints the commit that changes are counted from.
"""

import ast
import fnmatch
import functools
import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator
from importlib.util import resolve_name
from pathlib import Path

HERE = Path(__file__).parents[1]
PACKAGES = {"glazejax": HERE / "src" / "glazejax", "glazefit": HERE / "fitting" / "glazefit"}
FOLDERS = {**PACKAGES, "tests": HERE / "tests", "benchmarks": HERE / "benchmarks"}
MODULES = {
    ".".join((package, *path.relative_to(folder).with_suffix("").parts)).removesuffix(
        ".__init__"
    ): path
    for package, folder in FOLDERS.items()
    for path in sorted(folder.rglob("*.py"))
}
"""Path of each module by its dotted name."""
PUBLIC = {
    f"{package}.{alias.name}": ".".join(filter(None, (package, node.module, alias.name)))
    for package, path in MODULES.items()
    if (stub := path.with_suffix(".pyi")).is_file()
    for node in ast.parse(stub.read_text(encoding="utf-8")).body
    if isinstance(node, ast.ImportFrom)
    for alias in node.names
} | {"glazejax.fit": "glazefit"}
"""What each name of a lazy package stands for: `glazejax.paint.media.Glaze` for `glazejax.Glaze`."""
BY_NAME = {"import_module", "__import__", "run_module"}
"""Functions that import a module by its name."""


def module_of(name: str) -> str:
    """Module that defines a dotted name, through the lazy packages on the way; empty for others'."""
    parts = name.split(".")
    for end in range(len(parts), 0, -1):
        start = ".".join(parts[:end])
        # A module that has the name of what it defines is meant by what follows.
        through = PUBLIC.get(start, start) if end == len(parts) or start not in MODULES else start
        if through != start:
            return module_of(".".join([through, *parts[end:]]))
        if start in MODULES:
            return start
    return ""


@functools.cache
def imports(module: str) -> frozenset[str]:
    """Modules of the project that a module imports anywhere in its text: also for types only, in a
    function, and by name.
    """
    inside = MODULES[module].name == "__init__.py"
    package = module if inside else module.rpartition(".")[0]
    tree = ast.parse(MODULES[module].read_text(encoding="utf-8"))
    return frozenset(map(module_of, _imported(package, tree))) - {""}


def _imported(package: str, tree: ast.AST) -> Iterator[str]:
    """Dotted names that a file of a package asks for."""
    names: dict[str, str] = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                names[alias.asname or alias.name.split(".")[0]] = (
                    alias.name if alias.asname else alias.name.split(".")[0]
                )
                yield alias.name
        elif isinstance(node, ast.ImportFrom):
            source = resolve_name("." * node.level + (node.module or ""), package)
            for alias in node.names:
                names[alias.asname or alias.name] = f"{source}.{alias.name}"
                yield f"{source}.{alias.name}"
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute):
            root, _, rest = _dotted(node).partition(".")
            if root in names:
                yield f"{names[root]}.{rest}"
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            # The name of a module, or of what is in it as entry points have it. The packages around
            # a file are where its data lie.
            name = node.value.partition(":")[0]
            if "." in name and name in MODULES and not f"{package}.".startswith(f"{name}."):
                yield name
        elif isinstance(node, ast.Call) and called(node) in BY_NAME:
            yield from fnmatch.filter(MODULES, asked_for(node, package))


def _dotted(node: ast.AST) -> str:
    """`glazejax.io.read_spectra` as it stands in a text; empty for what begins otherwise."""
    if isinstance(node, ast.Attribute):
        return f"{before}.{node.attr}" if (before := _dotted(node.value)) else ""
    return node.id if isinstance(node, ast.Name) else ""


def called(node: ast.Call) -> str:
    """Last name of the function that is called."""
    return getattr(node.func, "attr", "") or getattr(node.func, "id", "")


def asked_for(node: ast.Call, package: str) -> str:
    """Pattern of the modules that a call imports by name; empty where the text does not say."""
    name = node.args[0] if node.args else None
    parts = name.values if isinstance(name, ast.JoinedStr) else [name]
    pattern = "".join(str(part.value) if isinstance(part, ast.Constant) else "*" for part in parts)
    return "" if pattern == "*" else resolve_name(pattern, package)


def room_of(module: str) -> str:
    """Folder of a module; files on top of `glazejax` are rooms of their own."""
    if MODULES[module].name == "__init__.py" or module.count(".") == 1:
        return module
    return module.rpartition(".")[0]


@functools.cache
def arrows() -> dict[str, frozenset[str]]:
    """Rooms that each room imports."""
    rooms: dict[str, set[str]] = {}
    for module in MODULES:
        if module.split(".")[0] in PACKAGES and room_of(module) not in PACKAGES:
            rooms.setdefault(room_of(module), set()).update(map(room_of, imports(module)))
    return {room: frozenset(others & rooms.keys() - {room}) for room, others in rooms.items()}


def _reached(start: str, following: Callable[[str], Iterable[str]]) -> frozenset[str]:
    """What a walk comes to, its start too, also where it comes to a place again."""
    reached = {start}
    while more := {other for each in reached for other in following(each)} - reached:
        reached |= more
    return frozenset(reached)


@functools.cache
def beneath(room: str) -> frozenset[str]:
    """Rooms that a room stands on, itself or by others."""
    return _reached(room, lambda each: arrows()[each])


@functools.cache
def used(test: str) -> frozenset[str]:
    """A test's module, and what it and its helpers import. A helper may name itself, in a program
    for another Python say.
    """
    return _reached(test, lambda each: imports(each) if each.startswith("tests.") else ())


def rooms_of(test: str) -> set[str]:
    """Rooms that a test is of: those of its imports that no other of its imports stands on."""
    rooms = {room_of(module) for module in used(test)} & arrows().keys()
    return {
        room
        for room in rooms
        if all(room not in beneath(other) or other in beneath(room) for other in rooms)
    }


def room_at(path: str) -> str:
    """Room of a file of either package, of data too; nothing for any other file."""
    for package, folder in PACKAGES.items():
        if (HERE / path).is_relative_to(folder):
            parts = [package, *(HERE / path).relative_to(folder).with_suffix("").parts]
            while parts and ".".join(parts) not in arrows():
                parts.pop()
            return ".".join(parts)
    return ""


def chosen(tests: list[str], changed: list[str], count: int) -> dict[str, list[str]]:
    """Tests that changed files and a commit's count ask for, each under its first reason."""
    files = {HERE / path for path in changed}
    helpers = {
        m for m, path in MODULES.items() if path in files and m.split(".")[0] not in PACKAGES
    }
    rooms = {room_at(path) for path in changed} - {""}
    above = {room for room, others in arrows().items() if others & rooms}
    # What is of no room, a test of a program in the browser say, has a turn too.
    of = {test: rooms_of(test) or {"no room"} for test in tests}
    turns = sorted(set().union(*of.values()))
    turn = turns[count % len(turns)]
    reasons = {test: f"the turn of {turn}" for test in tests if turn in of[test]}
    reasons |= {test: "rooms that import what changed" for test in tests if of[test] & above}
    reasons |= {test: "what changed" for test in tests if used(test) & helpers or of[test] & rooms}
    return {
        reason: [test for test in tests if reasons.get(test) == reason]
        for reason in ("what changed", "rooms that import what changed", f"the turn of {turn}")
    }


def since() -> str:
    """The last merge of `main`: GLAZEJAX_SINCE, or where this work left `origin/main`; in a clone
    of the work itself, the newest commit that was half a day old when the last one was made. With
    none of them, in a shallow clone say, the empty tree, from which every file differs.
    """
    git = functools.partial(_git, HERE)
    head = git("rev-parse", "HEAD")
    left = git("merge-base", "HEAD", "origin/main")
    before = int(git("log", "-1", "--format=%ct")) - 12 * 3600
    return (
        os.environ.get("GLAZEJAX_SINCE")
        or (left if left != head else "")
        or git("log", "-1", "--first-parent", "--format=%H", f"--until={before}")
        or git("hash-object", "-t", "tree", "/dev/null")
    )


def _git(folder: Path, *words: str) -> str:
    done = subprocess.run(["git", *words], cwd=folder, capture_output=True, text=True, check=False)
    return done.stdout.strip()


def main() -> None:
    """Print paths of tests, and why they are taken among the errors; or the commit."""
    if "--since" in sys.argv:
        print(since())
        return
    slow = re.compile(r"mark\.(slow|optimised)")
    tests = [m for m in MODULES if ".test_" in m and slow.search(MODULES[m].read_text("utf-8"))]
    changed = _git(HERE, "diff", "--name-only", since()).splitlines()
    count = int(_git(HERE, "rev-list", "--count", "HEAD"))
    for reason, group in chosen(tests, changed, count).items():
        print(f"slow tests of {reason}: {len(group)} files", file=sys.stderr)
        for test in group:
            print(MODULES[test].relative_to(HERE).as_posix())


if __name__ == "__main__":
    main()
