"""The command ``glazejax render``: a description of a glaze in; numbers, a table and a
picture out.
"""

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..catalogue import assumed_scale
from ..paint.describe import find_name, format_length, name_paints, parse_coats, same_name
from . import options
from .command_line import ground_file
from .help_groups import help_groups
from .progress import follow, plain_console

if TYPE_CHECKING:
    from ..paint.describe import Coat
    from ..paint.media import Mixture, Pigment
    from ..stacks import Stack


_GEOMETRY = "0:0"
_GROUND = "0.9"


@help_groups(
    usual="--coats --ground --catalogue --out --list",
    given="--stack --pigments --instrument --illuminant --observer",
    written="--csv --write-stack --ladder --overwrite",
    fine="--refractive-index --tolerance",
)
def render(
    coats: Annotated[
        str | None,
        options.option(
            help='Coats from top to bottom: "UltramarineBlue:12um, Vermillion:12um". Mixtures: '
            '"0.7*ZincWhite + 0.3*CobaltBlue:20um". Equal coats: "Eosin:5um x3". Units: um, µm, '
            "mm, nm, m.",
        ),
    ] = None,
    stack: Annotated[
        Path | None,
        options.file_option(
            help="Stack of `glazejax studio` or --write-stack (coats, ground, index, instrument), "
            "in place of --coats. --ground, --instrument and --refractive-index override it.",
        ),
    ] = None,
    write_stack: Annotated[
        Path | None,
        options.option(
            metavar="FILE",
            help="Also write the stack as JSON, for the studio.",
        ),
    ] = None,
    ground: Annotated[str | None, options.ground_option(_GROUND)] = None,
    refractive_index: options.RefractiveIndexOfStack = None,
    instrument: Annotated[str | None, options.instrument_option(_GEOMETRY)] = None,
    illuminant: options.Illuminant = "D65",
    observer: options.Observer = "2",
    out: options.Picture = Path("glaze.png"),
    csv: options.Csv = None,
    overwrite: options.Overwrite = False,
    ladder: Annotated[
        str | None,
        options.option(
            help="Paint of the coat that the ladder repeats. Default: the top one.",
        ),
    ] = None,
    pigments: Annotated[
        Path | None,
        options.file_option(
            help="Your own paints, added to the catalogue's: a pigments.csv of `glazejax "
            "recover`. Yours have precedence where names are equal.",
        ),
    ] = None,
    catalogue: options.CatalogueName = None,
    tolerance: options.Tolerance = 1e-6,
    list_pigments: Annotated[
        bool, typer.Option("--list", help="List the paints, and stop.")
    ] = False,
) -> None:
    """Compute the colour of a glaze: reflectance, XYZ, Lab, sRGB, and a picture.

    The picture shows the spectrum, a swatch, and a ladder: the colour of
    1 to 40 coats of one layer, compared with "multiply" layers of digital
    painting and with mixed paint.

    Example: glazejax render --coats "CobaltBlue:1um, ChromeYellow:10um"
    """
    started = time.perf_counter()
    from .main import start_jax

    console = plain_console()
    if list_pigments:
        from ..spectra import describe_grid

        for name, pigment in _shelf(pigments, catalogue).items():
            console.print(f"{name:24} {describe_grid(pigment.wavelengths)}")
        return
    if coats is not None and stack is not None:
        raise ValueError(f"--stack {stack} says what the coats are: leave out --coats")
    if catalogue is not None and stack is not None:
        raise ValueError(f"--stack {stack} says which paints it has: leave out --catalogue")
    if coats is None and stack is None:
        raise ValueError(
            'give the coats, such as --coats "UltramarineBlue:12um,Vermillion:12um"; --list '
            "shows the pigments"
        )
    # Everything that can be wrong is looked at before anything is computed.
    if coats is not None:
        options.check_coats(coats, pigments, catalogue)
    options.check_outputs(
        {"--out": out, "--csv": csv, "--write-stack": write_stack},
        overwrite,
        inputs=[stack, ground_file(ground), pigments],
    )
    # One program, which runs once.
    start_jax(optimisation=0)
    from ..colour import find_illuminant, find_observer
    from ..paint.pigment_table import read_pigments
    from ..stacks import Stack, paints

    given = (
        Stack(parse_coats(coats or ""), ground=float(_GROUND), instrument=_GEOMETRY)
        if stack is None
        else _read_stack(stack)
    )
    if refractive_index is None:
        refractive_index = given.refractive_index
    seen_by = options.read_geometry(instrument, given.instrument)
    illuminant = find_illuminant(illuminant)
    observer = find_observer(observer)
    if stack is None:
        named = [name for coat in given.shown for _, name in coat.parts]
        shelf = _shelf(pigments, catalogue, named)
    else:
        shelf = {**paints(given), **({} if pigments is None else read_pigments(pigments))}
    described = name_paints(given.shown, shelf)
    if write_stack is not None:
        _check_size(described)
    repeated = _ladder_layer(described, ladder)
    below = _ground_of(given) if ground is None else options.read_ground(ground)
    media, bed = _lay(below, described, shelf)

    from ..paint.media import Glaze, Layer
    from ..plots import load_matplotlib_ahead, save_picture
    from . import render_report as report
    from .plots import glaze_figure
    from .rendering import render as compute

    glaze = Glaze(
        [Layer(medium, coat.total) for medium, coat in zip(media, described, strict=True)],
        bed.on(media[0].wavelengths),
        refractive_index,
    )
    coat = described[repeated]
    load_matplotlib_ahead()
    solving = time.perf_counter()
    with follow("compiling, then solving"):
        rendering = compute(
            glaze,
            seen_by,
            layer=repeated,
            coat=coat.thickness,
            illuminant=illuminant,
            observer=observer,
            tolerance=tolerance,
        )
    solved = time.perf_counter() - solving
    seen = seen_by.describe()
    present = [f"{coat.name} {coat.size}" for coat in described if coat.total > 0]
    with follow("drawing"):
        figure = glaze_figure(
            rendering,
            [coat.name for coat in described],
            title=" over ".join(present) or "No paint at all",
            subtitle=f"on a ground of {bed.words}  ·  n = {refractive_index:g}  ·  {seen}  ·  "
            f"{rendering.eye}",
            coat=f"{coat.name} {format_length(coat.thickness)}",
            marked=coat.repeats,
        )
        # Files first: a pager that closes early must not lose them.
        save_picture(figure, out, dpi=100)
    if write_stack is not None:
        drawn = Stack(
            described,
            ground=bed.level,
            refractive_index=refractive_index,
            instrument=seen_by.notation,
            pigments=shelf,
        )
        _write_stack(write_stack, drawn, overwrite)
    if csv is not None:
        _write_table(csv, rendering, described, overwrite)

    used = {
        name: shelf[name]
        for coat in described
        if coat.total > 0
        for weight, name in coat.parts
        if weight > 0
    }
    remarks = [("note", words) for words in bed.notes] + _remarks(used)
    if rendering.ladder.capped:
        remarks.append(("note", "coats of the ladder that reach 10 mm are shown at 10 mm"))
    lines = [
        *report.report_stack(
            described,
            ground=bed.words,
            refractive_index=refractive_index,
            seen=seen,
            width=console.width,
        ),
        *report.report_rendering(rendering, described, coat, console.width),
        *(["", report.report_remarks(remarks)] if remarks else []),
    ]
    for line in lines:
        console.print(line)
    files = " and ".join(str(path) for path in (out, csv, write_stack) if path is not None)
    total = time.perf_counter() - started
    console.print()
    console.print(f"wrote {files} in {total:.1f} s ({solved:.1f} s of it computing spectra)")


def _read_stack(path: Path) -> "Stack":
    """A stack to draw, which shows a coat at least."""
    from ..stacks import read_stack

    stack = read_stack(path)
    if not stack.shown:
        raise ValueError(f"--stack {path} shows no coat: add one, or show one that is hidden")
    return stack


def _ground_of(stack: "Stack") -> options.Ground:
    """The ground of a stack; of a card the white half."""
    from ..stacks import Spectrum

    level = stack.level()
    if isinstance(level, Spectrum):
        return options.Ground(level, f"a spectrum, mean {level.reflectance.mean():.2f}")
    notes = (
        ("the stack lies on a card of white and black: drawn over white",)
        if stack.ground == "card"
        else ()
    )
    return options.Ground(level, f"reflectance {level:g}", notes)


def _check_size(coats: "Sequence[Coat]") -> None:
    """Refuse coats that the file of a stack does not hold."""
    from ..stacks import MOST_COATS, MOST_PARTS

    if len(coats) > MOST_COATS:
        raise ValueError(
            f"--write-stack: there are {len(coats)} coats, and a stack's file holds {MOST_COATS} "
            "at most: write equal coats as x3, or leave it out"
        )
    for coat in coats:
        count = len({name for _, name in coat.parts})
        if count > MOST_PARTS:
            raise ValueError(
                f"--write-stack: a coat is of {count} paints, and a stack's file holds "
                f"{MOST_PARTS} at most: mix fewer, or leave it out"
            )


def _write_stack(path: Path, stack: "Stack", overwrite: bool) -> None:
    """Write the stack as JSON; of its paints, those that are in no catalogue go along."""
    from ..stacks import all_paints, write_stack

    shipped = all_paints()
    # The studio has a stroke where the command has a colon: acrylics/TitaniumWhite.
    in_studio = {
        name: stroke if (stroke := name.replace(":", "/")) in shipped else name
        for coat in stack.coats
        for _, name in coat.parts
    }
    # One of another catalogue, or one's own: the same name in the studio would be another paint.
    embedded = {
        new: stack.pigments[name]
        for name, new in in_studio.items()
        if new not in shipped or shipped[new].provenance != stack.pigments[name].provenance
    }
    coats = tuple(
        coat._replace(parts=tuple((share, in_studio[name]) for share, name in coat.parts))
        for coat in stack.coats
    )
    write_stack(path, replace(stack, coats=coats, pigments=embedded), overwrite=overwrite)


def _ladder_layer(coats: "Sequence[Coat]", ladder: str | None) -> int:
    """Layer that the ladder repeats: the named one, else the uppermost that is there."""
    if ladder is None:
        return next((i for i, coat in enumerate(coats) if coat.total > 0), 0)
    layers = [i for i, coat in enumerate(coats) if same_name(coat.name, ladder)]
    if not layers:
        names = ", ".join(dict.fromkeys(coat.name for coat in coats))
        raise ValueError(f"--ladder {ladder!r} is none of the coats: choose one of {names}")
    if coats[layers[0]].total == 0:
        raise ValueError(
            f"--ladder {ladder!r}: this coat is 0 thick, so there is nothing to repeat"
        )
    return layers[0]


def _shelf(
    path: Path | None, catalogue: str | None, names: Sequence[str] = ()
) -> "Mapping[str, Pigment]":
    """Own pigments, and a catalogue behind them unless nothing is wanted from it; for names of
    paints, those of all catalogues as ``acrylics:TitaniumWhite`` too.
    """
    from ..paint.pigment_table import read_pigments

    def has_all(shelf: "Mapping[str, Pigment]") -> bool:
        try:
            for name in names:
                find_name(name, shelf)
        except ValueError:
            return False
        return True

    paints = {} if path is None else read_pigments(path)
    if names and paints and has_all(paints):
        return paints
    shelf = {**options.read_shelf(None, catalogue), **paints}
    # The other catalogues are read where a name is of one of them, or of none.
    return shelf if has_all(shelf) else options.all_named(shelf)


def _lay(
    ground: options.Ground, coats: "Sequence[Coat]", shelf: "Mapping[str, Pigment]"
) -> "tuple[list[Pigment | Mixture], options.Ground]":
    """Paints of the coats, and the ground, on the wavelengths that all of them cover."""
    from ..paint.media import make_media
    from ..spectra import describe_grid, same_grid
    from ..stacks import Spectrum, Stack, common_grid

    level = ground.level
    notes = ground.notes
    with ground.blame():
        grid = common_grid(Stack(tuple(coats), ground=level), shelf)
    grids = [shelf[name].wavelengths for coat in coats for _, name in coat.parts]
    if isinstance(level, Spectrum):
        grids.append(level.wavelengths)
        level = Spectrum(grid, level.on(grid))
    if not all(same_grid(grid, other) for other in grids):
        note = (
            "pigments and ground differ in wavelengths; everything is computed at "
            f"{describe_grid(grid)}"
        )
        notes = (*notes, note)
    return make_media(coats, shelf, grid), ground._replace(level=level, notes=notes)


def _remarks(used: "Mapping[str, Pigment]") -> list[tuple[str, str]]:
    """Remarks on where the pigments come from, and where their numbers cannot be relied on."""
    from ..spectra import ranges

    origins: dict[str, list[str]] = {}
    for name, pigment in used.items():
        origins.setdefault(pigment.provenance or "no provenance is stated", []).append(name)
    remarks: list[tuple[str, str]] = []
    scales = dict.fromkeys(filter(None, map(assumed_scale, used.values())))
    remarks += [("note", f"{words}; thicknesses here are on that scale") for words in scales]
    remarks += [("source", f"{', '.join(names)}: {origin}") for origin, names in origins.items()]
    for name, pigment in used.items():
        if pigment.identifiable is not None and not pigment.identifiable.all():
            bands = ranges(pigment.wavelengths, ~pigment.identifiable)
            remarks.append(
                (
                    "warning",
                    f"{name} at {bands}: measurements fix only k/s there; thin coats may look "
                    "different",
                )
            )
    return remarks


def _write_table(path: Path, rendering, coats: "Sequence[Coat]", overwrite: bool) -> None:
    """Write wavelength, glaze, ground and each layer alone; `glazejax.io.read_spectra` reads it
    back.
    """
    from ..io import write_table

    titles = ["wavelength_nm", "glaze", "ground"]
    titles += [f"layer {i}: {coat.name} {coat.size} alone" for i, coat in enumerate(coats, 1)]
    columns = [rendering.wavelengths, rendering.glaze, rendering.ground, *rendering.alone]
    write_table(path, titles, zip(*columns, strict=True), overwrite=overwrite)
