"""Thickness maps that look painted: overlapping brush strokes with the marks of bristles, and a primed canvas."""

import numpy as np
from jaxtyping import Float

_STROKES = 46


def _smooth(noise: np.ndarray, width: float) -> np.ndarray:
    """Periodic Gaussian blur along every axis, normalised to unit spread."""
    spectrum = np.fft.fftn(noise)
    for k, n in enumerate(noise.shape):
        line = np.exp(-2.0 * (np.pi * width * np.fft.fftfreq(n)) ** 2)
        spectrum *= line.reshape([-1 if i == k else 1 for i in range(noise.ndim)])
    out = np.fft.ifftn(spectrum).real
    return (out - out.mean()) / out.std()


def brush_strokes(size: int, thickness: float = 1.4e-6, seed: int = 4) -> Float[np.ndarray, "size size"]:
    """Thickness in m of a glaze laid on in curved strokes, each over what is left of those before; thin between."""
    rng = np.random.default_rng(seed)
    y, x = (np.mgrid[0:size, 0:size] + 0.5) / size
    paint = np.zeros((size, size))
    for _ in range(_STROKES):
        centre = rng.uniform(-0.05, 1.05, 2)
        # Strokes follow a swirl around a point off the middle.
        angle = np.arctan2(centre[1] - 0.52, centre[0] - 0.45) + np.pi / 2 + rng.normal(0, 0.25)
        length, width = rng.uniform(0.16, 0.42), rng.uniform(0.035, 0.085)
        dx, dy = x - centre[0], y - centre[1]
        along = dx * np.cos(angle) + dy * np.sin(angle)
        across = dy * np.cos(angle) - dx * np.sin(angle) - rng.uniform(0.2, 0.8) * along**2
        # One track a bristle; the paint runs out towards the end of the stroke.
        tracks = _smooth(rng.normal(size=512), 3.0) * 0.28 + _smooth(rng.normal(size=512), 14.0) * 0.2
        bristle = np.interp(across / width, np.linspace(-1.3, 1.3, 512), tracks)
        left = np.clip(0.75 - 0.55 * along / length, 0.0, 1.3)
        ridge = 0.55 * np.exp(-(((np.abs(across) / width - 0.93) / 0.07) ** 2))
        cover = 0.5 - 0.5 * np.tanh((np.abs(across) / width - 1.0) * 13.0)
        cover *= 0.5 - 0.5 * np.tanh((np.abs(along) - length) * 60.0 + bristle)
        body = np.clip(left * (1.0 + bristle) + ridge * left, 0.0, None)
        paint = paint * (1.0 - 0.55 * cover) + (0.35 + 0.65 * rng.random()) * cover * body
    grain = 1.0 + 0.03 * _smooth(rng.normal(size=(size, size)), 0.7)
    return thickness * np.clip(paint * grain, 0.0, None)


def primed_canvas(size: int, thickness: float = 12e-6, seed: int = 1) -> Float[np.ndarray, "size size"]:
    """Thickness in m of a ground coat over a weave: thin on the threads, with slow variation of the hand."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[0:size, 0:size] / size
    waver = 0.004 * _smooth(rng.normal(size=(size, size)), size / 40)
    threads = np.cos(2 * np.pi * 64 * (x + waver)) * np.cos(2 * np.pi * 64 * (y - waver))
    slow = _smooth(rng.normal(size=(size, size)), size / 9)
    return thickness * np.clip(1.0 + 0.22 * slow + 0.16 * threads, 0.12, None)
