"""Maps of paintings whose truth is known: seconds and memory by size, agreement with the full
search, and rivals.

    python -m benchmarks.maps.painting [--megapixels 0.1 1 10] [--bands 200] [--folder FOLDER] [--checked
    2000] [--no-dask]
    python -m benchmarks.maps.painting --mosaic [--megapixels 1] [--checked 2000]

Each painting is written to disk first (10 megapixels of 200 bands take 4 GB as 16-bit integers),
then mapped by a process of its own, as `glazejax map` does, whose time and peak memory are taken.
Cubes stay in the folder and are used again. `--mosaic` maps measured films instead, see
`benchmarks.maps.painting_mosaic`.
"""

import argparse
import itertools
import json
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.results import Results, add_option
from benchmarks.rivals.known_painting import painting, write_painting
from benchmarks.rivals.known_painting_scene import FOREIGN
from benchmarks.rivals.painting_rivals import (
    Row,
    answer_of_map,
    by_coats,
    compared,
    only,
    sampled,
    score,
    table,
)

NEEDS = ("zarr", "dask", "distributed")

_SEED, _OTHER = 3, 4
PAINTS = "paints.csv"
"""Paints that the map is given, beside a cube; without such a file the oils that ship."""


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add_option(parser, megapixels=[0.01], bands=40, checked=50, no_dask=True)
    parser.add_argument("--megapixels", type=float, nargs="+", default=[0.1, 1.0, 10.0])
    parser.add_argument("--bands", type=int, default=200)
    parser.add_argument(
        "--folder", type=Path, default=None, help="for the cubes (default: a temporary one)"
    )
    parser.add_argument(
        "--checked", type=int, default=2000, help="pixels that are searched in full"
    )
    parser.add_argument("--no-dask", action="store_true")
    parser.add_argument(
        "--mosaic", action="store_true", help="measured films in place of computed spectra"
    )
    parser.add_argument("--child", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--workers", type=int, default=0, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.child is not None:
        _child(options.child, options.workers)
        return
    if options.mosaic:
        results = Results("painting_mosaic", options.out, "zarr")
        side = round((1e6 * min(options.megapixels, key=lambda size: abs(size - 1.0))) ** 0.5)
        with tempfile.TemporaryDirectory() as temporary:
            _mosaic(results, options.folder or Path(temporary), side, options.checked)
        results.save()
        return
    results = Results("painting", options.out, "zarr", "dask")
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.folder or Path(temporary)
        sides = [round((1e6 * size) ** 0.5) for size in sorted(options.megapixels)]
        runs = [
            _size(results, folder, side, options.bands, first=side == sides[0]) for side in sides
        ]
        _exponents(results, runs)
        middle = folder / _name(sides[min(1, len(sides) - 1)], options.bands)
        _truth(
            results,
            middle,
            sides[min(1, len(sides) - 1)],
            options.bands,
            options.checked,
            runs[min(1, len(sides) - 1)],
        )
        if not options.no_dask:
            _dask(results, folder / _name(sides[0], options.bands))
    results.save()


def _name(side: int, bands: int) -> str:
    return f"painting-{side}x{side}x{bands}"


def _size(
    results: Results, folder: Path, side: int, bands: int, *, first: bool
) -> tuple[int, float]:
    """Write and map one painting; pixels and seconds."""
    where = folder / _name(side, bands)
    scene = painting((side, side), bands, _SEED)
    if not (where / "painting.hdr").exists():
        shutil.rmtree(where, ignore_errors=True)
        start = time.perf_counter()
        write_painting(where, scene, "uint16")
        print(f"painted {side} x {side} in {time.perf_counter() - start:.0f} s", flush=True)
    if first:
        # Programs are compiled once and kept, as on a second call of the command.
        map_painting(where)
        results(
            "Seconds by stage, and peak memory of the process; programs were compiled by a run "
            "before."
        )
        results(
            f"{'pixels':>12}{'bands':>7}{'survey':>9}{'search':>9}{'check':>9}{'map':>9}{'all':>9}{'pixels/s':>10}"
            f"{'GiB':>7}{'closed form':>13}{'own search':>12}{'saved':>8}"
        )
    said = map_painting(where)
    stages, tallies = said["stages"], said["tallies"]
    mapped = tallies["mapped"]
    # What a search of every pixel would take at the pace at which the representatives were
    # searched.
    whole = mapped * stages["search"] / said["representatives"]
    results(
        f"{side * side:>12,}{bands:>7}"
        + "".join(f"{stages[name]:>9.1f}" for name in ("survey", "search", "check", "map"))
        + f"{said['seconds']:>9.1f}{side * side / said['seconds']:>10.0f}{said['gib']:>7.2f}"
        + f"{(tallies['way updated'] + tallies['way neighbour']) / mapped:>13.2%}"
        + f"{(tallies['way searched'] + said['representatives']) / mapped:>12.3%}"
        + f"{whole / said['seconds']:>7.0f}x"
    )
    return side * side, said["seconds"]


def _exponents(results: Results, runs: list[tuple[int, float]]) -> None:
    """How time grows with the number of pixels."""
    results()
    for (pixels, seconds), (more, longer) in itertools.pairwise(runs):
        power = np.log(longer / seconds) / np.log(more / pixels)
        results(f"from {pixels:,} to {more:,} pixels time grows with the power {power:.2f}")
    results(
        "'saved': a search of every pixel, at the pace of the representatives, over the time "
        "that the map took"
    )


def map_painting(where: Path, workers: int = 0) -> dict:
    """Map a painting in a process of its own, into map.zarr (dask.zarr with workers)."""
    words = [
        sys.executable,
        "-m",
        "benchmarks.maps.painting",
        "--child",
        str(where),
        "--workers",
        str(workers),
    ]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(done.stderr[-2000:])
    return json.loads(done.stdout.splitlines()[-1])


def _child(where: Path, workers: int) -> None:
    """What `glazejax map` does, with the times of its stages as one line of JSON."""
    from contextlib import ExitStack

    from glazefit.mapping.solve.process import few_arenas

    few_arenas()
    import resource

    from glazejax import catalogue
    from glazejax.commands.main import start_jax

    start_jax()
    from glazefit.mapping.map_cube import map_cube
    from glazejax.io import read_spectra

    ground = read_spectra(where / "ground.csv").reflectance[0]
    own = where / PAINTS
    shelf = catalogue.read(own) if own.exists() else catalogue.load()
    paints = [paint for name, paint in shelf.items() if name not in FOREIGN]
    begun: list[tuple[str, float]] = []

    def note_stage(done: int, total: int | None, stage: str) -> None:
        if not begun or begun[-1][0] != stage:
            begun.append((stage, time.perf_counter()))

    with ExitStack() as stack:
        client = None
        if workers:
            import distributed

            cluster = stack.enter_context(
                distributed.LocalCluster(
                    n_workers=workers, threads_per_worker=1, dashboard_address=":0"
                )
            )
            client = stack.enter_context(distributed.Client(cluster, set_as_default=False))
        start = time.perf_counter()
        out = where / ("dask.zarr" if workers else "map.zarr")
        found = map_cube(
            where / "painting.hdr",
            paints,
            ground=ground,
            out=out,
            client=client,
            overwrite=True,
            progress=note_stage,
        )
        end = time.perf_counter()
    ends = [*(at for _, at in begun[1:]), end]
    stages = {name: after - at for (name, at), after in zip(begun, ends, strict=True)}
    names = {
        "survey": ("reading", "surveying"),
        "search": ("searching",),
        "check": ("checking",),
        "map": ("mapping",),
    }
    print(
        json.dumps(
            {
                "seconds": end - start,
                "stages": {
                    name: sum(stages.get(part, 0.0) for part in parts)
                    for name, parts in names.items()
                },
                "gib": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20,
                "tallies": found.attrs["tallies"],
                "representatives": found.attrs["representatives"],
            }
        )
    )


def _truth(
    results: Results, where: Path, side: int, bands: int, pixels: int, run: tuple[int, float]
) -> None:
    """The map beside the full search, beside `identify` as it is called, and beside the truth with
    its rivals.
    """
    import jax

    jax.config.update("jax_enable_x64", True)
    from glazefit import open_map
    from glazejax import catalogue

    scene, other = painting((side, side), bands, _SEED), painting((480, 640), bands, _OTHER)
    found = open_map(where / "map.zarr")
    _, truth, places = sampled(scene, pixels)
    arrays = {str(name): found[name].values[places[:, 0], places[:, 1]] for name in found.data_vars}
    from glazefit.film.films import Noise
    from glazefit.mapping.solve.agreement import agreement
    from glazefit.mapping.solve.task import map_task

    results()
    results(
        f"{len(places)} pixels of {side} x {side}, each searched in full at the map's bands and "
        "noise:"
    )
    paints = [paint for name, paint in catalogue.load().items() if name not in FOREIGN]
    start = time.perf_counter()
    task = map_task(where / "painting.hdr", paints, ground=scene.ground).with_noise(
        Noise(*found.attrs["noise"])
    )
    same = agreement(task, _readings(task.image, places), arrays)
    seconds = (time.perf_counter() - start) / len(places)
    results(
        f"  same first set {float(same.first):.1%}, same answer to 'none' "
        f"{float(same.explained):.1%}"
    )
    results(
        f"  a paint's probability differs by {float(same.probability):.3f} in the median of the "
        "largest difference,"
    )
    results(
        f"  by {float(same.probability_90):.3f} in nine of ten; thickness by "
        f"{float(same.amount):.3f} and "
        f"{float(same.amount_90):.3f} of its standard deviation"
    )
    results(f"  the full search took {seconds * 1e3:.1f} ms a pixel")
    fine = _at_image_bands(scene, paints)
    bands = task.image.bands.count.size
    results(
        f"  and {fine * 1e3:.0f} ms at every second band of the image, not averaged to {bands} "
        "(16 pixels)"
    )
    results()
    results(
        f"Against the truth, {len(places)} pixels; rivals choose cut and threshold on another "
        "painting:"
    )
    rows = compared(scene, other, pixels)
    answer = answer_of_map(arrays)
    own = Row(
        "map_cube",
        score(truth, answer, scene.names),
        run[1] / run[0],
        by_coats(truth, answer, scene.names),
    )
    for line in table([*rows, own]):
        results(line)


def _mosaic(results: Results, folder: Path, side: int, pixels: int) -> None:
    """Measured films as a camera sees them, mapped beside the rivals."""
    from benchmarks.maps.painting_mosaic import BLUR, GAIN, NOISE, mosaic
    from glazefit import open_map
    from glazejax.paint.pigment_table import write_pigments

    scene = mosaic((side, side), _SEED)
    other = mosaic((480, 640), _OTHER, scene.paints)
    where = folder / f"mosaic-{side}x{side}"
    if not (where / "painting.hdr").exists():
        shutil.rmtree(where, ignore_errors=True)
        write_painting(where, scene, "uint16")
        write_pigments(where / PAINTS, scene.paints)
    said = map_painting(where)
    found = open_map(where / "map.zarr")
    _, truth, places = sampled(scene, pixels)
    arrays = {str(name): found[name].values[places[:, 0], places[:, 1]] for name in found.data_vars}
    inside = np.array([scene.inside(y, y + 1)[0, x] for y, x in places.tolist()])
    count = len(scene.recipes)
    foreign = sum(bool(set(recipe) & set(scene.foreign)) for recipe in scene.recipes)
    results(
        f"Mosaic of {side} x {side} pixels and {len(scene.wavelengths)} bands: {count} measured "
        f"films over a white card, {foreign} of them with"
    )
    results(
        f"foreign paint ({', '.join(scene.foreign)}). The {len(scene.paints)} paints are those of "
        "a joint fit without all of these films."
    )
    results(
        f"Put on: noise {NOISE:g}, light that varies by {GAIN:.0%}, blur of {BLUR:g} pixels. "
        f"{pixels} pixels, {inside.sum()} of them off the edges of tiles;"
    )
    results("rivals choose cut and threshold on another mosaic of the same films.")
    results()
    rows = compared(scene, other, pixels)
    answer = replace(answer_of_map(arrays), thickness=np.full(len(places), np.nan))
    seconds = said["seconds"] / side**2
    for name, (true, told) in {
        "map_cube": (truth, answer),
        "map_cube, off edges": only(truth, answer, inside),
    }.items():
        by = by_coats(true, told, scene.names)
        rows.append(Row(name, score(true, told, scene.names), seconds, by))
    for line in table(
        [row._replace(score=row.score._replace(amount_error=np.nan)) for row in rows]
    ):
        results(line)
    results()
    results(f"seconds {said['seconds']:.1f}, peak memory {said['gib']:.2f} GiB")


def _at_image_bands(scene, paints) -> float:
    """Seconds of a full search at every second band, in the second of two runs."""
    from glazefit import IdentificationOptions, Noise
    from glazefit.identify.search.searcher import Searcher

    grid = scene.wavelengths[::2]
    readings = np.maximum(sampled(scene, 16)[0][:, ::2], 0.0)
    searcher = Searcher.of(grid, paints, IdentificationOptions(noise=Noise(0.003, 0.0)))
    measured = searcher.measure(readings, scene.ground[::2])
    list(searcher.search(measured))
    start = time.perf_counter()
    list(searcher.search(measured))
    return (time.perf_counter() - start) / len(readings)


def _readings(image, places: np.ndarray) -> np.ndarray:
    """Working readings of pixels."""
    from glazefit.mapping.store.windows import Window

    return np.concatenate([image.read(Window(y, y + 1, x, x + 1))[0] for y, x in places.tolist()])


def _dask(results: Results, where: Path) -> None:
    """The smallest painting here and by two workers of a dask cluster."""
    from glazefit import open_map

    map_painting(where, workers=2)
    here, there = open_map(where / "map.zarr"), open_map(where / "dask.zarr")
    worst, differ = 0.0, 0
    for name in here.data_vars:
        one, other = here[name].values, there[name].values
        if one.dtype.kind == "f":
            both = np.isfinite(one) & np.isfinite(other)
            differ += int(np.sum(np.isfinite(one) != np.isfinite(other)))
            worst = max(
                worst,
                float(np.abs(one[both].astype(float) - other[both].astype(float)).max(initial=0.0)),
            )
        else:
            differ += int(np.sum(one != other))
    results()
    results(
        f"dask with two workers: {differ} integers (or gaps) differ, floats by {worst:.1e} at most"
    )


if __name__ == "__main__":
    main()
