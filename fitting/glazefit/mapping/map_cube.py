"""Paints of every pixel of an image of spectra, with amounts, thickness, probability: `map_cube`.

A sample of the image gives some thousand representatives, each is searched in full
(`glazefit.identify`). Every pixel is averaged with its neighbours that are equal within noise and
answered from the nearest representative. The cost of that is measured on pixels that are searched
themselves.
"""

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np
from jaxtyping import ArrayLike, Bool, Float, Int

from glazejax.progress import Progress, no_progress

from ..film.films import Noise
from ..film.model.mixing import Pigments
from ..film.noise import spectra_noise
from ..identify.families.set_up import prepare_search
from ..identify.search.options import SearchKeywords, check_keywords
from ..identify.search.searcher import Searcher
from .solve.agreement import agreement
from .solve.atlas import Atlas, search_for_atlas
from .solve.by_family import Answered, FamilySearcher
from .solve.image import classify
from .solve.local import Searched
from .solve.pool import ALONG, pooled
from .solve.process import give_back, one_thread_each
from .solve.solver import PixelSolver
from .solve.survey import Features, survey
from .solve.task import MapTask, map_task
from .solve.unexplained import choose_spots
from .store.chunk import ChunkMaps, PixelReadings
from .store.layout import STATUS_WORDS, Status
from .store.run import AT_ONCE, client_in_scope, finish
from .store.store import MapStore, check_map, open_map
from .store.windows import BASE, Window, chunk_shape

if TYPE_CHECKING:
    import xarray
    from distributed import Client

    from glazejax.io import CubeSource

# Lines in which pixels are sampled.
_LINES = 96
# Bytes that the process takes besides representatives and windows: Python, JAX, its programs, a
# search.
_BASE = 900 * 2**20
# Representatives at least and at most.
_REPRESENTATIVES = (256, 4000)
# At most where families are searched.
_OF_FAMILIES = 1500
# Representatives of one piece of work; a fourth of them in a search by family.
_PIECE = 128
# Pixels that are searched themselves, to see what the closed form costs, at most; and at most where
# there are fewer representatives.
_CHECKED = (256, 64)


def map_cube(
    cube: "CubeSource | str | Path | xarray.DataArray",
    pigments: Pigments,
    *,
    ground: ArrayLike | None = None,
    opaque: bool = False,
    out: str | Path,
    mask: Bool[np.ndarray, "y x"] | str | Path | None = None,
    spots: Mapping[str, Float[np.ndarray, "bands"]] | None = None,
    memory: int = 2**31,
    client: "Client | None" = None,
    overwrite: bool = False,
    progress: Progress = no_progress,
    **search: Unpack[SearchKeywords],
) -> "xarray.Dataset":
    """Map the paints of an image of spectra into a zarr store, window by window.

    A run that was interrupted goes on where it stopped when it is called again with the same
    options. Windows of it that are damaged are warned of (`DamagedWindow`) and mapped again.

    Args:
        cube: the image, or where it is; see `glazejax.io.open_cube`.
        pigments: the catalogue, a mapping or a list, on any grids; bands that they do not cover are
            left out. Those with a family and a source, as ``catalogue.load("pigments")`` gives
            them, are searched by family: the map's paints are families, and groups such as
            "a white", and it has no thickness.
        ground: internal reflectance of the ground under the paint: a number, or one for each band
            of the image.
        opaque: the paint hides its ground everywhere; its thickness is then unknown.
        out: folder of the map; its parent must exist.
        mask: pixels that are mapped, (y, x), or a file as for `glazejax.io.read_mask`.
        spots: further paints by name: spectra of thick, hiding paint, at the image's bands, such as
            a pure stroke in the image itself. What a spectrum alone leaves open of a paint is taken
            as open (`spot_pigment`).
        memory: bytes that the process is to stay below, at least some 950 MiB; more where many
            families are searched over a ground that is seen.
        client: of a dask cluster whose workers do the work; by default the one that this program
            has made, if any. Workers must see the image under the same path.
        overwrite: replace a map that is there.
        progress: called with pieces done, pieces in all and the stage: reading, surveying, for
            families computing films and trying families, searching, checking, mapping.
        search: instrument, noise, discrepancy, prior, max_paints, elements, without_elements and
            painted, as for `glazefit.identify`; noise is of one reading of the image, by default
            estimated from the roughness of a sample of its spectra.

    Returns:
        The map, opened lazily (`glazefit.open_map`); its variables are those of
        `glazefit.mapping.store.layout`.

    Raises:
        ValueError: options or shapes that do not fit, an image without a pixel that can be mapped,
            a map that was begun with other options, that another run is writing, or that is damaged
            beyond its windows.
        FileExistsError: `out` is there and is no map.
        OSError: the disk is full; finished windows are kept.
        ModuleNotFoundError: the extra ``cube`` is not installed.
    """
    check_keywords("map_cube", search, SearchKeywords)
    check_map(out, overwrite=overwrite)
    task = map_task(
        cube,
        pigments,
        ground=ground,
        opaque=opaque,
        mask=mask,
        spots=spots,
        **search,
    )
    progress(0, 1, "reading")
    bands = task.image.bands
    paints = task.searcher.paints
    most, base = _most_representatives(task, memory)
    count = bands.wavelengths.size
    # Memory of a pixel while it is mapped, for each of its working readings: answers, arrays, what
    # they come from, of all windows that are solved at once.
    bytes_each = 4.0 * AT_ONCE * (7 * count + 3 * len(paints) + 250) / count
    store = MapStore.create(
        out,
        task.shape,
        chunk_shape(task.shape, count, bytes_each, memory, base=base),
        paints,
        options=task.options,
        attrs={
            "working_wavelengths": bands.wavelengths,
            "bands_of_each": bands.count,
            "notes": list(task.notes),
            "made_by": ", ".join(
                f"{name} {version(name)}" for name in ("glazejax", "jax", "numpy")
            ),
        },
        coords=task.coords,
        overwrite=overwrite,
    )
    client = client or client_in_scope()
    with store.writing(), one_thread_each():
        surveyed = _survey(store, task, most, progress)
        task = task.with_noise(Noise(*surveyed.noise.tolist()))
        atlas = _atlas(store, task, surveyed, client, progress)
        if "checked" not in store.work.done():
            progress(0, 1, "checking")
            answers, _ = atlas.answers(surveyed.checked.astype(np.float32))
            compared = agreement(task, surveyed.checked, answers.columns(task.prior))
            store.work.put("checked", compared)
        solver = PixelSolver(task, atlas, reach=float(surveyed.reach))
        solve_windows(store, solver.solve, client, progress)
        tallies, _ = store.sums()
        store.note(
            complete=True,
            noise=surveyed.noise,
            representatives=len(surveyed.readings),
            reach=float(surveyed.reach),
            agreement={name: value.tolist() for name, value in store.work.get("checked").items()},
            tallies=tallies,
            spots=_spots(store, task, tallies),
        )
    return open_map(out)


def _spots(store: MapStore, task: MapTask, tallies: Mapping[str, float]) -> list[dict[str, Any]]:
    """Spectra that no paints explain and that may be paints, as the map's attribute holds them."""
    bare = np.ones(task.image.bands.wavelengths.size)
    if task.ground is not None and isinstance(task.searcher, Searcher):
        nothing = np.zeros(len(bare))
        search_task = task.searcher.task
        bare = (
            np.asarray(search_task.response.body(nothing, nothing, task.ground))
            + search_task.surface
        )
    spots = choose_spots(
        store.unexplained(),
        bare,
        tallies[STATUS_WORDS[Status.MAPPED]],
        task.searcher.paints,
    )
    return [asdict(spot) for spot in spots]


@dataclass(frozen=True)
class _Surveyed:
    """Results of the survey of a sample of the image, arrays as a file keeps them.

    Attributes:
        noise: of one reading, floor and share.
        middle, directions: of the features of spectra.
        readings: of the representatives.
        reach: how many times as far as noise and paint's errors reach an answer is taken.
        checked: pixels by which one sees what the closed form costs.
    """

    noise: Float[np.ndarray, "2"]
    middle: Float[np.ndarray, "bands"]
    directions: Float[np.ndarray, "directions bands"]
    readings: Float[np.ndarray, "representatives bands"]
    reach: np.ndarray
    checked: PixelReadings


def solve_windows(
    store: MapStore,
    solve: Callable[[Window], ChunkMaps],
    client: "Client | None",
    progress: Progress,
) -> None:
    """Solve and keep all windows of a map that are not there yet; see `store.run.finish`."""
    finish(
        keys=store.windows(),
        work=solve,
        done=store.done(),
        put=store.put,
        client=client,
        progress=progress,
        stage="mapping",
        at_once=AT_ONCE,
    )


def _survey(store: MapStore, task: MapTask, most: int, progress: Progress) -> _Surveyed:
    """The survey of the image: made, or kept by an earlier run."""
    work = store.work
    if "survey" not in work.done():
        sample, ends, noise = _sample(task, progress)
        sd = task.with_noise(noise).image.noise_sd(sample)
        status = classify(sample, sd)
        good = status == Status.MAPPED
        if not good.any():
            reasons = (
                ", ".join(
                    f"{np.sum(status == s)} {STATUS_WORDS[Status(s)]}" for s in np.unique(status)
                )
                or "the mask leaves none"
            )
            raise ValueError(f"the image has no pixel that can be mapped (of a sample: {reasons})")
        sample[~good] = np.nan
        by_family = isinstance(task.searcher, FamilySearcher)
        features = Features.of(np.maximum(sample[good], 0.0), brightness=not by_family)
        pools = [
            pooled(line, line_sd, features, (1, len(line)), ALONG)
            for line, line_sd in zip(np.split(sample, ends), np.split(sd, ends), strict=True)
        ]
        means, reach = (np.concatenate(arrays)[good] for arrays in zip(*pools, strict=True))
        means = np.maximum(means, 0.0)
        readings, beyond = survey(features, means, most, reach, progress)
        count = min(_CHECKED[0], max(_CHECKED[1], len(readings)), len(means))
        result = _Surveyed(
            noise=np.array([noise.floor, noise.share]),
            middle=features.middle,
            directions=features.directions,
            readings=readings,
            # Spectra beyond are searched themselves.
            reach=np.array(1.15 * max(beyond, 1.0)),
            checked=means[np.linspace(0, len(means) - 1, count).astype(int)],
        )
        work.put("survey", vars(result))
    return _Surveyed(**work.get("survey"))


def _sample(
    task: MapTask, progress: Progress
) -> tuple[PixelReadings, Int[np.ndarray, "ends"], Noise]:
    """Readings of pixels from all over the image that the mask leaves, line by line, where a line
    but the first begins, and the noise of one reading.
    """
    image = task.image
    height, width = task.shape
    cube = image.cube()
    stored = np.asarray(cube["wavelength"], float)
    lines = np.unique(np.linspace(0, height - 1, min(_LINES, height)).astype(int))
    # Some 60 000 pixels in all.
    step = max(1, -(-len(lines) * width // 60_000))
    readings = [np.zeros((0, image.bands.wavelengths.size), np.float32)]
    rough = []
    for number, y in enumerate(lines.tolist()):
        progress(number, len(lines), "reading")
        use = np.arange(number % step, width, step)
        if image.mask is not None:
            use = use[image.mask[y, use]]
        if not use.size:
            continue
        # Whole lines: their numbers lie together in a file.
        block = cube[y].to_numpy()[use]
        readings.append(image.bands.means(block, image.saturated))
        # Some thousand spectra are enough to estimate the noise.
        fine = block[:: max(1, len(use) * len(lines) // 4000)]
        rough.append(fine[np.isfinite(fine).all(axis=1)])
    progress(len(lines), len(lines), "reading")
    noise = (
        image.noise
        if task.options["noise"] is not None or not rough
        else spectra_noise(stored, np.concatenate(rough).astype(np.float64))
    )
    return np.concatenate(readings), np.cumsum([len(line) for line in readings])[1:-1], noise


def _atlas(
    store: MapStore,
    task: MapTask,
    surveyed: _Surveyed,
    client: "Client | None",
    progress: Progress,
) -> Atlas:
    """Representatives, searched piece by piece, here or on a cluster."""
    work = store.work
    searcher = task.searcher
    by_family = isinstance(searcher, FamilySearcher)
    size = _PIECE // 4 if by_family else _PIECE
    keys = [f"search-{n:04d}" for n in range(-(-len(surveyed.readings) // size))]

    def note(done: int, total: int | None, stage: str, /) -> None:
        give_back()
        progress(done, total, stage)

    if by_family and client is None and {*keys} - work.done():
        # So that the first spectrum need not wait for it.
        prepare_search(searcher.wavelengths, searcher.pigments, searcher.options, task.ground, note)
    search = partial(_search_piece, task, surveyed.readings, size)
    finish(keys, search, work.done(), work.put, client, note, stage="searching")
    kind = Answered if by_family else Searched
    searched = kind.joined(len(keys), lambda n, name: work.get(keys[n], [name])[name])
    return Atlas(Features(surveyed.middle, surveyed.directions), searched, task.prior)


def _search_piece(
    task: MapTask, readings: Float[np.ndarray, "representatives bands"], size: int, key: str
) -> dict[str, np.ndarray]:
    """Searches of representatives, by the key of a piece and its size, which is sent along: spectra
    that are searched in other company are rounded in other places.
    """
    first = int(key.rpartition("-")[2]) * size
    with one_thread_each():
        return search_for_atlas(task, readings[first : first + size]).arrays()


def _most_representatives(task: MapTask, memory: int) -> tuple[int, int]:
    """Representatives at most within a bound of the memory, and what the process takes before the
    first window.
    """
    # One for 40 pixels.
    target = int(np.clip(task.shape[0] * task.shape[1] // 40, *_REPRESENTATIVES))
    if isinstance(task.searcher, FamilySearcher):
        # Families differ by more than the distance of two representatives.
        return min(target, _OF_FAMILIES), BASE + task.searcher.memory
    bands = task.image.bands.wavelengths.size
    # Bytes of a representative, with about a dozen candidates.
    bytes_each = 4 * 12 * (2 * bands**2 + 24 * bands)
    # A third of what is left; the windows take the rest.
    most = int(np.clip((memory - _BASE) // 3 // bytes_each, _REPRESENTATIVES[0], target))
    return most, _BASE + most * bytes_each
