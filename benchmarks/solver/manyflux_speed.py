"""A whole table of angles for a spectrum, compared with PythonicDISORT in the same run.

    python -m benchmarks.solver.manyflux_speed

31 wavelengths, two layers that scatter forward (Henyey and Greenstein, g = .8) on a grey ground, 19
x 19 angles from 0 to 85 degrees, in the plane of incidence (azimuth 0 and 180 degrees). Without a
refracting surface, which PythonicDISORT does not have. It solves each wavelength and each incidence
alone and interpolates between its directions of viewing; this program solves each wavelength once,
every angle exact. What is printed last is its time with the surface.
"""

import warnings
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import numpy as np

from benchmarks.results import Results, command_line, quantity
from benchmarks.timing import time_call

NEEDS = ("PythonicDISORT",)

STREAMS = (24, 32, 48, 64)
TOLERANCES = (3e-2, 1e-2, 3e-3, 1e-3)
FINE = 1e-5
G, GROUND = 0.8, 0.3
WAVELENGTHS, ANGLES = 31, 19


class Work(NamedTuple):
    """Layers, (wavelengths, 2), and angles."""

    albedo: np.ndarray
    optical_thickness: np.ndarray
    cosines: np.ndarray
    azimuth: np.ndarray


class Point(NamedTuple):
    """One setting of one program."""

    name: str
    error: float
    seconds: float


def work() -> Work:
    """A pale layer that darkens along the spectrum on one with an absorption band."""
    x = np.linspace(0.0, 1.0, WAVELENGTHS)
    return Work(
        np.stack([0.99 - 0.5 * x**2, 0.7 + 0.299 * np.sin(3 * x) ** 2], axis=1),
        np.stack([np.ones_like(x), 3.0 + 2 * x], axis=1),
        np.cos(np.deg2rad(np.linspace(0.0, 85.0, ANGLES))),
        np.array([0.0, 180.0]),
    )


def ours(work: Work, tolerance: float, index: float = 1.0) -> np.ndarray:
    """Reflectance factor, (wavelengths, viewing, incidence, azimuths)."""
    from glazejax.radiative.common.phase import henyey_greenstein
    from glazejax.radiative.manyflux.reflectance import brdf_table

    table = brdf_table(
        work.albedo,
        work.optical_thickness,
        GROUND,
        phase=henyey_greenstein(G),
        refractive_index=index,
        cos_incidence=work.cosines,
        cos_viewing=work.cosines,
        azimuth=work.azimuth,
        tolerance=tolerance,
    )
    return np.pi * np.asarray(table)


def theirs(work: Work, streams: int) -> np.ndarray:
    """The same, with its delta-M scaling and its correction of single scattering at the angles
    asked for.
    """
    from PythonicDISORT import pydisort  # pyright: ignore[reportMissingImports]
    from PythonicDISORT.subroutines import interpolate  # pyright: ignore[reportMissingImports]

    moments = G ** np.arange(200)
    peak: Any = np.full(2, moments[streams])
    turned = np.deg2rad(work.azimuth)

    def one(albedo: np.ndarray, thickness: np.ndarray, cosine: float) -> np.ndarray:
        *_, field = pydisort(
            np.cumsum(thickness),
            albedo,
            streams,
            np.tile(moments, (2, 1)),
            cosine,
            np.pi,
            0.0,
            NLeg=streams,
            NFourier=streams,
            BDRF_Fourier_modes=[GROUND],
            f_arr=peak,
            NT_cor=True,
        )
        seen: Any = interpolate(field, "eval")
        return seen(work.cosines, 0.0, turned) / cosine

    stacks = zip(work.albedo, work.optical_thickness, strict=True)
    return np.array(
        [np.stack([one(*stack, float(c)) for c in work.cosines], axis=1) for stack in stacks]
    )


def point(name: str, function: Callable[[], np.ndarray], expected: np.ndarray, runs: int) -> Point:
    """Largest error of the table and the shortest of some runs, after one to compile for ours."""
    done = [time_call(function) for _ in range(runs)]
    error = np.max(np.abs(done[-1][0] - expected))
    return Point(name, float(error), min(seconds for _, seconds in done))


def seconds_at(points: list[Point], error: float) -> float:
    """Time at an error between the points', by straight lines in the logarithms."""
    ordered = sorted(points, key=lambda p: p.error)
    return float(
        np.exp(
            np.interp(
                np.log(error),
                np.log([p.error for p in ordered]),
                np.log([p.seconds for p in ordered]),
            )
        )
    )


def main() -> None:
    """Command line."""
    options = command_line(__doc__).parse_args()
    if options.quick:
        globals().update(TOLERANCES=TOLERANCES[:2], STREAMS=STREAMS[:2], FINE=1e-4)
    jax.config.update("jax_enable_x64", True)
    warnings.simplefilter("ignore")
    out = Results("manyflux_speed", options.out, "PythonicDISORT")
    scene = work()
    out(f"{WAVELENGTHS} wavelengths, 2 layers, g = {G}, {ANGLES} x {ANGLES} angles x 2 azimuths")
    expected = ours(scene, FINE)
    out(
        f"Errors are the largest of the table, against this program at {FINE:g}; factors reach "
        f"{expected.max():.1f}.\n"
        f"{'program':36}{'error':>10}{'seconds':>10}"
    )
    mine, other = [], []
    # In turn, so that a busy machine is fair to both.
    for tolerance, streams in zip(TOLERANCES, STREAMS, strict=True):
        ours(scene, tolerance)
        mine.append(
            point(
                f"glazejax, tolerance {tolerance:g}",
                lambda t=tolerance: ours(scene, t),
                expected,
                3,
            )
        )
        other.append(
            point(
                f"PythonicDISORT, {streams} streams",
                lambda n=streams: theirs(scene, n),
                expected,
                1,
            )
        )
        for one in (mine[-1], other[-1]):
            out(f"{one.name:36}{one.error:10.1e}{one.seconds:10.2f}")
    least = max(min(p.error for p in points) for points in (mine, other))
    most = min(max(p.error for p in points) for points in (mine, other))
    errors = np.geomspace(least, most, 3)
    ratios = [seconds_at(other, error) / seconds_at(mine, error) for error in errors]
    for error, ratio in zip(errors, ratios, strict=True):
        out(f"PythonicDISORT over glazejax at an error of {error:.1e}: {ratio:.1f} times the time")
    for key, place in (("fine", 0), ("coarse", -1)):
        out.record(
            **{
                key: quantity(ratios[place], "times", digits=0),
                f"{key}_error": quantity(errors[place], digits=1, form="e"),
            }
        )
    # The coarsest setting of ours that is still more accurate than the peer's finest.
    peer = other[-1]
    own = next((p for p in mine if p.error < peer.error), mine[-1])
    out.record(
        error=quantity(own.error, digits=1, form="e"),
        peer_error=quantity(peer.error, digits=1, form="e"),
        seconds=quantity(own.seconds, "s", digits=1),
        peer_seconds=quantity(peer.seconds, "s", digits=1),
        times=quantity(peer.seconds / own.seconds, "times", digits=2, form="g"),
    )
    ours(scene, 1e-3, 1.5)
    covered = point("", lambda: ours(scene, 1e-3, 1.5), expected, 2)
    out(f"With the surface of index 1.5, tolerance 1e-3: {covered.seconds:.2f} s")
    out.save()


if __name__ == "__main__":
    main()
