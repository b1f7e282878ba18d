"""The gallery picture of the docs: glazes on thick paint, on a table by a window, and in the
evening by a lamp.

    python -m benchmarks.make.gallery [--out FOLDER] [--size WIDTHxHEIGHT] [--samples N]

Three panels of white impasto stand against a wall, glazed in ultramarine, cochineal and chrome
yellow; the glazes gather in the furrows of the brush and leave the ridges thin. The ball has a
viridian glaze under varnish, the table a brown stain. Mitsuba follows the light (extra `render`),
wavelength by wavelength, through this program's material. Each picture is shown as an eye sees it
that is half adapted to its light and half to daylight. Writes docs/gallery.png by default.
"""

import numpy as np

from benchmarks.make.props import (
    WAVELENGTHS,
    glazed,
    on_screen,
    panel,
    picture_options,
    save,
    side_by_side,
    table,
    window,
    wood,
)
from benchmarks.render.strokes import impasto, wiped_glaze
from glazejax.appearance.scene.lights import AreaLight, Light, lamp
from glazejax.appearance.scene.materials import Lambert, Material
from glazejax.appearance.scene.scene import Camera, Scene
from glazejax.appearance.scene.shapes import Plane, Shape, Sphere

LAMPS = {
    "day": ("D65", "by the window: daylight (D65)"),
    "evening": ("A", "in the evening: tungsten lamp (A)"),
}
WHITE = ("ZincWhite", 60e-6)
# Heights of the strokes in the unit of the scene, some 10 cm.
_THICK = 0.045


def lights(time: str) -> list[Light]:
    """A window on the left by day, a lamp on the right in the evening."""
    name = LAMPS[time][0]
    if time == "day":
        return list(window((-6.2, -5.2, 4.2), (1.0, 0.55, -0.3), (3.2, 4.4), name, 17.0))
    return [AreaLight(Sphere("", (3.4, -4.2, 4.3), 0.45), lamp(name, WAVELENGTHS, 120.0))]


def scene(time: str, width: int, height: int, fine: float = 1.0) -> Scene:
    """Everything in its place; `fine` scales the resolution of relief and maps."""

    def strokes(rows: int, columns: int, **how) -> np.ndarray:
        return impasto(int(rows * fine), int(columns * fine), **how)

    blue = strokes(760, 980, swirl=(0.42, 0.62), brush=0.075, seed=3)
    red = strokes(900, 680, swirl=(0.75, 0.25), brush=0.075, strokes=150, seed=5)
    yellow = strokes(560, 640, swirl=(0.2, 0.2), brush=0.085, strokes=110, seed=8)
    materials: dict[str, Material] = {
        "wall": Lambert(0.6),
        "gesso": Lambert(0.78),
        "table": wood(0.2, dark=3e-6),
        "blue": glazed(
            [("UltramarineBlue", 2e-6), WHITE],
            0.9,
            wiped_glaze(blue, 2.2e-6, uneven=0.5, seed=1),
            0.1,
        ),
        "red": glazed([("Cochineal", 2e-6), WHITE], 0.9, wiped_glaze(red, 2.6e-6, seed=2), 0.1),
        "yellow": glazed(
            [("ChromeYellow", 2e-6), WHITE], 0.9, wiped_glaze(yellow, 1.6e-6, seed=3), 0.1
        ),
        "ball": glazed([("ViridianGreen", 4e-6), WHITE], 0.9),
    }
    shapes: list[Shape] = [
        table("table", (15.0, 7.4), (0.0, -2.9, 0.0)),
        Plane("wall", (0.0, 0.85, 4.0), (0.0, -1.0, 0.0), (30.0, 16.0)),
        *panel("blue", (-1.15, 0.0, 0.0), (3.35, 2.6), _THICK * blue, lean=9.0, turn=2.0),
        *panel("red", (1.65, -0.45, 0.0), (1.75, 2.3), _THICK * red, lean=10.0, turn=-7.0),
        *panel(
            "yellow", (-2.14, -1.05, 0.0), (1.3, 1.14), 0.8 * _THICK * yellow, lean=13.0, turn=14.0
        ),
        Sphere("ball", (0.45, -1.35, 0.46), 0.46),
    ]
    camera = Camera((0.25, -9.4, 2.6), (-0.2, -0.2, 1.2), field_of_view=37.0)
    room = 0.06 * lamp(LAMPS[time][0], WAVELENGTHS)
    return Scene(WAVELENGTHS, shapes, materials, lights(time), camera, width, height, room)


def main() -> None:
    options, width, height = picture_options(__doc__, "760x532")
    pictures = {}
    for time, (illuminant, words) in LAMPS.items():
        made = scene(time, width, height, min(1.0, width / 800))
        pictures[words] = on_screen(made, options.samples, (illuminant, "D65"))
    save(side_by_side(pictures), options.out / "gallery.png")


if __name__ == "__main__":
    main()
