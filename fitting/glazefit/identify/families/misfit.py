"""Usual misfit of the film of a right answer to a reading, learnt from the exemplars: each is
searched among those of other sources.

A film is compared at the reading's gloss and brightness, which say little of a pigment
(`features.relative_misfit`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from glazejax import Pigment
from glazejax.spectra import Bands, lie_between

from ..result import Identification
from ..search.options import IdentificationOptions
from .calibration import exemplars_as_readings, right_sets
from .features import relative_misfit
from .set_up import prepare_search


@dataclass(frozen=True, kw_only=True)
class UsualMisfit:
    """Misfits of right answers, in shares of a reading's brightest band.

    Attributes:
        answers: how many were right.
        half, nine_tenths: root mean square over the bands that half, and nine tenths, of them
            stay below.
        band: what half of them stay within at each band, NaN where it is not known, (bands,).
    """

    answers: int
    half: float
    nine_tenths: float
    band: Bands


def usual_misfit(
    identification: Identification, pigments: Sequence[Pigment], options: IdentificationOptions
) -> UsualMisfit | None:
    """Usual misfit of films of right answers to readings like those of an identification: of the
    answers to exemplars that are right, each of them searched among those of other sources; None
    where none is.

    Args:
        identification: by `identify_families`; of several grounds the first one counts.
        pigments, options: of that.
    """
    ground = None if identification.opaque else identification.measured.grounds[0, 0]
    # What is known of one painting is not of the exemplars.
    alone = replace(options, elements=(), without_elements=(), painted=None)
    search = prepare_search(identification.measured.wavelengths, pigments, alone, ground)
    readings, rows = exemplars_as_readings(search)
    odds = search.odds(readings, sources=search.source_of[rows])
    first = odds.sets.argmax(axis=1)
    correct = right_sets(search)[search.family_of[rows], first]
    if not correct.any():
        return None
    # Residual of each right answer's film, at the bands where both are known.
    residuals = []
    for row in np.flatnonzero(correct):
        template = int(odds.best[row, first[row]])
        grid = np.asarray(search.exemplars[rows[row]].wavelengths)
        # Beyond the bands that an exemplar is known at, its reading is made up.
        covered = lie_between(search.wavelengths, grid[0], grid[-1])
        film = np.full(covered.size, np.nan)
        film[search.bands] = search.templates.readings[template] + search.surface
        film[~covered] = np.nan
        residuals.append(relative_misfit(readings[row], film))
    off = np.array(residuals)
    # Over the bands of each answer, and over the answers at each band.
    by_answer = np.sqrt(np.nanmean(off**2, axis=1))
    finite = np.isfinite(off).any(axis=0)
    band = np.full(off.shape[1], np.nan)
    band[finite] = np.nanmedian(np.abs(off[:, finite]), axis=0)
    return UsualMisfit(
        answers=len(off),
        half=float(np.median(by_answer)),
        nine_tenths=float(np.quantile(by_answer, 0.9)),
        band=band,
    )
