"""Dropped files, read by the readers of `glazejax.io` without ever being written to a disk here."""

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from ..io import SpectraTable, read_spectra

_FILM_ROWS = ("b", "w", "ob", "ow")
_MOST_SPECTRA = 200


class Upload(NamedTuple):
    """What a file holds.

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
    with as_path(name, content) as path:
        table = read_spectra(path)
    if len(table.names) > _MOST_SPECTRA:
        raise ValueError(
            f"{name} holds {len(table.names)} spectra; the studio takes {_MOST_SPECTRA} at once"
        )
    rows: dict[str, set[str]] = {}
    for title in table.names:
        film, _, ending = title.rpartition("_")
        rows.setdefault(film, set()).add(ending)
    films = all(film and ends == set(_FILM_ROWS) for film, ends in rows.items())
    return Upload(films=films, table=table)


@contextmanager
def as_path(name: str, content: bytes) -> Iterator[Path]:
    """Content as a path to read once: a pipe, so that nothing is written. Errors inside name the
    file as the user does.

    Raises:
        ValueError: where the system has no such paths.
    """
    if not Path("/dev/fd").exists():
        raise ValueError(
            "this system has no /dev/fd, through which dropped files are read; use the command line"
        )
    out, into = os.pipe()
    path = Path(f"/dev/fd/{out}")

    def fill() -> None:
        try:
            with os.fdopen(into, "wb") as pipe:
                pipe.write(content)
        except OSError:  # The reader has seen enough.
            pass

    writer = threading.Thread(target=fill, daemon=True)
    writer.start()
    try:
        yield path
    except (ValueError, OSError) as error:
        raise ValueError(str(error).replace(str(path), name)) from None
    finally:
        os.close(out)
        writer.join(timeout=5)
