"""Arrangements of the paints of a film: mixed in one coat, or in several, one over another."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

from ...film.model.errors import Prior
from ..search.options import IdentificationOptions

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

    @property
    def layered(self) -> bool:
        """True for more than one coat."""
        return len(self.coats) > 1

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


def ways(count: int, options: IdentificationOptions) -> dict[Arrangement, float]:
    """Ways in which some or all paints of a set may lie -> prior probabilities of these.

    Args:
        count: of the set's paints, two or more.
        options: of the search.
    """
    prior = options.prior or Prior()
    mixture, *layered = arrangements(count, min(options.max_coats, count))
    together = prior.sizes[count - 1]
    chances = {Arrangement(((paint,),)): prior.sizes[0] / count for paint in range(count)}
    chances[mixture] = together * (1.0 - prior.stacked)
    return chances | dict.fromkeys(layered, together * (prior.stacked / len(layered)))
