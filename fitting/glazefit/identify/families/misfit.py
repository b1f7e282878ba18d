"""Usual misfit of the film of a right answer to a reading, learnt from the exemplars: each is
searched among those of other sources.

A film is compared at the reading's gloss and brightness, which say little of a pigment
(`features.py`).
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from glazejax.spectra import Bands, lie_between

from .features import with_one_gloss

if TYPE_CHECKING:
    from .search import FamilySearch


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


def misfit_of_right_answers(search: "FamilySearch") -> UsualMisfit | None:
    """Misfits of the answers of a search that are right about its own exemplars, sources left out
    in turn; None where none is.
    """
    # Only a search by families pays for scipy.
    from .calibration import exemplars_as_readings, right_sets

    readings, rows = exemplars_as_readings(search)
    odds = search.odds(readings, sources=search.source_of[rows])
    first = odds.sets.argmax(axis=1)
    correct = right_sets(search)[search.family_of[rows], first]
    if not correct.any():
        return None
    # Residual of each right answer's film, at the bands where both are known.
    films = search.compared
    off = np.full(readings.shape, np.nan)
    for row in np.flatnonzero(correct):
        template = int(odds.best[row, first[row]])
        grid = np.asarray(search.exemplars[rows[row]].wavelengths)
        # Beyond the bands that an exemplar is known at, its reading is made up.
        covered = lie_between(search.wavelengths, grid[0], grid[-1]) & films.bands
        film = np.full(covered.size, np.nan)
        film[films.bands] = films.templates.readings[template] + search.surface
        film[~covered] = np.nan
        off[row] = relative_misfit(readings[row], film)
    off = off[correct & np.isfinite(off).any(axis=1)]
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


def at_brightness_of(reading: Bands, film: Bands) -> tuple[Bands, float]:
    """A computed film at the gloss and brightness of a reading, at the bands that are compared, and
    what its brightness was multiplied by.

    Args:
        reading: reflectance factors.
        film: the same; where it is not known, NaN or held as at the last band that is.
    """
    finite = np.flatnonzero(np.isfinite(film))
    changes = np.flatnonzero(np.diff(film[finite]))
    compared = finite[changes[0] : changes[-1] + 2] if changes.size else finite
    # Both as the search compares them, their gloss at one level.
    body = with_one_gloss(reading[compared])
    film_body = with_one_gloss(film[compared])
    scale = float(body @ film_body / (film_body @ film_body))
    out = np.full(film.shape, np.nan)
    out[compared] = reading[compared] - body + scale * film_body
    return out, scale


def relative_misfit(reading: Bands, film: Bands) -> Bands:
    """A reading less a film at its gloss and brightness, in shares of the reading's brightest band
    above its gloss; args as for `at_brightness_of`.
    """
    return (reading - at_brightness_of(reading, film)[0]) / brightest(reading)


def brightest(reading: Bands) -> float:
    """Unit of a reading's misfits: its brightest band, its gloss at one level."""
    return float(with_one_gloss(reading).max())
