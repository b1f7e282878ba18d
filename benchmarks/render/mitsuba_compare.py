"""The ray caster compared with Mitsuba 3: the same scenes, direct light, pixel by pixel.

    python -m benchmarks.render.mitsuba_compare [--out FOLDER] [--samples N]

Four scenes: diffuse things with shadows of a parallel and a point light; a polished copper ball
over a diffuse floor (a path of two, so that Mitsuba adds no light between diffuse things); a glazed
sphere and a glazed box; a sphere and a box whose top glaze has a map of its thickness. All
have direct light alone. Glazes are those of the plugin
`glazejax.appearance.mitsuba`, and Mitsuba is asked as `glazejax scene --renderer mitsuba` asks it.
Both programs give XYZ of every pixel. Prints the mean of the absolute differences of Y and the
difference of the means, as shares of the mean of the image, and the first also on the pixels of the
objects alone.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

import glazejax as gj
from benchmarks.render.strokes import brush_strokes
from benchmarks.results import Results, command_line, quantities
from benchmarks.timing import time_call
from glazejax.appearance.metals import metal
from glazejax.appearance.mitsuba.variants import usable_variant
from glazejax.appearance.scene.draw.intersect import make_geometry
from glazejax.appearance.scene.draw.rays import lamps, trace
from glazejax.appearance.scene.draw.render import render
from glazejax.appearance.scene.lights import ParallelLight, PointLight
from glazejax.appearance.scene.materials import Conductor, Glazed, Lambert, Material
from glazejax.appearance.scene.path.path_trace import PathTraced, path_trace
from glazejax.appearance.scene.scene import Camera, Scene
from glazejax.appearance.scene.shapes import Box, Plane, Shape, Sphere

NEEDS = ("mitsuba",)

WAVELENGTHS = np.arange(400.0, 701.0, 10.0)


LIMIT = 0.01
"""The most that the two may differ."""


class Case(NamedTuple):
    """A scene, and how far Mitsuba follows paths in it."""

    scene: Scene
    max_depth: int


def cases(width: int = 96, height: int = 72) -> dict[str, Case]:
    """Scenes that both programs compute in full."""
    light = np.ones_like(WAVELENGTHS)
    ramp = (WAVELENGTHS - 400) / 300
    paints = gj.catalogue.load()
    blue, white = paints["UltramarineBlue"], paints["ZincWhite"]
    glaze = gj.Glaze([gj.Layer(blue, 3e-6), gj.Layer(white, 20e-6)], 0.8)
    red = gj.Glaze([gj.Layer(paints["Eosin"], 3e-6), gj.Layer(paints["ChromeYellow"], 20e-6)], 0.8)
    copper = metal("copper", WAVELENGTHS)
    camera = Camera((0.0, -6.0, 2.5), (0.0, 0.0, 0.6), field_of_view=40.0)
    floor = Plane("floor", size=(8.0, 8.0), up=(0.0, 1.0, 0.0))
    lights = [
        ParallelLight((0.6, 1.0, -1.2), 0.6 * light),
        PointLight((-2.0, -2.0, 3.5), 5.0 * light),
    ]

    def scene(shapes: list[Shape], materials: dict[str, Material]) -> Scene:
        base = {"floor": Lambert(0.5 + 0.2 * ramp)}
        return Scene(WAVELENGTHS, [floor, *shapes], base | materials, lights, camera, width, height)

    ball = Sphere("ball", (-0.8, 0.0, 0.8), 0.8)
    block = Box("block", (1.2, 0.3, 0.5), (1.0, 1.0, 1.0), (0.0, 0.0, 35.0))
    diffuse: dict[str, Material] = {
        "ball": Lambert(0.1 + 0.6 * ramp),
        "block": Lambert(0.7 - 0.5 * ramp),
    }
    metals: dict[str, Material] = {"ball": Conductor(copper.refractive_index, copper.extinction)}
    glazes: dict[str, Material] = {
        "ball": Glazed(glaze, gloss=False),
        "block": Glazed(red, gloss=False),
    }
    mapped: dict[str, Material] = {
        "ball": Glazed(glaze, brush_strokes(200, 3e-6), 0, gloss=False),
        "block": Glazed(red, 1e-6 + brush_strokes(200, 3e-6, seed=2), 0, gloss=False),
    }
    return {
        "diffuse": Case(scene([ball, block], diffuse), 2),
        "copper": Case(scene([ball], metals), 3),
        "glaze": Case(scene([ball, block], glazes), 2),
        "map": Case(scene([ball, block], mapped), 2),
    }


def linear_weights(wavelengths: Float[np.ndarray, "bands"]) -> Float[np.ndarray, "bands 3"]:
    """Weights of XYZ for spectra that are linear between bands and repeat the end bands beyond, as
    Mitsuba takes them.
    """
    import colour

    cmfs = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    # Mitsuba follows 360 to 830 nm.
    fine = np.linspace(360.0, 830.0, 47001)
    matching = np.stack(
        [np.interp(fine, cmfs.wavelengths, values) for values in cmfs.values.T], axis=1
    )
    hats = np.stack([np.interp(fine, wavelengths, unit) for unit in np.eye(wavelengths.size)])
    whole = np.trapezoid(cmfs.values[:, 1], cmfs.wavelengths)
    return np.trapezoid(hats[:, :, None] * matching[None], fine, axis=1) / whole


def ours(case: Case, antialias: int = 16) -> Float[np.ndarray, "h w 3"]:
    """XYZ by this program, many rays for each pixel."""
    scene = replace(case.scene, antialias=antialias)
    drawn = render(scene, adaptive=False, tolerance=1e-4)
    return drawn.radiance @ linear_weights(drawn.wavelengths)


def theirs(case: Case, samples: int) -> PathTraced:
    """XYZ by Mitsuba, and its report."""
    return path_trace(
        case.scene, samples=samples, max_depth=case.max_depth, background=False, tolerance=1e-4
    )


def differences(
    one: np.ndarray, two: np.ndarray, mask: np.ndarray | None = None
) -> tuple[float, float]:
    """Mean absolute difference and difference of means of Y, as shares of the mean of the second.

    `mask` (h, w) says which pixels count; all by default.
    """
    first, second = (image[..., 1] if mask is None else image[mask, 1] for image in (one, two))
    mean = second.mean()
    return float(np.abs(first - second).mean() / mean), float((first - second).mean() / mean)


def on_objects(case: Case) -> np.ndarray:
    """Pixels (h, w) in whose middle something else than the floor, the first of several shapes, is
    seen.
    """
    scene = case.scene
    pixels = np.arange(scene.width * scene.height)
    rays = scene.rays(pixels % scene.width + 0.5, pixels // scene.width + 0.5)
    level = trace(
        make_geometry(scene.shapes, scene.materials),
        lamps(scene.lights),
        *rays,
        reflects=lambda number, cosines: 0 * cosines,
        most_bounces=0,
    )[0]
    return (level.shape >= min(1, len(scene.shapes) - 1)).reshape(scene.height, scene.width)


def main() -> None:
    samples = (1024, 16, "rays of a pixel in Mitsuba")
    options = command_line(__doc__, samples=samples).parse_args()
    import jax

    jax.config.update("jax_enable_x64", True)

    results = Results("mitsuba_compare", options.out, "mitsuba")
    words = (
        f"{usable_variant()}, {options.samples} samples a pixel or a few more; glazejax 16 x 16 "
        "rays a pixel"
    )
    results(f"Mitsuba in {words}")
    titles = ("mean |difference|", "on objects alone", "difference of means", "noise of a pixel")
    results(
        f"{'scene':10}"
        + "".join(f"{t:>21}" for t in titles)
        + f"{'limit':>9}{'ours s':>9}{'theirs s':>9}"
    )
    shares = []
    for name, case in cases().items():
        mine, own_seconds = time_call(lambda c=case: ours(c))
        traced, seconds = time_call(lambda c=case: theirs(c, options.samples))
        other = traced.values
        mean, bias = differences(mine, other)
        times = f"{own_seconds:9.1f}{seconds:9.1f}"
        noise = traced.report.pixel_noise
        alone = differences(mine, other, on_objects(case))[0]
        shares.append((mean, alone, noise))
        results(f"{name:10}{mean:21.3%}{alone:21.3%}{bias:21.3%}{noise:21.3%}{LIMIT:9.0%}{times}")
    for key, values in zip(("", "things_", "noise_"), 100.0 * np.array(shares).T, strict=True):
        named = {f"{key}least": values.min(), f"{key}most": values.max()}
        results.record(**quantities(named, "%", n=len(values)))
    results.save()


if __name__ == "__main__":
    main()
