"""What the pictures of the docs are put together from: a window, painted panels, a wooden table;
and how they are drawn.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

import glazejax as gj
from benchmarks.render.strokes import wood_grain
from benchmarks.results import help_parser
from glazejax.appearance.scene.lights import AreaLight, lamp
from glazejax.appearance.scene.materials import Glazed
from glazejax.appearance.scene.path.path_trace import path_trace
from glazejax.appearance.scene.picture import light_white, picture_xyz, screen_picture
from glazejax.appearance.scene.scene import Scene
from glazejax.appearance.scene.shapes import Box, Plane, Shape, rotation

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FOLDER = Path(__file__).parents[2] / "docs"
WAVELENGTHS = np.arange(400.0, 701.0, 10.0)
# Of a glaze's reflectance factor: less than a step of a screen.
TOLERANCE = 3e-3


def glazed(
    described: Sequence[tuple[str, float]],
    ground: float = 0.9,
    thickness: Float[np.ndarray, "h w"] | None = None,
    roughness: float = 0.0,
    layer: int = 0,
) -> Glazed:
    """A material of coats of catalogue paints, top first, a name and a thickness in m each, on a
    ground; `thickness` is the map of one of them.
    """
    paints = gj.catalogue.load()
    coats = [gj.Layer(paints[name], thick) for name, thick in described]
    return Glazed(gj.Glaze(coats, ground), thickness, layer, True, roughness)


def window(
    middle: Sequence[float],
    normal: Sequence[float],
    size: tuple[float, float],
    illuminant: str,
    strength: float,
    panes: tuple[int, int] = (2, 3),
    bar: float = 0.14,
) -> list[AreaLight]:
    """Panes of a window side by side and one above the other, with bars between them."""
    spectrum = lamp(illuminant, WAVELENGTHS, strength)
    out = np.asarray(normal, float) / np.linalg.norm(normal)
    right = np.cross((0.0, 0.0, 1.0), out)
    right /= np.linalg.norm(right)
    up = np.cross(out, right)
    width, height = (
        (side - (count - 1) * bar) / count for side, count in zip(size, panes, strict=True)
    )
    lights = []
    for across in range(panes[0]):
        for high in range(panes[1]):
            x = (across - (panes[0] - 1) / 2) * (width + bar)
            z = (high - (panes[1] - 1) / 2) * (height + bar)
            place = np.asarray(middle, float) + x * right + z * up
            lights.append(AreaLight(Plane("", place, out, (width, height)), spectrum))
    return lights


def panel(
    face: str,
    foot: Sequence[float],
    size: tuple[float, float],
    relief: Float[np.ndarray, "h w"],
    *,
    lean: float,
    turn: float,
) -> list[Shape]:
    """A panel that stands on its lower edge: a box of gesso, and on its front a plane of
    material `face`.

    Args:
        face: material.
        foot: middle of the lower edge in front.
        size: width and height.
        relief: heights of the front.
        lean: degrees that it leans back, away from the viewer at negative y.
        turn: degrees about the vertical, counter-clockwise seen from above.
    """
    thick = 0.14
    angles = (-lean, 0.0, turn)
    about = rotation(angles)
    _, back, up = about.T
    front = np.asarray(foot, float) + 0.5 * size[1] * up
    # The relief stands clear of the box even where it is sunk.
    clear = 0.004 + max(0.0, -float(relief.min()))
    return [
        Box("gesso", front + 0.5 * thick * back, (size[0], thick, size[1]), angles),
        Plane(face, front - clear * back, -back, size, up, relief),
    ]


def table(
    material: str, size: tuple[float, float], middle: Sequence[float] = (0.0, 0.0, 0.0)
) -> Plane:
    """A table top that lies flat, its boards along x."""
    return Plane(material, middle, (0.0, 0.0, 1.0), size, (0.0, 1.0, 0.0))


def wood(roughness: float = 0.25, *, dark: float = 7e-6, boards: int = 5, seed: int = 2) -> Glazed:
    """Stained boards: a brown stain, thicker where the grain is dark, on pale wood."""
    paints = gj.catalogue.load()
    shares = {"ChromeYellow": 0.34, "Vermillion": 0.46, "BoneBlack": 0.20}
    stain = gj.Mixture([paints[name] for name in shares], list(shares.values()))
    grain = wood_grain(900, 1400, boards=boards, seed=seed)
    return Glazed(gj.Glaze([gj.Layer(stain, dark)], 0.55), dark * grain, 0, True, roughness)


def picture_options(words: str | None, size: str) -> tuple[argparse.Namespace, int, int]:
    """Options of a program that draws one picture, and width and height in pixels."""
    parser = help_parser(words, FOLDER)
    parser.add_argument("--size", default=size, help="pixels of a picture (default: %(default)s)")
    parser.add_argument(
        "--samples", type=int, default=256, help="rays of a pixel (default: %(default)s)"
    )
    options = parser.parse_args()
    import jax

    jax.config.update("jax_enable_x64", True)
    width, height = map(int, options.size.split("x"))
    return options, width, height


def on_screen(
    scene: Scene, samples: int, adapted: Sequence[str]
) -> Float[np.ndarray, "height width 3"]:
    """A scene as an eye sees it that is adapted to the mean of some illuminants."""
    rendered = path_trace(scene, samples=samples, tolerance=TOLERANCE)
    print(rendered.report.describe())
    whites = [light_white(lamp(name, WAVELENGTHS), WAVELENGTHS) for name in adapted]
    screen = screen_picture(picture_xyz(rendered, WAVELENGTHS), np.mean(whites, axis=0))
    print(f"too bright {screen.bright:.1%}, too colourful {screen.colourful:.1%}")
    return screen.rgb


def side_by_side(pictures: dict[str, np.ndarray]) -> "Figure":
    """Pictures in a row, pixel for pixel, with a line of words below each."""
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
        middle = (left + width / 2) / size[0], 0.35 * foot / size[1]
        figure.text(*middle, words, ha="center", fontsize=11)
    return figure


def save(figure: "Figure", path: Path) -> None:
    """Write a picture; its folder is made if it is not there."""
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=100)
    print(f"written to {path}")
