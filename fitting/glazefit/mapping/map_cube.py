"""Which paints are where in an image of spectra, how much, how thick and how sure: `map_cube`.

A sample of the image gives some thousand representatives, each is searched in full (`glazefit.identify`), and every
pixel is answered in closed form from the representative next to it. What that costs is measured on pixels that are
searched themselves.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from jaxtyping import ArrayLike, Bool, Float

from glazejax import Pigment
from glazejax.geometry import Geometry, Instrument, resolve_instrument
from glazejax.spectra import describe_grid

from ..film.errors import BETWEEN_FILMS, Discrepancy, Prior
from ..film.films import Noise
from ..film.noise import spectra_noise
from ..identify.searcher import Searcher
from .agreement import compare
from .atlas import Atlas
from .layout import STATUS_WORDS, Status
from .local import Searched, check_errors, searched
from .run import client_in_scope, finish, run_chunks
from .solver import Image, PixelSolver
from .store import MapStore, check_map, open_map
from .survey import Features, survey
from .windows import chunk_shape
from .working import WorkingBands, classify

if TYPE_CHECKING:
    import xarray
    from distributed import Client

    from glazejax.io import CubeSource

# Pixels that are sampled, in so many lines; representatives at most, and the distance that they are to keep to all.
_SAMPLE, _LINES, _REPRESENTATIVES, _REACH = 40_000, 96, 2500, 1.5
# Representatives that are searched as one piece of work.
_PIECE = 256
# Pixels that are searched themselves, to see what the closed form costs.
_CHECKED = 256
# Spectra from which the noise is told.
_NOISE_SAMPLE = 4000
_VERSION = 1


class Progress(NamedTuple):
    """How far a map is: `done` of `total` pieces of a stage, and what was noticed."""

    stage: str
    done: int
    total: int
    notes: tuple[str, ...] = ()


Told = Callable[[Progress], None]


def map_cube(
    cube: "CubeSource | str | Path | xarray.DataArray",
    pigments: Sequence[Pigment],
    *,
    grounds: ArrayLike | None,
    out: str | Path,
    mask: Bool[np.ndarray, "y x"] | str | Path | None = None,
    spots: Mapping[str, Float[np.ndarray, "bands"]] | None = None,
    instrument: Instrument | None = None,
    geometry: Geometry | None = None,
    noise: Noise | None = None,
    discrepancy: Discrepancy | None = None,
    prior: Prior | None = None,
    max_paints: int = 3,
    layers: int = 1,
    memory: int = 2**31,
    client: "Client | None" = None,
    overwrite: bool = False,
    told: Told | None = None,
) -> "xarray.Dataset":
    """Map the paints of an image of spectra into a zarr store, window by window.

    A run that was interrupted goes on where it stopped when it is called again with the same options.

    Args:
        cube: the image, or where it is; see `glazejax.io.open_cube`.
        pigments: the catalogue, on any grids; bands that they do not cover are left out.
        grounds: internal reflectance of the ground under the paint: a number, or one for each band of the image. None
            for paint that hides its ground; its thickness is then unknown.
        out: folder of the map; its parent must exist.
        mask: pixels that are mapped, (y, x), or a file as for `glazejax.io.read_mask`.
        spots: further paints by name: spectra of thick, hiding paint, at the image's bands, such as a pure stroke in
            the image itself. What a spectrum alone leaves open of a paint is taken as open (`spot_pigment`).
        instrument, geometry, discrepancy, prior, max_paints, layers: as for `glazefit.identify`.
        noise: of one reading of the image; by default told from the roughness of a sample of its spectra.
        memory: bytes that the process is to stay below, at least some 800 MiB.
        client: of a dask cluster whose workers do the work; by default the one that this program has made, if any.
            Workers must see the image under the same path.
        overwrite: replace a map that is there.
        told: called with the progress.

    Returns:
        The map, opened lazily (`glazefit.open_map`); its variables are those of `glazefit.mapping.layout`.

    Raises:
        ValueError: options or shapes that do not fit, an image without a pixel that can be mapped, a map that was begun
            with other options.
        FileExistsError: `out` is there and is no map.
        OSError: the disk is full; finished windows are kept.
        ModuleNotFoundError: the extra ``cube`` is not installed.
    """
    from glazejax.io import CubeSource, read_mask

    check_map(out, overwrite=overwrite)
    tell: Told = told or (lambda _: None)
    source = CubeSource(Path(cube)) if isinstance(cube, str | Path) else cube
    array = source.open() if isinstance(source, CubeSource) else _checked(source)
    tell(Progress("reading", 0, 1, tuple(array.attrs.get("notes", ()))))
    shape: tuple[int, int] = (array.shape[0], array.shape[1])
    stored = np.asarray(array["wavelength"], float)
    use = read_mask(mask, shape) if isinstance(mask, str | Path) else mask
    if use is not None and np.shape(use) != shape:
        raise ValueError(f"the mask has {_pixels(np.shape(use))}, the image {_pixels(shape)}")
    seen_by, expected = resolve_instrument(instrument, geometry), prior or Prior()
    errors = discrepancy or BETWEEN_FILMS
    check_errors(errors)
    from .spots import spot_pigment

    extra = [spot_pigment(name, stored, spectrum, pigments, seen_by) for name, spectrum in (spots or {}).items()]
    known = [*pigments, *extra]
    bands = WorkingBands.of(stored, known)
    searcher = Searcher.of(
        bands.wavelengths, known, opaque=grounds is None, instrument=seen_by, discrepancy=errors, prior=expected,
        max_paints=max_paints, layers=layers,
    )  # fmt: skip
    ground = None if grounds is None else _ground(grounds, bands, stored)
    saturated = array.attrs.get("saturated")
    image = Image(source, bands, noise or Noise(), None if use is None else np.asarray(use, bool), saturated)
    options = {
        "version": _VERSION,
        "image": _identity(source, array),
        "paints": {p.name: _digest(p.absorption, p.scattering) for p in known},
        "ground": None if ground is None else ground,
        "mask": None if use is None else _digest(np.asarray(use, bool)),
        "instrument": [seen_by.geometry.describe(), seen_by.refractive_index],
        "noise": None if noise is None else [noise.floor, noise.share],
        "discrepancy": _plain(errors),
        "prior": _plain(expected),
        "max_paints": max_paints,
        "layers": layers,
    }
    store = MapStore.create(
        out,
        shape,
        chunk_shape(shape, bands.wavelengths.size, _bytes(len(known), bands.wavelengths.size, stored.size), memory),
        [p.name for p in known],
        options=options,
        attrs={
            "working_wavelengths": bands.wavelengths,
            "bands_of_each": bands.count,
            "ground": "hidden" if ground is None else ground,
            "geometry": seen_by.geometry.describe(),
            "refractive_index": seen_by.refractive_index,
            "notes": list(array.attrs.get("notes", ())),
            **_versions(),
        },
        coords={
            axis: (np.asarray(array[axis]), dict(array[axis].attrs)) for axis in ("y", "x") if axis in array.coords
        },
        overwrite=overwrite,
    )
    client = client or client_in_scope()
    with store.writing():
        image, features, representatives, reach, sample = _surveyed(store, image, noise, tell)
        keys = [f"search-{n:04d}" for n in range(-(-len(representatives) // _PIECE))]
        pieces = _Pieces(searcher, image, ground, representatives)
        work = store.work

        def count(*_: Any) -> None:
            tell(Progress("searching", len(work.done() & set(keys)), len(keys)))

        count()
        finish(keys, pieces, work, client, count)
        found = Searched.joined([Searched.from_arrays(work.get(key)) for key in keys])
        atlas = Atlas.of(features, found, searcher.task.prior)
        if "checked" not in work.done():
            tell(Progress("checking", 0, 1))
            work.put("checked", compare(searcher, image, ground, atlas, sample).arrays())
        solver = PixelSolver(image, searcher, ground, atlas, reach)
        total = len(store.windows())
        tell(Progress("mapping", len(store.done()), total))
        run_chunks(store, solver, client, lambda *_: tell(Progress("mapping", len(store.done()), total)))
        tallies, _ = store.sums()
        store.note(
            complete=True,
            noise=[image.noise.floor, image.noise.share],
            representatives=len(representatives),
            reach=reach,
            agreement={name: value.tolist() for name, value in work.get("checked").items()},
            tallies=tallies,
        )
    return open_map(out)


@dataclass(frozen=True)
class _Pieces:
    """Searches of representatives, by the key of a piece."""

    searcher: Searcher
    image: Image
    ground: np.ndarray | None
    readings: np.ndarray

    def __call__(self, key: str) -> dict[str, np.ndarray]:
        first = int(key.rpartition("-")[2]) * _PIECE
        some = self.readings[first : first + _PIECE]
        return searched(self.searcher, some, self.image.noise_sd(some), self.ground).arrays()


def _surveyed(
    store: MapStore, image: Image, noise: Noise | None, tell: Told
) -> tuple[Image, Features, np.ndarray, float, np.ndarray]:
    """The image with its noise, features, representatives, their reach, and spectra to check the map with."""
    work = store.work
    if "survey" not in work.done():
        tell(Progress("surveying", 0, 1))
        sample, told = _sample(image, store.shape, noise)
        image = replace(image, noise=told)
        status = classify(sample, image.noise_sd(sample))
        good = np.maximum(sample[status == Status.MAPPED], 0.0)
        if not len(good):
            counts = {STATUS_WORDS[Status(s)]: int(np.sum(status == s)) for s in np.unique(status)}
            words = ", ".join(f"{count} {word}" for word, count in counts.items()) or "the mask leaves none"
            raise ValueError(f"the image has no pixel that can be mapped (of a sample: {words})")
        found = survey(good, _REPRESENTATIVES, _REACH)
        checked = good[np.linspace(0, len(good) - 1, min(_CHECKED, len(good))).astype(int)]
        work.put(
            "survey",
            {
                "noise": np.array([told.floor, told.share]),
                "middle": found.features.middle,
                "directions": found.features.directions,
                "readings": found.readings,
                "reach": np.array(1.15 * max(found.reach, _REACH)),
                "checked": checked,
            },
        )
    kept = work.get("survey")
    image = replace(image, noise=Noise(*kept["noise"].tolist()))
    features = Features(kept["middle"], kept["directions"])
    return image, features, kept["readings"], float(kept["reach"]), kept["checked"]


def _sample(
    image: Image, shape: tuple[int, int], noise: Noise | None
) -> tuple[Float[np.ndarray, "pixels bands"], Noise]:
    """Readings of pixels from all over the image that the mask leaves, and the noise of one reading."""
    cube = image.cube()
    stored = np.asarray(cube["wavelength"], float)
    lines = np.unique(np.linspace(0, shape[0] - 1, min(_LINES, shape[0])).astype(int))
    step = max(1, -(-len(lines) * shape[1] // _SAMPLE))
    readings, rough = [], []
    for number, y in enumerate(lines.tolist()):
        # Whole lines: their numbers lie together in a file.
        line = cube[y].to_numpy()
        use = np.arange(number % step, shape[1], step)
        if image.mask is not None:
            use = use[image.mask[y, use]]
        if not use.size:
            continue
        block = line[use]
        readings.append(image.bands.means(block, image.saturated))
        fine = block[:: max(1, len(use) * len(lines) // _NOISE_SAMPLE)]
        rough.append(fine[np.isfinite(fine).all(axis=1)])
    if not readings:
        return np.zeros((0, image.bands.wavelengths.size), np.float32), noise or Noise()
    told = noise or spectra_noise(stored, np.concatenate(rough).astype(np.float64))
    return np.concatenate(readings), told


def _ground(grounds: ArrayLike, bands: WorkingBands, stored: np.ndarray) -> Float[np.ndarray, "bands"]:
    """Internal reflectance of the ground at the working bands."""
    given = np.asarray(grounds, float)
    if given.ndim > 1 or (given.ndim == 1 and given.size != stored.size):
        raise ValueError(f"grounds of shape {given.shape} are neither a number nor one for each of {stored.size} bands")
    if not ((given >= 0) & (given <= 1)).all():
        wrong = given[~((given >= 0) & (given <= 1))].ravel()[0]
        raise ValueError(f"a ground's internal reflectance is {wrong:g}; it must lie in [0, 1]")
    return np.broadcast_to(given, stored.shape) @ bands.mean


def _bytes(paints: int, bands: int, stored: int) -> float:
    """Memory for each working reading of a window: readings, answers and results of a pixel, over the bands."""
    answers = 4 * (4 * bands + 3 * paints + 80)
    return answers / bands


def _checked(array: "xarray.DataArray") -> "xarray.DataArray":
    """An image that was made by the caller.

    Raises:
        ValueError: other dimensions, or no wavelengths.
    """
    if array.dims != ("y", "x", "wavelength") or "wavelength" not in array.coords:
        raise ValueError(
            f"an image has the dimensions y, x, wavelength, with wavelengths in nm; this one has {array.dims}"
        )
    grid = np.asarray(array["wavelength"], float)
    if np.any(np.diff(grid) <= 0) or grid[0] < 100:
        raise ValueError(f"wavelengths must ascend and be in nm; these are {describe_grid(grid)}")
    return array


def _pixels(shape: Sequence[int]) -> str:
    return " x ".join(map(str, shape)) + " pixels"


def _identity(source: "CubeSource | xarray.DataArray", array: "xarray.DataArray") -> dict[str, Any]:
    """What says that two images are the same."""
    from glazejax.io import CubeSource

    told = {"shape": list(array.shape), "wavelengths": _digest(np.asarray(array["wavelength"], float))}
    if not isinstance(source, CubeSource):
        rows = np.linspace(0, array.shape[0] - 1, min(8, array.shape[0])).astype(int)
        return told | {"some lines": _digest(*(array[int(y)].to_numpy() for y in rows))}
    from dataclasses import asdict

    from glazejax.io.cubes.hashes import quick_source_hash

    return told | {"source": asdict(source), "hash": quick_source_hash(source.path)}


def _digest(*arrays: Any) -> str:
    from hashlib import sha256

    whole = sha256()
    for array in arrays:
        whole.update(np.ascontiguousarray(array).tobytes())
    return whole.hexdigest()[:16]


def _plain(settings: Any) -> dict[str, Any]:
    from dataclasses import asdict

    return asdict(settings)


def _versions() -> dict[str, str]:
    from importlib.metadata import version

    return {"made_by": f"glazejax {version('glazejax')}, jax {version('jax')}, numpy {version('numpy')}"}
