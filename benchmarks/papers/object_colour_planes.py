"""Two joined planes that light each other, ray-traced: paper B's figures 15 and 16.

The scene's own renderer finds which point each ray meets. The planes' material answers there with
the direct light and what comes from the other plane, eq (9), as the paper builds it into its ray
tracer.
"""

from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from benchmarks.papers.object_colour import (
    GRID,
    chromaticity,
    chromaticity_of,
    lamp,
    patches,
    xyz,
)
from benchmarks.papers.object_colour_monitor import MISPRINTED, exposed, loops, measured
from benchmarks.results import Results, quantity
from glazejax.appearance.interreflection import all_bounces, one_bounce
from glazejax.appearance.scene.draw.render import render
from glazejax.appearance.scene.lights import ParallelLight
from glazejax.appearance.scene.materials import Angles, Material
from glazejax.appearance.scene.scene import Camera, Scene
from glazejax.appearance.scene.shapes import Plane

OPENING, WIDTH = 30.0, 20.0
WAYS = ("no bounce", "one bounce", "all bounces")
PLACES = 513
PIXELS = (360, 300)
DISTANCE = 62.0


class Side(Material):
    """One of two joined planes: a spectrum for each distance from the joint, 0 to 1 of the width
    along v.

    Args:
        leaving: (places, bands), light that leaves it over that of a white which faces the light.
        places: (places, 1), the distances from the far edge, first row on top, as maps have them.
    """

    leaving: Float[Array, "places bands"]
    places: Float[Array, "places 1"]

    def spectra(self) -> dict[str, Any]:
        """None on the grid alone."""
        return {}

    @property
    def thickness_map(self) -> Float[Array, "places 1"]:
        """Distance from the joint, in widths."""
        return self.places

    def direct(self, angles: Angles) -> Float[Array, "pairs bands"]:
        """Light that leaves the point, straight lines between the places."""
        at = angles.thickness * (self.leaving.shape[0] - 1)
        low = jnp.clip(jnp.floor(at).astype(int), 0, self.leaving.shape[0] - 2)
        part = (at - low)[:, None]
        return (1 - part) * self.leaving[low] + part * self.leaving[low + 1]


def sides(
    way: str, above: np.ndarray, below: np.ndarray, place: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Light that leaves both planes, (places, bands) each, for light of spectrum 1 along the
    bisector.
    """
    lit = np.sin(np.deg2rad(OPENING / 2))
    if way == "no bounce":
        return np.tile(lit * above, (place.size, 1)), np.tile(lit * below, (place.size, 1))
    bounces = one_bounce if way == "one bounce" else all_bounces
    pair = bounces(above, below, lit, lit, 1.0, place, OPENING)
    return np.asarray(pair.a), np.asarray(pair.b)


def scene(way: str, above: np.ndarray, below: np.ndarray, light: np.ndarray) -> Scene:
    """The planes, joined along x, opened towards a camera and a light on their bisector."""
    half = np.deg2rad(OPENING / 2)
    rows = 2 * PLACES
    distance = 1.0 - (np.arange(rows) + 0.5) / rows
    shapes, materials = [], {}
    for name, leaving, sign in zip(
        ("above", "below"),
        sides(way, above, below, np.linspace(0, 1, PLACES)),
        (1, -1),
        strict=True,
    ):
        along = np.array([0.0, -np.cos(half), sign * np.sin(half)])
        normal = np.array([0.0, -np.sin(half), -sign * np.cos(half)])
        shapes.append(Plane(name, 0.5 * WIDTH * along, normal, size=(4 * WIDTH, WIDTH), up=along))
        materials[name] = Side(jnp.asarray(leaving), jnp.asarray(distance[:, None]))
    return Scene(
        GRID,
        shapes,
        materials,
        [ParallelLight([0.0, 1.0, 0.0], light)],
        Camera([0.0, -DISTANCE, 0.0], field_of_view=17.0),
        width=PIXELS[0],
        height=PIXELS[1],
        antialias=3,
    )


def planes(results: Results) -> dict[str, Any]:
    """Figures 15 and 16, blue-green above and yellow below."""
    results(
        f"\nJoined planes (section 6.3): gamma {OPENING:g} degrees, w {WIDTH:g}, sunlight D55 "
        "along the bisector"
    )
    light = lamp("D55")
    above, below = patches("bluish green", "yellow")
    place = np.linspace(0.0, 1.0, 101)
    product = chromaticity(above * below * light)
    found = {way: [side * light for side in sides(way, above, below, place)] for way in WAYS}
    for way in WAYS[1:]:
        for side, body, label in zip(found[way], (above, below), ("above", "below"), strict=True):
            own, seen = chromaticity(body * light), chromaticity(side)
            distance = np.linalg.norm(seen - product, axis=1)
            along = product - own
            share = (seen - own) @ along / (along @ along)
            off = np.linalg.norm(seen - own - share[:, None] * along, axis=1).max()
            nearer = (
                "nearer at every step"
                if np.all(np.diff(distance) > 0)
                else "not nearer at every step"
            )
            results(
                f"  {way:11} {label}: {share[-1]:.3f} of the way to the product of both at the "
                "outer edge, "
                f"{share[0]:.3f} at the joint, {nearer}; off the segment {off:.0e}"
            )
    results(
        "  paper: colours lie about on the segment and move to the product towards the joint; "
        "ours: so, with one bounce"
    )
    joint = [xyz(found[way][0][0])[1] for way in WAYS]
    results(
        f"  light at the joint of the upper plane: {joint[1] / joint[0]:.2f} times its own with "
        "one bounce, "
        f"{joint[2] / joint[0]:.2f} with all: one bounce misses {1 - joint[1] / joint[2]:.0%}"
    )
    picture = xyz(render(scene("one bounce", above, below, light)).radiance)
    column = picture[:, PIXELS[0] // 2]
    # From the far edge above to the far edge below; dark pixels miss both planes.
    column = column[column[:, 1] > 0.5 * np.median(column[column[:, 1] > 0, 1])]
    results("  Figures 15 and 16, ray-traced with one bounce; down the middle of the picture:")
    straight = [chromaticity(side) for side in found["one bounce"]]
    near = np.concatenate(straight)
    away = np.linalg.norm(chromaticity_of(column)[:, None] - near, axis=-1).min(axis=1)
    results(
        "    distance in xy from the colours of eq (9) at 101 places: "
        f"{np.sort(away)[:-2].max():.4f} at most,\n"
        f"    but for the two pixels that show the joint and both planes: {away.max():.4f}"
    )
    chosen = column[:: max(len(column) // 40, 1)]
    wanted = exposed(chosen, loops()[0].known)
    read, missed = measured(results, "planes", "Figure 16", wanted)
    results.record(planes_misprint=quantity(missed[MISPRINTED].mean(), digits=4))
    return {
        "bodies": [chromaticity(above * light), chromaticity(below * light)],
        "product": product,
        "read": read,
    }
