"""Smooth parameters from a table: error against time, and compared with the solver itself in the same run.

    python -m benchmarks.solver.interpolated [--out FOLDER] [--pixels N]

A coat of viridian and zinc white under a thin coat of ultramarine, 31 bands at 45:0. One, two and
three numbers differ from pixel to pixel: the thickness of the upper coat, that of the lower one,
and the share of viridian in it.
`glazejax.interpolated` makes a table of XYZ of them; pixels then go from it to sRGB. Errors are the
largest at 4096 points of their own, against the solver in the same run. Times are medians of
several runs in turn.
"""

import functools
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np

import glazejax as gj
from benchmarks.results import Results, command_line
from benchmarks.timing import interleaved
from glazejax import colour

GRID = np.arange(400.0, 701.0, 10.0)
RANGES = {"upper": (0.0, 6e-6), "lower": (0.0, 40e-6), "share": (0.0, 1.0)}
FIXED = {"upper": 2e-6, "lower": 30e-6, "share": 0.5}
TOLERANCES = (1e-3, 1e-4, 1e-5)
SOLVER = 1e-6
CHECKS = 4096
DIRECT = 4096
ROUNDS = 5
WEIGHTS, WHITE = colour.colour_weights(GRID), colour.white_point(GRID)
PAINTS = gj.catalogue.load()


def xyz(**given) -> jax.Array:
    """XYZ, (points, 3), of glazes of which some numbers are given, each (points,)."""
    blue, green, white = (
        PAINTS[name].resample(GRID) for name in ("UltramarineBlue", "ViridianGreen", "ZincWhite")
    )
    numbers = {name: jnp.asarray(given.get(name, FIXED[name])) for name in RANGES}
    weights = jnp.stack([numbers["share"], 1.0 - numbers["share"]], axis=-1)
    glaze = gj.Glaze(
        [
            gj.Layer(blue, numbers["upper"]),
            gj.Layer(gj.Mixture([green, white], weights), numbers["lower"]),
        ],
        0.5,
    )
    return gj.reflectance(glaze, gj.Bidirectional(45.0, 0.0), tolerance=SOLVER) @ jnp.asarray(
        WEIGHTS
    )


def errors(table, names: tuple[str, ...], direct: Callable) -> tuple[float, float, float]:
    """Largest error of XYZ, largest Delta E00, and root mean square error of the slopes as a share
    of the slopes'.
    """
    rng = np.random.default_rng(5)
    points = {name: rng.uniform(*RANGES[name], CHECKS) for name in names}
    exact, found = np.asarray(direct(**points)), np.asarray(table(**points))
    difference = colour.delta_e_2000(
        *(colour.xyz_to_lab(np.maximum(v, 0.0), WHITE) for v in (exact, found))
    )
    few = {name: jnp.asarray(values[: DIRECT // 16]) for name, values in points.items()}
    worst = 0.0
    for name in names:
        scale = RANGES[name][1] - RANGES[name][0]
        slopes = []
        for program in (lambda **given: xyz(**given), lambda **given: table(**given)):

            def along(x, program=program, name=name, scale=scale):
                return jax.jvp(
                    lambda y: program(**(few | {name: y})), (x,), (jnp.full_like(x, scale),)
                )[1]

            slopes.append(jax.jit(along)(few[name]))
        worst = max(
            worst, float(jnp.linalg.norm(slopes[0] - slopes[1]) / jnp.linalg.norm(slopes[0]))
        )
    return float(np.max(np.abs(exact - found))), float(np.max(difference)), worst


def main() -> None:
    pixels = (2**21, 2**14, "pixels of a timed run")
    options = command_line(__doc__, pixels=pixels).parse_args()
    if options.quick:
        globals().update(TOLERANCES=TOLERANCES[:1], CHECKS=256, DIRECT=256, ROUNDS=2)
    jax.config.update("jax_enable_x64", True)
    say = Results("interpolated", options.out)
    say(f"{options.pixels} pixels to XYZ and sRGB, the solver itself {DIRECT} pixels")
    direct = jax.jit(lambda **given: xyz(**given))
    rng = np.random.default_rng(1)

    encode = jax.jit(lambda values: colour.xyz_to_srgb(values, WHITE))

    def run(table, points):
        return encode(table(**points))

    def slopes(table, points):
        return jax.grad(lambda moved: jnp.sum(colour.xyz_to_srgb(table(**moved), WHITE)))(points)

    for names in (("upper",), ("upper", "share"), ("upper", "lower", "share"))[
        : 1 if options.quick else None
    ]:
        pixels = {name: jnp.asarray(rng.uniform(*RANGES[name], options.pixels)) for name in names}
        few = {name: values[:DIRECT] for name, values in pixels.items()}
        solver = jax.jit(lambda points: colour.xyz_to_srgb(xyz(**points), WHITE))
        say(
            f"\n{len(names)} of 3 numbers differ: {', '.join(names)}\n"
            f"{'asked':>7}{'estimate':>10}{'found':>9}{'Delta E':>9}{'slopes':>9}{'solved':>8}{'terms':>15}"
            f"{'type':>9}{'million/s':>11}{'solver/s':>10}{'ratio':>7}{'with slopes/s':>15}"
        )
        for tolerance in TOLERANCES:
            table = gj.interpolated(
                lambda **given: direct(**given), {n: RANGES[n] for n in names}, tolerance=tolerance
            )
            found, difference, slope = errors(table, names, direct)
            terms = " x ".join(map(str, table.coefficients.shape[:-1]))
            run_slopes = jax.jit(slopes)
            for dtype in (jnp.float64, jnp.float32):
                here, typed = table.astype(dtype), {n: v.astype(dtype) for n, v in pixels.items()}
                seconds = interleaved(
                    {
                        "table": functools.partial(run, here, typed),
                        "slopes": functools.partial(run_slopes, here, typed),
                        "solver": functools.partial(solver, few),
                    },
                    ROUNDS,
                )
                rate = options.pixels / seconds["table"]
                alone = DIRECT / seconds["solver"]
                say(
                    f"{tolerance:7.0e}{table.error:10.1e}{found:9.1e}{difference:9.1e}{slope:9.1e}"
                    f"{table.evaluations:8d}{terms:>15}{jnp.dtype(dtype).name:>9}{rate / 1e6:11.1f}"
                    f"{alone:10.0f}{rate / alone:7.0f}{options.pixels / seconds['slopes'] / 1e6:15.1f}"
                )
    say(
        "\nasked, estimate, found: largest error of X, Y, Z. Slopes: their error by each number, "
        "root mean square\n"
        "over that of the slopes themselves.\n"
        "solved: points the solver computed for the table. With slopes: sRGB and its gradient, "
        "by all that differ."
    )
    say.save()


if __name__ == "__main__":
    main()
