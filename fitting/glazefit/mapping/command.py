"""The command `glazejax map`: an image of spectra in; which paints, how much and how thick, pixel
by pixel, out.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from glazejax.commands import options, progress
from glazejax.commands.command_line import changed, ground_file
from glazejax.commands.help_groups import help_groups
from glazejax.extras import require

from ..identify import facts
from ..page import subject as head
from .options import (
    CUBE,
    read_bands,
    read_binning,
    read_ground_of_cube,
    read_memory,
    read_spectra_of_spots,
    read_spots,
    read_wavelengths,
    read_white,
    read_window,
)


def _option(text: str, metavar: str = "", callback: Any = None) -> Any:
    return typer.Option(help=text, metavar=metavar or None, callback=callback, show_default=False)


def _ground(text: str) -> None:
    if not text.startswith(CUBE):
        options.ground_level(text)


@help_groups(
    usual="--ground --catalogue --only --out --report",
    given=(
        "--wavelengths --dataset --white --dark --white-reflectance --quantity --unit --scale "
        "--window --mask --bin --bands --pigments --references --without --spot --bare --opaque "
        "--elements --without-elements --painted --instrument"
    ),
    tried="--max-paints --example",
    written="--csv --export --object --inventory --operator --overwrite",
    fine=(
        "--thickness --refractive-index --noise --noise-share --model-error --memory --scheduler"
    ),
)
def map_(
    cube: Annotated[
        Path | None,
        typer.Argument(
            metavar="CUBE",
            help=(
                "Image of spectra: ENVI (header or data), zarr, NetCDF, HDF5, TIFF or a folder "
                "of TIFFs or PNGs, MATLAB, .npy."
            ),
            show_default=False,
        ),
    ] = None,
    out: Annotated[
        Path,
        typer.Option(
            "--out",
            "-o",
            metavar="FOLDER",
            help="Map to write, a zarr folder. If it was begun before, it goes on.",
        ),
    ] = Path("map.zarr"),
    wavelengths: Annotated[
        str, _option("Wavelengths, if the cube has none: a file, or nm with commas.", "NM")
    ] = "",
    dataset: Annotated[
        str, _option("Array of a zarr, NetCDF or HDF5 file, if there are several.", "NAME")
    ] = "",
    white: Annotated[
        Path | None,
        _option(
            "Reading of a white: cube, frame, line, or a list of numbers.", "FILE", options.there
        ),
    ] = None,
    dark: Annotated[
        Path | None, _option("Reading without light, of the same kinds.", "FILE", options.there)
    ] = None,
    white_reflectance: Annotated[
        str,
        _option(
            "The white's own reflectance, a number or a file of its spectrum. Default: 1.", "R"
        ),
    ] = "1",
    quantity: options.Quantity = None,
    unit: options.Unit = None,
    scale: options.Scale = None,
    window: Annotated[
        str,
        _option(
            "Part of the cube, x0:x1,y0:y1 in pixels from 0, ends not included.", "X0:X1,Y0:Y1"
        ),
    ] = "",
    mask: Annotated[
        Path | None,
        _option(
            "Pixels to map: a PNG that is not black there, or polygons (GeoJSON, or CSV of x,y).",
            "FILE",
            options.there,
        ),
    ] = None,
    binned: Annotated[
        str,
        typer.Option(
            "--bin",
            metavar="N",
            help="Mean of N x N pixels, or of lines, samples and bands: 2,2,4.",
        ),
    ] = "1",
    bands: Annotated[
        str, _option("First and last wavelength that are used, nm: 420-700.", "NM-NM")
    ] = "",
    pigments: options.Pigments = None,
    catalogue: facts.Catalogue = None,
    references: facts.References = None,
    only: options.Only = "",
    without: options.Without = "",
    spot: Annotated[
        list[str] | None,
        _option(
            "One more paint, where paints are mapped (--catalogue oils): its spectrum is read from "
            "the cube at x,y, at x0:x1,y0:y1 or in mask.png; can be repeated.",
            "NAME=x,y",
        ),
    ] = None,
    ground: Annotated[
        str | None,
        _option(
            "Ground below the paint: its reflectance as seen from inside the paint, 0 to 1; a "
            "file of spectra, FILE or FILE:SAMPLE; or cube:x0:x1,y0:y1, where it lies bare in "
            "the cube.",
            "GROUND",
            options.checked(_ground),
        ),
    ] = None,
    bare: facts.Bare = False,
    opaque: facts.Opaque = False,
    elements: facts.Elements = "",
    without_elements: facts.WithoutElements = "",
    painted: facts.Painted = None,
    max_paints: facts.MaxPaints = 3,
    instrument: facts.InstrumentName = None,
    refractive_index: options.RefractiveIndex = 1.5,
    noise: Annotated[
        float | None,
        _option(
            "Noise of a reading near black, in reflectance. Default: estimated from the cube.",
            callback=options.between(0.0),
        ),
    ] = None,
    noise_share: Annotated[
        float | None,
        _option(
            "Noise that grows with the reading: added to --noise per unit of reflectance.",
            callback=options.between(0.0),
        ),
    ] = None,
    model_error: options.ModelError = None,
    thickness: options.Thickness = "25um",
    memory: Annotated[
        str, typer.Option(metavar="SIZE", help="Most memory that the run may use, such as 4GiB.")
    ] = "2GiB",
    scheduler: Annotated[
        str | None,
        _option(
            "Address of a dask scheduler, whose workers do the work: tcp://host:8786.", "ADDRESS"
        ),
    ] = None,
    report: Annotated[
        Path | None, _option("Also write a report, one HTML page, and pictures.", "FOLDER")
    ] = None,
    csv: Annotated[
        Path | None,
        _option("Also write a table of the sets: area, thickness, mean spectra.", "FILE"),
    ] = None,
    export: Annotated[
        Path | None, _option("Also write the map as NetCDF (.nc) or ENVI (.hdr or .img).", "FILE")
    ] = None,
    object: head.Object = "",
    inventory: head.Inventory = "",
    operator: head.Operator = "",
    overwrite: options.Overwrite = False,
    example: Annotated[
        bool,
        typer.Option(
            "--example", help="Make a small painting, of which the truth is known, and map it."
        ),
    ] = False,
) -> None:
    """Map the pigments of every pixel of an image, with probabilities.

    --catalogue oils or acrylics, or your own --pigments, maps paints by that
    one maker instead, with amounts and thickness.

    The map is a zarr folder that fills window by window. A run that was
    interrupted or killed goes on where it stopped if the same command is given
    again, and maps damaged windows again. --overwrite starts over.

    Example: glazejax map painting.hdr --ground 0.9 --report report
    """
    typed = dict(locals())
    if example:
        if cube is not None:
            raise ValueError(
                f"--example maps a painting of its own: leave out {cube}, or leave out --example"
            )
    elif cube is None:
        raise ValueError("no CUBE was given; name an image of spectra, or try --example")
    facts.check_ground(ground, bare=bare, opaque=opaque)
    if not (example or opaque or ground):
        raise ValueError(
            "what is under the paint? Give --ground, its reflectance such as 0.9, a table, or "
            "cube:x0:x1,y0:y1 where it lies bare in the cube; or --opaque"
        )
    subject = head.check_subject(report, object=object, inventory=inventory, operator=operator)
    require("xarray", "zarr")
    bound = read_memory(memory)
    spots = spot or []
    read_spots(spots, [])
    bands_of_cube = read_wavelengths(wavelengths)
    white_level = read_white(white_reflectance)
    reading = {
        "wavelengths": bands_of_cube,
        "dataset": dataset or None,
        "white": white,
        "dark": dark,
        "white_reflectance": white_level,
        "quantity": quantity,
        "unit": unit,
        "scale": scale,
        "window": read_window(window),
        "binning": read_binning(binned),
        "bands": read_bands(bands),
    }
    given_files = {
        "--mask": mask,
        "--white": white,
        "--dark": dark,
        "--white-reflectance": white_level if isinstance(white_level, Path) else None,
        "--wavelengths": bands_of_cube if isinstance(bands_of_cube, Path) else None,
        "--pigments": pigments,
        "--references": references,
        "--ground": ground_file(ground),
    }
    _check_outputs(out, {"CUBE": cube, **given_files}, csv, export, report, overwrite)
    if cube is not None:
        options.existing(cube)
    if catalogue is pigments is None:
        # The example is painted with oils.
        catalogue = options.OILS if example else options.PIGMENTS
    if not example:
        options.check_names(options.split_names(f"{only},{without}"), pigments, catalogue)
    from glazejax.commands.main import start_jax

    from .store.process import few_arenas

    few_arenas()
    start_jax(optimisation=3)
    import numpy as np

    from glazejax.commands.command_line import command_line
    from glazejax.io import CubeSource

    from ..film.films import Noise
    from ..identify.search.options import IdentificationOptions
    from .family_facts import describe_sets
    from .map_cube import map_cube
    from .provenance import map_provenance
    from .show.page import write_report
    from .show.report import report_map, write_sets
    from .solve.spots import with_spots
    from .spot_files import write_spots
    from .store.run import connect
    from .store.store import MapStore
    from .terminal import name_damage, say_what_is_kept

    console = progress.plain_console()
    if example:
        from .example import FOREIGN, painting, write_painting

        # A small painting next to the map.
        folder = out.with_name(f"{out.stem}-example")
        cube = folder / "painting.hdr"
        if not cube.exists():
            with progress.follow("making a painting"):
                scene = painting()
                write_painting(folder, scene)
            lines, samples, _ = scene.spectra.shape
            console.print(f"Made a painting of {samples} x {lines} pixels: {cube}")
        if not (opaque or ground):
            ground = str(folder / "ground.csv")
        if catalogue == options.OILS and not (pigments or only or without):
            without = FOREIGN
    assert cube is not None
    chosen = {**typed, "catalogue": catalogue, "without": without}
    of_paints = changed(map_, {"model_error": model_error, "thickness": thickness})
    paints, by_family, search, asked = facts.read_search(chosen, console, of_paints)
    locations = read_spots(spots, [paint.name for paint in paints])
    seen_with = search["instrument"]
    # Workers of a cluster have another folder of their own.
    source = CubeSource(cube.absolute(), **reading)
    opened = source.open()
    progress.print_notes(console, cube, opened.attrs.get("notes", ()))
    measured_spots = read_spectra_of_spots(locations, opened)
    below, ground_words, notes = read_ground_of_cube(ground, bare, opened, paints, seen_with)
    progress.print_notes(console, "--ground", notes)
    stated_noise = {
        name: value
        for name, value in {"floor": noise, "share": noise_share}.items()
        if value is not None
    }
    with (
        say_what_is_kept(out, console, overwrite=overwrite),
        name_damage(console),
        connect(scheduler) as client,
        progress.follow("reading") as report_progress,
    ):
        paint_map = map_cube(
            source,
            paints,
            ground=below,
            opaque=opaque,
            out=out,
            mask=mask,
            spots=measured_spots,
            noise=Noise(**stated_noise) if stated_noise else None,
            **search,
            memory=bound,
            client=client,
            overwrite=overwrite,
            progress=report_progress,
        )
    store = MapStore(out)
    sets = store.sums().sets
    console.print(f"Wrote the map to {out}")
    for line in report_map(paint_map, sets):
        console.print(line)
    if csv is not None:
        write_sets(csv, paint_map, sets, overwrite=overwrite)
        console.print(f"Wrote the table of sets to {csv}")
    if export is not None:
        from .store.export import export_map

        with progress.follow(f"writing {export}"):
            files = export_map(out, export, overwrite=overwrite)
        console.print(f"Wrote it as {' and '.join(map(str, files))} too")
    if report is not None:
        about = {
            **{head.TITLES[name]: text for name, text in subject.items()},
            "Catalogue": asked,
            "Ground": ground_words,
            "Instrument": (
                f"{seen_with.geometry.describe()}, refractive index {refractive_index:g}"
            ),
            "Elements": ", ".join(search["elements"]),
            "Elements not found": ", ".join(search["without_elements"]),
            "Painted": "" if painted is None else str(painted),
        }
        with progress.follow("writing the report"):
            families = (
                describe_sets(
                    paint_map,
                    sets,
                    paints,
                    IdentificationOptions(**search),
                    store.options["ground"],
                )
                if by_family
                else None
            )
            page = write_report(
                paint_map,
                sets,
                map_provenance(command_line(), typed, source.path, given_files, paint_map, about),
                report,
                cube=opened,
                facts=families,
                overwrite=overwrite,
            )
        console.print(f"Wrote the report to {page}")
        image_grid = np.asarray(opened["wavelength"], float)
        tried = with_spots(paints, measured_spots, image_grid, seen_with)
        files = write_spots(
            report, paint_map, image_grid, tried, instrument=seen_with, overwrite=overwrite
        )
        if len(files) == 1:
            console.print(
                f"Wrote spectra that no family explains to {files[0]}, for --references: fill in "
                "their families"
            )
        elif files:
            console.print(
                f"Wrote spectra that no paint explains to {files[0]}, and with them as paints "
                f"{files[1]}, for --pigments"
            )
    console.print(asked, soft_wrap=True)


def _check_outputs(
    out: Path,
    inputs: Mapping[str, Path | None],
    csv: Path | None,
    export: Path | None,
    report: Path | None,
    overwrite: bool,
) -> None:
    """Refuse what could not be written in the end, or would replace what is read, before anything
    is read.
    """
    from glazejax.io.source import with_its_pair

    from .store.export import check_export
    from .store.store import check_map

    for name, path in inputs.items():
        if path is not None and path.resolve() == out.resolve():
            raise ValueError(f"--out is {out}, which is {name}: give the map another name")
    check_map(out, overwrite=overwrite)
    read = [file for path in inputs.values() if path is not None for file in with_its_pair(path)]
    files = {"--csv": csv}
    if export is not None:
        exported = check_export(export, overwrite=overwrite, argument="--export")
        files |= dict(zip(("--export", "the image of --export"), exported, strict=False))
    options.check_outputs(files, overwrite, inputs=read)
    if report is not None:
        require("matplotlib", "jinja2")
        if report.resolve() == out.resolve():
            raise ValueError(f"--report and --out are both {out}: give them different names")
        options.check_folder(report, overwrite, argument="--report", inputs=read)
