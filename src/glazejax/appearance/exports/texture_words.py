"""Sockets that the textures go into, in words for someone new."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from .openpbr import COLOURS, OpenPBR

SOCKETS = {
    "base_color": "Base Color",
    "roughness": "Roughness",
    "coat_color": "Coat > Tint",
    "normal": "Normal, through a Normal Map node",
    "height": "Displacement of the material's output, through a Displacement node",
}
"""Sockets of Blender's Principled BSDF."""


def readme(material: OpenPBR, files: Mapping[str, Path], record: Mapping[str, Any]) -> str:
    """Text of the README of the textures.

    Args:
        material: what has no texture.
        files: by what they are.
        record: what the JSON holds.
    """
    coated = "coat_color" in files
    lines = [
        "Textures of a glaze, computed by glazejax from its paints "
        f"({record['space']}, {record['light']['illuminant']}).",
        "",
        "Blender: Principled BSDF, sockets",
    ]
    for what, socket in SOCKETS.items():
        if what in files:
            space = "Non-Color"
            if what in COLOURS:
                space = "Linear Rec.709" if record["space"] == "linear sRGB" else record["space"]
            if record["textures"][what]["encoded"] == "sRGB":
                space = "sRGB"
            lines.append(f"  {files[what].name:28} -> {socket} (image colour space: {space})")
    lines += [f"  IOR {material.specular_ior:g}, Metallic 0"]
    if coated:
        lines += [
            f"  Coat: Weight 1, IOR {material.coat_ior:g}, {files['roughness'].name} into its "
            "Roughness",
            "  Specular > IOR Level 0: under the coat lies paint of the same index, without a "
            "second reflection",
        ]
    if "height" in record:
        high = record["height"]["white_m"]
        low = record["height"]["black_m"]
        lines += [f"  Displacement: Midlevel 0, Scale {high - low:g} (metres from black to white)"]
    specular = ((material.specular_ior - 1) / (material.specular_ior + 1)) ** 2 / 0.08
    lines += [
        "",
        "Unreal, Unity, Godot and glTF: base colour and roughness as above, metallic 0,",
        f"  specular {specular:.3g} where there is such a number (Unreal), index "
        f"{material.specular_ior:g} where one is asked for.",
        "  Normals point up with green, as OpenGL has it; Unreal wants green turned over."
        if "normal" in files
        else "",
        f"MaterialX: {files['materialx'].name} has all of it (open_pbr_surface).",
        "",
        "How near this is:",
        "  pixels compared with the computation of each: Delta E 2000 "
        f"{record['delta_e_2000_interpolation']:.2g} at most, as estimated",
        f"  pixels whose colour {record['space']} cannot hold: {record['share_outside_gamut']:.1%}"
        + (
            f", changed by Delta E 2000 {record['delta_e_2000_clipped']:.2g} at most"
            if record["share_outside_gamut"]
            else ""
        ),
    ]
    errors = record["largest_errors_at_some_pixels"]
    lines += [
        "  the material compared with the glaze at all angles, the worst of some pixels:",
        f"  albedo {errors['albedo']:.3f}, RMS of the reflectance factor {errors['rms']:.3f},",
        f"  mean Delta E 2000 {errors['sky']:.2f} under an even sky, {errors['lamp']:.2f} under "
        "a lamp at 45 degrees",
    ]
    return "\n".join(lines) + "\n"
