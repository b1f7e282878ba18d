"""What `layered_truth` says: agreement of glazejax and Monte Carlo, errors of the layer rules,
times of both.
"""

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
from benchmarks.results import Results

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
        "'error': largest standard"
    )
    say(
        "error; 'apart': largest difference of glazejax's second method, many-flux, where the "
        "first is ordinates"
    )
    say(f"{'':<36}{'albedo':>31}{'reflectance factor':>31}")
    columns = f"{'paths':>9}{'error':>9}{'rms':>6}{'max':>6} "
    say(f"{'stack':<36}{columns}{columns}{'apart':>8}")
    for found in all_found:
        line = f"{found.stack.name:<36}"
        for kind in KINDS:
            z, runs = deviations(found, kind), found.paths[kind]
            largest = max(float(one.error.max()) for one in runs)
            paths = sum(one.paths for one in runs)
            line += (
                f"{paths:9.1e}{largest:9.1e}{np.sqrt(np.mean(z**2)):6.2f}{np.abs(z).max():6.2f} "
            )
        say(line + (f"{found.apart:8.0e}" if found.apart is not None else f"{'':>8}"))
    say(f"\n{'share of deviations within':<52}{'1':>7}{'2':>7}{'3':>7}{'max':>7}{'values':>8}")
    say(f"{'a normal law has':<52}{0.6827:7.3f}{0.9545:7.3f}{0.9973:7.3f}")
    rough = np.array([found.stack.roughness > 0 for found in all_found])
    once = []
    for kind in KINDS:
        z = np.stack([deviations(found, kind) for found in all_found])
        for name, which in (("smooth", ~rough), ("rough", rough)):
            _shares(say, f"{kind}, {name}", z[which])
        once.append((z[:, :, 1] if kind == "albedo" else z[:, :, 6, 1]).ravel())
    independent = np.concatenate(once)
    _shares(say, "one band and view of each run: these are independent", independent)
    total, count = np.sum(independent**2), independent.size
    say(
        f"sum of squares of the last line {total:.1f}; expected {count} +- {np.sqrt(2 * count):.1f}"
    )
    _surfaces(all_found, say)


def _surfaces(all_found: list[Found], say: Results) -> None:
    """The surface's own reflection by both."""
    lit, seen, azimuth = layered_values.cosines()
    albedos, factors = [0.0], [0.0]
    for found in all_found:
        alpha, n = found.stack.roughness, found.stack.indices[0]
        albedos.append(
            np.max(np.abs(rough_surface.surface_albedo(lit, alpha, n) - found.surface.lit))
        )
        if alpha:
            other = rough_surface.surface_factor(lit[:, None], seen, azimuth, alpha, n)
            factors.append(np.max(np.abs(other / found.surface.factor - 1.0)))
    say(
        "the surfaces' own reflection, glazejax against the oracle's quadrature: largest "
        "difference of an albedo"
    )
    say(
        f"{max(albedos):.1e}, largest relative difference of a reflection factor {max(factors):.1e}"
    )


def _shares(say: Results, name: str, z: np.ndarray) -> None:
    within = "".join(f"{np.mean(np.abs(z) <= k):7.3f}" for k in (1, 2, 3))
    say(f"{name:<52}{within}{np.abs(z).max():7.2f}{z.size:8d}")


def rule_errors(all_found: list[Found], say: Results) -> None:
    """Tables of what each rule misses."""
    names = "".join(f"{TITLES[rule]:>20}" for rule in RULES)
    say(
        "\nErrors of the layer rules. Each gets the base's true reflectance, the coat's true "
        "transmittance and the"
    )
    say(
        "surface's exact reflection: what is left is the rule. Worst albedo (rule - truth, sign "
        "kept) of 3 angles x 3"
    )
    say("bands, as seen under even light")
    say(f"{'stack':<36}{names}")
    worst = np.empty((len(all_found), len(RULES)))
    for row, found in enumerate(all_found):
        for column, rule in enumerate(RULES):
            difference = (found.rules[rule].albedo - found.truth.albedo).ravel()
            worst[row, column] = difference[np.argmax(np.abs(difference))]
        say(f"{found.stack.name:<36}" + "".join(f"{value:20.4f}" for value in worst[row]))
    say(
        f"{'median of the absolute values':<36}"
        + "".join(f"{v:20.4f}" for v in np.median(np.abs(worst), axis=0))
    )
    _factor_errors(all_found, say, names)
    _by_angle(all_found, say, names)


def _factor_errors(all_found: list[Found], say: Results, names: str) -> None:
    for title, relative in (
        ("of the reflectance factor", False),
        ("relative to it, surface included, in per cent", True),
    ):
        say(f"\nRoot mean square error {title}: in the plane of incidence / out of it")
        say(f"{'stack':<36}{names}")
        form = "{:10.1f} /{:8.1f}" if relative else "{:10.4f} /{:8.4f}"
        table = np.empty((len(all_found), len(RULES), 2))
        for row, found in enumerate(all_found):
            whole = found.truth.factor + found.surface.factor[:, :, None]
            for column, rule in enumerate(RULES):
                difference = found.rules[rule].factor - found.truth.factor
                difference = 100.0 * difference / whole if relative else difference
                for side, views in enumerate((IN_PLANE, ~IN_PLANE)):
                    table[row, column, side] = np.sqrt(np.mean(difference[:, views] ** 2))
            say(f"{found.stack.name:<36}" + "".join(form.format(*pair) for pair in table[row]))
        say(f"{'median':<36}" + "".join(form.format(*pair) for pair in np.median(table, axis=0)))


def _kind_of_coat(stack: LayeredStack) -> str:
    if not stack.coats:
        return "no coat"
    if stack.scattering[0]:
        return "coat that scatters"
    return "absorbing coat" if stack.absorption[0].any() else "clear coat"


def _by_angle(all_found: list[Found], say: Results, names: str) -> None:
    groups: dict[str, list[Found]] = {}
    for found in all_found:
        groups.setdefault(_kind_of_coat(found.stack), []).append(found)
    say("\nMean error of the albedo (rule - truth) by kind of coat (how many) and angle")
    say(f"{'':<36}{names}")
    for name, some in groups.items():
        for i, angle in enumerate(INCIDENCES):
            mean = [
                np.mean([f.rules[rule].albedo[i] - f.truth.albedo[i] for f in some])
                for rule in RULES
            ]
            say(
                f"{f'{name} ({len(some)}), {angle:g} degrees':<36}"
                + "".join(f"{value:20.4f}" for value in mean)
            )
    say(
        "\nMean error of the reflectance factor, light and view both at 70 degrees or more, or "
        "both at 45 or less"
    )
    say(f"{'':<36}{names}")
    angle = np.array([a for a, _ in VIEWS])
    for name, some in groups.items():
        for words, lit, seen in (
            ("both grazing", [2], angle >= 70),
            ("both steep", [0, 1], angle <= 45),
        ):
            mean = [
                np.mean([(f.rules[r].factor - f.truth.factor)[lit][:, seen] for f in some])
                for r in RULES
            ]
            say(
                f"{f'{name} ({len(some)}), {words}':<36}"
                + "".join(f"{value:20.4f}" for value in mean)
            )


def times(all_found: list[Found], say: Results) -> None:
    """Processor time of both, for the same values at the same error."""
    albedos, factors = len(INCIDENCES) * BANDS, len(INCIDENCES) * len(VIEWS) * BANDS
    say(
        f"\nProcessor time on one core. glazejax: all {albedos} albedos and all {factors} "
        "factors of a stack, tolerance"
    )
    say(
        f"{WANTED:g}, compiled and with a rough surface's operators made (best of 5), and the "
        "largest error. Monte"
    )
    say(
        f"Carlo: paths timed here (best of 2), for a largest standard error of {WANTED:g} by "
        "1/sqrt(paths); bands share"
    )
    say("paths, and so do the views of an incidence.")
    columns = f"{'ms':>9}{'error':>9}{'MC s':>9}{'ratio':>9} "
    say(f"{'':<36}{'albedo':>36}{'reflectance factor':>37}")
    say(f"{'stack':<36}{columns}{columns}".rstrip())
    ratios: dict[str, list[float]] = {kind: [] for kind in KINDS}
    for found in all_found:
        line = f"{found.stack.name:<36}"
        made = layered_values.programs(found.stack, layered_values.methods(found.stack)[0], WANTED)
        for kind, program in zip(KINDS, made, strict=True):
            value = np.moveaxis(np.asarray(program(), float), 0, -1)
            error = float(np.max(np.abs(value - getattr(found.truth, kind))))
            ours = min(_timed(program)[0] for _ in range(5))
            theirs = _seconds_of_paths(found, kind)
            ratios[kind].append(theirs / ours)
            line += f"{1e3 * ours:9.2f}{error:9.1e}{theirs:9.0f}{theirs / ours:9.1e} "
        say(line.rstrip())
    for kind in KINDS:
        values = np.array(ratios[kind])
        low, high, middle = values.min(), values.max(), np.median(values)
        say(f"{kind}: Monte Carlo takes {low:.2g} to {high:.2g} times as long, median {middle:.2g}")


def _seconds_of_paths(found: Found, kind: str) -> float:
    """For the standard error wanted, at all incidences."""
    rng, size, total = np.random.default_rng(7), 8_000, 0.0
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
