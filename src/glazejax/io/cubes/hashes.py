"""A quick hash of an image: enough to tell that it is not the one that was mapped, without reading
all of it.
"""

import hashlib
from pathlib import Path

from ..sniff import header_beside
from ..source import explain_errors

_END = 1 << 20
# A file up to this size, such as a header or the metadata of a store, is hashed whole.
_SMALL = 1 << 21


def quick_source_hash(path: str | Path) -> str:
    """SHA-256 of names, sizes, and the first and last MiB of a file (of a small one, all); not of
    what lies between.

    Of an ENVI image the header and the data are hashed, of a folder all names and sizes, the small
    text files of its metadata, and the ends of its first and last file. A copy has the same hash
    wherever it lies.

    Raises:
        FileNotFoundError: no such file.
        OSError: the system cannot read it.
    """
    path = Path(path)
    digest = hashlib.sha256()
    with explain_errors(path):
        if path.is_dir():
            files = sorted(file for file in path.rglob("*") if file.is_file())
            for file in files:
                digest.update(
                    f"{file.relative_to(path).as_posix()} {file.stat().st_size}\n".encode()
                )
            named = [file for file in files if file.suffix == ".json" or file.name.startswith(".z")]
            data = [file for file in files if file not in set(named)]
            files = [*named, *data[:1], *data[1:][-1:]]
        else:
            files = _together(path)
        for file in files:
            _add(digest, file)
    return digest.hexdigest()


def _together(path: Path) -> list[Path]:
    """A file and what belongs to it: header and data of an ENVI image."""
    from ..read import envi_file

    if path.suffix.lower() == ".hdr" or header_beside(path) is not None:
        envi = envi_file(path)
        header = header_beside(envi.data) or path
        return [header, envi.data]
    return [path]


def _add(digest: "hashlib._Hash", path: Path) -> None:
    """Size and ends of a file."""
    size = path.stat().st_size
    digest.update(f"{size}\n".encode())
    with path.open("rb") as file:
        if size <= _SMALL:
            digest.update(file.read())
        else:
            digest.update(file.read(_END))
            file.seek(size - _END)
            digest.update(file.read(_END))
