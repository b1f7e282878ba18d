"""The files that a report was made from."""

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from glazejax.io.source import DATA_ENDINGS, split_sheet

_ENVI = ("", ".hdr", *(f".{ending}" for ending in DATA_ENDINGS))


def input_files(files: Mapping[str, Path | None]) -> list[dict[str, Any]]:
    """Name, size and SHA-256 of files, and of the second half of an ENVI pair; a pipe can be read
    once and has none.

    Args:
        files: what each was given as -> path; None where there is none.
    """
    out = []
    for role, path in files.items():
        for file in [] if path is None else with_its_pair(path):
            size, checksum = _checksum(split_sheet(file)[0])
            out.append({"role": role, "name": str(file), "bytes": size, "sha256": checksum})
    return out


def with_its_pair(path: Path) -> list[Path]:
    """A file and, where it is half of an ENVI pair, the other half."""
    if path.suffix.lower() not in _ENVI or path.is_dir():
        return [path]
    candidates = {path.with_suffix(end) for word in _ENVI for end in (word, word.upper())}
    # The header of cube.img may be cube.img.hdr, too.
    candidates |= {path.with_name(f"{path.name}{end}") for end in (".hdr", ".HDR")}
    companions = [
        companion for companion in candidates if companion != path and companion.is_file()
    ]
    pair = [path, *sorted(companions)]
    return pair if any(file.suffix.lower() == ".hdr" for file in pair) else [path]


def _checksum(path: Path) -> tuple[int | None, str | None]:
    if not path.is_file():
        return None, None
    with path.open("rb") as file:
        return path.stat().st_size, hashlib.file_digest(file, "sha256").hexdigest()
