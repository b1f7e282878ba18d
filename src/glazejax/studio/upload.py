"""Dropped files, read by the readers of `glazejax.io` without ever being written to a disk here."""

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from ..io import SpectraTable, read_spectra
from ..paint.media import Pigment
from ..paint.pigment_table import read_pigments
from ..stacks import own_name, pigment_to_dict

_FILM_ROWS = ("b", "w", "ob", "ow")
_MOST_PAINTS = 100
_MOST_SPECTRA = 200


class Upload(NamedTuple):
    """What a file holds.

    Attributes:
        kind: "paints", "films" (spectra over a black and a white card, four rows each) or
            "spectra".
        paints: by name; own names that a catalogue has too get " (own)".
        content: the same as JSON.
        table: of films or spectra.
        notes: of the reader.
    """

    kind: str
    paints: dict[str, Pigment]
    content: dict[str, Any]
    table: SpectraTable | None
    notes: tuple[str, ...]


def read_upload(name: str, content: bytes) -> Upload:
    """Read a dropped file by its content.

    Raises:
        ValueError: it holds neither paints nor spectra; the message is one line.
    """
    if not content.strip():
        raise ValueError(f"{name} is empty")
    head = content[: 1 << 16].decode("utf-8", "replace")
    first = next(
        (line for line in head.splitlines() if line.strip() and not line.startswith("#")), ""
    )
    if {"pigment", "absorption", "scattering"} <= {
        cell.strip() for cell in first.lstrip("\ufeff").split(",")
    }:
        with as_path(name, content) as path:
            found = read_pigments(path)
        if len(found) > _MOST_PAINTS:
            raise ValueError(
                f"{name} holds {len(found)} paints; the studio takes {_MOST_PAINTS} at once"
            )
        paints = own_names(found)
        return Upload(
            kind="paints",
            paints=paints,
            content={key: pigment_to_dict(p) for key, p in paints.items()},
            table=None,
            notes=(),
        )
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
    return Upload(
        kind="films" if films else "spectra",
        paints={},
        content={},
        table=table,
        notes=tuple(table.notes),
    )


def own_names(found: dict[str, Pigment]) -> dict[str, Pigment]:
    """Paints by names that no catalogue has."""
    renamed = {own_name(name): paint for name, paint in found.items()}
    return {name: paint.renamed(name) for name, paint in renamed.items()}


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
