"""Shapes of a scene, and the checks of points, directions and sizes that all parts of a scene
share.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from jaxtyping import Float, Int

from ...spectra import Numbers

Vector: TypeAlias = Float[np.ndarray, "3"]
"""A point or a direction."""

# A relief becomes two triangles a height; this many fill some gigabytes.
MOST_HEIGHTS = 1 << 24

# Products of a few lengths of this still have room in a float, and no scene is as wide.
_FURTHEST = 1e30


def vector(name: str, values: Numbers, *, direction: bool = False) -> Vector:
    """Three finite numbers; with `direction` of length 1 in the end.

    Raises:
        ValueError: other than three numbers, numbers beyond 1e30, or a direction of no length.
    """
    try:
        numbers = np.asarray(values, float)
    except (TypeError, ValueError):
        raise ValueError(f"{name} must be three numbers, not {values!r}") from None
    if numbers.shape != (3,) or not np.all(np.isfinite(numbers)):
        raise ValueError(f"{name} must be three finite numbers, not {values!r}")
    if np.abs(numbers).max() > _FURTHEST:
        raise ValueError(f"{name} must be numbers up to {_FURTHEST:g}, not {values!r}")
    if not direction:
        return numbers
    length = float(np.linalg.norm(numbers))
    if length == 0:
        raise ValueError(f"{name} is (0, 0, 0), which is no direction")
    return numbers / length


def positive(name: str, value: float) -> float:
    """A number above zero, up to 1e30.

    Raises:
        ValueError: anything else.
    """
    number = isinstance(value, int | float | np.number) and not isinstance(value, bool)
    if not number or not 0 < float(value) < np.inf:
        raise ValueError(f"{name} must be a number above 0, not {value!r}")
    if value > _FURTHEST:
        raise ValueError(f"{name} must be a number up to {_FURTHEST:g}, not {value!r}")
    return float(value)


def whole(name: str, value: int, low: int, high: int) -> int:
    """A whole number from `low` to `high`.

    Raises:
        ValueError: anything else.
    """
    number = isinstance(value, int | np.integer) and not isinstance(value, bool)
    if not number or not low <= value <= high:
        raise ValueError(f"{name} must be a whole number from {low} to {high}, not {value!r}")
    return int(value)


@dataclass(frozen=True)
class Sphere:
    """A ball; u runs once around its z axis, v from its lowest point (0) to its highest (1).

    Args:
        material: name of its material.
        centre: (3,), in the unit of length of the scene.
        radius: above 0, in that unit.

    Raises:
        ValueError: a radius that is not above 0, or a centre that is no point.
    """

    material: str
    centre: Numbers = (0.0, 0.0, 0.0)
    radius: float = 1.0

    def __post_init__(self) -> None:
        vector("centre", self.centre)
        positive("radius", self.radius)


@dataclass(frozen=True)
class Plane:
    """A plane through a point, endless or a rectangle; u and v run from 0 to 1 across the
    rectangle.

    Args:
        material: name of its material.
        point: the centre of the rectangle, or any point of an endless plane.
        normal: the side that is painted; the other side looks the same.
        size: width and height of the rectangle; None for an endless plane, whose u and v count
            units of length.
        up: direction of the height, as far as it lies in the plane; any if it is along the normal.
        relief: (h, w), how far the surface stands out along the normal, below 0 for what is sunk,
            in the unit of length of the scene; the first row is on top and the outermost values lie
            on the rim. For `path_trace` alone.

    Raises:
        ValueError: a vector that is none, a size that is not above 0, or a relief that is no such
            map or has no size to lie on.
    """

    material: str
    point: Numbers = (0.0, 0.0, 0.0)
    normal: Numbers = (0.0, 0.0, 1.0)
    size: Sequence[float] | None = None
    up: Numbers = (0.0, 0.0, 1.0)
    relief: np.ndarray | None = None

    def __post_init__(self) -> None:
        vector("point", self.point)
        vector("normal", self.normal, direction=True)
        vector("up", self.up, direction=True)
        if self.size is not None:
            if not isinstance(self.size, Sequence | np.ndarray) or len(self.size) != 2:
                raise ValueError(f"size must be a width and a height, not {self.size!r}")
            for value in self.size:
                positive("size", value)
        if self.relief is None:
            return
        check_relief(self.relief)
        if self.size is None:
            raise ValueError("a plane with a relief needs a size, its width and height")


def check_relief(relief: np.ndarray) -> None:
    """Refuse what is no map of heights.

    Raises:
        ValueError: not two-dimensional, smaller than 2 x 2, too large, or not finite.
    """
    shape = np.shape(relief)
    if len(shape) != 2 or min(shape) < 2:
        raise ValueError(
            f"a relief must be a map of heights (h, w), at least 2 x 2, not of shape {shape}"
        )
    if shape[0] * shape[1] > MOST_HEIGHTS:
        raise ValueError(
            f"a relief of {shape[0]} x {shape[1]} heights is too fine (at most {MOST_HEIGHTS} in "
            "all)"
        )
    if not np.all(np.isfinite(relief)):
        raise ValueError("a relief must hold finite heights; some are not")


@dataclass(frozen=True)
class Box:
    """A box with sides along the axes, turned about its centre; u and v run from 0 to 1 across each
    face.

    Args:
        material: name of its material.
        centre: its centre.
        size: full length of its sides.
        rotation: degrees about x, then y, then z.

    Raises:
        ValueError: a vector that is none, or a size that is not above 0.
    """

    material: str
    centre: Numbers = (0.0, 0.0, 0.0)
    size: Numbers = (1.0, 1.0, 1.0)
    rotation: Numbers = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        vector("centre", self.centre)
        vector("rotation", self.rotation)
        for value in vector("size", self.size):
            positive("size", value)


@dataclass(frozen=True)
class Mesh:
    """Triangles; `glazejax.appearance.scene.mesh.read_mesh` reads them from a file.

    Args:
        material: name of its material.
        vertices: (vertices, 3).
        faces: (faces, 3), numbers of the vertices.
        normals: (vertices, 3), for shading that hides the edges; None for flat faces.
        uv: (vertices, 2), coordinates in a thickness map; None if there are none.

    Raises:
        ValueError: arrays of other shapes, no triangle at all, or a face of a vertex that does not
            exist.
    """

    material: str
    vertices: Float[np.ndarray, "vertices 3"]
    faces: Int[np.ndarray, "faces 3"]
    normals: Float[np.ndarray, "vertices 3"] | None = None
    uv: Float[np.ndarray, "vertices 2"] | None = None

    def __post_init__(self) -> None:
        vertices = np.asarray(self.vertices)
        faces = np.asarray(self.faces)
        if vertices.ndim != 2 or vertices.shape[1] != 3 or not np.all(np.isfinite(vertices)):
            raise ValueError(
                f"vertices must be finite points (vertices, 3), not of shape {vertices.shape}"
            )
        if faces.ndim != 2 or faces.shape[1] != 3 or len(faces) == 0:
            raise ValueError(f"faces must be triangles (faces, 3), not of shape {faces.shape}")
        if not np.issubdtype(faces.dtype, np.integer):
            raise ValueError(
                f"faces must be whole numbers, those of the vertices, not {faces.dtype}"
            )
        wrong = faces[(faces < 0) | (faces >= len(vertices))]
        if wrong.size:
            raise ValueError(
                f"a face names vertex {wrong[0]}, but they are 0 to {len(vertices) - 1}"
            )
        for name, values, width in (("normals", self.normals, 3), ("uv", self.uv, 2)):
            if values is not None and np.shape(values) != (len(vertices), width):
                raise ValueError(
                    f"{name} must be ({len(vertices)}, {width}), not {np.shape(values)}"
                )

    def __repr__(self) -> str:
        return (
            f"Mesh(material={self.material!r}, {len(self.vertices)} vertices, {len(self.faces)} "
            "faces)"
        )


Shape = Sphere | Plane | Box | Mesh
"""What a scene is made of."""


def plane_frame(plane: Plane) -> np.ndarray:
    """Unit vectors along the width, along the height, and the normal, in rows."""
    normal = vector("normal", plane.normal, direction=True)
    guides = np.array([plane.up, [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]], float)
    # What of each guide lies in the plane.
    heights = guides - np.outer(guides @ normal, normal)
    lengths = np.linalg.norm(heights, axis=1)
    # The first guide that does not run along the normal.
    first = (lengths > 1e-6 * np.linalg.norm(guides, axis=1)).argmax()
    height = heights[first] / lengths[first]
    return np.stack([np.cross(height, normal), height, normal])


def rotation(degrees: Numbers) -> Float[np.ndarray, "3 3"]:
    """Matrix of rotations about x, then y, then z; it turns column vectors."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_euler("xyz", np.asarray(degrees, float), degrees=True).as_matrix()
