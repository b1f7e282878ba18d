"""Report of ``glazejax export``: what was written, how near it is, and what that means."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from ..appearance.exports.rgb import SPACES
from ..paint.describe import format_length

if TYPE_CHECKING:
    from ..appearance.exports.fit import Errors, OpenPBRFit
    from ..appearance.exports.textures import TextureSet
    from ..stacks import Stack


Lines: TypeAlias = Iterator[tuple[str, str]]
"""Titles, empty where a line goes on from the one above it, and texts."""

_MEANING = "", "Delta E is CIEDE2000, seen from 0 to 75 degrees: below 1 is hard to see."


def report_stack(stack: "Stack", roughness: float) -> Lines:
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
    yield "stack", f"{coats}, ground {ground}, n = {stack.refractive_index:g}, {surface}"
    if stack.ground == "card":
        yield "note", "the stack lies on a card of white and black: exported over white"


def report_fit(fit: "OpenPBRFit", path: Path) -> Lines:
    """Say what was fitted, and how near it is."""
    material = fit.material
    truth = fit.truth
    space = SPACES[truth.space].label
    yield "wrote", f"{path}: OpenPBR 1.1 in MaterialX 1.39, colours in {space}, {truth.light[0]}"
    colour = " ".join(f"{value:.4g}" for value in material.base_color)
    yield (
        "",
        f"base_color {colour}, base_diffuse_roughness {material.base_diffuse_roughness:.3g}, "
        f"specular_ior {material.specular_ior:.4g}, specular_roughness "
        f"{material.specular_roughness:.3g}",
    )
    if material.coat_weight:
        colour = " ".join(f"{value:.4g}" for value in material.coat_color)
        yield (
            "",
            f"coat_color {colour}, coat_ior {material.coat_ior:.4g}, coat_darkening "
            f"{material.coat_darkening:.3g}",
        )
    yield from _errors(fit.errors)
    plain = fit.naive_errors
    yield (
        "",
        f"without the fit (base_color as seen straight on): albedo {plain.albedo:.3f}, Delta E "
        f"{plain.sky:.2f} and {plain.lamp:.2f}, RMS {plain.rms:.3f}",
    )
    if fit.layering != "materialx":
        errors = fit.errors_with("materialx")
        yield (
            "note",
            f"in a program that layers as in materialx: Delta E {errors.sky:.2f} and "
            f"{errors.lamp:.2f}",
        )
    # A smaller share is rounding.
    if fit.outside > 5e-4:
        advice = "; --space acescg holds it" if truth.space == "lin_rec709" else ""
        yield (
            "note",
            f"{fit.outside:.0%} of the angles show a colour that {space} cannot hold: it is "
            f"brought inside{advice}",
        )
    yield _MEANING
    if fit.layering != "reciprocal":
        yield (
            "",
            "Most of the RMS is light that comes in at a slant, which OpenPBR's layers let in "
            "unweakened.",
        )


def report_textures(textures: "TextureSet", folder: Path) -> Lines:
    """Say what was written, and how near it is."""
    names = ", ".join(path.name for path in textures.files.values())
    yield "wrote", f"{folder}: {names}"
    yield (
        "",
        "README.txt says which picture goes into which socket of Blender, and into game engines",
    )
    yield (
        "pixels",
        f"{textures.computed} glazes computed, the others interpolated within Delta E "
        f"{textures.interpolation:.2g} (estimated)",
    )
    yield from _errors(textures.errors, "at the worst of some pixels, ")
    # A smaller share is rounding.
    if textures.outside > 5e-4:
        yield (
            "note",
            f"{textures.outside:.1%} of the pixels have a colour that the space cannot hold: "
            f"brought inside, changed by Delta E {textures.clipped:.2g} at most; --format exr "
            "--space acescg holds it",
        )
    yield _MEANING


def _errors(errors: "Errors", where: str = "") -> Lines:
    yield (
        "how near",
        f"{where}under an even sky: albedo within {errors.albedo:.3f}, Delta E {errors.sky:.2f} "
        f"(mean), {errors.sky_most:.2f} (most)",
    )
    yield (
        "",
        f"under a lamp at 45 degrees: Delta E {errors.lamp:.2f} (mean), {errors.lamp_most:.2f} "
        "(most)",
    )
    yield "", f"reflectance factor over all pairs of angles: RMS {errors.rms:.3f}"
