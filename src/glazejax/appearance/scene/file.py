"""Scene files: a small TOML format, read with one clear error for whatever is wrong.

A file has the tables ``[picture]``, ``[camera]`` and any number of ``[lights.NAME]``,
``[materials.NAME]`` and
``[objects.NAME]``; ``glazejax scene --example`` prints one with everything in it. Names of other
files are relative to the scene file.
"""

import tomllib
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any, Literal

import msgspec
import numpy as np
from msgspec import structs

from ...colour import colour_weights
from ...io.source import open_source
from ...io.words import parse_grid
from ...radiative.common.inputs import check_tolerance
from ...spectra import Bands, describe_grid, validate_wavelengths
from ..display.display import Display
from .file_materials import read_grey, read_material, read_reflectance
from .file_table import (
    Flag,
    Keys,
    Named,
    Number,
    Plain,
    Positive,
    Reflectance,
    Size,
    Text,
    TomlTable,
    Vector,
    Whole,
)
from .lights import AreaLight, Light, ParallelLight, PointLight, lamp, measured_lamp
from .picture import Screen, light_white, picture_xyz, screen_picture
from .render_result import Rendered
from .scene import Camera, Scene
from .shapes import Box, Plane, Shape, Sphere

_MAX_FILE = 1 << 20


@dataclass(frozen=True)
class SceneFile:
    """A scene and how its file wants it to be shown.

    Attributes:
        scene: the scene.
        white: spectrum of the light that the eye is adapted to, (bands,).
        display: name of a display, see `glazejax.appearance.display.display.PRESETS`.
        gamut: what becomes of colours it cannot show, see `Display.to_rgb`.
        exposure: factor of all colours.
        tolerance: absolute error wanted of a glaze's reflectance factor.
        notes: what was changed in reading, a sentence each.
    """

    scene: Scene
    white: Bands
    display: str
    gamut: str
    exposure: float
    tolerance: float
    notes: tuple[str, ...] = ()

    def on_screen(self, rendered: Rendered) -> Screen:
        """Digital colours of what `render` or `path_trace` made of the scene, as the file wants
        them shown.

        Its ``rgb`` goes to `save_png`.
        """
        return screen_picture(
            picture_xyz(rendered, self.scene.wavelengths),
            light_white(self.white, self.scene.wavelengths),
            Display.preset(self.display),
            exposure=self.exposure,
            gamut=self.gamut,  # type: ignore[arg-type]
        )


def example() -> str:
    """Text of a scene file that shows the format."""
    return (files("glazejax.appearance.scene") / "example.toml").read_text(encoding="utf-8")


def read_scene(path: str | Path) -> SceneFile:
    """Read a scene file.

    Raises:
        FileNotFoundError: no such file, or one that it names.
        ValueError: anything wrong in it; the message names the table, the key, the value and what
            would do.
    """
    path = Path(path)
    # The time that Python's parser takes for a key grows with the square of its parts.
    longest = 10_000
    with open_source(path) as source:
        # A character may become 20 times itself in Python's parser.
        text = source.text(most=_MAX_FILE, fallback=None)
        for number, line in enumerate(text.splitlines(), start=1):
            if len(line) > longest:
                raise source.error(
                    f"more than {longest} characters, too long for a line of a scene file", number
                )
        try:
            content = tomllib.loads(text)
        except ValueError as error:
            digits = "a number has thousands of digits" if "digits" in str(error) else error
            raise source.error(f"not a legal TOML file: {digits}") from None
    return _scene(TomlTable(path.name, "", content, []), path.parent)


class _SceneKeys(Keys):
    camera: Plain
    lights: Named
    materials: Named
    objects: Named
    picture: Plain = msgspec.field(default_factory=dict)


class _PictureKeys(Keys):
    width: Whole = 640
    height: Whole = 480
    antialias: Whole = 4
    bounces: Whole = 3
    diffuse_bounces: Whole = 0
    wavelengths: Text = "400:700:10"
    background: Reflectance = 0.0
    white: Text = ""
    display: Text = "sRGB"
    exposure: Positive = 1.0
    gamut: Literal["desaturate", "clip", "dim"] = "desaturate"
    tolerance: Positive = 1e-3


class _CameraKeys(Keys):
    position: Vector
    target: Vector = (0.0, 0.0, 0.0)
    up: Vector = (0.0, 0.0, 1.0)
    field_of_view: Positive = 40.0


class _LampKeys(Keys):
    illuminant: Text = ""
    spectrum: Text = ""
    strength: Positive = 1.0


class _FarLampKeys(_LampKeys):
    position: Vector | None = None
    direction: Vector | None = None


class _BallLampKeys(_LampKeys, tag_field="shape", tag="sphere", kw_only=True):
    centre: Vector
    radius: Positive


class _RectangleLampKeys(_LampKeys, tag_field="shape", tag="rectangle", kw_only=True):
    centre: Vector
    normal: Vector
    size: Size
    up: Vector = (0.0, 0.0, 1.0)


class _ObjectKeys(Keys, tag_field="shape"):
    material: Text


class _BallKeys(_ObjectKeys, tag="sphere"):
    centre: Vector
    radius: Positive


class _PlaneKeys(_ObjectKeys, tag="plane"):
    centre: Vector
    normal: Vector
    size: Size | None = None
    up: Vector = (0.0, 0.0, 1.0)
    relief: Text = ""
    relief_height: Number | None = None


class _BoxKeys(_ObjectKeys, tag="box"):
    centre: Vector
    size: Vector
    rotation: Vector = (0.0, 0.0, 0.0)


class _MeshKeys(_ObjectKeys, tag="mesh"):
    file: Text
    size: Positive | None = None
    centre: Vector | None = None
    rotation: Vector = (0.0, 0.0, 0.0)
    smooth: Flag = True


def _scene(root: TomlTable, folder: Path) -> SceneFile:
    file = root.read(_SceneKeys)
    table = root.inner("picture", file.picture)
    picture = table.read(_PictureKeys)
    with table.blame("wavelengths"):
        grid = _wavelengths(picture.wavelengths)
    # Each light, material and object is read from a table of its own, which its errors name.
    lights = {name: _light(lamp, grid, folder) for name, lamp in root.named("lights", file.lights)}
    materials = {
        name: read_material(material, grid, folder)
        for name, material in root.named("materials", file.materials)
    }
    shapes = [_shape(shape, materials, folder) for _, shape in root.named("objects", file.objects)]
    reflectance = read_reflectance(table, "background", picture.background, grid, folder)
    # The background has the colour of the first lamp.
    first = np.asarray(next(iter(lights.values())).spectrum, float)
    with table.blame("white"):
        white = _white(picture.white or next(iter(lights)), grid, lights)
    with table.blame("display"):
        Display.preset(picture.display)
    with table.blame("tolerance"):
        check_tolerance(picture.tolerance)
    camera = root.inner("camera", file.camera)
    view = _build(camera, Camera, **structs.asdict(camera.read(_CameraKeys)))
    scene = _build(
        root,
        Scene,
        wavelengths=grid,
        shapes=shapes,
        materials=materials,
        lights=list(lights.values()),
        camera=view,
        # As bright as white under luminance 1, whatever the strength or distance of the lamp.
        background=reflectance * first / float(first @ colour_weights(grid, "E")[:, 1]),
        width=picture.width,
        height=picture.height,
        antialias=picture.antialias,
        bounces=picture.bounces,
        diffuse_bounces=picture.diffuse_bounces,
    )
    return SceneFile(
        scene=scene,
        white=white,
        display=picture.display,
        gamut=picture.gamut,
        exposure=picture.exposure,
        tolerance=picture.tolerance,
        notes=tuple(root.notes),
    )


def _build(table: TomlTable, kind: Callable[..., Any], **values: Any) -> Any:
    """Make a thing; what it refuses is said to be in this table."""
    with table.blame():
        return kind(**values)


def _wavelengths(text: str) -> Bands:
    """Bands of the scene."""
    grid = validate_wavelengths(parse_grid(text))
    if np.diff(grid).min(initial=np.inf) < 0.5:
        raise ValueError(f"{text!r}: STEP must be 0.5 nm or more")
    # A grid too coarse or too short for colour is refused here.
    colour_weights(grid, "E")
    return grid


def _light(table: TomlTable, grid: np.ndarray, folder: Path) -> Light:
    light = table.read(
        *((_RectangleLampKeys, _BallLampKeys) if "shape" in table.content else (_FarLampKeys,))
    )
    if bool(light.illuminant) == bool(light.spectrum):
        raise table.error("illuminant", 'give either illuminant = "D65" or spectrum = "lamp.csv"')
    with table.blame("illuminant" if light.illuminant else "spectrum"):
        spectrum = (
            lamp(light.illuminant, grid, light.strength)
            if light.illuminant
            else measured_lamp(folder / light.spectrum, grid, light.strength)
        )
    if isinstance(light, _BallLampKeys | _RectangleLampKeys):
        return _build(table, AreaLight, shape=_solid(table, light, ""), spectrum=spectrum)
    if (light.position is None) == (light.direction is None):
        raise table.error(
            "position",
            "give either position, of a point light, or direction, the way the light travels, or "
            'shape = "rectangle" or "sphere", of a thing that shines',
        )
    if light.position is not None:
        return _build(table, PointLight, position=light.position, spectrum=spectrum)
    return _build(table, ParallelLight, direction=light.direction, spectrum=spectrum)


def _white(name: str, grid: np.ndarray, lights: dict[str, Light]) -> np.ndarray:
    """Spectrum of the white that the eye is adapted to: a light of the scene, or an illuminant."""
    if name in lights:
        return np.asarray(lights[name].spectrum, float)
    try:
        return lamp(name, grid)
    except ValueError as error:
        raise ValueError(
            f"{name!r} is none of the lights ({', '.join(lights)}), and {error}"
        ) from None


def _solid(
    table: TomlTable,
    solid: "_BallKeys | _BallLampKeys | _PlaneKeys | _RectangleLampKeys",
    material: str,
    relief: np.ndarray | None = None,
) -> Sphere | Plane:
    if isinstance(solid, _BallKeys | _BallLampKeys):
        return _build(table, Sphere, material=material, centre=solid.centre, radius=solid.radius)
    return _build(
        table,
        Plane,
        material=material,
        point=solid.centre,
        normal=solid.normal,
        size=solid.size,
        up=solid.up,
        relief=relief,
    )


def _relief(table: TomlTable, plane: _PlaneKeys, folder: Path) -> np.ndarray | None:
    """Heights of a plane in the scene's unit of length; None if it is flat."""
    height = plane.relief_height
    if not plane.relief:
        if height is not None:
            raise table.error(
                "relief_height",
                'has no meaning without relief, a map of heights such as "strokes.npy"',
            )
        return None
    if height is None:
        # An array may hold lengths already; a picture cannot.
        if not plane.relief.lower().endswith(".npy"):
            raise table.error("", "relief_height is missing: give the height of white in relief")
        height = 1.0
    with table.blame("relief"):
        return height * read_grey(folder / plane.relief, heights=True)


def _shape(table: TomlTable, materials: Iterable[str], folder: Path) -> Shape:
    shape = table.read(_BallKeys, _PlaneKeys, _BoxKeys, _MeshKeys)
    material = table.choice("material", shape.material, materials)
    if isinstance(shape, _BoxKeys):
        return _build(table, Box, **structs.asdict(shape))
    if isinstance(shape, _MeshKeys):
        from .mesh import read_mesh

        return _build(
            table,
            read_mesh,
            path=folder / shape.file,
            material=material,
            size=shape.size,
            centre=shape.centre,
            turn=shape.rotation,
            smooth=shape.smooth,
        )
    relief = _relief(table, shape, folder) if isinstance(shape, _PlaneKeys) else None
    return _solid(table, shape, material, relief)


def describe(loaded: SceneFile) -> str:
    """One line: what is in it."""
    scene = loaded.scene
    counts = ((scene.shapes, "object"), (scene.materials, "material"), (scene.lights, "light"))
    phrases = [
        *(f"{len(group)} {word}{'s' * (len(group) != 1)}" for group, word in counts),
        f"{scene.width} x {scene.height} pixels",
        describe_grid(np.asarray(scene.wavelengths)),
    ]
    return ", ".join(phrases)
