"""A painting whose truth is known: spectra of a scene of one to three coats, with noise, block by
block.

Reflectance is `glazejax.reflectance`'s, tabulated for each region over the two or three numbers
that vary in it (`glazejax.interpolated`), so that millions of pixels take minutes and no two are
alike.
"""

import functools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
from jaxtyping import Float

from benchmarks.rivals.known_painting_scene import FOREIGN, REGIONS, Region, Scene
from glazefit.mapping.store.layout import PLACES
from glazejax import Glaze, Hemispherical, Layer, Mixture, Pigment, interpolated, reflectance
from glazejax.catalogue import load
from glazejax.chebyshev_table import Axis, Mirrored, polynomials

NOISE = 0.003
"""Standard deviation of a reading, independent in every band."""
INDEX = 1.5
INSTRUMENT = Hemispherical(8.0)

TABLE_ERROR = 5e-5
"""Largest error of the tables of spectra."""
_SOLVER = 1e-5
# Values at once while spectra are made, for memory.
_PIXELS = 4096
_VALUES = 2**24

TRUTH = {
    "members": "int16",
    "coats": "int8",
    "amounts": "float32",
    "region": "uint8",
    "foreign": "bool",
}
PLACED = ("members", "coats", "amounts")
"""Arrays of the truth; these three have `PLACES` columns."""


class Scenery(Protocol):
    """What can be written: a `Painting`, or another image that is computed row by row."""

    @property
    def shape(self) -> tuple[int, int]:
        """(y, x) in pixels."""
        ...

    @property
    def wavelengths(self) -> Float[np.ndarray, "bands"]:
        """(bands,), nm."""
        ...

    @property
    def ground(self) -> Float[np.ndarray, "bands"]:
        """Its internal reflectance."""
        ...

    @property
    def seed(self) -> int:
        """Of all that is drawn at random."""
        ...

    def rows(self, y0: int, y1: int) -> Float[np.ndarray, "rows x bands"]:
        """Reflectance of some rows, float32."""
        ...


@dataclass(frozen=True)
class Painting:
    """A painting that is computed where it is asked for; `painting` makes one.

    Attributes:
        shape: (y, x) in pixels.
        wavelengths: (bands,), nm.
        paints: that a map is to be given.
        foreign: the two paints of the catalogue that are in the painting, and are not among those
            of a map.
        ground: its internal reflectance, (bands,).
        noise: standard deviation of a reading, independent in every band.
        seed: of all that is drawn at random.
    """

    shape: tuple[int, int]
    wavelengths: Float[np.ndarray, "bands"]
    paints: list[Pigment]
    foreign: list[Pigment]
    ground: Float[np.ndarray, "bands"]
    noise: float
    seed: int

    @functools.cached_property
    def scene(self) -> Scene:
        """What is painted where."""
        return Scene(self.seed, self.shape)

    @property
    def names(self) -> tuple[str, ...]:
        """Paints by the number that the truth gives them."""
        return tuple(paint.name for paint in (*self.paints, *self.foreign))

    def rows(self, y0: int, y1: int, *, noise: bool = True) -> Float[np.ndarray, "rows x bands"]:
        """Reflectance of rows y0 to y1, float32; the same however the painting is cut into blocks."""
        found = np.empty((y1 - y0, self.shape[1], self.wavelengths.size), np.float32)
        for number, where, values in self._vary(y0, y1):
            table = _table(number, tuple(self.wavelengths.tolist()), tuple(self.ground.tolist()))
            found[where] = table(values)
        if noise:
            # Of each row by itself, so that it is the same however rows are cut into blocks.
            for y, row in enumerate(found, y0):
                rng = np.random.default_rng([self.seed, 2, y])
                row += np.float32(self.noise) * rng.standard_normal(row.shape, np.float32)
        return found

    def truth(self, y0: int, y1: int) -> dict[str, np.ndarray]:
        """What rows y0 to y1 are painted with.

        Returns:
            members (rows, x, places), numbers of `names`, ascending, -1 where there are no more
            paints; coats, of each the coat it lies in, 0 the uppermost; amounts, of each in m
            (thickness times share); region (rows, x), number in `benchmarks.rivals.known_painting_scene.REGIONS`;
            foreign, whether a paint of it is not in the catalogue.
        """
        number_of = {name: n for n, name in enumerate(self.names)}
        place = y1 - y0, self.shape[1]
        found = {
            name: np.zeros((*place, PLACES) if name in PLACED else place, dtype)
            for name, dtype in TRUTH.items()
        }
        found["members"][:] = -1
        for number, where, values in self._vary(y0, y1):
            region = REGIONS[number]
            parts = []
            for n, coat in enumerate(region.coats):
                thick = region.thickness(n, values)
                for name, share in zip(coat.paints, region.shares(n, values), strict=True):
                    parts.append((number_of[name], n, np.asarray(thick * share)))
            for place, (member, n, amount) in enumerate(sorted(parts, key=lambda part: part[0])):
                found["members"][where, place] = member
                found["coats"][where, place] = n
                found["amounts"][where, place] = amount
            found["region"][where] = number
            found["foreign"][where] = any(member >= len(self.paints) for member, _, _ in parts)
        return found

    def _vary(self, y0: int, y1: int) -> Iterator[tuple[int, np.ndarray, dict[str, np.ndarray]]]:
        """Number of each region in some rows, its pixels, and the numbers that vary there."""
        labels = self.scene.labels(y0, y1)
        # Of every row by itself, so that blocks of any size hold the same painting.
        rows = [np.random.default_rng([self.seed, 1, y]) for y in range(y0, y1)]
        grain = np.stack(
            [rng.standard_normal((3, self.shape[1]), np.float32) for rng in rows], axis=1
        )
        for number in np.unique(labels):
            where = labels == number
            fields = self.scene.fields(y0, y1, int(number), where, grain)
            values = {}
            for (name, (low, high), by_log), field in zip(
                REGIONS[number].ranges, fields, strict=True
            ):
                values[name] = low * (high / low) ** field if by_log else low + (high - low) * field
            yield int(number), where, values


def painting(
    shape: tuple[int, int] = (96, 128),
    bands: int | Float[np.ndarray, "bands"] = 60,
    seed: int = 0,
    noise: float = NOISE,
) -> Painting:
    """A painting of the oils that ship, with two paints that are kept from the catalogue.

    Args:
        shape: (y, x) in pixels.
        bands: number of bands from 400 to 700 nm, or wavelengths in nm within that range.
        seed: another seed is another painting of the same kind.
        noise: standard deviation of a reading, independent in every band.
    """
    grid = np.linspace(400.0, 700.0, bands) if isinstance(bands, int) else np.asarray(bands, float)
    paints = {name: paint.resample(grid) for name, paint in load().items()}
    kept = [paint for name, paint in paints.items() if name not in FOREIGN]
    return Painting(
        shape=shape,
        wavelengths=grid,
        paints=kept,
        foreign=[paints[name] for name in FOREIGN],
        ground=_ground(grid),
        noise=noise,
        seed=seed,
    )


def _ground(grid: Float[np.ndarray, "bands"]) -> Float[np.ndarray, "bands"]:
    """A warm grey."""
    return 0.58 + 0.12 / (1.0 + np.exp(-(grid - 530.0) / 50.0))


def spectra(
    region: Region,
    paints: Mapping[str, Pigment],
    ground: Float[np.ndarray, "bands"],
    values: Mapping[str, np.ndarray],
) -> Float[np.ndarray, "points bands"]:
    """Reflectance of a region by the solver, for numbers by name, each (points,)."""
    known = {name: np.asarray(value) for name, value in values.items()}
    size = next(iter(known.values())).shape
    layers = []
    for n, coat in enumerate(region.coats):
        parts = np.stack(
            [np.broadcast_to(share, size) for share in region.shares(n, known)], axis=-1
        )
        medium = paints[coat.paints[0]]
        if len(coat.paints) > 1:
            medium = Mixture(
                [paints[name] for name in coat.paints], parts / parts.sum(axis=-1, keepdims=True)
            )
        layers.append(Layer(medium, np.broadcast_to(region.thickness(n, known), size)))
    return np.asarray(reflectance(Glaze(layers, ground, INDEX), INSTRUMENT, tolerance=_SOLVER))


@dataclass(frozen=True)
class _Table:
    """Spectra of a region over the numbers that vary in it, float32."""

    names: tuple[str, ...]
    axes: tuple[Axis | Mirrored, ...]
    core: np.ndarray  # Chebyshev coefficients, (n_1, ..., components)
    components: Float[np.ndarray, "components bands"]
    error: float

    def __call__(self, values: Mapping[str, np.ndarray]) -> Float[np.ndarray, "points bands"]:
        columns = [np.asarray(values[name], float) for name in self.names]
        found = np.empty((columns[0].size, self.components.shape[1]), np.float32)
        for start in range(0, len(found), _PIXELS):
            some = slice(start, start + _PIXELS)
            part = None
            for axis, column, count in zip(self.axes, columns, self.core.shape, strict=False):
                basis = polynomials(axis.coordinate(column[some], np), count, np).astype(np.float32)
                if part is None:
                    part = basis @ self.core.reshape(count, -1)
                else:
                    part = np.matmul(basis[:, None, :], part.reshape(len(basis), count, -1))[:, 0]
            assert part is not None
            found[some] = part @ self.components
        return found


@functools.lru_cache(maxsize=64)
def _table(number: int, wavelengths: tuple[float, ...], ground: tuple[float, ...]) -> _Table:
    """The table of one region."""
    region = REGIONS[number]
    grid = np.asarray(wavelengths)
    catalogue = load()
    paints = {name: catalogue[name].resample(grid) for coat in region.coats for name in coat.paints}

    def function(**values: np.ndarray) -> np.ndarray:
        return spectra(region, paints, np.asarray(ground), values)

    ranges = {name: ends for name, ends, _ in region.ranges}
    table = interpolated(function, ranges, tolerance=TABLE_ERROR)
    if not table.converged:
        raise ValueError(
            f"the spectra of {region.name!r} are known to {table.error:.2g} only, not "
            f"{TABLE_ERROR:g}"
        )
    whole = np.asarray(table.coefficients, float)
    # Spectra of a region lie in a space of few dimensions: what is left out is bounded by the sum
    # of what it weighs.
    left, weight, right = np.linalg.svd(whole.reshape(-1, whole.shape[-1]), full_matrices=False)
    rest = np.cumsum(weight[::-1])[::-1]
    keep = max(1, int(np.sum(rest > 0.1 * TABLE_ERROR)))
    core = (left[:, :keep] * weight[:keep]).reshape(*whole.shape[:-1], keep)
    return _Table(
        names=table.names,
        axes=table.axes,
        core=core.astype(np.float32),
        components=right[:keep].astype(np.float32),
        error=table.error,
    )


def write_painting(folder: str | Path, painting: Scenery) -> Path:
    """Write a painting as an ENVI image of ten thousandths (uint16), a block of rows at a time.

    Args:
        folder: is made; gets painting.hdr and painting.dat, and ground.csv (internal reflectance).
        painting: by `painting`.

    Returns:
        Path of the header.

    Raises:
        FileExistsError: there is a painting in the folder.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    lines, samples = painting.shape
    rows = max(1, _VALUES // (samples * painting.wavelengths.size))
    with (folder / "painting.dat").open("xb") as file:
        for y in range(0, lines, rows):
            block = painting.rows(y, min(y + rows, lines))
            whole = np.clip(np.rint(block * 10000.0), 0, 65535).astype("<u2")
            file.write(whole.transpose(0, 2, 1).tobytes())
    table = "\n".join(
        f"{w:g},{r:.6f}" for w, r in zip(painting.wavelengths, painting.ground, strict=True)
    )
    (folder / "ground.csv").write_text(f"wavelength,ground\n{table}\n", encoding="utf-8")
    header = folder / "painting.hdr"
    header.write_text(_header(painting), encoding="utf-8")
    return header


def _header(painting: Scenery) -> str:
    fields = {
        "description": f"{{Painting made by benchmarks.rivals.known_painting, seed {painting.seed}}}",
        "samples": painting.shape[1],
        "lines": painting.shape[0],
        "bands": painting.wavelengths.size,
        "header offset": 0,
        "file type": "ENVI Standard",
        "data type": 12,
        "interleave": "bil",
        "byte order": 0,
        "reflectance scale factor": 10000,
        "wavelength units": "Nanometers",
        "wavelength": "{" + ", ".join(f"{w:.6g}" for w in painting.wavelengths) + "}",
    }
    return "ENVI\n" + "".join(f"{name} = {value}\n" for name, value in fields.items())
