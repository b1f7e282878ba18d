"""Two coats as candidates of a spectrum, weighed as probable as it is that paints lie so."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float
from scipy.special import logsumexp

from ..search.candidates import with_surface
from ..search.fit import FilmNumbers, Fitted, pool_of
from ..search.pool import Pool
from ..search.refine import Groups, move_readings, slopes_by_amount
from ..search.task import Chunk, IdentificationTask, Measured
from .arrangement import PaintNumbers
from .evidence import Evidence, WeighedSet
from .readings import CoatedFilms


def with_coats(
    task: IdentificationTask,
    measured: Measured,
    pool: Pool,
    weighed: Sequence[WeighedSet],
    rarity: Float[np.ndarray, "paints"],
) -> Pool:
    """The candidates with those of two coats, as probable relative to one coat as the weighed sets
    are.

    Args:
        task: of the search.
        measured: spectra.
        pool: their candidates of one coat.
        weighed: sets for them.
        rarity: log of how much less probable each paint is in a set.
    """
    # Of each spectrum: the evidence of all weighed mixtures, and the largest of any arrangement.
    count = len(measured)
    flat = np.full(count, -np.inf)
    best = np.full(count, -np.inf)
    for weighed_set in weighed:
        mixed = np.asarray(logsumexp(weighed_set.logs[~weighed_set.layered], axis=0))
        np.logaddexp.at(flat, weighed_set.rows, mixed)
        np.maximum.at(best, weighed_set.rows, weighed_set.logs.max(axis=0))
    scale = np.asarray(logsumexp(pool.log_weight, axis=1)) - flat

    # Arrangements of two coats, on the scale on which the pool weighs the same mixtures.
    rows = []
    pools = []
    for weighed_set in weighed:
        members = weighed_set.members
        for evidence, logs in zip(weighed_set.evidence, weighed_set.logs, strict=True):
            # Coats whose log chance is 8 below the spectrum's best are no candidate.
            films = np.flatnonzero(logs > best[weighed_set.rows] - 8.0)
            if len(evidence.arrangement.coats) == 2 and films.size:
                film_rows = weighed_set.rows[films]
                chunk = Chunk(task, measured.take(film_rows))
                near = _candidates(chunk, members, evidence, films)
                weight = logs[films] + scale[film_rows] + rarity[list(members)].sum()
                pools.append(replace(near, log_weight=weight[:, None]))
                rows.append(film_rows)
    return pool.merge(Pool.join(pools).spread(np.concatenate(rows), count)) if pools else pool


def _candidates(
    chunk: Chunk,
    members: PaintNumbers,
    evidence: Evidence,
    films: FilmNumbers,
) -> Pool:
    """One candidate for each of some films, with amounts that come near the readings.

    Args:
        chunk: the films.
        members: paints, by number.
        evidence: of their arrangement, for more films.
        films: numbers of the chunk's films among these.
    """
    task = chunk.task
    arrangement = evidence.arrangement
    size = len(members)
    sets = np.tile(np.array(members, dtype=np.int32), (len(films), 1))
    coated = CoatedFilms.of(task, members, chunk.spectra.grounds[0])

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
