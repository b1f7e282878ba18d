"""The scene in lengths that suit Mitsuba, whose camera and rays count some distances in plain
numbers: where the picture begins and ends, and how far from a surface a new ray starts.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ....spectra import Numbers
from ..scene import Scene
from ..shapes import Mesh, Plane, Shape, Sphere, Vector, plane_frame, vector

REACH = 1e3
"""From the camera to the end of all shapes. A ray starts 1e-4 (1 + the largest coordinate) off its
surface: with so large a number, and the camera as origin, that is a share of the distance.
"""


class Placing(NamedTuple):
    """Mitsuba's lengths: the camera is the origin, and shapes reach as far as `REACH`."""

    eye: Vector
    """The camera, in the scene's lengths."""
    unit: float
    """Length of the scene's unit in Mitsuba's lengths."""

    def points(self, points: Numbers) -> Float[np.ndarray, "*points 3"]:
        """Points of the scene in Mitsuba's lengths."""
        return self.unit * (np.asarray(points, float) - self.eye)


def to_scale(scene: Scene) -> Placing:
    """Lengths in which the camera is the origin and the shapes of a scene reach as far as
    `REACH`.
    """
    eye = vector("position", scene.camera.position)
    # Endless planes that the camera lies in reach nowhere: then any unit will do.
    return Placing(eye, REACH / (max(_reach(shape, eye) for shape in scene.shapes) or 1.0))


def _reach(shape: Shape, eye: Vector) -> float:
    """Distance from the eye to the end of a shape, or to an endless plane."""
    if isinstance(shape, Mesh):
        return float(np.linalg.norm(np.asarray(shape.vertices) - eye, axis=1).max())
    if isinstance(shape, Plane):
        away = np.asarray(shape.point, float) - eye
        if shape.size is None:
            return abs(float(away @ plane_frame(shape)[2]))
        return float(np.linalg.norm(away) + np.linalg.norm(shape.size) / 2)
    if isinstance(shape, Sphere):
        half = shape.radius
    else:
        half = np.linalg.norm(np.asarray(shape.size, float)) / 2
    return float(np.linalg.norm(np.asarray(shape.centre, float) - eye) + half)
