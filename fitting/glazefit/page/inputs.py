"""The files that a report was made from."""

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from glazejax.io.source import split_sheet, with_its_pair


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


def _checksum(path: Path) -> tuple[int | None, str | None]:
    if not path.is_file():
        return None, None
    with path.open("rb") as file:
        return path.stat().st_size, hashlib.file_digest(file, "sha256").hexdigest()
