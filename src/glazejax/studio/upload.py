"""Dropped files, read by the readers of `glazejax.io`."""

import tempfile
from pathlib import Path
from typing import NamedTuple

from ..io import SpectraTable, read_spectra

_FILM_ROWS = ("b", "w", "ob", "ow")


class Upload(NamedTuple):
    """Content of a file.

    Attributes:
        films: whether these are films over a black and a white card, four rows each.
        table: the spectra.
    """

    films: bool
    table: SpectraTable


def read_upload(name: str, content: bytes) -> Upload:
    """Read a dropped file by its content.

    Raises:
        ValueError: it holds no spectra; the message is one line.
    """
    if not content.strip():
        raise ValueError(f"{name} is empty")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "dropped"
        path.write_bytes(content)
        try:
            table = read_spectra(path)
        except (ValueError, OSError) as error:
            raise ValueError(str(error).replace(str(path), name)) from None
    most = 200
    if len(table.names) > most:
        raise ValueError(
            f"{name} holds {len(table.names)} spectra; the studio takes {most} at once"
        )
    rows: dict[str, set[str]] = {}
    for title in table.names:
        film, _, ending = title.rpartition("_")
        rows.setdefault(film, set()).add(ending)
    films = all(film and ends == set(_FILM_ROWS) for film, ends in rows.items())
    return Upload(films=films, table=table)
