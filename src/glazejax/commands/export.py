"""The command ``glazejax export``: a stack in; a material or textures for another program out."""

import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..appearance.exports.spaces import LAYERINGS, find_space
from ..paint.describe import MAX_THICKNESS, name_paints, names_file, parse_coats
from . import options
from .command_line import changed, ground_file
from .help_groups import help_groups
from .progress import follow, plain_console

if TYPE_CHECKING:
    import numpy as np
    from jaxtyping import Float

    from ..paint.media import Glaze
    from ..stacks import Stack

_USUAL = {"openpbr": "glaze.mtlx", "textures": "glaze-textures"}
_GROUND = "0.9"


@help_groups(
    usual="--to --out --ground --thickness-map --format",
    given="--thickness-range --fraction-map --ground-map --layer --pixel --pigments --roughness",
    tried="--layering --coat",
    written="--space --overwrite",
    fine="--illuminant --observer --refractive-index --delta-e --tolerance",
)
def export(
    stack: Annotated[
        str,
        typer.Argument(
            metavar="STACK",
            help='Coats from top to bottom, "UltramarineBlue:3um, ZincWhite:20um", as `glazejax '
            "render --coats` takes them, or a JSON file of the studio or of --write-stack.",
        ),
    ],
    to: Annotated[
        str,
        typer.Option(
            metavar="KIND",
            callback=options.among(*_USUAL),
            help="openpbr: parameters fitted to the stack, in a MaterialX file. textures: "
            "pictures for Blender and game engines, of a map.",
        ),
    ] = "openpbr",
    out: Annotated[
        Path | None,
        options.option(
            "--out",
            "-o",
            metavar="PATH",
            help="File .mtlx, or the folder for textures. Default: glaze.mtlx or glaze-textures.",
        ),
    ] = None,
    ground: Annotated[str | None, options.ground_option(_GROUND)] = None,
    refractive_index: options.RefractiveIndexOfStack = None,
    roughness: Annotated[
        float,
        typer.Option(
            callback=options.between(0.0, 1.0),
            help="Roughness of the surface, alpha of GGX: 0 (smooth) to 1. OpenPBR uses its root.",
        ),
    ] = 0.0,
    space: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            callback=options.checked(find_space),
            help="Linear RGB of the colours: srgb or acescg.",
        ),
    ] = "srgb",
    illuminant: options.Illuminant = "D65",
    observer: options.Observer = "2",
    layering: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            callback=options.among(*LAYERINGS),
            help="Layering rule of your renderer: materialx (its node graph, most programs), "
            "specification (the coat absorbs along slanted paths) or reciprocal (layers "
            "attenuate incoming light, too).",
        ),
    ] = "materialx",
    coat: Annotated[
        bool | None,
        options.option(
            "--coat/--no-coat",
            help="With a coat or without. Default: whichever fits better.",
        ),
    ] = None,
    thickness_map: Annotated[
        Path | None,
        options.file_option(
            help="Map of a coat's thickness: .npy in metres, or a grey picture from 0 (black) to "
            "the coat's own thickness (white).",
        ),
    ] = None,
    thickness_range: Annotated[
        str | None,
        options.option(
            metavar="RANGE",
            help="Thickness of 0 and 1 in --thickness-map, such as 0-20um.",
        ),
    ] = None,
    fraction_map: Annotated[
        Path | None,
        options.file_option(
            help="Share of the second paint of a mixed coat, 0 to 1: .npy or grey.",
        ),
    ] = None,
    ground_map: Annotated[
        Path | None,
        options.file_option(
            help="Reflectance of the ground, 0 to 1: .npy or grey.",
        ),
    ] = None,
    layer: Annotated[int, typer.Option(metavar="N", help="Coat of the maps, 1 the top one.")] = 1,
    pixel: Annotated[
        str | None,
        options.option(
            metavar="LENGTH",
            help="Width of a pixel of the map, such as 50um: writes height and normals of the "
            "paint too.",
        ),
    ] = None,
    format: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            callback=options.among("png", "exr"),
            help="Textures as png (16 bits) or exr.",
        ),
    ] = "png",
    delta_e: Annotated[
        float,
        typer.Option(help="Largest Delta E 2000 that textures may add by interpolation."),
    ] = 0.1,
    pigments: Annotated[
        Path | None,
        options.file_option(
            help="Your own paints, added to the catalogue's: a pigments.csv of `glazejax recover`.",
        ),
    ] = None,
    tolerance: options.Tolerance = 1e-4,
    overwrite: options.Overwrite = False,
) -> None:
    """Export a stack of coats to a renderer or a game engine, with its error.

    OpenPBR has no scattering layers, so its parameters are fitted. The
    report states the error in Delta E 2000 (1 is barely visible) and in
    reflectance, compared with no fit.

    Example: glazejax export "UltramarineBlue:3um, ZincWhite:20um"
    """
    started = time.perf_counter()
    from .main import start_jax

    for_textures = {
        "thickness_map": thickness_map,
        "fraction_map": fraction_map,
        "ground_map": ground_map,
        "thickness_range": thickness_range,
        "pixel": pixel,
        "layer": layer,
        "format": format,
        "delta_e": delta_e,
    }
    for_openpbr = {"layering": layering, "tolerance": tolerance}
    _check_kind(to, changed(export, for_textures), changed(export, for_openpbr))
    path = Path(_USUAL[to]) if out is None else out
    if to == "openpbr" and path.suffix.lower() != ".mtlx":
        raise ValueError(f"--out {path}: a MaterialX file ends in .mtlx")
    if to != "textures":
        options.check_outputs(
            {"--out": path},
            overwrite,
            pictures=(),
            inputs=[Path(stack), ground_file(ground), pigments],
        )
    if names_file(stack):
        options.existing(Path(stack))
    else:
        options.check_coats(stack, pigments)
    start_jax()
    from ..colour import find_illuminant, find_observer
    from . import export_report as report

    illuminant = find_illuminant(illuminant)
    observer = find_observer(observer)
    exported = _stack(stack, ground, refractive_index, pigments)
    glaze = exported.glaze()
    console = plain_console(soft_wrap=True)
    light: dict[str, Any] = {"illuminant": illuminant, "observer": observer}
    if to == "openpbr":
        from ..appearance.exports.fit import fit_openpbr
        from ..appearance.exports.materialx import write_materialx

        with follow("computing all angles, then fitting") as note:
            fit = fit_openpbr(
                glaze,
                roughness=roughness,
                space=space,
                layering=layering,  # pyright: ignore[reportArgumentType]
                coat=coat,
                tolerance=tolerance,
                progress=note,
                **light,
            )
        write_materialx(fit, path, overwrite=overwrite)
        lines = report.report_fit(fit, path)
    else:
        from ..appearance.exports.textures import texture_set

        maps = _maps(glaze, layer, thickness_map, thickness_range, fraction_map, ground_map)
        width = None if pixel is None else options.read_length(pixel, "--pixel")
        with follow("computing colours where they are needed") as note:
            textures = texture_set(
                glaze,
                path,
                **maps,
                layer=layer - 1,
                roughness=roughness,
                coat=bool(coat),
                pixel=width,
                space=space,
                delta_e=delta_e,
                kind=format,
                overwrite=overwrite,
                progress=note,
                **light,
            )
        lines = report.report_textures(textures, path)
    for title, text in (*report.report_stack(exported, roughness), *lines):
        console.print(f"{title:9}{text}")
    console.print(f"done in {time.perf_counter() - started:.1f} s")


def _check_kind(to: str, of_textures: list[str], of_openpbr: list[str]) -> None:
    """Refuse what cannot be meant, before anything is loaded, by the options that were stated."""
    if to != "textures" and of_textures:
        raise ValueError(f"{of_textures[0]} is for textures: add --to textures")
    if to != "openpbr" and of_openpbr:
        raise ValueError(f"{of_openpbr[0]} is for openpbr: leave it out, or give --to openpbr")
    if to == "textures" and not any(option.endswith("-map") for option in of_textures):
        raise ValueError(
            "textures need a map that says what changes: add --thickness-map FILE, "
            "--fraction-map FILE or --ground-map FILE"
        )


def _stack(text: str, ground: str | None, index: float | None, pigments: Path | None) -> "Stack":
    """The stack of a file, or of coats as typed; options count before a file."""
    from ..paint.pigment_table import read_pigments
    from ..stacks import Stack, all_paints, common_grid, paints, read_stack

    own_paints = {} if pigments is None else dict(read_pigments(pigments))
    if names_file(text):
        stack = read_stack(Path(text))
    else:
        coats = name_paints(parse_coats(text), {**all_paints(), **own_paints})
        stack = Stack(coats, ground=float(_GROUND))
    stack = replace(stack, pigments={**stack.pigments, **own_paints})
    if index is not None:
        stack = replace(stack, refractive_index=index)
    if ground is None:
        return stack
    below = options.read_ground(ground)
    stack = replace(stack, ground=below.level)
    # Looked at here, where the ground's file is known.
    with below.blame():
        common_grid(stack, paints(stack))
    return stack


def _maps(
    glaze: "Glaze",
    layer: int,
    thickness: Path | None,
    span: str | None,
    fraction: Path | None,
    ground: Path | None,
) -> "dict[str, Float[np.ndarray, 'h w']]":
    """Maps of the options, in metres and shares."""
    from ..appearance.scene.file_materials import read_grey

    if not 1 <= layer <= len(glaze.coats):
        raise ValueError(
            f"--layer is {layer}, but there are {len(glaze.coats)} coats, the top one is 1"
        )
    maps = {}
    if span is not None and thickness is None:
        raise ValueError("--thickness-range has no meaning without --thickness-map FILE")
    if thickness is not None:
        metres = span is None and thickness.suffix.lower() == ".npy"
        grey = read_grey(thickness, heights=metres)
        if metres:
            if grey.min() < 0 or grey.max() > MAX_THICKNESS:
                raise ValueError(
                    f"{thickness}: holds {grey.min():g} to {grey.max():g}; thicknesses are in "
                    f"metres, 0 to {MAX_THICKNESS:g} (20 micrometres are 20e-6); values from 0 to "
                    "1 take --thickness-range, such as 0-20um"
                )
            maps["thickness"] = grey
        else:
            low, high = (
                (0.0, float(glaze.coats[layer - 1].thickness))
                if span is None
                else options.read_lengths(span, "--thickness-range", from_zero=True)
            )
            if thickness.suffix.lower() == ".npy" and 0 < grey.max() <= MAX_THICKNESS:
                raise ValueError(
                    f"{thickness}: holds {grey.min():g} to {grey.max():g}, which looks like "
                    "metres: leave out --thickness-range, which is of values from 0 to 1"
                )
            maps["thickness"] = low + (high - low) * grey
    for name, path in (("fraction", fraction), ("ground", ground)):
        if path is not None:
            maps[name] = read_grey(path)
    return maps
