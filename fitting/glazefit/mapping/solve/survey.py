"""Survey of an image: the noise of its readings, and representatives of a sample of its pixels."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from glazejax.progress import Progress

from ...film.films import Noise
from ...film.noise import spectra_noise
from ..store.atomic_files import KeyedResults
from ..store.chunk import PixelReadings
from ..store.layout import STATUS_WORDS, Status
from .features import ALONG, Features, choose_representatives, pooled
from .image import Image, classify

# Lines in which pixels are sampled.
_LINES = 96
# Pixels that are searched themselves, to see what the closed form costs, at most; and at most where
# there are fewer representatives.
_CHECKED = (256, 64)


@dataclass(frozen=True)
class Survey:
    """Results of the survey of a sample of an image.

    Attributes:
        noise: of one reading.
        features: by which its spectra are compared.
        readings: of the representatives.
        reach: how many times as far as noise and paint's errors reach an answer is taken.
        checked: readings of pixels by which one sees what the closed form costs.
    """

    noise: Noise
    features: Features
    readings: Float[np.ndarray, "representatives bands"]
    reach: float
    checked: PixelReadings


def survey(
    work: KeyedResults, image: Image, most: int, brightness: bool, progress: Progress
) -> Survey:
    """The survey of an image: made, or kept by an earlier run.

    Args:
        work: keeps it.
        image: of which a sample is read.
        most: representatives at most.
        brightness: as for `Features.of`.
        progress: called as pixels are read, and representatives chosen.

    Raises:
        ValueError: the image has no pixel that can be mapped.
    """
    if "survey" not in work.done():
        sample, ends, noise = _sample(image, progress)
        image = replace(image, noise=noise)
        status = classify(sample, image.noise_sd(sample))
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
        features = Features.of(np.maximum(sample[good], 0.0), brightness=brightness)
        pools = [
            pooled(line, image.noise_sd(line), features, (1, len(line)), ALONG)
            for line in np.split(sample, ends)
        ]
        means, reach = (np.concatenate(lines)[good] for lines in zip(*pools, strict=True))
        means = np.maximum(means, 0.0)
        readings, beyond = choose_representatives(features, means, most, reach, progress)
        count = min(_CHECKED[0], max(_CHECKED[1], len(readings)), len(means))
        results = {
            "noise": np.array([noise.floor, noise.share]),
            "middle": features.middle,
            "directions": features.directions,
            "readings": readings,
            # Spectra beyond are searched themselves.
            "reach": np.array(1.15 * max(beyond, 1.0)),
            "checked": means[np.linspace(0, len(means) - 1, count).astype(int)],
        }
        work.put("survey", results)
    arrays = work.get("survey")
    return Survey(
        noise=Noise(*arrays["noise"].tolist()),
        features=Features(arrays["middle"], arrays["directions"]),
        readings=arrays["readings"],
        reach=float(arrays["reach"]),
        checked=arrays["checked"],
    )


def _sample(
    image: Image, progress: Progress
) -> tuple[PixelReadings, Int[np.ndarray, "ends"], Noise]:
    """Readings of pixels from all over the image that the mask leaves, line by line, where a line
    but the first begins, and the noise of one reading.
    """
    cube = image.cube()
    height, width = cube.shape[:2]
    lines = np.unique(np.linspace(0, height - 1, min(_LINES, height)).astype(int))
    # Some 60 000 pixels in all.
    step = max(1, -(-len(lines) * width // 60_000))
    readings = [np.zeros((0, image.bands.wavelengths.size), np.float32)]
    used = image.used
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
        readings.append(image.means(block))
        # Some thousand spectra are enough to estimate the noise. Bands at a sensor's ends that the
        # map does not use may be noisier, or empty.
        fine = block[:: max(1, len(use) * len(lines) // 4000), used]
        rough.append(fine[np.isfinite(fine).all(axis=1)])
    progress(len(lines), len(lines), "reading")
    noise = image.noise
    if noise is None:
        stored = np.asarray(cube["wavelength"], float)[used]
        noise = spectra_noise(stored, np.concatenate(rough).astype(float)) if rough else Noise()
    return np.concatenate(readings), np.cumsum([len(line) for line in readings])[1:-1], noise
