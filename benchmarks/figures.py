"""Figures by name: each number that README and docs take from `benchmarks/results`, read from its
file.

    python -m benchmarks.figures [NAME ...]

prints them; `python -m benchmarks.fill` writes them into the texts.
`figure("scaling.million_seconds")` is the text that the docs say, `value` the number before
rounding. What stands before the dot is the file of results. The lists are
`benchmarks/figures_optics.py`, `figures_paints.py`, `figures_render.py` and `figures_speed.py`.
"""

import argparse
import difflib
import functools
import importlib
import re
from collections.abc import Callable
from dataclasses import dataclass
from decimal import ROUND_HALF_UP, Decimal
from pathlib import Path

from benchmarks.results import FOLDER

Reader = Callable[[str], float]
_NUMBER = r"[-+]?\.?\d[\d,.]*(?:e[-+]?\d+)?"


@dataclass(frozen=True)
class Figure:
    """How a figure is read and said.

    read: from the text of its result file, the number.
    style: of `format`, such as `.2f`; `2s` is two significant digits of a whole number: 546.4 is
    550.
    unit: that follows it, such as `%` or `times`; empty if it has none.
    """

    read: Reader
    style: str
    unit: str = ""

    def said(self, number: float, style: str | None = None) -> str:
        """The number as text, in another style if one is given. A half goes up, as people round:
        3.55 is 3.6.

        Raises:
            ValueError: there is no such style.
        """
        style = style or self.style
        if not re.fullmatch(r",?\.\d+[fge]|\ds", style):
            raise ValueError(
                f"no style is called {style!r}; there are such as .1f, ,.0f, .2e, .3g and 2s"
            )
        # Twelve digits, so that a half is a half after a division too.
        exact = Decimal(f"{number:.12g}")
        if style.endswith("s"):
            places = Decimal(1).scaleb(exact.adjusted() - int(style[:-1]) + 1)
            return f"{exact.quantize(places, ROUND_HALF_UP):.0f}"
        if style.endswith("f"):
            exact = exact.quantize(
                Decimal(1).scaleb(-int(style.rstrip("f").partition(".")[2])), ROUND_HALF_UP
            )
        return re.sub(r"e\+?(-?)0*(?=\d)", r"e\1", format(exact, style))


def number(text: str) -> float:
    """The first number in a piece of a table: `2.16e+03`, `99,856` and `(62%)` are numbers."""
    found = re.search(_NUMBER, text)
    if not found:
        raise ValueError(f"no number in {text!r}")
    return float(found[0].rstrip(".,").replace(",", ""))


def found(pattern: str, scale: float = 1.0, after: str = "") -> Reader:
    """The number in the one group of a pattern, times `scale`; sought below the words `after`."""

    def read(text: str) -> float:
        match = re.search(pattern, below(text, after), re.MULTILINE)
        if not match:
            raise ValueError(f"nothing like {pattern!r}" + f" below {after!r}" * bool(after))
        return number(match[1]) * scale

    return read


def cell(row: str, column: int, scale: float = 1.0, after: str = "") -> Reader:
    """A table's number: of the first line that begins with the words `row`, piece `column` of what
    follows, from 0.

    Pieces are parted by spaces; a negative column counts from the line's end.
    """

    def read(text: str) -> float:
        for line in below(text, after).splitlines():
            if re.match(rf"{re.escape(row)}(?!\S)", line.strip()):
                pieces = line.strip()[len(row) :].split()
                return number(pieces[column]) * scale
        raise ValueError(f"no line begins with {row!r}" + f" below {after!r}" * bool(after))

    return read


def ratio(over: Reader, under: Reader) -> Reader:
    """One number over another."""
    return lambda text: over(text) / under(text)


def one_over(read: Reader) -> Reader:
    """The inverse of a number."""
    return lambda text: 1.0 / read(text)


def least(*readers: Reader) -> Reader:
    """The smallest of some numbers."""
    return lambda text: min(read(text) for read in readers)


def most(*readers: Reader) -> Reader:
    """The largest of some numbers."""
    return lambda text: max(read(text) for read in readers)


def below(text: str, words: str) -> str:
    """What follows the words, all of the text if there are none.

    Raises:
        ValueError: they are not in it.
    """
    if words not in text:
        raise ValueError(f"the words {words!r} are not in it")
    return text.partition(words)[2] if words else text


def value(name: str, folder: Path = FOLDER) -> float:
    """A figure's number, as the result file has it.

    Raises:
        ValueError: there is no figure of this name, or its file does not hold it.
    """
    result = name.partition(".")[0]
    path = Path(folder) / f"{result}.txt"
    if not path.is_file():
        raise ValueError(f"figure {name}: there is no file {path.name} in {path.parent.name}")
    try:
        return of(name).read(path.read_text())
    except (ValueError, IndexError) as error:
        raise ValueError(f"figure {name}: {path.name} does not hold it: {error}") from None


def figure(name: str, folder: Path = FOLDER, style: str | None = None) -> str:
    """A figure as text, for instance `figure("calibrate_directions.worst")` is `0.82`; in another
    style if given.

    Raises:
        ValueError: as `value`.
    """
    return of(name).said(value(name, folder), style)


def of(name: str) -> Figure:
    """How the figure of this name is read and said.

    Raises:
        ValueError: there is no figure of this name; says which are near.
    """
    listed = _all()
    if name not in listed:
        near = difflib.get_close_matches(name, listed, n=3)
        raise ValueError(
            f"no figure is called {name!r}" + (f"; did you mean {', '.join(near)}?" if near else "")
        )
    return listed[name]


def names(*results: str) -> list[str]:
    """Names of all figures, or of those of some results."""
    return [name for name in _all() if not results or name.partition(".")[0] in results]


_LISTED: dict[str, Figure] = {}


def add(result: str, style: str, **readers: Reader) -> None:
    """Put figures of one result, said in one style, on the list; `.1f s` are seconds.

    Raises:
        ValueError: a name is taken.
    """
    for what, read in readers.items():
        name = f"{result}.{what}"
        if name in _LISTED:
            raise ValueError(f"two figures are called {name}")
        _LISTED[name] = Figure(read, *style.split())


@functools.cache
def _all() -> dict[str, Figure]:
    """The list; the modules that fill it import this one."""
    # Run as a program, this module is a second one.
    listed = importlib.import_module("benchmarks.figures")._LISTED
    for part in ("optics", "paints", "render", "speed"):
        importlib.import_module(f"benchmarks.figures_{part}")
    return listed


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "names", nargs="*", metavar="NAME", help="of figures or of results (default: all)"
    )
    parser.add_argument(
        "--from", dest="folder", type=Path, default=FOLDER, help="folder of results"
    )
    options = parser.parse_args()
    wanted = [n for given in options.names for n in (names(given) or [given])] or names()
    width = max(map(len, wanted))
    try:
        for name in wanted:
            print(f"{name:{width}}  {figure(name, options.folder)} {of(name).unit}".rstrip())
    except ValueError as error:
        raise SystemExit(str(error)) from None


if __name__ == "__main__":
    main()
