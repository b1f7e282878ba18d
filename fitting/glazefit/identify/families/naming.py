"""Names of what was found: families, and one name for several that a spectrum cannot tell.

Whites and extenders, blacks, and iron oxides differ from one another by less than one maker's from
another's. Where none of a group's families has most of the group's probability, the answer is the
group, with its likeliest families.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float

from .groups import COLOURLESS, FamilySet, group_of
from .search import FamilySearch

TOLD = 0.8
"""Share of a group's probability from which one family of it is named."""
LARGEST = 4
"""Families of a group that are named with it."""


def name_sets(
    search: FamilySearch, probabilities: Float[np.ndarray, "sets"], least: float = 1e-3
) -> list[FamilySet]:
    """Answers of one spectrum, best first.

    Args:
        search: that the probabilities are from.
        probabilities: of each of its sets of families.
        least: probability below which an answer is left out.
    """
    totals: dict[frozenset[str], float] = {}
    parts: dict[frozenset[str], dict[str, dict[str, float]]] = {}
    for chance, members in zip(probabilities.tolist(), search.members.tolist(), strict=True):
        if chance < 1e-3 * least:
            continue
        names = [search.families[member] for member in members if member >= 0]
        groups = frozenset(group_of(name) for name in names)
        totals[groups] = totals.get(groups, 0.0) + chance
        within = parts.setdefault(groups, {group: {} for group in groups})
        for name in names:
            own = within[group_of(name)]
            own[name] = own.get(name, 0.0) + chance
    ordered = sorted(totals, key=lambda groups: -totals[groups])
    return [_answer(parts[groups], totals[groups]) for groups in ordered if totals[groups] >= least]


def _answer(parts: Mapping[str, Mapping[str, float]], probability: float) -> FamilySet:
    names = []
    within = {}
    for group, families in parts.items():
        ranked = sorted(families, key=lambda family: -families[family])
        total = sum(families.values())
        if families[ranked[0]] >= TOLD * total:
            names.append(ranked[0])
            continue
        names.append(group)
        within[group] = tuple((family, families[family] / total) for family in ranked[:LARGEST])
    return FamilySet(families=coloured_first(names), probability=probability, within=within)


def coloured_first(names: Sequence[str]) -> tuple[str, ...]:
    """Names in the order of the alphabet, whites, extenders and blacks last."""
    return tuple(sorted(names, key=lambda name: (name in COLOURLESS, name.casefold())))
