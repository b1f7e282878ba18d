"""Scene of shapes, materials, lights and a camera, checked when it is made.

Coordinates are right-handed, in any unit of length; z is up in the examples. Light is counted on
the scale of the lamp: a perfect white that faces a light of strength 1 has the spectrum of the
light itself, whose luminance is 1.
`glazejax.appearance.scene.draw.render.render` makes the picture,
`glazejax.appearance.scene.file.read_scene` reads a file.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from ...spectra import Bands, Grid, Numbers, validate_wavelengths
from .lights import AreaLight, Light
from .materials import Glazed, Material, check_spectrum
from .shapes import Mesh, Plane, Shape, Vector, positive, vector, whole

# Pictures beyond are a slip of the hand: 100 megapixels of 31 bands fill the memory of a
# workstation.
_MOST_PIXELS = 10**8
# Least and most of what a scene counts.
_WHOLE = {
    "width": (1, 20000),
    "height": (1, 20000),
    "antialias": (1, 16),
    "bounces": (0, 20),
    "diffuse_bounces": (0, 20),
}


@dataclass(frozen=True)
class Camera:
    """A pinhole camera.

    Args:
        position: where it is.
        target: the point in the middle of the picture.
        up: what is up in the picture.
        field_of_view: angle across the width of the picture, degrees, between 0 and 170.

    Raises:
        ValueError: vectors that are none, a target at the position, a view along `up`, or an angle
            out of range.
    """

    position: Numbers
    target: Numbers = (0.0, 0.0, 0.0)
    up: Numbers = (0.0, 0.0, 1.0)
    field_of_view: float = 40.0

    def __post_init__(self) -> None:
        look = vector("target", self.target) - vector("position", self.position)
        if np.linalg.norm(look) == 0:
            raise ValueError(f"the camera's target {self.target} is its position")
        if np.linalg.norm(
            np.cross(look, vector("up", self.up, direction=True))
        ) < 1e-9 * np.linalg.norm(look):
            raise ValueError(
                f"the camera looks along its up {self.up}: give another up, such as [0, 1, 0]"
            )
        if not 0 < positive("field_of_view", self.field_of_view) <= 170:
            raise ValueError(
                f"field_of_view must be between 0 and 170 degrees, not {self.field_of_view!r}"
            )

    def axes(self) -> tuple[Vector, Vector, Vector]:
        """Unit vectors to the right, up and forward in the picture."""
        look = vector("target", self.target) - vector("position", self.position)
        forward = look / np.linalg.norm(look)
        rightward = np.cross(forward, vector("up", self.up))
        rightward /= np.linalg.norm(rightward)
        return rightward, np.cross(rightward, forward), forward


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
        background: (bands,) or one number: what is seen where nothing is, also in mirrors. It
            lights things where `path_trace` follows all light.
        antialias: samples along the side of a pixel, where there is an edge; 1 for none.
        bounces: how many mirror reflections are followed one after another.
        diffuse_bounces: 0 for light from lamps alone; above 0 the scene means light from surface to
            surface as well, of which `path_trace` follows every bounce.

    Raises:
        ValueError: something is missing, names a material there is not, or has other bands, or a
            thickness map is to lie on a mesh without texture coordinates.
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
    diffuse_bounces: int = 0

    def __post_init__(self) -> None:
        grid = validate_wavelengths(self.wavelengths)
        for name, (low, high) in _WHOLE.items():
            whole(name, getattr(self, name), low, high)
        if self.width * self.height > _MOST_PIXELS:
            raise ValueError(
                f"{self.width} x {self.height} pixels are too many (at most {_MOST_PIXELS:g} in "
                "all)"
            )
        if not self.shapes:
            raise ValueError("a scene needs at least one shape")
        if not self.lights:
            raise ValueError("a scene needs at least one light")
        for shape in self.shapes:
            if shape.material not in self.materials:
                names = ", ".join(self.materials) or "none"
                raise ValueError(
                    f"a shape has the material {shape.material!r}, but there are: {names}"
                )
            mapped = self.materials[shape.material].thickness_map is not None
            if mapped and isinstance(shape, Mesh) and shape.uv is None:
                raise ValueError(
                    f"the material {shape.material!r} has a thickness map, but a mesh of it has no "
                    "texture coordinates (u, v) to lay it on: give them, or an even thickness"
                )
        for name, material in self.materials.items():
            material.check(name, grid)
        for light in self.lights:
            check_spectrum("the spectrum of a light", light.spectrum, grid)
        check_spectrum("the spectrum of the background", self.background, grid)

    def light_spectra(self) -> Float[np.ndarray, "lights bands"]:
        """Spectra of the lights."""
        bands = np.size(self.wavelengths)
        return np.stack(
            [np.broadcast_to(np.asarray(light.spectrum, float), (bands,)) for light in self.lights]
        )

    def background_spectrum(self) -> Bands:
        """Spectrum seen where nothing is."""
        return np.broadcast_to(np.asarray(self.background, float), (np.size(self.wavelengths),))

    def needs_path_tracing(self) -> str | None:
        """Features of the scene that the ray caster cannot draw, in words; None if it can draw all
        of it.
        """
        features = []
        if any(isinstance(light, AreaLight) for light in self.lights):
            features.append("area lights")
        if any(isinstance(shape, Plane) and shape.relief is not None for shape in self.shapes):
            features.append("relief")
        if any(
            isinstance(material, Glazed) and material.roughness > 0
            for material in self.materials.values()
        ):
            features.append("glazes with a rough surface")
        if self.diffuse_bounces > 0:
            features.append(f"light between surfaces (diffuse_bounces = {self.diffuse_bounces})")
        return " and ".join(features) or None

    def rays(self, across: np.ndarray, down: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rays of the camera through points of the picture.

        Args:
            across, down: (rays,), in pixels from the upper left corner; (0.5, 0.5) is the middle of
                the first.

        Returns:
            Origins and unit directions, (rays, 3) each.
        """
        rightward, up, forward = self.camera.axes()
        # Points of a plane one unit ahead, which the picture's width covers from -half to half.
        half = np.tan(np.deg2rad(self.camera.field_of_view) / 2)
        x = (2 * across / self.width - 1) * half
        y = (1 - 2 * down / self.height) * half * self.height / self.width
        # Through the point of that plane, then brought to length 1.
        direction = forward + x[:, None] * rightward + y[:, None] * up
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        return np.broadcast_to(vector("position", self.camera.position), direction.shape), direction
