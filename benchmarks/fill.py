"""Write the numbers of `benchmarks/results/*.json` into README and docs, where a mark follows a number.

    python -m benchmarks.fill [--check]

A mark is a comment that no reader sees, the name of a result, a dot and the name of its value:

    It takes 0.6<!--scaling.million_seconds--> s, more exactly 0.62<!--scaling.million_seconds
    .2f--> s.

The words after the name are another style than the value's own: `.1f`, `,.0f`, `.2e`, `.3g`, or `2s`,
two significant digits of a whole number. A number written .62 keeps its missing 0. Code is left
alone. `--check` changes nothing; its exit status is 1 if a number is stale.
"""

import re
from collections.abc import Callable
from pathlib import Path

from benchmarks.results import FOLDER, HERE, figure, help_parser

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
    written = [page for page in pages if not MADE & set(page.relative_to(root / "docs").parts)]
    return [root / "README.md", *written]


def with_marks(text: str, put: Callable[[re.Match[str]], str]) -> str:
    """A Markdown text in which `put` replaces each number with its mark; the match has the groups
    `number`, `name` and `style`.

    Raises:
        ValueError: no number stands before a mark.
    """

    def replace(match: re.Match[str]) -> str:
        if match["bare"]:
            line = text.count("\n", 0, match.start()) + 1
            raise ValueError(f"line {line}: no number stands before the mark {match[0]}")
        return put(match) if match["number"] else match[0]

    return _CODE_OR_MARK.sub(replace, text)


def filled(text: str, folder: Path = FOLDER) -> str:
    """A text with its numbers as the results have them.

    Raises:
        ValueError: a mark names no value, or has no number before it.
    """

    def put(match: re.Match[str]) -> str:
        number = figure(match["name"], match["style"], folder)
        if match["number"].startswith("."):
            number = number.removeprefix("0")
        return match[0].replace(match["number"], number, 1)

    return with_marks(text, put)


def main() -> None:
    parser = help_parser(__doc__)
    parser.add_argument(
        "--check", action="store_true", help="write nothing; exit status 1 if a number is stale"
    )
    check = parser.parse_args().check
    stale = False
    for page in documents():
        before = page.read_text("utf-8")
        try:
            after = filled(before)
        except ValueError as error:
            raise SystemExit(f"{page.relative_to(HERE.parent)}, {error}") from None
        for old, new in zip(before.splitlines(), after.splitlines(), strict=True):
            if old != new:
                stale = True
                print(f"{page.relative_to(HERE.parent)}:\n- {old}\n+ {new}")
        if not check:
            page.write_text(after, "utf-8")
    if not stale:
        print("every marked number is that of its result")
    raise SystemExit(int(stale and check))


if __name__ == "__main__":
    main()
