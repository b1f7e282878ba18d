"""What a user waits for: seconds from the start of a process to its answer, with an empty
compilation cache and again.

    python -m benchmarks.cold_start [--out FOLDER] [--only NAME ...] [--repetitions N]
        [--before CHECKOUT]

Each command runs in processes of its own: once with an empty cache of compiled programs, and again
with what that run left there. JAX's own monitoring says how many programs were compiled and where
the time went: tracing Python, lowering to XLA, compiling (or taking from the cache); the rest is
imports and work. Python and `import jax` alone are timed, too, which nobody who uses JAX can go
below. Seconds of the processor, over all threads, are given next to the seconds that pass: other
programs on the machine change these much less.

With ``--before`` each command is run from another checkout too, in turn with this one.
"""

import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

from benchmarks.results import Results, command_line, git, quantity
from glazejax import catalogue, samples
from glazejax.appearance.scene.file import example

# Runs a command as its entry point does, and adds up what JAX's monitoring says.
_RUN = """
import json, sys
import jax.monitoring as monitoring
spent = {}
def add(event, seconds, **about):
    count, total = spent.get(event, (0, 0.0))
    spent[event] = count + 1, total + seconds
monitoring.register_event_duration_secs_listener(add)
from glazejax.commands.main import main
where = sys.argv.pop(1)
try:
    main()
finally:
    open(where, "w").write(json.dumps(spent))
"""
# The studio until its page has what it computes the first colour from: the page itself, and paints.
_STUDIO = """
import sys, threading, urllib.request
from glazejax.commands.main import start_jax
start_jax()
from glazejax.studio.server import Studio
from websockets.sync.client import connect
studio = Studio()
threading.Thread(target=studio.run).start()
with urllib.request.urlopen(studio.link) as page:
    page.read()
where = studio.link.partition("//")[2]
host = where.partition("/")[0]
with connect(f"ws://{where}socket", origin=f"http://{host}", max_size=None) as page:
    page.send('{"type": "hello"}')
    assert b"ZincWhite" in page.recv(timeout=60)
studio.stop()
"""
ROOT = Path(__file__).resolve().parents[1]
_TRACE = "/jax/core/compile/jaxpr_trace_duration"
_LOWER = "/jax/core/compile/jaxpr_to_mlir_module_duration"
_COMPILE = "/jax/core/compile/backend_compile_duration"
QUOTED = {
    "render": "render",
    "recover": "recover",
    "identify": "identify",
    "recipe --srgb": "recipe",
}


class Timing(NamedTuple):
    """One process."""

    seconds: float
    cpu: float
    programs: int
    trace: float
    lower: float
    compile: float


def commands(folder: Path) -> dict[str, list[str]]:
    """What is run: arguments of Python, or of glazejax where they do not begin with -c."""
    films, picture = str(samples.path()), ["--out", str(folder / "picture.png"), "--overwrite"]
    return {
        "python": ["-c", "pass"],
        "import jax": ["-c", "import jax"],
        "import glazejax": ["-c", "import glazejax"],
        "import glazefit": ["-c", "import glazefit"],
        "render": [
            "render",
            "--coats",
            "CobaltBlue:5um,ZincWhite:20um",
            "--ground",
            "0.6",
            *picture,
        ],
        "recover": [
            "recover",
            str(folder / "films.csv"),
            "--no-plots",
            "--out",
            str(folder / "found"),
            "--overwrite",
        ],
        "recover --into": [
            *("recover", str(folder / "blue.csv"), "--white", "ZincWhite"),
            *("--into", str(folder / "mine.csv"), "--overwrite"),
        ],
        "identify": ["identify", films, "--catalogue", "oils"],
        "recipe --srgb": ["recipe", "--srgb", "#8a4b2d", *picture],
        "recipe --colourchecker": ["recipe", "--colourchecker", *picture],
        "posterior": [
            "posterior",
            films,
            "--sample",
            "12A",
            "--steps",
            "500",
            "--out",
            str(folder / "posterior"),
            "--overwrite",
        ],
        "scene": ["scene", str(folder / "scene.toml"), *picture],
        "studio": ["-c", _STUDIO],
        "predict": ["predict", "10 Vermillion + 90 ZincWhite", "--thickness", "10um,25um"],
    }


def prepare(folder: Path) -> None:
    """Files that the commands read: twelve simulated masstones, and a masstone with its tint."""
    from benchmarks.paint.tubes import CASES, WHITE, tube, written
    from glazefit import Instrument, Noise
    from glazefit.film.simulate import simulate_paints
    from glazefit.recover.joint.joint import UNIT

    paints = list(catalogue.load().values())[:12]
    (folder / "films.csv").write_text(
        written(simulate_paints(paints, UNIT, instrument=Instrument(), noise=Noise()))
    )
    (folder / "scene.toml").write_text(example())
    made = tube(catalogue.pigment("CobaltBlue"), catalogue.pigment(WHITE), CASES[0], 1)
    (folder / "blue.csv").write_text(written(made.films.take([0, 1])))


def timed(words: list[str], cache: Path, root: Path) -> Timing:
    """One process, from its start to its end, of the packages in a checkout.

    Raises:
        SystemExit: the command failed; says what it printed.
    """
    spent_file = cache.with_suffix(".json")
    spent_file.unlink(missing_ok=True)
    plain = words[0] == "-c"
    line = (
        [sys.executable, *words] if plain else [sys.executable, "-c", _RUN, str(spent_file), *words]
    )
    paths = os.pathsep.join([str(root / "src"), str(root / "fitting")])
    environment = {**os.environ, "GLAZEJAX_CACHE": str(cache), "PYTHONPATH": paths}
    before, began = _processor(), time.perf_counter()
    done = subprocess.run(line, capture_output=True, text=True, env=environment, check=False)
    took, cpu = time.perf_counter() - began, _processor() - before
    if done.returncode:
        raise SystemExit(f"{' '.join(words)} failed: {done.stderr.strip()[-500:]}")
    spent = {} if plain else json.loads(spent_file.read_text())
    count, compiling = spent.get(_COMPILE, (0, 0.0))
    trace, lower = (spent.get(event, (0, 0.0))[1] for event in (_TRACE, _LOWER))
    return Timing(took, cpu, count, trace, lower, compiling)


def _processor() -> float:
    """Seconds that ended child processes have had of the processor."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def row(name: str, first: Timing, warm: Timing) -> str:
    """A command's line: with an empty cache, and the medians with a full one."""
    shown = f"{name:<32}{first.seconds:>8.1f}{warm.seconds:>8.1f}{first.cpu:>9.1f}{warm.cpu:>8.1f}"
    shown += f"{first.programs:>10}{first.trace:>15.1f}{first.lower:>8.1f}{first.compile:>9.1f}"
    return shown + f"{warm.trace:>14.1f}{warm.lower:>8.1f}{warm.compile:>8.1f}"


def record(say: Results, key: str, first: Timing, warm: Timing) -> None:
    """Seconds of a command, and where they went."""
    seconds = {
        "empty": first.seconds,
        "again": warm.seconds,
        "trace": first.trace,
        "compile": first.compile,
        "again_load": warm.compile,
    }
    say.record(**{f"{key}_{name}": quantity(v, "s", digits=1) for name, v in seconds.items()})
    over = warm.seconds / first.seconds
    say.record(**{f"{key}_over": quantity(over, "times", digits=2, form="g")})


def commit(checkout: Path) -> str:
    """Short name of the commit that a checkout is at."""
    return git("-C", str(checkout), "rev-parse", "--short", "HEAD")


def main() -> None:
    quick = {"only": list(QUOTED)}
    parser = command_line(__doc__, quick, repetitions=(3, 1, "runs with a full cache"))
    parser.add_argument(
        "--only", nargs="+", help="commands of these names, whose file is not written"
    )
    parser.add_argument(
        "--before", type=Path, help="another checkout, whose commands are run in turn with these"
    )
    options = parser.parse_args()
    say = Results("cold_start", options.out)
    say(
        "Seconds from the start of the process to its end, and seconds of the processor (cpu), "
        "with an empty cache and\n"
        "warm; of the warm runs the medians. The studio is waited for until its page has its paints."
    )
    if options.before is not None:
        say(f"Before: commit {commit(options.before)}. Each command of both in turn.")
    say(
        f"\n{'':<32}{'empty':>8}{'warm':>8}{'cpu':>9}{'cpu':>8}{'programs':>10}"
        "   empty: trace   lower  compile   warm: trace   lower    load"
    )
    checkouts = (
        {"": ROOT} if options.before is None else {", before": options.before.resolve(), "": ROOT}
    )
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        prepare(folder)
        for number, (name, words) in enumerate(commands(folder).items()):
            if options.only and name not in options.only:
                continue
            caches = {which: folder / f"cache{number}{which}" for which in checkouts}
            first, again = {}, {which: [] for which in checkouts}
            for which, cache in caches.items():
                cache.mkdir()
                first[which] = timed(words, cache, checkouts[which])
            for _ in range(options.repetitions):
                for which, cache in caches.items():
                    again[which].append(timed(words, cache, checkouts[which]))
            warm = {
                which: Timing(*map(statistics.median, zip(*runs, strict=True)))
                for which, runs in again.items()
            }
            for which in checkouts:
                say(row(name + which, first[which], warm[which]))
            if name in QUOTED:
                record(say, QUOTED[name], first[""], warm[""])
    say(
        "\nTrace, lower, compile: sums over all programs; programs compiled side by side count each."
    )
    busy = ", ".join(f"{load:.1f}" for load in os.getloadavg())
    say(
        "Processes that wanted the processor at the end, mean of the last 1, 5 and 15 minutes: "
        f"{busy}."
    )
    if options.quick or not options.only:
        say.save()


if __name__ == "__main__":
    main()
