"""The command ``glazejax convert``: spectra from any format that is known to CSV, CxF3 or ENVI."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from . import options

if TYPE_CHECKING:
    from ..io import SpectraTable

_UNITS = {"fraction": "as fractions", "percent": "in percent", "scaled": "as scaled numbers"}


def convert(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="IN",
            callback=options.there,
            help="File of spectra, recognised by content: CSV, TSV, Excel (FILE.xlsx:SHEET), ENVI "
            "(.hdr or its data), CGATS, CxF3, JCAMP-DX, QTX, ASD, SVC, ProcSpec or JSON.",
        ),
    ],
    target: Annotated[
        Path,
        typer.Argument(
            metavar="OUT",
            help="File to write: .csv, .tsv, .cxf (CxF3), .hdr (ENVI library, with .sli).",
        ),
    ],
    to: Annotated[
        str | None,
        options.option(help="Format of OUT, whatever its name: csv, cxf or envi."),
    ] = None,
    resample: Annotated[
        str | None,
        options.option(help="Wavelengths of OUT in nm, FROM:TO:STEP, such as 400:700:10."),
    ] = None,
    long: Annotated[
        bool, typer.Option("--long", help="Write a column for each sample, not a row (CSV, TSV).")
    ] = False,
    quantity: options.Quantity = None,
    unit: options.Unit = None,
    scale: options.Scale = None,
    overwrite: options.Overwrite = False,
) -> None:
    """Convert measured spectra from IN to OUT.

    Reflectance is written as fractions, 0 to 1. Percent in IN is read or
    detected, and reported. Spectra are resampled by interpolation, never
    beyond their range.

    Example: glazejax convert chart.cxf chart.csv --resample 400:700:10
    """
    from ..io.outputs import file_format
    from ..io.source import with_its_pair
    from ..io.words import parse_grid

    try:
        grid = None if resample is None else parse_grid(resample)
    except ValueError as error:
        raise ValueError(f"--resample {error}") from None
    # A library is two files.
    endings = (".hdr", ".sli") if file_format(target, to) == "envi" else ()
    targets = [target.with_suffix(ending) for ending in endings] or [target]
    # Of an ENVI file both halves are read.
    inputs = with_its_pair(source)
    for path in targets:
        options.check_outputs({"OUT": path}, overwrite, pictures=(), inputs=inputs)
    from ..io import read_spectra, write_spectra
    from ..io import resample as resample_table
    from .progress import follow

    with follow("reading") as note:
        meaning = options.stated(quantity, unit, scale)
        table = read_spectra(source, progress=note, **meaning)
    typer.echo(f"read   {source}: {table.format}, {_summary(table)}, stored {_UNITS[table.unit]}")
    if grid is not None:
        try:
            table = resample_table(table, grid)
        except ValueError as error:
            raise ValueError(f"--resample {resample}: {error}") from None
    for note in table.notes:
        typer.echo(f"note   {note}")
    notes = write_spectra(table, target, format=to, long=long, overwrite=overwrite)
    for note in notes:
        typer.echo(f"note   {note}")
    written = " and ".join(map(str, targets))
    typer.echo(f"wrote  {written}: {_summary(table)}, stored as fractions")


def _summary(table: "SpectraTable") -> str:
    """Number, grid and range of the spectra of a table."""
    from ..spectra import describe_grid

    count = "1 spectrum" if len(table) == 1 else f"{len(table)} spectra"
    low = table.reflectance.min()
    high = table.reflectance.max()
    return f"{count}, {describe_grid(table.wavelengths)}, reflectance {low:.3g} to {high:.3g}"
