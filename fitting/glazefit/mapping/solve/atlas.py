"""Representatives of an image with their candidates, and what they say of any of its spectra."""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from jaxtyping import Float

from glazejax.progress import Progress
from glazejax.radiative.common.chunks import pieces_of

from ..store.atomic_files import KeyedResults
from ..store.run import finish
from .answers import Answers
from .by_family import FamilySearcher
from .by_paint import PaintSearcher
from .features import Features, PerSpectrum, SpectraReadings, nearest
from .image import Image
from .local import Searched
from .survey import Survey

if TYPE_CHECKING:
    from distributed import Client

ImageSearcher: TypeAlias = PaintSearcher | FamilySearcher
"""Search for paints, or for families of pigments, in the spectra of an image."""


@dataclass(frozen=True)
class Atlas:
    """Representatives, and the candidates of each; of families the answer to each.

    Attributes:
        features: by which spectra are compared with them.
        readings: of the representatives, single precision.
        searched: their candidates, or answers.
        searcher: that they were searched by.
    """

    features: Features
    readings: Float[np.ndarray, "representatives bands"]
    searched: Searched | Answers
    searcher: ImageSearcher

    @cached_property
    def centres(self) -> Float[np.ndarray, "representatives directions"]:
        """Features of the representatives."""
        return self.features(self.readings)

    def answers(self, readings: SpectraReadings) -> tuple[Answers, PerSpectrum]:
        """Answers for spectra, and the distance of each from its representative.

        Families have the answer of the representative: paints of one family are far more apart
        than a spectrum is from it. A map's agreement says what that costs.
        """
        searched = self.searched
        which, distance = nearest(self.features(readings), self.centres)
        if isinstance(searched, Answers):
            return searched.take(which), distance
        answers = Answers.empty(len(readings), searched.rest_paints.shape[1], readings.shape[1])
        order = np.argsort(which, kind="stable")
        used, first = np.unique(which[order], return_index=True)
        # One after another: so few pixels at a time, two threads would only wait for Python's lock.
        for number, rows in zip(used.tolist(), np.split(order, first)[1:], strict=True):
            change = readings[rows] - self.readings[number]
            answers.put(rows, searched.answers_near(number, self.searcher.prior, change))
        return answers, distance


def search_atlas(
    work: KeyedResults,
    searcher: ImageSearcher,
    image: Image,
    surveyed: Survey,
    client: "Client | None",
    progress: Progress,
) -> Atlas:
    """Representatives of an image, searched piece by piece, here or on a cluster.

    Args:
        work: keeps the pieces, and has those of an earlier run.
        searcher: of the image's paints.
        image: with its noise.
        surveyed: the survey that chose the representatives.
        client: of a dask cluster; None searches here.
        progress: called as they are searched.
    """
    # The same pieces in each run: spectra that are searched in other company are rounded in other
    # places.
    readings = surveyed.readings
    noise_sd = image.noise_sd(readings)
    pieces = {
        f"search-{number:04d}": (readings[rows], noise_sd[rows])
        for number, rows in enumerate(pieces_of(np.arange(len(readings)), searcher.piece))
    }
    keys = [*pieces]
    if client is None and {*keys} - work.done():
        searcher.prepare(progress)
    finish(
        keys,
        lambda key: searcher.search(*pieces[key]).arrays(),
        work.done(),
        work.put,
        client,
        progress,
        stage="searching",
    )
    searched = searcher.kind.joined(len(keys), lambda n, name: work.get(keys[n], [name])[name])
    return Atlas(surveyed.features, readings.astype(np.float32), searched, searcher)
