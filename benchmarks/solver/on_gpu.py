"""All that waits for a GPU: the goals set for one, then the tables and the tests there.

    python -m benchmarks.solver.on_gpu [--device cpu] [--only-goals] [--quick] [--out FOLDER]

Goals: a million stacks of two layers at a tolerance of 1e-4, in double precision and single, with
and without the gradient, inputs and results in the device's memory; a picture of 4096 x 4096 pixels
with two maps of thickness; 50,000 spectra identified among all pairs of twenty paints. Times are
warm medians, next to the first call's; errors of the million are those of 1000 of its stacks
against a tolerance of 1e-8 in double precision. Then, one after the other,
`benchmarks.solver.frontier`, `solver.scaling`, `render.savings` and `paint.identification` with
`--device gpu`, and the tests with JAX_PLATFORMS=cuda. What fails is said, and the rest
goes on. `--quick` tries the command itself: every size a hundredth, and the goals only.
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
from benchmarks.results import Results, command_line
from benchmarks.timing import time_call

NEEDS = ("gpu",)

TABLES = ("solver.frontier", "solver.scaling", "render.savings", "paint.identification")
REPETITIONS = 5
TOLERANCE = 1e-4
CHECKED = 1000


def cold_and_warm(program: Callable[[], Any]) -> tuple[Any, float, float]:
    """Result, seconds of the first call, median seconds of later ones."""
    found, first = time_call(program)
    later = [time_call(program)[1] for _ in range(REPETITIONS)]
    return found, first, float(np.median(later))


def million(say: Results, count: int) -> None:
    """Value, and value and gradient by albedo, thickness and ground, in both precisions."""
    from glazejax import stack_reflectance_factor

    rng = np.random.default_rng(0)
    given = rng.uniform(0, 1, (count, 2)), rng.uniform(0.1, 2, (count, 2)), np.full(count, 0.7)

    def factor(q: Any, d: Any, ground: Any, tolerance: float = TOLERANCE) -> jax.Array:
        return stack_reflectance_factor(q, d, ground, cos_incidence=0.8, tolerance=tolerance)

    def value_and_sum(*inputs: Any) -> tuple[jax.Array, jax.Array]:
        value = factor(*inputs)
        return value.sum(), value

    few = [jnp.asarray(a[:CHECKED]) for a in given]
    exact = np.asarray(factor(*few, tolerance=1e-8))
    slopes = jax.grad(lambda *a: factor(*a, tolerance=1e-8).sum(), argnums=(0, 1, 2))(*few)
    slopes = [
        np.asarray(slope) for slope in slopes
    ]  # of double precision where JAX's own would no longer be
    gradient = jax.value_and_grad(value_and_sum, argnums=(0, 1, 2), has_aux=True)
    for single in (False, True):
        with jax.enable_x64(not single):
            inputs = [jax.device_put(jnp.asarray(a)) for a in given]
            precision = "float32" if single else "float64"
            found, first, warm = cold_and_warm(functools.partial(jax.jit(factor), *inputs))
            error = np.max(np.abs(np.asarray(found)[:CHECKED] - exact))
            times = f"{1e3 * warm:.2f} ms (first {first:.1f} s)"
            say(f"{count} stacks of 2 layers, {precision}: {times}, error {error:.1e}")
            found, first, warm = cold_and_warm(functools.partial(jax.jit(gradient), *inputs))
            pairs = zip(found[1], slopes, strict=True)
            error = max(float(np.max(np.abs(np.asarray(a)[:CHECKED] - b))) for a, b in pairs)
            times = f"{1e3 * warm:.2f} ms (first {first:.1f} s)"
            say(f"  with gradient, {precision}: {times}, error of slopes {error:.1e}")


def large_picture(say: Results, size: int) -> None:
    from benchmarks.render.savings import picture_program

    draw = picture_program(size)
    _, first, warm = cold_and_warm(lambda: draw().srgb)
    say(f"picture of {size} x {size} pixels, two maps, to sRGB: {warm:.3f} s (first {first:.1f} s)")


def goals(say: Results, small: bool) -> None:
    """The three goals; a part that fails is said."""
    from benchmarks.paint.identification import speed

    parts: tuple[tuple[str, Callable[[], None]], ...] = (
        ("million", lambda: million(say, 10_000 if small else 1_000_000)),
        ("picture", lambda: large_picture(say, 400 if small else 4096)),
        ("identification", lambda: speed(say, *(64, 16, 16) if small else (50_000,))),
    )
    for name, part in parts:
        try:
            part()
        except (
            Exception
        ) as trouble:  # one failure is a result; the machine is there for a short time only
            say(f"{name} failed: {type(trouble).__name__}: {str(trouble).splitlines()[0]}")


def main() -> None:
    parser = command_line(__doc__, {"only_goals": True})
    device.add_option(parser)
    parser.set_defaults(device="gpu")
    parser.add_argument("--only-goals", action="store_true", help="no tables and no tests")
    options = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    chosen = device.start(options.device)
    say = Results("on_gpu" if options.device == "gpu" else "on_gpu_cpu", options.out)
    say(device.words(chosen))
    goals(say, options.quick)
    say.save()
    if options.only_goals:
        return
    # JAX takes most of a GPU's memory for itself; here it is only asked on.
    shared = {**os.environ, "XLA_PYTHON_CLIENT_PREALLOCATE": "false"}
    commands = [
        ["-m", f"benchmarks.{name}", "--device", options.device, "--out", str(options.out)]
        for name in TABLES
    ]
    tests = ["-m", "pytest", "-q", str(Path(__file__).parents[2] / "tests")]
    for command in [*commands, tests]:
        platform = {"JAX_PLATFORMS": "cuda"} if command is tests and options.device == "gpu" else {}
        done = subprocess.run([sys.executable, *command], env={**shared, **platform})
        say(
            f"python {' '.join(command)}: "
            f"{'done' if done.returncode == 0 else f'failed ({done.returncode})'}"
        )
    say.save()


if __name__ == "__main__":
    main()
