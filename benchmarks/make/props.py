"""What the pictures of the docs are put together from: a window, painted panels, a
wooden table.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

import glazejax as gj
from benchmarks.render.strokes import wood_grain
from glazejax.appearance.scene.lights import AreaLight, lamp
from glazejax.appearance.scene.materials import Glazed
from glazejax.appearance.scene.shapes import Box, Plane, Shape, rotation

WAVELENGTHS = np.arange(400.0, 701.0, 10.0)
# Of a glaze's reflectance factor: less than a step of a screen.
TOLERANCE = 3e-3


def coats(*described: tuple[str, float]) -> list[gj.Layer]:
    """Coats of catalogue paints, top first: a name and a thickness in m each."""
    paints = gj.catalogue.load()
    return [gj.Layer(paints[name], thickness) for name, thickness in described]


def glazed(
    described: Sequence[tuple[str, float]],
    ground: float = 0.9,
    thickness: Float[np.ndarray, "h w"] | None = None,
    roughness: float = 0.0,
    layer: int = 0,
) -> Glazed:
    """A material of coats, top first, on a ground; `thickness` is the map of one of them."""
    return Glazed(gj.Glaze(coats(*described), ground), thickness, layer, True, roughness)


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
    edge: str,
    face: str,
    foot: Sequence[float],
    size: tuple[float, float],
    *,
    lean: float = 0.0,
    turn: float = 0.0,
    thick: float = 0.14,
    relief: Float[np.ndarray, "h w"] | None = None,
) -> list[Shape]:
    """A panel that stands on its lower edge: a box of material `edge`, and on its front a plane of
    material `face`.

    Args:
        edge, face: materials.
        foot: middle of the lower edge in front.
        size: width and height.
        lean: degrees that it leans back, away from the viewer at negative y.
        turn: degrees about the vertical, counter-clockwise seen from above.
        thick: of the box.
        relief: heights of the front.
    """
    angles = (-lean, 0.0, turn)
    about = rotation(angles)
    _, back, up = about.T
    front = np.asarray(foot, float) + 0.5 * size[1] * up
    # The relief stands clear of the box even where it is sunk.
    clear = 0.004 + (0.0 if relief is None else max(0.0, -float(relief.min())))
    return [
        Box(edge, front + 0.5 * thick * back, (size[0], thick, size[1]), angles),
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
