"""The one entry to read spectra: recognises the format by the content and calls its reader."""

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from ...progress import Progress
from ..finish import finish
from ..quantity import Stated
from ..source import Source, open_source, split_sheet
from ..spectra_table import SpectraTable
from .sniff import header_beside, identify

if TYPE_CHECKING:
    from ..formats.envi import EnviFile


def read_spectra(
    path: str | Path,
    *,
    progress: Progress | None = None,
    quantity: str | None = None,
    unit: str | None = None,
    scale: float | None = None,
) -> SpectraTable:
    """Read reflectance spectra, in any format that is known.

    CSV or TSV, wide, long or longest, also below lines of an instrument's own; columns of numbers
    without a header; workbooks (the first sheet, or FILE.xlsx:SHEET); ENVI spectral libraries and
    images (header or data file named; of an image every pixel); CGATS text; CxF3; JCAMP-DX; QTX;
    ASD; SVC; ProcSpec; and JSON lists of wavelengths and spectra, as Kimera's. The content says
    which, not the name. Of readings with the specular component (SCI) and without (SCE) each is a
    spectrum, ``NAME SCI`` and ``NAME SCE``. Wavelengths that descend are sorted. Values are
    fractions or percent, as the file says, else percent if any exceeds 2; a file that says another
    quantity than reflectance is refused. The table says in `notes` what was changed or taken for
    granted. A pipe such as ``/dev/stdin`` reads as a file does. Tables are read in pieces and may
    be large.

    Two samples of one name are an error in a text table, which can be corrected by hand; in the
    other formats the second becomes ``name (2)``, with a note.

    Args:
        path: of the file, or FILE.xlsx:SHEET.
        progress: called as it is read with the bytes read, those of the file (None for a pipe), and
            'reading'.
        quantity: ``reflectance``, where that is what the values are, whatever the file calls them.
        unit: what the file does not say, or says wrongly: ``nm``, ``um``, ``1/cm`` of wavelengths,
            ``percent`` or ``fraction`` of values, or one of each, ``1/cm percent``.
        scale: number that stands for a reflectance of 1.

    Raises:
        FileNotFoundError: no such file, or an ENVI header without its data.
        OSError: the system cannot read it.
        ValueError: the file is not legal; the message is one line that says where and what would
            correct it.
    """
    path = Path(path)
    stated = Stated(quantity=quantity, unit=unit, scale=scale)
    file, sheet = split_sheet(path)
    with open_source(file, progress=progress) as source:
        kind = identify(source)
        if kind not in ("envi header", "envi data"):
            # Imported when a file asks for it.
            module = import_module(f"..formats.{kind}", __package__)
            reader = getattr(module, f"read_{kind}")
            return finish(reader(source, sheet) if sheet else reader(source), path, **stated)
        envi = _envi(source, kind)
        if envi.is_library:
            return finish(envi.library(), path, **stated)
        return envi.table(**stated)


def envi_file(path: str | Path) -> "EnviFile":
    """ENVI file of which header or data are named: the header read and the sizes checked.

    Raises:
        FileNotFoundError: no such file, or a header without its data.
        OSError: the system cannot read it.
        ValueError: it is no ENVI file, or not a legal one.
    """
    with open_source(path) as source:
        kind = identify(source)
        if kind not in ("envi header", "envi data"):
            raise source.error(
                "not an ENVI image; read_spectra reads tables and libraries of spectra"
            )
        return _envi(source, kind)


def _envi(source: Source, kind: str) -> "EnviFile":
    """ENVI file of which the header or the data were named."""
    from ..formats.envi import EnviFile

    if kind == "envi header":
        return EnviFile(source)
    header = header_beside(source.path)
    assert header is not None
    with open_source(header) as header_source:
        return EnviFile(header_source, source.path)
