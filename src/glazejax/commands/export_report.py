"""Report of ``glazejax export``: what was written, how near it is, and what that means."""

from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from ..appearance.exports.rgb import SPACES
from ..paint.describe import format_length

if TYPE_CHECKING:
    from ..appearance.exports.fit import Errors, OpenPBRFit
    from ..appearance.exports.textures import TextureSet
    from ..stacks import Stack


def _line(console: Console, title: str, text: str) -> None:
    console.print(f"{title:9}{text}", markup=False)


def print_stack(console: Console, stack: "Stack", roughness: float) -> None:
    """Say what is exported."""
    from ..stacks import Spectrum

    coats = " over ".join(f"{coat.name} {format_length(coat.total)}" for coat in stack.shown)
    ground_level = stack.level()
    ground = (
        f"a spectrum, mean {ground_level.reflectance.mean():.2f}"
        if isinstance(ground_level, Spectrum)
        else f"{ground_level:g}"
    )
    surface = "a smooth surface" if roughness == 0 else f"a surface of roughness {roughness:g}"
    _line(console, "stack", f"{coats}, ground {ground}, n = {stack.refractive_index:g}, {surface}")
    if stack.ground == "card":
        _line(console, "note", "the stack lies on a card of white and black: exported over white")


def print_fit(console: Console, fit: "OpenPBRFit", path: Path) -> None:
    """Say what was fitted, and how near it is."""
    material = fit.material
    truth = fit.truth
    space = SPACES[truth.space].label
    _line(
        console,
        "wrote",
        f"{path}: OpenPBR 1.1 in MaterialX 1.39, colours in {space}, {truth.light[0]}",
    )
    colour = " ".join(f"{value:.4g}" for value in material.base_color)
    _line(
        console,
        "",
        f"base_color {colour}, base_diffuse_roughness {material.base_diffuse_roughness:.3g}, "
        f"specular_ior {material.specular_ior:.4g}, specular_roughness "
        f"{material.specular_roughness:.3g}",
    )
    if material.coat_weight:
        colour = " ".join(f"{value:.4g}" for value in material.coat_color)
        _line(
            console,
            "",
            f"coat_color {colour}, coat_ior {material.coat_ior:.4g}, coat_darkening "
            f"{material.coat_darkening:.3g}",
        )
    _errors(console, fit.errors)
    plain = fit.naive_errors
    _line(
        console,
        "",
        f"without the fit (base_color as seen straight on): albedo {plain.albedo:.3f}, Delta E "
        f"{plain.sky:.2f} and {plain.lamp:.2f}, RMS {plain.rms:.3f}",
    )
    if fit.layering != "materialx":
        errors = fit.errors_with("materialx")
        _line(
            console,
            "note",
            f"in a program that layers as in materialx: Delta E {errors.sky:.2f} and "
            f"{errors.lamp:.2f}",
        )
    # A smaller share is rounding.
    if fit.outside > 5e-4:
        advice = "; --space acescg holds it" if truth.space == "lin_rec709" else ""
        _line(
            console,
            "note",
            f"{fit.outside:.0%} of the angles show a colour that {space} cannot hold: it is "
            f"brought inside{advice}",
        )
    _meaning(console)
    if fit.layering != "reciprocal":
        _line(
            console,
            "",
            "Most of the RMS is light that comes in at a slant, which OpenPBR's layers let in "
            "unweakened.",
        )


def print_textures(console: Console, textures: "TextureSet", folder: Path) -> None:
    """Say what was written, and how near it is."""
    names = ", ".join(path.name for path in textures.files.values())
    _line(console, "wrote", f"{folder}: {names}")
    _line(
        console,
        "",
        "README.txt says which picture goes into which socket of Blender, and into game engines",
    )
    _line(
        console,
        "pixels",
        f"{textures.computed} glazes computed, the others interpolated within Delta E "
        f"{textures.interpolation:.2g} (estimated)",
    )
    _errors(console, textures.errors, "at the worst of some pixels, ")
    # A smaller share is rounding.
    if textures.outside > 5e-4:
        _line(
            console,
            "note",
            f"{textures.outside:.1%} of the pixels have a colour that the space cannot hold: "
            f"brought inside, changed by Delta E {textures.clipped:.2g} at most; --format exr "
            "--space acescg holds it",
        )
    _meaning(console)


def _errors(console: Console, errors: "Errors", where: str = "") -> None:
    _line(
        console,
        "how near",
        f"{where}under an even sky: albedo within {errors.albedo:.3f}, Delta E {errors.sky:.2f} "
        f"(mean), {errors.sky_most:.2f} (most)",
    )
    _line(
        console,
        "",
        f"under a lamp at 45 degrees: Delta E {errors.lamp:.2f} (mean), {errors.lamp_most:.2f} "
        "(most)",
    )
    _line(console, "", f"reflectance factor over all pairs of angles: RMS {errors.rms:.3f}")


def _meaning(console: Console) -> None:
    _line(console, "", "Delta E is CIEDE2000, seen from 0 to 75 degrees: below 1 is hard to see.")
