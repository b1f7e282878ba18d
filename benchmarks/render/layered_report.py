"""What `layered_truth` says: agreement of glazejax and Monte Carlo, errors of the layer rules,
times of both.
"""

import math
import time
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import numpy as np
from tests.oracles import rough_surface
from tests.oracles.position_free import Tally

from benchmarks.render import layered_paths, layered_values
from benchmarks.render.layer_rules import RULES, TITLES
from benchmarks.render.layered_paths import KINDS
from benchmarks.render.layered_stacks import BANDS, IN_PLANE, INCIDENCES, VIEWS, LayeredStack
from benchmarks.render.layered_values import Surface, Values
from benchmarks.results import Results, ends, percent, quantities, quantity

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


def deviations(found: Found, kind: str) -> np.ndarray:
    """(glazejax - Monte Carlo) over the standard error, (incidences, ...)."""
    ours = getattr(found.truth, kind)
    return np.stack(
        [
            (ours[i] - one.mean) / np.maximum(one.error, 1e-12)
            for i, one in enumerate(found.paths[kind])
        ]
    )


def agreement(all_found: list[Found], say: Results) -> None:
    """How glazejax and Monte Carlo agree."""
    say(
        "\nglazejax against Monte Carlo: (glazejax - mean)/standard error, rms and largest; "
        "'error': largest standard\n"
        "error; 'apart': largest difference of glazejax's second method, many-flux, where the "
        "first is ordinates\n"
        f"{'':<36}{'albedo':>31}{'reflectance factor':>31}"
    )
    columns = f"{'paths':>9}{'error':>9}{'rms':>6}{'max':>6} "
    say(f"{'stack':<36}{columns}{columns}{'apart':>8}")
    errors: dict[str, list[float]] = {kind: [] for kind in KINDS}
    total = 0
    for found in all_found:
        line = f"{found.stack.name:<36}"
        for kind in KINDS:
            z, runs = deviations(found, kind), found.paths[kind]
            largest = max(float(one.error.max()) for one in runs)
            paths = sum(one.paths for one in runs)
            line += (
                f"{paths:9.1e}{largest:9.1e}{np.sqrt(np.mean(z**2)):6.2f}{np.abs(z).max():6.2f} "
            )
            errors[kind].append(largest)
            total += paths
        say(line + (f"{found.apart:8.0e}" if found.apart is not None else f"{'':>8}"))
    apart = max(found.apart for found in all_found if found.apart is not None)
    worst = {f"{kind}_error": max(values) for kind, values in errors.items()}
    say.record(
        **quantities(worst, digits=1, form="e"),
        million_paths=quantity(1e-6 * total, digits=0),
        apart=quantity(apart, digits=0, form="e"),
    )
    say(f"\n{'share of deviations within':<52}{'1':>7}{'2':>7}{'3':>7}{'max':>7}{'values':>8}")
    normal = {f"normal_within_{k}": math.erf(k / math.sqrt(2.0)) for k in (1, 2, 3)}
    say(f"{'a normal law has':<52}{''.join(f'{share:7.3f}' for share in normal.values())}")
    say.record(**quantities(normal, digits=3))
    rough = np.array([found.stack.roughness > 0 for found in all_found])
    once = []
    count = 0
    for kind in KINDS:
        z = np.stack([deviations(found, kind) for found in all_found])
        for name, which in (("smooth", ~rough), ("rough", rough)):
            _shares(say, f"{kind}_{name}", f"{kind}, {name}", z[which])
        once.append((z[:, :, 1] if kind == "albedo" else z[:, :, 6, 1]).ravel())
        count += z.size
    alone = np.concatenate(once)
    _shares(say, "independent", "one band and view of each run: these are independent", alone)
    squares, spread = np.sum(alone**2), np.sqrt(2 * alone.size)
    say(f"sum of squares of the last line {squares:.1f}; expected {alone.size} +- {spread:.1f}")
    counts = {"values": count, "squares_expected": alone.size, "squares_spread": spread}
    say.record(squares=quantity(squares, digits=1), **quantities(counts, digits=0))
    _surfaces(all_found, say)


def _surfaces(all_found: list[Found], say: Results) -> None:
    """The surface's own reflection by both."""
    lit, seen, azimuth = layered_values.cosines()
    albedo = factor = 0.0
    for found in all_found:
        alpha, n = found.stack.roughness, found.stack.indices[0]
        off = rough_surface.surface_albedo(lit, alpha, n) - found.surface.lit
        albedo = max(albedo, float(np.max(np.abs(off))))
        if alpha:
            other = rough_surface.surface_factor(lit[:, None], seen, azimuth, alpha, n)
            factor = max(factor, float(np.max(np.abs(other / found.surface.factor - 1.0))))
    say(
        "the surfaces' own reflection, glazejax against the oracle's quadrature: largest "
        "difference of an albedo\n"
        f"{albedo:.1e}, largest relative difference of a reflection factor {factor:.1e}"
    )
    say.record(
        surface_albedo=quantity(albedo, digits=1, form="e"),
        surface_factor=percent(factor, 2),
    )


def _shares(say: Results, key: str, name: str, z: np.ndarray) -> None:
    within = {f"{key}_within_{k}": np.mean(np.abs(z) <= k) for k in (1, 2, 3)}
    largest = np.abs(z).max()
    say(f"{name:<52}{''.join(f'{w:7.3f}' for w in within.values())}{largest:7.2f}{z.size:8d}")
    say.record(
        **quantities(within, digits=3, n=z.size),
        **quantities({f"{key}_largest": largest}, n=z.size),
        **quantities({f"{key}_values": z.size}, digits=0),
    )


def rule_errors(all_found: list[Found], say: Results) -> None:
    """Tables of what each rule misses."""
    names = "".join(f"{TITLES[rule]:>20}" for rule in RULES)
    say(
        "\nErrors of the layer rules. Each gets the base's true reflectance, the coat's true "
        "transmittance and the\n"
        "surface's exact reflection: what is left is the rule. Worst albedo (rule - truth, sign "
        "kept) of 3 angles x 3\n"
        "bands, as seen under even light\n"
        f"{'stack':<36}{names}"
    )
    worst = np.empty((len(all_found), len(RULES)))
    for row, found in enumerate(all_found):
        for column, rule in enumerate(RULES):
            difference = (found.rules[rule].albedo - found.truth.albedo).ravel()
            worst[row, column] = difference[np.argmax(np.abs(difference))]
        say(f"{found.stack.name:<36}" + "".join(f"{value:20.4f}" for value in worst[row]))
    middle = np.median(np.abs(worst), axis=0)
    say(f"{'median of the absolute values':<36}" + "".join(f"{v:20.4f}" for v in middle))
    for rule, value, digits in zip(RULES, middle, (2, 2, 3, 3), strict=True):
        say.record(**{f"{rule}_albedo": quantity(value, digits=digits, n=len(worst))})
    _record_worst(all_found, say, np.abs(worst))
    _factor_errors(all_found, say, names)
    _by_angle(all_found, say, names)


def _record_worst(all_found: list[Found], say: Results, worst: np.ndarray) -> None:
    """Absolute errors of an albedo, (stacks, rules), by kind of coat."""
    kinds = np.array([_kind_of_coat(found.stack) for found in all_found])
    uniform = np.array([found.stack.uniform for found in all_found])
    haze = np.array([found.stack.name.startswith("hazy") for found in all_found])
    clear, tinted = kinds == "clear coat", kinds == "absorbing coat"
    by_rule = dict(zip(RULES, worst.T, strict=True))
    scaling, openpbr, belcour = (by_rule[rule] for rule in ("scaling", "openpbr", "belcour"))
    worst_of = {
        **ends("scaling", scaling[~haze]),
        **ends("openpbr_clear", openpbr[clear & uniform]),
        **ends("openpbr_tinted", openpbr[tinted & uniform]),
        **ends("belcour_tinted", belcour[tinted & uniform]),
        "scaling_haze": max(scaling[haze]),
        "openpbr_haze": max(openpbr[haze]),
        "openpbr_two_indices_tint": max(openpbr[tinted & ~uniform]),
        "belcour_two_indices_tint": max(belcour[tinted & ~uniform]),
        "openpbr_two_indices_varnish": max(openpbr[clear & ~uniform]),
    }
    say.record(**quantities(worst_of))


def _factor_errors(all_found: list[Found], say: Results, names: str) -> None:
    for title, key, unit in (
        ("of the reflectance factor", "", ""),
        ("relative to it, surface included, in per cent", "_share", "%"),
    ):
        say(
            f"\nRoot mean square error {title}: in the plane of incidence / out of it\n"
            f"{'stack':<36}{names}"
        )
        form = "{:10.1f} /{:8.1f}" if unit else "{:10.4f} /{:8.4f}"
        table = np.empty((len(all_found), len(RULES), 2))
        for row, found in enumerate(all_found):
            whole = found.truth.factor + found.surface.factor[:, :, None]
            for column, rule in enumerate(RULES):
                difference = found.rules[rule].factor - found.truth.factor
                difference = 100.0 * difference / whole if unit else difference
                for side, views in enumerate((IN_PLANE, ~IN_PLANE)):
                    table[row, column, side] = np.sqrt(np.mean(difference[:, views] ** 2))
            say(f"{found.stack.name:<36}" + "".join(form.format(*pair) for pair in table[row]))
        middle = np.median(table, axis=0)
        say(f"{'median':<36}" + "".join(form.format(*pair) for pair in middle))
        for side, values in zip(("in", "out"), middle.T, strict=True):
            named = {f"{rule}_{side}{key}": v for rule, v in zip(RULES, values, strict=True)}
            say.record(**quantities(named, unit, 0 if unit else 3, n=len(table)))


def _kind_of_coat(stack: LayeredStack) -> str:
    if not stack.coats:
        return "no coat"
    if stack.scattering[0]:
        return "coat that scatters"
    return "absorbing coat" if stack.absorption[0].any() else "clear coat"


def _by_angle(all_found: list[Found], say: Results, names: str) -> None:
    say(
        "\nMean error of the reflectance factor by kind of coat (how many), light and view both at "
        "70 degrees or more,\nor both at 45 or less\n"
        f"{'':<36}{names}"
    )
    groups: dict[str, list[Found]] = {}
    for found in all_found:
        groups.setdefault(_kind_of_coat(found.stack), []).append(found)
    angle = np.array([a for a, _ in VIEWS])
    ways = {"both grazing": ([2], angle >= 70), "both steep": ([0, 1], angle <= 45)}
    for name, some in groups.items():
        for words, (lit, seen) in ways.items():
            mean = [
                np.mean([(f.rules[rule].factor - f.truth.factor)[lit][:, seen] for f in some])
                for rule in RULES
            ]
            title = f"{name} ({len(some)}), {words}"
            say(f"{title:<36}" + "".join(f"{value:20.4f}" for value in mean))


def times(all_found: list[Found], say: Results, paths: int) -> None:
    """Processor time of both, for the same values at the same error; Monte Carlo's from so many
    paths.
    """
    albedos, factors = len(INCIDENCES) * BANDS, len(INCIDENCES) * len(VIEWS) * BANDS
    say(
        f"\nProcessor time on one core. glazejax: all {albedos} albedos and all {factors} "
        "factors of a stack, tolerance\n"
        f"{WANTED:g}, compiled and with a rough surface's operators made (best of 5), and the "
        "largest error. Monte\n"
        f"Carlo: paths timed here (best of 2), for a largest standard error of {WANTED:g} by "
        "1/sqrt(paths); bands share\n"
        "paths, and so do the views of an incidence."
    )
    columns = f"{'ms':>9}{'error':>9}{'MC s':>9}{'ratio':>9} "
    say(f"{'':<36}{'albedo':>36}{'reflectance factor':>37}")
    say(f"{'stack':<36}{columns}{columns}".rstrip())
    measured = {kind: np.empty((len(all_found), 3)) for kind in KINDS}
    for row, found in enumerate(all_found):
        line = f"{found.stack.name:<36}"
        made = layered_values.programs(found.stack, layered_values.methods(found.stack)[0], WANTED)
        for kind, program in zip(KINDS, made, strict=True):
            value = np.moveaxis(np.asarray(program(), float), 0, -1)
            error = float(np.max(np.abs(value - getattr(found.truth, kind))))
            ours = min(_timed(program)[0] for _ in range(5))
            theirs = _seconds_of_paths(found, kind, paths)
            line += f"{1e3 * ours:9.2f}{error:9.1e}{theirs:9.0f}{theirs / ours:9.1e} "
            measured[kind][row] = 1e3 * ours, error, theirs
        say(line.rstrip())
    one = np.array([found.stack.isotropic and found.stack.uniform for found in all_found])
    rough = np.array([found.stack.roughness > 0 for found in all_found])
    groups = {"smooth": one & ~rough, "rough": rough, "several": ~one}
    errors = {
        f"{key}_error": max(measured[kind][which, 1].max() for kind in KINDS)
        for key, which in groups.items()
    }
    say.record(**quantities(errors, digits=1, form="e"))
    for kind, (ours, _, theirs) in ((kind, values.T) for kind, values in measured.items()):
        ratio = 1e3 * theirs / ours
        middle = np.median(ratio)
        say(
            f"{kind}: Monte Carlo takes {ratio.min():.2g} to {ratio.max():.2g} times as long, "
            f"median {middle:.2g}"
        )
        for key, which in groups.items():
            digits = int(key == "smooth" or (key, kind) == ("rough", "albedo"))
            say.record(**quantities(ends(f"{kind}_{key}", ours[which]), "ms", digits))
        ratios = {f"{kind}_ratio": middle, **ends(f"{kind}_ratio", ratio)}
        say.record(
            **quantities(ends(f"{kind}_paths", theirs), "s", 0),
            **quantities(ratios, digits=1, form="e", n=len(ratio)),
        )


def _seconds_of_paths(found: Found, kind: str, size: int) -> float:
    """For the standard error wanted, at all incidences, from so many paths."""
    rng, total = np.random.default_rng(7), 0.0
    for angle in INCIDENCES:
        runs = [
            _timed(lambda a=angle: layered_paths.chunk(found.stack, kind, a, size, rng))
            for _ in range(2)
        ]
        tally = runs[0][1].plus(runs[1][1])
        total += (
            min(run[0] for run in runs)
            / size
            * tally.paths
            * (float(tally.error.max()) / WANTED) ** 2
        )
    return total


def _timed(program: Callable[[], Any]) -> tuple[float, Any]:
    """Processor seconds and result."""
    start = time.process_time()
    result = jax.block_until_ready(program())
    return time.process_time() - start, result
