"""A material as a MaterialX 1.39 file: the node `open_pbr_surface`, with numbers or pictures."""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree as xml

from ...io.outputs import check_output
from .fit import OpenPBRFit
from .openpbr import COLOURS, OpenPBR
from .rgb import SPACES
from .spaces import find_space

VERSION = "1.39"


class ImageNode(NamedTuple):
    """A picture in place of a number."""

    file: str
    """Path as the file says it, relative to the file."""
    colorspace: str = ""
    """Such as ``srgb_texture``; empty for numbers that are no colours."""


def write_materialx(
    fit: OpenPBRFit | OpenPBR,
    path: str | Path,
    *,
    name: str = "glaze",
    space: str = "srgb",
    images: Mapping[str, ImageNode] | None = None,
    normal: ImageNode | None = None,
    overwrite: bool = False,
) -> Path:
    """Write a material to a ``.mtlx`` file, valid MaterialX 1.39.

    Args:
        fit: of `fit_openpbr`, which knows its space and errors, or parameters alone.
        path: file to write.
        name: of the material: letters, digits and underscores, beginning with a letter.
        space: of the colours, where `fit` is parameters alone.
        images: pictures in place of parameters, by their names.
        normal: a tangent-space normal map.
        overwrite: replace the file if it exists.

    Returns:
        The path.

    Raises:
        ValueError: a path that does not end in .mtlx, or a name that MaterialX does not take.
        FileExistsError, FileNotFoundError, IsADirectoryError: see
            `glazejax.io.outputs.check_output`.
    """
    path = Path(path)
    if path.suffix.lower() != ".mtlx":
        raise ValueError(f"{path}: a MaterialX file ends in .mtlx")
    check_name(name)
    path = check_output(path, overwrite=overwrite, switch="overwrite=True")
    material, colour_space, comment = (
        (fit, find_space(space), "") if isinstance(fit, OpenPBR) else _describe_fit(fit)
    )
    root = xml.Element("materialx", {"version": VERSION, "colorspace": colour_space})
    if comment:
        root.set("doc", comment)
    pictures = images or {}
    for parameter, image in pictures.items():
        _image(root, f"{name}_{parameter}", "color3" if parameter in COLOURS else "float", image)
    if normal is not None:
        _image(root, f"{name}_normal_picture", "vector3", normal)
        node = _add(root, "normalmap", f"{name}_normal", "vector3")
        _add(node, "input", "in", "vector3", nodename=f"{name}_normal_picture")
    shader = _add(root, "open_pbr_surface", f"{name}_surface", "surfaceshader")
    for parameter, value in material.parameters().items():
        if parameter in pictures:
            source = {"nodename": f"{name}_{parameter}"}
        else:
            numbers = value if isinstance(value, tuple) else (value,)
            source = {"value": ", ".join(f"{number:.6g}" for number in numbers)}
        _add(shader, "input", parameter, "color3" if parameter in COLOURS else "float", **source)
    if normal is not None:
        for parameter in ("geometry_normal", "geometry_coat_normal"):
            _add(shader, "input", parameter, "vector3", nodename=f"{name}_normal")
    top = _add(root, "surfacematerial", name, "material")
    _add(top, "input", "surfaceshader", "surfaceshader", nodename=f"{name}_surface")
    xml.indent(root)
    path.write_text(
        '<?xml version="1.0"?>\n' + xml.tostring(root, encoding="unicode") + "\n", encoding="utf-8"
    )
    return path


def check_name(name: str) -> None:
    """Refuse what MaterialX does not take as a material's name.

    Raises:
        ValueError: it is not letters, digits and underscores, beginning with a letter.
    """
    if not name.isidentifier() or not name.isascii() or name.startswith("_"):
        raise ValueError(
            f"the material's name is {name!r}; use letters, digits and _, beginning with a letter"
        )


def _describe_fit(fit: OpenPBRFit) -> tuple[OpenPBR, str, str]:
    """Material, space, and the errors in words, for the file's doc."""
    errors = fit.errors
    truth = fit.truth
    comment = (
        f"OpenPBR 1.1 fitted by glazejax to a computed glaze; {SPACES[truth.space].label}, "
        f"{truth.light[0]}; layers as in {fit.layering}. Remaining error: albedo "
        f"{errors.albedo:.4f}, RMS of the reflectance factor {errors.rms:.4f}, mean Delta E 2000 "
        f"{errors.sky:.2f} under an even sky and {errors.lamp:.2f} under a lamp at 45 degrees."
    )
    return fit.material, truth.space, comment


def _image(root: xml.Element, name: str, kind: str, image: ImageNode) -> None:
    node = _add(root, "image", name, kind)
    space = {"colorspace": image.colorspace} if image.colorspace else {}
    _add(node, "input", "file", "filename", value=image.file, **space)


def _add(parent: xml.Element, tag: str, name: str, kind: str, **further: str) -> xml.Element:
    """A new element with a name, a type and further attributes."""
    return xml.SubElement(parent, tag, {"name": name, "type": kind}, **further)
