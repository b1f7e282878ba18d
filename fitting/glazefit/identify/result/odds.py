"""Odds of mixture and superposition, as an answer gives them."""

from collections.abc import Mapping
from dataclasses import dataclass

DECIDED = 0.8
"""Probability from which a verdict counts as decided."""


@dataclass(frozen=True, kw_only=True)
class CoatsOdds:
    """Odds of how one set of paints lies in a film, whatever their amounts.

    Attributes:
        paints: names of the set.
        chances: probability of each arrangement, in words such as "Azurite + LeadWhite", "LeadWhite
            over Azurite" or "Azurite"; together 1.
        layered: probability of more than one coat.
        share: probability of this set among all that were weighed.
        reason: why the spectrum does not decide, or empty.
    """

    paints: tuple[str, ...]
    chances: Mapping[str, float]
    layered: float
    share: float
    reason: str

    @property
    def most_probable(self) -> str:
        """The arrangement, in words."""
        return max(self.chances, key=lambda arrangement: self.chances[arrangement])

    def words(self) -> str:
        """One sentence."""
        best = self.most_probable
        if self.reason:
            return (
                f"whether these paints were mixed or laid one over another is open "
                f"({self.layered:.0%} for several coats): {self.reason}"
            )
        if " over " in best:
            return f"laid one over another: {best} ({self.chances[best]:.0%})"
        if len(self.paints) > 1 and " + " in best:
            return f"mixed, not laid one over another ({1.0 - self.layered:.0%} for one coat)"
        return f"one coat ({1.0 - self.layered:.0%})"
