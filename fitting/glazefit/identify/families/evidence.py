"""Facts that are known of a painting: elements that X-ray fluorescence found, and the year.

Odds of a set of families are multiplied by how well its composition and the years of its use fit.
Fluorescence misses light elements and small amounts, and sees layers below, and a painting may have
been retouched, so nothing is ruled out.
"""

import math
import re
from collections.abc import Iterable, Sequence

import numpy as np
from jaxtyping import Float

from glazejax import catalogue
from glazejax.catalogue import Family
from glazejax.names import nearest_hint

MISSED = 0.1
"""Probability that an element of a pigment in the film is not found."""
STRAY = 0.2
"""Probability that an element is found that no pigment of the film holds: of the ground, of a layer
below, of a drier.
"""
ANACHRONISM = 0.02
"""Probability of a pigment in a painting of a year in which it was not in use: of a retouching, or
of a year that is wrong.
"""
LIGHT = frozenset({"H", "C", "N", "O", "F", "Na", "Mg", "Al", "Si", "P", "S", "Cl"})
"""Elements that fluorescence in air hardly sees: whether they were found says nothing."""
# The periodic table, by rows.
_SYMBOLS = frozenset(
    re.findall(
        "[A-Z][a-z]?",
        "HHeLiBeBCNOFNeNaMgAlSiPSClArKCaScTiVCrMnFeCoNiCuZnGaGeAsSeBrKr"
        "RbSrYZrNbMoTcRuRhPdAgCdInSnSbTeIXeCsBaLaCePrNdPmSmEuGdTbDyHoErTmYbLu"
        "HfTaWReOsIrPtAuHgTlPbBiPoAtRnFrRaAcThPaU",
    )
)


def check_elements(symbols: Sequence[str]) -> tuple[str, ...]:
    """Chemical symbols, each once.

    Raises:
        ValueError: one does not exist; names the nearest.
    """
    for symbol in symbols:
        if symbol not in _SYMBOLS:
            hint = nearest_hint(symbol.capitalize(), sorted(_SYMBOLS))
            raise ValueError(
                f"there is no element {symbol!r}{hint}; write symbols such as Cu, Pb, Hg"
            )
    return tuple(dict.fromkeys(symbols))


def facts_of(names: Iterable[str]) -> list[Family]:
    """Facts about families; names of groups, and of own references' families that the catalogue
    does not have, are passed over.
    """
    about = catalogue.families()
    return [about[name] for name in names if name in about]


def log_odds_of_elements(
    sets: Sequence[Sequence[Family]], detected: Sequence[str], absent: Sequence[str]
) -> Float[np.ndarray, "sets"]:
    """Log of how much better each set of families fits what was found, and what was looked for and
    not found, than a film of no pigment that is known does.

    Args:
        sets: families of each set.
        detected, absent: chemical symbols.

    Raises:
        ValueError: no such element, or one that is in both.
    """
    present = check_elements(detected)
    missing = check_elements(absent)
    contradictory = [symbol for symbol in present if symbol in missing]
    if contradictory:
        raise ValueError(f"{contradictory[0]} is said to be found and not to be found")
    # What an element adds to the odds of a set that holds it.
    gains = dict.fromkeys(present, math.log((1.0 - MISSED) / STRAY))
    gains |= dict.fromkeys(missing, math.log(MISSED / (1.0 - STRAY)))
    elements = [{e for family in families for e in family.elements} - LIGHT for families in sets]
    return np.array(
        [sum(gain for symbol, gain in gains.items() if symbol in heavy) for heavy in elements],
        dtype=float,
    )


def log_odds_of_year(
    sets: Sequence[Sequence[Family]], year: int | None
) -> Float[np.ndarray, "sets"]:
    """Log of how well each set of families fits a painting of a year.

    Args:
        sets: families of each set.
        year: negative before Christ; None if it is not known.
    """
    if year is None:
        return np.zeros(len(sets))
    late = [sum(not _in_use(family, year) for family in families) for families in sets]
    return np.log(ANACHRONISM) * np.array(late, dtype=float)


def _in_use(family: Family, year: int) -> bool:
    return family.first_year <= year and (family.last_year is None or year <= family.last_year)


def describe_anachronism(families: Sequence[str], year: int | None) -> str:
    """Name the families that were not in use in a year, in a sentence; empty if all were.

    Args:
        families: names; groups and unknown names are passed over.
        year: negative before Christ; None if it is not known.
    """
    if year is None:
        return ""
    periods = [
        f"{family.name} was in use {family.in_use}"
        for family in facts_of(families)
        if not _in_use(family, year)
    ]
    return f"not of {year}: {'; '.join(periods)}" if periods else ""
