"""The truth for layered paint, found in two ways, and what the layer rules of renderers make of it.

    python -m benchmarks.render.layered_truth [--paths-minutes 10] [--out FOLDER]

24 stacks (`benchmarks/render/layered_stacks.py`) by glazejax, by position-free Monte Carlo
(`tests/oracles/position_free.py`) and by four rules (`benchmarks/render/layer_rules.py`). Writes
layered_truth.txt, the summary; layered_truth.csv, every value with Monte Carlo's and its standard
error; and layered_truth_paths.json, the sums of all paths so far, to which
--paths-minutes adds (it may be stopped at any time). docs/layered-truth.md explains.
"""

import os

import numpy as np
from tests.oracles.position_free import Tally

from benchmarks.render import layer_rules, layered_paths, layered_values
from benchmarks.render.layer_rules import RULES, Coat
from benchmarks.render.layered_csv import write_table
from benchmarks.render.layered_paths import KINDS, key_of
from benchmarks.render.layered_report import Found, agreement, rule_errors, times
from benchmarks.render.layered_stacks import BANDS, INCIDENCES, STACKS, VIEWS, LayeredStack
from benchmarks.render.layered_values import Values
from benchmarks.results import Results, command_line

FINE = {"rough": 1e-5, "ordinates": 1e-8, "manyflux": 1e-6}
"""Tolerance of the table, by method."""
FEW = (
    "clear varnish on white, smooth",
    "tint on a bare ground, .1",
    "hazy varnish on black, .05",
    "varnish 1.5 on white 1.4, smooth",
    "tint 1.4 on dark 1.7, smooth",
)
"""Stacks of a quick run: all methods, and all kinds of coat that texts quote."""


def evaluate(stack: LayeredStack, tallies: dict[str, Tally], fine: dict[str, float]) -> Found:
    """Truth, second method and rules; `fine` is the tolerance of each method."""
    both = [
        layered_values.values(stack, method, fine[method])
        for method in layered_values.methods(stack)
    ]
    apart = None
    if len(both) == 2:
        apart = max(float(np.max(np.abs(one - two))) for one, two in zip(*both, strict=True))
    surface = layered_values.surface(stack)
    absorbed = np.sum(stack.absorption[: stack.coats], axis=0)
    coat = Coat(
        layered_values.base_reflectance(stack), np.exp(-absorbed), stack.indices[0], surface.even
    )
    lit, seen, _ = layered_values.cosines()
    rules = {
        rule: Values(
            layer_rules.albedo(rule, coat, (lit, surface.lit)),
            layer_rules.factor(rule, coat, (lit, surface.lit), (seen, surface.seen)),
        )
        for rule in RULES
    }
    paths = {kind: [tallies[key_of(stack, kind, angle)] for angle in INCIDENCES] for kind in KINDS}
    return Found(stack=stack, surface=surface, truth=both[0], apart=apart, paths=paths, rules=rules)


def main() -> None:
    """See the module."""
    parser = command_line(__doc__, {"paths_minutes": 0.05})
    parser.add_argument(
        "--paths-minutes", type=float, default=0.0, help="follow paths for so long first"
    )
    options = parser.parse_args()
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})  # one core for both
    stacks, paths, fine = STACKS, layered_paths.CHUNK, FINE
    if options.quick:
        stacks, paths = tuple(stack for stack in STACKS if stack.name in FEW), 2000
        fine = dict.fromkeys(FINE, 1e-4)
    sums = options.out / "layered_truth_paths.json"
    options.out.mkdir(parents=True, exist_ok=True)
    if options.paths_minutes > 0:
        tallies = layered_paths.run(sums, options.paths_minutes, stacks, paths)
    else:
        tallies = layered_paths.read(sums)
    missing = [
        s.name for s in stacks for k in KINDS for i in INCIDENCES if key_of(s, k, i) not in tallies
    ]
    if missing:
        raise SystemExit(
            f"{sums} has no paths of {missing[0]!r}; run again with --paths-minutes 10"
        )

    import jax

    jax.config.update("jax_enable_x64", True)
    say = Results("layered_truth", options.out)
    lights = ", ".join(f"{a:g}" for a in INCIDENCES)
    angles = ", ".join(f"{a:g}/{z:g}" for a, z in VIEWS)
    say(
        f"{len(stacks)} stacks x {BANDS} bands; light at {lights} degrees, views (angle/azimuth) "
        f"{angles}.\n"
        "Body only: the light that comes from below the surface. docs/layered-truth.md says what "
        "everything means."
    )
    all_found = [evaluate(stack, tallies, fine) for stack in stacks]
    agreement(all_found, say)
    rule_errors(all_found, say)
    write_table(options.out / "layered_truth.csv", all_found)
    times(all_found, say, min(paths, 8_000))
    say.save()


if __name__ == "__main__":
    main()
