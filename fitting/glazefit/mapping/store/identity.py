"""What a map says of itself in its ``zarr.json``, by which it is told from what is no map, from a
damaged one, and from maps of other formats.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from uuid import uuid4
from zlib import crc32

KIND = "glazejax map"
FORMAT = 4
"""What the attribute `glazejax` of a map says it is. The order of `layout.VARIABLES` is part of the
format.
"""

WORK = ".glazejax"
"""Folder within a map that holds what a run needs to go on."""

NO_FILE = -1
"""Checksum of a file that is not there."""


@dataclass(frozen=True)
class Identity:
    """A map as it was laid out; nothing of it changes later.

    Attributes:
        run: tells the map from any that it replaced.
        shape: rows and columns of the image.
        chunk: rows and columns of a window.
        paints: their names.
        options: what the map depends on, as plain JSON.
        files: checksums of the files of metadata and coordinates, by their places in the map.
    """

    run: str
    shape: tuple[int, int]
    chunk: tuple[int, int]
    paints: tuple[str, ...]
    options: dict[str, Any]
    files: dict[str, int]


def seal_attributes(
    path: Path, shape: list[int], chunk: list[int], attrs: Mapping[str, Any]
) -> dict[str, Any]:
    """The attribute `glazejax` of a map whose files of metadata and coordinates are written.

    Args:
        path: folder of the map.
        shape, chunk: of the image and of a window.
        attrs: all other attributes, as plain JSON.
    """
    files = {
        file.relative_to(path).as_posix(): file_checksum(file)
        for file in sorted(path.rglob("*"))
        if file.is_file() and file.parent != path
    }
    whole = {
        "kind": KIND,
        "format": FORMAT,
        "run": uuid4().hex,
        "shape": shape,
        "chunk": chunk,
        "files": files,
    }
    return whole | {"checksum": _checksum({**attrs, "glazejax": whole})}


def read_identity(path: Path) -> Identity:
    """What the map in a folder says of itself.

    Raises:
        ValueError: there is no map, one of another format, or one whose ``zarr.json`` is damaged.
    """
    attrs = _attributes(path)
    if attrs is None and not is_map(path):
        raise ValueError(
            f"{path} is no map of glazejax; name the folder that `glazejax map` wrote with --out"
        )
    own = {} if attrs is None else attrs["glazejax"]
    written = own.get("format")
    if isinstance(written, int) and written != FORMAT:
        raise ValueError(
            f"{path} is a map of format {written}, written by another glazejax; this one reads "
            f"format {FORMAT}: make the map again (--overwrite), or read it by xarray.open_zarr"
        )
    if attrs is None or own.get("checksum") != _checksum(attrs):
        raise ValueError(
            f"{path} is a damaged map, whose zarr.json is not as it was written: make the map "
            "again with overwrite=True (--overwrite)"
        )
    return Identity(
        run=own["run"],
        shape=(own["shape"][0], own["shape"][1]),
        chunk=(own["chunk"][0], own["chunk"][1]),
        paints=tuple(attrs["paints"]),
        options=attrs["options"],
        files=own["files"],
    )


def is_map(path: Path) -> bool:
    """Whether a folder holds a map of glazejax, whole or damaged."""
    return _attributes(path) is not None or (
        (path / WORK).is_dir() and (path / "zarr.json").is_file()
    )


def damaged_files(path: Path, identity: Identity) -> list[str]:
    """Files of a map's metadata and coordinates that are missing or not as they were written, by
    their places in the map.
    """
    return [name for name, wanted in identity.files.items() if file_checksum(path / name) != wanted]


def file_checksum(path: Path) -> int:
    """CRC-32 of a file's content; `NO_FILE` if there is no such file."""
    try:
        return crc32(path.read_bytes())
    except FileNotFoundError:
        return NO_FILE


def _attributes(path: Path) -> dict[str, Any] | None:
    """Attributes of the map in a folder; None if it holds none, or none that can be read."""
    try:
        attrs = json.loads((path / "zarr.json").read_text(encoding="utf-8"))["attributes"]
        return attrs if attrs["glazejax"]["kind"] == KIND else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _checksum(attrs: Mapping[str, Any]) -> int:
    """CRC-32 of options, paints, and all that the attribute `glazejax` holds beside this number."""
    identity = {name: value for name, value in attrs["glazejax"].items() if name != "checksum"}
    own = [identity, attrs.get("paints"), attrs.get("options")]
    return crc32(json.dumps(own, sort_keys=True).encode())
