"""Datacolor QTX: sections of KEY=VALUE, one a standard or a batch, as colour matching exchanges
them.
"""

import re

import numpy as np

from ..finish import RawSpectra
from ..source import Source
from ..words import read_number

# A section's keys begin with STD_ or BAT_.
_KEY = re.compile(r"(?:STD|BAT)_(\w+)\s*=(.*)", re.IGNORECASE)
_GRID = ("REFLLOW", "REFLINTERVAL", "REFLPOINTS")


def read_qtx(source: Source) -> RawSpectra:
    """Read the reflectance of all standards and batches of a QTX file, which is in percent.

    Raises:
        ValueError: no section has readings, a section lacks its wavelengths or has other ones than
            the first, or another number of readings; or a value is no number.
    """
    sections: list[tuple[int, dict[str, str]]] = []
    for number, line in enumerate(source.text().splitlines(), start=1):
        if line.strip().startswith("["):
            sections.append((number, {}))
        elif sections and (match := _KEY.fullmatch(line.strip())):
            sections[-1][1].setdefault(match[1].upper(), match[2].strip())
    read = [(number, keys) for number, keys in sections if keys.get("R")]
    if not read:
        raise source.error("Datacolor QTX without reflectance: no section has STD_R= or BAT_R=")
    first = [read[0][1].get(key, "") for key in _GRID]
    rows: list[list[float]] = []
    try:
        low, step, count = map(read_number, first)
        for number, keys in read:
            rows.append([read_number(word) for word in keys["R"].split(",")])
            if [keys.get(key, "") for key in _GRID] != first or len(rows[-1]) != count:
                raise source.error(
                    f"{len(rows[-1])} readings, where the first section has {count:g} from "
                    f"{low:g} nm by {step:g}: every section must be so",
                    number,
                )
    except ValueError as error:
        if str(source.path) in str(error):
            raise
        raise source.error(f"{', '.join(_GRID)} and R must be numbers: {error}") from None
    return RawSpectra(
        wavelengths=low + step * np.arange(len(rows[0])),
        names=[keys.get("NAME", "") for _, keys in read],
        values=np.array(rows),
        format="Datacolor QTX",
        quantity="%R",
        attributes={"viewing": [keys.get("VIEWING", "") for _, keys in read]},
    )
