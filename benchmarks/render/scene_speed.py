"""How long a picture of glazed things takes, and how much of the work is skipped.

    python -m benchmarks.render.scene_speed [--out FOLDER]

640 x 480 pixels, 31 bands: a glazed sphere, a glazed box and a canvas with a painted thickness map
on a table, under daylight from a window and a tungsten lamp, with shadows and mirror reflections in
the glossy surfaces. Runs in a fresh
process: first with compilation, then again; the second run is the one that counts. Then the same
with 4 x 4 rays for every pixel, to say what the skipping saves and costs.
"""

import numpy as np

import glazejax as gj
from benchmarks.render.strokes import brush_strokes
from benchmarks.results import Results, command_line, percent, quantity
from benchmarks.timing import peak_memory, time_call
from glazejax.appearance.scene.draw.render import render
from glazejax.appearance.scene.lights import ParallelLight, PointLight, lamp
from glazejax.appearance.scene.materials import Glazed, Lambert
from glazejax.appearance.scene.scene import Camera, Scene
from glazejax.appearance.scene.shapes import Box, Plane, Sphere

WAVELENGTHS = np.arange(400.0, 701.0, 10.0)


def scene(width: int = 640, height: int = 480) -> Scene:
    """Three glazed things on a table."""
    paints = gj.catalogue.load()

    def glaze(*coats: tuple[str, float]) -> gj.Glaze:
        return gj.Glaze([gj.Layer(paints[name], thickness) for name, thickness in coats], 0.85)

    strokes = brush_strokes(512)
    materials = {
        "table": Lambert(0.45),
        "blue": Glazed(glaze(("UltramarineBlue", 4e-6), ("ZincWhite", 20e-6))),
        "red": Glazed(glaze(("Eosin", 2e-6), ("ChromeYellow", 20e-6))),
        "canvas": Glazed(
            glaze(("UltramarineBlue", 1.4e-6), ("ChromeYellow", 12e-6)), strokes, gloss=False
        ),
    }
    shapes = [
        Plane("table"),
        Plane("canvas", (0.0, 1.7, 1.25), (0.0, -1.0, 0.15), (2.5, 2.5)),
        Sphere("blue", (-1.15, 0.0, 0.65), 0.65),
        Box("red", (1.05, 0.0, 0.45), (0.9, 0.9, 0.9), (0.0, 0.0, 30.0)),
    ]
    lights = [
        ParallelLight((0.7, 1.0, -1.0), lamp("D65", WAVELENGTHS, 0.75)),
        PointLight((3.0, -3.0, 3.5), lamp("A", WAVELENGTHS, 4.0)),
    ]
    camera = Camera((0.0, -7.0, 2.6), (0.0, 0.4, 0.95), field_of_view=34.0)
    background = 0.25 * lights[0].spectrum
    return Scene(WAVELENGTHS, shapes, materials, lights, camera, width, height, background)


def main() -> None:
    options = command_line(__doc__).parse_args()
    import jax

    jax.config.update("jax_enable_x64", True)
    results = Results("scene_speed", options.out)
    made = scene(160, 120) if options.quick else scene()
    size = f"{made.width} x {made.height} pixels"
    results(f"{size}, 31 bands, three glazed things, two lights, 4 x 4 rays where there is an edge")
    _, first = time_call(lambda: render(made))
    rendered, again = time_call(lambda: render(made))
    results(f"first, with compilation: {first:.1f} s\nagain: {again:.1f} s")
    for line in rendered.report.describe().splitlines():
        results(f"  {line}")
    peak = peak_memory() / 2**30
    results(f"peak memory {peak:.2f} GiB")
    full, seconds = time_call(lambda: render(made, adaptive=False))
    error = np.abs(full.radiance - rendered.radiance).mean() / full.radiance.mean()
    results(
        f"4 x 4 rays for every pixel: {seconds:.1f} s; mean difference of the two pictures "
        f"{error:.2%} of the mean"
    )
    results.record(
        first=quantity(first, "s", 1),
        again=quantity(again, "s", 1),
        left_out=percent(rendered.report.saved),
        full=quantity(seconds, "s", 1),
        apart=percent(error, 2),
        times=quantity(seconds / again, "times", 2, form="g"),
    )
    results.save()


if __name__ == "__main__":
    main()
