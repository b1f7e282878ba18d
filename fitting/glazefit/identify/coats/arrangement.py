"""Arrangements of the paints of a film: mixed in one coat, or in several, one over another."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

PaintNumbers: TypeAlias = tuple[int, ...]
"""Numbers of the paints of a set, or their places in it."""


@dataclass(frozen=True)
class Arrangement:
    """Paints of a set in coats.

    Attributes:
        coats: the coats, top first, each the places of its paints in the set.
    """

    coats: tuple[PaintNumbers, ...]

    @property
    def paints(self) -> PaintNumbers:
        """Places of all its paints, ascending."""
        return tuple(sorted(index for coat in self.coats for index in coat))

    def words(self, names: Sequence[str]) -> str:
        """Such as ``LeadWhite over Azurite``, or ``Azurite + LeadWhite``.

        Args:
            names: of the set's paints.
        """
        sides = [" + ".join(names[index] for index in coat) for coat in self.coats]
        if len(sides) == 1:
            return sides[0]
        return " over ".join(f"({side})" if " + " in side else side for side in sides)


def arrangements(count: int, max_coats: int) -> list[Arrangement]:
    """All ways in which some paints lie in one coat or more, the mixture first.

    Args:
        count: of paints.
        max_coats: most coats.
    """
    return [
        Arrangement(
            tuple(
                tuple(paint for paint in range(count) if coat_of[paint] == coat)
                for coat in range(coats)
            )
        )
        for coats in range(1, max_coats + 1)
        for coat_of in itertools.product(range(coats), repeat=count)
        # No coat is empty.
        if len(set(coat_of)) == coats
    ]
