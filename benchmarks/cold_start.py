"""What a user waits for: seconds from the start of a process to its answer, with an empty compilation cache and again.

    python -m benchmarks.cold_start [--out FOLDER] [--only NAME] [--repetitions N]

Each command runs in processes of its own: once with an empty cache of compiled programs, and again with what that run
left there. JAX's own monitoring tells how many programs were compiled and where the time went: tracing Python, lowering
to XLA, compiling (or taking from the cache); the rest is imports and work. Beside them stand Python and `import jax`
alone, which nobody who uses JAX can go below.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

from benchmarks.results import Results, add_option
from benchmarks.timing import environment
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
_TRACE = "/jax/core/compile/jaxpr_trace_duration"
_LOWER = "/jax/core/compile/jaxpr_to_mlir_module_duration"
_COMPILE = "/jax/core/compile/backend_compile_duration"


class Timing(NamedTuple):
    """One process."""

    seconds: float
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
        "render": ["render", "--layers", "CobaltBlue:5um,ZincWhite:20um", "--ground", "0.6", *picture],
        "recover": ["recover", str(folder / "films.csv"), "--no-plots", "--out", str(folder / "found"), "--overwrite"],
        "recover --into": [
            *("recover", str(folder / "blue.csv"), "--white", "ZincWhite"),
            *("--into", str(folder / "mine.csv"), "--overwrite"),
        ],
        "identify": ["identify", films],
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
        "predict": ["predict", "10 Vermillion + 90 ZincWhite", "--thickness", "10um,25um"],
    }


def prepare(folder: Path) -> None:
    """Files that the commands read: twelve simulated masstones, and a masstone with its tint."""
    from benchmarks.tubes import CASES, WHITE, tube, written
    from glazefit import Instrument, Noise
    from glazefit.film.simulate import simulate_paints
    from glazefit.recover.joint import UNIT

    paints = list(catalogue.load().values())[:12]
    (folder / "films.csv").write_text(written(simulate_paints(paints, UNIT, instrument=Instrument(), noise=Noise())))
    (folder / "scene.toml").write_text(example())
    made = tube(catalogue.pigment("CobaltBlue"), catalogue.pigment(WHITE), CASES[0], 1)
    (folder / "blue.csv").write_text(written(made.films.take([0, 1])))


def timed(words: list[str], cache: Path, told: Path) -> Timing:
    """One process, from its start to its end.

    Raises:
        SystemExit: the command failed; says what it printed.
    """
    told.unlink(missing_ok=True)
    plain = words[0] == "-c"
    line = [sys.executable, *words] if plain else [sys.executable, "-c", _RUN, str(told), *words]
    began = time.perf_counter()
    done = subprocess.run(
        line, capture_output=True, text=True, env={**os.environ, "GLAZEJAX_CACHE": str(cache)}, check=False
    )
    took = time.perf_counter() - began
    if done.returncode:
        raise SystemExit(f"{' '.join(words)} failed: {done.stderr.strip()[-500:]}")
    spent = {} if plain else json.loads(told.read_text())
    count, compiling = spent.get(_COMPILE, (0, 0.0))
    trace, lower = (spent.get(event, (0, 0.0))[1] for event in (_TRACE, _LOWER))
    return Timing(took, count, trace, lower, compiling)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add_option(parser)
    parser.add_argument("--only", help="commands whose name holds this")
    parser.add_argument("--repetitions", type=int, default=3, help="runs with a full cache (default: %(default)s)")
    options = parser.parse_args()
    say = Results("cold_start", options.out)
    say(environment())
    say("Seconds from the start of the process to its end; of the warm runs the median.")
    say()
    say(
        f"{'':<24}{'empty':>8}{'warm':>8}{'programs':>10}   empty: trace   lower  compile   warm: trace   lower    load"
    )
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        prepare(folder)
        for number, (name, words) in enumerate(commands(folder).items()):
            if options.only and options.only not in name:
                continue
            cache = folder / f"cache{number}"
            cache.mkdir()
            first = timed(words, cache, folder / "told.json")
            again = [timed(words, cache, folder / "told.json") for _ in range(options.repetitions)]
            warm = sorted(again)[len(again) // 2]
            median = statistics.median(run.seconds for run in again)
            say(
                f"{name:<24}{first.seconds:>8.1f}{median:>8.1f}{first.programs:>10}"
                f"{first.trace:>15.1f}{first.lower:>8.1f}{first.compile:>9.1f}"
                f"{warm.trace:>14.1f}{warm.lower:>8.1f}{warm.compile:>8.1f}"
            )
    say()
    say("Trace, lower, compile: sums over all programs; programs compiled side by side count each.")
    if not options.only:
        say.save()


if __name__ == "__main__":
    main()
