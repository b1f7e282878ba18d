"""Representatives of an image with their candidates, and what they say of any of its spectra."""

import itertools
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float

from ...film.model.errors import Prior
from ...identify.search.searcher import Searcher
from ...identify.search.weigh import Smaller, smaller_sets
from .by_family import Answered, FamilyAtlas, FamilySearcher
from .local import Searched, search_locally
from .survey import Features, nearest
from .update import Answers, Updater


@dataclass(frozen=True)
class Atlas:
    """What was found of representatives.

    Attributes:
        features: by which spectra are compared with them.
        centres: their features.
        known: their candidates.
        prior: what was expected.
    """

    features: Features
    centres: Float[np.ndarray, "representatives directions"]
    known: Searched
    prior: Prior

    @classmethod
    def of(cls, features: Features, known: Searched, prior: Prior) -> "Atlas":
        """Of representatives that were searched."""
        return cls(features, features(known.readings), known, prior)

    @cached_property
    def _candidates(self) -> list[slice]:
        """Of each representative, among all."""
        ends = np.searchsorted(self.known.local.row, np.arange(len(self.centres) + 1)).tolist()
        return [slice(*both) for both in itertools.pairwise(ends)]

    @cached_property
    def _orders(self) -> list[list[Smaller]]:
        """What each representative's candidates are without a paint; every window asks for it."""
        local = self.known.local
        return [
            smaller_sets(
                members=local.members[own],
                condition=local.condition[own],
                log_weight=local.log_weight[own],
                possible=np.ones(own.stop - own.start, bool),
            )
            for own in self._candidates
        ]

    def answers(
        self, readings: Float[np.ndarray, "spectra bands"]
    ) -> tuple[Answers, Float[np.ndarray, "spectra"]]:
        """What is said of spectra, and how far each is from its representative."""
        paints = self.known.rest_paints.shape[1]
        found = Answers.empty(len(readings), paints, readings.shape[1])
        which, apart = nearest(self.features(readings), self.centres)
        if not len(readings):
            return found, apart
        order = np.argsort(which, kind="stable")
        used, first = np.unique(which[order], return_index=True)
        groups = zip(used.tolist(), np.split(order, first[1:]), strict=True)
        candidates = self._candidates
        orders = self._orders

        # One after another: so few pixels at a time, two threads would only wait for Python's lock.
        for number, rows in groups:
            own = Updater(self.known, number, candidates[number], orders[number], self.prior)
            found.put(rows, own.answers(readings[rows]))
        return found, apart


def search_for_atlas(
    searcher: Searcher | FamilySearcher,
    readings: Float[np.ndarray, "spectra bands"],
    noise_sd: np.ndarray,
    ground: np.ndarray | None,
) -> Searched | Answered:
    """Search spectra in full; see `search_locally` and `FamilySearcher`."""
    if isinstance(searcher, FamilySearcher):
        return searcher.search(readings, ground)
    return search_locally(searcher, readings, noise_sd, ground)


def make_atlas(features: Features, known: Searched | Answered, prior: Prior) -> Atlas | FamilyAtlas:
    """What spectra that were searched say of any others."""
    if isinstance(known, Answered):
        return FamilyAtlas(features, known)
    return Atlas.of(features, known, prior)
