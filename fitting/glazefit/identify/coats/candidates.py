"""Two coats as candidates of a spectrum, weighed as probable as it is that paints lie so."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float
from scipy.special import logsumexp

from ..search.candidates import with_surface
from ..search.fit import FilmNumbers, Fitted, pool_of
from ..search.pool import Pool
from ..search.refine import Groups, move_readings, slopes_by_amount
from ..search.task import Chunk, IdentificationTask, Measured
from .arrangement import Arrangement, PaintNumbers
from .evidence import Evidence
from .readings import CoatedFilms


class WeighedSet(NamedTuple):
    """A set of paints for some spectra over one ground, in all ways in which it may lie.

    Attributes:
        members: the paints, by number.
        rows: the spectra.
        arrangements: in which the paints may lie.
        stated: evidence of each with the library as it is.
        logs: log of how probable each way is over all that the library may be, its prior a part of
            it, up to what is the same for all sets of a spectrum.
        readings: of the best films of each, without the outer surface's part.
    """

    members: PaintNumbers
    rows: FilmNumbers
    arrangements: Sequence[Arrangement]
    stated: Sequence[Evidence]
    logs: Float[np.ndarray, "ways films"]
    readings: Float[np.ndarray, "ways films readings"]

    @property
    def several(self) -> Bool[np.ndarray, "ways"]:
        """True for ways of more than one coat."""
        return np.array([len(arrangement.coats) > 1 for arrangement in self.arrangements])


def log_rarity(task: IdentificationTask) -> Float[np.ndarray, "paints"]:
    """Log of how much less probable each paint is in a set: of those that hardly show."""
    return np.log(np.where(task.extenders, task.prior.extender, 1.0))


def with_coats(
    task: IdentificationTask, measured: Measured, pool: Pool, weighed: Sequence[WeighedSet]
) -> Pool:
    """The candidates with those of two coats, as probable relative to one coat as the weighed sets
    are.

    Args:
        task: of the search.
        measured: spectra.
        pool: their candidates of one coat.
        weighed: sets for them.
    """
    # Of each spectrum: the evidence of all weighed mixtures, and the largest of any arrangement.
    count = len(measured)
    flat = np.full(count, -np.inf)
    best = np.full(count, -np.inf)
    for weighed_set in weighed:
        set_rows = weighed_set.rows
        mixed = np.asarray(logsumexp(weighed_set.logs[~weighed_set.several], axis=0))
        flat[set_rows] = np.logaddexp(flat[set_rows], mixed)
        best[set_rows] = np.maximum(best[set_rows], weighed_set.logs.max(axis=0))
    rare = log_rarity(task)
    scale = np.asarray(logsumexp(pool.log_weight, axis=1)) - flat

    # Arrangements of two coats, on the scale on which the pool weighs the same mixtures.
    rows = []
    pools = []
    for weighed_set in weighed:
        for number, arrangement in enumerate(weighed_set.arrangements):
            logs = weighed_set.logs[number]
            # Coats whose log chance is 8 below the spectrum's best are no candidate.
            films = np.flatnonzero(logs > best[weighed_set.rows] - 8.0)
            if len(arrangement.coats) == 2 and films.size:
                film_rows = weighed_set.rows[films]
                near = _candidates(
                    Chunk(task, measured.take(film_rows)),
                    weighed_set.members,
                    arrangement,
                    weighed_set.stated[number],
                    films,
                )
                weight = logs[films] + scale[film_rows] + rare[list(weighed_set.members)].sum()
                pools.append(replace(near, log_weight=weight[:, None]))
                rows.append(film_rows)
    return pool.merge(Pool.join(pools).spread(np.concatenate(rows), count)) if pools else pool


def _candidates(
    chunk: Chunk,
    members: PaintNumbers,
    arrangement: Arrangement,
    evidence: Evidence,
    films: FilmNumbers,
) -> Pool:
    """One candidate for each of some films, with amounts that come near the readings.

    Args:
        chunk: the films.
        members: paints, by number.
        arrangement: in which they lie.
        evidence: of this for more films.
        films: numbers of the chunk's films among these.
    """
    task = chunk.task
    size = len(members)
    sets = np.tile(np.array(members, dtype=np.int32), (len(films), 1))
    coated = CoatedFilms(
        coefficients=np.stack(task.paints)[:, list(members)].astype(float),
        grounds=chunk.spectra.grounds[0],
        optics=task.optics,
        response=task.response,
    )

    # Three of Gauss and Newton's steps from the most probable place of the grid, each of at most .3
    # in a log amount.
    white = chunk.near_errors.basis
    logs = evidence.nearest[films]
    for _ in range(3):
        readings, slopes = coated.read_and_slopes(arrangement, np.exp(logs))
        by_amount = slopes_by_amount(slopes) @ white.swapaxes(1, 2)
        off = white @ (chunk.target - readings)[..., None]
        # The added .1 holds amounts that hardly change the readings.
        normal = by_amount @ by_amount.swapaxes(1, 2) + 0.1 * np.eye(size)
        step = np.linalg.solve(normal, by_amount @ off)[..., 0]
        logs = logs + np.clip(step, -0.3, 0.3)
    readings, slopes = coated.read_and_slopes(arrangement, np.exp(logs))

    fitted = Fitted(
        logs=logs[:, None],
        covariance=evidence.covariance[films][:, None],
        log_evidence=np.zeros((len(films), 1)),
        readings=readings[:, None],
    )
    pool = pool_of(task, sets[:, None], fitted)
    pool.coats[..., list(arrangement.coats[1])] = 1
    weighed = pool.logs.copy()
    weighed[..., :size] = evidence.log_amounts[films][:, None]
    row = np.arange(len(films))
    adjusted = move_readings(chunk, readings, Groups(row, row, sets, slopes))
    pool = replace(pool, weighed=weighed, adjusted=adjusted[:, None])
    return with_surface(chunk, pool)
