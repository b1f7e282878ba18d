"""A glaze, thickness maps and grounds of Python as the dictionary that Mitsuba loads."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from ...paint.media import Glaze, Layer, Mixture, Pigment, check_glaze, check_map
from ...spectra import Grid, Numbers
from ...stacks import Stack, stack_of, stack_to_dict
from ..glaze.solve import check_layer, on_grid
from .coats import index_of
from .device import renderer

Surface: TypeAlias = "Numbers | Mapping[str, Any] | None"
"""A number, a map (rows, columns), or the dictionary of a texture of Mitsuba."""

Description: TypeAlias = dict[str, Any]
"""What `mitsuba.load_dict` takes."""

_MICROMETRE = 1e-6


def glaze_bsdf(
    glaze: Glaze | Stack | str | Path,
    *,
    roughness: float = 0.0,
    thickness: Surface = None,
    thickness_max: float | None = None,
    fraction: Surface = None,
    ground: Surface = None,
    layer: int = 0,
    wavelengths: Grid | None = None,
    gloss: bool = True,
    tolerance: float = 1e-3,
) -> dict[str, Any]:
    """Dictionary of a glaze for `mitsuba.load_dict`; `register` must have been called for the
    variant.

    Args:
        glaze: without batch axes and phase functions; or a `glazejax.stacks.Stack`; or coats as
            text, or the path of a stack's JSON.
        roughness: alpha of the surface's GGX facets, 0 to 1; 0 is a smooth surface.
        thickness: of coat `layer`, m: a number, a map (rows, columns), or a texture of Mitsuba in
            m. A map becomes a texture in micrometres, so that an optimiser sees numbers near 1. Row
            0 of a map lies at v = 0.
        thickness_max: largest thickness that the table is for, m; that of the map by default. An
            optimiser wants room.
        fraction: share of the second paint of coat `layer`, a mixture of two: a number, a map or a
            texture, 0 to 1.
        ground: reflectance as seen from inside the paint: a number, a spectrum (bands,), a map
            (rows, columns), a map of spectra (rows, columns, bands) on the glaze's wavelengths (or
            `wavelengths`), or a texture.
        layer: number of the coat, 0 on top.
        wavelengths: bands of the table, nm; the glaze's own by default. Only for a `Glaze`.
        gloss: with the reflection of the surface itself.
        tolerance: absolute error wanted of the reflectance factor.

    Returns:
        ``{"type": "glaze", ...}``, with numbers, text and textures only.

    Raises:
        TypeError: `glaze` is none of these.
        ModuleNotFoundError: maps are given and Mitsuba is not installed.
        ValueError: a glaze with batch axes, phase functions or an index that varies; a map of
            another number of axes or with values out of range; no such coat. With maps: no variant
            that follows wavelengths is set.
    """
    if isinstance(glaze, Stack):
        glaze = glaze.glaze()
    if not isinstance(glaze, str | Path):
        check_glaze(glaze)
    if not 0 <= roughness <= 1:
        raise ValueError(f"roughness is {roughness}; it must lie between 0 (smooth) and 1")
    description: Description = {
        "type": "glaze",
        "coats": str(glaze),
        "layer": int(layer),
        "gloss": bool(gloss),
        "roughness": float(roughness),
        "tolerance": float(tolerance),
    }
    if isinstance(glaze, Glaze):
        spectrum = None
        if not isinstance(ground, Mapping | None) and np.ndim(ground) == 1:
            # A spectrum of the ground goes with the coats; maps and textures stay Mitsuba's.
            spectrum = ground
            ground = None
        description["coats"] = _text(glaze, wavelengths, layer, fraction is not None, spectrum)
        if fraction is not None or thickness is not None:
            check_layer(glaze, layer, mixed=fraction is not None)
    elif wavelengths is not None:
        raise ValueError(
            "wavelengths belong to a Glaze; coats given as text or a file keep those of their "
            "paints"
        )
    if thickness is not None:
        description |= _thickness(thickness, thickness_max)
    if fraction is not None:
        description["fraction"] = _map("fraction", fraction)
    if ground is not None:
        description["ground"] = _map("ground", ground, axes=(0, 2, 3))
    return description


def _text(
    glaze: Glaze, wavelengths: Grid | None, layer: int, mixed: bool, ground: Numbers | None
) -> str:
    """The text of a stack, with all digits; only the coat whose mixture varies keeps its paints
    apart.
    """
    if not glaze.coats:
        raise ValueError("a glaze without coats is its ground: use Mitsuba's plastic")
    index = index_of(glaze)
    glaze = on_grid(glaze, glaze.wavelengths if wavelengths is None else wavelengths)
    coats = list(glaze.coats)
    for number, coat in enumerate(coats):
        medium = coat.medium
        # A coat of a stack is of few paints: any other mixture is one.
        if isinstance(medium, Mixture) and not (mixed and number == layer):
            paint = Pigment(medium.name, medium.wavelengths, medium.absorption, medium.scattering)
            coats[number] = Layer(paint, coat.thickness)
    whole = Glaze(coats, glaze.ground if ground is None else ground, index)
    return json.dumps(stack_to_dict(stack_of(whole), digits=17))


def _thickness(thickness: "Numbers | Mapping[str, Any]", most: float | None) -> Description:
    description: Description = {} if most is None else {"thickness_max": float(most)}
    if isinstance(thickness, Mapping) or np.ndim(thickness) == 0:
        return description | {"thickness": _map("thickness", thickness)}
    values = check_map("thickness", thickness)
    largest = float(values.max())
    if most is not None and largest > most * (1 + 1e-6):
        raise ValueError(
            f"thickness reaches {largest:g} m, beyond the thickness_max of {most:g} m: raise that"
        )
    # In micrometres an optimiser meets numbers near 1.
    scaled = _texture(values / _MICROMETRE)
    return description | {"thickness": scaled, "thickness_scale": _MICROMETRE}


def _map(kind: str, surface: "Numbers | Mapping[str, Any]", axes: Sequence[int] = (0, 2)) -> Any:
    """A number, texture or array of spectra, checked."""
    if isinstance(surface, Mapping):
        return dict(surface)
    values = check_map(kind, surface, axes=axes)
    if values.ndim == 3:
        return renderer()[0].Bitmap(np.ascontiguousarray(values, np.float32))
    return float(values) if values.ndim == 0 else _texture(values)


def _texture(values: np.ndarray) -> Description:
    """A map of numbers as a texture, linear between its values."""
    mi, _ = renderer()
    return {
        "type": "bitmap",
        "bitmap": mi.Bitmap(np.ascontiguousarray(values[..., None], np.float32)),
        "raw": True,
        "filter_type": "bilinear",
        "wrap_mode": "clamp",
    }
