"""Candidates of spectra: sets from the screen, ranked, the best refined, read as they are seen."""

from dataclasses import replace

import numpy as np

from glazejax.radiative.common.chunks import pieces_of
from glazejax.radiative.common.threads import in_threads

from .fit import rank
from .pool import Pool
from .refine import refine
from .screen import table_over
from .table import Grounds
from .task import Chunk, RowNumbers

CHUNK = 64
"""Spectra that are fitted at a time."""
# Grounds of spectra searched together that differ by no more share a table; each film is then
# fitted with its own.
_ALIKE = 0.04


def find_candidates(films: Chunk) -> Pool:
    """Fitted candidates of spectra, of those over one ground together; `CHUNK` at a time, a few of
    these side by side.
    """

    def fit(part: tuple[RowNumbers, Grounds]) -> Pool:
        rows, ground = part
        chunk = films.take(rows)
        return with_surface(chunk, refine(chunk, rank(chunk, table_over(films.task, ground))))

    spectra = films.spectra
    parts = [
        (piece, spectra.grounds[rows].mean(axis=0))
        for rows in spectra.by_grounds(_ALIKE)
        for piece in pieces_of(rows, CHUNK)
    ]
    pool = Pool.join(in_threads(fit, parts))
    # Back in the order of the spectra.
    return pool.take(np.argsort(np.concatenate([rows for rows, _ in parts])))


def with_surface(chunk: Chunk, pool: Pool) -> Pool:
    """The pool with readings over each ground as they are seen, and amounts in metres.

    How much the surface adds, and the other unknowns of `Measured.doubt`, are estimated from each
    candidate's residual.
    """
    task = chunk.task
    off = chunk.target[:, None] - pool.readings
    estimates = off @ np.swapaxes(chunk.shape_estimator, 1, 2)
    added = np.maximum(task.mean_surface + task.surface_sd * estimates[..., 0], 0.0)
    # As a share of a smooth surface's; an instrument that sees none of that has no such share.
    gloss = added / task.surface if task.surface > 0 else np.ones_like(added)
    log_thickness = np.log(task.prior.thickness)
    readings = pool.readings + added[..., None] + estimates[..., 1:] @ chunk.shapes[:, 1:]
    shape = (*added.shape, *chunk.spectra.readings.shape[1:])
    return replace(
        pool,
        logs=pool.logs + log_thickness,
        weighed=pool.weighed + log_thickness,
        readings=readings.reshape(shape),
        adjusted=(pool.adjusted + task.mean_surface).reshape(shape),
        gloss=gloss,
    )
