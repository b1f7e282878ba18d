"""The truth for layered paint, two ways, and what the layer rules of renderers make of it.

    python -m benchmarks.layered_truth [--paths-minutes 10] [--out FOLDER]

24 stacks (`benchmarks/layered_stacks.py`) by glazejax, by position-free Monte Carlo (`tests/oracles/position_free.py`)
and by four rules (`benchmarks/layer_rules.py`). Writes layered_truth.txt, the summary; layered_truth.csv, every value
with Monte Carlo's and its standard error; and layered_truth_paths.json, the sums of all paths so far, to which
--paths-minutes adds (it may be stopped at any time). docs/layered-truth.md explains.
"""

import argparse
import os
import time
from typing import NamedTuple

import numpy as np

from benchmarks import layer_rules, layered_paths, layered_values
from benchmarks.layer_rules import RULES, TITLES, Coat
from benchmarks.layered_csv import write_table
from benchmarks.layered_paths import KINDS, key_of
from benchmarks.layered_stacks import BANDS, IN_PLANE, INCIDENCES, STACKS, VIEWS, LayeredStack
from benchmarks.layered_values import Surface, Values
from benchmarks.results import Results, add_option
from benchmarks.timing import environment
from tests.oracles.position_free import Tally

FINE = {"rough": 1e-6, "ordinates": 1e-8, "manyflux": 1e-7, "modes": 1e-7}
"""Tolerance of the table, by method."""
WANTED = 1e-4
"""Error at which times are compared."""


class Found(NamedTuple):
    """All that is known of one stack."""

    stack: LayeredStack
    surface: Surface
    truth: Values
    apart: float | None  # of the second method
    paths: dict[str, list[Tally]]  # by kind, for each incidence
    rules: dict[str, Values]


def evaluate(stack: LayeredStack, tallies: dict[str, Tally]) -> Found:
    """Truth, second method and rules."""
    both = [layered_values.values(stack, method, FINE[method]) for method in layered_values.methods(stack)]
    apart = None
    if len(both) == 2:
        apart = max(float(np.max(np.abs(one - two))) for one, two in zip(*both, strict=True))
    surface = layered_values.surface(stack)
    absorbed = np.sum(stack.absorption[: stack.coats], axis=0)
    coat = Coat(layered_values.base_reflectance(stack), np.exp(-absorbed), stack.indices[0], surface.even)
    lit, seen, _ = layered_values.cosines()
    rules = {
        rule: Values(
            layer_rules.albedo(rule, coat, (lit, surface.lit)),
            layer_rules.factor(rule, coat, (lit, surface.lit), (seen, surface.seen)),
        )
        for rule in RULES
    }
    paths = {kind: [tallies[key_of(stack, kind, angle)] for angle in INCIDENCES] for kind in KINDS}
    return Found(stack, surface, both[0], apart, paths, rules)


def deviations(found: Found, kind: str) -> np.ndarray:
    """(glazejax - Monte Carlo) over the standard error, (incidences, ...)."""
    ours = getattr(found.truth, kind)
    return np.stack([(ours[i] - one.mean) / np.maximum(one.error, 1e-12) for i, one in enumerate(found.paths[kind])])


def agreement(all_found: list[Found], say: Results) -> None:
    """How glazejax and Monte Carlo agree."""
    say(f"\nglazejax against Monte Carlo: (glazejax - mean)/standard error; 'apart': largest difference of the second")
    say(
        "method of glazejax (many-flux; where there is an index or a phase function for each layer, many-flux by modes)"
    )
    say(
        f"{'stack':<36}{'paths':>9}{'error':>9}{'rms':>6}{'max':>6} {'paths':>10}{'error':>9}{'rms':>6}{'max':>6}{'apart':>9}"
    )
    say(f"{'':<36}{'albedo':>30}{'reflectance factor':>31}")
    for found in all_found:
        line = f"{found.stack.name:<36}"
        for kind in KINDS:
            z, runs = deviations(found, kind), found.paths[kind]
            largest = max(float(one.error.max()) for one in runs)
            paths = sum(one.paths for one in runs)
            line += f"{paths:9.1e}{largest:9.1e}{np.sqrt(np.mean(z**2)):6.2f}{np.abs(z).max():6.2f} "
        say(line + (f"{found.apart:8.0e}" if found.apart is not None else f"{'':>8}"))
    say(f"\n{'share of deviations within':<52}{'1':>7}{'2':>7}{'3':>7}{'max':>7}{'values':>8}")
    say(f"{'a normal law has':<52}{0.6827:7.3f}{0.9545:7.3f}{0.9973:7.3f}")
    rough = np.array([found.stack.roughness > 0 for found in all_found])
    for kind in KINDS:
        z = np.stack([deviations(found, kind) for found in all_found])
        for name, which in (("smooth", ~rough), ("rough", rough)):
            _shares(say, f"{kind}, {name}", z[which])
    once = np.concatenate(
        [np.stack([deviations(f, "albedo")[:, 1] for f in all_found]).ravel()]
        + [np.stack([deviations(f, "factor")[:, 6, 1] for f in all_found]).ravel()]
    )
    _shares(say, "one band and view a run: these are independent", once)
    say(
        f"sum of squares of the last line: {np.sum(once**2):.1f} of {once.size} expected, +- {np.sqrt(2 * once.size):.1f}"
    )


def _shares(say: Results, name: str, z: np.ndarray) -> None:
    within = "".join(f"{np.mean(np.abs(z) <= k):7.3f}" for k in (1, 2, 3))
    say(f"{name:<52}{within}{np.abs(z).max():7.2f}{z.size:8d}")


def rule_errors(all_found: list[Found], say: Results) -> None:
    """Tables of what each rule misses."""
    names = "".join(f"{TITLES[rule]:>20}" for rule in RULES)
    say("\nErrors of the layer rules. Each gets the base's true reflectance, the coat's true transmittance and the")
    say(
        "surface's exact reflection: what is left is the rule. Worst albedo (rule - truth, the sign kept) of 3 angles x 3"
    )
    say("bands, as seen under even light")
    say(f"{'stack':<36}{names}")
    worst = np.empty((len(all_found), len(RULES)))
    for row, found in enumerate(all_found):
        for column, rule in enumerate(RULES):
            difference = (found.rules[rule].albedo - found.truth.albedo).ravel()
            worst[row, column] = difference[np.argmax(np.abs(difference))]
        say(f"{found.stack.name:<36}" + "".join(f"{value:20.4f}" for value in worst[row]))
    say(f"{'median of the absolute values':<36}" + "".join(f"{v:20.4f}" for v in np.median(np.abs(worst), axis=0)))
    for title, relative in (
        ("of the reflectance factor", False),
        ("relative to it, surface included, in per cent", True),
    ):
        say(f"\nRoot mean square error {title}: in the plane of incidence / out of it")
        say(f"{'stack':<36}{names}")
        table = np.empty((len(all_found), len(RULES), 2))
        for row, found in enumerate(all_found):
            whole = found.truth.factor + found.surface.factor[:, :, None]
            for column, rule in enumerate(RULES):
                difference = found.rules[rule].factor - found.truth.factor
                difference = 100.0 * difference / whole if relative else difference
                for side, views in enumerate((IN_PLANE, ~IN_PLANE)):
                    table[row, column, side] = np.sqrt(np.mean(difference[:, views] ** 2))
            form = "{:10.1f} /{:8.1f}" if relative else "{:10.4f} /{:8.4f}"
            say(f"{found.stack.name:<36}" + "".join(form.format(*pair) for pair in table[row]))
        form = "{:10.1f} /{:8.1f}" if relative else "{:10.4f} /{:8.4f}"
        say(f"{'median':<36}" + "".join(form.format(*pair) for pair in np.median(table, axis=0)))
    grazing_and_steep(all_found, say)


def grazing_and_steep(all_found: list[Found], say: Results) -> None:
    """Where in angle each rule fails, by kind of coat."""
    groups = {
        "clear coat": lambda s: s.coats and not s.absorption[0].any(),
        "absorbing coat": lambda s: s.coats and s.absorption[0].any() and not s.scattering[0],
        "coat that scatters": lambda s: s.coats and s.scattering[0],
        "no coat": lambda s: not s.coats,
    }
    say("\nMean error of the albedo (rule - truth) by kind of coat and angle")
    say(f"{'':<36}" + "".join(f"{TITLES[rule]:>20}" for rule in RULES))
    for name, belongs in groups.items():
        some = [found for found in all_found if belongs(found.stack)]
        for i, angle in enumerate(INCIDENCES):
            mean = [np.mean([f.rules[rule].albedo[i] - f.truth.albedo[i] for f in some]) for rule in RULES]
            say(f"{f'{name} ({len(some)}), {angle:g} degrees':<36}" + "".join(f"{value:20.4f}" for value in mean))
    say("\nMean error of the reflectance factor, light and view both at 70 degrees or more, and both at 45 or less")
    angle = np.array([a for a, _ in VIEWS])
    for name, belongs in groups.items():
        some = [found for found in all_found if belongs(found.stack)]
        for words, lit, seen in (("both grazing", [2], angle >= 70), ("both steep", [0, 1], angle <= 45)):
            mean = [np.mean([(f.rules[r].factor - f.truth.factor)[lit][:, seen] for f in some]) for r in RULES]
            say(f"{f'{name} ({len(some)}), {words}':<36}" + "".join(f"{value:20.4f}" for value in mean))


def times(all_found: list[Found], say: Results) -> None:
    """Processor time of both, for the same values at the same error."""
    say(f"\nProcessor time on one core. glazejax: all albedos ({len(INCIDENCES) * BANDS} values) and all factors")
    say(
        f"({len(INCIDENCES) * len(VIEWS) * BANDS}) of a stack, tolerance {WANTED:g}, compiled (best of 5), and the largest error met;"
    )
    say(
        "'first': the first call, compilation and the operators of a rough surface included. Monte Carlo: paths timed here"
    )
    say(f"(best of 3), for a largest standard error of {WANTED:g} by 1/sqrt(paths); all bands share paths.")
    say(
        f"{'stack':<36}{'ms':>8}{'first':>8}{'error':>9}{'MC s':>9}{'ratio':>9}  {'ms':>8}{'first':>8}{'error':>9}{'MC s':>9}{'ratio':>9}"
    )
    say(f"{'':<36}{'albedo':>43}{'reflectance factor':>45}")
    ratios: dict[str, list[float]] = {kind: [] for kind in KINDS}
    rng = np.random.default_rng(7)
    for found in all_found:
        line = f"{found.stack.name:<36}"
        made = layered_values.programs(found.stack, layered_values.methods(found.stack)[0], WANTED)
        for kind, program in zip(KINDS, made, strict=True):
            start = time.process_time()
            value = np.moveaxis(np.asarray(program(), float), 0, -1)
            first = time.process_time() - start
            ours = min(_seconds(program) for _ in range(5))
            error = float(np.max(np.abs(value - getattr(found.truth, kind))))
            size, theirs = layered_paths.CHUNK[kind], 0.0
            for angle, tally in zip(INCIDENCES, found.paths[kind], strict=True):
                each = min(
                    _seconds(lambda a=angle, k=kind, p=size: layered_paths.chunk(found.stack, k, a, p, rng))
                    for _ in range(3)
                )
                theirs += each / size * tally.paths * (float(tally.error.max()) / WANTED) ** 2
            ratios[kind].append(theirs / ours)
            line += f"{1e3 * ours:8.2f}{first:8.1f}{error:9.1e}{theirs:9.0f}{theirs / ours:9.1e}  "
        say(line.rstrip())
    for kind in KINDS:
        values = np.array(ratios[kind])
        say(
            f"{kind}: Monte Carlo takes {values.min():.2g} to {values.max():.2g} times as long, median {np.median(values):.2g}"
        )


def _seconds(program) -> float:
    start = time.process_time()
    np.asarray(program())
    return time.process_time() - start


def main() -> None:
    """See the module."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add_option(parser)
    parser.add_argument("--paths-minutes", type=float, default=0.0, help="follow paths for so long first")
    parser.add_argument("--no-times", action="store_true", help="leave the times out")
    options = parser.parse_args()
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})  # one core for both
    sums = options.out / "layered_truth_paths.json"
    tallies = layered_paths.run(sums, options.paths_minutes) if options.paths_minutes > 0 else layered_paths.read(sums)
    missing = [s.name for s in STACKS for k in KINDS for i in INCIDENCES if key_of(s, k, i) not in tallies]
    if missing:
        raise SystemExit(f"{sums} has no paths of {missing[0]!r}; run again with --paths-minutes 10")

    import jax

    jax.config.update("jax_enable_x64", True)
    say = Results("layered_truth", options.out)
    say(environment())
    angles = ", ".join(f"{a:g}/{z:g}" for a, z in VIEWS)
    say(
        f"{len(STACKS)} stacks x {BANDS} bands; light at {', '.join(f'{a:g}' for a in INCIDENCES)} degrees, views (angle/azimuth) {angles}."
    )
    say("Body only: the light that comes from below the surface. docs/layered-truth.md says what everything means.")
    all_found = [evaluate(stack, tallies) for stack in STACKS]
    agreement(all_found, say)
    rule_errors(all_found, say)
    if not options.no_times:
        times(all_found, say)
    write_table(options.out / "layered_truth.csv", all_found)
    say.save()


if __name__ == "__main__":
    main()
