"""What takes how long, with what error, beside whom: one table of the results of other benchmarks.

    python -m benchmarks.performance [--out FOLDER]
    python -m benchmarks.performance --run [--quoted] [--only NAME ...] [--patience SECONDS] [--quick]

Reads the results in FOLDER and writes `performance.txt` beside them; from the committed ones also
the table of `docs/performance.md`. Above it stands whether all lines are of one commit and one
processor, and which are not. `--run` makes these results anew first, each in a process of its own,
with the options that its result's first line names, and waits for an idle machine before each.
`--quoted` makes all results that README and docs quote. A result takes the place of the former one
when its benchmark has ended well; what fails or is stopped changes nothing
(`benchmarks/performance_run.py`).
"""

import argparse
import re
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import date, timedelta
from pathlib import Path

from benchmarks import figures, performance_run
from benchmarks.performance_lines import LINES, Line
from benchmarks.results import FOLDER, HERE, Head, Results, add_option, head

PAGE = HERE.parent / "docs" / "performance.md"
# The table stands between these in the page.
BEGIN = "<!-- table: made by python -m benchmarks.performance, not by hand -->"
END = "<!-- end of the table -->"
TITLES = ("what is computed", "time", "error", "beside", "its time", "ratio", "made")
_NUMBER = re.compile(r"\{(?P<name>\w+\.\w+)(?: (?P<style>\S+))?\}")
# What stands where a result lacks a number, and where the table has it already.
LACKING, ABOVE = "?", "above"

Put = Callable[[str, str | None, Path], str]


@dataclass(frozen=True)
class Row:
    """Cells of a line as text, in the order of TITLES."""

    line: Line
    cells: tuple[str, ...]


def plain(name: str, style: str | None, folder: Path) -> str:
    """A figure as text."""
    return figures.figure(name, folder, style)


def marked(name: str, style: str | None, folder: Path) -> str:
    """A figure with the mark that `benchmarks.fill` reads."""
    return f"{plain(name, style, folder)}<!--{name}{f' {style}' if style else ''}-->"


def heads(folder: Path, lines: Iterable[Line] = LINES) -> dict[str, Head | None]:
    """Head of each result of the lines; None if it is not there or has none."""
    found: dict[str, Head | None] = {}
    for line in lines:
        try:
            found[line.result] = head(line.result, folder)
        except ValueError:
            found[line.result] = None
    return found


def reasons(lines: Iterable[Line] = LINES) -> dict[str, str]:
    """A letter for each reason why a line has no error or no peer."""
    told = dict.fromkeys(
        words
        for line in lines
        for words in (
            line.no_error and f"no error: {line.no_error}",
            line.no_peer and f"no peer: {line.no_peer}",
        )
        if words
    )
    return {words: chr(ord("a") + number) for number, words in enumerate(told)}


def rows(
    folder: Path,
    put: Put,
    made: Callable[[str, Head], str],
    lines: Sequence[Line] = LINES,
) -> Iterator[Row]:
    """Each line of the table as text.

    Args:
        folder: of the results.
        put: writes a figure.
        made: writes where and when a result was made, from its name and head.
        lines: of the table.
    """
    letters, known, told = reasons(lines), heads(folder, lines), set[str]()

    def text(words: str) -> str:
        def number(match: re.Match[str]) -> str:
            try:
                return put(match["name"], match["style"], folder)
            except ValueError:
                return LACKING

        return _NUMBER.sub(number, words)

    def once(words: str) -> str:
        """A time or an error, unless the table has it already."""
        said = ABOVE if words in told else text(words)
        told.add(words)
        return said

    for line in lines:
        its = known[line.result]
        if its is None:
            yield Row(line, (line.what, *[LACKING] * 5, f"no result {line.result}"))
            continue
        time = once(line.time)
        error = once(line.error) if line.error else f"- ({letters[f'no error: {line.no_error}']})"
        if line.peer:
            peer = (text(line.peer), once(line.peer_time), text(line.ratio))
        else:
            peer = (f"- ({letters[f'no peer: {line.no_peer}']})", "-", "-")
        yield Row(line, (line.what, time, error, *peer, made(line.result, its)))


def notes(lines: Iterable[Line] = LINES) -> str:
    """What the letters mean."""
    return "; ".join(f"({letter}) {words}" for words, letter in reasons(lines).items()) + "."


def standing(folder: Path, lines: Sequence[Line] = LINES) -> list[str]:
    """Sentences: whether all lines are of one commit and one processor, and which are not."""
    known = heads(folder, lines)
    there = {name: its for name, its in known.items() if its is not None}
    said = []
    if missing := [name for name, its in known.items() if its is None]:
        said.append(f"Without a result: {', '.join(missing)}.")
    if not there:
        return said
    commits = {its.commit or "none" for its in there.values()}
    machines = Counter(its.processor for its in there.values() if its.processor)
    newest = max(its.date for its in there.values())
    one_machine = len(machines) == 1 and all(its.processor for its in there.values())
    if len(commits) == 1 and one_machine:
        said.append(
            f"All lines are of one commit, {commits.pop()}, and one processor, {usual(machines)}."
        )
    else:
        said.append(
            "The lines are not all of one commit and one processor: there are "
            f"{_many(len(commits), 'commit')} and {_many(len(machines), 'processor')}."
        )
    # A run may last over midnight.
    since = (date.fromisoformat(newest) - timedelta(days=1)).isoformat()
    if older := [f"{name} ({its.date})" for name, its in there.items() if its.date < since]:
        said.append(f"Older than the newest, {newest}, by more than a day: {', '.join(older)}.")
    others: dict[str, list[str]] = {}
    for name, its in there.items():
        if its.processor != usual(machines):
            others.setdefault(its.processor or "none that was kept", []).append(name)
    for machine, names in others.items():
        said.append(f"Most are of {usual(machines)}; of {machine}: {', '.join(names)}.")
    if busy := [
        f"{name} ({its.load:.1f})"
        for name, its in there.items()
        if its.load is not None and its.load > performance_run.BUSY
    ]:
        said.append(
            f"Busy when they began (load above {performance_run.BUSY}), so that times may be too "
            f"long: {', '.join(busy)}."
        )
    return said


def _many(count: int, what: str) -> str:
    return f"{count} {what}{'s' * (count != 1)}"


def usual(machines: Counter[str]) -> str:
    """The processor of most results; of equally many the first by name."""
    return min(machines, key=lambda name: (-machines[name], name), default="not kept")


def report(folder: Path, lines: Sequence[Line] = LINES) -> list[str]:
    """The table as plain text, with what is said above and below it."""
    made = [
        row.cells
        for row in rows(folder, plain, lambda name, its: f"{its.date} {_at(its)}, {name}", lines)
    ]
    widths = [max(map(len, column)) for column in zip(TITLES, *made, strict=True)]
    right = {1, 4, 5}
    table = [
        "  ".join(
            cell.rjust(width) if k in right else cell.ljust(width)
            for k, (cell, width) in enumerate(zip(cells, widths, strict=True))
        ).rstrip()
        for cells in (TITLES, *made)
    ]
    below = ["", "ratio: its time over ours, below 1 where it is faster.", f"'-': {notes(lines)}"]
    if any(LACKING in cell.split() for cells in made for cell in cells):
        below.append(f"'{LACKING}': the result does not hold this number.")
    return [*standing(folder, lines), "", *table, *below]


def _at(its: Head) -> str:
    return its.commit or "no commit"


def page_table(folder: Path = FOLDER) -> str:
    """The table in Markdown, with marks, and what is said above and below it."""

    def made(name: str, its: Head) -> str:
        return f"[{its.date}, {_at(its)}](../benchmarks/results/{name}.txt)"

    lines = [f"| {' | '.join(TITLES)} |", "|---" * len(TITLES) + "|"]
    lines += [f"| {' | '.join(row.cells)} |" for row in rows(folder, marked, made)]
    return "\n".join(
        [BEGIN, *standing(folder), "", *lines, "", f"Where '-' stands: {notes()}", END]
    )


def on_page(text: str, folder: Path = FOLDER) -> str:
    """The page's text with the table as the results have it.

    Raises:
        ValueError: a result or a number of it is missing, or the page has no place for the table.
    """
    if BEGIN not in text or END not in text:
        raise ValueError(f"{PAGE.name} has no place for the table: {BEGIN} ... {END}")
    faults = [
        f"{row.line.result}: {row.line.what}"
        for row in rows(folder, plain, lambda name, its: name)
        if LACKING in " ".join(row.cells).split()
    ]
    if faults:
        raise ValueError(f"the page needs all numbers; not there: {'; '.join(faults)}")
    before, _, rest = text.partition(BEGIN)
    return before + page_table(folder) + rest.partition(END)[2]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add_option(parser, patience=0.0)
    parser.add_argument("--run", action="store_true", help="make the results anew first")
    parser.add_argument(
        "--quoted", action="store_true", help="with --run: all that README and docs quote"
    )
    parser.add_argument("--only", nargs="+", metavar="NAME", help="with --run: these results")
    parser.add_argument(
        "--patience",
        type=float,
        default=600.0,
        help="with --run: seconds to wait for an idle machine before each (default: %(default)s)",
    )
    options = parser.parse_args()
    if (options.quoted or options.only) and not options.run:
        parser.error("--quoted and --only choose what --run makes anew")
    status = 0
    if options.run:
        quoted = performance_run.quoted() if options.quoted else []
        wanted = [*dict.fromkeys([*(line.result for line in LINES), *quoted])]
        status = performance_run.run_all(
            performance_run.chosen(wanted, options.only),
            options.out,
            patience=options.patience,
            quick=options.quick,
        )
        print()
    say = Results("performance", options.out)
    for line in report(options.out):
        say(line)
    say.save()
    if options.out.resolve() == FOLDER.resolve():
        try:
            now = on_page(PAGE.read_text("utf-8"))
        except ValueError as error:
            raise SystemExit(str(error)) from None
        PAGE.write_text(now, "utf-8")
        print(
            f"the table stands in {PAGE.name}; python -m benchmarks.fill writes the other numbers"
        )
    sys.exit(status)


if __name__ == "__main__":
    main()
