"""Families that a spectrum often cannot tell from one another, and which have no colour."""

from collections.abc import Mapping

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

_GROUP_OF = {family: group for group, members in GROUPS.items() for family in members}


def group_of(family: str) -> str:
    """The group of a family, or the family itself where it has none."""
    return _GROUP_OF.get(family, family)
