"""Damaged files of every kind, thousands of them: each reader must give a table or one sentence.

python -m benchmarks.fuzz_readers [--cases N] [--seed S] [--seconds T] [--only WORDS]

Bytes are flipped, cut, inserted and swapped, numbers of headers changed, pieces repeated up to a
megabyte and files spliced. Each case is read in a process of its own kind with a limit of memory
and time. Legal is a result whose counts are those that the file declares, or a ValueError or
OSError of one line that names the file. Anything else is a fault, and so are 10 s of processor time
and 200 MB more than the file's size. A fault is printed with the seed that makes it
again: --seed, --only and --case.
"""

import argparse
import multiprocessing
import random
import resource
import signal
import tempfile
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.results import FOLDER, Results, add_option

SECONDS = 10.0
MEMORY = 200 << 20
# The parent gives a process up that does not even hear its own alarm.
_LOST = 120.0
_BATCH = 25


@dataclass
class Tally:
    """What became of the cases of one kind."""

    accepted: int = 0
    refused: int = 0
    faults: int = 0
    memory: int = 0
    seconds: float = 0.0


class _Alarm(BaseException):
    """A case has used up its time; no reader catches it."""


def make(kind: str, seed: int, case: int) -> bytes:
    """Content of a case."""
    from tests.io.hostile import damaged, subjects

    everything = subjects()
    chance = random.Random(f"{seed} {kind} {case}")
    return damaged(
        everything[kind].content, [subject.content for subject in everything.values()], chance
    )


def serve(pipe: Any) -> None:
    """Work of a process: cases (kind, seed, case) in; (outcome, bytes above, seconds) out."""
    from tests.io.hostile import Fault, damaged, outcome, subjects

    def ring(*_: object) -> None:
        raise _Alarm

    signal.signal(signal.SIGPROF, ring)
    everything = subjects()
    contents = [subject.content for subject in everything.values()]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for subject in everything.values():
            for title, content in subject.beside.items():
                (folder / title).write_bytes(content)
            if not outcome(subject, folder, subject.content):
                raise RuntimeError(f"the sample {subject.name} is refused")
        while (task := pipe.recv()) is not None:
            kind, seed, case = task
            subject = everything[kind]
            for title, content in subject.beside.items():
                (folder / title).write_bytes(content)
            content = damaged(subject.content, contents, random.Random(f"{seed} {kind} {case}"))
            rest = _reset_peak()
            room = (
                _status("VmSize") + MEMORY + len(content) + (64 << 20)
            )  # of addresses; threads take some
            resource.setrlimit(resource.RLIMIT_AS, (room, resource.RLIM_INFINITY))
            start = time.process_time()
            said, fault = "refused", ""
            try:
                signal.setitimer(signal.ITIMER_PROF, SECONDS)
                said = "accepted" if outcome(subject, folder, content) else "refused"
            except Fault as error:
                fault = str(error)
                if "too large for this machine's memory" in fault:
                    fault = f"memory: {fault}"
            except _Alarm:
                fault = f"more than {SECONDS:g} s"
            finally:
                signal.setitimer(signal.ITIMER_PROF, 0.0)
                resource.setrlimit(
                    resource.RLIMIT_AS, (resource.RLIM_INFINITY, resource.RLIM_INFINITY)
                )
            above = _status("VmHWM") - rest
            if not fault and above > MEMORY + len(content):
                fault = f"{above >> 20} MB above the {len(content)} bytes of the file"
            pipe.send((fault or said, bool(fault), above, time.process_time() - start))


def _status(title: str) -> int:
    """Bytes of this process as the kernel counts them."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith(title):
            return int(line.split()[1]) << 10
    return 0


def _reset_peak() -> int:
    """Forget the largest size so far; bytes in use now."""
    Path("/proc/self/clear_refs").write_text("5")
    return _status("VmRSS")


class Worker:
    """A process that reads cases."""

    def __init__(self) -> None:
        context = multiprocessing.get_context("spawn")
        self.pipe, theirs = context.Pipe()
        self.process = context.Process(target=serve, args=(theirs,), daemon=True)
        self.process.start()
        theirs.close()

    def run(self, kind: str, seed: int, case: int) -> tuple[str, bool, int, float]:
        """What became of a case; a process that is lost is a fault of its own."""
        try:
            self.pipe.send((kind, seed, case))
            if self.pipe.poll(_LOST):
                return self.pipe.recv()
            lost = f"no answer within {_LOST:g} s"
        except (EOFError, BrokenPipeError):
            lost = "the process died"
        self.process.kill()
        self.process.join()
        lost += f" (exit code {self.process.exitcode})"
        self.__init__()
        return lost, True, 0, _LOST


def main() -> None:
    """Run cases and write what became of them."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--cases", type=int, default=22_000, help="in all (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="of the damage (default: %(default)s)")
    parser.add_argument("--seconds", type=float, default=float("inf"), help="stop after so many")
    parser.add_argument("--only", default="", help="kinds whose name holds these words")
    parser.add_argument(
        "--case", type=int, help="this case alone; its file is written to ./fuzz.CASE"
    )
    add_option(parser, cases=220)
    options = parser.parse_args()
    from tests.io.hostile import subjects

    kinds = [kind for kind in subjects() if options.only.lower() in kind.lower()]
    if options.case is not None:
        for kind in kinds:
            Path(f"fuzz.{options.case}").write_bytes(make(kind, options.seed, options.case))
            print(kind, Worker().run(kind, options.seed, options.case))
        return
    results = Results(
        "fuzz_readers", options.out if not options.only else FOLDER.parent / ".scratch", "numpy"
    )
    each = -(-options.cases // len(kinds))
    tallies = {kind: Tally() for kind in kinds}
    faults: Counter[tuple[str, str]] = Counter()
    worker, start = Worker(), time.monotonic()
    for first in range(0, each, _BATCH):
        for kind in kinds:
            if time.monotonic() - start > options.seconds:
                break
            for case in range(first, min(first + _BATCH, each)):
                said, fault, above, seconds = worker.run(kind, options.seed, case)
                tally = tallies[kind]
                tally.memory, tally.seconds = max(tally.memory, above), max(tally.seconds, seconds)
                if fault:
                    tally.faults += 1
                    key = (kind, said[:60])
                    faults[key] += 1
                    if faults[key] <= 2:
                        print(f"FAULT {kind!r} --case {case}: {said}", flush=True)
                elif said == "accepted":
                    tally.accepted += 1
                else:
                    tally.refused += 1
    report(results, tallies, options.seed)


def report(results: Results, tallies: dict[str, Tally], seed: int) -> None:
    """Table of what became of the cases."""
    cases = sum(tally.accepted + tally.refused + tally.faults for tally in tallies.values())
    results(
        f"{cases} damaged files, seed {seed}: accepted with the counts that they declare, "
        "refused in one sentence"
    )
    results(
        "that names the file, or faults (anything else, above 200 MB beside the file's size, "
        "above 10 s)"
    )
    results()
    results(
        f"{'kind of file':26} {'accepted':>9} {'refused':>9} {'faults':>7} {'MB above':>9} "
        f"{'slowest, s':>11}"
    )
    for kind, tally in tallies.items():
        results(
            f"{kind:26} {tally.accepted:9} {tally.refused:9} {tally.faults:7} "
            f"{tally.memory / 2**20:9.0f} "
            f"{tally.seconds:11.2f}"
        )
    sums = [
        sum(getattr(tally, title) for tally in tallies.values())
        for title in ("accepted", "refused", "faults")
    ]
    results(f"{'all':26} {sums[0]:9} {sums[1]:9} {sums[2]:7}")
    results.save()


if __name__ == "__main__":
    main()
