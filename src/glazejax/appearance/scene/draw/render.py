"""A picture of a scene: what is computed, in which order, and what is not.

First geometry alone: one ray through the middle of each pixel, then several where neighbours meet
different things. That gives the materials, angles and thicknesses of the picture; their tables
are made, and spectra follow tile by tile. Pixels that differ strongly from a neighbour (a
highlight, a texture) get more rays in the end.
"""

from collections.abc import Callable
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Int

from ....colour import colour_weights
from ....progress import Progress, no_progress
from ....radiative.common.inputs import check_tolerance
from ..render_result import Rendered, RenderReport
from ..scene import Scene
from .intersect import make_geometry
from .rays import TILE, Bounce, Lamps, lamps, trace
from .shade import radiance
from .visibility import MaterialsInView

# Bounces of rays are kept between the passes up to so many bytes, and traced again beyond.
_KEPT_BYTES = 2**29


@dataclass
class _Tile:
    """Rays that are followed together: `samples_across` squared for a pixel, one after another."""

    pixels: Int[np.ndarray, "pixels"]
    samples_across: int
    bounces: list[Bounce] | None = None


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
        spectral: keep all bands; otherwise nothing but XYZ is kept, so that a large picture needs
            little memory.
        adaptive: several rays only where neighbouring pixels differ; otherwise for all pixels.
        tolerance: absolute error wanted of a glaze's reflectance factor.
        progress: called with how far it is, in thousandths.

    Returns:
        `Rendered`. Interrupted from the keyboard, it holds what was done until then.

    Raises:
        ValueError: the scene has what only `path_trace` draws: area lights, relief, a rough
            surface of a glaze, or light between surfaces; or the tolerance is not between 0 and 1.
    """
    check_tolerance(tolerance)
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


@dataclass
class _Work:
    """One picture in the making; arguments as of `render`."""

    scene: Scene
    spectral: bool
    adaptive: bool
    tolerance: float
    progress: Progress

    def __post_init__(self) -> None:
        scene = self.scene
        self.weights = None if self.spectral else colour_weights(scene.wavelengths, "E")
        self.refines: bool = self.adaptive and scene.antialias > 1
        self.geometry = make_geometry(scene.shapes, scene.materials)
        self.places: Lamps = lamps(scene.lights)
        self.in_view = MaterialsInView(list(scene.materials.values()))
        self.kept = 0
        self.report = RenderReport(
            bands=np.size(scene.wavelengths),
            materials_full=len(scene.materials),
            pixels=scene.width * scene.height,
        )

    def run(self) -> Rendered:
        """All passes."""
        scene = self.scene
        grid = np.asarray(scene.wavelengths, float)
        pixels = np.arange(scene.width * scene.height)
        image = np.full((pixels.size, grid.size if self.weights is None else 3), np.nan)
        finished = 0.0
        try:
            # Geometry before any spectrum: one ray for a pixel, then more where neighbours differ.
            tiles = self._tiles(pixels, 1 if self.adaptive else scene.antialias)
            signature = self._look(tiles, 0.0, 0.25)
            edges = np.zeros(0, int)
            if self.refines:
                # Small numbers, one for each signature: the filters count in double precision.
                things = np.unique(signature, return_inverse=True)[1]
                edges = np.flatnonzero(_unlike_neighbour(self._as_picture(things), np.not_equal))
                edge_tiles = self._tiles(edges, scene.antialias)
                self._look(edge_tiles, 0.25, 0.35)
                # Later tiles write over earlier ones: an edge gets the mean of its own rays.
                tiles += edge_tiles
            # Tables of the materials in view, for the angles in view; then the spectra.
            self.in_view.prepare(grid, self.tolerance)
            self._shade(tiles, image, 0.35, 0.85)
            finished = 1.0
            if self.refines:
                # More rays for pixels that came out unlike a neighbour.
                strong = np.flatnonzero(_contrasting(self._as_picture(image)))
                strong = np.setdiff1d(strong, edges)
                strong_tiles = self._tiles(strong, scene.antialias)
                self._look(strong_tiles, 0.85, 0.87)
                # Again, as only these rays may meet a thing that is small.
                self.in_view.prepare(grid, self.tolerance)
                self._shade(strong_tiles, image, 0.87, 1.0)
                self.report.refined = edges.size + strong.size
        except KeyboardInterrupt:
            done = np.isfinite(image[:, 0]).mean()
            finished = min(float(done), 0.999)
        self.report.materials = sum(m is not None for m in self.in_view.prepared)
        self.report.angles = self.in_view.describe()
        # Without skipping, every ray would be one of a full pixel, and meet every light.
        scale = scene.antialias**2 * self.report.pixels
        self.report.rays_full = max(int(scale * self.in_view.rays_a_sample), self.report.rays)
        self.report.pairs_full = self.report.rays_full * len(self.places.point)
        return Rendered(
            values=self._as_picture(image),
            spectral=self.spectral,
            wavelengths=grid,
            done=finished,
            report=self.report,
        )

    def _as_picture(self, values: np.ndarray) -> np.ndarray:
        """Values of pixels in rows and columns, (h, w, ...)."""
        return values.reshape(self.scene.height, self.scene.width, *values.shape[1:])

    def _report(self, share: float, stage: str) -> None:
        """Say how far the picture is, 0 to 1, and what is being done."""
        # Progress is counted in a thousand parts.
        self.progress(round(share * 1000), 1000, stage)

    def _tiles(self, pixels: np.ndarray, samples_across: int) -> list[_Tile]:
        """Pixels in groups that go through the processor together, `samples_across` squared
        rays for one.
        """
        size = max(1, TILE // samples_across**2)
        return [_Tile(pixels[k : k + size], samples_across) for k in range(0, pixels.size, size)]

    def _bounces(self, tile: _Tile) -> list[Bounce]:
        """Bounces of the rays of a tile: kept, or traced."""
        if tile.bounces is not None:
            return tile.bounces
        # Samples in the middles of a grid within each pixel.
        steps = (np.arange(tile.samples_across) + 0.5) / tile.samples_across
        across, down = np.meshgrid(steps, steps)
        x = (tile.pixels % self.scene.width)[:, None] + across.ravel()
        y = (tile.pixels // self.scene.width)[:, None] + down.ravel()
        rays = self.scene.rays(x.ravel(), y.ravel())
        bounces = trace(
            self.geometry,
            self.places,
            *rays,
            reflects=self.in_view.most_mirrored,
            most_bounces=self.scene.bounces,
        )
        # Bounces wait in memory for their spectra as far as there is room.
        size = sum(bounce.bytes for bounce in bounces)
        if self.kept + size <= _KEPT_BYTES:
            tile.bounces = bounces
            self.kept += size
        return bounces

    def _look(self, tiles: list[_Tile], start: float, end: float) -> np.ndarray:
        """First pass: what is to be seen, and of each ray a number that differs between different
        things.
        """
        signatures = []
        for k, tile in enumerate(tiles):
            self._report(start + (end - start) * k / len(tiles), "finding visible surfaces")
            bounces = self._bounces(tile)
            self.in_view.add(bounces)
            signatures.append(_signature(bounces))
        return np.concatenate(signatures) if signatures else np.zeros(0, int)

    def _shade(self, tiles: list[_Tile], image: np.ndarray, start: float, end: float) -> None:
        """Second pass: spectra, written to their pixels."""
        lights = jnp.asarray(self.scene.light_spectra(), jnp.result_type(float))
        background = jnp.asarray(self.scene.background_spectrum(), lights.dtype)
        for k, tile in enumerate(tiles):
            self._report(start + (end - start) * k / len(tiles), "computing spectra")
            bounces = self._bounces(tile)
            self.report.rays += sum(len(bounce.material) for bounce in bounces)
            self.report.pairs += sum(int(np.sum(bounce.strength > 0)) for bounce in bounces)
            samples = radiance(bounces, self.in_view.prepared, lights, background)
            # The mean over the samples of each pixel, which follow one another.
            colours = (
                np.asarray(samples).reshape(tile.pixels.size, -1, samples.shape[-1]).mean(axis=1)
            )
            image[tile.pixels] = colours if self.weights is None else colours @ self.weights
            if tile.bounces is not None:
                # Its room is that of tiles to come.
                self.kept -= sum(bounce.bytes for bounce in bounces)
                tile.bounces = None
        self._report(end, "computing spectra")


def _signature(bounces: list[Bounce]) -> Int[np.ndarray, "rays"]:
    """A number of each ray that changes with the things it meets and the lights that reach them."""
    total = np.zeros(0, int)
    child: Bounce | None = None
    # From the last bounce back: each point's number takes in that of the point seen in its mirror.
    for bounce in reversed(bounces):
        # The lights that reach a point, as a sum of one random number each: bits would end at 63.
        reached = (bounce.strength > 0) @ np.random.default_rng(0).integers(
            1 << 62, size=bounce.strength.shape[1]
        )
        signature = (bounce.shape.astype(np.int64) + 1) * 1000003 + reached
        if child is not None:
            signature[child.parent] += 7919 * (total % 1000000007)
        total = signature
        child = bounce
    return total


def _contrasting(image: np.ndarray) -> Bool[np.ndarray, "h w"]:
    """Pixels whose mean over bands, or XYZ, differs strongly from that of a neighbour."""

    def contrast(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        # By more than this share of the brighter one and a little white.
        return np.abs(a - b) > 0.06 * (np.maximum(a, b) + 0.05)

    return _unlike_neighbour(np.nan_to_num(image.mean(axis=-1)), contrast)


def _unlike_neighbour(
    values: np.ndarray, unlike: Callable[[np.ndarray, np.ndarray], np.ndarray]
) -> Bool[np.ndarray, "h w"]:
    """Pixels that are unlike one of their eight neighbours: the largest or the smallest of them, as
    no other differs as much.
    """
    from scipy.ndimage import maximum_filter, minimum_filter

    return unlike(values, maximum_filter(values, 3)) | unlike(values, minimum_filter(values, 3))
