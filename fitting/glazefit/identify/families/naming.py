"""Names of what was found: families, and one name for several that a spectrum cannot separate.

Whites and extenders, blacks, and iron oxides differ from one another by less than one maker's from
another's. Where none of a group's families has most of the group's probability, the answer is the
group, with its likeliest families; of the blacks, which a spectrum does not separate, it always is.
What white or black accompanies a colour changes a spectrum less than the colour does: films of
the same colours are one answer, which names the companion that is most probable.
"""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from jaxtyping import Bool, Float, Int

from ..result.groups import COLOURLESS, GROUPS, FamilySet, answer_of, group_of
from .search import FamilySearch

DISTINGUISHED = 0.8
"""Share of a group's probability from which one family of it is named."""
LARGEST = 4
"""Families of a group that are named with it."""
# Share of an answer's probability below which a set's families are not counted in it.
_SMALL = 1e-3


def name_sets(search: FamilySearch, probabilities: Float[np.ndarray, "sets"]) -> list[FamilySet]:
    """Answers of one spectrum, best first: sets of the same colours, or of the same groups where
    there is no colour, are one.

    Args:
        search: that the probabilities are from.
        probabilities: of each of its sets of families.
    """
    count, group_of_set, named = _groups_of_sets(search.families, search.sets)
    totals = np.bincount(group_of_set, weights=probabilities, minlength=count)
    ordered = [int(number) for number in np.argsort(-totals, kind="stable")]
    return [
        _answer(named, probabilities, group_of_set == number, float(totals[number]))
        for number in ordered
        if totals[number] >= _SMALL
    ]


@lru_cache(maxsize=8)
def _groups_of_sets(
    families: tuple[str, ...], members: tuple[tuple[int, ...], ...]
) -> tuple[int, Int[np.ndarray, "sets"], list[list[tuple[str, str]]]]:
    """Number of different answers, by their colours; of each set its number, and its families
    after the groups that they are of.
    """
    number: dict[frozenset[str], int] = {}
    of_set = []
    named = [[families[member] for member in row if member >= 0] for row in members]
    for names in named:
        of_set.append(number.setdefault(answer_of(names), len(number)))
    pairs = [[(group_of(name), name) for name in names] for names in named]
    return len(number), np.array(of_set), pairs


def _answer(
    named_sets: Sequence[list[tuple[str, str]]],
    probabilities: Float[np.ndarray, "sets"],
    chosen: Bool[np.ndarray, "sets"],
    total: float,
) -> FamilySet:
    """One answer: sets of the same colours, with the companion that is most probable, and families
    of a group relative to one another.
    """
    chosen = chosen & (probabilities > _SMALL * total)
    chances = probabilities[chosen].tolist()
    named = [named_sets[number] for number in np.flatnonzero(chosen).tolist()]
    # Which groups together have most of it: a colour alone, or with a white, or with a black.
    of_groups: dict[frozenset[str], float] = {}
    for chance, members in zip(chances, named, strict=True):
        key = frozenset(group for group, _ in members)
        of_groups[key] = of_groups.get(key, 0.0) + chance
    groups = max(of_groups, key=lambda key: of_groups[key])

    by_group: dict[str, dict[str, float]] = {group: {} for group in groups}
    for chance, members in zip(chances, named, strict=True):
        for group, family in members:
            if group in groups:
                by_group[group][family] = by_group[group].get(family, 0.0) + chance
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
