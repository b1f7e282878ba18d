"""How many small faults the tests find: mutants of cosmic-ray, each tried in a copy of the
repository.

python -m benchmarks.mutation [MODULE...] [--count N] [--seed S] [--seconds T] [--budget T]
[--again] [--confirm]

MODULE is a folder or file of glazejax or glazefit: io, colour, film/errors. A random sample of
sites, evenly over the modules, gets one change each. Tests whose lines reach the changed line run
first, those of the files that are nearest (whose lines lie most in the changed file) before others;
other tests of these files that use the changed file follow. The first failure kills; so do a crash
and a test that does not end. What lives after --budget seconds of processor time has survived.

Results are added to a file of --scratch as they come: a run goes on where one stopped. --again
tries survivors once more, with the tests of today, --confirm those that were killed, by the same
test; --slow lets the slow tests of the nearest files run instead; --table runs nothing.
mutation_equivalent.tsv names mutants that change nothing that a user could see, with the reason.
"""

import argparse
import ast
import itertools
import json
import math
import os
import shutil
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.mutation_sites import Mutant, mutated, sample
from benchmarks.results import Results, add_option

NEEDS = ("long", "cosmic_ray", "coverage", "pytest", "hypothesis")

ROOT = Path(__file__).parents[1]
ROOMS = ("radiative", "paint", "colour", "io", "film", "recover", "identify", "recipe", "posterior")
JUDGED = Path(__file__).with_name("mutation_equivalent.tsv")
LEFT_OUT = (
    "test_architecture",
    "test_readme",
    "test_plots",
    "test_extras",
    "test_samples",
    "appearance/",
)
"""Tests that read the source itself, draw, start programs, or lie in a room of their own."""

KILLED = ("killed", "timeout")
NEAREST = 2
"""Test files of which all tests that use a changed file are tried before others, and the slow ones
if asked.
"""


@dataclass
class Tests:
    """What each test file runs, kept in the scratch folder; files that have changed are
    run again.
    """

    scratch: Path
    files: dict[str, Any]

    @classmethod
    def read(cls, scratch: Path) -> "Tests":
        """As far as it has been made."""
        path = scratch.with_suffix(".map.json")
        return cls(scratch, json.loads(path.read_text()) if path.exists() else {})

    def make(self, until: float) -> None:
        """Run what is new or changed; nothing after the time `until`."""
        from benchmarks.mutation_run import map_file

        for path in sorted((self.scratch / "tests").rglob("test_*.py")):
            file = str(path.relative_to(self.scratch))
            if any(name in file for name in LEFT_OUT):
                continue
            text = path.read_text()
            known = self.files.get(file, {})
            if (known.get("text") == text and known["outcome"] == "passed") or time.time() > until:
                continue
            entry = map_file(self.scratch, file)
            self.files[file] = {**entry, "text": text}
            self.scratch.with_suffix(".map.json").write_text(json.dumps(self.files))
            print(
                f"{file}: {len(entry['seconds'])} tests, {entry['took']:.0f} s, failed "
                f"{entry['failed']}",
                flush=True,
            )

    @property
    def usual(self) -> dict[str, float]:
        """Seconds of each test that passes."""
        return {
            test: took for entry in self.files.values() for test, took in entry["seconds"].items()
        }

    def of(self, mutant: Mutant, budget: float, slow: bool = False) -> list[list[str]]:
        """Tests to try, by file: those that reach the line, then others that use the file; few that
        are long.

        If slow, the nearest files, for their slow tests.
        """
        usual, inside = self.usual, in_functions((self.scratch / mutant.file).read_text())
        near: dict[str, float] = {}
        reach: dict[str, set[str]] = {}
        use: dict[str, set[str]] = {}
        for file, entry in self.files.items():
            # What runs on import tells nothing of a test.
            lines = {
                int(at): tests
                for at, tests in entry["lines"].get(mutant.file, {}).items()
                if int(at) in inside
            }
            if lines:
                near[file] = len(lines) / sum(map(len, entry["lines"].values()))
                reach[file] = set(lines.get(mutant.line, ()))
                use[file] = {test for tests in lines.values() for test in tests}
        if not any(reach.values()):
            reach = use
        order = sorted((file for file in reach if reach[file]), key=lambda file: -near[file])
        if slow:
            return [[file] for file in order[:NEAREST]]
        # A test that takes half the budget leaves too little for others, unless it is all there is.
        most = max(
            budget / 2, min((usual[test] for file in order for test in reach[file]), default=0.0)
        )
        # A tracer sees a line for the first test only; others of the file may depend on it.
        rest = {file: use[file] - reach[file] for file in order}
        both = [tests for file in order[:NEAREST] for tests in (reach[file], rest[file])]
        chosen = [
            *both,
            *(reach[file] for file in order[NEAREST:]),
            *(rest[file] for file in order[NEAREST:]),
        ]
        short = [
            sorted((t for t in tests if usual[t] <= most), key=lambda t: usual[t])
            for tests in chosen
        ]
        return [tests for tests in short if tests]


def in_functions(source: str) -> set[int]:
    """Lines that run when a function is called."""
    functions = (node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.FunctionDef))
    return {
        line
        for each in functions
        for line in range(each.body[0].lineno, (each.end_lineno or 0) + 1)
    }


def copy_tree(scratch: Path) -> None:
    """Bring the scratch copy up to date; files keep their times, and compiled ones stay."""
    skip = shutil.ignore_patterns(
        "*.egg-info", "__pycache__", ".pytest_cache", "shared", ".hypothesis", "results"
    )
    for name in ("src", "fitting", "tests", "benchmarks", "docs"):
        shutil.copytree(ROOT / name, scratch / name, ignore=skip, dirs_exist_ok=True)
        for old in (scratch / name).rglob("*.py"):
            if not (ROOT / old.relative_to(scratch)).exists():
                old.unlink()
    for path in ROOT.iterdir():
        if path.is_file():
            shutil.copy2(path, scratch / path.name)


def tried(scratch: Path) -> dict[str, list[dict[str, Any]]]:
    """Every trial of every mutant, first first."""
    path = scratch.with_suffix(".jsonl")
    trials: dict[str, list[dict[str, Any]]] = {}
    for line in path.read_text().splitlines() if path.exists() else ():
        trial = json.loads(line)
        trials.setdefault(Mutant(**trial["mutant"]).key, []).append(trial)
    return trials


def judged() -> dict[str, str]:
    """Reason by mutant, of those that no test can tell from the program."""
    rows = (
        line.split("\t")
        for line in JUDGED.read_text().splitlines()
        if line and not line.startswith("#")
    )
    return {"\t".join(row[:3]): row[3] for row in rows}


def attempt(
    scratch: Path,
    tests: Tests,
    mutant: Mutant,
    budget: float,
    stamp: int,
    slow: bool,
    before: list[dict[str, Any]],
) -> dict[str, Any]:
    """Write the mutant into the scratch copy, run its tests, and take it out again.

    Tests that it has passed before are left out; one that is dead has to fail the test that killed
    it once more.
    """
    from benchmarks.mutation_run import run_tests

    path = scratch / mutant.file
    source = path.read_text()
    text = mutated(source, mutant.operator, mutant.occurrence)
    if text is None:
        raise ValueError(f"{mutant.file} has changed: no {mutant.operator} at {mutant.code}")
    kept = path.stat()
    groups, usual = tests.of(mutant, budget, slow), None if slow else tests.usual
    passed = {test for trial in before for test in trial.get("passed", ())}
    if confirm := dead(before):
        groups, passed = (
            [[next(trial["by"] for trial in before if trial["outcome"] in KILLED)]],
            set(),
        )
    groups = [
        left
        for tests_of_one in groups
        if (left := [test for test in tests_of_one if test not in passed])
    ]
    begun = time.monotonic()
    try:
        path.write_text(text)
        # Byte code of an earlier mutant of the same length must not pass for this one's.
        os.utime(path, (stamp, stamp))
        outcome, by, ended = (
            run_tests(scratch, groups, usual, budget, slow) if groups else ("passed", "", [])
        )
    finally:
        path.write_text(source)
        os.utime(path, ns=(kept.st_atime_ns, kept.st_mtime_ns))
    return {
        "mutant": vars(mutant),
        "slow": slow,
        "confirm": confirm,
        "outcome": outcome,
        "by": by,
        "passed": sorted(test for test, _ in ended if test != by),
        "tests": len(passed) + len(ended),
        "of": len(passed) + sum(map(len, groups)),
        "seconds": round(time.monotonic() - begun, 1),
    }


def dead(trials: list[dict[str, Any]]) -> bool:
    """Whether a mutant was killed, and again wherever that was tried again."""
    found = False
    for trial in trials:
        found = trial["outcome"] in KILLED or (found and not trial.get("confirm"))
    return found


def interval(killed: int, of: int) -> tuple[float, float]:
    """Wilson's 95 % interval of a share."""
    if of == 0:
        return 0.0, 1.0
    z, share = 1.96, killed / of
    middle, half = (
        share + z * z / (2 * of),
        z * math.sqrt(share * (1 - share) / of + z * z / (4 * of * of)),
    )
    return (middle - half) / (1 + z * z / of), (middle + half) / (1 + z * z / of)


def _room(mutant: Mutant, rooms: list[str]) -> str:
    inside = (
        mutant.file.removeprefix("src/glazejax/")
        .removeprefix("fitting/glazefit/")
        .removesuffix(".py")
    )
    return next((room for room in rooms if inside == room or inside.startswith(f"{room}/")), "")


def table(results: Results, scratch: Path, rooms: list[str], seed: int, budget: float) -> None:
    """Counts by module, before and after survivors were tried again, then each survivor and each
    equivalent.
    """
    equivalent = judged()
    rows: dict[str, list[int]] = {room: [0, 0, 0, 0] for room in rooms}
    living: list[str] = []
    same: list[str] = []
    for key, trials in tried(scratch).items():
        mutant = Mutant(**trials[0]["mutant"])
        if not (room := _room(mutant, rooms)):
            continue
        row = rows[room]
        row[0] += 1
        if key in equivalent:
            row[1] += 1
            same.append(
                f"{mutant.file}:{mutant.line}\n    {mutant.code}\n    {mutant.change}\n    = "
                f"{equivalent[key]}"
            )
            continue
        row[2] += dead(
            [
                trial
                for n, trial in enumerate(trials)
                if n == 0 or (dead(trials[:1]) and trial.get("confirm"))
            ]
        )
        if dead(trials):
            row[3] += 1
        else:
            last = trials[-1]
            ran = (
                f"{last['tests']} of {last['of']} tests ran in {last['seconds']:.0f} s"
                if last["of"]
                else "no test"
            )
            living.append(
                f"{mutant.file}:{mutant.line} ({ran})\n    {mutant.code}\n    {mutant.change}"
            )
    results(
        f"Mutants of cosmic-ray, seed {seed}, one change at each of a random sample of places, "
        "evenly over the modules."
    )
    results(
        "Fast tests only: those that reach the line, nearest file first, then others of these "
        "files that use the"
    )
    results(
        f"changed file, for at most {budget:.0f} s of processor time. Left out: files that draw "
        "and word (plots,"
    )
    results(
        "page, report), words of errors, annotations, decorators. Share: killed of those that "
        "are not equivalent,"
    )
    results(
        "with its 95 % interval. Survivors were tried again, with longer tests and with tests "
        "written since: the"
    )
    results("second share is of the very sample that these were written for.")
    results("")
    results(
        f"{'':12s} mutants  equivalent  killed at first  share  killed now  survive  share  "
        "interval"
    )
    total = [sum(column) for column in zip(*rows.values(), strict=True)]
    for room, (count, no, first, now) in [*rows.items(), ("all", total)]:
        real = count - no
        low, high = interval(now, real)
        results(
            f"{room:12s} {count:7d}  {no:10d}  {first:15d}  {first / max(real, 1):5.0%}  "
            f"{now:10d}  {real - now:7d}"
            f"  {now / max(real, 1):5.0%}  {low:.0%} to {high:.0%}"
        )
    again = [
        trials
        for trials in tried(scratch).values()
        if any(trial.get("confirm") for trial in trials)
    ]
    if again:
        results("")
        twice = sum(
            any(t.get("confirm") and t["outcome"] in KILLED for t in trials) for trials in again
        )
        results(
            f"Killed ones tried again, each with the test that killed it: {len(again)}, killed "
            f"again: {twice}."
        )
    for title, texts in (("Survivors", living), ("Judged equivalent", same)):
        results("")
        results(f"{title}: {len(texts)}")
        for text in sorted(texts):
            for line in text.split("\n"):
                results(line)
    results.save()


def waiting(options: argparse.Namespace, scratch: Path) -> Iterator[Mutant]:
    """Mutants to try: of the sample those not tried yet, or with --again survivors, with --confirm
    the others.
    """
    done = tried(scratch)
    if not (options.again or options.confirm):
        drawn = itertools.islice(sample(scratch, options.modules, options.seed), options.count)
        yield from (mutant for mutant in drawn if mutant.key not in done)
        return
    equivalent = judged()
    for key, trials in done.items():
        mutant = Mutant(**trials[0]["mutant"])
        if key in equivalent or not _room(mutant, options.modules):
            continue
        tried_twice = any(trial.get("confirm") for trial in trials)
        if (options.again and not dead(trials)) or (
            options.confirm and dead(trials) and not tried_twice
        ):
            yield mutant


def main() -> None:
    """Parse the command line, run, and write the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("modules", nargs="*", default=list(ROOMS), metavar="MODULE")
    parser.add_argument(
        "--count", type=int, default=300, help="size of the sample (default: %(default)s)"
    )
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument(
        "--seconds", type=float, default=math.inf, help="stop after these, with what there is"
    )
    parser.add_argument(
        "--budget",
        type=float,
        default=60.0,
        help="processor seconds a mutant (default: %(default)s)",
    )
    parser.add_argument("--core", type=int, help="run on this core alone")
    parser.add_argument("--again", action="store_true", help="try survivors once more")
    parser.add_argument(
        "--confirm",
        action="store_true",
        help="try those that were killed once more, by the same test",
    )
    parser.add_argument("--slow", action="store_true", help="with slow tests")
    parser.add_argument(
        "--table", action="store_true", help="run nothing, write the table of what was run"
    )
    parser.add_argument("--map", action="store_true", help="only see which tests run which lines")
    parser.add_argument(
        "--mapped", action="store_true", help="use the map of tests as far as it is made"
    )
    parser.add_argument(
        "--scratch", type=Path, default=Path(tempfile.gettempdir()) / "glazejax-mutation" / "tree"
    )
    add_option(parser)
    options = parser.parse_args()
    scratch = options.scratch.resolve()
    until = time.time() + options.seconds
    if not options.table:
        from benchmarks.mutation_run import prepare

        scratch.mkdir(parents=True, exist_ok=True)
        copy_tree(scratch)
        sys.dont_write_bytecode = True
        prepare(options.core)
        tests = Tests.read(scratch)
        if not options.mapped:
            tests.make(until)
        done = tried(scratch)
        stamp = 1_000_000_000 + len(done) * 1000
        for number, mutant in enumerate(() if options.map else waiting(options, scratch)):
            if time.time() > until:
                break
            trial = attempt(
                scratch,
                tests,
                mutant,
                options.budget,
                stamp + number,
                options.slow,
                done.get(mutant.key, []),
            )
            with scratch.with_suffix(".jsonl").open("a") as log:
                log.write(json.dumps(trial) + "\n")
            print(
                f"{trial['outcome']:8s} {trial['seconds']:5.1f} s  {mutant.file}:{mutant.line}  "
                f"{mutant.change}",
                flush=True,
            )
    # The first sample is that which tests were written for; others are named by their seed.
    name = "mutation" if options.seed == 1 else f"mutation_{options.seed}"
    table(Results(name, options.out), scratch, options.modules, options.seed, options.budget)


if __name__ == "__main__":
    main()
