"""Explanations of a reading as they are drawn with it."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from ..families.features import at_brightness_of
from ..result import Identification
from ..result.groups import answer_of

FITS = 3
"""Explanations that are drawn, at most."""
LEAST = 0.001
"""Of the first one's probability: a less probable explanation would only stretch the axes."""


@dataclass(frozen=True, kw_only=True)
class Explanation:
    """A film that is drawn.

    Attributes:
        words: of its paints, or of the families that it stands for.
        probability: of these.
        paints: names.
        fitted: reflectance factors, (grounds, bands), NaN where they are not known; where families
            were searched at the gloss and brightness of the reading, as they are compared.
        scale: what its brightness was multiplied by.
    """

    words: str
    probability: float
    paints: tuple[str, ...]
    fitted: Float[np.ndarray, "grounds bands"]
    scale: float


def explanations(identification: Identification, row: int, count: int) -> list[Explanation]:
    """The most probable explanations of one spectrum: sets of paints, or where families were
    searched sets of these, each with the film that stands for it.

    Args:
        identification: its result.
        row: number of the spectrum.
        count: most explanations.
    """
    if not identification.family_sets:
        return [
            Explanation(
                words=candidate.words,
                probability=candidate.probability,
                paints=candidate.paints,
                fitted=candidate.fitted,
                scale=1.0,
            )
            for candidate in identification.ranked(row, count)
        ]
    films = identification.films_of_answers(row)
    out = []
    for answer in identification.family_sets[row][:count]:
        film = films.get(answer_of(answer.families))
        # Of an improbable answer no film may have been kept.
        if film is not None:
            fitted, scale = at_brightness_of(
                identification.measured.readings[row, 0], film.fitted[0]
            )
            out.append(
                Explanation(
                    words=" + ".join(answer.families),
                    probability=answer.probability,
                    paints=film.paints,
                    fitted=fitted[None],
                    scale=scale,
                )
            )
    return out
