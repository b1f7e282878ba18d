"""Paints of every pixel of an image of spectra, with amounts, thickness, probability: `map_cube`.

A sample of the image gives some thousand representatives, each is searched in full
(`glazefit.identify`). Every pixel is averaged with its neighbours that are equal within noise and
answered from the nearest representative. The cost of that is measured on pixels that are searched
themselves.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from importlib.metadata import version
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING, Unpack

import numpy as np
from jaxtyping import ArrayLike, Bool, Float

from glazejax.progress import Progress, no_progress

from ..film.model.mixing import Pigments
from ..identify.search.options import SearchKeywords, check_keywords
from .solve.answers import agreement
from .solve.atlas import search_atlas
from .solve.solver import PixelSolver
from .solve.spots import choose_spots
from .solve.survey import survey
from .solve.task import map_task
from .store.chunk import ChunkMaps
from .store.export import map_place
from .store.layout import STATUS_WORDS, Status
from .store.process import one_thread_each
from .store.run import AT_ONCE, client_in_scope, finish
from .store.store import MapStore, check_map, open_map
from .store.windows import Window, chunk_shape

if TYPE_CHECKING:
    import xarray
    from distributed import Client

    from glazejax.io import CubeSource


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
    searcher = task.searcher
    bands = task.image.bands
    array = task.image.cube()
    shape = array.shape[:2]
    most, base = searcher.representatives(prod(shape), memory)
    count = bands.wavelengths.size
    # Memory of a pixel while it is mapped, for each of its working readings: answers, arrays, what
    # they come from, of all windows that are solved at once.
    bytes_each = 4.0 * AT_ONCE * (7 * count + 3 * len(searcher.paints) + 250) / count
    store = MapStore.create(
        out,
        shape,
        chunk_shape(shape, count, bytes_each, memory, base=base),
        searcher.paints,
        options=task.options,
        attrs={
            "working_wavelengths": bands.wavelengths,
            "bands_of_each": task.image.count,
            "notes": array.attrs.get("notes", ()),
            "made_by": ", ".join(
                f"{name} {version(name)}" for name in ("glazejax", "jax", "numpy")
            ),
            **map_place(array),
        },
        # Numbers along y and x and their attributes.
        coords={
            axis: (np.asarray(array[axis]), array[axis].attrs)
            for axis in ("y", "x")
            if axis in array.coords
        },
        overwrite=overwrite,
    )
    client = client or client_in_scope()
    with store.writing(), one_thread_each():
        work = store.work
        surveyed = survey(work, task.image, most, searcher.brightness, progress)
        image = replace(task.image, noise=surveyed.noise)
        atlas = search_atlas(work, searcher, image, surveyed, client, progress)
        if "checked" not in work.done():
            progress(0, 1, "checking")
            pixels = surveyed.checked
            answers, _ = atlas.answers(pixels.astype(np.float32))
            mapped = answers.columns(searcher.prior)
            full = searcher.answers(pixels, image.noise_sd(pixels))
            work.put("checked", agreement(mapped, full))
        solver = PixelSolver(image, atlas, surveyed.reach)
        solve_windows(store, solver.solve, client, progress)
        sums = store.sums()
        store.note(
            complete=True,
            noise=[surveyed.noise.floor, surveyed.noise.share],
            representatives=len(surveyed.readings),
            reach=surveyed.reach,
            agreement=work.get("checked"),
            tallies=sums.tallies,
            spots=choose_spots(
                sums.unexplained,
                searcher.bare,
                sums.tallies[STATUS_WORDS[Status.MAPPED]],
                searcher.paints,
            ),
        )
    return open_map(out)


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
