"""Maps by families of pigments: seconds with set-up and the process's own peak of memory, by size,
and what rivals take.

    python -m benchmarks.maps.speed [--nnls 200] [--angle 1000000] [--large 3163 3163 200]

Each image is twelve flat fields of exemplars of the catalogue that the map is not given, with a
camera's noise, written to disk first (10 megapixels of 200 bands take 4 GB) and mapped by a process
of its own. The rivals get the same exemplars and bands: the spectral angle to each one's thick
film, read from the same file, and unmixing by these (scipy's NNLS), of a share of the pixels.
"""

import argparse
import json
import tempfile
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from benchmarks.results import Results, command_line, progress, quantities, quantity
from benchmarks.rivals.baselines import unmix
from benchmarks.rivals.known_painting import write_painting
from benchmarks.timing import in_a_process, peak_memory, time_call
from glazejax import Glaze, Layer, Pigment, catalogue, reflectance

NEEDS = ("zarr",)

SIZES = ("panel", "million", "large")
"""What texts call the images, by size."""
FIELDS = (3, 4)
"""Flat fields, down and across."""
MEMORY = 2**31
"""Bytes that a map is to stay below, the command's own default."""
# Wavelengths that most exemplars are known at, nm, and what the readings are taken with.
_RANGE = (410.0, 990.0)
_GEOMETRY = "45:0"
_GROUND = 0.9
# Noise near black, and the relief of the brush as a share of a pixel's level.
_NOISE, _RELIEF = 0.004, 0.01
# Values read at a time.
_VALUES = 2**24


@dataclass(frozen=True)
class Fields:
    """Flat fields of paint with a camera's noise.

    Attributes:
        shape: (y, x) in pixels.
        wavelengths: (bands,), nm.
        ground: internal reflectance of what is below, (bands,).
        spectra: of the fields, (fields, bands).
        seed: of the noise.
    """

    shape: tuple[int, int]
    wavelengths: Float[np.ndarray, "bands"]
    ground: Float[np.ndarray, "bands"]
    spectra: Float[np.ndarray, "fields bands"]
    seed: int = 3

    def rows(self, y0: int, y1: int) -> Float[np.ndarray, "rows x bands"]:
        """Reflectance of some rows, float32."""
        height, width = self.shape
        down = np.arange(y0, y1)[:, None] * FIELDS[0] // height
        across = np.arange(width) * FIELDS[1] // width
        readings = self.spectra[down * FIELDS[1] + across].astype(np.float32)
        for y, row in enumerate(readings, y0):
            rng = np.random.default_rng([self.seed, y])
            row *= 1.0 + np.float32(_RELIEF) * rng.standard_normal((width, 1), np.float32)
            row += np.float32(_NOISE) * rng.standard_normal(row.shape, np.float32)
        return readings


def main() -> None:
    """Run the benchmark."""
    parser = command_line(
        __doc__,
        {"panel": [24, 32, 61], "million": [48, 64, 61], "large": [60, 80, 61]},
        nnls=(200, 20, "pixels that are unmixed"),
        angle=(1_000_000, 2000, "pixels that are compared by their angle"),
    )
    for name, usual in zip(
        SIZES, ([60, 80, 121], [1000, 1000, 121], [3163, 3163, 200]), strict=True
    ):
        parser.add_argument(
            f"--{name}", type=int, nargs=3, default=usual, help="lines, samples and bands"
        )
    options = parser.parse_args()
    results = Results("map_speed", options.out, "zarr", "scipy")
    results(
        f"{'pixels':>12}{'bands':>7}{'map, s':>9}{'GiB':>7}{'sets':>6}{'in small':>10}"
        f"{'angle, s':>10}{'NNLS, s':>10}"
    )
    for name in SIZES:
        progress(name)
        with tempfile.TemporaryDirectory() as temporary:
            _size(results, name, Path(temporary) / name, getattr(options, name), options)
    progress()
    results(
        f"\nThe map over a ground of {_GROUND:g}, with the set-up of its process; 'sets': each of "
        "1 % of the image or more, of\ntwelve paints, 'in small': pixels of the other sets. Rivals "
        "on one core, their seconds for all pixels."
    )
    results.save()


def _size(
    results: Results, name: str, where: Path, shape: list[int], options: argparse.Namespace
) -> None:
    """Write and map one image, and ask the rivals."""
    lines, samples, bands = shape
    aside = _kept_aside()
    grid = np.linspace(*_RANGE, bands)
    scene = Fields(
        shape=(lines, samples),
        wavelengths=grid,
        ground=np.full(bands, _GROUND),
        spectra=_thick_films(aside, grid),
    )
    header = write_painting(where, scene)
    done = _mapped(where)
    known = _thick_films(_catalogue(), grid)
    pixels = lines * samples
    angle = pixels * _angle_seconds(header, known, options.angle)
    nnls = pixels * _nnls_seconds(scene, known, options.nnls)
    results(
        f"{pixels:>12,}{bands:>7}{done['seconds']:>9.1f}{done['gib']:>7.2f}{done['sets']:>6}"
        f"{done['small']:>10.1%}{angle:>10.1f}{nnls:>10.0f}"
    )
    seconds = {f"{name}_seconds": done["seconds"], f"{name}_angle": angle, f"{name}_nnls": nnls}
    results.record(
        **quantities(seconds, "s", 2, form="g"),
        **{
            f"{name}_memory": quantity(done["gib"], "GiB", 2),
            f"{name}_sets": quantity(done["sets"], digits=0),
        },
    )


def _kept_aside() -> list[Pigment]:
    """An exemplar of each of the families that have most, not given to the map."""
    known = _of_whole_range(catalogue.load("pigments").values())
    count = Counter(paint.family for paint in known)
    largest = sorted(count, key=lambda family: (-count[family], family))
    last = {paint.family: paint for paint in known}
    return [last[family] for family in largest[: FIELDS[0] * FIELDS[1]]]


def _catalogue() -> list[Pigment]:
    """Exemplars that the map is given."""
    aside = {paint.name for paint in _kept_aside()}
    return [paint for name, paint in catalogue.load("pigments").items() if name not in aside]


def _of_whole_range(paints) -> list[Pigment]:
    return [
        paint
        for paint in paints
        if paint.wavelengths[0] <= _RANGE[0] and paint.wavelengths[-1] >= _RANGE[1]
    ]


def _thick_films(
    paints: list[Pigment], grid: Float[np.ndarray, "bands"]
) -> Float[np.ndarray, "paints bands"]:
    """Readings of films that hide their ground, of paints that are known at all bands."""
    return np.stack(
        [
            np.asarray(
                reflectance(Glaze([Layer(paint.resample(grid), 1e-2)], ground=0.5), _GEOMETRY)
            )
            for paint in _of_whole_range(paints)
        ]
    )


def _mapped(where: Path) -> dict:
    """Map an image in a process of its own; what that said, and the seconds from its start."""
    code = f"from benchmarks.maps.speed import child; child({str(where)!r})"
    done, seconds = time_call(lambda: in_a_process("-c", code))
    return done[-1] | {"seconds": seconds}


def child(folder: str) -> None:
    """What `glazejax map` does; memory and sets as one line of JSON."""
    where = Path(folder)
    from glazefit.mapping.store.process import few_arenas

    few_arenas()
    from glazejax.commands.main import start_jax

    start_jax(optimisation=3)
    from glazefit.mapping.map_cube import map_cube
    from glazefit.mapping.store.store import MapStore

    map_cube(
        where / "painting.hdr",
        _catalogue(),
        ground=_GROUND,
        instrument=_GEOMETRY,
        out=where / "map.zarr",
        memory=MEMORY,
    )
    sums = MapStore(where / "map.zarr").sums()
    mapped = sums.tallies["mapped"]
    large = [one.pixels for one in sums.sets.values() if one.pixels >= 0.01 * mapped]
    done = {
        "gib": peak_memory() / 2**30,
        "sets": len(large),
        "small": 1.0 - sum(large) / mapped,
    }
    print(json.dumps(done))


def _angle_seconds(header: Path, known: Float[np.ndarray, "paints bands"], most: int) -> float:
    """Seconds a pixel of reading an image and finding each pixel's nearest exemplar by angle."""
    from glazejax.io import open_cube

    cube = open_cube(header)
    units = (known / np.linalg.norm(known, axis=1, keepdims=True)).astype(np.float32)
    rows = max(1, min(_VALUES // (cube.shape[1] * cube.shape[2]), most // cube.shape[1]))
    start = time.perf_counter()
    done = 0
    for y in range(0, cube.shape[0], rows):
        block = cube[y : y + rows].to_numpy().reshape(-1, cube.shape[2]).astype(np.float32)
        (block / np.linalg.norm(block, axis=1, keepdims=True) @ units.T).argmax(axis=1)
        done += len(block)
        if done >= most:
            break
    return (time.perf_counter() - start) / done


def _nnls_seconds(scene: Fields, known: Float[np.ndarray, "paints bands"], count: int) -> float:
    """Seconds a pixel of unmixing by all exemplars, from pixels all over an image."""
    rows = np.linspace(0, scene.shape[0] - 1, min(count, scene.shape[0])).astype(int)
    each = -(-count // len(rows))
    columns = np.linspace(0, scene.shape[1] - 1, each).astype(int)
    readings = np.concatenate([scene.rows(y, y + 1)[0, columns] for y in rows.tolist()])
    return time_call(lambda: unmix(known.T, readings.astype(np.float64)))[1] / len(readings)


if __name__ == "__main__":
    main()
