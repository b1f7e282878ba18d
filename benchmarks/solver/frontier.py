"""Run time against error: this program and every peer that installs from PyPI, on the same work.

    python -m benchmarks.solver.frontier [--device gpu] [--out FOLDER]

41 wavelengths x 2 layers, one geometry, reflectance factor. Peers need the extra `benchmark`; one
that is missing gets a line that says so. Error: the largest relative error over the wavelengths,
against a run of this program with half as many directions again as for its finest tolerance, which
the peers' finest runs confirm. Times: warm medians of programs run in turn, set-up and compilation
left out. Writes a table and a log-log plot. With `--device gpu` this program's curves, their
gradients and single precision among them, get a second column, 'ms GPU'; errors stay those of the
processor's values.
"""

import os
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import jax
import numpy as np

from benchmarks import device
from benchmarks.peers import Work, installed, ours, sasktran, two_layers, without_blas_threads
from benchmarks.results import Results, command_line, ends, quantities, quantity
from benchmarks.solver.frontier_curves import (
    CDISORT,
    CONVENTIONAL,
    OURS,
    OURS_GRADIENT,
    PACKAGES,
    SASKTRAN_DEFAULT,
    SASKTRAN_GRADIENT,
    Curve,
    our_curves,
    paper_curves,
    peer_curves,
)
from benchmarks.solver.frontier_plot import draw
from benchmarks.timing import Programs, interleaved

NEEDS = ("matplotlib",)
PARTS_NEED = ("nanodisort", "sasktran2", "PythonicDISORT", "iadpython", "threadpoolctl")

# Tolerances whose errors and times texts quote, and errors at which peers are compared.
QUOTED = (1e-2, 1e-4, 1e-6, 1e-8, 1e-10)
ASKED = (1e-4, 1e-8)


class Row(NamedTuple):
    """One point of a curve."""

    curve: Curve
    setting: Any
    error: float
    seconds: float
    gpu_seconds: float | None


def measure(
    curves: Iterable[Curve], truth: dict[float, np.ndarray], say: Results, repetitions: int = 40
) -> list[Row]:
    """Errors of every curve's settings, then the times of all of them in turn."""
    found: list[tuple[Curve, Any, float]] = []
    programs: Programs = {}
    for curve in curves:
        for setting in curve.settings:
            try:
                program = curve.make(setting)
                value = program()
                if curve.on_gpu is not None:
                    programs[f"{len(found)} gpu"] = curve.on_gpu(setting)
            except (
                Exception
            ) as trouble:  # a peer's failure is a result, not the end of the benchmark
                say(
                    f"{curve.name} {setting} {curve.unit} failed: {type(trouble).__name__}: "
                    f"{trouble}"
                )
                continue
            value = np.asarray(value[0] if isinstance(value, tuple) else value, float)
            programs[str(len(found))] = program
            found.append(
                (curve, setting, float(np.max(np.abs(value / truth[curve.refractive_index] - 1))))
            )
    if without_blas_threads() is None:
        say("threadpoolctl is not installed: BLAS keeps its threads, which slows the peers down")
    seconds = interleaved(programs, repetitions, budget=0.2, rewarm=True)
    return [Row(*point, seconds[str(i)], seconds.get(f"{i} gpu")) for i, point in enumerate(found)]


def envelope(rows: Iterable[Row]) -> list[Row]:
    """The rows that no other beats in both error and time, from coarse to fine."""
    best: list[Row] = []
    for row in sorted(rows, key=lambda row: (row.seconds, row.error)):
        if not best or row.error < best[-1].error:
            best.append(row)
    return best


def seconds_at(rows: Iterable[Row], error: float) -> float | None:
    """Time at an error, interpolated in log-log; None where no row is accurate enough."""
    best = envelope(rows)
    if not best or best[-1].error > error:
        return None
    xs = np.log([row.error for row in reversed(best)])
    ys = np.log([row.seconds for row in reversed(best)])
    return float(np.exp(np.interp(np.log(error), xs, ys)))


def of(rows: Iterable[Row], name: str) -> list[Row]:
    """The rows of a curve."""
    return [row for row in rows if row.curve.name == name]


def rival(row: Row) -> str:
    """Our curve that a row is compared with."""
    return OURS_GRADIENT if row.curve.gradient else OURS


def over_ours(rows: Iterable[Row], row: Row) -> float | None:
    """A row's time over ours at its error; None for our own, and where ours reach it not."""
    reference = seconds_at(of(rows, rival(row)), row.error)
    if row.curve.name.startswith(OURS) or reference is None:
        return None
    return row.seconds / reference


def fastest(rows: Iterable[Row], name: str) -> list[tuple[float, float]]:
    """A curve as (error, seconds), with the better number of threads at each error."""
    points: dict[float, float] = {}
    for row in of(rows, name):
        # Threads change the last digits of the error only.
        key = next((e for e in points if abs(e / row.error - 1) < 1e-3), row.error)
        points[key] = min(points.get(key, np.inf), row.seconds)
    return sorted(points.items(), reverse=True)


def cheapest(rows: Iterable[Row], error: float) -> Row | None:
    """The fastest row with at most this error."""
    return min(
        (row for row in rows if row.error <= error), key=lambda row: row.seconds, default=None
    )


def table(rows: Sequence[Row], say: Results) -> None:
    gpu = any(row.gpu_seconds is not None for row in rows)
    say(
        "'x ours': time over that of glazejax n = 1.5 (value, or with gradient) interpolated at "
        "the same error"
    )
    say(
        f"{'program':<36} {'setting':<14} {'error':>8} {'ms':>9}"
        + (f"{'ms GPU':>9}" if gpu else "")
        + f"{'x ours':>9}"
    )
    for row in rows:
        ratio = over_ours(rows, row)
        setting = f"{row.setting:g}" if isinstance(row.setting, float) else str(row.setting)
        on_gpu = (
            ""
            if not gpu
            else f"{1e3 * row.gpu_seconds:9.3f}"
            if row.gpu_seconds is not None
            else " " * 9
        )
        say(
            f"{row.curve.name:<36} {setting + ' ' + row.curve.unit:<14} {row.error:8.1e} "
            f"{1e3 * row.seconds:9.3f}"
            f"{on_gpu}{'' if ratio is None else f'{ratio:9.3g}'}"
        )


def headlines(rows: Sequence[Row], say: Results) -> None:
    """The ratios asked for, each with its target."""

    def line(what: str, where: str, ratio: float | None, target: float, also: str = "") -> None:
        if ratio is None:
            say(
                f"{what:<58} {where:<10} {'-':>8}  <= {target:<7g} not measured: one side does "
                "not reach this error"
            )
        else:
            verdict = "met" if ratio <= target else "missed"
            say(f"{what:<58} {where:<10} {ratio:8.3g}  <= {target:<7g} {verdict:<8}{also}".rstrip())

    def against(key: str, ours_name: str, peer: str, what: str, target: float) -> None:
        for error in ASKED if of(rows, peer) else ():
            times = [seconds_at(of(rows, name), error) for name in (ours_name, peer)]
            pair = [cheapest(of(rows, name), error) for name in (ours_name, peer)]
            ratio = times[0] / times[1] if times[0] and times[1] else None
            steps = (
                f"cheapest settings: {pair[0].seconds / pair[1].seconds:.2g}"
                if pair[0] and pair[1]
                else ""
            )
            line(what, f"at {error:.0e}", ratio, target, steps)
            if ratio is not None:
                say.record(**{f"{key}_{in_name(error)}": quantity(1 / ratio, digits=2, form="s")})

    say(f"{'ratio of times, in this run':<58} {'':<10} {'ratio':>8}  target")
    against("cdisort", OURS, CDISORT, "glazejax n = 1.5 / CDISORT without surface", 0.2)
    against(
        "sasktran2",
        OURS_GRADIENT,
        SASKTRAN_GRADIENT,
        "with gradient: glazejax n = 1.5 / sasktran2, one mode",
        0.02,
    )
    against(
        "sasktran2_all_modes",
        OURS_GRADIENT,
        SASKTRAN_DEFAULT,
        "with gradient: glazejax n = 1.5 / sasktran2, all modes",
        0.02,
    )
    values = {row.setting: row.seconds for row in of(rows, OURS)}
    ratios = {row.setting: row.seconds / values[row.setting] for row in of(rows, OURS_GRADIENT)}
    gradient, most = ratios[1e-6], max(ratios.values())
    line("value and gradient / value", f"tol. {1e-6:.0e}", gradient, 1.5)
    line("value and gradient / value, largest over tolerances", "", most, 1.5)
    say.record(
        alone=quantity(1 / gradient, "times", form="g"),
        gradient=quantity(gradient, "times", digits=1),
        gradient_most=quantity(most, "times", digits=1),
    )
    conventional = min(of(rows, CONVENTIONAL), key=lambda row: row.setting)
    match = cheapest(of(rows, OURS), conventional.error / 10)
    assert match is not None
    line(
        "glazejax / conventional at dh = .01, a tenth of its error or less",
        "",
        match.seconds / conventional.seconds,
        5e-4,
        f"errors {match.error:.1e}, {conventional.error:.1e}",
    )
    say.record(
        conventional=quantity(conventional.seconds / match.seconds, "times", digits=0),
        conventional_errors=quantity(conventional.error / match.error, "times", digits=0),
    )


def in_name(setting: float) -> str:
    """1e-4 as `1e4`."""
    return f"1e{-round(np.log10(setting))}"


def record_curves(rows: Sequence[Row], say: Results) -> None:
    """Our errors and times at some tolerances, peers at the errors asked for, paper A over ours."""
    ours_at = {(name, row.setting): row for name in (OURS, OURS_GRADIENT) for row in of(rows, name)}
    for setting in QUOTED:
        value = ours_at[OURS, setting]
        slopes = ours_at[OURS_GRADIENT, setting]
        key = in_name(setting)
        say.record(
            **{
                f"error_{key}": quantity(value.error, digits=0, form="e"),
                f"value_{key}": quantity(1e3 * value.seconds, "ms"),
                f"slopes_{key}": quantity(1e3 * slopes.seconds, "ms"),
            }
        )
    for peer, name in (("cdisort", CDISORT), ("sasktran2", SASKTRAN_GRADIENT)):
        for asked in ASKED:
            row = cheapest(of(rows, name), asked)
            if row is None:
                continue
            times = row.seconds / ours_at[rival(row), asked].seconds
            key = in_name(asked)
            say.record(
                **{
                    f"{peer}_error_{key}": quantity(row.error, digits=0, form="e"),
                    f"{peer}_ms_{key}": quantity(1e3 * row.seconds, "ms", digits=1),
                    f"{peer}_asked_{key}": quantity(times, "times", digits=2, form="s"),
                }
            )
    for key, starts in (("auxiliary", ("method=",)), ("paper", ("paper A", "fixed step"))):
        own = [over_ours(rows, row) for row in rows if row.curve.name.startswith(starts)]
        times = [ratio for ratio in own if ratio is not None]
        say.record(**quantities(ends(key, times), "times", 1, form="s", n=len(times)))


def confirm(rows: Sequence[Row], peers: Iterable[Curve], work: Work, say: Results) -> None:
    """What the peers' finest runs say of the reference, and sasktran2 of our derivatives."""
    say(
        "Reference: glazejax with half as many directions again as its finest. Peers' finest "
        "agree with it to:"
    )
    for name in (curve.name for curve in peers):
        best = min(of(rows, name), key=lambda row: row.error, default=None)
        if best is not None:
            say(f"  {name:<36} {best.error:.1e} ({f'{best.setting} {best.curve.unit}'.strip()})")
    if installed(sasktran.PACKAGE):
        theirs = sasktran.reflectance_and_gradient(work, sasktran.SETTINGS[-1])()[1]
        mine: Any = ours.reflectance(work, 1.0, ours.TOLERANCES[-1], gradient=True)()
        worst = max(
            np.max(np.abs(a - b)) / np.max(np.abs(a)) for a, b in zip(theirs, mine[1], strict=True)
        )
        say(
            f"  derivatives of sasktran2 and glazejax, n = 1: {worst:.1e} of the largest of each "
            "kind"
        )


def main() -> None:
    parser = command_line(__doc__)
    device.add_option(parser)
    options = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    chosen = device.start(options.device)
    say = Results(device.file_name("frontier", options.device), options.out, *PACKAGES)
    work = two_layers()
    peers, missing = peer_curves(work)
    say(
        "Run time against error: 41 wavelengths x 2 layers, one geometry, reflectance factor; "
        "float64 unless said"
    )
    if options.device == "gpu":
        say(f"{device.words(chosen)}; 'ms GPU' is its time, inputs and results in its own memory")
    say(
        f"Threads: glazejax XLA's own pool; CDISORT {os.cpu_count()}; sasktran2 as its setting "
        "says, streams/threads;\n"
        "the others offer none. BLAS, which the peers call, keeps to one thread: more cost them "
        "time.\n"
        "sasktran2 is set up knowing that isotropic scattering has one azimuth mode ('all modes' is its "
        "default).\n"
        "CDISORT, sasktran2 and PythonicDISORT cannot do a refracting surface and solve n = 1.\n"
        "Paper A's method (direct, decomposed, fixed step: as printed; corrected: without its "
        "errors of first order)\n"
        "solves n = 1.5. It sets its grid by the thickness outside the compiled program, which "
        "is timed with it."
    )
    for line in missing:
        say(line)
    truth = {index: ours.converged(work, index) for index in ours.CONVERGED}
    curves = our_curves(work) + paper_curves(work) + peers
    if options.quick:
        curves = [curve._replace(settings=curve.settings[::2]) for curve in curves]
    rows = measure(curves, truth, say, repetitions=3 if options.quick else 40)
    say()
    confirm(rows, peers, work, say)
    say()
    table(rows, say)
    say()
    headlines(rows, say)
    record_curves(rows, say)
    drawn = {curve.name: curve.style for curve in curves if curve.style is not None}
    say.save(
        draw(
            {
                name: (style, points)
                for name, style in drawn.items()
                if (points := fastest(rows, name))
            }
        )
    )


if __name__ == "__main__":
    main()
