"""H, U and M of all stacks in one program: three ways to multiply by H + U, in time, memory and
error.

    python -m benchmarks.solver.auxiliary_products [--out FOLDER] [--repetitions N]

"one by one" makes each stack's matrix and solves with it before the next; "matrices" makes all of
them first; "transforms" never makes one, but multiplies by its Toeplitz and Hankel numbers with
fast Fourier transforms.
"""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.results import Results, command_line, quantity
from benchmarks.timing import REPEATED, interleaved
from glazejax import stack_reflectance_factor
from glazejax.radiative.auxiliary import uniform
from glazejax.radiative.auxiliary.kernel_table import KernelTable
from glazejax.radiative.auxiliary.uniform import reflectance_factor
from glazejax.radiative.auxiliary.uniform_solver import GridSettings, solve

WAYS = {"one by one": "matrix", "matrices": "matrices", "transforms": "fft"}
STEP, INDEX, GROUND = 0.01, 1.5, 0.8
# (segments of the thickest, wavelengths, glazes)
OWN = (
    (16, 41, 1),
    (64, 41, 1),
    (120, 41, 1),
    (250, 41, 1),
    (500, 41, 1),
    (120, 401, 1),
    (120, 41, 10),
)
FIXED = (64, 250, 500, 1000, 2000)
GRADIENT = (32, 120)
QUOTED = {"q120_401": (120, 401, 1), "q500": (500, 41, 1)}
# Matrices of more bytes in all are not made.
_MOST_BYTES = 2**30
# The matrix of the fixed step and its copies take a gigabyte beyond.
_MOST_FIXED = 2048

Given = tuple[np.ndarray, np.ndarray]


class Row(NamedTuple):
    """Of one case: seconds of each way, megabytes of each, the largest difference between them."""

    seconds: dict[str, float]
    megabytes: dict[str, float]
    apart: float


def stacks(segments: int, wavelengths: int, glazes: int) -> Given:
    """Albedo and thickness of two layers, (wavelengths, 2) of each glaze; the thickest needs so
    many segments.
    """
    rng = np.random.default_rng(segments)
    shape = (glazes * wavelengths, 2)
    albedo, thickness = rng.uniform(0.2, 0.99, shape), rng.uniform(0.3, 1.0, shape)
    return albedo, thickness * segments * STEP / thickness.sum(axis=1).max()


def megabytes(given: Given, settings: dict[str, Any]) -> float:
    """Working memory of the largest program that a call runs, as the compiler plans it."""
    full = GridSettings(
        settings["variant"], settings["corrected"], INDEX, STEP, 0, settings["product"]
    )
    alone = {"albedo": given[0], "optical_thickness": given[1], "substrate_reflectance": GROUND}
    batch, _ = uniform._flatten(alone | {"cos_incidence": 1.0, "cos_viewing": 1.0})
    count = np.asarray(uniform._segments(given[1].sum(axis=1), full))
    largest = 0.0
    groups = uniform._groups(count, full, None)
    for rows, most in groups:
        if most != max(m for _, m in groups):
            continue
        single = (
            full.variant != "fixed_step" and full.product == "matrix" and most >= uniform._ALONE
        )
        chosen = rows[:1] if single else rows
        piece = jax.tree.map(lambda leaf, index=chosen: leaf[index], batch)
        table = KernelTable(INDEX, STEP, most) if full.variant == "fixed_step" else None
        vectors = uniform._vectors(table, full)(most)
        compiled = solve.lower(piece, count[chosen], vectors, full._replace(most=most)).compile()
        analysis = compiled.memory_analysis()
        largest = max(largest, analysis.temp_size_in_bytes / 2**20) if analysis else float("nan")
    return largest


def program(given: Given, settings: dict[str, Any]) -> Callable[[], Any]:
    """Reflectance factors at 0/0 degrees."""
    return functools.partial(reflectance_factor, *given, GROUND, step=STEP, **settings)


def gradient(given: Given, settings: dict[str, Any]) -> Callable[[], Any]:
    """Their sum and its derivatives by every albedo and thickness."""

    def total(q: jax.Array, d: jax.Array) -> jax.Array:
        return jnp.sum(reflectance_factor(q, d, GROUND, step=STEP, **settings))

    return functools.partial(jax.value_and_grad(total, argnums=(0, 1)), *map(jnp.asarray, given))


def compare(
    say: Results, cases, settings: dict[str, Any], options, *, slopes: bool = False
) -> dict[tuple[int, int, int], Row]:
    """A table: one row for each case, all ways that it fits, timed in turn."""
    rows = {}
    for segments, wavelengths, glazes in cases:
        given = stacks(segments, wavelengths, glazes)
        ways = {}
        for name, product in WAYS.items():
            own = settings["variant"] != "fixed_step"
            if product == "matrices" and (
                not own or 8 * segments**2 * wavelengths * glazes > _MOST_BYTES
            ):
                continue
            if product == "matrix" and not own and segments > _MOST_FIXED:
                continue
            ways[name] = settings | {"product": product}
        make = gradient if slopes else program
        programs = {name: make(given, how) for name, how in ways.items()}
        sizes = {} if slopes else {name: megabytes(given, how) for name, how in ways.items()}
        seconds = interleaved(programs, options.repetitions, budget=options.budget)
        first, *others = (jax.tree.leaves(p()) for p in programs.values())
        pairs = [pair for other in others for pair in zip(other, first, strict=True)]
        apart = max((float(np.max(np.abs(np.asarray(a) - b))) for a, b in pairs), default=0.0)
        rows[segments, wavelengths, glazes] = Row(seconds, sizes, apart)
        cells = "".join(f"{name:>12}{1e3 * s:9.2f} ms" for name, s in seconds.items())
        memory = "".join(f"{m:9.2f}" for m in sizes.values())
        best = min(seconds, key=seconds.__getitem__)
        words = f"Q {segments:4d}, {wavelengths:3d} x {glazes:2d} stacks"
        say(f"{words:<28}{cells}   MB{memory}   apart {apart:.0e}   fastest: {best}")
    return rows


def record_times(say: Results, key: str, row: Row) -> None:
    """Milliseconds of making a matrix for each stack, and of transforms."""
    for way, name in (("one", "one by one"), ("fft", "transforms")):
        say.record(**{f"{key}_{way}": quantity(1e3 * row.seconds[name], "ms", digits=0)})


def main() -> None:
    """Command line."""
    options = command_line(__doc__, None, **REPEATED).parse_args()
    if options.quick:
        globals().update(OWN=tuple(QUOTED.values()), FIXED=FIXED[:1], GRADIENT=GRADIENT[-1:])
    jax.config.update("jax_enable_x64", True)
    say = Results("auxiliary_products", options.out)
    say(
        "Paper A: H, U and M of all wavelengths and glazes in one program, double precision\n"
        f"Two layers, albedo .2 to .99, random thickness; the thickest has Q steps of {STEP:g}; "
        f"n = {INDEX:g}, ground\n"
        f"{GROUND:g}, 0/0 degrees. MB: working memory of the largest program, as planned by the "
        "compiler, in the order\n"
        "of the ways. apart: largest difference of a value (or derivative) from the first way.\n\n"
        "Own step, decomposed: each stack has numbers of its own, 3 Q - 1 of H and U"
    )
    own = {"variant": "decomposed", "corrected": False}
    rows = compare(say, OWN, own, options)
    for key, case in QUOTED.items():
        record_times(say, key, rows[case])
    for way, size in zip(
        ("one", "all", "fft"), rows[QUOTED["q500"]].megabytes.values(), strict=True
    ):
        say.record(**{f"q500_mb_{way}": quantity(size, "MB", digits=1)})
    say("\nThe same with derivatives by all albedos and thicknesses (corrected)")
    corrected = own | {"corrected": True}
    rows = compare(say, [(q, 41, 1) for q in GRADIENT], corrected, options, slopes=True)
    last = rows[GRADIENT[-1], 41, 1]
    record_times(say, "slopes", last)
    say.record(apart=quantity(last.apart, digits=0, form="e"))
    for corrected, words in ((False, "as printed"), (True, "corrected")):
        say(f"\nFixed step, {words}: one matrix for all stacks")
        compare(
            say,
            [(q, 41, 1) for q in FIXED],
            {"variant": "fixed_step", "corrected": corrected},
            options,
        )
    q, d = stacks(120, 41, 1)
    truth = stack_reflectance_factor(q, d, GROUND, tolerance=1e-10)
    say(
        "\nError against the default solver at 1e-10, Q = 120, 41 wavelengths (the step's own, "
        "alike for all ways)"
    )
    for variant, corrected in (("decomposed", False), ("decomposed", True), ("fixed_step", True)):
        how: dict[str, Any] = {"variant": variant, "corrected": corrected}
        found = [program((q, d), how | {"product": product})() for product in ("matrix", "fft")]
        wrong = ", ".join(f"{float(np.max(np.abs(f - truth))):.6e}" for f in found)
        say(
            f"{variant + (', corrected' if corrected else ''):<24} one by one / one matrix, "
            f"transforms: {wrong}"
        )
    say.save()


if __name__ == "__main__":
    main()
