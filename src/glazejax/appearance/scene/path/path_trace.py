"""A picture of a scene by path tracing with Mitsuba 3: light that goes everywhere, and how noisy
the picture is.

The picture is the mean of several passes that know nothing of each other, so that their differences
show the noise.
"""

import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from ....progress import Progress, no_progress
from ...mitsuba.variants import spectral_variant
from ..render_result import Rendered, RenderReport
from ..scene import Scene
from ..shapes import whole
from .mitsuba import mitsuba_scene

MOST_SAMPLES = 1 << 20
# Rays of one pass, at most: more would fill the memory.
_MOST_RAYS = 1 << 23


@dataclass
class PathReport(RenderReport):
    """Counts of what was computed, and its noise; of the counts of a `RenderReport` it has rays,
    pixels and materials.

    Attributes:
        variant: of Mitsuba.
        samples: rays of a pixel, all passes together.
        passes: done.
        passes_full: wanted.
        pixel_noise: standard error of a pixel's luminance, root mean square over the picture, as a
            share of the picture's mean luminance.
        mean_noise: standard error of the mean luminance of the whole picture, as a share of it.
        notes: materials that became the nearest that Mitsuba has, a sentence each.
    """

    variant: str = ""
    samples: int = 0
    passes: int = 0
    passes_full: int = 0
    pixel_noise: float = np.nan
    mean_noise: float = np.nan

    def describe(self) -> str:
        """In words, a line each."""
        lines = [
            f"paths: {self.samples} of each pixel in {self.passes} passes, by Mitsuba's "
            f"{self.variant}"
        ]
        if np.isfinite(self.pixel_noise):
            noise = (
                f"{self.pixel_noise:.2%} of the mean luminance for a pixel, "
                f"{self.mean_noise:.3%} for the picture"
            )
            lines.append(f"noise: {noise} (standard error, from the differences between passes)")
        return "\n".join(lines)


@dataclass(frozen=True)
class PathTraced(Rendered):
    """A picture as XYZ, and how noisy it is."""

    report: PathReport


def path_trace(
    scene: Scene,
    *,
    samples: int = 256,
    max_depth: int = -1,
    background: bool = True,
    tolerance: float = 1e-3,
    seed: int = 0,
    progress: Progress = no_progress,
) -> PathTraced:
    """Make a picture with everything that light does, in Mitsuba 3.

    A spectral variant of Mitsuba that is set stays; otherwise the fastest that works here is set
    meanwhile.

    Args:
        scene: what there is. `antialias` and `bounces` play no part, and all bounces are followed
            whatever `diffuse_bounces` says.
        samples: rays of a pixel, at least; some more make passes of whole squares.
        max_depth: of paths: 2 for direct light alone, -1 for everything.
        background: light from all around with the scene's background.
        tolerance: absolute error wanted of a glaze's reflectance factor, 1e-5 to 0.1.
        seed: of the random numbers; the same seed gives the same picture.
        progress: called with the passes that are done.

    Returns:
        `PathTraced`. Interrupted from the keyboard, it is the mean of the passes done, and NaN
        before the first.

    Raises:
        ModuleNotFoundError: Mitsuba is not installed.
        ValueError: samples or tolerance out of range, or what `mitsuba_scene` refuses.
    """
    samples = whole("samples", samples, 1, MOST_SAMPLES)
    with spectral_variant() as variant, tempfile.TemporaryDirectory() as folder:
        import mitsuba as mi  # pyright: ignore[reportMissingImports]

        pixels = scene.width * scene.height
        report = PathReport(variant=variant, pixels=pixels, materials=len(scene.materials))
        # Passes with seeds of their own are independent, and their spread is the noise.
        samples_each, report.passes_full = passes_of(samples, pixels)
        progress(0, report.passes_full, "computing glazes")
        description = mitsuba_scene(
            scene,
            Path(folder),
            samples=samples_each,
            max_depth=max_depth,
            background=background,
            tolerance=tolerance,
            notes=report.notes,
        )
        try:
            loaded = mi.load_dict(description)
        except RuntimeError as error:
            # What the material refuses is the last line of a traceback.
            _, refused, words = str(error).rpartition("\nValueError: ")
            if not refused:
                raise
            raise ValueError(words) from None

        def one(number: int) -> Float[np.ndarray, "h w 3"]:
            return np.array(
                mi.render(
                    loaded, spp=samples_each, seed=mi.UInt32(seed * report.passes_full + number)
                ),
                float,
            )

        return _mean(scene, report, samples_each, one, progress)


def passes_of(samples: int, pixels: int) -> tuple[int, int]:
    """Rays of a pixel in one pass, a square, and the number of passes, so that there are `samples`
    at least.
    """
    # Passes say how noisy the picture is: four at least, where there are as many samples.
    most = max(1, min(samples // 4, _MOST_RAYS // pixels))
    samples_each = int(np.sqrt(most)) ** 2
    return samples_each, max(2, -(-samples // samples_each))


def _mean(
    scene: Scene,
    report: PathReport,
    samples_each: int,
    render_pass: Callable[[int], Float[np.ndarray, "h w 3"]],
    progress: Progress,
) -> PathTraced:
    """Mean of the passes, and the spread of their luminance."""
    total = np.zeros((scene.height, scene.width, 3))
    square = np.zeros((scene.height, scene.width))
    means = []
    try:
        for number in range(report.passes_full):
            progress(number, report.passes_full, "following paths")
            image = render_pass(number)
            total += image
            square += image[..., 1] ** 2
            means.append(float(image[..., 1].mean()))
    except KeyboardInterrupt:
        pass
    count = len(means)
    report.passes = count
    report.samples = count * samples_each
    report.rays = report.samples * report.pixels
    # NaN before the first pass is done.
    total = total / count if count else np.full_like(total, np.nan)
    mean = float(np.mean(means)) if count else 0.0
    # Standard errors of the mean: of a pixel, and of the picture.
    if count > 1 and mean > 0:
        variance = np.maximum(square / count - total[..., 1] ** 2, 0.0) / (count - 1)
        report.pixel_noise = float(np.sqrt(variance.mean())) / mean
        report.mean_noise = float(np.std(means, ddof=1) / np.sqrt(count)) / mean
    progress(report.passes_full, report.passes_full, "following paths")
    return PathTraced(
        values=total,
        spectral=False,
        wavelengths=np.asarray(scene.wavelengths, float),
        done=count / report.passes_full,
        report=report,
    )
