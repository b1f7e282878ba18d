"""One measured spectrum, named as FILE or FILE:SAMPLE wherever a reflectance may be a number or
measured.
"""

from dataclasses import replace
from pathlib import Path
from typing import Unpack

from ..quantity import Stated
from ..source import is_there, split_sheet
from ..spectra_table import SpectraTable, row_of
from .read import read_spectra


def split_sample(text: str, folder: str | Path = "") -> tuple[Path, str]:
    """File and sample of FILE:SAMPLE; the sample is empty where FILE stands alone. Neither need
    exist.

    Args:
        text: `FILE` or `FILE:SAMPLE`; a file whose own name has a colon in it comes first. The
            sample may have colons, too.
        folder: where a relative FILE is looked for.
    """
    path = Path(folder) / text
    if ":" not in text or is_there(path):
        return path, ""
    colons = [at for at, letter in enumerate(text) if letter == ":"]
    splits = [(Path(folder) / text[:at], text[at + 1 :]) for at in reversed(colons)]
    # A sheet is of a file, too.
    there = (split for split in splits if is_there(split_sheet(split[0])[0]))
    return next(there, splits[0])


def read_sample(
    text: str, *, folder: str | Path = "", argument: str = "", **stated: Unpack[Stated]
) -> SpectraTable:
    """Read one spectrum in any format that `read_spectra` knows.

    Args:
        text: `FILE` or `FILE:SAMPLE`; the sample may be left out of a file that holds one spectrum.
            `FILE.xlsx:SHEET:SAMPLE` is of another sheet than the first.
        folder: where a relative FILE is looked for.
        argument: what ``text`` was given as, such as ``--ground``; errors begin with it.
        stated: ``quantity``, ``unit`` and ``scale``, as `read_spectra` takes them.

    Returns:
        A table of that spectrum alone, with the file's notes.

    Raises:
        FileNotFoundError: no such file.
        ValueError: the file is not legal, holds several spectra and none is chosen, or has none of
            that name.
    """
    lead = f"{argument} " if argument else ""
    path, sample = split_sample(text, folder)
    if not is_there(split_sheet(path)[0]):
        raise FileNotFoundError(
            f"{lead}{text!r} is neither a number from 0 to 1, such as 0.9, nor a file"
        )
    table = read_spectra(path, **stated)
    row = row_of(table.names, sample, f"{lead}{path}", f"{text.rstrip(':')}:")
    return replace(
        table,
        names=table.names[row : row + 1],
        reflectance=table.reflectance[row : row + 1],
        attributes={title: texts[row : row + 1] for title, texts in table.attributes.items()},
    )
