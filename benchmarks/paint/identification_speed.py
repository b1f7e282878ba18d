"""Spectra a second that are identified, by the number of their bands; compared with another
checkout, and with the thorough search.

    python -m benchmarks.paint.identification_speed [--before CHECKOUT] [--out FOLDER]

Simulated films of two paints with an instrument's noise, searched among all single paints and pairs
of the 20 oils. Each line is a process of its own, in turn with one of the other checkout: the same
spectra twice, of which the second time counts.
"""

import argparse
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.cold_start import ROOT, commit
from benchmarks.results import Results, command_line, percent, progress, quantity

# Seconds after which a line is given up.
LIMIT = 120.0


class Case(NamedTuple):
    """Spectra of one shape."""

    words: str
    bands: int
    cards: tuple[float, ...]
    rough: bool
    spectra: int
    compared: int  # with the thorough search
    recorded: tuple[str, ...] = ()


BOTH, WHITE = (0.025, 0.93), (0.93,)
SEARCH = ("before", "now", "same", "off")
RATES = ("rate", "before_rate", "times")
CASES = {
    "two": Case("31 bands, two cards", 31, BOTH, False, 1000, 300, SEARCH + RATES),
    "errors": Case("the same, errors of 5 %", 31, BOTH, True, 500, 200, SEARCH),
    "fine": Case("61 bands, white card", 61, WHITE, False, 300, 60, SEARCH + RATES),
    "finer": Case("121 bands, white card", 121, WHITE, False, 300, 12),
    "many": Case("301 bands, white card", 301, WHITE, False, 300, 0),
    "finest": Case("2151 bands, white card", 2151, WHITE, False, 200, 0, ("rate",)),
}


def work(key: str, count: int, thorough: bool) -> dict[str, Any]:
    """Identify the spectra of a case twice; the second time, and what was found."""
    from benchmarks.paint.identification import first_set, simulated
    from glazefit import identify
    from glazejax import catalogue
    from glazejax.commands.main import start_jax

    start_jax()
    case = CASES[key]
    paints = list(catalogue.load().values())
    grid = np.linspace(400.0, 700.0, case.bands)
    fine = [paint.resample(grid) for paint in paints]
    spectra, grounds, _ = simulated(fine, case.spectra, 1, case.rough, case.cards)
    seconds: list[float] = []
    cpu = 0.0
    found: Any = None
    for _ in range(1 if thorough else 2):
        began, cpu = time.perf_counter(), time.process_time()
        found = identify(
            grid, spectra[:count], paints, ground=grounds, max_paints=2, thorough=thorough
        )
        cpu = time.process_time() - cpu
        seconds.append(time.perf_counter() - began)
    first = [first_set(found, row) for row in range(count)]
    return {
        "rate": count / seconds[-1],
        "cpu": 1e3 * cpu / count,
        "first": [[sorted(paints), condition] for paints, condition in first],
        "paint": found.paint_probability.tolist(),
        "none": found.none.tolist(),
    }


def run(root: Path, key: str, count: int, thorough: bool = False) -> dict[str, Any] | None:
    """`work` in a process with the packages of a checkout; None after `LIMIT`, or where the system
    killed it: a search may want more memory than there is.
    """
    paths = os.pathsep.join([str(root / "src"), str(root / "fitting"), str(ROOT)])
    line = [sys.executable, "-m", "benchmarks.paint.identification_speed", "--work"]
    line.append(json.dumps([key, count, thorough]))
    try:
        done = subprocess.run(
            line,
            capture_output=True,
            text=True,
            check=True,
            cwd=ROOT,
            env={**os.environ, "PYTHONPATH": paths},
            timeout=LIMIT,
        )
    except subprocess.TimeoutExpired:
        return None
    except subprocess.CalledProcessError as error:
        if error.returncode != -signal.SIGKILL:
            raise
        return None
    return json.loads(done.stdout.splitlines()[-1])


class Agreement(NamedTuple):
    """How often a search says what the thorough one does."""

    same: float
    off: float
    none: float
    most: float
    spectra: int


def agreement(found: dict[str, Any], full: dict[str, Any]) -> Agreement:
    """Compare a search with the thorough one."""
    count = len(full["first"])
    same = np.mean([a == b for a, b in zip(found["first"], full["first"], strict=False)])
    off = np.abs(np.array(found["paint"][:count]) - np.array(full["paint"])).max(axis=1)
    none = np.abs(np.array(found["none"][:count]) - np.array(full["none"]))
    return Agreement(
        same=float(same),
        off=float(np.mean(off > 0.02)),
        none=float(np.mean(none > 0.02)),
        most=float(np.quantile(off, 0.99)),
        spectra=count,
    )


def record(
    say: Results,
    key: str,
    now: dict[str, Any],
    before: dict[str, Any] | None,
    alike: Agreement | None,
) -> None:
    """What texts quote of a case, as far as it was asked."""
    values = {"rate": quantity(now["rate"], digits=0), "now": quantity(now["cpu"], digits=1)}
    if before:
        values["before"] = quantity(before["cpu"], digits=1)
        values["before_rate"] = quantity(before["rate"], digits=0)
        values["times"] = quantity(now["rate"] / before["rate"], "times", form="g")
    if alike:
        values["same"] = percent(alike.same, 1, n=alike.spectra)
        values["off"] = percent(alike.off, 1, n=alike.spectra)
    wanted = CASES[key].recorded
    say.record(**{f"{key}_{name}": one for name, one in values.items() if name in wanted})


def main() -> None:
    """Time each case, and write the table."""
    parser = command_line(__doc__, {"before": ROOT})
    parser.add_argument("--before", type=Path, help="another checkout, in turn with this one")
    parser.add_argument("--work", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.work:
        print(json.dumps(work(*json.loads(options.work))))
        return
    say = Results("identification_speed", options.out, "numpy")
    if options.before:
        say(f"Before: commit {commit(options.before)}, in turn with this one.")
    say(
        "Spectra a second, and ms of the processor for each; compared with the thorough search: "
        "same first set,\n"
        "a paint's probability and that of none off by more than .02, 99 % of the former; of so many spectra\n"
        f"\n{'':<26}{'before':>8}{'now':>8}{'times':>8}{'cpu':>8}{'cpu':>8}{'times':>8}"
        f"{'same':>9}{'off':>9}{'none':>9}{'99 %':>8}{'of':>6}"
    )
    for key, case in CASES.items():
        if options.quick and not case.recorded:
            continue
        progress(case.words)
        count, compared = (40, 10) if options.quick else (case.spectra, case.compared)
        # What takes a second for each spectrum is not asked for hundreds.
        few = count if case.bands < 100 else 16
        before = run(options.before.resolve(), key, few) if options.before else None
        now = run(ROOT, key, count)
        if now is None:
            say(f"{case.words:<26}{'none, see below':>16}")
            continue
        full = run(ROOT, key, compared, True) if case.compared else None
        cells = [f"{case.words:<26}"]
        for what in ("rate", "cpu"):
            old = before[what] if before else None
            ratio = None
            if old:
                ratio = now[what] / old if what == "rate" else old / now[what]
            cells += [f"{old:8.1f}" if old else f"{'-':>8}", f"{now[what]:8.1f}"]
            cells.append(f"{ratio:8.1f}" if ratio else f"{'-':>8}")
        alike = agreement(now, full) if full else None
        if alike:
            cells += [f"{share:9.1%}" for share in (alike.same, alike.off, alike.none)]
            cells += [f"{alike.most:8.3f}", f"{alike.spectra:6d}"]
        say("".join(cells))
        record(say, key, now, before, alike)
    progress()
    say(f"\n-: not asked, or none in {LIMIT:.0f} s or with the memory there is.")
    say.save()


if __name__ == "__main__":
    main()
