"""Films as the tables that commands read, and the tables that they write."""

import csv
from pathlib import Path

from glazefit import Films


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
    rows = [["Name", *(f"{nm:g}" for nm in films.wavelengths)]]
    for i, name in enumerate(films.names):
        for end in ends:
            values = (f"{scale * value:.6f}" for value in arrays[end][i])
            rows.append([f"{name}_{end}" if end else name, *values])
    path.write_text("\n".join(",".join(row) for row in rows) + "\n")
    return path


def read_rows(path: Path) -> list[dict[str, str]]:
    """Rows by their titles."""
    with path.open(encoding="utf-8") as file:
        return list(csv.DictReader(file))
