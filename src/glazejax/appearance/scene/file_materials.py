"""Materials of scene files: plain reflectances, metals, and glazes with their thickness maps."""

from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from ...extras import require
from ...io.source import open_source, refusal, show_path
from ...paint.describe import MAX_THICKNESS, format_length, name_paints, parse_coats
from ...paint.media import Glaze, Layer, make_media
from ...spectra import Bands, resample
from ..metals import metal
from .file_table import (
    LENGTHS,
    Flag,
    Keys,
    Lengths,
    Number,
    Positive,
    Reflectance,
    Text,
    TomlTable,
    Whole,
)
from .materials import Conductor, FresnelModel, Glazed, Lambert, Material, Phong

_MAX_PIXELS = 1 << 24
# The built-in map: from 0 on the left to 1 on the right, between which it is interpolated.
_WEDGE = np.linspace(0.0, 1.0, 1024)[None]


class _LambertKeys(Keys, tag_field="kind", tag="lambert"):
    reflectance: Reflectance


class _PhongKeys(Keys, tag_field="kind", tag="phong"):
    reflectance: Reflectance
    highlight: Positive = 0.3
    exponent: Positive = 40.0


class _MetalKeys(Keys, tag_field="kind", tag="metal"):
    metal: Text
    roughness: Number = 0.0
    fresnel: FresnelModel = "exact"


class _GlazeKeys(Keys, tag_field="kind", tag="glaze"):
    coats: Text
    pigments: Text = ""
    ground: Reflectance = 0.9
    refractive_index: Number = 1.5
    gloss: Flag = True
    roughness: Number = 0.0
    thickness_map: Text = ""
    thickness_layer: Whole | None = None
    thickness_range: Lengths | None = None


def read_material(table: TomlTable, grid: Bands, folder: Path) -> Material:
    """One material of a scene file.

    Raises:
        ValueError, FileNotFoundError: names the table and the key.
    """
    material = table.read(_LambertKeys, _PhongKeys, _MetalKeys, _GlazeKeys)
    if isinstance(material, _GlazeKeys):
        return _glaze(table, material, grid, folder)
    if isinstance(material, _MetalKeys):
        with table.blame("metal"):
            optics = metal(material.metal, grid)
        with table.blame():
            return Conductor(
                optics.refractive_index, optics.extinction, material.roughness, material.fresnel
            )
    body = read_reflectance(table, "reflectance", material.reflectance, grid, folder)
    if isinstance(material, _PhongKeys):
        return Phong(body, material.highlight, material.exponent)
    return Lambert(body)


def _glaze(table: TomlTable, material: _GlazeKeys, grid: np.ndarray, folder: Path) -> Glazed:
    from ... import catalogue

    shelf: Any = catalogue.load()
    if material.pigments:
        from ...paint.pigment_table import read_pigments

        with table.blame("pigments"):
            shelf = {**shelf, **read_pigments(folder / material.pigments)}
    with table.blame("coats"):
        # Names as typed become those of the shelf; the paints go to the scene's bands.
        described = name_paints(parse_coats(material.coats), shelf)
        media = make_media(described, shelf, grid)
    ground = read_reflectance(table, "ground", material.ground, grid, folder)
    with table.blame():
        coats = [Layer(medium, coat.total) for medium, coat in zip(media, described, strict=True)]
        glaze = Glaze(coats, ground, material.refractive_index)
    thickness, layer = _thickness(table, material, len(coats), folder)
    with table.blame("roughness"):
        return Glazed(
            glaze=glaze,
            thickness=thickness,
            layer=layer,
            gloss=material.gloss,
            roughness=material.roughness,
        )


def _thickness(
    table: TomlTable, material: _GlazeKeys, coats: int, folder: Path
) -> tuple[np.ndarray | None, int]:
    """Map of a layer's thickness, m, and which layer it is, counted from 0."""
    file = material.thickness_map
    if not file:
        for key in ("thickness_layer", "thickness_range"):
            if getattr(material, key) is not None:
                raise table.error(key, "has no meaning without thickness_map, a grey picture")
        return None, 0
    layer = 1 if material.thickness_layer is None else material.thickness_layer
    if not 1 <= layer <= coats:
        raise table.error(
            "thickness_layer", f"is {layer}, but there are {coats} coats, the top one is 1"
        )
    if material.thickness_range is None:
        raise table.error("thickness_range", f"must be {LENGTHS} of thickness_map")
    with table.blame("thickness_range"):
        black, white = (
            parse_coats(f"paint:{length}")[0].thickness for length in material.thickness_range
        )
    with table.blame("thickness_map"):
        grey = _WEDGE if file == "wedge" else read_grey(folder / file)
    # From grey to metres, linear between the thicknesses of black and white.
    thickness = black + (white - black) * grey
    if thickness.max() > MAX_THICKNESS:
        raise table.error("thickness_range", f"reaches {format_length(float(thickness.max()))}")
    return thickness, layer - 1


def read_grey(path: Path, *, heights: bool = False) -> Float[np.ndarray, "h w"]:
    """A map from 0 to 1: a grey PNG (colours are averaged, no gamma is undone), or an .npy array as
    it is.

    Args:
        path: the file.
        heights: an array may hold any finite numbers.

    Raises:
        FileNotFoundError: no such file.
        ValueError: it is no picture, or an array of something else.
    """
    with open_source(path, missing=f"there is no file {show_path(path)}") as source:
        if source.size is None:
            raise source.error("a pipe; a map must be a file")
    if path.suffix.lower() == ".npy":
        try:
            # Mapped: its header is held against the size of the file before anything is taken.
            with np.errstate(all="ignore"):
                values = np.load(path, mmap_mode="r", allow_pickle=False)
        except Exception as error:  # NumPy raises many kinds
            raise refusal(path, f"not an array that can be read ({error})") from None
        if not isinstance(values, np.ndarray):
            raise refusal(path, "an archive (.npz) of arrays; save one array with numpy.save")
        if values.ndim != 2 or values.dtype.kind not in "iuf" or not 0 < values.size <= _MAX_PIXELS:
            raise refusal(
                path, f"must hold finite numbers (h, w), not {values.dtype} {values.shape}"
            )
        values = np.array(values, float)
        if not np.all(np.isfinite(values)):
            raise refusal(path, "must hold finite numbers (h, w); some are not")
        if not heights and (values.min() < 0 or values.max() > 1):
            raise refusal(path, f"must hold 0 to 1, not {values.min():g} to {values.max():g}")
        return values
    require("matplotlib")
    from matplotlib.image import imread
    from PIL import Image

    try:
        with Image.open(path) as loaded:
            width, height = loaded.size
        picture = np.asarray(imread(path)) if width * height <= _MAX_PIXELS else None
    except Exception as error:  # Pillow raises many kinds
        raise refusal(path, f"not a picture that can be read ({type(error).__name__})") from None
    if picture is None:
        raise refusal(
            path,
            f"{width} x {height} pixels are too many for a map (at most {_MAX_PIXELS}); make it "
            "smaller",
        )
    top = 255.0 if picture.dtype == np.uint8 else 1.0
    # NumPy's mean takes few numbers at a time to double precision, in which the whole picture would
    # have eight times its size.
    grey = picture.astype(float) if picture.ndim == 2 else picture[..., :3].mean(-1, dtype=float)
    grey = grey / top
    if not 0 <= grey.min() <= grey.max() <= 1:
        raise refusal(
            path,
            f"must hold 0 to 1, not {grey.min():g} to {grey.max():g}; save it with 8 bits a colour",
        )
    return grey


def read_reflectance(
    table: TomlTable,
    key: str,
    value: float | str,
    grid: Bands,
    folder: Path,
) -> float | Bands:
    """A reflectance: one number, or FILE or FILE:SAMPLE, any format that `glazejax.io` reads.

    A measured value a little above 1 becomes 1, with a note.

    Raises:
        ValueError, FileNotFoundError: names the table and the key.
    """
    if isinstance(value, str):
        with table.blame(key):
            return _measured_material(table, key, value, grid, folder)
    if not 0 <= value <= 1:
        hint = f"; {value:g} percent is {value / 100:g}" if 1 < value <= 100 else ""
        raise table.error(key, f"must lie between 0 and 1, not {value:g}{hint}")
    return value


def _measured_material(
    table: TomlTable, key: str, text: str, grid: np.ndarray, folder: Path
) -> Bands:
    from ...io import read_sample

    sample = read_sample(text, folder=folder)
    values = np.asarray(resample(sample.wavelengths, sample.reflectance[0], grid), float)
    brightest = int(values.argmax())
    most = f"{text} reflects {values[brightest]:.4g} at {grid[brightest]:g} nm"
    # What a measured white may reach by noise and calibration.
    if values[brightest] > 1.05:
        raise ValueError(f"{most}, but a material reflects 1 at most: scale the spectrum")
    if values[brightest] > 1:
        table.note(key, f"{most}, taken as noise: values above 1 became 1")
    return np.clip(values, 0.0, 1.0)
