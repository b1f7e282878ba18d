"""Time and memory against the size of the work: layers, wavelengths, stacks, pixels of a glazed
picture.

    python -m benchmarks.solver.scaling [--device gpu] [--out FOLDER]

Each series runs in a process of its own, from small to large, and notes the highest resident memory
so far. Layers and wavelengths run in turn with CDISORT's threaded batch binding (extra `benchmark`;
it has no refracting surface), each at the setting that is the cheapest with a relative error of 1e-4
on 41 wavelengths x 2 layers. Stacks have two layers and a tolerance of 1e-4: their value, value and
slopes by every albedo and thickness, and the value in single precision. A picture has two layers
with a thickness map each, 31 wavelengths, Delta E00 0.1. Warm medians, compilation left out.
Exponents are slopes of a line through the logarithms over the range given. With `--device gpu`
there is a column for it; what it holds in its own memory is not counted. Writes a table and a
log-log plot.
"""

import argparse
import json
import time
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from benchmarks import device
from benchmarks.peers import Work, cdisort, installed, two_layers
from benchmarks.results import Results, command_line, quantity
from benchmarks.timing import Programs, in_a_process, interleaved, peak_memory

NEEDS = ("matplotlib",)
PARTS_NEED = ("nanodisort",)

RELATIVE_ERROR = 1e-4
TOLERANCES = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)
# Seconds of repeated runs for one point.
PATIENCE = 1.5


class Series(NamedTuple):
    """One quantity that grows."""

    name: str
    what: str
    sizes: tuple[int, ...]
    fitted: tuple[int, int]  # range of the exponent


SERIES = (
    Series("layers", "layers, 41 wavelengths", (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 40), (2, 40)),
    Series(
        "wavelengths",
        "wavelengths, 2 layers",
        (31, 61, 121, 251, 501, 1001, 2001, 4001),
        (251, 4001),
    ),
    Series("stacks", "stacks of 2 layers", tuple(10**k for k in range(7)), (10**4, 10**6)),
    Series(
        "pixels",
        "pixels of a picture, 31 wavelengths",
        tuple(n * n for n in (64, 128, 256, 512, 1024)),
        (256**2, 1024**2),
    ),
)


def layered(layers: int) -> Work:
    """Layers that all differ, of the same total optical thickness whatever their number."""
    x, y = np.meshgrid(np.linspace(0, 1, 41), (np.arange(layers) + 0.5) / layers, indexing="ij")
    return Work(0.55 + 0.4 * np.sin(5 * x + 3 * y), (1.0 + x * y) * 2.0 / layers, 0.7, 0.83, 0.61)


def solver(work: Work, tolerance: float, index: float = 1.5) -> Callable[[], Any]:
    from benchmarks.peers import ours

    albedo, thickness = jnp.asarray(work.albedo), jnp.asarray(work.optical_thickness)
    ground = jnp.full(len(work.albedo), work.ground)
    program = jax.jit(ours.spectrum(work, index, tolerance))
    return lambda: program(albedo, thickness, ground)


def cheapest(make: Callable[[Any], Callable[[], Any]], settings: tuple, truth: np.ndarray) -> Any:
    """First setting, from coarse to fine, whose relative error on the reference work is small
    enough.
    """
    for setting in settings:
        if np.max(np.abs(np.asarray(make(setting)()) / truth - 1)) <= RELATIVE_ERROR:
            return setting
    raise RuntimeError(f"no setting reaches a relative error of {RELATIVE_ERROR:g}")


def many_stacks(count: int) -> Programs:
    """The value; with its slopes by every albedo and thickness; and in single precision."""
    from glazejax import stack_reflectance_factor

    rng = np.random.default_rng(0)
    numbers = rng.uniform(0, 1, (count, 2)), rng.uniform(0.1, 2, (count, 2))

    def value(albedo, thickness):
        return stack_reflectance_factor(albedo, thickness, 0.7, cos_incidence=0.8, tolerance=1e-4)

    def single():
        with jax.enable_x64(False):
            return value(*numbers)

    slopes = jax.value_and_grad(lambda *given: jnp.sum(value(*given)), (0, 1))
    return {
        "glazejax": lambda: value(*numbers),
        "with slopes": lambda: slopes(*numbers),
        "float32": single,
    }


def picture(pixels: int) -> Callable[[], Any]:
    from benchmarks.render.savings import picture_program

    draw = picture_program(round(pixels**0.5))
    return lambda: draw().srgb


def programs(name: str) -> Callable[[int], Programs]:
    """For a series: from a size to the programs to run."""
    if name == "stacks":
        return many_stacks
    if name == "pixels":
        return lambda size: {"glazejax": picture(size)}
    reference = two_layers()
    truth = np.asarray(solver(reference, 1e-8)())
    tolerance = cheapest(lambda t: solver(reference, t), TOLERANCES, truth)
    streams = None
    if installed("nanodisort"):
        truth = np.asarray(solver(reference, 1e-8, 1.0)())
        streams = cheapest(lambda s: cdisort.reflectance(reference, s), cdisort.SETTINGS, truth)

    def make(size: int) -> Programs:
        work = layered(size) if name == "layers" else two_layers(size)
        found: Programs = {"glazejax": solver(work, tolerance)}
        return found if streams is None else found | {"CDISORT": cdisort.reflectance(work, streams)}

    return make


def measure(name: str, platform: str) -> None:
    """Print one line of JSON for each size of a series."""
    series = next(s for s in SERIES if s.name == name)
    with jax.default_device(device.start(platform)):
        make = programs(name)
        for size in series.sizes:
            point = make(size)
            seconds, peak = {}, 0
            for key, program in point.items():
                jax.block_until_ready(program())
                if key == "glazejax":
                    peak = peak_memory()
                start = time.perf_counter()
                jax.block_until_ready(program())
                seconds[key] = time.perf_counter() - start
            repetitions = int(PATIENCE / sum(seconds.values()))
            if repetitions >= 3:
                seconds = interleaved(point, min(repetitions, 40))
            print(json.dumps({"size": size, "peak": peak, "seconds": seconds}), flush=True)


def measured(name: str, platform: str, quick: bool) -> list[dict[str, Any]]:
    """The lines of `measure` from a fresh process."""
    command = ["-m", "benchmarks.solver.scaling", "--measure", name, "--platform", platform]
    return in_a_process(*command, *["--quick"] * quick)


def exponent(points: list[dict[str, Any]], program: str, fitted: tuple[int, int]) -> float:
    """Slope of log seconds against log size within a range."""
    inside = [p for p in points if fitted[0] <= p["size"] <= fitted[1]]
    sizes, seconds = [p["size"] for p in inside], [p["seconds"][program] for p in inside]
    return float(np.polyfit(np.log(sizes), np.log(seconds), 1)[0])


def table(say: Results, series: Series, results: dict[str, list[dict[str, Any]]]) -> None:
    """Results by platform, CPU first."""
    cpu = results["cpu"]
    peer = "CDISORT" in cpu[0]["seconds"]
    others = [name for name in cpu[0]["seconds"] if name not in ("glazejax", "CDISORT")]
    elsewhere = [(p, name) for p in results if p != "cpu" for name in ("glazejax", *others)]
    columns = ["ms", "peak MiB"] + ["CDISORT ms", "ratio"] * peer + others
    columns += [f"{p} {'ms' if name == 'glazejax' else name.split()[-1]}" for p, name in elsewhere]
    say(f"\n{series.what:<36}" + "".join(f"{c:>12}" for c in columns))
    for k, point in enumerate(cpu):
        ours = point["seconds"]["glazejax"]
        cells = [f"{1e3 * ours:.4g}", f"{point['peak'] / 2**20:.0f}"]
        if peer:
            cells += [
                f"{1e3 * point['seconds']['CDISORT']:.4g}",
                f"{ours / point['seconds']['CDISORT']:.2f}",
            ]
        cells += [f"{1e3 * point['seconds'][name]:.4g}" for name in others]
        cells += [f"{1e3 * results[p][k]['seconds'][name]:.4g}" for p, name in elsewhere]
        say(f"{point['size']:<36}" + "".join(f"{c:>12}" for c in cells))
    names = [(p, "glazejax") for p in results] + [("cpu", "CDISORT")] * peer
    slopes = ", ".join(
        f"{n} {exponent(results[p], n, series.fitted):.2f}" + f" ({p})" * (p != "cpu")
        for p, n in names
    )
    say(f"exponent from {series.fitted[0]} to {series.fitted[1]}: {slopes}")


def record(say: Results, points: dict[str, list[dict[str, Any]]]) -> None:
    """Numbers of the ends of each series on the processor, and its exponent."""
    for series in SERIES:
        power = exponent(points[series.name], "glazejax", series.fitted)
        say.record(**{f"{series.name}_power": quantity(power)})
    layers = points["layers"][-1]["seconds"]
    say.record(layers_40=quantity(1e3 * layers["glazejax"], "ms"))
    if "CDISORT" in layers:
        say.record(
            layers_40_cdisort=quantity(1e3 * layers["CDISORT"], "ms", digits=0),
            layers_40_times=quantity(layers["CDISORT"] / layers["glazejax"], "times", form="g"),
        )
    stacks = points["stacks"]
    value, slopes, single = stacks[-1]["seconds"].values()
    say.record(
        million_seconds=quantity(value, "s", digits=1),
        million_slopes=quantity(slopes, "s", digits=1),
        million_single=quantity(single, "s"),
        million_alone=quantity(value / slopes, "times", form="g"),
        million_single_times=quantity(value / single, "times", form="g"),
    )
    for key, point, digits in (
        ("million", stacks[-1], 1),
        ("one", stacks[0], 1),
        ("pixels", points["pixels"][-1], 2),
        ("pixels_few", points["pixels"][0], 2),
    ):
        say.record(**{f"{key}_memory": quantity(point["peak"] / 2**30, "GiB", digits=digits)})


def draw(results: dict[str, dict[str, list[dict[str, Any]]]]) -> Any:
    """One panel a series: time on the left axis, memory on the right."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, panels = pyplot.subplots(2, 2, figsize=(10.5, 8), constrained_layout=True)
    for series, panel in zip(SERIES, panels.flat, strict=True):
        lines = []
        for platform, points in results[series.name].items():
            sizes = np.array([p["size"] for p in points])
            for name in points[0]["seconds"]:
                if name not in ("glazejax", "CDISORT") or (name == "CDISORT" and platform != "cpu"):
                    continue
                slope = exponent(points, name, series.fitted)
                label = f"{name}{'' if platform == 'cpu' else ' on ' + platform}, slope {slope:.2f}"
                colour = (
                    "0.45" if name == "CDISORT" else "#1f4e9c" if platform == "cpu" else "#2a9d5c"
                )
                seconds = [p["seconds"][name] for p in points]
                lines += panel.loglog(
                    sizes, seconds, "s--" if name == "CDISORT" else "o-", color=colour, label=label
                )
        cpu = results[series.name]["cpu"]
        memory = panel.twinx()
        peak = [p["peak"] / 2**20 for p in cpu]
        lines += memory.semilogy(
            [p["size"] for p in cpu], peak, "^:", color="#c8641e", label="peak memory"
        )
        memory.set_ylim(100, 10000)
        memory.set_ylabel("peak resident memory, MiB", color="#c8641e")
        panel.set(xlabel=series.what, ylabel="seconds", title=series.name)
        panel.grid(True, which="major", alpha=0.3)
        panel.legend(lines, [line.get_label() for line in lines], loc="upper left", fontsize=8)
    return figure


def main() -> None:
    parser = command_line(__doc__)
    device.add_option(parser)
    parser.add_argument("--measure", help=argparse.SUPPRESS)
    parser.add_argument("--platform", default="cpu", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.quick:
        globals().update(
            PATIENCE=0.1,
            SERIES=tuple(s._replace(sizes=s.sizes[:3], fitted=s.sizes[:3:2]) for s in SERIES),
        )
    jax.config.update("jax_enable_x64", True)
    if options.measure:
        measure(options.measure, options.platform)
        return
    platforms = ["cpu"] + ["gpu"] * (options.device == "gpu")
    chosen = device.start(options.device)
    say = Results(device.file_name("scaling", options.device), options.out, "nanodisort")
    if options.device == "gpu":
        say(
            f"{device.words(chosen)}; stacks go there and back in each call, 40 bytes in and 8 "
            "out each"
        )
    results: dict[str, dict[str, list[dict[str, Any]]]] = {}
    for series in SERIES:
        results[series.name] = {
            platform: measured(series.name, platform, options.quick) for platform in platforms
        }
        table(say, series, results[series.name])
    record(say, {name: series["cpu"] for name, series in results.items()})
    say.save(draw(results))


if __name__ == "__main__":
    main()
