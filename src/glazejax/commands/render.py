"""The command ``glazejax render``: a description of a glaze in; numbers, a table and a picture out."""

import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

if TYPE_CHECKING:
    import numpy as np
    from jaxtyping import Float

    from ..geometry import Geometry
    from ..paint.describe import Coat
    from ..paint.media import Mixture, Pigment


def register(app: typer.Typer) -> None:
    """Add the command `render` to the application."""
    app.command("render")(render)


def render(
    layers: Annotated[
        str | None,
        typer.Option(
            "--layers",
            help='Coats from top to bottom: "UltramarineBlue:12um, Vermillion:12um". Mixtures: '
            '"0.7*ZincWhite + 0.3*CobaltBlue:20um". Equal coats: "Eosin:5um x3". Units: um, µm, mm, nm, m.',
            show_default=False,
        ),
    ] = None,
    substrate: Annotated[
        str,
        typer.Option(help="Ground below: its reflectance, 0 to 1, or a table of spectra FILE.csv, FILE.csv:SAMPLE."),
    ] = "0.9",
    refractive_index: Annotated[float, typer.Option(help="Of every layer, 1 to 2.5.")] = 1.5,
    incidence: Annotated[
        float | None,
        typer.Option(
            help="Angle of the light from the normal, degrees. Default: 0, or 8 with --hemispherical.",
            show_default=False,
        ),
    ] = None,
    viewing: Annotated[
        float | None,
        typer.Option(help="Angle of the view from the normal, degrees. Default: 0.", show_default=False),
    ] = None,
    hemispherical: Annotated[
        bool, typer.Option("--hemispherical", help="An integrating sphere collects all light, instead of one view.")
    ] = False,
    specular: Annotated[
        bool | None,
        typer.Option(
            "--specular/--no-specular",
            help="Mirror reflection of the surface included. Default: with --hemispherical only.",
            show_default=False,
        ),
    ] = None,
    illuminant: Annotated[
        str, typer.Option(help="CIE illuminant of the colours: D65, D50, A, FL2, LED-B3, ...")
    ] = "D65",
    observer: Annotated[str, typer.Option(help="Standard observer of the colours: 2 or 10 (degrees).")] = "2",
    out: Annotated[Path, typer.Option(help="Picture to write: .png, .pdf, .svg or .jpg.")] = Path("glaze.png"),
    csv: Annotated[Path | None, typer.Option(help="Also write the spectra to this table.", show_default=False)] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace files that exist.")] = False,
    ladder: Annotated[
        str | None,
        typer.Option(help="Paint of the layer that the ladder repeats. Default: the top layer.", show_default=False),
    ] = None,
    pigments: Annotated[
        Path | None,
        typer.Option(
            help="Your own pigments: a pigments.csv as `glazejax recover` writes it. Its names come before those "
            "of the catalogue.",
            show_default=False,
        ),
    ] = None,
    tolerance: Annotated[float, typer.Option(help="Absolute error wanted in reflectance.")] = 1e-6,
    list_pigments: Annotated[bool, typer.Option("--list", help="List the pigments there are, and stop.")] = False,
) -> None:
    """Colour of a glaze: reflectance, XYZ, Lab and sRGB, and a picture.

    The picture shows the spectrum, a swatch, and a ladder: the colour of
    1 to 40 coats of one layer as computed here, beside what "multiply"
    layers of digital painting and plain mixing would give.

    Example: glazejax render --layers "CobaltBlue:1um, ChromeYellow:10um"
    """
    started = time.perf_counter()
    from rich.console import Console

    from ..paint.describe import format_length, make_media, name_paints, parse_layers

    console = Console(highlight=False, soft_wrap=False)
    if list_pigments:
        _list(console, _shelf(pigments))
        return
    if layers is None:
        raise ValueError(
            'give the layers, such as --layers "UltramarineBlue:12um,Vermillion:12um"; --list shows the pigments'
        )
    # Everything that can be wrong is looked at before anything is computed.
    coats = parse_layers(layers)
    from ..plots import check_picture

    check_picture(out, overwrite=overwrite)
    if csv is not None:
        _check_table(csv, out, overwrite)
    geometry, seen = _geometry(incidence, viewing, hemispherical, specular)
    from ..colour import find_illuminant, find_observer

    illuminant, observer = find_illuminant(illuminant), find_observer(observer)
    from .main import start_jax

    start_jax()
    shelf = _shelf(pigments, [name for coat in coats for _, name in coat.parts])
    coats = name_paints(coats, shelf)
    repeated = _repeated(coats, ladder)
    bed = _ground(substrate, make_media(coats, shelf))

    from ..paint.media import Glaze, Layer
    from . import render_report as report
    from .plots import glaze_figure
    from .rendering import render as compute

    glaze = Glaze(
        [Layer(medium, coat.total) for medium, coat in zip(bed.media, coats, strict=True)],
        bed.reflectance,
        refractive_index,
    )
    solving = time.perf_counter()
    rendering = compute(
        glaze,
        geometry,
        layer=repeated,
        coat=coats[repeated].thickness,
        illuminant=illuminant,
        observer=observer,
        tolerance=tolerance,
    )
    solved = time.perf_counter() - solving
    scene = report.Scene(coats, bed.words, refractive_index, seen, illuminant, observer)
    coat = coats[repeated]
    present = [f"{coat.name} {coat.size}" for coat in coats if coat.total > 0]
    figure = glaze_figure(
        rendering,
        [coat.name for coat in coats],
        title=" over ".join(present) or "No paint at all",
        subtitle=f"on a ground of {bed.words}  ·  n = {refractive_index:g}  ·  {seen}  ·  {scene.eye}",
        coat=f"{coat.name} {format_length(coat.thickness)}",
        marked=coat.repeats,
        illuminant=illuminant,
        observer=observer,
    )
    # Files first: a pager that closes early must not lose them.
    figure.savefig(out, dpi=100)
    if csv is not None:
        _write_table(csv, rendering, coats, overwrite)

    report.print_stack(console, scene)
    report.print_spectrum(console, rendering)
    report.print_colour(console, rendering, scene)
    report.print_comparison(console, rendering, scene)
    report.print_ladder(console, rendering, scene)
    used = {name: shelf[name] for coat in coats if coat.total > 0 for weight, name in coat.parts if weight > 0}
    remarks = [("note", words) for words in bed.notes] + _remarks(used)
    if rendering.ladder.capped:
        remarks.append(("note", "coats of the ladder that reach 10 mm are shown at 10 mm"))
    report.print_remarks(console, remarks)
    files = str(out) if csv is None else f"{out} and {csv}"
    total = time.perf_counter() - started
    console.print()
    console.print(f"wrote {files} in {total:.1f} s ({solved:.1f} s of it computing spectra)", markup=False)


def _check_table(csv: Path, out: Path, overwrite: bool) -> None:
    if csv.resolve() == out.resolve():
        raise ValueError(f"--csv and --out are both {csv}: give them different names")
    from ..io.outputs import check_output

    check_output(csv, overwrite=overwrite, argument="--csv")


def _repeated(coats: "Sequence[Coat]", ladder: str | None) -> int:
    """Which layer the ladder repeats: the named one, else the uppermost that is there."""
    if ladder is None:
        return next((i for i, coat in enumerate(coats) if coat.total > 0), 0)
    from ..paint.describe import same_name

    found = [i for i, coat in enumerate(coats) if same_name(coat.name, ladder)]
    if not found:
        names = ", ".join(dict.fromkeys(coat.name for coat in coats))
        raise ValueError(f"--ladder {ladder!r} is none of the layers: choose one of {names}")
    if coats[found[0]].total == 0:
        raise ValueError(f"--ladder {ladder!r}: this layer is 0 thick, so there is nothing to repeat")
    return found[0]


def _geometry(
    incidence: float | None, viewing: float | None, hemispherical: bool, specular: bool | None
) -> "tuple[Geometry, str]":
    """The instrument, and its description."""
    from ..geometry import Bidirectional, Hemispherical

    if hemispherical:
        if viewing is not None:
            raise ValueError(
                "--viewing has no meaning with --hemispherical, which collects all directions: leave it out"
            )
        angle, mirror = (8.0 if incidence is None else incidence), specular is not False
        return Hemispherical(
            angle, mirror
        ), f"an integrating sphere at {angle:g}°, specular {'in' if mirror else 'ex'}cluded"
    light, view = incidence or 0.0, viewing or 0.0
    if specular and light != view:
        raise ValueError(
            f"--specular: at {light:g}:{view:g} the mirror reflection is not in view; use equal angles, or "
            "--hemispherical"
        )
    mirrored = "mirror reflection included" if specular else "no mirror reflection"
    return Bidirectional(light, view, bool(specular)), f"light at {light:g}°, view at {view:g}°, {mirrored}"


def _shelf(path: Path | None, names: Sequence[str] = ()) -> "Mapping[str, Pigment]":
    """Own pigments, and the catalogue behind them unless nothing is wanted from it."""
    from ..paint.describe import find_name
    from ..paint.pigment_table import read_pigments

    own = {} if path is None else read_pigments(path)
    if names and own:
        try:
            for name in names:
                find_name(name, own)
        except ValueError:
            pass
        else:
            return own
    from .. import catalogue

    return {**catalogue.load(), **own}


def _list(console, shelf: "Mapping[str, Pigment]") -> None:
    from ..spectra import describe_grid

    for name, pigment in shelf.items():
        console.print(f"{name:24} {describe_grid(pigment.wavelengths)}", markup=False)


class _Bed(NamedTuple):
    """Ground and media on common wavelengths."""

    media: "list[Pigment | Mixture]"
    reflectance: "float | Float[np.ndarray, 'bands']"
    words: str
    notes: list[str]


def _ground(text: str, media: "list[Pigment | Mixture]") -> _Bed:
    """Read --substrate and bring everything to the wavelengths that all of it covers."""
    import numpy as np

    from ..spectra import describe_grid, resample, same_grid

    notes: list[str] = []
    try:
        level = float(text)
    except ValueError:
        level = None
    grids = [medium.wavelengths for medium in media]
    spectrum = None
    if level is not None:
        if not 0 <= level <= 1:
            fix = f", which looks like percent: write {level / 100:g}" if 1 < level <= 100 else ""
            raise ValueError(f"--substrate is {text}; reflectance lies between 0 and 1{fix}")
        words = f"reflectance {level:g}"
    else:
        wavelengths, spectrum, words, notes = _read_ground(text)
        grids.append(wavelengths)
    low, high = max(g[0] for g in grids), min(g[-1] for g in grids)
    grid = grids[0][(grids[0] >= low - 1e-6) & (grids[0] <= high + 1e-6)]
    if grid.size == 0:
        raise ValueError("the pigments and the ground share no wavelengths: " + "; ".join(map(describe_grid, grids)))
    if not all(same_grid(grid, other) for other in grids):
        notes.append(f"pigments and ground differ in wavelengths; everything is computed at {describe_grid(grid)}")
        media = [m if same_grid(grid, m.wavelengths) else m.resample(grid) for m in media]
    if spectrum is None:
        assert level is not None
        return _Bed(media, level, words, notes)
    return _Bed(media, np.asarray(resample(grids[-1], spectrum, grid)), words, notes)


def _read_ground(text: str) -> "tuple[np.ndarray, np.ndarray, str, list[str]]":
    """Wavelengths, reflectance, words and notes of a ground in a file."""
    from ..io import read_sample
    from ..io.sample import split_sample

    path, _ = split_sample(text)
    table = read_sample(text, argument="--substrate")
    sample, spectrum = table.names[0], table.reflectance[0]
    if spectrum.max() > 1:
        worst = int(spectrum.argmax())
        raise ValueError(
            f"{path}: {sample!r} reflects {spectrum[worst]:.3g} at {table.wavelengths[worst]:g} nm; a ground "
            "reflects 1 at most: scale the spectrum"
        )
    notes = [f"{path}: {note}" for note in table.notes]
    notes.append("the ground's spectrum is taken as its reflectance seen from inside the paint, not from air")
    return table.wavelengths, spectrum, f"{sample} ({path.name}, mean {spectrum.mean():.2f})", notes


def _remarks(used: "Mapping[str, Pigment]") -> list[tuple[str, str]]:
    """Where the pigments come from, and where their numbers cannot be relied on."""
    from .. import catalogue
    from ..paint.describe import describe_bands, format_length

    origins: dict[str, list[str]] = {}
    for name, pigment in used.items():
        origins.setdefault(pigment.provenance or "no provenance is stated", []).append(name)
    remarks = []
    if catalogue.PROVENANCE in origins:
        film = format_length(catalogue.ASSUMED_THICKNESS)
        words = f"pigments of the catalogue were fitted to films of unknown thickness, taken as {film}"
        remarks.append(("note", f"{words}; thicknesses here are on that scale"))
    remarks += [("source", f"{', '.join(names)}: {origin}") for origin, names in origins.items()]
    for name, pigment in used.items():
        if pigment.identifiable is not None and not pigment.identifiable.all():
            bands = describe_bands(pigment.wavelengths, ~pigment.identifiable)
            remarks.append(
                ("warning", f"{name} at {bands}: measurements fix only k/s there; thin coats may look different")
            )
    return remarks


def _write_table(path: Path, rendering, coats: "Sequence[Coat]", overwrite: bool) -> None:
    """Write wavelength, glaze, ground and each layer alone; `glazejax.io.read_spectra` reads it back."""
    from ..io import write_table

    titles = ["wavelength_nm", "glaze", "ground"]
    for i, coat in enumerate(coats, 1):
        titles.append(f"layer {i}: {coat.name} {coat.size} alone")
    columns = [rendering.wavelengths, rendering.glaze, rendering.ground, *rendering.alone]
    write_table(path, titles, zip(*columns, strict=True), overwrite=overwrite)
