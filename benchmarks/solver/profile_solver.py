"""What bounds the default solver: arithmetic, memory or dispatch, and how near it is.

    python -m benchmarks.solver.profile_solver [--out FOLDER]

For 41 and 4100 wavelengths of two layers: the time of one call, the kernels XLA runs for it and
where their time goes (JAX's own profiler, kernels named by the part of the solver they belong to),
and what the matrix arithmetic alone would take at the rate this machine reaches, in the same run,
with large matrices of the same type on one core. Then what a call of `glazejax.reflectance` for a
glaze takes, in turn with its program alone: as JAX comes, and where JAX may not hand a program to
another thread (`jax_cpu_enable_async_dispatch`).
"""

import os
import re
import tempfile
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.peers import ours, two_layers
from benchmarks.results import Results, command_line, quantity
from benchmarks.timing import in_a_process, interleaved
from glazejax.radiative.ordinates.resolution import resolve_known

PARTS = ("modes", "assemble", "inverse", "eliminate")
REPETITIONS = 100
COPIES = (1, 100)
INDEX = 1.5
# Tolerance of the calls of a glaze.
CALLED_AT = 1e-4


def seconds(program: Callable[[], object], repetitions: int = REPETITIONS) -> float:
    """Median seconds of a call, warm."""
    return interleaved({"": program}, repetitions)[""]


def part_of(kernel_line: str) -> str:
    """Innermost part of the solver that a kernel's operation belongs to, by its name scopes."""
    scopes = re.search(r'op_name="([^"]*)"', kernel_line)
    names = scopes.group(1).split("/") if scopes else []
    found = [name for name in names if name in PARTS]
    return found[-1] if found else "rest"


def kernel_times(
    compiled, arguments, repetitions: int = REPETITIONS
) -> dict[str, tuple[float, float]]:
    """Seconds in kernels and number of kernels of one call, by part of the solver."""
    parts = {}
    for line in compiled.as_text().splitlines():
        named = re.match(r"\s*(?:ROOT )?%([\w.-]+) = ", line)
        if named and not re.search(
            r" (while|call|conditional)\(", line
        ):  # these hold other kernels
            parts[named.group(1)] = part_of(line)
    for _ in range(3):
        jax.block_until_ready(compiled(*arguments))
    with tempfile.TemporaryDirectory() as folder:
        with jax.profiler.trace(folder):
            for _ in range(repetitions):
                jax.block_until_ready(compiled(*arguments))
        (trace,) = Path(folder).glob("**/*.xplane.pb")
        data = jax.profiler.ProfileData.from_file(str(trace))
    total, count = Counter(), Counter()
    for plane in data.planes:
        for line in plane.lines:
            for event in line.events:
                if event.name in parts:
                    total[parts[event.name]] += event.duration_ns * 1e-9
                    count[parts[event.name]] += 1
    return {part: (total[part] / repetitions, count[part] / repetitions) for part in total}


def multiplications(nodes: int, layers: int, batch: int) -> float:
    """Multiply-adds of the dense algebra of one call: four products and an inverse a layer, one
    more at the join.
    """
    return batch * nodes**3 * (layers * 5.0 + 1.0)


def reachable_rate() -> float:
    """Multiply-adds a second of large matrix products on one core."""
    n = 512
    a = jnp.asarray(np.random.default_rng(0).random((n, n)))
    product = jax.jit(lambda x: x @ x)
    cores = os.cpu_count() or 1
    return n**3 / seconds(lambda: product(a), 20) / cores


def call_and_program(hand_over: bool) -> tuple[float, float]:
    """Median seconds of `glazejax.reflectance` for a glaze, and of its compiled program alone, in
    turn; for a process that has not run anything yet.

    Args:
        hand_over: whether JAX hands a program to another thread, as it does by default.
    """
    jax.config.update("jax_cpu_enable_async_dispatch", hand_over)
    jax.config.update("jax_enable_x64", True)
    from glazejax import Bidirectional, Glaze, Layer, catalogue, reflectance

    paints = catalogue.load()
    grid = np.linspace(400.0, 700.0, 41)
    blue, white = (paints[name].resample(grid) for name in ("CobaltBlue", "ZincWhite"))
    glaze = Glaze([Layer(blue, 5e-6), Layer(white, 20e-6)], 0.6)
    geometry = Bidirectional(45, 0)
    work = two_layers()._replace(
        cos_incidence=geometry.cos_incidence, cos_viewing=geometry.cos_viewing
    )
    ground = jnp.full(grid.size, glaze.ground)
    arguments = (glaze.albedo, glaze.optical_thickness, ground)
    compiled = jax.jit(ours.spectrum(work, INDEX, CALLED_AT)).lower(*arguments).compile()
    taken = interleaved(
        {
            "call": lambda: reflectance(glaze, geometry, tolerance=CALLED_AT),
            "program": lambda: compiled(*arguments),
        },
        10 * REPETITIONS,
    )
    return taken["call"], taken["program"]


def calls() -> list[tuple[str, float, float]]:
    """What is done, and its `call_and_program`, each in a process of its own."""
    rows = []
    for words, hand_over in (("as JAX comes", True), ("not handed to a thread", False)):
        code = (
            f"import json, benchmarks.solver.profile_solver as p; p.REPETITIONS = {REPETITIONS}; "
            f"print(json.dumps(p.call_and_program({hand_over})))"
        )
        rows.append((words, *in_a_process("-c", code)[-1]))
    return rows


def main() -> None:
    options = command_line(__doc__).parse_args()
    if options.quick:
        globals().update(REPETITIONS=5, COPIES=(1,))
    jax.config.update("jax_enable_x64", True)
    say = Results("profile_solver", options.out)
    rate = reachable_rate()
    say(f"large matrix products: {rate / 1e9:.1f} billion multiply-adds a second and core")
    empty = jax.jit(lambda x: x + 1.0)
    one = jnp.zeros(())
    dispatch = seconds(lambda: empty(one))
    say(f"an empty program: {1e6 * dispatch:.0f} us\n")
    header = (
        f"{'wavelengths':>11} {'tolerance':>9} {'directions':>10} {'call us':>8} {'kernels':>8} "
        f"{'us each':>8}"
    )
    say(f"{header} {'algebra at full rate':>20}   share of kernel time")
    work = two_layers()
    for copies in COPIES:
        albedo, thickness = (
            jnp.asarray(np.tile(a, (copies, 1))) for a in (work.albedo, work.optical_thickness)
        )
        ground = jnp.full(albedo.shape[0], work.ground)
        for tolerance in (1e-3, 1e-7):
            arguments = (albedo, thickness, ground)
            compiled = jax.jit(ours.spectrum(work, INDEX, tolerance)).lower(*arguments).compile()
            taken = seconds(
                lambda c=compiled, a=arguments: c(*a), REPETITIONS if copies == 1 else 20
            )
            parts = kernel_times(compiled, arguments, REPETITIONS if copies == 1 else 10)
            inside, number = (sum(value[i] for value in parts.values()) for i in (0, 1))
            resolution = resolve_known(tolerance, INDEX)
            nodes = resolution.cone + resolution.total
            algebra = multiplications(nodes, 2, albedo.shape[0]) / rate
            largest_first = sorted(parts.items(), key=lambda item: -item[1][0])
            if copies == 1 and tolerance == 1e-3:
                say.record(
                    kernel=quantity(1e6 * inside / number, "µs", digits=1),
                    kernels=quantity(number, digits=0),
                )
            shares = ", ".join(
                f"{part} {100 * value[0] / inside:.0f} %" for part, value in largest_first
            )
            say(
                f"{albedo.shape[0]:11d} {tolerance:9.0e} {nodes:10d} {1e6 * taken:8.0f} "
                f"{number:8.0f} "
                f"{1e6 * inside / number:8.1f} {100 * algebra / taken:18.0f} %   {shares}"
            )
    say(
        "\n'algebra at full rate': share of the call that the multiply-adds would take at the rate "
        "above. Kernels of a\n"
        "few microseconds are bound by their own start, long ones by memory and by vectors as "
        "short as a matrix row.\n"
        f"\nreflectance(glaze, '45:0'), 41 wavelengths, two coats, tolerance {CALLED_AT:g}, and its "
        "program alone, in turn:\n"
        f"{'':<24}{'call us':>9}{'program us':>12}{'other us':>11}"
    )
    rows = calls()
    for words, whole, inside in rows:
        say(f"{words:<24}{1e6 * whole:9.0f}{1e6 * inside:12.0f}{1e6 * (whole - inside):11.0f}")
    (_, usual_call, usual), (_, _, kept) = rows
    say.record(
        hand_over=quantity(usual / kept, "times", digits=1),
        call=quantity(usual_call / usual, "times", digits=1),
    )
    say.save()


if __name__ == "__main__":
    main()
