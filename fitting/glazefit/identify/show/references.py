"""Output of `glazejax paints --references`: reference paints as they were understood.

`glazejax.commands.paints` finds the function by the entry point `glazejax.references`.
"""

from pathlib import Path

from rich.console import Console

from glazejax.geometry import Geometry
from glazejax.io import write_table
from glazejax.io.quantity import Stated

from ..families.references import read_references

_COLUMNS = ("reference", "family", "colour_index", "first_nm", "last_nm", "coefficients")


def list_references(
    file: Path,
    *,
    instrument: Geometry,
    console: Console,
    csv: Path | None,
    overwrite: bool,
    stated: Stated,
) -> None:
    """Print, and write as a table, the references of a file; after them what was not understood.

    Args:
        file: of their spectra.
        instrument: that read them.
        console: to print to.
        csv: table to write, or None.
        overwrite: whether it may replace a file.
        stated: what the user says of quantity and units.
    """
    read = read_references(file, instrument, **stated)
    rows = [
        (
            paint.name,
            paint.pigment.family,
            paint.colour_index,
            f"{paint.pigment.wavelengths[0]:.0f}",
            f"{paint.pigment.wavelengths[-1]:.0f}",
            paint.coefficients,
        )
        for paint in read.paints
    ]
    console.print(f"{'family':<23}{'nm':<10}{'Colour Index':<14}{'coefficients':<19}reference")
    for name, family, index, first, last, coefficients in rows:
        console.print(
            f"{family:<23}{f'{first}-{last}':<10}{index:<14}{coefficients:<19}{name}",
            soft_wrap=True,
        )
    families = len({paint.pigment.family for paint in read.paints})
    console.print(f"{len(rows)} references of {families} families, from {file}.", soft_wrap=True)
    for line in read.unclear:
        console.print(f"not understood: {line}", soft_wrap=True)
    if csv is not None:
        write_table(csv, _COLUMNS, rows, overwrite=overwrite)
        console.print(f"Wrote {len(rows)} references to {csv}")
