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
    """Representatives, and the candidates of each.

    Attributes:
        features: by which spectra are compared with them.
        centres: their features.
        representatives: readings and candidates.
        prior: what was expected.
    """

    features: Features
    centres: Float[np.ndarray, "representatives directions"]
    representatives: Searched
    prior: Prior

    @classmethod
    def of(cls, features: Features, representatives: Searched, prior: Prior) -> "Atlas":
        """Of representatives that were searched."""
        return cls(features, features(representatives.readings), representatives, prior)

    @cached_property
    def _candidates(self) -> list[slice]:
        """Of each representative, among all."""
        ends = np.searchsorted(
            self.representatives.local.row, np.arange(len(self.centres) + 1)
        ).tolist()
        return [slice(*pair) for pair in itertools.pairwise(ends)]

    @cached_property
    def _orders(self) -> list[list[Smaller]]:
        """Smaller sets of each representative's candidates, each without one paint; used by every
        window.
        """
        local = self.representatives.local
        return [
            smaller_sets(
                members=local.members[candidates],
                condition=local.condition[candidates],
                log_weight=local.log_weight[candidates],
                possible=np.ones(candidates.stop - candidates.start, bool),
            )
            for candidates in self._candidates
        ]

    def answers(
        self, readings: Float[np.ndarray, "spectra bands"]
    ) -> tuple[Answers, Float[np.ndarray, "spectra"]]:
        """Answers for spectra, and the distance of each from its representative."""
        paints = self.representatives.rest_paints.shape[1]
        answers = Answers.empty(len(readings), paints, readings.shape[1])
        which, distance = nearest(self.features(readings), self.centres)
        if not len(readings):
            return answers, distance
        order = np.argsort(which, kind="stable")
        used, first = np.unique(which[order], return_index=True)
        groups = zip(used.tolist(), np.split(order, first[1:]), strict=True)
        candidates = self._candidates
        orders = self._orders

        # One after another: so few pixels at a time, two threads would only wait for Python's lock.
        for number, rows in groups:
            updater = Updater(
                self.representatives, number, candidates[number], orders[number], self.prior
            )
            answers.put(rows, updater.answers(readings[rows]))
        return answers, distance


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


def make_atlas(
    features: Features, searched: Searched | Answered, prior: Prior
) -> Atlas | FamilyAtlas:
    """Atlas of spectra that were searched, which answers for others."""
    if isinstance(searched, Answered):
        return FamilyAtlas(features, searched)
    return Atlas.of(features, searched, prior)
