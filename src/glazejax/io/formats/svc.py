"""SVC .sig files (Spectra Vista HR-1024i and its kin): a text of one spectrum a file.

Below the line ``data=`` stand wavelength in nm, reading of the white reference, reading of the
sample, and their ratio in percent.
"""

import re

import numpy as np

from ..finish import SPECTROMETER, RawSpectra
from ..source import Source
from ..words import is_number


def read_svc(source: Source) -> RawSpectra:
    """Read the reflectance of a .sig file: its last column, percent.

    Where detectors overlap, each is read up to the middle of the overlap.

    Raises:
        ValueError: there is no line ``data=`` or nothing below it, or a line there is not four
            numbers.
    """
    text = "\n".join(source.text().splitlines())
    above, *below = re.split(r"(?m)^[ \t]*data[ \t]*=.*", text, maxsplit=1)
    comments = re.findall(r"(?m)^[ \t]*comm[ \t]*=[ \t]*(.*\S)", above)
    rows = [line.split() for line in "".join(below).split("\n")]
    for number, words in enumerate(rows, start=above.count("\n") + 1):
        if words and (len(words) != 4 or not all(map(is_number, words))):
            raise source.error(f"{' '.join(words)[:40]!r} are not four numbers", number)
    if not any(rows):
        raise source.error("an SVC file without numbers below 'data='; was it cut short?")
    table = np.array([words for words in rows if words], float)
    return RawSpectra(
        wavelengths=table[:, 0],
        names=[*comments[-1:], source.path.stem][:1],
        values=table[:, 3][None],
        format="SVC text (.sig)",
        notes=["the last column, percent of the white reference, is the reflectance"],
        scale=100.0,
        lit=SPECTROMETER,
    )
