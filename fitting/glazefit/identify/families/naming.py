"""Names of what was found: families, and one name for several that a spectrum cannot separate.

Whites and extenders, blacks, and iron oxides differ from one another by less than one maker's from
another's. Where none of a group's families has most of the group's probability, the answer is the
group, with its likeliest families; of the blacks, which a spectrum does not separate, it always is.
What white or black accompanies a colour changes a spectrum less than the colour does: films of
the same colours are one answer, which names the companion that is most probable.
"""

from collections import defaultdict
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from ..result.groups import COLOURLESS, GROUPS, FamilySet, group_of
from .search import FamilySearch

DISTINGUISHED = 0.8
"""Share of a group's probability from which one family of it is named."""
LARGEST = 4
"""Families of a group that are named with it."""
# Probability from which an answer is listed, and share of an answer's from which a set's families
# are counted in it.
_SMALL = 1e-3


def name_sets(search: FamilySearch, probabilities: Float[np.ndarray, "sets"]) -> list[FamilySet]:
    """Answers of one spectrum, best first: sets of the same colours, or of the same groups where
    there is no colour, are one. The nearest is an answer however improbable it is.

    Args:
        search: that the probabilities are from.
        probabilities: of each of its sets of families.
    """
    sets_of: defaultdict[frozenset[str], list[tuple[float, list[str]]]] = defaultdict(list)
    totals: defaultdict[frozenset[str], float] = defaultdict(float)
    for answer, names, chance in zip(
        search.answers, search.sets, probabilities.tolist(), strict=True
    ):
        sets_of[answer].append((chance, names))
        totals[answer] += chance
    ranked = sorted(totals, key=lambda answer: -totals[answer])
    probable = [answer for answer in ranked if totals[answer] >= _SMALL]
    return [_answer(sets_of[answer], totals[answer]) for answer in probable or ranked[:1]]


def _answer(sets: Sequence[tuple[float, list[str]]], total: float) -> FamilySet:
    """One answer: sets of the same colours, with the companion that is most probable, and families
    of a group relative to one another.

    Args:
        sets: probability of each, and its families.
        total: of these probabilities.
    """
    sets = [(chance, names) for chance, names in sets if chance > _SMALL * total]
    # Which groups together have most of it: a colour alone, or with a white, or with a black.
    of_groups: defaultdict[frozenset[str], float] = defaultdict(float)
    for chance, members in sets:
        of_groups[frozenset(map(group_of, members))] += chance
    groups = max(of_groups, key=lambda key: of_groups[key])

    by_group: dict[str, defaultdict[str, float]] = {group: defaultdict(float) for group in groups}
    for chance, members in sets:
        for family in members:
            if (shares := by_group.get(group_of(family))) is not None:
                shares[family] += chance
    names = []
    within = {}
    for group, families in by_group.items():
        ranked = sorted(families, key=lambda family: -families[family])
        group_total = sum(families.values())
        if families[ranked[0]] >= DISTINGUISHED * group_total and group != "a black":
            names.append(ranked[0])
            continue
        names.append(group)
        # A black that has no chance of its own is named with the others for what it is called.
        ranked += [name for name in GROUPS[group] if group == "a black" and name not in ranked]
        within[group] = tuple(
            (family, families.get(family, 0.0) / group_total) for family in ranked[:LARGEST]
        )
    return FamilySet(families=coloured_first(names), probability=total, within=within)


def coloured_first(names: Sequence[str]) -> tuple[str, ...]:
    """Names in the order of the alphabet, whites, extenders and blacks last."""
    return tuple(sorted(names, key=lambda name: (name in COLOURLESS, name.casefold())))
