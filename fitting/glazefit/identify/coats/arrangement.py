"""Arrangements of the paints of a film: mixed in one coat, or in several, one over another."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Arrangement:
    """Paints of a set in coats.

    Attributes:
        coats: the coats, top first, each the places of its paints in the set.
    """

    coats: tuple[tuple[int, ...], ...]

    @property
    def paints(self) -> tuple[int, ...]:
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
    orders = [coats for coats in _orders(tuple(range(count))) if len(coats) <= max_coats]
    return [Arrangement(coats) for coats in sorted(orders, key=len)]


def _orders(paints: tuple[int, ...]) -> Iterator[tuple[tuple[int, ...], ...]]:
    """Ordered partitions of a set."""
    if not paints:
        yield ()
        return
    for chosen in range(1, 2 ** len(paints)):
        top = tuple(paint for bit, paint in enumerate(paints) if chosen >> bit & 1)
        remaining = tuple(paint for paint in paints if paint not in top)
        for below in _orders(remaining):
            yield (top, *below)
