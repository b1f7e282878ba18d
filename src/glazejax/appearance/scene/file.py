"""Scene files: a small TOML format, read with one clear error for whatever is wrong.

A file has the tables ``[picture]``, ``[camera]`` and any number of ``[lights.NAME]``,
``[materials.NAME]`` and
``[objects.NAME]``; ``glazejax scene --example`` prints one with everything in it. Names of other
files are relative to the scene file.
"""

import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from ...colour import colour_weights
from ...io.source import open_source, show_path
from ...spectra import describe_grid, validate_wavelengths
from ..display.display import Display
from .file_materials import read_heights, read_material, read_reflectance
from .file_table import TomlTable
from .lights import AreaLight, Light, ParallelLight, PointLight, lamp, measured_lamp
from .picture import Screen, light_white, picture_xyz, screen_picture
from .render_result import Rendered
from .scene import Camera, Scene
from .shapes import Box, Plane, Shape, Sphere

_DEFAULT_WAVELENGTHS = "400:700:10"
_MAX_FILE = 1 << 20
# The time that Python's parser takes for a key grows with the square of its parts.
_MAX_LINE = 10_000


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
    white: Float[np.ndarray, "bands"]
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
    missing = (
        f"there is no scene file {show_path(path)}; glazejax scene --example prints one to start "
        "from"
    )
    with open_source(path, missing=missing) as source:
        # A character may become 20 times itself in Python's parser.
        text = source.text(most=_MAX_FILE, fallback=None)
        long = next(
            (i for i, line in enumerate(text.splitlines(), start=1) if len(line) > _MAX_LINE), None
        )
        if long is not None:
            raise source.error(
                f"more than {_MAX_LINE} characters, too long for a line of a scene file", long
            )
        try:
            content = tomllib.loads(text)
        except ValueError as error:
            digits = "a number has thousands of digits" if "digits" in str(error) else error
            raise source.error(f"not a legal TOML file: {digits}") from None
    return _scene(TomlTable(path.name, "", content), path.parent)


def _scene(root: TomlTable, folder: Path) -> SceneFile:
    picture = root.table("picture", {})
    grid = _wavelengths(picture)
    lights = {name: _light(table, grid, folder) for name, table in root.tables("lights").items()}
    materials = {
        name: read_material(table, grid, folder) for name, table in root.tables("materials").items()
    }
    shapes = [_shape(table, list(materials), folder) for table in root.tables("objects").values()]
    camera = root.table("camera")
    sizes = {key: picture.whole(key, default) for key, default in _SIZES.items()}
    background = _background(picture, grid, lights, folder)
    white = _white(picture, grid, lights)
    display = picture.text("display", "sRGB")
    with picture.blame("display"):
        Display.preset(display)
    gamut = picture.choice("gamut", ("desaturate", "clip", "dim"), "desaturate")
    exposure = picture.above_zero("exposure", 1.0)
    tolerance = picture.above_zero("tolerance", 1e-3)
    view = _build(
        camera,
        Camera,
        position=camera.vector("position"),
        target=camera.vector("target", (0.0, 0.0, 0.0)),
        up=camera.vector("up", (0.0, 0.0, 1.0)),
        field_of_view=camera.above_zero("field_of_view", 40.0),
    )
    for table in (picture, camera, root):
        table.done()
    scene = _build(
        root,
        Scene,
        wavelengths=grid,
        shapes=shapes,
        materials=materials,
        lights=list(lights.values()),
        camera=view,
        background=background,
        **sizes,
    )
    return SceneFile(
        scene=scene,
        white=white,
        display=display,
        gamut=gamut,
        exposure=exposure,
        tolerance=tolerance,
        notes=tuple(root.notes),
    )


_SIZES = {
    "width": 640,
    "height": 480,
    "antialias": 4,
    "bounces": 3,
    "diffuse_bounces": 0,
}


def _build(table: TomlTable, kind: Callable[..., Any], **values: Any) -> Any:
    """Make a thing; what it refuses is said to be in this table."""
    with table.blame():
        return kind(**values)


def _wavelengths(picture: TomlTable) -> Float[np.ndarray, "bands"]:
    """Bands of the scene: FROM:TO:STEP in nm, both ends included."""
    text = picture.text("wavelengths", _DEFAULT_WAVELENGTHS)
    with picture.blame("wavelengths"):
        try:
            start, end, step = (float(part) for part in text.split(":"))
        except ValueError:
            raise ValueError(
                f"{text!r} is not FROM:TO:STEP in nm, such as {_DEFAULT_WAVELENGTHS}"
            ) from None
        if not (0 < start < end < 1e5 and 0.5 <= step <= end - start):
            raise ValueError(
                f"{text!r}: FROM must be below TO, and STEP from 0.5 nm up to their distance"
            )
        count = (end - start) / step
        if abs(count - round(count)) > 1e-6:
            raise ValueError(f"{text!r}: steps of {step:g} nm do not meet {end:g} nm")
        grid = validate_wavelengths(start + step * np.arange(round(count) + 1))
        colour_weights(grid, "E")
    return grid


def _light(table: TomlTable, grid: np.ndarray, folder: Path) -> Light:
    strength = table.above_zero("strength", 1.0)
    name = table.text("illuminant", "")
    file = table.text("spectrum", "")
    if bool(name) == bool(file):
        raise table.error("illuminant", 'give either illuminant = "D65" or spectrum = "lamp.csv"')
    with table.blame("illuminant" if name else "spectrum"):
        spectrum = (
            lamp(name, grid, strength) if name else measured_lamp(folder / file, grid, strength)
        )
    if table.has("shape"):
        return _area_light(table, spectrum)
    place = table.vector("position", None)
    way = table.vector("direction", None)
    if (place is None) == (way is None):
        words = (
            "give either position, of a point light, or direction, the way the light travels, or "
            "shape"
        )
        raise table.error("position", f'{words} = "rectangle" or "sphere", of a thing that shines')
    table.done()
    if place is not None:
        return _build(table, PointLight, position=place, spectrum=spectrum)
    return _build(table, ParallelLight, direction=way, spectrum=spectrum)


def _area_light(table: TomlTable, spectrum: np.ndarray) -> AreaLight:
    """A rectangle or a sphere that shines."""
    if table.choice("shape", ("rectangle", "sphere")) == "sphere":
        shape: Plane | Sphere = _build(table, Sphere, material="", **_sphere(table))
    else:
        if not table.has("size"):
            raise table.error(
                "size", "is missing: an area light has a width and a height, such as [1.0, 1.5]"
            )
        shape = _build(table, Plane, material="", **_plane(table))
    table.done()
    return _build(table, AreaLight, shape=shape, spectrum=spectrum)


def _sphere(table: TomlTable) -> dict[str, Any]:
    return {"centre": table.vector("centre"), "radius": table.above_zero("radius")}


def _plane(table: TomlTable) -> dict[str, Any]:
    return {
        "point": table.vector("centre"),
        "normal": table.vector("normal"),
        "size": table.numbers("size", 2, None),
        "up": table.vector("up", (0.0, 0.0, 1.0)),
    }


def _relief(table: TomlTable, folder: Path) -> np.ndarray | None:
    """Heights of a plane in the scene's unit of length; None if it is flat."""
    file = table.text("relief", "")
    if not file:
        if table.has("relief_height"):
            raise table.error(
                "relief_height",
                'has no meaning without relief, a map of heights such as "strokes.npy"',
            )
        return None
    # An array may hold lengths already; a picture cannot.
    array = file.lower().endswith(".npy")
    height = table.number("relief_height", 1.0) if array else table.number("relief_height")
    with table.blame("relief"):
        return height * read_heights(folder / file)


def _background(
    picture: TomlTable, grid: np.ndarray, lights: dict[str, Light], folder: Path
) -> np.ndarray:
    """Light of the surroundings: a reflectance, under the first light."""
    reflectance = read_reflectance(picture, "background", grid, folder, default=0.0)
    first = next(iter(lights.values()))
    spectrum = np.asarray(first.spectrum, float)
    # As bright as white under luminance 1, whatever the strength or distance of the lamp.
    return np.asarray(reflectance) * spectrum / float(spectrum @ colour_weights(grid, "E")[:, 1])


def _white(picture: TomlTable, grid: np.ndarray, lights: dict[str, Light]) -> np.ndarray:
    """Spectrum of the white that the eye is adapted to: a light of the scene, or an illuminant."""
    name = picture.text("white", next(iter(lights)))
    if name in lights:
        return np.asarray(lights[name].spectrum, float)
    with picture.blame("white"):
        try:
            return lamp(name, grid)
        except ValueError as error:
            raise ValueError(
                f"{name!r} is none of the lights ({', '.join(lights)}), and {error}"
            ) from None


def _shape(table: TomlTable, materials: list[str], folder: Path) -> Shape:
    kind = table.choice("shape", ("sphere", "plane", "box", "mesh"))
    material = table.choice("material", materials)
    if kind == "sphere":
        values = _sphere(table)
        maker: Callable[..., Shape] = Sphere
    elif kind == "plane":
        values = _plane(table) | {"relief": _relief(table, folder)}
        maker = Plane
    elif kind == "box":
        values = {
            "centre": table.vector("centre"),
            "size": table.vector("size"),
            "rotation": table.vector("rotation", (0.0, 0.0, 0.0)),
        }
        maker = Box
    else:
        from .mesh import read_mesh

        values = {
            "path": folder / table.text("file"),
            "size": table.above_zero("size", None),
            "centre": table.vector("centre", None),
            "turn": table.vector("rotation", (0.0, 0.0, 0.0)),
            "smooth": table.flag("smooth", True),
        }
        maker = read_mesh
    table.done()
    return _build(table, maker, material=material, **values)


def describe(found: SceneFile) -> str:
    """One line: what is in it."""
    scene = found.scene
    counts = ((scene.shapes, "object"), (scene.materials, "material"), (scene.lights, "light"))
    parts = [
        *(f"{len(each)} {word}{'s' * (len(each) != 1)}" for each, word in counts),
        f"{scene.width} x {scene.height} pixels",
        describe_grid(np.asarray(scene.wavelengths)),
    ]
    return ", ".join(parts)
