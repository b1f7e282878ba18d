"""Representatives of an image with their candidates, and what they say of any of its spectra."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float

from ...film.model.errors import Prior
from .by_family import Answered, FamilySearcher
from .local import Searched, as_measured, search_locally
from .survey import Features, PerSpectrum, SpectraReadings, nearest
from .task import MapTask
from .update import Answers, answers_near


@dataclass(frozen=True)
class Atlas:
    """Representatives, and the candidates of each; of families the answer to each.

    Attributes:
        features: by which spectra are compared with them.
        representatives: readings and candidates, or answers.
        prior: what was expected.
    """

    features: Features
    representatives: Searched | Answered
    prior: Prior

    @cached_property
    def centres(self) -> Float[np.ndarray, "representatives directions"]:
        """Features of the representatives."""
        return self.features(self.representatives.readings)

    def answers(self, readings: SpectraReadings) -> tuple[Answers, PerSpectrum]:
        """Answers for spectra, and the distance of each from its representative.

        Families have the answer of the representative: paints of one family are far more apart
        than a spectrum is from it. A map's agreement says what that costs.
        """
        searched = self.representatives
        which, distance = nearest(self.features(readings), self.centres)
        if isinstance(searched, Answered):
            return searched.answers.take(which), distance
        answers = Answers.empty(len(readings), searched.rest_paints.shape[1], readings.shape[1])
        order = np.argsort(which, kind="stable")
        used, first = np.unique(which[order], return_index=True)
        # One after another: so few pixels at a time, two threads would only wait for Python's lock.
        for number, rows in zip(used.tolist(), np.split(order, first)[1:], strict=True):
            answers.put(rows, answers_near(searched, number, self.prior, readings[rows]))
        return answers, distance


def search_for_atlas(task: MapTask, readings: SpectraReadings) -> Searched | Answered:
    """Search spectra in full; see `search_locally` and `FamilySearcher`."""
    if isinstance(task.searcher, FamilySearcher):
        return task.searcher.search(readings, task.ground)
    measured = as_measured(task.searcher, readings, task.image.noise_sd(readings), task.ground)
    return search_locally(task.searcher, measured)
