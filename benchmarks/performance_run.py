"""Results made anew, one benchmark after another, each in a process of its own, on an idle machine.

See `benchmarks.performance --run`.
"""

import contextlib
import difflib
import math
import os
import re
import shlex
import shutil
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from benchmarks import all as runner
from benchmarks import fill
from benchmarks.results import FOLDER, git, head, module_of, progress

# Load average above which others' work shows in the times.
BUSY = 0.7
# Options in place of those in the result's first line: what was compared with there is not needed,
# what lay in a folder of that machine is made in a temporary one, and the table that ships stays.
OPTIONS: dict[str, tuple[str, ...]] = {
    "cold_start": (),
    "painting": (),
    "acrylics": ("--table", str(Path(tempfile.gettempdir()) / "acrylics.csv")),
}


class Outcome(NamedTuple):
    """What became of one command: the results that it was for, and what is to be said of them."""

    names: tuple[str, ...]
    kind: str  # made, failed, left out or stopped
    words: str


def quoted() -> list[str]:
    """Results whose numbers README or docs quote."""
    names: set[str] = set()
    for page in fill.documents():
        fill.with_marks(
            page.read_text("utf-8"),
            lambda mark: names.add(mark["name"].partition(".")[0]) or mark[0],
        )
    return sorted(names)


def chosen(names: Sequence[str], only: Sequence[str] | None) -> list[str]:
    """Those of the names that are asked for.

    Raises:
        SystemExit: one is not among them; says which are near.
    """
    for name in only or ():
        if name not in names:
            near = difflib.get_close_matches(name, names, n=3)
            raise SystemExit(
                f"--only {name}: no result of this name is made here; "
                + (f"{', '.join(near)}?" if near else f"there are {', '.join(names)}")
            )
    return [*dict.fromkeys(only or names)]


def options_of(name: str) -> tuple[str, ...]:
    """Options with which a result was made, by its first line."""
    if name in OPTIONS:
        return OPTIONS[name]
    try:
        return tuple(shlex.split(head(name, FOLDER).command)[3:])
    except ValueError:
        return ()


def commands(names: Sequence[str], *, quick: bool) -> dict[tuple[Path, tuple[str, ...]], list[str]]:
    """Benchmark and options of each run, and which results it is for: one run may make several."""
    found: dict[tuple[Path, tuple[str, ...]], list[str]] = {}
    for name in names:
        options = ("--quick",) if quick else options_of(name)
        found.setdefault((module_of(name), options), []).append(name)
    return found


@contextlib.contextmanager
def with_checkouts(name: str, options: Sequence[str]) -> Iterator[list[str]]:
    """Options in which `--before FOLDER` names a checkout of the commit that the result was
    compared with.

    Raises:
        ValueError: the result does not say which, or git does not have it.
    """
    words = list(options)
    if "--before" not in words:
        yield words
        return
    text = (FOLDER / f"{name}.txt").read_text()
    commit = re.search(r"^Before: commit ([0-9a-f]+)", text, re.MULTILINE)
    if not commit:
        raise ValueError(f"{name}.txt does not say which commit it was compared with")
    with tempfile.TemporaryDirectory() as temporary:
        checkout = Path(temporary) / "before"
        git("worktree", "add", "--detach", str(checkout), commit[1])
        if not checkout.is_dir():
            raise ValueError(f"git does not have {commit[1]}, which {name}.txt was compared with")
        try:
            words[words.index("--before") + 1] = str(checkout)
            yield words
        finally:
            git("worktree", "remove", "--force", str(checkout))


def idle(patience: float) -> float:
    """Wait until the machine is idle, so many seconds at most; the load then."""
    until = time.monotonic() + patience
    while (load := os.getloadavg()[0]) > BUSY and time.monotonic() < until:
        progress(f"load {load:.1f}, waiting for an idle machine")
        time.sleep(min(5.0, max(0.0, until - time.monotonic())))
    progress()
    return load


def run_one(
    module: Path, options: Sequence[str], names: Sequence[str], out: Path, logs: Path
) -> Outcome:
    """Run a benchmark; what it wrote takes its place when it has ended well."""
    its = tuple(names)
    if lack := runner.missing(module):
        return Outcome(its, "left out", lack)
    made = logs / f"{module.stem}-{its[0]}"
    made.mkdir()
    log = made / f"{module.stem}.log"
    try:
        with with_checkouts(its[0], options) as words:
            ended = runner.run(module, made, math.inf, words)
    except ValueError as error:
        return Outcome(its, "failed", str(error))
    if ended != "0":
        return Outcome(its, "failed", f"exit status {ended}; see {log}")
    if not_there := [name for name in its if not (made / f"{name}.txt").is_file()]:
        return Outcome(its, "failed", f"wrote no {', '.join(not_there)}; see {log}")
    out.mkdir(parents=True, exist_ok=True)
    for path in made.iterdir():
        if path != log:
            shutil.move(path, out / path.name)
    lack = runner.missing(module, "PARTS_NEED")
    load = head(its[0], out).load
    said = [f"without parts: {lack}" * bool(lack), "" if load is None else f"load {load:.1f}"]
    if load is not None and load > BUSY:
        said.append("others used the machine: times may be too long")
    return Outcome(its, "made", "; ".join(filter(None, said)))


def run_all(names: Sequence[str], out: Path, *, patience: float, quick: bool = False) -> int:
    """Make these results anew, one after another; 0 if all were, 1 if not, 130 if it was stopped."""
    runner.stop_on_signals()
    runs = commands(names, quick=quick)
    logs = Path(tempfile.mkdtemp(prefix="glazejax-performance-"))
    outcomes: list[Outcome] = []
    for (module, options), its in runs.items():
        began = time.monotonic()
        print(f"{', '.join(its)} ...", end="", flush=True)
        try:
            if idle(patience) > BUSY and not quick:
                print(" (the machine is busy)", end="", flush=True)
            outcomes.append(run_one(module, options, its, out, logs))
        except KeyboardInterrupt:
            outcomes.append(Outcome(tuple(its), "stopped", ""))
        print(f" {time.monotonic() - began:.0f} s, {outcomes[-1].kind}", flush=True)
        if outcomes[-1].kind == "stopped":
            break
    print("\n" + summary(outcomes, names))
    kinds = {one.kind for one in outcomes}
    return 130 if "stopped" in kinds else int(kinds != {"made"})


def summary(outcomes: Sequence[Outcome], names: Sequence[str]) -> str:
    """A line for each result, and one that counts."""
    reached = {name for one in outcomes for name in one.names}
    lines = [
        f"{', '.join(one.names)}: {one.kind}" + f": {one.words}" * bool(one.words)
        for one in outcomes
    ]
    if unreached := [name for name in names if name not in reached]:
        lines.append(f"not reached: {', '.join(unreached)}")
    made = sum(len(one.names) for one in outcomes if one.kind == "made")
    lines.append(f"{made} of {len(names)} results were made anew")
    return "\n".join(lines)
