"""Paint under a rough surface: error against time by the number of nodes, compared with the smooth solver
and with paths.

Random stacks of one or two layers (optical thickness 0.003 to 30, albedo up to 1 - 1e-6, grounds 0
to 1, cosines 0.05 to 1), surfaces of roughness 0.001 to 1 and index 1.05 to 2.5. The errors are
those against a run with more of
everything: nodes, facets, beams, angles. Times are of 41 stacks of two layers, compiled, the best
of several, and given as ratios to the smooth solver's. Paths are the tests' own
(`tests/oracles/position_free.py`), a hundred thousand each: what they take for the same error of one
number follows from their standard error.

    python -m benchmarks.solver.rough_surface [--stacks 60] [--out FOLDER]
"""

import functools
import os
import time
from collections.abc import Callable, Iterator
from typing import Any
from unittest import mock

import jax
import jax.numpy as jnp
import numpy as np
from tests.oracles import position_free

from benchmarks import results
from benchmarks.timing import time_call
from glazejax import stack_reflectance_factor
from glazejax.radiative import rough
from glazejax.radiative.rough import resolution
from glazejax.radiative.rough.basis import Size

FINE = Size(12, 24, 3.0, 64, 64, (40, 40))
SURFACES = ((0.05, 1.5), (0.3, 1.5), (0.5, 1.7), (0.1, 1.05), (1e-3, 1.5), (1.0, 1.5), (0.2, 2.5))
TOLERANCES = (1e-3, 1e-4, 1e-5)
# What a run of small size leaves out: the last of them.
NEEDS_SIZE = ("worst_1e5", "times_1e5")
# Stacks whose times are taken.
_TIMED = 41


def random_stacks(count: int, seed: int = 0) -> dict[str, np.ndarray]:
    """Arguments of the functions by name."""
    rng = np.random.default_rng(seed)
    thickness = 10 ** rng.uniform(-2.5, 1.5, (count, 2))
    thickness[rng.random((count, 2)) < 0.4] = 0.0
    ground = rng.uniform(0, 1, count)
    ground[: count // 4], ground[count // 4 : count // 2] = 0.0, 1.0
    return {
        "albedo": 1 - 10 ** rng.uniform(-6, 0, (count, 2)),
        "optical_thickness": thickness,
        "substrate_reflectance": ground,
        "cos_incidence": rng.uniform(0.05, 1, count),
        "cos_viewing": rng.uniform(0.05, 1, count),
    }


def with_size(size: Size, evaluate: Callable[[], jax.Array]) -> np.ndarray:
    """A value at a resolution of its own."""
    with mock.patch.object(resolution, "_SIZES", ((1e-5, size),)):
        return np.asarray(evaluate())


def errors(count: int, surfaces: int) -> Iterator[tuple[float, float, list[tuple[float, float]]]]:
    """Roughness, index, and by tolerance the largest error of the factor and of the flux."""
    stacks = random_stacks(count)
    flux = {name: value for name, value in stacks.items() if name != "cos_viewing"}
    for roughness, index in SURFACES[:surfaces]:
        surface = {"roughness": roughness, "refractive_index": index}
        both = (
            functools.partial(rough.rough_reflectance_factor, **stacks, **surface),
            functools.partial(rough.rough_hemispherical_reflectance, **flux, **surface),
        )
        exact = [with_size(FINE, functools.partial(one, tolerance=1e-5)) for one in both]
        row = []
        for tolerance in TOLERANCES:
            miss = [
                np.max(np.abs(np.asarray(one(tolerance=tolerance)) - e))
                for one, e in zip(both, exact, strict=True)
            ]
            row.append((float(miss[0]), float(miss[1])))
        yield roughness, index, row
        jax.clear_caches()


def seconds(function: Callable, *arguments: object) -> float:
    """Best of several."""
    jax.block_until_ready(function(*arguments))
    return min(time_call(lambda: function(*arguments))[1] for _ in range(25))


def main() -> None:
    options = results.command_line(
        __doc__,
        stacks=(60, 8, "random stacks"),
        surfaces=(len(SURFACES), 1, "so many of them"),
    ).parse_args()
    if options.quick:
        globals().update(TOLERANCES=TOLERANCES[:2])
    jax.config.update("jax_enable_x64", True)
    say = results.Results("rough_surface", options.out)
    say(
        f"Largest error of the reflectance factor and of the flux over {options.stacks} random "
        "stacks, by the tolerance"
    )
    say("asked for, against a run with more nodes, facets, beams and angles")
    if flags := os.environ.get("XLA_FLAGS"):
        say(f"Compiled with XLA_FLAGS={flags}")
    say()
    say(f"{'roughness':>9} {'index':>6}   " + "   ".join(f"{t:^17.0e}" for t in TOLERANCES))
    worst = np.zeros((len(TOLERANCES), 2))
    for roughness, index, row in errors(options.stacks, options.surfaces):
        say(f"{roughness:9g} {index:6g}   " + "   ".join(f"{f:8.1e} {h:8.1e}" for f, h in row))
        worst = np.maximum(worst, row)
    say(f"{'worst':>16}   " + "   ".join(f"{f:8.1e} {h:8.1e}" for f, h in worst))
    say()
    say.record(random=results.quantity(options.stacks, digits=0))
    for tolerance, of_both in zip(TOLERANCES, worst, strict=True):
        largest = results.quantity(of_both.max(), digits=1, form="e")
        say.record(**{f"worst_{_in_name(tolerance)}": largest})
    _speed(say)
    say.save()


def _in_name(tolerance: float) -> str:
    """A tolerance as names of recorded values have it: 1e4 for 1e-4."""
    return f"1e{-round(np.log10(tolerance))}"


def _speed(say: results.Results) -> None:
    q, d, g = (
        jnp.linspace(0.5, 0.99, 2 * _TIMED).reshape(_TIMED, 2),
        jnp.linspace(0.1, 4, 2 * _TIMED).reshape(_TIMED, 2),
        jnp.full(_TIMED, 0.6),
    )
    arguments = q, d, g
    cosines: dict[str, Any] = {"cos_incidence": 0.8, "cos_viewing": 0.6}

    @jax.jit
    def smooth(q, d, g):
        return stack_reflectance_factor(q, d, g, tolerance=1e-4, **cosines)

    base = seconds(smooth, *arguments)
    say(
        f"Time of {_TIMED} stacks of two layers, compiled, over that of the smooth solver at "
        "tolerance 1e-4; with slopes by"
    )
    say(
        "albedo, thickness and ground; and the seconds of once, for the operators of one surface "
        "(roughness 0.2)"
    )
    say()
    say(f"{'tolerance':>9} {'value':>7} {'slopes':>7} {'operators':>10}")
    slopes = jax.jit(jax.grad(lambda *a: jnp.sum(smooth(*a)), argnums=(0, 1, 2)))
    say(f"{'smooth':>9} {1.0:7.2f} {seconds(slopes, *arguments) / base:7.2f} {'':>10}")
    times = {}
    set_up = []
    for tolerance in TOLERANCES:
        start = time.process_time()
        resolution.resolve(1.5, 0.2, tolerance).operators()
        set_up.append(time.process_time() - start)
        value = jax.jit(
            functools.partial(
                rough.rough_reflectance_factor, roughness=0.2, tolerance=tolerance, **cosines
            )
        )
        gradient = jax.jit(jax.grad(lambda *a, value=value: jnp.sum(value(*a)), argnums=(0, 1, 2)))
        times[tolerance] = seconds(value, *arguments)
        ratio = times[tolerance] / base
        say(
            f"{tolerance:9.0e} {ratio:7.2f} "
            f"{seconds(gradient, *arguments) / base:7.2f} {set_up[-1]:10.2f}"
        )
        # The smallest is quoted with a digit after the point, the others are whole numbers.
        digits = 1 if tolerance == TOLERANCES[0] else 0
        say.record(**{f"times_{_in_name(tolerance)}": results.quantity(ratio, "times", digits)})
    say.record(
        operators=results.quantity(max(set_up), "s", digits=1),
        timed=results.quantity(_TIMED, digits=0),
    )
    say()
    rng, view = np.random.default_rng(0), position_free.Views(np.array([0.6]), np.zeros(1))
    stack = position_free.Stack(
        scattering=np.array([0.9]),
        absorption=np.array([[0.1]]),
        g=np.zeros(1),
        refractive_index=np.array([1.5]),
        ground=0.6,
        roughness=0.2,
    )
    paths = {
        "flux": lambda: position_free.albedo(stack, 0.8, 100_000, rng),
        "reflectance factor": lambda: position_free.reflectance_factor(
            stack, 0.8, view, 100_000, rng
        ),
    }
    for name, follow in paths.items():
        start = time.perf_counter()
        error = float(follow().error.max())
        took = time.perf_counter() - start
        for tolerance in (1e-3, 1e-4):
            ratio = took * (error / tolerance) ** 2 / (times[tolerance] / _TIMED)
            say(
                f"Paths to a standard error of {tolerance:.0e} of {name}: {ratio:.1e} times one "
                "stack's time"
            )


if __name__ == "__main__":
    main()
