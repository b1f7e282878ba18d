"""From a window of an image to its maps."""

import functools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Bool, Float

from ...film.films import Noise
from ...film.model.errors import Prior
from ...identify.search.pool import NOBODY
from ...identify.search.searcher import Searcher
from ..store.chunk import ChunkMaps, SetSum, distinct_sets
from ..store.layout import BY_NAME, STATUS_WORDS, Status, Way
from ..store.windows import Window
from .atlas import Atlas, make_atlas, search_for_atlas
from .by_family import FamilyAtlas, FamilySearcher
from .pool import AROUND, pooled
from .process import give_back, one_thread_each
from .survey import spread_out
from .unexplained import gather
from .update import Answers
from .working_bands import WorkingBands, classify

if TYPE_CHECKING:
    import xarray

    from glazejax.io import CubeSource

# Values read at a time.
_VALUES = 2**24


@dataclass(frozen=True)
class Image:
    """An image and how its spectra are worked with; can be sent to other processes.

    Attributes:
        source: opens the image, or is it.
        bands: that are worked with.
        noise: of one reading of the image.
        mask: pixels that are used; None for all.
        saturated: reading from which the detector was full, if that is stated.
    """

    source: "CubeSource | xarray.DataArray"
    bands: WorkingBands
    noise: Noise
    mask: Bool[np.ndarray, "y x"] | None
    saturated: float | None

    def cube(self) -> "xarray.DataArray":
        """The lazy image."""
        from glazejax.io import CubeSource

        return _open(self.source) if isinstance(self.source, CubeSource) else self.source

    def read(self, window: Window) -> tuple[Float[np.ndarray, "pixels bands"], np.ndarray]:
        """Readings at the working bands, and what can be done with each pixel, row by row."""
        cube = self.cube()
        readings = []
        height = max(1, _VALUES // (cube.shape[2] * window.shape[1]))
        for y in range(window.y0, window.y1, height):
            block = cube[y : min(y + height, window.y1), window.x0 : window.x1].to_numpy()
            readings.append(self.bands.means(block.reshape(-1, block.shape[-1]), self.saturated))
        spectra = np.concatenate(readings)
        use = None if self.mask is None else self.mask[window.slices].ravel()
        with np.errstate(invalid="ignore"):
            return spectra, classify(spectra, self.noise_sd(spectra), use)

    def noise_sd(self, readings: Float[np.ndarray, "*n bands"]) -> Float[np.ndarray, "*n bands"]:
        """Standard deviation of the noise of readings at the working bands."""
        return self.bands.noise_sd(readings, self.noise)


@functools.lru_cache(maxsize=4)
def _open(source: "CubeSource") -> "xarray.DataArray":
    """Once for each process."""
    return source.open()


@dataclass(frozen=True)
class PixelSolver:
    """Maps of windows: pixels near a representative in closed form, others by searches of the
    window's own.

    Attributes:
        image: that is mapped.
        searcher: of the paints.
        ground: internal reflectance at the working bands; None where films hide it.
        atlas: of the representatives.
        prior: what was expected.
        reach: how many times as far as noise and paint's errors reach a representative's answer
            is taken.
    """

    image: Image
    searcher: Searcher | FamilySearcher
    ground: Float[np.ndarray, "bands"] | None
    atlas: Atlas | FamilyAtlas
    prior: Prior
    reach: float

    def solve(self, window: Window) -> ChunkMaps:
        """Maps of a window, from it alone."""
        with one_thread_each():
            maps = self._map(window)
        give_back()
        return maps

    def _map(self, window: Window) -> ChunkMaps:
        readings, status = self.image.read(window)
        good = np.flatnonzero(status == Status.MAPPED)
        spectra = np.maximum(readings[good], 0.0)
        mean = pooled(
            np.where((status == Status.MAPPED)[:, None], readings, np.float32(np.nan)),
            self.image.noise_sd(readings),
            self.atlas.features,
            window.shape,
            AROUND,
        )
        answers, way = self._answers(np.maximum(mean.readings[good], 0.0), mean.reach[good])
        arrays = self._arrays(
            window,
            readings=readings,
            status=status,
            good=good,
            spectra=spectra,
            answers=answers,
            way=way,
        )
        tallies: dict[str, float] = {
            label: float(np.sum(status == s)) for s, label in STATUS_WORDS.items()
        }
        tallies |= {f"way {w.name.lower()}": float(np.sum(way == w)) for w in Way if w}
        tallies["explained"] = float(answers.explained.sum())
        unexplained = np.flatnonzero(~answers.explained)
        corner = window.y0, window.x0
        positions = np.stack(np.unravel_index(good[unexplained], window.shape), axis=1)
        return ChunkMaps(
            arrays=arrays,
            tallies=tallies,
            sets=_sums(answers, spectra),
            unexplained=gather(
                spectra[unexplained],
                self.atlas.features(spectra[unexplained]),
                positions + np.array(corner),
            ),
        )

    def _answers(
        self, spectra: Float[np.ndarray, "spectra bands"], reach: Float[np.ndarray, "spectra"]
    ) -> tuple[Answers, np.ndarray]:
        """Answers for good pixels, and the way of each."""
        answers, separation = self.atlas.answers(spectra)
        way = np.full(len(spectra), int(Way.UPDATED), np.uint8)
        reach = self.reach * reach
        far = np.flatnonzero(separation > reach)
        if far.size:
            features = self.atlas.features(spectra[far])
            # Spectra of a window that are searched because no representative is near, at most.
            chosen = spread_out(features, 64, reach[far])
            middles = spectra[far[chosen]]
            searched = search_for_atlas(
                self.searcher, middles, self.image.noise_sd(middles), self.ground
            )
            window_atlas = make_atlas(self.atlas.features, searched, self.prior)
            window_answers, distance = window_atlas.answers(spectra[far])
            better = distance < separation[far]
            answers.put(far[better], window_answers.take(better))
            way[far[better]] = int(Way.NEIGHBOUR)
            way[far[chosen]] = int(Way.SEARCHED)
        return answers, way

    def _arrays(
        self,
        window: Window,
        readings: np.ndarray,
        status: np.ndarray,
        good: np.ndarray,
        spectra: np.ndarray,
        answers: Answers,
        way: np.ndarray,
    ) -> dict[str, np.ndarray]:
        """Arrays by the names of `layout.VARIABLES`."""
        log_fraction_sd, log_thickness_sd = answers.spread()
        fractions = answers.fractions
        present = answers.members != NOBODY
        thickness = np.where(answers.opaque, np.nan, np.exp(answers.amounts).sum(axis=1))
        columns = {
            "members": answers.members,
            "condition": answers.condition,
            "probability": answers.probability,
            "none": answers.none,
            "explained": answers.explained,
            "paint_probability": answers.paint_probability,
            "fraction": np.where(present, fractions, np.nan),
            "fraction_sd": np.where(present, np.minimum(fractions * log_fraction_sd, 0.3), np.nan),
            "thickness": thickness,
            "thickness_sd": thickness * log_thickness_sd,
            "misfit": answers.misfit,
            "rmse": _rmse(spectra, answers.fitted),
            "way": way,
        }
        seen_as = true_colour(self.image.bands.wavelengths, readings)
        arrays = {
            "status": status.reshape(window.shape),
            "true_colour": seen_as.reshape(*window.shape, 3),
        }
        for name, values in columns.items():
            variable = BY_NAME[name]
            full = np.full((window.pixels, *values.shape[1:]), variable.fill, variable.dtype)
            full[good] = values
            arrays[name] = full.reshape(*window.shape, *values.shape[1:])
        return arrays


def _rmse(
    spectra: Float[np.ndarray, "spectra bands"], fitted: Float[np.ndarray, "spectra bands"]
) -> Float[np.ndarray, "spectra"]:
    """Root mean square over the bands at which a fit is known."""
    finite = np.isfinite(fitted)
    square = np.where(finite, spectra - fitted, 0.0) ** 2
    with np.errstate(invalid="ignore"):
        return np.sqrt(square.sum(axis=1) / finite.sum(axis=1))


def _sums(
    answers: Answers, spectra: Float[np.ndarray, "spectra bands"]
) -> dict[tuple[int, ...], SetSum]:
    """Sums over the pixels of each first set; those that nothing explains are the empty set."""
    if not len(spectra):
        return {}
    members = np.sort(np.where(answers.explained[:, None], answers.members, NOBODY), axis=1)
    one_of_each, which = distinct_sets(members)
    sets = members[one_of_each]
    order = np.argsort(which, kind="stable")
    out = {}
    for number, rows in enumerate(
        np.split(order, np.cumsum(np.bincount(which, minlength=len(sets)))[:-1])
    ):
        readings = spectra[rows].astype(np.float64)
        fitted = answers.fitted[rows].astype(np.float64)
        thickness = (
            np.exp(answers.amounts[rows]).sum(axis=1)[~answers.opaque[rows]].astype(np.float64)
        )
        key = tuple(int(m) for m in sets[number] if m != NOBODY)
        total = float(thickness.sum()), len(thickness)
        out[key] = SetSum(
            pixels=len(rows),
            spectrum=readings.sum(axis=0),
            fitted=fitted.sum(axis=0),
            square=(readings**2).sum(axis=0),
            thickness=total,
        )
    return out


def true_colour(
    wavelengths: Float[np.ndarray, "bands"], readings: Float[np.ndarray, "pixels bands"]
) -> np.ndarray:
    """sRGB from 0 to 255 under D65, (pixels, 3); grey where the bands give no colour."""
    from glazejax.colour import srgb

    clipped = np.clip(np.nan_to_num(readings, nan=0.0, posinf=1.0, neginf=0.0), 0.0, 2.0)
    try:
        encoded = np.asarray(srgb(wavelengths, clipped))
    except ValueError:
        encoded = np.repeat(np.sqrt(clipped.mean(axis=1, keepdims=True)), 3, axis=1)
    return np.rint(255.0 * np.clip(encoded, 0.0, 1.0)).astype(np.uint8)
