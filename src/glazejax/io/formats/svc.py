"""SVC .sig files (Spectra Vista HR-1024i and its kin): a text of one spectrum a file.

Below the line ``data=`` stand wavelength in nm, reading of the white reference, reading of the
sample, and their ratio in percent.
"""

import numpy as np

from ..finish import SPECTROMETER, RawSpectra
from ..source import Source
from ..words import read_number


def read_svc(source: Source) -> RawSpectra:
    """Read the reflectance of a .sig file: its last column, percent.

    Where detectors overlap, each is read up to the middle of the overlap.

    Raises:
        ValueError: there is no line ``data=`` or nothing below it, or a line there is not four
            numbers.
    """
    name = source.path.stem
    rows: list[list[float]] = []
    begun = False
    for number, line in source.lines(damaged="replace"):
        if not begun:
            title, _, value = line.partition("=")
            begun = title.strip() == "data"
            if title.strip() == "comm" and value.strip():
                name = value.strip()
            continue
        if not line.strip():
            continue
        try:
            row = [read_number(word) for word in line.split()]
        except ValueError:
            row = []
        if len(row) != 4:
            raise source.error(f"{line.strip()[:40]!r} are not four numbers", number)
        rows.append(row)
    if not rows:
        raise source.error("an SVC file without numbers below 'data='; was it cut short?")
    table = np.array(rows)
    notes = ["the last column, percent of the white reference, is the reflectance"]
    return RawSpectra(
        wavelengths=table[:, 0],
        names=[name],
        values=table[:, 3][None],
        format="SVC text (.sig)",
        notes=notes,
        scale=100.0,
        lit=SPECTROMETER,
    )
