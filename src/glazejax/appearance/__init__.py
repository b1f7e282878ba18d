"""Object colour: displays, interfaces, shading, glazes as a material, interreflection (paper B), and scenes of them.

`Display` leads from XYZ to digital RGB and back, `metal` gives complex refractive indices, `glaze_table` makes a glaze
a material; `shading` and `interreflection` are functions of cosines and spectra. Nothing is imported before it is
asked for.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from . import interreflection, shading
    from .display import Display
    from .glaze_material import GlazeTable, glaze_table
    from .metals import Metal, metal
    from .tone import ToneCurve

__all__ = ["Display", "GlazeTable", "Metal", "ToneCurve", "glaze_table", "interreflection", "metal", "shading"]

_SUBMODULES = {"interreflection", "shading"}
_NAMES = {
    "Display": "display",
    "GlazeTable": "glaze_material",
    "Metal": "metals",
    "ToneCurve": "tone",
    "glaze_table": "glaze_material",
    "metal": "metals",
}


def __getattr__(name: str) -> Any:
    """Load a name when it is first asked for."""
    if name in _SUBMODULES:
        return importlib.import_module(f"{__name__}.{name}")
    if name in _NAMES:
        return getattr(importlib.import_module(f"{__name__}.{_NAMES[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
