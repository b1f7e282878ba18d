"""Maps of paintings whose truth is known: seconds and memory by size, agreement with the full
search, and rivals.

    python -m benchmarks.maps.painting [--megapixels 0.1 1 10] [--bands 200]
        [--checked 2000]

Each painting is written to disk first (10 megapixels of 200 bands take 4 GB as 16-bit integers),
then mapped by a process of its own, as `glazejax map` does, whose time and peak memory are taken.
"""

import json
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from benchmarks.results import Results, command_line, percent, quantities, quantity
from benchmarks.rivals.known_painting import Painting, painting, write_painting
from benchmarks.rivals.known_painting_scene import FOREIGN
from benchmarks.rivals.painting_rivals import (
    Row,
    Truth,
    answer_of_map,
    compared,
    sampled,
    table,
)
from benchmarks.timing import in_a_process, peak_memory, time_call

if TYPE_CHECKING:
    from glazefit.mapping.solve.task import MapTask

NEEDS = ("zarr",)

_SEED, _OTHER = 3, 4
SIZES = ("small", "million", "large")
"""What texts call the paintings, by size."""
PAINTS = "paints.csv"
"""Paints that the map is given, next to a cube; without such a file the oils that ship."""


def main() -> None:
    parser = command_line(
        __doc__,
        {"megapixels": [0.001, 0.004, 0.01]},
        bands=(200, 40, "of an image"),
        checked=(2000, 100, "pixels that are searched in full"),
    )
    parser.add_argument("--megapixels", type=float, nargs="+", default=[0.1, 1.0, 10.0])
    options = parser.parse_args()
    results = Results("painting", options.out, "zarr")
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        sides = [round((1e6 * size) ** 0.5) for size in sorted(options.megapixels)]
        runs = [
            _size(results, folder, side, options.bands, number) for number, side in enumerate(sides)
        ]
        results(
            "\n'saved': a search of every pixel, at the pace of the representatives, over the time "
            "that the map took"
        )
        middle = min(1, len(sides) - 1)
        where = folder / str(sides[middle])
        _truth(results, where, sides[middle], options.bands, options.checked, runs)
    results.save()


class Run(NamedTuple):
    """A map of a painting of so many pixels."""

    pixels: int
    seconds: float


def _size(results: Results, folder: Path, side: int, bands: int, number: int) -> Run:
    """Write and map one painting, the first, second or third by its size."""
    where = folder / str(side)
    write_painting(where, painting((side, side), bands, _SEED))
    if number == 0:
        # Programs are compiled once and kept, as on a second call of the command.
        map_painting(where)
        results(
            "Seconds by stage, and peak memory of the process; programs were compiled by a run "
            "before.\n"
            f"{'pixels':>12}{'bands':>7}{'survey':>9}{'search':>9}{'check':>9}{'map':>9}{'all':>9}{'pixels/s':>10}"
            f"{'GiB':>7}{'closed form':>13}{'own search':>12}{'saved':>8}"
        )
    done = map_painting(where)
    stages, tallies = done["stages"], done["tallies"]
    mapped = tallies["mapped"]
    run = Run(pixels=side * side, seconds=done["seconds"])
    # What a search of every pixel would take at the pace at which the representatives were
    # searched.
    whole = mapped * stages["search"] / done["representatives"]
    saved = whole / run.seconds
    searched = (tallies["way searched"] + done["representatives"]) / mapped
    rate = run.pixels / run.seconds
    results(
        f"{run.pixels:>12,}{bands:>7}"
        + "".join(f"{stages[name]:>9.1f}" for name in ("survey", "search", "check", "map"))
        + f"{run.seconds:>9.1f}{rate:>10.0f}{done['gib']:>7.2f}"
        + f"{(tallies['way updated'] + tallies['way neighbour']) / mapped:>13.2%}"
        + f"{searched:>12.3%}{saved:>7.0f}x"
    )
    kept = {
        "pixels": quantity(run.pixels, digits=0, form=","),
        "seconds": quantity(run.seconds, "s", 1),
        "rate": quantity(rate, digits=0),
        "memory": quantity(done["gib"], "GiB", 2),
    }
    results.record(**{f"{SIZES[number]}_{name}": value for name, value in kept.items()})
    if SIZES[number] == "large":
        results.record(saved=quantity(saved, "times", 0))
        results.record(searched=percent(searched, 2, n=int(mapped)))
    return run


def map_painting(where: Path) -> dict:
    """Map a painting in a process of its own, into map.zarr."""
    code = f"from benchmarks.maps.painting import child; child({str(where)!r})"
    return in_a_process("-c", code)[-1]


_STAGES = {"reading": "survey", "surveying": "survey", "searching": "search"}
_STAGES |= {"checking": "check", "mapping": "map"}


def child(folder: str) -> None:
    """What `glazejax map` does, with the times of its stages as one line of JSON."""
    where = Path(folder)
    from glazefit.mapping.store.process import few_arenas

    few_arenas()
    from glazejax import catalogue
    from glazejax.commands.main import start_jax

    start_jax()
    from glazefit.mapping.map_cube import map_cube
    from glazejax.io import read_spectra

    table = where / PAINTS
    shelf = catalogue.read(table) if table.exists() else catalogue.load()
    stages = dict.fromkeys(_STAGES.values(), 0.0)
    start = time.perf_counter()
    latest = "reading", start

    def end_stage(done: int, total: int | None, stage: str) -> None:
        nonlocal latest
        if stage != latest[0]:
            now = time.perf_counter()
            stages[_STAGES[latest[0]]] += now - latest[1]
            latest = stage, now

    found = map_cube(
        where / "painting.hdr",
        [paint for name, paint in shelf.items() if name not in FOREIGN],
        ground=read_spectra(where / "ground.csv").reflectance[0],
        out=where / "map.zarr",
        overwrite=True,
        progress=end_stage,
    )
    end_stage(0, None, "")
    done = {
        "seconds": time.perf_counter() - start,
        "stages": stages,
        "gib": peak_memory() / 2**30,
        "tallies": found.attrs["tallies"],
        "representatives": found.attrs["representatives"],
    }
    print(json.dumps(done))


def _truth(
    results: Results, where: Path, side: int, bands: int, pixels: int, runs: list[Run]
) -> None:
    """The map of one of the runs compared with the full search, with `identify` as it is called,
    and with the truth and its rivals.
    """
    import jax

    jax.config.update("jax_enable_x64", True)
    from glazefit.film.films import Noise
    from glazefit.mapping.solve.answers import agreement
    from glazefit.mapping.solve.task import map_task
    from glazejax import catalogue

    scene, other = painting((side, side), bands, _SEED), painting((480, 640), bands, _OTHER)
    truth, places, arrays, noise = _checked(scene, where, pixels)
    results(
        f"\n{len(places)} pixels of {side} x {side}, each mean of equal neighbours searched in full "
        "at the map's bands and noise:"
    )
    paints = [paint for name, paint in catalogue.load().items() if name not in FOREIGN]
    stated = Noise(*noise)
    task = map_task(where / "painting.hdr", paints, ground=scene.ground, noise=stated)
    readings = _readings(task, places)
    start = time.perf_counter()
    same = agreement(arrays, task.searcher.answers(readings, task.image.noise_sd(readings)))
    full = (time.perf_counter() - start) / len(places)
    fine = _at_image_bands(scene, paints)
    results(
        f"  same first set {float(same['first']):.1%}, same answer to 'none' "
        f"{float(same['explained']):.1%}\n"
        f"  a paint's probability differs by {float(same['probability']):.3f} in the median of the "
        "largest difference,\n"
        f"  by {float(same['probability_90']):.3f} in nine of ten; thickness by "
        f"{float(same['amount']):.3f} and "
        f"{float(same['amount_90']):.3f} of its standard deviation\n"
        f"  the full search took {full * 1e3:.1f} ms a pixel\n"
        f"  and {fine * 1e3:.0f} ms at every second band of the image, not averaged to "
        f"{task.image.count.size} (16 pixels)"
    )
    large = runs[-1]
    shares = {"same_set": 100.0 * same["first"], "same_none": 100.0 * same["explained"]}
    off = {
        "probability_median": same["probability"],
        "probability_most": same["probability_90"],
        "thickness_median": same["amount"],
        "thickness_most": same["amount_90"],
    }
    results.record(
        **quantities(shares, "%", 1, n=len(places)),
        **quantities(off, digits=3, n=len(places)),
        averaged=quantity(fine / full, "times", 1),
        full_hours=quantity(full * large.pixels / 3600.0, "h", 0),
        full_times=quantity(full * large.pixels / large.seconds, "times", 2, form="s"),
    )
    results(
        f"\nAgainst the truth, {len(places)} pixels; rivals choose cut and threshold on another "
        "painting:"
    )
    middle = runs[min(1, len(runs) - 1)]
    pace = middle.seconds / middle.pixels
    rows = compared(scene, other, pixels)
    rows.append(Row.of("map_cube", truth, answer_of_map(arrays), scene.names, pace))
    for line in table(rows):
        results(line)
    for key, row in zip(METHODS, rows[1:], strict=True):
        shares = {name: 100.0 * getattr(row.score, score) for name, score in QUOTED.items()}
        results.record(
            **{f"{key}_{name}": each for name, each in quantities(shares, "%", 1).items()},
            **{f"{key}_shares": quantity(row.score.share_error, digits=3)},
        )
    results.record(
        map_two_coats=percent(rows[-1].by_coats[1]),
        angle_rate=quantity(1.0 / rows[1].seconds, "pixels/s", 3, form="s"),
        angle_times=quantity(rows[1].seconds / pace, "times", 2, form="g"),
    )


METHODS = ("angle", "nnls", "nnls_log", "opaque", "film", "map")
"""What texts call all methods but the angle to pure paints alone, in the order of `rivals`."""
QUOTED = {
    "right": "right_set",
    "main": "right_main",
    "false": "false_none",
    "found": "none_found",
}
"""Shares of a score by the names that texts quote them by."""


def _checked(
    scene: Painting, where: Path, pixels: int
) -> tuple[Truth, np.ndarray, dict[str, np.ndarray], Sequence[float]]:
    """Truth of some pixels, where they are, what the map says there, and the map's noise."""
    from glazefit import open_map

    found = open_map(where / "map.zarr")
    _, truth, places = sampled(scene, pixels)
    arrays = {str(name): found[name].values[tuple(places.T)] for name in found.data_vars}
    return truth, places, arrays, found.attrs["noise"]


def _at_image_bands(scene, paints) -> float:
    """Seconds of a full search at every second band, in the second of two runs."""
    from glazefit import IdentificationOptions, Noise
    from glazefit.identify.search.searcher import Searcher

    grid = scene.wavelengths[::2]
    readings = np.maximum(sampled(scene, 16)[0][:, ::2], 0.0)
    searcher = Searcher.of(grid, paints, IdentificationOptions(noise=Noise(0.003, 0.0)))
    measured = searcher.measure(readings, scene.ground[::2])
    list(searcher.search(measured))
    return time_call(lambda: list(searcher.search(measured)))[1] / len(readings)


def _readings(task: "MapTask", places: np.ndarray) -> np.ndarray:
    """Working readings of pixels, each with its equal neighbours' as a map takes their mean."""
    from glazefit.mapping.solve.features import AROUND, pooled
    from glazefit.mapping.solve.survey import survey
    from glazefit.mapping.store.atomic_files import KeyedResults
    from glazefit.mapping.store.windows import Window
    from glazejax.progress import no_progress

    image = task.image
    with tempfile.TemporaryDirectory() as folder:
        # By what the map compares neighbours; its representatives are not needed again.
        results = KeyedResults(Path(folder))
        features = survey(results, image, 1, task.searcher.brightness, no_progress).features
    height, width = image.cube().shape[:2]
    out = []
    for y, x in places.tolist():
        window = Window(max(y - 2, 0), min(y + 3, height), max(x - 2, 0), min(x + 3, width))
        around, _ = image.read(window)
        means, _ = pooled(around, image.noise_sd(around), features, window.shape, AROUND)
        out.append(means.reshape(*window.shape, -1)[y - window.y0, x - window.x0])
    return np.maximum(out, 0.0)


if __name__ == "__main__":
    main()
