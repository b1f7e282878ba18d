"""Write the numbers of `benchmarks/results` into README and docs, wherever a mark stands behind a
number.

    python -m benchmarks.fill [--check]

A mark is a comment that no reader sees, with the name of a figure (`python -m benchmarks.figures`
prints them all):

    It takes 0.6<!--scaling.million_seconds--> s, more exactly 0.62<!--scaling.million_seconds
    .2f--> s.

The words after the name are another style than the figure's own. A number that is written .62 keeps
its missing 0. Code is left alone. Each number that changes is told; `--check` changes nothing, and
its exit status is 1 if one would.
"""

import argparse
import re
from collections.abc import Callable
from pathlib import Path

from benchmarks import figures
from benchmarks.results import FOLDER, HERE

# What the site's build writes.
MADE = {"_build", "project", "reference", "results"}
_FENCE = r"^ *(?P<fence>`{3,}|~{3,}).*?^ *(?P=fence)"
_QUOTED = r"(?P<ticks>`+)(?:(?!\n\s*\n).)+?(?P=ticks)(?!`)"
_NUMBER = r"(?<![\w.])(?:\d[\d,]*(?:\.\d+)?|\.\d+)(?:e-?\d+)?"
_COMMENT = r"<!-- *(?P<name>[^\s>]+?)(?: +(?P<style>[^\s>]+?))? *-->"
_MARK = rf"(?P<number>{_NUMBER}){_COMMENT}|<!-- *(?P<bare>\w+\.\w+)[^>]*-->"
_CODE_OR_MARK = re.compile(f"{_FENCE}|{_QUOTED}|{_MARK}", re.MULTILINE | re.DOTALL)


def documents(root: Path = HERE.parent) -> list[Path]:
    """README and the pages of docs."""
    pages = sorted((root / "docs").rglob("*.md"))
    return [
        root / "README.md",
        *(page for page in pages if not MADE & set(page.relative_to(root / "docs").parts)),
    ]


def with_marks(text: str, put: Callable[[re.Match[str]], str]) -> str:
    """A text with something put for each number and its mark.

    Args:
        text: in Markdown.
        put: from a match with the groups `number`, `name` and `style` to what stands there then.

    Raises:
        ValueError: no number stands before a mark.
    """

    def one(match: re.Match[str]) -> str:
        if match["bare"]:
            raise ValueError(f"line {line_of(match)}: no number stands before the mark {match[0]}")
        return put(match) if match["number"] else match[0]

    return _CODE_OR_MARK.sub(one, text)


def line_of(match: re.Match[str]) -> int:
    """In which line of its text a match begins."""
    return match.string.count("\n", 0, match.start()) + 1


def filled(text: str, folder: Path = FOLDER) -> tuple[str, list[str]]:
    """A text with its numbers as the results have them, and for each that changed: name, before ->
    now.

    Raises:
        ValueError: a mark names no figure or has no number before it, or a result does not hold the
            figure.
    """
    changes = []

    def put(match: re.Match[str]) -> str:
        before = match["number"]
        try:
            now = figures.figure(match["name"], folder, match["style"])
        except ValueError as error:
            raise ValueError(f"line {line_of(match)}: {error}") from None
        if before.startswith("."):
            now = now.removeprefix("0")
        if now != before:
            changes.append(f"{match['name']}: {before} -> {now}")
        return match[0].replace(before, now, 1)

    return with_marks(text, put), changes


def fill(root: Path = HERE.parent, folder: Path = FOLDER, *, write: bool = True) -> list[str]:
    """Fill all documents of a folder; a line for each number that was stale.

    Raises:
        ValueError: as `filled`; then nothing is written.
    """
    told, changed = [], {}
    for page in documents(root):
        name = page.relative_to(root).as_posix()
        before = page.read_text("utf-8")
        try:
            now, changes = filled(before, folder)
        except ValueError as error:
            raise ValueError(f"{name}, {error}") from None
        told += [f"{name}: {change}" for change in changes]
        if now != before:
            changed[page] = now
    if write:
        for page, text in changed.items():
            page.write_text(text, "utf-8")
    return told


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--check", action="store_true", help="write nothing; exit status 1 if a number is stale"
    )
    options = parser.parse_args()
    try:
        stale = fill(write=not options.check)
    except ValueError as error:
        raise SystemExit(str(error)) from None
    print("\n".join(stale) or "every marked number is that of its result")
    if stale and options.check:
        raise SystemExit(1)


if __name__ == "__main__":
    main()
