"""Every benchmark once, at small size: does each still run, and are its figures of the same order?

    python -m benchmarks.all --quick [--out FOLDER] [--only NAME ...] [--limit SECONDS] [--resume]
    python -m benchmarks.all --list
    python -m benchmarks.all --older

Each runs in a process of its own, with `--quick`, and writes its results and NAME.log to FOLDER;
the committed results stay as they are. What needs a package, a program, data or a GPU that is not
here is left out and said, and so are parts of a benchmark, such as one of several programs it
compares. The table at the end is written to all.txt as it grows, so that nothing is lost when the
run is stopped; `--resume` goes on from there and runs again what failed. The exit status is 0 if
nothing failed, 1 if something did, 130 if the run was stopped. Figures are those of
`benchmarks.figures` that the small run has too; one that differs from the committed one by more
than `--factor` is told. That is a hint and no
fault: sizes are small, and other machines have other times. `--older` runs nothing: it lists the
results that are older than the code they measure, by how often that has changed since
(`benchmarks/older.py`).
"""

import argparse
import difflib
import importlib.util
import math
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Literal, NamedTuple, NoReturn

from benchmarks import figures, older
from benchmarks.results import FOLDER, HERE, QUICK_FOLDER, code_of, declared, modules

# Ends what hangs; each takes a minute or two of two idle cores.
SECONDS = 600.0
# Last line of the log of a benchmark that ran to its end.
ENDED = re.compile(r"ended well after ([\d.]+) s, processor ([\d.]+) s")


class Outcome(NamedTuple):
    """What became of one benchmark."""

    name: str
    seconds: float
    processor: float  # seconds of all its cores and processes, which a busy machine changes less
    kind: Literal["ran", "failed", "left out", "stopped"]
    ended: str  # exit status, or why there is none
    figures: int = 0
    apart: tuple[str, ...] = ()


def lacks(need: str) -> str:
    """Why a benchmark that needs this cannot run here; empty if it can.

    Args:
        need: `data/NAME`, measured films; `program/NAME`; `gpu`; `long`; or a package by the name
            it is imported by.
    """
    kind, _, name = need.rpartition("/")
    if kind == "data":
        base = Path(os.environ.get("GLAZEJAX_DATA") or HERE.parents[1] / "shared" / "data")
        return "" if (base / name).is_dir() else f"no measured data {name} (GLAZEJAX_DATA)"
    if kind == "program":
        return "" if shutil.which(name) else f"no program {name}"
    if name == "gpu":
        return "" if shutil.which("nvidia-smi") else "no NVIDIA GPU"
    if name == "long":
        return "takes hours at any size"
    return "" if importlib.util.find_spec(name) else f"no package {name}"


def missing(module: Path, what: str = "NEEDS") -> str:
    """All that a benchmark lacks here, in words; with `PARTS_NEED`, what only parts of it need."""
    return ", ".join(filter(None, map(lacks, declared(module, what, ()))))


def run(module: Path, folder: Path, limit: float, options: Sequence[str] = ("--quick",)) -> str:
    """Run one benchmark, at small size unless other options are given; its exit status, or the
    limit of seconds that it passed.
    """
    command = [sys.executable, "-m", f"benchmarks.{module.stem}", *options, "--out", str(folder)]
    with (folder / f"{module.stem}.log").open("w") as log:
        # A group of its own: what it starts ends with it.
        child = subprocess.Popen(
            command,
            cwd=HERE.parent,
            stdout=log,
            stderr=subprocess.STDOUT,
            stdin=subprocess.DEVNULL,
            start_new_session=True,
        )
        try:
            return str(child.wait(limit))
        except subprocess.TimeoutExpired:
            return f"limit of {limit:g} s"
        finally:
            if child.poll() is None:
                os.killpg(child.pid, signal.SIGKILL)
                child.wait()


def compared(result: str, folder: Path, factor: float) -> tuple[int, tuple[str, ...]]:
    """How many figures of a result the small run has too, and those that differ by more than a
    factor.
    """
    count, apart = 0, []
    for name in figures.names(result):
        try:
            now, before = figures.value(name, folder), figures.value(name)
        except ValueError:
            continue
        count += 1
        same = now == before or (
            now * before > 0 and abs(math.log(now / before)) <= math.log(factor)
        )
        if not same:
            apart.append(f"{name} {figures.of(name).said(before)} -> {figures.of(name).said(now)}")
    return count, tuple(apart)


def summary(outcomes: list[Outcome], unreached: Sequence[str] = ()) -> str:
    """One sentence: how many ran, and which did not."""
    ran = sum(one.kind == "ran" for one in outcomes)
    words = [f"{ran} of {len(outcomes) + len(unreached)} ran to the end"]
    for kind in ("failed", "stopped", "left out"):
        if names := [one.name for one in outcomes if one.kind == kind]:
            words.append(f"{len(names)} {kind}: {', '.join(names)}")
    if unreached:
        words.append(
            f"{len(unreached)} not reached: {', '.join(unreached)} (--resume goes on from there)"
        )
    return "; ".join(words)


def table(outcomes: list[Outcome], factor: float, unreached: Sequence[str] = ()) -> str:
    """One line a benchmark, a sentence, then the figures that are apart."""
    lines = [
        f"{'benchmark':<24}{'seconds':>9}{'cpu':>9}{'figures':>9}{'apart':>7}  exit status, or "
        "why not"
    ]
    for one in outcomes:
        counts = f"{one.figures:>9}{len(one.apart):>7}" if one.figures else " " * 16
        seconds = f"{one.seconds:9.1f}{one.processor:9.1f}" if one.kind != "left out" else " " * 18
        lines.append(f"{one.name:<24}{seconds}{counts}  {one.ended}")
    lines.append(
        f"{'all':<24}{sum(one.seconds for one in outcomes):9.1f}{sum(one.processor for one in outcomes):9.1f}"
    )
    lines += ["", summary(outcomes, unreached)]
    if apart := [words for one in outcomes for words in one.apart]:
        lines += [
            "",
            "figures of small size that differ from the committed ones by more than a factor of "
            f"{factor:g}:",
        ]
        lines += [f"  {words}" for words in apart]
    return "\n".join(lines) + "\n"


def listed() -> str:
    """Every module that is run by itself: what it asks, and what it lacks here."""
    ours = {module.stem: module for module in modules()}
    others = [
        p
        for p in sorted(HERE.glob("*.py"))
        if "\ndef main(" in p.read_text() and p.stem not in ours
    ]
    lines = [f"{name:<24}{first_words(module)}{_brackets(module)}" for name, module in ours.items()]
    lines += ["", "not run by this: they make files that ship or show, or ask the results"]
    lines += [f"{path.stem:<24}{first_words(path)}" for path in others]
    return "\n".join(lines)


def _brackets(module: Path) -> str:
    lack, parts = missing(module), missing(module, "PARTS_NEED")
    return f" [{lack}]" if lack else f" [without parts: {parts}]" if parts else ""


def first_words(module: Path) -> str:
    """First line of a module's docstring."""
    return code_of(module).removeprefix('"""').partition("\n")[0].removesuffix('"""')


def chosen(only: list[str] | None) -> list[Path]:
    """The benchmarks asked for.

    Raises:
        SystemExit: one is not there; says which are near.
    """
    ours = {module.stem: module for module in modules()}
    for name in only or ():
        if name not in ours:
            near = difflib.get_close_matches(name, ours, n=3)
            raise SystemExit(
                f"--only {name}: no such benchmark; "
                + (f"{', '.join(near)}?" if near else "see --list")
            )
    return [ours[name] for name in only or ours]


def done_before(module: Path, folder: Path) -> tuple[float, float] | None:
    """Seconds and processor seconds that it took, if it ran to its end before.

    Its log says so. A result alone is not enough: a benchmark may have written it and failed later.
    """
    log = folder / f"{module.stem}.log"
    last = log.read_text(errors="replace").splitlines()[-1:] if log.is_file() else []
    found = ENDED.fullmatch(last[0]) if last else None
    return (float(found[1]), float(found[2])) if found else None


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--quick", action="store_true", help="run them; full sizes are run one by one, by hand"
    )
    parser.add_argument(
        "--list", action="store_true", help="name every benchmark and what it lacks here"
    )
    parser.add_argument(
        "--older",
        action="store_true",
        help="list results that are older than the code they measure",
    )
    parser.add_argument(
        "--out", type=Path, default=QUICK_FOLDER, help="folder for results (default: %(default)s)"
    )
    parser.add_argument("--only", nargs="+", metavar="NAME", help="these benchmarks")
    parser.add_argument(
        "--limit", type=float, default=SECONDS, help="seconds for each (default: %(default)s)"
    )
    parser.add_argument(
        "--factor", type=float, default=2.0, help="of figures that are told (default: %(default)s)"
    )
    parser.add_argument(
        "--resume", action="store_true", help="leave out what the folder holds already"
    )
    options = parser.parse_args()
    if options.list:
        print(listed())
        return
    if options.older:
        print(older.table())
        return
    if not options.quick:
        parser.error(
            "say --quick, --list or --older; a benchmark of full size is run by itself: python "
            "-m benchmarks.NAME"
        )
    if options.out.resolve() == FOLDER.resolve():
        raise SystemExit(
            f"--out {options.out}: the committed results are of full size; choose another folder"
        )
    sys.exit(run_all(chosen(options.only), options))


def _stop(*_: object) -> NoReturn:
    raise KeyboardInterrupt


def stop_on_signals() -> None:
    """Whoever stops this process, by either signal, stops the child too."""
    for kind in (signal.SIGINT, signal.SIGTERM):
        signal.signal(kind, _stop)


def _processor() -> float:
    """Seconds of processor time of all children that ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def run_all(benchmarks: list[Path], options: argparse.Namespace) -> int:
    """Run them in turn; 0 if none failed, 130 if it was stopped."""
    folder = options.out.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    stop_on_signals()
    outcomes: list[Outcome] = []
    print(f"results and logs go to {folder}")
    for number, module in enumerate(benchmarks, 1):
        outcomes.append(outcome(module, folder, options))
        unreached = [one.stem for one in benchmarks[number:]]
        (folder / "all.txt").write_text(table(outcomes, options.factor, unreached))
        if outcomes[-1].kind == "stopped":
            break
    print(f"\n{(folder / 'all.txt').read_text()}written to {folder}: all.txt")
    kinds = {one.kind for one in outcomes}
    return 130 if "stopped" in kinds else int("failed" in kinds)


def outcome(module: Path, folder: Path, options: argparse.Namespace) -> Outcome:
    """Run one benchmark, unless it lacks something or was done before; says so while it does."""
    name, began, spent = module.stem, time.monotonic(), _processor()
    if lack := missing(module):
        return Outcome(name, 0.0, 0.0, "left out", f"left out: {lack}")
    lack = missing(module, "PARTS_NEED")
    parts = f"; without parts: {lack}" if lack else ""
    if options.resume and (took := done_before(module, folder)):
        return Outcome(
            name, *took, "ran", f"0, done before{parts}", *compared(name, folder, options.factor)
        )
    print(f"{name} ...", end="", flush=True)
    try:
        ended = run(module, folder, options.limit)
    except KeyboardInterrupt:
        ended = "stopped"
    seconds, processor = time.monotonic() - began, _processor() - spent
    print(f" {seconds:.0f} s" + f", {ended}" * (ended != "0"), flush=True)
    if ended != "0":
        kind = "stopped" if ended == "stopped" else "failed"
        return Outcome(name, seconds, processor, kind, f"{ended}; see {name}.log")
    with (folder / f"{name}.log").open("a") as log:
        log.write(f"\nended well after {seconds:.1f} s, processor {processor:.1f} s\n")
    return Outcome(
        name, seconds, processor, "ran", f"0{parts}", *compared(name, folder, options.factor)
    )


if __name__ == "__main__":
    main()
