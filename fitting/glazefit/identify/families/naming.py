"""Names of what was found: families, and one name for several that a spectrum cannot tell.

Whites and extenders, blacks, and iron oxides differ from one another by less than one maker's from
another's. Where none of a group's families has most of the group's probability, the answer is the
group, with its likeliest families.
"""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from jaxtyping import Bool, Float, Int

from .groups import COLOURLESS, FamilySet, group_of
from .search import FamilySearch

TOLD = 0.8
"""Share of a group's probability from which one family of it is named."""
LARGEST = 4
"""Families of a group that are named with it."""
# Share of an answer's probability below which a set's families are not counted in it.
_SMALL = 1e-3


def name_sets(
    search: FamilySearch, probabilities: Float[np.ndarray, "sets"], least: float = 1e-3
) -> list[FamilySet]:
    """Answers of one spectrum, best first: sets that differ by families of a group alone are one.

    Args:
        search: that the probabilities are from.
        probabilities: of each of its sets of families.
        least: probability below which an answer is left out.
    """
    count, group_of_set = _groups_of_sets(search.families, search.sets)
    totals = np.bincount(group_of_set, weights=probabilities, minlength=count)
    ordered = [int(number) for number in np.argsort(-totals, kind="stable")]
    return [
        _answer(search, probabilities, group_of_set == number, float(totals[number]))
        for number in ordered
        if totals[number] >= least
    ]


@lru_cache(maxsize=8)
def _groups_of_sets(
    families: tuple[str, ...], members: tuple[tuple[int, ...], ...]
) -> tuple[int, Int[np.ndarray, "sets"]]:
    """How many different answers there are, by their groups, and number of each set's."""
    number: dict[frozenset[str], int] = {}
    of_set = []
    for row in members:
        groups = frozenset(group_of(families[member]) for member in row if member >= 0)
        of_set.append(number.setdefault(groups, len(number)))
    return len(number), np.array(of_set)


def _answer(
    search: FamilySearch,
    probabilities: Float[np.ndarray, "sets"],
    own: Bool[np.ndarray, "sets"],
    total: float,
) -> FamilySet:
    """One answer: the sets whose groups are the same, and their families beside one another."""
    parts: dict[str, dict[str, float]] = {}
    own = own & (probabilities > _SMALL * total)
    for chance, row in zip(probabilities[own].tolist(), search.members[own].tolist(), strict=True):
        for member in row:
            if member >= 0:
                family = search.families[member]
                held = parts.setdefault(group_of(family), {})
                held[family] = held.get(family, 0.0) + chance
    names = []
    within = {}
    for group, families in parts.items():
        ranked = sorted(families, key=lambda family: -families[family])
        whole = sum(families.values())
        if families[ranked[0]] >= TOLD * whole:
            names.append(ranked[0])
            continue
        names.append(group)
        within[group] = tuple((family, families[family] / whole) for family in ranked[:LARGEST])
    return FamilySet(families=coloured_first(names), probability=total, within=within)


def coloured_first(names: Sequence[str]) -> tuple[str, ...]:
    """Names in the order of the alphabet, whites, extenders and blacks last."""
    return tuple(sorted(names, key=lambda name: (name in COLOURLESS, name.casefold())))
