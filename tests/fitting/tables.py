"""Films as the tables that commands read, and the tables that they write."""

import csv
from pathlib import Path

from glazefit import Films
from glazejax.io import write_table


def write_films(path: Path, films: Films, ends=("b", "w", "ob", "ow"), scale=1.0) -> Path:
    """A row for each end of a film's name: the bare cards and the paint over them. Without an end,
    the paint over white.
    """
    arrays = {
        "b": films.bare_black,
        "w": films.bare_white,
        "ob": films.over_black,
        "ow": films.over_white,
        "": films.over_white,
    }
    titles = ["Name", *(f"{nm:g}" for nm in films.wavelengths)]
    rows = [
        [f"{name}_{end}" if end else name, *(scale * arrays[end][i])]
        for i, name in enumerate(films.names)
        for end in ends
    ]
    write_table(path, titles, rows, overwrite=True)
    return path


def read_rows(path: Path) -> list[dict[str, str]]:
    """Rows by their titles."""
    with path.open(encoding="utf-8") as file:
        return list(csv.DictReader(file))
