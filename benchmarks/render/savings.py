"""What is gained by leaving out what a scene does not need: each saving of the plan on and off, and
glazed pictures.

    python -m benchmarks.render.savings [--device gpu] [--out FOLDER]

Each saving gets a scene it is made for, and runs on it alone against none at all (reciprocity: with
and without it, where equal stacks are computed once): time with the plan's own included, warm
medians of programs run in turn, and the largest change of the result, as a share of the tolerance
asked for.
Then a picture of 512 x 512 pixels, two layers with a thickness map each, 31 wavelengths, to sRGB:
seconds and peak memory in a process of its own, and the colour difference from computing pixels one
by one. Writes a table and the picture. The plan itself is made on the processor, whatever the
device.
"""

import argparse
import functools
import json
from collections.abc import Callable
from typing import Any

import jax
import numpy as np

from benchmarks import device
from benchmarks.render.strokes import brush_strokes, primed_canvas
from benchmarks.results import Results, command_line, quantity
from benchmarks.timing import in_a_process, interleaved, peak_memory, time_call

PAINTS = ("UltramarineBlue", "ChromeYellow")
GROUND = 0.85
PICTURE_SIZE = 512
CHECKED_PIXELS = 2500
REPETITIONS = 5


def picture_program(size: int) -> functools.partial:
    """A function that draws the picture of so many pixels along a side; it takes options of
    `glazejax.picture`.
    """
    import glazejax as gj

    paints = [gj.catalogue.load()[name] for name in PAINTS]
    return functools.partial(gj.picture, paints, [brush_strokes(size), primed_canvas(size)], GROUND)


def scenes() -> dict[str, tuple[str, dict[str, Any]]]:
    """A scene for each saving: what it is, and arguments of `plan_stacks`."""
    from glazejax import colour

    rng = np.random.default_rng(0)

    def stacks(count: int, layers: int, depth: float = 1.0) -> dict[str, Any]:
        thickness = depth * rng.uniform(0.3, 1.0, (count, layers))
        return {
            "albedo": rng.uniform(0.2, 0.95, (count, layers)),
            "optical_thickness": thickness,
            "substrate_reflectance": rng.uniform(0.3, 0.9, count),
            "cos_incidence": 0.8,
        }

    found: dict[str, tuple[str, dict[str, Any]]] = {}
    scene = stacks(1024, 8)
    scene["albedo"] = np.repeat(scene["albedo"][:, ::2], 2, axis=1)
    scene["optical_thickness"][:, 5] = 0.0
    found["layers"] = ("1024 stacks of 8 layers, equal in pairs, some empty", scene)
    scene = stacks(1024, 6)
    scene["albedo"] = np.minimum(scene["albedo"], 0.9)
    scene["optical_thickness"][:, 1] = 40.0
    found["hidden"] = ("1024 stacks of 6 layers, the second opaque", scene)
    scene = stacks(1024, 3)
    scene["albedo"] *= 1e-8
    found["scattering"] = ("1024 stacks of 3 dyed layers that scatter next to nothing", scene)
    scene = stacks(256, 2)
    repeated = rng.integers(0, 256, 4096)
    scene = {k: np.asarray(v)[repeated] if np.ndim(v) else v for k, v in scene.items()}
    found["equal"] = ("4096 pixels of 256 kinds, 2 layers", scene)
    cosines = np.cos(np.deg2rad(np.linspace(0, 85, 18)))
    scene = stacks(31, 2)
    for k in ("albedo", "optical_thickness", "substrate_reflectance"):
        scene[k] = scene[k][:, None, None]
    scene |= {"cos_incidence": cosines[:, None], "cos_viewing": cosines}
    found["reciprocity"] = ("31 bands x 18 x 18 angles, 2 layers", scene)
    grid = np.arange(360.0, 781.0, 5.0)
    x = (grid - 360) / 420
    scene = {
        "albedo": np.stack([0.3 + 0.6 * x, 0.9 - 0.5 * x], -1),
        "optical_thickness": rng.uniform(0.5, 1.5, (480, 1, 1)) * np.array([1.0, 3.0]),
        "substrate_reflectance": 0.8,
        "band_weights": colour.colour_weights(grid),
        "tolerance": 1e-3,
    }
    found["bands"] = ("480 pixels, 360-780 nm step 5, for XYZ within 1e-3, 2 layers", scene)
    scene = stacks(2048, 2)
    found["unwanted"] = (
        "2048 pixels, a quarter of them inside the outline, 2 layers",
        scene | {"wanted": np.arange(2048) < 512},
    )
    scene = stacks(2048, 8)
    scene["optical_thickness"] *= np.arange(8) < rng.choice([1, 2, 8], (2048, 1), p=[0.5, 0.4, 0.1])
    found["groups"] = ("2048 stacks of 1, 2 or (one in ten) 8 layers", scene)
    return found


def savings_table(say: Results) -> None:
    from glazejax.radiative.plan.plan import Savings, plan_stacks

    none = Savings(*(False for _ in Savings._fields))
    say(f"{'saving':<12} {'scene':<58} {'ms off':>7} {'ms on':>7} {'ratio':>6} change/tolerance")
    for name, (words, scene) in scenes().items():
        tolerance = scene.setdefault("tolerance", 1e-6)

        def run(savings: Savings, scene: dict[str, Any] = scene) -> Callable[[], Any]:
            return lambda: plan_stacks(**scene, savings=savings).run()

        # Exchanged directions are only a case of equal stacks.
        base = none._replace(equal=name == "reciprocity")
        programs = {"off": run(base), "on": run(base._replace(**{name: True}))}
        seconds = interleaved(programs, REPETITIONS)
        off, on = (np.asarray(program()) for program in programs.values())
        if name == "bands":
            weights = scene["band_weights"]
            change = np.max(np.abs((on - off) @ weights) / np.abs(weights).sum(axis=0))
        else:
            change = np.nanmax(np.abs(on - off))
        off, on = 1e3 * seconds["off"], 1e3 * seconds["on"]
        times = f"{off:7.1f} {on:7.1f} {on / off:6.2f}"
        say(f"{name:<12} {words:<58} {times} {change / tolerance:10.2g}")


def measure_picture() -> dict[str, float]:
    """Seconds of the first and of later pictures, and peak resident memory; to be run in a fresh
    process.
    """
    draw = picture_program(PICTURE_SIZE)
    seconds = [time_call(lambda: draw().srgb)[1] for _ in range(4)]
    return {"first": seconds[0], "later": float(np.median(seconds[1:])), "peak": peak_memory()}


def picture_report(say: Results, options: argparse.Namespace) -> None:
    import glazejax as gj
    from glazejax import colour

    command = ["-m", "benchmarks.render.savings", "--measure-picture"]
    command += ["--device", options.device, *["--quick"] * options.quick]
    measured = in_a_process(*command)[-1]
    draw = picture_program(PICTURE_SIZE)
    paints, thickness, _ = draw.args
    fast = draw()
    chosen = np.random.default_rng(0).choice(PICTURE_SIZE**2, CHECKED_PIXELS, replace=False)
    pixels = [m.reshape(1, -1)[:, chosen] for m in thickness]
    gj.picture(paints, pixels, GROUND, full=True)
    full, taken = time_call(lambda: gj.picture(paints, pixels, GROUND, full=True))
    seconds = taken * PICTURE_SIZE**2 / CHECKED_PIXELS
    white = colour.white_point(paints[0].wavelengths)
    labs = [colour.xyz_to_lab(xyz, white) for xyz in (fast.xyz.reshape(-1, 3)[chosen], full.xyz[0])]
    error = colour.delta_e_2000(*labs)
    say(
        f"\npicture of {PICTURE_SIZE} x {PICTURE_SIZE} pixels, {' over '.join(PAINTS)}, 31 "
        "wavelengths, to sRGB\n"
        f"  {fast.report}"
    )
    later, first, peak = (measured[name] for name in ("later", "first", "peak"))
    say(
        f"  seconds: {later:.2f}, the first time {first:.1f} with compilation\n"
        f"  peak memory of the process: {peak / 2**30:.2f} GiB"
    )
    times = seconds / later
    say(
        f"  pixel by pixel it would take {seconds:.0f} s (from {CHECKED_PIXELS}), {times:.0f} "
        "times as long\n"
        f"  Delta E00 from that, at {CHECKED_PIXELS} random pixels: mean {error.mean():.4f}, max "
        f"{error.max():.4f}"
    )
    say.record(
        picture=quantity(later, "s", 2),
        picture_first=quantity(first, "s", 1),
        picture_memory=quantity(peak / 2**30, "GiB", 2),
        pixel_by_pixel=quantity(seconds, "s", 0, n=CHECKED_PIXELS),
        delta_e_most=quantity(error.max(), digits=3, n=CHECKED_PIXELS),
        times=quantity(times, "times", 2, form="s"),
    )
    options.out.mkdir(parents=True, exist_ok=True)
    fast.save(options.out / f"{device.file_name('glazed_picture', options.device)}.png")


def main() -> None:
    parser = command_line(__doc__)
    device.add_option(parser)
    parser.add_argument("--measure-picture", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.quick:
        globals().update(PICTURE_SIZE=64, CHECKED_PIXELS=100, REPETITIONS=2)
    jax.config.update("jax_enable_x64", True)
    chosen = device.start(options.device)
    if options.measure_picture:
        print(json.dumps(measure_picture()))
        return
    say = Results(device.file_name("savings", options.device), options.out)
    say(device.words(chosen))
    savings_table(say)
    picture_report(say, options)
    say.save()


if __name__ == "__main__":
    main()
