"""The table of `docs/performance.md`: which commit, day and machine each line is from.

    python -m benchmarks.performance [--check]

The lines are written in the page by hand, their numbers filled by `python -m benchmarks.fill`. This
writes each line's last cell, where its numbers come from, and the sentences above the table: whether
all lines are of one commit and one processor, and which are not. All numbers of a line are of one
result. `--check` changes nothing; its exit status is 1 if something is stale.
"""

import re
from collections import Counter
from datetime import date, timedelta
from pathlib import Path

from benchmarks.results import FOLDER, HERE, help_parser, read

PAGE = HERE.parent / "docs" / "performance.md"
BEGIN = "<!-- table: its first lines and last column by python -m benchmarks.performance -->"
END = "<!-- end of the table -->"
# Load average above which others' work shows in the times.
BUSY = 0.7
_RESULT = re.compile(r"<!--(\w+)\.")


def result_of(line: str) -> str:
    """Name of the one result of a line of the table.

    Raises:
        ValueError: there is none, or there are several.
    """
    names = set(_RESULT.findall(line))
    if len(names) != 1:
        raise ValueError(f"one result a line, here {sorted(names)}: {line}")
    return names.pop()


def provenance(heads: dict[str, dict]) -> list[str]:
    """Sentences on the commits, processors and loads of the results.

    Args:
        heads: of each result's name, its `made`.
    """
    commits = {made["commit"] for made in heads.values()}
    machines = Counter(made["machine"] for made in heads.values())
    usual = min(machines, key=lambda machine: (-machines[machine], machine))
    if len(commits) == len(machines) == 1:
        sentences = [f"All lines are of one commit, {commits.pop()}, and one machine, {usual}."]
    else:
        sentences = [f"The lines are of {len(commits)} commits and {len(machines)} machines."]
    newest = max(made["date"] for made in heads.values())
    # A run may last over midnight.
    since = (date.fromisoformat(newest) - timedelta(days=1)).isoformat()
    older = [f"{name} ({made['date']})" for name, made in heads.items() if made["date"] < since]
    if older:
        sentences.append(
            f"Older than the newest, {newest}, by more than a day: {', '.join(older)}."
        )
    others: dict[str, list[str]] = {}
    for name, made in heads.items():
        if made["machine"] != usual:
            others.setdefault(made["machine"] or "an unrecorded machine", []).append(name)
    sentences += [f"Not of {usual}: {', '.join(its)} ({one})." for one, its in others.items()]
    busy = [
        f"{name} ({made['load']:.1f})"
        for name, made in heads.items()
        if made["load"] is not None and made["load"] > BUSY
    ]
    if busy:
        sentences.append(
            f"Times may be too long, because the load was above {BUSY}: {', '.join(busy)}."
        )
    return sentences


def refreshed(text: str, folder: Path = FOLDER) -> str:
    """The page's text with the origin of each line.

    Raises:
        ValueError: the page has no table, or a line has no result.
    """
    if BEGIN not in text or END not in text:
        raise ValueError(f"{PAGE.name} has no place for the table: {BEGIN} ... {END}")
    before, _, rest = text.partition(BEGIN)
    inside, _, after = rest.partition(END)
    titles, rule, *lines = [line for line in inside.splitlines() if line.startswith("|")]
    notes = inside.rpartition("|\n")[2].strip()
    names = [result_of(line) for line in lines]
    heads = {name: read(name, folder)["made"] for name in dict.fromkeys(names)}
    table = [titles, rule]
    for name, line in zip(names, lines, strict=True):
        made = heads[name]
        *cells, _ = line.strip("| ").split(" | ")
        link = f"[{made['date']}, {made['commit']}](../benchmarks/results/{name}.txt)"
        table.append(f"| {' | '.join([*cells, link])} |")
    inner = "\n".join([*provenance(heads), "", *table, "", notes])
    return f"{before}{BEGIN}\n{inner}\n{END}{after}"


def main() -> None:
    parser = help_parser(__doc__)
    parser.add_argument(
        "--check", action="store_true", help="write nothing; exit status 1 if stale"
    )
    check = parser.parse_args().check
    before = PAGE.read_text("utf-8")
    after = refreshed(before)
    if not check:
        PAGE.write_text(after, "utf-8")
    print(
        f"{PAGE.name} is {'as its results state' if before == after else 'stale' if check else 'written'}"
    )
    raise SystemExit(int(check and before != after))


if __name__ == "__main__":
    main()
