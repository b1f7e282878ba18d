"""Ocean Optics SpectraSuite's own .ProcSpec: an archive with a text of one spectrum."""

import io
import re
import zipfile
import zlib

import numpy as np

from ..finish import SPECTROMETER, RawSpectra
from ..source import MAX_TEXT, Source
from ..spectra_table import Bands
from ..words import read_number

_INSTEAD = "Ocean Optics SpectraSuite (.ProcSpec) that is not read: save it as ASCII (with header)"


def read_procspec(source: Source) -> RawSpectra:
    """Read the processed spectrum of a .ProcSpec file over its channels' wavelengths.

    Raises:
        ValueError: not a whole archive, or its text does not hold them plainly.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(source.content())) as archive:
            texts = [entry for entry in archive.infolist() if entry.filename.startswith("ps_")]
            # What a spectrum unpacks to at most.
            if not texts or texts[0].file_size > MAX_TEXT:
                raise source.error(_INSTEAD)
            text = archive.read(texts[0]).decode("latin-1")
    except (zipfile.BadZipFile, NotImplementedError, RuntimeError, EOFError, zlib.error):
        raise source.error(f"not a whole archive of {_INSTEAD}") from None
    values = _numbers(source, text, "processedPixels")
    wavelengths = _numbers(source, text, "channelWavelengths")
    if values.size != wavelengths.size:
        raise source.error(
            f"{values.size} readings over {wavelengths.size} wavelengths: {_INSTEAD}"
        )
    return RawSpectra(
        wavelengths=wavelengths,
        names=[source.path.stem],
        values=values[None],
        format="SpectraSuite .ProcSpec",
        notes=["the processed spectrum is taken as reflectance; the file does not say what it is"],
        lit=SPECTROMETER,
    )


def _numbers(source: Source, text: str, title: str) -> Bands:
    """Numbers of the first element of a title, which may be read without its text's other parts."""
    _, _, rest = text.partition(f"<{title}")
    words = re.findall(r"<double>([^<]*)</double>", rest.partition(f"</{title}>")[0])
    try:
        values = np.array([read_number(word) for word in words])
    except ValueError:
        values = np.zeros(0)
    if not values.size:
        raise source.error(f"no plain numbers of {title}: {_INSTEAD}")
    return values
