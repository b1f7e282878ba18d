"""What a GPU gives, goal by goal.

    python -m benchmarks.solver.on_gpu [million] [picture] [identify] [tables] [tests] [--device cpu]
                                       [--quick] [--out FOLDER]

Without names all of them, in this order. `million`: a million stacks of two layers at a tolerance of
1e-4, in double precision and single, with and without the gradient, inputs and results in the
device's memory. `picture`: 4096 x 4096 pixels with two maps of thickness. `identify`: 1000
and 50,000 spectra of 31 bands among all pairs of twenty paints. Times are warm medians, next to the first call's;
errors of the million are those of 1000 of its stacks against a tolerance of 1e-8 in double
precision; the processor of the same machine runs the same programs. `tables`:
`benchmarks.solver.frontier`, `solver.scaling`, `render.savings` and `paint.identification` with
`--device gpu`; `tests`: the tests with JAX_PLATFORMS=cuda. A goal that fails is said, and the rest
goes on; the file is written after each. `--quick` tries the command itself: every size a hundredth.
"""

import functools
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from benchmarks import device
from benchmarks.results import Results, command_line, quantity
from benchmarks.timing import time_call

NEEDS = ("gpu",)

TABLES = ("solver.frontier", "solver.scaling", "render.savings", "paint.identification")
REPETITIONS = 5
TOLERANCE = 1e-4
CHECKED = 1000


def cold_and_warm(
    program: Callable[[], Any], repetitions: int = REPETITIONS
) -> tuple[Any, float, float]:
    """Result, seconds of the first call, median seconds of later ones."""
    result, first = time_call(program)
    later = [time_call(program)[1] for _ in range(repetitions)]
    return result, first, float(np.median(later))


def processor() -> Any:
    """The CPU of this machine as a device of JAX."""
    return jax.devices("cpu")[0]


def million(say: Results, quick: bool) -> None:
    """Value, and value and gradient by albedo, thickness and ground, in both precisions."""
    from glazejax import stack_reflectance_factor

    count = 10_000 if quick else 1_000_000
    rng = np.random.default_rng(0)
    stacks = rng.uniform(0, 1, (count, 2)), rng.uniform(0.1, 2, (count, 2)), np.full(count, 0.7)

    def factor(q: Any, d: Any, ground: Any, tolerance: float = TOLERANCE) -> jax.Array:
        return stack_reflectance_factor(q, d, ground, cos_incidence=0.8, tolerance=tolerance)

    def value_and_sum(*inputs: Any) -> tuple[jax.Array, jax.Array]:
        value = factor(*inputs)
        return value.sum(), value

    gradient = jax.value_and_grad(value_and_sum, argnums=(0, 1, 2), has_aux=True)
    # What is right comes from the processor, in double precision.
    with jax.default_device(processor()):
        few = [jnp.asarray(a[:CHECKED]) for a in stacks]
        exact = np.asarray(factor(*few, tolerance=1e-8))
        slopes = jax.grad(lambda *a: factor(*a, tolerance=1e-8).sum(), argnums=(0, 1, 2))(*few)
        slopes = [np.asarray(slope) for slope in slopes]

    here = jax.devices()[0]
    # One repetition on the processor, which takes a hundred times as long.
    places = [(here, "", REPETITIONS)]
    if here != processor():
        places.append((processor(), "_processor", 1))
    for place, suffix, repetitions in places:
        for single in (False, True):
            with jax.enable_x64(not single), jax.default_device(place):
                inputs = [jax.device_put(jnp.asarray(a), place) for a in stacks]
                precision = "float32" if single else "float64"
                value, first, warm = cold_and_warm(
                    functools.partial(jax.jit(factor), *inputs), repetitions
                )
                error = np.max(np.abs(np.asarray(value)[:CHECKED] - exact))
                say(
                    f"{count} stacks of 2 layers, {precision}, {place.platform}: "
                    f"{1e3 * warm:.2f} ms (first {first:.1f} s), error {error:.1e}"
                )
                (_, derivatives), first_slopes, warm_slopes = cold_and_warm(
                    functools.partial(jax.jit(gradient), *inputs), repetitions
                )
                pairs = zip(derivatives, slopes, strict=True)
                worst = max(float(np.max(np.abs(np.asarray(a)[:CHECKED] - b))) for a, b in pairs)
                say(
                    f"  with gradient: {1e3 * warm_slopes:.2f} ms (first {first_slopes:.1f} s), "
                    f"error of slopes {worst:.1e}"
                )
                say.record(
                    **{
                        f"{precision}_ms{suffix}": quantity(1e3 * warm, "ms", 2, form="s", n=count),
                        f"{precision}_gradient_ms{suffix}": quantity(
                            1e3 * warm_slopes, "ms", 2, form="s", n=count
                        ),
                        f"{precision}_error{suffix}": quantity(
                            error, digits=0, form="e", n=CHECKED
                        ),
                        f"{precision}_gradient_error{suffix}": quantity(
                            worst, digits=0, form="e", n=CHECKED
                        ),
                    }
                )


def large_picture(say: Results, quick: bool) -> None:
    """Two maps of thickness to sRGB."""
    from benchmarks.render.savings import picture_program

    size = 400 if quick else 4096
    draw = picture_program(size)
    _, first, warm = cold_and_warm(lambda: draw().srgb)
    say(f"picture of {size} x {size} pixels, two maps, to sRGB: {warm:.3f} s (first {first:.1f} s)")
    say.record(picture_seconds=quantity(warm, "s", 2, form="s", n=size * size))


def identify_spectra(say: Results, quick: bool) -> None:
    """Spectra searched among all singles and pairs, and how often both paints are right."""
    from benchmarks.paint.identification import first_set, simulated
    from glazefit import identify
    from glazejax import catalogue

    paints = list(catalogue.load().values())
    grid = paints[0].wavelengths
    # A thousand first: they say what the whole set will take.
    for name, count in (("few", 1000), ("many", 50_000)):
        count = count // 100 if quick else count
        spectra, grounds, pairs = simulated(paints, count, 1, True)
        search = functools.partial(identify, grid, spectra, paints, ground=grounds, max_paints=2)
        answer, first, warm = cold_and_warm(search, 1)
        right = np.mean([first_set(answer, i)[0] == set(pairs[i].tolist()) for i in range(count)])
        say(
            f"{count} spectra, pairs of {len(paints)} paints: {warm:.1f} s, "
            f"{count / warm:.0f} a second (first {first:.1f} s); both paints right {right:.1%}"
        )
        rate = quantity(count / warm, digits=2, form="s", n=count)
        say.record(**{f"identify_{name}_rate": rate})
        say.save()


def run_all(say: Results, options: Any, commands: list[list[str]], **environment: str) -> None:
    """Run commands one after the other and say which failed."""
    # JAX takes most of a GPU's memory for itself; here it is only asked on.
    shared = {**os.environ, "XLA_PYTHON_CLIENT_PREALLOCATE": "false", **environment}
    for command in commands:
        returned = subprocess.run([sys.executable, *command], env=shared).returncode
        result = "done" if returned == 0 else f"failed ({returned})"
        say(f"python {' '.join(command)}: {result}")


def tables(say: Results, options: Any) -> None:
    """The benchmarks that have a column for a GPU."""
    words = ["--device", options.device, "--out", str(options.out)]
    run_all(say, options, [["-m", f"benchmarks.{name}", *words] for name in TABLES])


def tests(say: Results, options: Any) -> None:
    """All tests on the device."""
    platform = {"JAX_PLATFORMS": "cuda"} if options.device == "gpu" else {}
    folder = str(Path(__file__).parents[2] / "tests")
    run_all(say, options, [["-m", "pytest", "-q", folder]], **platform)


GOALS: dict[str, Callable[[Results, Any], None]] = {
    "million": lambda say, options: million(say, options.quick),
    "picture": lambda say, options: large_picture(say, options.quick),
    "identify": lambda say, options: identify_spectra(say, options.quick),
    "tables": tables,
    "tests": tests,
}


def main() -> None:
    parser = command_line(__doc__)
    device.add_option(parser)
    parser.set_defaults(device="gpu")
    parser.add_argument("goals", nargs="*", metavar="GOAL", help=", ".join(GOALS))
    options = parser.parse_args()
    if unlisted := [name for name in options.goals if name not in GOALS]:
        parser.error(f"no goal {unlisted[0]!r}; there are {', '.join(GOALS)}")
    jax.config.update("jax_enable_x64", True)
    chosen = device.start(options.device)
    say = Results("on_gpu" if options.device == "gpu" else "on_gpu_cpu", options.out)
    say(device.words(chosen))
    # With --quick the command itself is tried, not the other benchmarks and the tests.
    usual = [name for name in GOALS if not options.quick or name not in ("tables", "tests")]
    for name in options.goals or usual:
        try:
            GOALS[name](say, options)
        except Exception as trouble:
            # One failure is a result: the machine is there for a short time only.
            say(f"{name} failed: {type(trouble).__name__}: {str(trouble).splitlines()[0]}")
        say.save()


if __name__ == "__main__":
    main()
