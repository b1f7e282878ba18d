"""Parameters of a glaze in a scene file, read from Mitsuba's properties and checked."""

from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from ...names import nearest_names
from ...paint.media import MAX_THICKNESS, check_quantity


class GlazeParameters(NamedTuple):
    """The parameters of one glaze; textures are Mitsuba's."""

    coats: str
    layer: int
    thickness: Any
    """A number in m, a texture in units of `thickness_scale`, or None for the coat's own."""
    thickness_scale: float
    thickness_max: float
    """Largest thickness of the table, m."""
    fraction: Any
    """A number, a texture or None."""
    ground: Any
    """A number, a texture, an array (rows, columns, bands), or None for that of the coats."""
    refractive_index: float | None
    roughness: float
    gloss: bool
    tolerance: float


def read_parameters(mi: Any, props: Any) -> GlazeParameters:
    """Parameters of a glaze.

    Raises:
        ValueError: something is missing, unknown, of another kind or out of range; the message
            names the value and the fix.
    """
    names = set(props.keys() if hasattr(props, "keys") else props.property_names())
    known = GlazeParameters._fields
    for name in sorted(names - set(known)):
        near = nearest_names(name, known)
        raise ValueError(
            f"a glaze has no {name!r}"
            + (f"; you may mean {near[0]!r}" if near else f"; it has {known}")
        )
    entries = {name: props[name] for name in names}
    if not isinstance(entries.get("coats"), str):
        raise ValueError('a glaze needs "coats", such as "UltramarineBlue:3um, ZincWhite:20um"')
    # Textures count in any unit, so that an optimiser meets numbers near 1.
    scale = _number(entries, "thickness_scale", 1.0, 1e-12, 1e3)
    thickness = _texture(mi, props, entries, "thickness", "get_unbounded_texture")
    fraction = _texture(mi, props, entries, "fraction", "get_unbounded_texture")
    if _is_array(mi, entries.get("ground")):
        ground = _bands(entries["ground"])
    else:
        ground = _texture(mi, props, entries, "ground", "get_texture")
    least, largest = (scale * end for end in _range(mi, thickness))
    check_quantity(
        "thickness",
        [least, largest],
        "" if scale == 1.0 else f"times thickness_scale ({scale:g})",
        ": thickness is in metres (20 micrometres are 20e-6, or 20 with a thickness_scale of 1e-6)",
    )
    # Without a limit the table ends at the largest thickness there is.
    most = _number(entries, "thickness_max", largest, 0.0, MAX_THICKNESS)
    if largest > most * (1 + 1e-6):
        raise ValueError(
            f"thickness reaches {largest:g} m, beyond the thickness_max of {most:g} m: raise that"
        )
    check_quantity("fraction", _range(mi, fraction))
    check_quantity("ground", _range(mi, ground))
    gloss = entries.get("gloss", True)
    if not isinstance(gloss, bool):
        raise ValueError(f"gloss is {gloss!r}; it must be true or false")
    return GlazeParameters(
        coats=entries["coats"],
        layer=int(_number(entries, "layer", 0, 0, 1000)),
        thickness=thickness * scale if isinstance(thickness, float) else thickness,
        thickness_scale=scale,
        thickness_max=most,
        fraction=fraction,
        ground=ground,
        refractive_index=_number(entries, "refractive_index", None, 1.0, 2.5),
        roughness=_number(entries, "roughness", 0.0, 0.0, 1.0),
        gloss=gloss,
        tolerance=_number(entries, "tolerance", 1e-3, 1e-5, 0.1),
    )


def _number(entries: dict[str, Any], name: str, default: Any, low: float, high: float) -> Any:
    if name not in entries:
        return default
    value = entries[name]
    if not isinstance(value, int | float) or isinstance(value, bool) or not low <= value <= high:
        raise ValueError(f"{name} is {value!r}; it must be a number between {low:g} and {high:g}")
    return float(value)


def _texture(mi: Any, props: Any, entries: dict[str, Any], name: str, getter: str) -> Any:
    """A number, a texture, or None if it is not given."""
    if name not in entries:
        return None
    value = entries[name]
    if isinstance(value, int | float) and not isinstance(value, bool):
        return float(value)
    if _is_array(mi, value) or isinstance(value, str | bool):
        raise ValueError(
            f"{name} is {type(value).__name__}; give a number or a texture, or an array to "
            "glazejax.appearance.mitsuba.glaze_bsdf"
        )
    return getattr(props, getter)(name) if hasattr(props, getter) else value


def _is_array(mi: Any, value: Any) -> bool:
    return isinstance(value, mi.TensorXf | mi.Bitmap)


def _bands(value: Any) -> Float[np.ndarray, "rows columns bands"]:
    """An array of spectra."""
    array = np.array(value, np.float32)
    if array.ndim != 3:
        raise ValueError(
            f"a ground given as an array must be (rows, columns, bands), not of shape {array.shape}"
        )
    return array


def values_of(mi: Any, texture: Any) -> np.ndarray | None:
    """Values that a texture holds, as far as it states them."""
    entries = mi.traverse(texture)
    for name in entries.keys():  # noqa: SIM118
        if name.rpartition(".")[2] in ("data", "value"):
            return np.array(entries[name], float)
    return None


def _range(mi: Any, value: Any) -> tuple[float, float]:
    """Smallest and largest value; NaN if there is one."""
    if value is None:
        return 0.0, 0.0
    if isinstance(value, float):
        return value, value
    values = value if isinstance(value, np.ndarray) else values_of(mi, value)
    if values is None or values.size == 0:
        return 0.0, 0.0
    return float(values.min()), float(values.max())
