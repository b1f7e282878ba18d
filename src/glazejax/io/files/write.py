"""Spectra out, as CSV, CxF3 or ENVI."""

import csv
import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ...spectra import MAX_DECLARED, MAX_FRACTION, validate_wavelengths
from ..finish import different, plain_name
from ..outputs import file_format
from ..quantity import names_sample
from ..source import DATA_ENDINGS, naming
from ..spectra_table import SpectraTable, list_names
from ..words import shield_name
from ..write import write_files

WIDE_TITLE = "Name (reflectance as fraction, nm)"
"""First title of a table with a sample a row, which says what it holds."""


def write_spectra(
    table: SpectraTable,
    path: str | Path,
    *,
    format: str | None = None,
    long: bool = False,
    overwrite: bool = False,
) -> list[str]:
    """Write spectra as fractions, so that `read_spectra` gives the same numbers back, bit for bit.

    Args:
        table: spectra.
        path: file to write; of an ENVI library, which is two files, either.
        format: ``csv`` (tab separated if the name ends in .tsv), ``cxf`` or ``envi``; left out, the
            name's ending says.
        long: CSV with a sample a column instead of a sample a row.
        overwrite: whether files that exist may be replaced.

    Returns:
        Sentences on what could not be kept as it was, such as a comma in an ENVI name.

    Raises:
        FileExistsError: a file exists and `overwrite` is false; or one that would be read in place
            of an ENVI library's own.
        FileNotFoundError: its folder does not exist.
        IsADirectoryError: it is a folder.
        ValueError: unknown format; a table that is empty or not of legal fractions; wavelengths
            that CxF3 cannot hold; names that a long table cannot.
    """
    path = Path(path)
    kind = file_format(path, format)
    if long and kind != "csv":
        raise ValueError(f"{path}: only CSV has a long layout")
    _check(table, path)
    notes: list[str] = []
    if table.attributes:
        notes.append(
            f"only names and spectra are written, not {list_names(list(table.attributes))}"
        )
    names = [" ".join(plain_name(name).split()) for name in table.names]
    names = [name or f"spectrum {i + 1}" for i, name in enumerate(names)]
    if (changed := sum(old != new for old, new in zip(table.names, names, strict=True))) > 0:
        notes.append(f"{changed} names lost control characters or blanks")
    table = replace(table, names=tuple(different(names, notes)))
    if long and any(re.fullmatch(r"[\d.,\s]*(nm)?", name) for name in table.names):
        raise ValueError(
            f"{path}: names that are numbers would be read as wavelengths; write the wide layout"
        )
    if kind == "csv":
        files = {path: _format_csv(table, path, long)}
    elif kind == "cxf":
        from ..formats.cxf import format_cxf

        with naming(path):
            files = {path: [format_cxf(table)]}
    else:
        from ..formats.envi import format_envi

        header, numbers, said = format_envi(table)
        notes += said
        # Of several files next to a header the first of these endings is read.
        for ending in DATA_ENDINGS[: DATA_ENDINGS.index(".sli")]:
            if (other := path.with_suffix(ending)).is_file():
                raise FileExistsError(
                    f"{other} lies next to {path.with_suffix('.hdr').name} and would be read in "
                    f"place of {path.with_suffix('.sli').name}: move it, or write to another name"
                )
        files = {path.with_suffix(".sli"): numbers, path.with_suffix(".hdr"): [header.encode()]}
    write_files(files, overwrite=overwrite)
    return notes


def _check(table: SpectraTable, path: Path) -> None:
    """Refuse what could not be read back."""
    validate_wavelengths(table.wavelengths)
    values = np.asarray(table.reflectance)
    if values.shape != (len(table), table.wavelengths.size) or not len(table):
        raise ValueError(
            f"{path}: {len(table)} names and reflectance of shape {values.shape} make no table "
            "to write"
        )
    # A large table has room for a mask only if one is needed.
    if 0 <= values.min() <= values.max() <= MAX_DECLARED:
        return
    wrong = ~((values >= 0) & (values <= MAX_DECLARED))
    i, j = np.argwhere(wrong)[0].tolist()
    raise ValueError(
        f"{path}: reflectance of {table.names[i]!r} is {values[i, j]:g} at "
        f"{table.wavelengths[j]:g} nm; it must be a fraction from 0 to {MAX_DECLARED:g}"
    )


def _format_csv(table: SpectraTable, path: Path, long: bool) -> Iterator[bytes]:
    """Table as text, line by line; names are quoted, so that no letter in them is taken for a
    delimiter or a comment, and begin with an apostrophe where they would be a formula.
    """
    grid = [int(nm) if nm.is_integer() else nm for nm in table.wavelengths.tolist()]
    values = table.reflectance.T if long else table.reflectance
    names = [shield_name(name) for name in table.names]
    header = ["wavelength_nm", *names] if long else [WIDE_TITLE, *grid]
    first: Sequence[object] = grid if long else names
    writer = csv.writer(
        _Encoder(),
        delimiter="\t" if path.suffix.lower() == ".tsv" else ",",
        lineterminator="\n",
        quoting=csv.QUOTE_NONNUMERIC,
    )
    if long and (table.reflectance.max() > MAX_FRACTION or not all(map(names_sample, names))):
        # Without it the reader takes what is so bright for percent, and R% for no name.
        yield b"# unit: fraction\n"
    yield writer.writerow(header)
    for title, row in zip(first, values, strict=True):
        yield writer.writerow([title, *row.tolist()])


class _Encoder:
    """File of a CSV writer, whose `writerow` gives back what this gives."""

    def write(self, text: str) -> bytes:
        return text.encode()
