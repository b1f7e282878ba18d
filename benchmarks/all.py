"""Every benchmark once, at small size: does each still run, and are its figures of the same order?

    python -m benchmarks.all --quick [--out FOLDER] [--only NAME ...] [--limit SECONDS] [--resume]
    python -m benchmarks.all --list

Each runs in a process of its own, with `--quick`, and writes its results and NAME.log to FOLDER; the committed results
stay as they are. What needs a package, a program, data or a GPU that is not here is left out and said. The table at
the end is written to all.txt as it grows, so that nothing is lost when the run is stopped; `--resume` goes on from
there. Figures are those of `benchmarks.figures` that the small run has too; one that differs from the committed one by
more than `--factor` is told. That is a hint and no fault: sizes are small, and other machines have other times.
"""

import argparse
import difflib
import importlib.util
import math
import os
import resource
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import NamedTuple, NoReturn

from benchmarks import figures
from benchmarks.results import FOLDER, HERE, QUICK_FOLDER, declared, head, modules

SECONDS = 180.0


class Outcome(NamedTuple):
    """What became of one benchmark."""

    name: str
    seconds: float
    processor: float  # seconds of all its cores and processes, which a busy machine changes less
    ended: str  # exit status, or why there is none
    figures: int = 0
    apart: tuple[str, ...] = ()

    @property
    def good(self) -> bool:
        """It ran to its end, or was left out with a reason."""
        return self.ended in ("0", "done before") or not self.seconds


def lacks(need: str) -> str:
    """Why a benchmark that needs this cannot run here; empty if it can.

    Args:
        need: `data/NAME`, measured films; `program/NAME`; `gpu`; `long`; or a package by the name it is imported by.
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


def missing(module: Path) -> str:
    """All that a benchmark lacks here, in words."""
    return ", ".join(filter(None, map(lacks, declared(module, "NEEDS", ()))))


def run(module: Path, folder: Path, limit: float) -> str:
    """Run one benchmark at small size; its exit status, or `limit`."""
    command = [sys.executable, "-m", f"benchmarks.{module.stem}", "--quick", "--out", str(folder)]
    with (folder / f"{module.stem}.log").open("w") as log:
        # A group of its own: what it starts ends with it.
        child = subprocess.Popen(
            command, cwd=HERE.parent, stdout=log, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL,
            start_new_session=True,
        )  # fmt: skip
        try:
            return str(child.wait(limit))
        except subprocess.TimeoutExpired:
            return f"limit of {limit:g} s"
        finally:
            if child.poll() is None:
                os.killpg(child.pid, signal.SIGKILL)
                child.wait()


def compared(result: str, folder: Path, factor: float) -> tuple[int, tuple[str, ...]]:
    """How many figures of a result the small run has too, and those that differ by more than a factor."""
    count, apart = 0, []
    for name in figures.names(result):
        try:
            now, before = figures.value(name, folder), figures.value(name)
        except ValueError:
            continue
        count += 1
        same = now == before or (now * before > 0 and abs(math.log(now / before)) <= math.log(factor))
        if not same:
            apart.append(f"{name} {figures.of(name).said(before)} -> {figures.of(name).said(now)}")
    return count, tuple(apart)


def table(outcomes: list[Outcome], factor: float) -> str:
    """One line a benchmark, then the figures that are apart."""
    lines = [f"{'benchmark':<24}{'seconds':>9}{'cpu':>9}{'figures':>9}{'apart':>7}  exit status, or why not"]
    for one in outcomes:
        counts = f"{one.figures:>9}{len(one.apart):>7}" if one.figures else " " * 16
        seconds = f"{one.seconds:9.1f}{one.processor:9.1f}" if one.seconds else " " * 18
        lines.append(f"{one.name:<24}{seconds}{counts}  {one.ended}")
    lines.append(f"{'all':<24}{sum(one.seconds for one in outcomes):9.1f}{sum(one.processor for one in outcomes):9.1f}")
    if apart := [words for one in outcomes for words in one.apart]:
        lines += ["", f"figures of small size that differ from the committed ones by more than a factor of {factor:g}:"]
        lines += [f"  {words}" for words in apart]
    return "\n".join(lines) + "\n"


def listed() -> str:
    """Every module that is run by itself: what it asks, and what it lacks here."""
    ours = {module.stem: module for module in modules()}
    others = [p for p in sorted(HERE.glob("*.py")) if "\ndef main(" in p.read_text() and p.stem not in ours]
    lines = [f"{name:<24}{first_words(module)}{_brackets(missing(module))}" for name, module in ours.items()]
    lines += ["", "not run by this: they make files that ship or show, or ask the results"]
    lines += [f"{path.stem:<24}{first_words(path)}" for path in others]
    return "\n".join(lines)


def _brackets(words: str) -> str:
    return f" [{words}]" if words else ""


def first_words(module: Path) -> str:
    """First line of a module's docstring."""
    return module.read_text().removeprefix('"""').partition("\n")[0].removesuffix('"""')


def chosen(only: list[str] | None) -> list[Path]:
    """The benchmarks asked for.

    Raises:
        SystemExit: one is not there; says which are near.
    """
    ours = {module.stem: module for module in modules()}
    for name in only or ():
        if name not in ours:
            near = difflib.get_close_matches(name, ours, n=3)
            raise SystemExit(f"--only {name}: no such benchmark; " + (f"{', '.join(near)}?" if near else "see --list"))
    return [ours[name] for name in only or ours]


def done_before(module: Path, folder: Path) -> bool:
    """Whether the folder holds its small result, of today's revision."""
    try:
        return head(module.stem, folder).revision == declared(module, "REVISION", 0)
    except ValueError:
        return False


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="run them; full sizes are run one by one, by hand")
    parser.add_argument("--list", action="store_true", help="name every benchmark and what it lacks here")
    parser.add_argument("--out", type=Path, default=QUICK_FOLDER, help="folder for results (default: %(default)s)")
    parser.add_argument("--only", nargs="+", metavar="NAME", help="these benchmarks")
    parser.add_argument("--limit", type=float, default=SECONDS, help="seconds for each (default: %(default)s)")
    parser.add_argument("--factor", type=float, default=2.0, help="of figures that are told (default: %(default)s)")
    parser.add_argument("--resume", action="store_true", help="leave out what the folder holds already")
    options = parser.parse_args()
    if options.list:
        print(listed())
        return
    if not options.quick:
        parser.error("say --quick, or --list; a benchmark of full size is run by itself: python -m benchmarks.NAME")
    if options.out.resolve() == FOLDER.resolve():
        raise SystemExit(f"--out {options.out}: the committed results are of full size; choose another folder")
    sys.exit(run_all(chosen(options.only), options))


def _stop(*_: object) -> NoReturn:
    raise KeyboardInterrupt


def _processor() -> float:
    """Seconds of processor time of all children that ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def run_all(benchmarks: list[Path], options: argparse.Namespace) -> int:
    """Run them in turn; 0 if all that ran ended well, 130 if it was stopped."""
    folder = options.out.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    # Whoever stops this process, by either signal, stops the child too.
    for kind in (signal.SIGINT, signal.SIGTERM):
        signal.signal(kind, _stop)
    outcomes: list[Outcome] = []
    stopped = False
    print(f"results and logs go to {folder}")
    for module in benchmarks:
        name, began, spent = module.stem, time.monotonic(), _processor()
        if lack := missing(module):
            outcomes.append(Outcome(name, 0.0, 0.0, f"left out: {lack}"))
        elif options.resume and done_before(module, folder):
            outcomes.append(Outcome(name, 0.0, 0.0, "done before", *compared(name, folder, options.factor)))
        else:
            print(f"{name} ...", end="", flush=True)
            try:
                ended = run(module, folder, options.limit)
            except KeyboardInterrupt:
                ended, stopped = "stopped", True
            seconds = time.monotonic() - began
            print(f" {seconds:.0f} s" + f", {ended}" * (ended != "0"), flush=True)
            count, apart = compared(name, folder, options.factor) if ended == "0" else (0, ())
            words = ended if ended == "0" else f"{ended}; see {name}.log"
            outcomes.append(Outcome(name, seconds, _processor() - spent, words, count, apart))
        (folder / "all.txt").write_text(table(outcomes, options.factor))
        if stopped:
            break
    print(f"\n{table(outcomes, options.factor)}written to {folder}: all.txt")
    return 130 if stopped else int(not all(one.good for one in outcomes))


if __name__ == "__main__":
    main()
