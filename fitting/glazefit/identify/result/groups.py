"""Families that a spectrum often cannot separate, those without colour, and a set of families as
an answer.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

GROUPS: Mapping[str, tuple[str, ...]] = {
    "a white": (
        "lead white",
        "zinc white",
        "titanium white",
        "zinc sulphide white",
        "chalk",
        "barium sulphate",
        "gypsum",
    ),
    "a black": ("carbon black", "iron black"),
    "an iron oxide": ("red ochre", "yellow ochre", "burnt umber", "raw umber"),
}
"""Families that may have one name together."""
COLOURLESS = frozenset({"a white", "a black", *GROUPS["a white"], *GROUPS["a black"]})
"""What is named last in a set."""

_GROUP_OF: dict[str, str] = {
    family: group for group, members in GROUPS.items() for family in members
}


def group_of(family: str) -> str:
    """The group of a family, or the family itself where it has none."""
    return _GROUP_OF.get(family, family)


def answer_of(families: Iterable[str]) -> frozenset[str]:
    """Key that sets of families of one answer share: their coloured groups, or all their groups
    where none has a colour.
    """
    groups = frozenset(map(group_of, families))
    return groups - COLOURLESS or groups


@dataclass(frozen=True, kw_only=True)
class FamilySet:
    """One answer: the pigments of a film.

    Attributes:
        families: names of families or of groups, coloured ones first.
        probability: of its coloured families, whatever whites, extenders and blacks are with them;
            of an answer without a colour, of its groups.
        within: of each group that is named: its likeliest families and their probabilities next to
            one another, best first.
    """

    families: tuple[str, ...]
    probability: float
    within: Mapping[str, tuple[tuple[str, float], ...]]

    @property
    def words(self) -> str:
        """Such as ``azurite + a white (lead white 60 %, chalk 30 %)``."""
        return " + ".join(map(self._words_of, self.families))

    def _words_of(self, name: str) -> str:
        """A name with the families of its group that have a share of it, where several have."""
        shares = [
            f"{family} {share:.0%}" for family, share in self.shares(name).items() if share >= 0.005
        ]
        return f"{name} ({', '.join(shares)})" if len(shares) > 1 else name

    def shares(self, name: str) -> dict[str, float]:
        """Families that one of its names stands for, each with its share: of a family itself
        alone.
        """
        return dict(self.within.get(name, ((name, 1.0),)))
