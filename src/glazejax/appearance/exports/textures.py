"""Sets of textures for Blender and game engines, of a glaze that changes from point to point."""

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from ...colour import CIE_1931, encoded_srgb
from ...extras import require
from ...io.outputs import check_output
from ...paint.media import Glaze, check_map, shared_shape
from ...progress import Progress, no_progress
from ...spectra import Numbers
from ...stacks import Stack
from ..image_files import FORMATS, normals, write_image
from .angles import Viewing, angular_colour, check_roughness
from .fit import Errors, colour_tuple, material_errors
from .mapped import Colours, MappedGlaze, mapped_colours
from .materialx import ImageNode, check_name, write_materialx
from .openpbr import COLOURS, OpenPBR, paint_surface
from .rgb import SPACES, outside
from .rgb import delta_e as difference
from .spaces import Layering, Space, find_space
from .texture_words import SOCKETS, readme


@dataclass(frozen=True)
class TextureSet:
    """Files that were written, and how near they are.

    Attributes:
        files: by what they are: ``base_color``, ``roughness``, ... , ``materialx``, ``json``,
            ``readme``.
        material: of OpenPBR, for what has no picture.
        interpolation: estimated largest CIEDE2000 between a pixel's colours and those computed for
            it alone.
        outside: share of pixels whose base colour the space cannot hold.
        clipped: largest CIEDE2000 of bringing these inside.
        errors: of the material against the glaze at all angles, the largest of each at some pixels
            of the map.
        computed: number of glazes that were computed.
    """

    files: dict[str, Path]
    material: OpenPBR
    interpolation: float
    outside: float
    clipped: float
    errors: Errors
    computed: int


def texture_set(
    glaze: Glaze | Stack,
    folder: str | Path,
    *,
    thickness: Numbers | None = None,
    fraction: Numbers | None = None,
    ground: Numbers | None = None,
    layer: int = 0,
    roughness: float = 0.0,
    coat: bool = False,
    pixel: float | None = None,
    space: str = "srgb",
    illuminant: str = "D65",
    observer: str | int = CIE_1931,
    delta_e: float = 0.1,
    kind: str = "png",
    name: str = "glaze",
    overwrite: bool = False,
    progress: Progress = no_progress,
) -> TextureSet:
    """Write textures for OpenPBR, MaterialX, Blender's Principled BSDF and game engines.

    Args:
        glaze: what does not change; or a stack, of a card its white half.
        folder: for the files; made if it is missing.
        thickness: (h, w), of `layer`, m.
        fraction: (h, w), share of the second paint of `layer`, a mixture of two.
        ground: (h, w), reflectance of the ground as seen from inside the paint.
        layer: number of the layer that changes, 0 the top one.
        roughness: alpha of the surface, 0 (smooth) to 1.
        coat: one body of the lightest colour, and a picture of a coat that colours it, for programs
            that absorb along refracted paths, such as Blender. A handle for artists: it comes no
            nearer than the base colour alone.
        pixel: width of a pixel, m: writes height and normals of the thickness map too.
        space: "srgb" or "acescg"; PNG holds sRGB only.
        illuminant, observer: of the colours, see `glazejax.colour.colour_weights`.
        delta_e: largest CIEDE2000 wanted between a pixel and the computation for it alone.
        kind: "png" (16 bits a channel, base colour and coat encoded as sRGB) or "exr" (linear).
        name: files begin with it; letters, digits and underscores, beginning with a letter.
        overwrite: replace files that exist.
        progress: called with what is done of each stage.

    Raises:
        ValueError: no map, maps of different shapes or out of range, or what `fit_openpbr` and
            `write_materialx` refuse.
        FileExistsError: a file exists.
        ModuleNotFoundError: OpenEXR is not installed.
    """
    # Wrong input is refused before anything is computed.
    linear_space = find_space(space)
    check_roughness(roughness)
    check_name(name)
    if kind not in FORMATS:
        raise ValueError(f"kind is {kind!r}; choose {' or '.join(FORMATS)}")
    if kind == "png" and linear_space != "lin_rec709":
        raise ValueError("PNG holds sRGB: write kind='exr' for ACEScg")
    if kind == "exr":
        require("OpenEXR")
    if not 0 < delta_e < 100:
        raise ValueError(f"delta_e is {delta_e}; it must be positive, such as 0.1")
    maps = _check_maps({"thickness": thickness, "fraction": fraction, "ground": ground}, pixel)
    single = glaze.glaze() if isinstance(glaze, Stack) else glaze
    mapped = MappedGlaze(single, layer, tuple(maps))
    files = _files(Path(folder), name, kind, coat, pixel is not None, overwrite)
    # The colour of each pixel; all else of the material is one number.
    points = np.stack([values.reshape(-1) for values in maps.values()], axis=1)
    light = (illuminant, observer)
    colours = mapped_colours(
        mapped,
        points,
        roughness=roughness,
        space=linear_space,
        light=light,
        coat=coat,
        delta_e=delta_e,
        progress=progress,
    )
    index = float(np.mean(np.asarray(single.refractive_index)))
    material = paint_surface(index, roughness, coated=coat)
    if coat:
        material = replace(material, coat_darkening=0.0)
    beyond = colours.plain[outside(colours.plain)]
    clipped = difference(beyond, np.clip(beyond, 0.0, 1.0), linear_space)
    # How near: some pixels against a computation of all angles.
    errors = _errors(
        mapped=mapped,
        points=points,
        colours=colours,
        material=material,
        roughness=roughness,
        space=linear_space,
        light=light,
        progress=progress,
    )
    result = TextureSet(
        files=files,
        material=material,
        interpolation=colours.delta_e,
        outside=len(beyond) / len(points),
        clipped=float(clipped.max(initial=0.0)),
        errors=errors,
        computed=colours.computed,
    )
    # Pictures of colours, and the roughness as a picture of one value.
    pictures = {"base_color": colours.base}
    if colours.coat is not None:
        pictures["coat_color"] = colours.coat
    shape = next(iter(maps.values())).shape
    files["base_color"].parent.mkdir(parents=True, exist_ok=True)
    for what, values in pictures.items():
        encoded = encoded_srgb(values) if kind == "png" else values
        write_image(files[what], encoded.reshape(*shape, 3), encoded=True)
    write_image(files["roughness"], np.full(shape, np.sqrt(roughness)))
    heights: dict[str, Any] = {}
    if pixel is not None:
        # Relief: the thickness from its least to its largest.
        low = float(maps["thickness"].min())
        high = float(maps["thickness"].max())
        span = (high - low) or 1.0
        write_image(files["height"], (maps["thickness"] - low) / span)
        write_image(files["normal"], normals(maps["thickness"], pixel))
        heights["height"] = {"black_m": low, "white_m": high, "pixel_m": pixel}
    _write_words(result, linear_space, light, kind, heights)
    return result


def _check_maps(
    inputs: dict[str, Numbers | None], pixel: float | None
) -> dict[str, Float[np.ndarray, "h w"]]:
    """Maps as arrays, those that there are, of one shape."""
    maps = {kind: check_map(kind, values) for kind, values in inputs.items() if values is not None}
    if not maps:
        raise ValueError(
            "textures need a map that says what changes: thickness, fraction or ground, (h, w)"
        )
    shared_shape(list(maps.items()))
    if pixel is not None and "thickness" not in maps:
        raise ValueError(
            "height and normals are those of a thickness map: give one, or leave out the pixel's "
            "width"
        )
    if pixel is not None and not 0 < pixel < 1:
        raise ValueError(f"pixel is {pixel}; it is a pixel's width in metres, such as 50e-6")
    return maps


def _files(
    folder: Path, name: str, kind: str, coat: bool, relief: bool, overwrite: bool
) -> dict[str, Path]:
    """Paths of all files, checked to be free."""
    pictures = ["base_color", "roughness"]
    if coat:
        pictures.append("coat_color")
    if relief:
        pictures += ["height", "normal"]
    files = {what: folder / f"{name}_{what}.{kind}" for what in pictures}
    files |= {
        "materialx": folder / f"{name}.mtlx",
        "json": folder / f"{name}.json",
        "readme": folder / "README.txt",
    }
    if folder.is_dir():
        for path in files.values():
            check_output(path, overwrite=overwrite, switch="overwrite=True")
    elif folder.exists():
        raise FileExistsError(f"{folder} is a file; name a folder")
    elif not folder.parent.is_dir():
        raise FileNotFoundError(f"{folder}: the folder {folder.parent} does not exist")
    return files


def _errors(
    mapped: MappedGlaze,
    points: Float[np.ndarray, "points kinds"],
    colours: Colours,
    material: OpenPBR,
    roughness: float,
    space: Space,
    light: Viewing,
    progress: Progress,
) -> Errors:
    """Largest errors at pixels from the darkest to the lightest, each a material of its own."""
    order = np.argsort(colours.base @ np.array([0.3, 0.6, 0.1]))
    # Points of the map at which the whole material is held against the glaze, at all angles.
    chosen = dict.fromkeys(order[np.linspace(0, len(order) - 1, 5).round().astype(int)].tolist())
    errors = []
    for number, k in enumerate(chosen):
        progress(number, len(chosen), "comparing pixels at all angles")
        truth = angular_colour(
            mapped.at(points[k]),
            roughness=roughness,
            space=space,
            illuminant=light[0],
            observer=light[1],
        )
        pixel_material = replace(material, base_color=colour_tuple(colours.base[k]))
        layering: Layering = "materialx"
        if colours.coat is not None:
            pixel_material = replace(pixel_material, coat_color=colour_tuple(colours.coat[k]))
            layering = "specification"
        errors.append(material_errors(pixel_material, truth, layering))
    return Errors(*(float(max(column)) for column in zip(*errors, strict=True)))


def _write_words(
    result: TextureSet,
    space: Space,
    light: Viewing,
    kind: str,
    heights: dict[str, Any],
) -> None:
    """The MaterialX file, the JSON and the text that say what goes where."""
    files = result.files
    pictures = [what for what in result.files if what in SOCKETS]
    colour = "srgb_texture" if kind == "png" else space
    images = {what: ImageNode(files[what].name, colour) for what in COLOURS if what in files}
    rough = ImageNode(files["roughness"].name)
    images["specular_roughness"] = rough
    if "coat_color" in files:
        images["coat_roughness"] = rough
    write_materialx(
        result.material,
        files["materialx"],
        name=files["json"].stem,
        space=space,
        images=images,
        normal=ImageNode(files["normal"].name) if "normal" in files else None,
        overwrite=True,
    )
    record = {
        "glazejax": "textures",
        "version": 1,
        "light": {"illuminant": light[0], "observer": str(light[1])},
        "space": SPACES[space].label,
        "textures": {
            what: {
                "file": files[what].name,
                "colour": what in COLOURS,
                "encoded": "sRGB" if kind == "png" and what in COLOURS else "linear",
                "blender": SOCKETS[what],
            }
            for what in pictures
        },
        "values": result.material.parameters(),
        "delta_e_2000_interpolation": result.interpolation,
        "share_outside_gamut": result.outside,
        "delta_e_2000_clipped": result.clipped,
        "largest_errors_at_some_pixels": result.errors._asdict(),
        **heights,
    }
    files["json"].write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
    files["readme"].write_text(readme(result.material, files, record), encoding="utf-8")
