"""An image of spectra: which one it is, the readings that are worked with, and which of its pixels
say anything.

Bands are as fine as the paints are known.
"""

import functools
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from jaxtyping import Bool, Float, UInt8

from glazejax import Pigment
from glazejax.spectra import Bands, common_range

from ...film.films import Noise
from ...film.model.mixing import digest
from ...film.shared_bands import SEARCHED, SharedBands, shared_bands
from ...identify.families.expected import has_families
from ..store.chunk import PixelReadings
from ..store.layout import Status
from ..store.windows import Window

if TYPE_CHECKING:
    import xarray

    from glazejax.io import CubeSource

BandReadings: TypeAlias = Float[np.ndarray, "*n bands"]
"""Readings at the working bands, or their standard deviations; of any shape before the bands."""

# Values read at a time.
_VALUES = 2**24
# Readings below 0 or near it by so many standard deviations of their noise are no noise.
_SURE = 4.0


def working_bands(stored: Float[np.ndarray, "stored"], pigments: Sequence[Pigment]) -> SharedBands:
    """Groups of an image's bands, each averaged to one reading.

    A catalogue known every 10 nm says nothing finer: means over such groups hold all that
    distinguishes its paints, with less noise, at a fraction of the cost.

    Args:
        stored: wavelengths of the image, nm, ascending.
        pigments: of the catalogue.

    Raises:
        ValueError: the paints cover less than six bands of the image.
    """
    first, last = used_range(pigments)
    # Tables are often interpolated to finer steps than paint has structure for.
    # Steps in nm below which spectra of paint hold no more, and working bands at most. Families
    # have the bins of their search: it would average bands of other bins once more.
    finest = min(float(np.median(np.diff(p.wavelengths))) for p in pigments)
    width = SEARCHED if has_families(pigments) else max(finest, SEARCHED, (last - first) / 60)
    return shared_bands(stored, (first, last), width, "the image has")


def used_range(pigments: Sequence[Pigment]) -> tuple[float, float]:
    """First and last wavelength that an image is used at, nm: all paints are known there or, where
    they are searched by family, one of them is.
    """
    grids = [p.wavelengths for p in pigments]
    if has_families(pigments):
        return float(min(grid[0] for grid in grids)), float(max(grid[-1] for grid in grids))
    return common_range(grids)


def classify(
    readings: BandReadings,
    sd: BandReadings,
    use: Bool[np.ndarray, "*n"] | None = None,
) -> UInt8[np.ndarray, "*n"]:
    """Status of pixels: a number of `layout.Status` for each.

    Args:
        readings: at the working bands; a missing band makes them NaN, a saturated one infinite.
        sd: of their noise.
        use: the user's mask.
    """
    with np.errstate(invalid="ignore"):
        top = readings.max(axis=-1)
        bottom = readings.min(axis=-1)
        # The first that holds counts.
        reasons = {
            Status.MASKED: False if use is None else ~use,
            Status.NO_DATA: np.isnan(readings).any(axis=-1) | (np.isfinite(top) & (top == bottom)),
            Status.SATURATED: np.isposinf(top),
            Status.NEGATIVE: (readings < -(_SURE * sd + 0.01)).any(axis=-1),
            Status.TOO_BRIGHT: top > 1.5,
            Status.DARK: top < _SURE * sd.mean(axis=-1),
        }
    return np.select([*reasons.values()], [*reasons], Status.MAPPED).astype(np.uint8)


@dataclass(frozen=True)
class Image:
    """An image and how its spectra are worked with; can be sent to other processes.

    Attributes:
        source: opens the image, or is it.
        bands: that are worked with.
        noise: of one reading of the image; None until it is estimated, as if by a bench instrument.
        mask: pixels that are used; None for all.
        changed: when each of its files was last written, ns since 1970: another file under the same
            name is opened again.
    """

    source: "CubeSource | xarray.DataArray"
    bands: SharedBands
    noise: Noise | None
    mask: Bool[np.ndarray, "y x"] | None
    changed: tuple[int, ...] = ()

    @property
    def count(self) -> Bands:
        """Bands of the image in each that is worked with."""
        return np.count_nonzero(self.bands.mean, axis=0).astype(float)

    @property
    def used(self) -> slice:
        """Stored bands from the first to the last that is worked with."""
        first, last = np.flatnonzero(self.bands.mean.any(axis=1))[[0, -1]].tolist()
        return slice(first, last + 1)

    def cube(self) -> "xarray.DataArray":
        """The lazy image."""
        from glazejax.io import CubeSource

        if isinstance(self.source, CubeSource):
            return _open(self.source, self.changed)
        return self.source

    def means(self, block: Float[np.ndarray, "pixels stored"]) -> PixelReadings:
        """Readings of pixels at the working bands, single precision.

        Args:
            block: reflectance; a missing band makes all readings of a pixel NaN, a saturated one
                infinite.
        """
        used = self.used
        block = block[:, used].astype(np.float32, copy=False)
        with np.errstate(invalid="ignore"):
            readings = block @ self.bands.mean[used].astype(np.float32)
            full = block.max(axis=1) >= self.cube().attrs.get("saturated", np.inf)
            odd = np.flatnonzero(~np.isfinite(readings).all(axis=1))
        # A product with a zero makes NaN of infinity: which of both it was, the pixel itself says.
        full[odd] |= np.isposinf(block[odd]).any(axis=1)
        readings[odd] = np.nan
        readings[full] = np.inf
        return readings

    def read(self, window: Window) -> tuple[PixelReadings, np.ndarray]:
        """Readings at the working bands, and what can be done with each pixel, row by row."""
        cube = self.cube()
        readings = []
        height = max(1, _VALUES // (cube.shape[2] * window.shape[1]))
        for y in range(window.y0, window.y1, height):
            block = cube[y : min(y + height, window.y1), window.x0 : window.x1].to_numpy()
            readings.append(self.means(block.reshape(-1, block.shape[-1])))
        spectra = np.concatenate(readings)
        use = None if self.mask is None else self.mask[window.slices].ravel()
        with np.errstate(invalid="ignore"):
            return spectra, classify(spectra, self.noise_sd(spectra), use)

    def noise_sd(self, readings: BandReadings) -> BandReadings:
        """Standard deviation of the noise of readings at the working bands.

        Averaging makes the noise of one reading less, but not what an instrument's scale and stray
        light do to all bands: as much as of a bench instrument (`Noise()`).
        """
        usual = Noise()
        noise = self.noise or usual
        averaged = noise.sd(readings) / np.sqrt(self.count).astype(readings.dtype)
        return np.hypot(averaged, usual.sd(readings))


@functools.lru_cache(maxsize=4)
def _open(source: "CubeSource", changed: tuple[int, ...]) -> "xarray.DataArray":
    """Open an image, once for each process and each time that one of its files was written."""
    return source.open()


def identity(source: "CubeSource | xarray.DataArray", array: "xarray.DataArray") -> dict[str, Any]:
    """Identity of an image: equal for two images that are the same.

    Args:
        source: opens it, or is it.
        array: as it was opened.
    """
    from glazejax.io import CubeSource

    same = {
        "shape": array.shape,
        "wavelengths": digest(np.asarray(array["wavelength"], float)),
    }
    if not isinstance(source, CubeSource):
        # Some lines distinguish an image in memory from others.
        rows = np.linspace(0, array.shape[0] - 1, min(64, array.shape[0])).astype(int)
        return same | {"some lines": digest(*(array[int(y)].to_numpy() for y in rows))}
    from glazejax.io.cubes.hashes import quick_source_hash, time_of_change

    settings = asdict(source)
    # With further files, which calibrate the image.
    names = ("wavelengths", "white", "dark", "white_reflectance", "path")
    files = {name: Path(settings[name]) for name in names if isinstance(settings[name], str | Path)}
    return same | {
        "source": settings,
        "hash": {name: quick_source_hash(path) for name, path in files.items()},
        "time of change": {name: time_of_change(path) for name, path in files.items()},
    }
