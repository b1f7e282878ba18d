"""Places where results may be written: asked before anything is computed, and no file is replaced
unless that is wished.
"""

from pathlib import Path

from .source import show_path

_ENDINGS = {
    ".csv": "csv",
    ".tsv": "csv",
    ".txt": "csv",
    ".cxf": "cxf",
    ".xml": "cxf",
    ".hdr": "envi",
    ".sli": "envi",
}


def file_format(path: Path, format: str | None) -> str:
    """Format of a table of spectra to be written: the one that is named, or that of the ending.

    Raises:
        ValueError: it is not csv, cxf or envi.
    """
    kind = format or _ENDINGS.get(path.suffix.lower())
    if kind not in ("csv", "cxf", "envi"):
        said = repr(format) if format else f"the ending of {path.name!r}"
        raise ValueError(
            f"{path}: no format is known by {said}; write .csv, .tsv, .cxf or .hdr (ENVI)"
        )
    return kind


def check_output(
    path: str | Path, *, overwrite: bool = False, argument: str = "", switch: str = "--overwrite"
) -> Path:
    """The path of a file, if it can be written.

    Args:
        path: of the file.
        overwrite: whether a file that exists may be replaced.
        argument: what the path was given as, such as ``--csv``; errors begin with it.
        switch: how the user asks for ``overwrite``.

    Raises:
        FileExistsError: the file exists and `overwrite` is false.
        FileNotFoundError: its folder does not exist.
        IsADirectoryError: it is a folder.
        OSError: the system knows no such name, as it is too long.
    """
    path = Path(path)
    said = f"{argument} {show_path(path)}" if argument else show_path(path)
    try:
        if path.is_dir():
            raise IsADirectoryError(f"{said} is a folder: name a file in it")
        if not path.parent.is_dir():
            raise FileNotFoundError(f"{said}: the folder {path.parent} does not exist")
        there = path.exists()
    except OSError as error:
        if error.strerror is None:
            raise
        raise type(error)(f"{said}: cannot be written: {error.strerror}") from None
    if there and not overwrite:
        raise FileExistsError(f"{said} exists; choose another name, or replace it with {switch}")
    return path
