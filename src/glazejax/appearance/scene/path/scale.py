"""The scene in lengths that suit Mitsuba, whose camera and rays count some distances in plain
numbers: where the picture begins and ends, and how far from a surface a new ray starts.
"""

from dataclasses import replace

import numpy as np

from ..lights import AreaLight, Light, PointLight
from ..scene import Scene
from ..shapes import Mesh, Plane, Shape, Sphere, Vector, plane_frame, vector

REACH = 1e3
"""From the camera to the end of all shapes. A ray starts 1e-4 (1 + the largest coordinate) off its
surface: with so large a number, and the camera as origin, that is a share of the distance.
"""


def to_scale(scene: Scene) -> tuple[Scene, float]:
    """The scene with the camera at the origin and shapes that reach as far as `REACH`.

    Returns:
        The scene, and the length of the old unit in it.
    """
    camera = scene.camera
    eye = vector("position", camera.position)
    # Endless planes that the camera lies in reach nowhere: then any unit will do.
    unit = REACH / (max(_reach(shape, eye) for shape in scene.shapes) or 1.0)
    moved = replace(
        scene,
        shapes=[_moved(shape, eye, unit) for shape in scene.shapes],
        lights=[_moved_light(light, eye, unit) for light in scene.lights],
        camera=replace(camera, position=(0.0, 0.0, 0.0), target=camera.axes()[2]),
    )
    return moved, unit


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


def _moved(shape: Shape, eye: Vector, unit: float) -> Shape:
    if isinstance(shape, Mesh):
        return replace(shape, vertices=unit * (np.asarray(shape.vertices) - eye))
    if isinstance(shape, Plane):
        return replace(
            shape,
            point=unit * (np.asarray(shape.point, float) - eye),
            size=None if shape.size is None else [unit * side for side in shape.size],
            relief=None if shape.relief is None else unit * np.asarray(shape.relief, float),
        )
    centre = unit * (np.asarray(shape.centre, float) - eye)
    if isinstance(shape, Sphere):
        return replace(shape, centre=centre, radius=unit * shape.radius)
    return replace(shape, centre=centre, size=unit * np.asarray(shape.size, float))


def _moved_light(light: Light, eye: Vector, unit: float) -> Light:
    if isinstance(light, AreaLight):
        return replace(light, shape=_moved(light.shape, eye, unit))
    if isinstance(light, PointLight):
        # Its strength is that at a distance of one unit.
        return replace(
            light,
            position=unit * (np.asarray(light.position, float) - eye),
            spectrum=unit**2 * np.asarray(light.spectrum, float),
        )
    return light
