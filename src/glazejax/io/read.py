"""The one entry to read spectra: tells the format by the content and calls its reader."""

from pathlib import Path

from .cube import SpectraCube
from .finish import finish
from .sniff import header_beside, identify
from .spectra_table import SpectraTable


def read_spectra(path: str | Path) -> SpectraTable:
    """Read reflectance spectra, in any format that is known.

    CSV or TSV, wide, long or longest; columns of numbers without a header; ENVI spectral libraries and images
    (header or data file named; of an image every pixel); CGATS text; CxF3; JCAMP-DX; ASD; and JSON lists of
    wavelengths and spectra, as Kimera's. The content tells which, not the name. Values are fractions or percent,
    as the file says or as `glazejax.spectra.as_fraction` detects; the table says in `notes` what was changed.

    Two samples of one name are an error in a text table, which can be mended by hand; in the other formats the
    second becomes ``name (2)``, with a note.

    Raises:
        FileNotFoundError: no such file, or an ENVI header without its data.
        ValueError: the file is not legal; the message is one line that says where and what would mend it.
    """
    path = Path(path)
    kind = identify(path)
    if kind in ("envi header", "envi data"):
        from .formats.envi import is_library, read_envi_cube, read_envi_library

        header = path if kind == "envi header" else header_beside(path)
        assert header is not None
        if not is_library(header):
            return read_envi_cube(header, path if kind == "envi data" else None).table()
        return finish(read_envi_library(header, path if kind == "envi data" else None), path)
    if kind == "cgats":
        from .formats.cgats import read_cgats as reader
    elif kind == "cxf":
        from .formats.cxf import read_cxf as reader
    elif kind == "jcamp":
        from .formats.jcamp import read_jcamp as reader
    elif kind == "asd":
        from .formats.asd import read_asd as reader
    elif kind == "json":
        from .formats.listing import read_listing as reader
    elif kind == "columns":
        from .formats.table import read_columns as reader
    else:
        from .formats.table import read_table as reader
    return finish(reader(path), path)


def read_cube(path: str | Path) -> SpectraCube:
    """Open an ENVI image of spectra without reading it: header or data file may be named.

    Raises:
        FileNotFoundError: no such file, or a header without its data.
        ValueError: it is no ENVI image, or not a legal one.
    """
    path = Path(path)
    kind = identify(path)
    header = path if kind == "envi header" else header_beside(path)
    if kind not in ("envi header", "envi data") or header is None:
        raise ValueError(f"{path}: not an ENVI image; read_spectra reads tables and libraries of spectra")
    from .formats.envi import is_library, read_envi_cube

    if is_library(header):
        raise ValueError(f"{path}: an ENVI spectral library, not an image; use read_spectra")
    return read_envi_cube(header, path if kind == "envi data" else None)
