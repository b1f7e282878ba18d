"""Which results are older than what they measure: a list from the history, as a hint where to
measure again.

    python -m benchmarks.all --older

A room is a folder, as in ARCHITECTURE.md; a file on top of a package is a room of its own. Of each
result this counts the commits since its own that changed the benchmark's module, or a room that it
or its helpers here import by name. What those rooms import in turn is not looked at, and a change
need not change a number.
"""

import ast
import functools
import textwrap
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from benchmarks.results import FOLDER, HERE, git, head, module_of

ROOT = HERE.parent
SOURCES = {"glazejax": "src/glazejax", "glazefit": "fitting/glazefit", "benchmarks": "benchmarks"}


def place(module: str) -> Path | None:
    """File of a module of ours, `__init__.py` of a package; None if there is none."""
    package, _, rest = module.partition(".")
    path = ROOT / SOURCES[package] / rest.replace(".", "/")
    files = (path / "__init__.py", path.with_suffix(".py"))
    return next((file for file in files if file.is_file()), None)


def room(path: str) -> str:
    """Room of a file of the repository, by its path there; empty if it is in none."""
    for package, source in SOURCES.items():
        if path.startswith(f"{source}/"):
            *folders, file = path.removeprefix(f"{source}/").split("/")
            inside = ".".join(folders) or Path(file).stem
            return "" if inside == "__init__" else f"{package}.{inside}"
    return ""


def home(module: str, names: list[str]) -> str:
    """The module in which `module.name...` is written; a lazy package's `__init__.pyi` says where
    its names are.
    """
    if not names:
        return module
    inner = f"{module}.{names[0]}"
    if place(inner):
        return home(inner, names[1:])
    file = place(module)
    stub = file.with_suffix(".pyi") if file else None
    for node in ast.parse(stub.read_text("utf-8")).body if stub and stub.is_file() else ():
        if isinstance(node, ast.ImportFrom) and names[0] in [
            alias.asname or alias.name for alias in node.names
        ]:
            above = module.split(".")[: len(module.split(".")) - node.level + 1]
            return home(".".join(above + ([node.module] if node.module else [])), names[:1])
    return module


def imported(path: Path) -> Iterator[tuple[str, list[str]]]:
    """Modules that a file imports, each with the names that it takes from them or looks
    up in them.
    """
    tree = ast.parse(path.read_text("utf-8"))
    called = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module:
            yield from ((node.module, [alias.name]) for alias in node.names)
        elif isinstance(node, ast.Import):
            called |= {alias.asname or alias.name: alias.name for alias in node.names}
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute):
            names = ast.unparse(node).split(".")
            if names[0] in called:
                yield called[names[0]], names[1:]


@functools.cache
def rooms(benchmark: Path) -> frozenset[str]:
    """Rooms that a benchmark and its helpers in this folder import."""
    found: set[str] = set()
    seen: set[Path] = set()
    left = sorted(benchmark.glob("*.py")) if benchmark.is_dir() else [benchmark]
    while left:
        path = left.pop()
        seen.add(path)
        for module, names in imported(path):
            package = module.partition(".")[0]
            file = place(home(module, names)) if package in SOURCES else None
            if file and package == "benchmarks":
                left += [file] * (file not in seen)
            elif file:
                found.add(room(file.relative_to(ROOT).as_posix()))
    return frozenset(found - {""})


@functools.cache
def changes(commit: str) -> list[set[str]] | None:
    """Rooms that each commit since this one changed; None if it is not in the history."""
    if not git("cat-file", "-t", commit):
        return None
    told = git("log", "--no-merges", "--format=%x00", "--name-only", f"{commit}..HEAD")
    return [{room(path) for path in one.splitlines()} for one in told.split("\0")]


def table() -> str:
    """One line a result, those with most changes first; then those without any."""
    if not git("ls-files", "benchmarks/results.py"):
        return (
            "this copy of the code has no history (git), so it cannot tell which results are older"
        )
    rows, same, unknown = [], [], []
    for name in sorted(path.stem for path in FOLDER.glob("*.txt")):
        its, module = head(name, FOLDER), module_of(name)
        since = changes(its.commit) if its.commit else None
        if since is None:
            unknown.append(name)
            continue
        ours = rooms(module) | {f"benchmarks.{module.stem}"}
        by_room = Counter(one for changed in since for one in changed & ours)
        count = sum(bool(changed & ours) for changed in since)
        if count:
            # A room and its number stay in one line.
            told = ", ".join(
                f"{one}\N{NO-BREAK SPACE}{n}"
                for one, n in sorted(by_room.items(), key=lambda pair: (-pair[1], pair[0]))
            )
            rows.append((count, f"{name:<23}{its.commit}  {its.date}{count:>9}  ", told))
        else:
            same.append(name)
    lines = [
        "Commits since each result that changed its benchmark or a room it imports: a hint where "
        "to measure again.",
        "",
    ]
    lines.append(f"{'result':<23}{'commit':<9}{'date':<10}{'commits':>9}  of these by room")
    for _, begin, told in sorted(rows, key=lambda row: (-row[0], row[1])):
        lines += textwrap.wrap(
            begin + told, 120, subsequent_indent=" " * len(begin), break_on_hyphens=False
        )
    for words, names in (
        ("nothing changed since", same),
        ("no commit of this history made", unknown),
    ):
        if names:
            lines += ["", *textwrap.wrap(f"{words}: {', '.join(names)}", 120)]
    return "\n".join(lines).replace("\N{NO-BREAK SPACE}", " ")
