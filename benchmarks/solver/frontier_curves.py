"""The curves of `benchmarks.solver.frontier`: this program, paper A's method on its grid, and
the peers.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax

from benchmarks.peers import (
    Streams,
    Work,
    adding_doubling,
    cdisort,
    installed,
    one_or_all_cores,
    ours,
    pythonic_disort,
    sasktran,
)
from benchmarks.solver.frontier_plot import BOTH, OTHERS, PAPER, Style

OURS = "glazejax n = 1.5"
OURS_GRADIENT = "glazejax n = 1.5, gradient"
CDISORT = "CDISORT n = 1"
SASKTRAN = "sasktran2 n = 1"
SASKTRAN_GRADIENT = SASKTRAN + ", gradient"
SASKTRAN_DEFAULT = SASKTRAN_GRADIENT + ", all modes"
CONVENTIONAL = "paper A, direct (conventional)"
PACKAGES = (cdisort.PACKAGE, sasktran.PACKAGE, pythonic_disort.PACKAGE, adding_doubling.PACKAGE)

_BLUE, _SKY, _VERMILION, _GREEN, _PURPLE, _ORANGE = (
    "#0072B2",
    "#56B4E9",
    "#D55E00",
    "#009E73",
    "#CC79A7",
    "#E69F00",
)


class Curve(NamedTuple):
    """One program over its settings, from coarse to fine."""

    name: str
    refractive_index: float
    settings: Sequence[Any]
    make: Callable[
        [Any], Callable[[], Any]
    ]  # a setting to a program that gives the spectrum, alone or first
    style: Style | None = None  # none: in the table only
    unit: str = ""  # after the setting in the table
    gradient: bool = False
    on_gpu: Callable[[Any], Callable[[], Any]] | None = None


def _devices() -> tuple[Any, Any]:
    """The processor, and a GPU if JAX has one."""
    return jax.devices("cpu")[0], next(
        (device for device in jax.devices() if device.platform != "cpu"), None
    )


def our_curves(work: Work) -> list[Curve]:
    """The default method over tolerances."""
    cpu, gpu = _devices()

    def curve(
        name: str, index: float, style: Style | None, finest: float = 0.0, **options: Any
    ) -> Curve:
        def on(device: Any) -> Callable[[float], Callable[[], Any]]:
            return lambda tolerance: ours.reflectance(
                work, index, tolerance, device=device, **options
            )

        tolerances = [t for t in ours.TOLERANCES if t > 0.5 * finest]
        gradient = options.get("gradient", False)
        return Curve(
            name, index, tolerances, on(cpu), style, "", gradient, on(gpu) if gpu else None
        )

    return [
        curve(OURS, 1.5, Style(_BLUE, "-", "o", BOTH, thick=True)),
        curve(OURS_GRADIENT, 1.5, Style(_BLUE, "--", "s", OTHERS, thick=True), gradient=True),
        curve("glazejax n = 1", 1.0, Style(_SKY, "-", "o", OTHERS)),
        curve(OURS + ", float32", 1.5, Style(_SKY, ":", "^", PAPER), 1e-5, single=True),
        curve(OURS_GRADIENT + ", float32", 1.5, None, 1e-4, single=True, gradient=True),
    ]


def paper_curves(work: Work) -> list[Curve]:
    """Paper A's method over its step, and on a graded mesh over tolerances."""
    cpu, gpu = _devices()

    def curve(
        name: str,
        settings: Sequence[float],
        make: Callable,
        unit: str,
        style: Style,
        **options: Any,
    ) -> Curve:
        def on(device: Any) -> Callable[[float], Callable[[], Any]]:
            return lambda setting: make(work, setting, device=device, **options)

        return Curve(name, 1.5, settings, on(cpu), style, unit, on_gpu=on(gpu) if gpu else None)

    def stepped(name: str, variant: str, corrected: bool, style: Style) -> Curve:
        return curve(
            name, ours.STEPS, ours.stepped, "step", style, variant=variant, corrected=corrected
        )

    return [
        stepped(CONVENTIONAL, "direct", False, Style("#000000", "-", "D", PAPER)),
        stepped("paper A, decomposed", "decomposed", False, Style(_VERMILION, "--", "v", PAPER)),
        stepped("paper A, fixed step", "fixed_step", False, Style(_PURPLE, "-", "P", PAPER)),
        stepped("fixed step, corrected", "fixed_step", True, Style(_GREEN, "-", "X", PAPER)),
        curve(
            'method="auxiliary"',
            ours.TOLERANCES[:7:2],
            ours.graded,
            "",
            Style(_ORANGE, "-", "s", PAPER),
        ),
    ]


def peer_curves(work: Work) -> tuple[list[Curve], list[str]]:
    """Curves of the peers that are installed, and a line for each that is not."""

    def gradient(modes: int) -> Callable[[Streams], Callable[[], Any]]:
        return lambda setting: sasktran.reflectance_and_gradient(work, setting, modes)

    def over_streams(name: str, peer: Any, style: Style) -> Curve:
        return Curve(
            name,
            1.0,
            peer.SETTINGS,
            lambda streams: peer.reflectance(work, streams),
            style,
            "streams",
        )

    by_package = {
        cdisort.PACKAGE: [over_streams(CDISORT, cdisort, Style(_VERMILION, "-", "D", OTHERS))],
        sasktran.PACKAGE: [
            over_streams(SASKTRAN, sasktran, Style(_GREEN, "-", "v", OTHERS))._replace(unit=""),
            Curve(
                SASKTRAN_GRADIENT,
                1.0,
                sasktran.SETTINGS,
                gradient(modes=1),
                Style(_GREEN, "--", "v", OTHERS),
                gradient=True,
            ),
            Curve(
                SASKTRAN_DEFAULT, 1.0, one_or_all_cores(8, 12, 40), gradient(modes=0), gradient=True
            ),
        ],
        pythonic_disort.PACKAGE: [
            over_streams("PythonicDISORT n = 1", pythonic_disort, Style(_PURPLE, "-", "P", OTHERS))
        ],
        adding_doubling.PACKAGE: [
            over_streams(
                "iadpython n = 1.5", adding_doubling, Style(_ORANGE, "-", "X", OTHERS)
            )._replace(refractive_index=1.5, unit="")
        ],
    }
    curves, missing = [], []
    for package, group in by_package.items():
        if installed(package):
            curves += group
        else:
            missing.append(
                f"{package} is not installed and left out; pip install '.[benchmark]' brings it"
            )
    return curves, missing
