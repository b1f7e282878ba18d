"""Numbers in Markdown that stand beside a link to `benchmarks/results`, and whether a figure by name backs each."""

import functools
import re
from collections.abc import Iterable, Iterator
from typing import NamedTuple

from benchmarks import figures
from benchmarks.results import FOLDER

_LINK = re.compile(r"benchmarks/results/(\w+)\.(?:txt|png)|python -m benchmarks\.(\w+)")
_DIGITS = r"(?:\d[\d,]*(?:\.\d+)?|\.\d+)(?:e-?\d+)?"
# A unit is that of both ends of a range: 18-41 %, 84 to 91 %.
_NUMBER = re.compile(rf"(?<![\w.])({_DIGITS})(?!\w)(?=(?:(?:-| to ){_DIGITS})?,? ?(%|µs|ms|s|GiB|MB|times)?(?!\w))")
_HIDDEN = (
    re.compile(r"\{result\}`[^`]+`"),  # a figure by name: the site's build puts it in
    re.compile(r"`[^`]*`"),
    re.compile(r"!\[[^\]]*\]\([^)]*\)"),
    re.compile(r"\]\([^)]*\)"),
    re.compile(r"<!--.*?-->"),
)


class Block(NamedTuple):
    """A paragraph, a point of a list or a row of a table.

    results: linked in it; if none is, in the last block that links any, below the same heading. A link in a row of a
        table is for this row alone.
    """

    text: str
    results: frozenset[str]


def blocks(markdown: str, *, all_of_them: bool = False) -> Iterator[Block]:
    """Blocks of a document that stand beside results, in order; or all, some of them with no results."""
    before: frozenset[str] = frozenset()
    for piece in re.split(r"\n\s*\n|\n(?=#|\||- |\d\. )", re.sub(r"(?ms)^```.*?^```", "", markdown)):
        text = " ".join(piece.split())
        if text.startswith("#"):
            before = frozenset()
            continue
        linked = frozenset(name for pair in _LINK.findall(text) for name in pair if (FOLDER / f"{name}.txt").is_file())
        if linked or before or all_of_them:
            yield Block(text, linked or before)
        # A row of a table stands for itself.
        if linked and not text.startswith("|"):
            before = linked


class Quoted(NamedTuple):
    """A number in the text."""

    digits: str
    unit: str  # empty if it has none, or one that no figure has


def quoted(text: str, exempt: Iterable[str]) -> list[Quoted]:
    """Numbers of a block, but for those in code, in links and in what is exempt."""
    for pattern in _HIDDEN:
        text = pattern.sub(" ", text)
    for pattern in exempt:
        text = re.sub(pattern, " ", text)
    return [Quoted(found[1].rstrip(","), found[2] or "") for found in _NUMBER.finditer(text)]


def backing(number: Quoted, results: frozenset[str]) -> str:
    """Name of a figure of these results that is said as the number, or rounds to it, in the same unit; or empty."""
    digits = number.digits.replace(",", "")
    stem, _, power = digits.partition("e")
    half = 0.5 * 10.0 ** (int(power or 0) - len(stem.partition(".")[2]))
    for name in figures.names(*results):
        value, figure = _value(name), figures.of(name)
        same = figure.said(value).replace(",", "") == digits or abs(value - float(digits)) <= half * (1 + 1e-9)
        if same and number.unit in ("", figure.unit):
            return name
    return ""


@functools.cache
def _value(name: str) -> float:
    return figures.value(name)


def unbacked(markdown: str, exempt: Iterable[str] = ()) -> list[str]:
    """Numbers beside results that no figure backs, each with what stands around it."""
    return [
        f"{' '.join(filter(None, number))} in: {block.text[:90]}... ({', '.join(sorted(block.results))})"
        for block in blocks(markdown)
        for number in quoted(block.text, exempt)
        if not backing(number, block.results)
    ]


def beside_nothing(markdown: str, exempt: Iterable[str] = ()) -> list[str]:
    """Numbers of blocks that stand beside no result at all, each with what stands around it."""
    return [
        f"{' '.join(filter(None, number))} in: {block.text[:90]}..."
        for block in blocks(markdown, all_of_them=True)
        if not block.results
        for number in quoted(block.text, exempt)
    ]
