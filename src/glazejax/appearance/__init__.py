"""Object colour: displays, interfaces, shading, glazes as a material, interreflection (paper B), and scenes of them.

`Display` leads from XYZ to digital RGB and back, `metal` gives complex refractive indices, `glaze_table` makes a glaze
a material; `shading` and `interreflection` are functions of cosines and spectra. A `Scene` of shapes, materials, lights
(`lamp`) and a `Camera` is computed by `render`, and shown by `picture_xyz` and `screen_picture`. Nothing is imported
before it is asked for.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from . import interreflection, scene, shading
    from .display import Display
    from .glaze_material import GlazeTable, glaze_table
    from .mesh import read_mesh
    from .metals import Metal, metal
    from .scene import (
        Box,
        Camera,
        Conductor,
        Glazed,
        Lambert,
        Material,
        Mesh,
        ParallelLight,
        Phong,
        Plane,
        PointLight,
        Scene,
        Sphere,
    )
    from .scene_file import read_scene
    from .scene_lights import lamp, measured_lamp
    from .scene_picture import light_white, picture_xyz, save_png, save_spectral, screen_picture
    from .scene_render import render
    from .tone import ToneCurve

__all__ = [
    "Box",
    "Camera",
    "Conductor",
    "Display",
    "GlazeTable",
    "Glazed",
    "Lambert",
    "Material",
    "Mesh",
    "Metal",
    "ParallelLight",
    "Phong",
    "Plane",
    "PointLight",
    "Scene",
    "Sphere",
    "ToneCurve",
    "glaze_table",
    "interreflection",
    "lamp",
    "light_white",
    "measured_lamp",
    "metal",
    "picture_xyz",
    "read_mesh",
    "read_scene",
    "render",
    "save_png",
    "save_spectral",
    "scene",
    "screen_picture",
    "shading",
]

_SUBMODULES = {"interreflection", "scene", "shading"}
# Each module with the names that are looked for in it.
_MODULES = {
    "display": ("Display",),
    "glaze_material": ("GlazeTable", "glaze_table"),
    "mesh": ("read_mesh",),
    "metals": ("Metal", "metal"),
    "scene": ("Box", "Camera", "Mesh", "ParallelLight", "Plane", "PointLight", "Scene", "Sphere"),
    "scene_file": ("read_scene",),
    "scene_lights": ("lamp", "measured_lamp"),
    "scene_materials": ("Conductor", "Glazed", "Lambert", "Material", "Phong"),
    "scene_picture": ("light_white", "picture_xyz", "save_png", "save_spectral", "screen_picture"),
    "scene_render": ("render",),
    "tone": ("ToneCurve",),
}
_NAMES = {name: module for module, names in _MODULES.items() for name in names}


def __getattr__(name: str) -> Any:
    """Load a name when it is first asked for."""
    if name in _SUBMODULES:
        return importlib.import_module(f"{__name__}.{name}")
    if name in _NAMES:
        return getattr(importlib.import_module(f"{__name__}.{_NAMES[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
