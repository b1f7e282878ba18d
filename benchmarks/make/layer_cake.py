"""From the ground to the varnish: a stepped panel that shows one coat more at every step.

    python -m benchmarks.make.layer_cake [--out FOLDER] [--size WIDTHxHEIGHT] [--samples N]

Each step is as high as one coat, some thousand times enlarged, and its top shows all coats up to
there: chalk ground; underpaint of white in thick strokes; a yellow glaze; a blue one over it, which
makes green; varnish. The front shows each coat's own paint. Writes docs/layer-cake.png by default.
"""

import numpy as np

from benchmarks.make.props import (
    WAVELENGTHS,
    glazed,
    on_screen,
    picture_options,
    save,
    side_by_side,
    table,
    window,
    wood,
)
from benchmarks.render.strokes import impasto, wiped_glaze
from glazejax.appearance.scene.lights import lamp
from glazejax.appearance.scene.materials import Lambert, Material
from glazejax.appearance.scene.scene import Camera, Scene
from glazejax.appearance.scene.shapes import Box, Plane, Shape

STEPS = ("ground", "underpaint", "first glaze", "second glaze", "varnish")
# Width, depth and height of a step, in the unit of the scene, some 5 cm.
_WIDE, _DEEP, _HIGH = 1.25, 2.3, 0.2
_THICK = 0.05
FIRST, SECOND = ("ChromeYellow", 1.2e-6), ("PrussianBlue", 0.13e-6)
UNDERPAINT = ("LeadWhite", 40e-6)
CAMERA = Camera((-0.3, -8.2, 4.6), (0.0, -0.1, 0.36), field_of_view=46.0)


def scene(width: int, height: int, fine: float = 1.0) -> Scene:
    """The panel on a table by a window."""
    count = len(STEPS)
    columns, rows = int(330 * fine), int(600 * fine)
    # One relief from end to end, so that the strokes go on over the steps.
    relief = impasto(
        rows, columns * (count - 1), swirl=(1.4, -0.6), brush=0.07, strokes=230, seed=4
    )
    first = wiped_glaze(relief, FIRST[1], uneven=0.35, seed=1)
    second = wiped_glaze(relief, SECOND[1], uneven=0.35, seed=2)

    def part(values: np.ndarray, step: int) -> np.ndarray:
        return values[:, (step - 1) * columns : step * columns]

    materials: dict[str, Material] = {
        "wall": Lambert(0.6),
        "table": wood(0.2, dark=3e-6),
        "ground": Lambert(0.69 + 0.1 * (WAVELENGTHS - 400.0) / 300.0),
        "underpaint": glazed([UNDERPAINT], 0.82, None, 0.2),
        "first glaze": glazed([FIRST, UNDERPAINT], 0.82, part(first, 2), 0.2),
        "second glaze": glazed([SECOND, FIRST, UNDERPAINT], 0.82, part(second, 3), 0.2),
        "varnish": glazed([SECOND, FIRST, UNDERPAINT], 0.82, part(second, 4)),
        "side of first glaze": glazed([(FIRST[0], 4e-6), UNDERPAINT], 0.82),
        "side of second glaze": glazed([(SECOND[0], 0.5e-6), UNDERPAINT], 0.82),
        "side of varnish": glazed([("ChromeYellow", 0.1e-6), UNDERPAINT], 0.82),
    }
    shapes: list[Shape] = [
        table("table", (16.0, 9.0), (0.0, -0.5, 0.0)),
        Plane("wall", (0.0, 3.2, 4.0), (0.0, -1.0, 0.0), (30.0, 16.0)),
    ]
    for k, name in enumerate(STEPS):
        # A coat runs from its own step to the far end, below those that come later.
        low, high = (k - count / 2) * _WIDE, count / 2 * _WIDE
        side = name if name in ("ground", "underpaint") else f"side of {name}"
        middle = (0.5 * (low + high), 0.0, (k + 0.5) * _HIGH)
        shapes.append(Box(side, middle, (high - low, _DEEP, _HIGH)))
        top = (low + 0.5 * _WIDE, 0.0, (k + 1) * _HIGH + 0.004)
        heights = None if k == 0 else _THICK * (part(relief, k) - part(relief, k).min())
        shapes.append(Plane(name, top, (0.0, 0.0, 1.0), (_WIDE, _DEEP), (0.0, 1.0, 0.0), heights))
    # One window on the left, and one at the back that the varnish mirrors.
    lights = window((-5.2, -4.4, 4.6), (1.0, 0.7, -0.75), (3.6, 3.6), "D65", 15.0, (2, 2))
    lights += window((1.5, 3.1, 3.5), (0.0, -1.0, 0.0), (3.4, 2.2), "D65", 3.0, (2, 1))
    room = 0.1 * lamp("D65", WAVELENGTHS)
    return Scene(WAVELENGTHS, shapes, materials, lights, CAMERA, width, height, room)


def _across(point: tuple[float, float, float]) -> float:
    """Where a point is seen across the picture, from 0 on the left to 1 on the right."""
    right, _, forward = CAMERA.axes()
    away = np.asarray(point) - np.asarray(CAMERA.position)
    return float(
        0.5 + 0.5 * (away @ right) / (away @ forward) / np.tan(np.deg2rad(CAMERA.field_of_view) / 2)
    )


def main() -> None:
    options, width, height = picture_options(__doc__, "900x480")
    made = scene(width, height, min(1.0, width / 900))
    figure = side_by_side({"": on_screen(made, options.samples, ("D65",))})
    for k, words in enumerate(STEPS):
        middle = ((k + 0.5 - len(STEPS) / 2) * _WIDE, -0.5 * _DEEP, 0.0)
        figure.text(_across(middle), 0.016, words, ha="center")
    save(figure, options.out / "layer-cake.png")


if __name__ == "__main__":
    main()
