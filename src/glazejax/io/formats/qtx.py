"""Datacolor QTX: sections of KEY=VALUE, one a standard or a batch, as colour matching exchanges
them.
"""

import re
from itertools import chain

import numpy as np

from ..finish import RawSpectra
from ..quantity import first_quantity
from ..source import Source
from ..words import is_number, read_number

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
    grids = [[keys.get(key, "") for key in _GRID] for _, keys in read]
    words = [keys["R"].split(",") for _, keys in read]
    for word in chain(grids[0], *words):
        if not is_number(word):
            raise source.error(f"{', '.join(_GRID)} and R must be numbers, not {word[:20]!r}")
    low, step, count = map(read_number, grids[0])
    for (number, _), grid, row in zip(read, grids, words, strict=True):
        if grid != grids[0] or len(row) != count:
            raise source.error(
                f"{len(row)} readings, where the first section has {count:g} from {low:g} nm by "
                f"{step:g}: every section must be so",
                number,
            )
    viewing = [keys.get("VIEWING", "") for _, keys in read]
    return RawSpectra(
        wavelengths=low + step * np.arange(count),
        names=[keys.get("NAME", "") for _, keys in read],
        values=np.array([list(map(read_number, row)) for row in words]),
        format="Datacolor QTX",
        quantity=first_quantity([*viewing, "%R"]),
        scale=100.0,
        attributes={"viewing": viewing},
    )
