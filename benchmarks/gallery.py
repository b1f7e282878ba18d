"""The gallery picture of the README: one glaze on a flat swatch, a sphere and a painted canvas, under two lamps.

    python -m benchmarks.gallery [--out FOLDER] [--size WIDTHxHEIGHT]

The glaze is the same everywhere, ultramarine over zinc white; on the canvas its thickness
follows the strokes of a brush. The scene is computed twice, by daylight and by tungsten light, shown as an eye sees it
that is half adapted to that light and half to daylight. Writes docs/gallery.png by default.
"""

import argparse
from pathlib import Path

import numpy as np

import glazejax as gj
from benchmarks.strokes import brush_strokes
from glazejax.appearance.scene.lights import ParallelLight, PointLight, lamp
from glazejax.appearance.scene.materials import Glazed, Lambert
from glazejax.appearance.scene.picture import light_white, picture_xyz, screen_picture
from glazejax.appearance.scene.render import render
from glazejax.appearance.scene.scene import Camera, Scene
from glazejax.appearance.scene.shapes import Plane, Sphere

WAVELENGTHS = np.arange(400.0, 701.0, 10.0)
LAMPS = {"daylight (D65)": "D65", "tungsten (A)": "A"}
TOP, TOP_THICKNESS = "UltramarineBlue", 2.5e-6
BELOW, BELOW_THICKNESS = "ZincWhite", 25e-6
FOLDER = Path(__file__).parents[1] / "docs"


def scene(illuminant: str, width: int, height: int) -> Scene:
    """Swatch, sphere and canvas on a pale table before a grey wall."""
    paints = gj.catalogue.load()
    glaze = gj.Glaze([gj.Layer(paints[TOP], TOP_THICKNESS), gj.Layer(paints[BELOW], BELOW_THICKNESS)], 0.9)
    strokes = brush_strokes(768, 1.0)
    strokes *= 1.1 * TOP_THICKNESS / strokes.mean()
    materials = {
        "table": Lambert(0.62),
        "wall": Lambert(0.42),
        "even": Glazed(glaze),
        "flat": Glazed(glaze, gloss=False),
        "painted": Glazed(glaze, strokes, gloss=False),
    }
    shapes = [
        Plane("table"),
        Plane("wall", (0.0, 2.6, 0.0), (0.0, -1.0, 0.0)),
        Plane("flat", (-2.05, 0.55, 0.84), (0.18, -1.0, 0.2), (1.5, 1.62)),
        Sphere("even", (-0.15, -0.15, 0.78), 0.78),
        Plane("painted", (1.85, 0.6, 0.92), (-0.2, -1.0, 0.2), (1.8, 1.78)),
    ]
    lights = [
        ParallelLight((0.75, 1.0, -1.0), lamp(illuminant, WAVELENGTHS, 0.95)),
        PointLight((3.0, -4.0, 3.0), lamp(illuminant, WAVELENGTHS, 4.0)),
        ParallelLight((-0.1, 1.0, -0.25), lamp(illuminant, WAVELENGTHS, 0.16)),
    ]
    camera = Camera((0.0, -7.6, 2.35), (0.0, 0.3, 0.82), field_of_view=42.0)
    background = 0.4 * lamp(illuminant, WAVELENGTHS)
    return Scene(WAVELENGTHS, shapes, materials, lights, camera, width, height, background)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=FOLDER, help="folder for gallery.png (default: %(default)s)")
    parser.add_argument("--size", default="800x460", help="pixels of each of the two pictures (default: %(default)s)")
    options = parser.parse_args()
    import jax

    jax.config.update("jax_enable_x64", True)
    width, height = (int(part) for part in options.size.split("x"))
    pictures = {}
    for words, illuminant in LAMPS.items():
        made = scene(illuminant, width, height)
        rendered = render(made)
        print(f"{words}\n{rendered.report.describe()}")
        whites = [light_white(lamp(name, WAVELENGTHS), WAVELENGTHS) for name in (illuminant, "D65")]
        white = np.mean(whites, axis=0)
        screen = screen_picture(picture_xyz(rendered, WAVELENGTHS), white)
        print(f"too bright {screen.bright:.1%}, too colourful {screen.colourful:.1%}")
        pictures[words] = screen.rgb
    figure = _figure(pictures)
    options.out.mkdir(parents=True, exist_ok=True)
    figure.savefig(options.out / "gallery.png", dpi=100)
    print(f"written to {options.out / 'gallery.png'}")


def _figure(pictures: dict[str, np.ndarray]):
    """Both pictures side by side, pixel for pixel, with a line of words below each."""
    from matplotlib.figure import Figure

    height, width = next(iter(pictures.values())).shape[:2]
    gap, foot = 12, 30
    size = (len(pictures) * (width + gap) - gap, height + foot)
    figure = Figure(figsize=(size[0] / 100, size[1] / 100))
    for k, (words, picture) in enumerate(pictures.items()):
        left = k * (width + gap)
        axis = figure.add_axes((left / size[0], foot / size[1], width / size[0], height / size[1]))
        axis.imshow(picture, interpolation="nearest")
        axis.set_axis_off()
        figure.text((left + width / 2) / size[0], 0.35 * foot / size[1], words, ha="center", fontsize=11)
    return figure


if __name__ == "__main__":
    main()
