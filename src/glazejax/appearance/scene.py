"""What a scene is: shapes, materials, lights and a camera, checked when it is made.

Coordinates are right-handed, in any unit of length; z is up in the examples. Light is counted on the scale of the
lamp: a perfect white that faces a light of strength 1 has the spectrum of the light itself, whose luminance is 1.
`glazejax.appearance.scene_render.render` makes the picture, `glazejax.appearance.scene_file.read_scene` reads a file.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int

from ..spectra import Grid, Numbers, concrete, validate_wavelengths
from .raycast_shapes import Geometry, make_geometry
from .scene_materials import Conductor, Glazed, Lambert, Material, Phong

__all__ = [
    "Box",
    "Camera",
    "Conductor",
    "Glazed",
    "Lambert",
    "Material",
    "Mesh",
    "ParallelLight",
    "Phong",
    "Plane",
    "PointLight",
    "Scene",
    "Sphere",
]

# Pictures beyond are a slip of the hand: 100 megapixels of 31 bands fill the memory of a workstation.
_MOST_PIXELS = 10**8


def vector(name: str, values: Numbers, *, direction: bool = False) -> Float[np.ndarray, "3"]:
    """Three finite numbers; with `direction` of length 1 in the end.

    Raises:
        ValueError: other than three numbers, or a direction of no length.
    """
    try:
        found = np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        raise ValueError(f"{name} must be three numbers, not {values!r}") from None
    if found.shape != (3,) or not np.all(np.isfinite(found)):
        raise ValueError(f"{name} must be three finite numbers, not {values!r}")
    if not direction:
        return found
    length = float(np.linalg.norm(found))
    if length == 0:
        raise ValueError(f"{name} is (0, 0, 0), which is no direction")
    return found / length


def positive(name: str, value: float) -> float:
    """A finite number above zero.

    Raises:
        ValueError: anything else.
    """
    number = isinstance(value, int | float | np.number) and not isinstance(value, bool)
    if not number or not 0 < float(value) < np.inf:
        raise ValueError(f"{name} must be a number above 0, not {value!r}")
    return float(value)


@dataclass(frozen=True)
class Sphere:
    """A ball; u runs once around its z axis, v from its lowest point (0) to its highest (1).

    Raises:
        ValueError: a radius that is not above 0, or a centre that is no point.
    """

    material: str
    centre: Numbers = (0.0, 0.0, 0.0)
    radius: float = 1.0

    def __post_init__(self):
        vector("centre", self.centre)
        positive("radius", self.radius)


@dataclass(frozen=True)
class Plane:
    """A plane through a point, endless or a rectangle; u and v run from 0 to 1 across the rectangle.

    Args:
        material: name of its material.
        point: the centre of the rectangle, or any point of an endless plane.
        normal: the side that is painted; the other side looks the same.
        size: width and height of the rectangle; None for an endless plane, whose u and v count units of length.
        up: direction of the height, as far as it lies in the plane; any if it is along the normal.

    Raises:
        ValueError: a vector that is none, or a size that is not above 0.
    """

    material: str
    point: Numbers = (0.0, 0.0, 0.0)
    normal: Numbers = (0.0, 0.0, 1.0)
    size: Sequence[float] | None = None
    up: Numbers = (0.0, 0.0, 1.0)

    def __post_init__(self):
        vector("point", self.point)
        vector("normal", self.normal, direction=True)
        vector("up", self.up, direction=True)
        if self.size is not None:
            if not isinstance(self.size, Sequence | np.ndarray) or len(self.size) != 2:
                raise ValueError(f"size must be a width and a height, not {self.size!r}")
            for value in self.size:
                positive("size", value)


@dataclass(frozen=True)
class Box:
    """A box with sides along the axes, turned about its centre; u and v run from 0 to 1 across each face.

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

    def __post_init__(self):
        vector("centre", self.centre)
        vector("rotation", self.rotation)
        for value in vector("size", self.size):
            positive("size", value)


@dataclass(frozen=True)
class Mesh:
    """Triangles; `glazejax.appearance.mesh.read_mesh` reads them from a file.

    Args:
        material: name of its material.
        vertices: (vertices, 3).
        faces: (faces, 3), numbers of the vertices.
        normals: (vertices, 3), for shading that hides the edges; None for flat faces.
        uv: (vertices, 2), coordinates in a thickness map; None if there are none.

    Raises:
        ValueError: arrays of other shapes, no triangle at all, or a face of a vertex that does not exist.
    """

    material: str
    vertices: Float[np.ndarray, "vertices 3"]
    faces: Int[np.ndarray, "faces 3"]
    normals: Float[np.ndarray, "vertices 3"] | None = None
    uv: Float[np.ndarray, "vertices 2"] | None = None

    def __post_init__(self):
        vertices, faces = np.asarray(self.vertices), np.asarray(self.faces)
        if vertices.ndim != 2 or vertices.shape[1] != 3 or not np.all(np.isfinite(vertices)):
            raise ValueError(f"vertices must be finite points (vertices, 3), not of shape {vertices.shape}")
        if faces.ndim != 2 or faces.shape[1] != 3 or len(faces) == 0:
            raise ValueError(f"faces must be triangles (faces, 3), not of shape {faces.shape}")
        if not np.issubdtype(faces.dtype, np.integer):
            raise ValueError(f"faces must be whole numbers, those of the vertices, not {faces.dtype}")
        wrong = faces[(faces < 0) | (faces >= len(vertices))]
        if wrong.size:
            raise ValueError(f"a face names vertex {wrong[0]}, but they are 0 to {len(vertices) - 1}")
        for name, values, width in (("normals", self.normals, 3), ("uv", self.uv, 2)):
            if values is not None and np.shape(values) != (len(vertices), width):
                raise ValueError(f"{name} must be ({len(vertices)}, {width}), not {np.shape(values)}")


Shape = Sphere | Plane | Box | Mesh


@dataclass(frozen=True)
class ParallelLight:
    """Light from afar.

    Args:
        direction: the way the light travels.
        spectrum: (bands,), radiance of a perfect white that faces it; see `glazejax.appearance.scene_lights`.
    """

    direction: Numbers
    spectrum: Numbers

    def __post_init__(self):
        vector("direction", self.direction, direction=True)


@dataclass(frozen=True)
class PointLight:
    """Light from a point, weaker with the square of the distance.

    Args:
        position: where it is.
        spectrum: (bands,), radiance of a perfect white that faces it one unit of length away.
    """

    position: Numbers
    spectrum: Numbers

    def __post_init__(self):
        vector("position", self.position)


Light = ParallelLight | PointLight


@dataclass(frozen=True)
class Camera:
    """A pinhole camera.

    Args:
        position: where it is.
        target: the point in the middle of the picture.
        up: what is up in the picture.
        field_of_view: angle across the width of the picture, degrees, between 0 and 170.

    Raises:
        ValueError: vectors that are none, a target at the position, a view along `up`, or an angle out of range.
    """

    position: Numbers
    target: Numbers = (0.0, 0.0, 0.0)
    up: Numbers = (0.0, 0.0, 1.0)
    field_of_view: float = 40.0

    def __post_init__(self):
        look = vector("target", self.target) - vector("position", self.position)
        if np.linalg.norm(look) == 0:
            raise ValueError(f"the camera's target {self.target} is its position")
        if np.linalg.norm(np.cross(look, vector("up", self.up, direction=True))) < 1e-9 * np.linalg.norm(look):
            raise ValueError(f"the camera looks along its up {self.up}: give another up, such as [0, 1, 0]")
        if not 0 < positive("field_of_view", self.field_of_view) <= 170:
            raise ValueError(f"field_of_view must be between 0 and 170 degrees, not {self.field_of_view!r}")

    def axes(self) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"], Float[np.ndarray, "3"]]:
        """Unit vectors to the right, up and forward in the picture."""
        look = vector("target", self.target) - vector("position", self.position)
        forward = look / np.linalg.norm(look)
        right = np.cross(forward, vector("up", self.up))
        right /= np.linalg.norm(right)
        return right, np.cross(right, forward), forward


@dataclass(frozen=True)
class Scene:
    """Everything that makes a picture.

    Args:
        wavelengths: (bands,), nm.
        shapes: at least one.
        materials: by the name that the shapes use.
        lights: at least one.
        camera: see `Camera`.
        width, height: pixels.
        background: (bands,) or one number: what is seen where nothing is, also in mirrors. It lights nothing.
        antialias: samples along the side of a pixel, where there is an edge; 1 for none.
        bounces: how many mirror reflections are followed one after another.

    Raises:
        ValueError: something is missing, names a material there is not, or has other bands.
    """

    wavelengths: Grid
    shapes: Sequence[Shape]
    materials: Mapping[str, Material]
    lights: Sequence[Light]
    camera: Camera
    width: int = 640
    height: int = 480
    background: Numbers = 0.0
    antialias: int = 4
    bounces: int = 3

    def __post_init__(self):
        bands = validate_wavelengths(self.wavelengths).size
        for name, low, high in (("width", 1, 20000), ("height", 1, 20000), ("antialias", 1, 16), ("bounces", 0, 20)):
            value = getattr(self, name)
            if not isinstance(value, int | np.integer) or isinstance(value, bool) or not low <= value <= high:
                raise ValueError(f"{name} must be a whole number from {low} to {high}, not {value!r}")
        if self.width * self.height > _MOST_PIXELS:
            raise ValueError(f"{self.width} x {self.height} pixels are too many (at most {_MOST_PIXELS:g} in all)")
        if not self.shapes:
            raise ValueError("a scene needs at least one shape")
        if not self.lights:
            raise ValueError("a scene needs at least one light")
        for shape in self.shapes:
            if shape.material not in self.materials:
                known = ", ".join(self.materials) or "none"
                raise ValueError(f"a shape has the material {shape.material!r}, but there are: {known}")
        for name, material in self.materials.items():
            material.check(name, validate_wavelengths(self.wavelengths))
        for what, spectrum in [("light", light.spectrum) for light in self.lights] + [("background", self.background)]:
            if np.shape(spectrum) not in ((), (bands,)):
                raise ValueError(
                    f"the spectrum of a {what} has shape {np.shape(spectrum)}, but there are {bands} bands"
                )
            known = concrete(spectrum)
            if known is not None and not np.all((known >= 0) & np.isfinite(known)):
                raise ValueError(f"the spectrum of a {what} holds {np.min(known):g}; it must be finite and 0 or more")

    def geometry(self) -> Geometry:
        """Shapes as arrays for the ray caster."""
        number = {name: k for k, name in enumerate(self.materials)}
        return make_geometry(self.shapes, number)

    def light_spectra(self) -> Float[np.ndarray, "lights bands"]:
        """Spectra of the lights."""
        bands = np.size(self.wavelengths)
        return np.stack([np.broadcast_to(np.asarray(light.spectrum, float), (bands,)) for light in self.lights])

    def background_spectrum(self) -> Float[np.ndarray, "bands"]:
        """What is seen where nothing is."""
        return np.broadcast_to(np.asarray(self.background, float), (np.size(self.wavelengths),))

    def only_bands(self, keep: np.ndarray) -> "Scene":
        """The same scene with the bands where `keep` is true."""
        if np.all(keep):
            return self
        bands = np.size(self.wavelengths)

        def part(spectrum: Numbers) -> Numbers:
            return spectrum if np.ndim(spectrum) == 0 else jnp.asarray(spectrum)[..., np.flatnonzero(keep)]

        return replace(
            self,
            wavelengths=np.asarray(self.wavelengths)[keep],
            materials={name: material.only_bands(keep, bands) for name, material in self.materials.items()},
            lights=[replace(light, spectrum=part(light.spectrum)) for light in self.lights],
            background=part(self.background),
        )

    def rays(self, across: np.ndarray, down: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rays of the camera through points of the picture.

        Args:
            across, down: (rays,), in pixels from the upper left corner; (0.5, 0.5) is the middle of the first.

        Returns:
            Origins and unit directions, (rays, 3) each.
        """
        right, up, forward = self.camera.axes()
        half = np.tan(np.deg2rad(self.camera.field_of_view) / 2)
        x = (2 * np.asarray(across) / self.width - 1) * half
        y = (1 - 2 * np.asarray(down) / self.height) * half * self.height / self.width
        direction = forward + x[:, None] * right + y[:, None] * up
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        return np.broadcast_to(vector("position", self.camera.position), direction.shape), direction
