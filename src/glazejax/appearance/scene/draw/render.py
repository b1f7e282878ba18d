"""A picture of a scene: what is computed, in which order, and what is not.

First geometry alone: one ray through the middle of each pixel, then several where neighbours meet
different things. That tells which materials, angles and thicknesses the picture shows; their tables
are made, and spectra follow tile by tile. Pixels that differ strongly from a neighbour (a
highlight, a texture) get more rays in the end.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Int

from ....colour import CIE_1931, colour_weights
from ....progress import Progress, no_progress
from ..materials import Material
from ..render_result import Rendered, RenderReport
from ..scene import Scene
from .intersect import scene_geometry
from .rays import TILE, Lamps, Level, lamps, trace
from .shade import lit_pairs, pixels_from_samples, radiance
from .visibility import MaterialsInView, needed_bands

# Levels of rays are kept between the passes up to so many bytes, and traced again beyond.
_KEPT_BYTES = 2**29


@dataclass
class _Tile:
    """Rays that are followed together: `each` of them for a pixel, one after another."""

    pixels: Int[np.ndarray, "pixels"]
    each: int
    levels: list[Level] | None = None


def render(
    scene: Scene,
    *,
    spectral: bool = True,
    adaptive: bool = True,
    tolerance: float = 1e-3,
    progress: Progress = no_progress,
) -> Rendered:
    """Make a picture.

    Args:
        scene: what there is.
        spectral: compute and keep all bands; otherwise only those that a picture on a screen can
            show, of which nothing but XYZ is kept, so that a large picture needs little memory.
        adaptive: several rays only where neighbouring pixels differ; otherwise for all pixels.
        tolerance: absolute error wanted of a glaze's reflectance factor.
        progress: called with how far it is, in thousandths.

    Returns:
        `Rendered`. Interrupted from the keyboard, it holds what was done until then.

    Raises:
        ValueError: the scene has what only `path_trace` draws: area lights, relief, a rough
            surface of a glaze, or light between surfaces.
    """
    beyond = scene.needs_path_tracing()
    if beyond is not None:
        raise ValueError(
            f"the ray caster cannot draw {beyond}: use path_trace, or glazejax scene --renderer "
            "mitsuba (pip install 'glazejax[render]')"
        )
    return _Work(
        scene=scene,
        spectral=spectral,
        adaptive=adaptive,
        tolerance=tolerance,
        progress=progress,
    ).run()


class _Work:
    """One picture in the making."""

    def __init__(
        self, scene: Scene, spectral: bool, adaptive: bool, tolerance: float, progress: Progress
    ):
        keep = np.ones(np.size(scene.wavelengths), bool) if spectral else needed_bands(scene)
        # Weights of the whole grid: bands left out count as dark.
        self.weights = None if spectral else colour_weights(scene.wavelengths, "E", CIE_1931)[keep]
        self.bands = keep
        self.scene = scene.only_bands(keep)
        self.adaptive = adaptive
        self.tolerance = tolerance
        self.progress = progress
        self.geometry = scene_geometry(self.scene)
        self.places: Lamps = lamps(scene.lights)
        self.all_materials = list(self.scene.materials.values())
        self.in_view = MaterialsInView(self.all_materials)
        self.prepared: Sequence[Material | None] = []
        self.kept = 0
        full = scene.antialias**2 if scene.antialias > 1 else 1
        self.report = RenderReport(
            bands=int(keep.sum()),
            bands_full=keep.size,
            materials_full=len(self.all_materials),
            pixels=scene.width * scene.height,
            rays_full=0,
            pairs_full=0,
        )
        self.full = full

    def run(self) -> Rendered:
        """All passes."""
        scene = self.scene
        pixels = np.arange(scene.width * scene.height)
        image = np.full((pixels.size, int(self.bands.sum()) if self.weights is None else 3), np.nan)
        finished = 0.0
        try:
            # What is in view, before any spectrum: one ray for a pixel, then more at edges.
            each = 1 if self.adaptive else scene.antialias
            tiles = self._tiles(pixels, each)
            signature = self._look(tiles, 0.0, 0.25)
            edges = np.zeros(0, int)
            if self.adaptive and scene.antialias > 1:
                edges = np.flatnonzero(
                    _differing(signature.reshape(scene.height, scene.width)).ravel()
                )
                more = self._tiles(edges, scene.antialias)
                self._look(more, 0.25, 0.35)
                tiles += more
            # Tables of what is seen, at the angles at which it is seen; then the spectra.
            self.prepared = self.in_view.prepare(np.asarray(scene.wavelengths), self.tolerance)
            self._shade(tiles, image, 0.35, 0.85)
            finished = 1.0
            if self.adaptive and scene.antialias > 1:
                # More rays for pixels that came out unlike a neighbour.
                strong = np.flatnonzero(
                    _contrasting(image.reshape(scene.height, scene.width, -1)).ravel()
                )
                strong = np.setdiff1d(strong, edges)
                again = self._tiles(strong, scene.antialias)
                self._look(again, 0.85, 0.87)
                # A thing so small that only these rays meet it.
                self.prepared = self.in_view.prepare(
                    np.asarray(scene.wavelengths), self.tolerance, self.prepared
                )
                self._shade(again, image, 0.87, 1.0)
                self.report.refined = edges.size + strong.size
        except KeyboardInterrupt:
            done = np.isfinite(image[:, 0]).mean()
            finished = min(float(done), 0.999)
        self.report.materials = sum(m is not None for m in self.prepared)
        self.report.angles = self.in_view.describe()
        # Without skipping, every ray would be one of a full pixel, and meet every light.
        scale = self.full * self.report.pixels
        self.report.rays_full = max(int(scale * self.in_view.rays_a_sample), self.report.rays)
        self.report.pairs_full = self.report.rays_full * len(self.places.point)
        image = image.reshape(scene.height, scene.width, -1)
        return Rendered(
            values=image,
            spectral=self.weights is None,
            wavelengths=np.asarray(scene.wavelengths, float),
            bands=self.bands,
            done=finished,
            report=self.report,
        )

    def _report(self, share: float, words: str) -> None:
        """Say how far the picture is, 0 to 1, and what is being done."""
        # Progress is counted in a thousand parts.
        self.progress(round(share * 1000), 1000, words)

    def _tiles(self, pixels: np.ndarray, each: int) -> list[_Tile]:
        """Pixels in groups that go through the processor together, `each` times `each` rays for
        one.
        """
        size = max(1, TILE // each**2)
        return [_Tile(pixels[k : k + size], each) for k in range(0, pixels.size, size)]

    def _levels(self, tile: _Tile) -> list[Level]:
        """Levels of the rays of a tile: kept, or traced."""
        if tile.levels is not None:
            return tile.levels
        steps = (np.arange(tile.each) + 0.5) / tile.each
        across, down = np.meshgrid(steps, steps)
        x = (tile.pixels % self.scene.width)[:, None] + across.ravel()
        y = (tile.pixels // self.scene.width)[:, None] + down.ravel()
        rays = self.scene.rays(x.ravel(), y.ravel())
        levels = trace(
            self.geometry,
            self.places,
            *rays,
            reflects=self.in_view.most_mirrored,
            bounces=self.scene.bounces,
        )
        size = sum(level.bytes for level in levels)
        if self.kept + size <= _KEPT_BYTES:
            tile.levels = levels
            self.kept += size
        return levels

    def _look(self, tiles: list[_Tile], start: float, end: float) -> np.ndarray:
        """First pass: what is to be seen, and of each ray a number that differs between different
        things.
        """
        signatures = []
        for k, tile in enumerate(tiles):
            self._report(start + (end - start) * k / len(tiles), "finding visible surfaces")
            levels = self._levels(tile)
            self.in_view.add(levels)
            signatures.append(_signature(levels))
        return np.concatenate(signatures) if signatures else np.zeros(0, int)

    def _shade(self, tiles: list[_Tile], image: np.ndarray, start: float, end: float) -> None:
        """Second pass: spectra, written to their pixels."""
        lights = jnp.asarray(self.scene.light_spectra(), jnp.result_type(float))
        background = jnp.asarray(self.scene.background_spectrum(), lights.dtype)
        for k, tile in enumerate(tiles):
            self._report(start + (end - start) * k / len(tiles), "computing spectra")
            levels = self._levels(tile)
            self.report.rays += sum(len(level.material) for level in levels)
            self.report.pairs += sum(
                lit_pairs(level, np.arange(len(level.material)))[0].size for level in levels
            )
            samples = radiance(levels, self.prepared, lights, background)
            found = np.asarray(pixels_from_samples(samples, tile.each**2))
            image[tile.pixels] = found if self.weights is None else found @ self.weights
            tile.levels = None
        self._report(end, "computing spectra")


def _signature(levels: list[Level]) -> Int[np.ndarray, "rays"]:
    """A number of each ray that changes with the things it meets and the lights that reach them."""
    total: np.ndarray | None = None
    for level, child in zip(reversed(levels), [None, *reversed(levels[1:])], strict=True):
        reached = (level.strength > 0) @ (1 << np.arange(level.strength.shape[1], dtype=np.int64))
        own = (level.shape.astype(np.int64) + 1) * 1000003 + reached
        if child is not None and total is not None:
            own[child.parent] += 7919 * (total % 1000000007)
        total = own
    assert total is not None
    return total


def _differing(values: np.ndarray) -> Bool[np.ndarray, "h w"]:
    """Pixels that differ from a neighbour, across corners too."""
    out = np.zeros(values.shape, bool)
    for down, across in ((0, 1), (1, 0), (1, 1), (1, -1)):
        first, second = _neighbours(values.shape, down, across)
        different = values[first] != values[second]
        out[first] |= different
        out[second] |= different
    return out


def _contrasting(image: np.ndarray) -> Bool[np.ndarray, "h w"]:
    """Pixels whose mean over bands, or XYZ, differs strongly from that of a neighbour."""
    level = np.nan_to_num(image.mean(axis=-1))
    out = np.zeros(level.shape, bool)
    for down, across in ((0, 1), (1, 0), (1, 1), (1, -1)):
        first, second = _neighbours(level.shape, down, across)
        a = level[first]
        b = level[second]
        # Neighbours that differ by more than this share, of the brighter one and a little white,
        # get more rays.
        different = np.abs(a - b) > 0.06 * (np.maximum(a, b) + 0.05)
        out[first] |= different
        out[second] |= different
    return out


def _neighbours(
    shape: tuple[int, int], down: int, across: int
) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
    """Slices of pixels and of their neighbours."""
    rows, columns = shape
    first = (slice(0, rows - down), slice(max(-across, 0), columns - max(across, 0)))
    second = (slice(down, rows), slice(max(across, 0), columns - max(-across, 0)))
    return first, second
