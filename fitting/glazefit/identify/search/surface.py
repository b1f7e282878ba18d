"""Readings of candidates as they are seen: with what the surface adds, and amounts in metres."""

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from .pool import Pool
from .task import Chunk


def with_surface(chunk: Chunk, pool: Pool) -> Pool:
    """The pool with readings as they are seen, and amounts in metres.

    How much the surface adds, and the other unknowns of `Measured.doubt`, are estimated from each
    candidate's residual.
    """
    task = chunk.task
    shapes, solved = nuisance_modes(chunk)
    off = chunk.target[:, None] - pool.readings
    estimates = solved @ np.swapaxes(off, 1, 2)
    added = np.maximum(task.mean_surface + task.surface_sd * estimates[:, 0], 0.0)
    # As a share of a smooth surface's; an instrument that sees none of that has no such share.
    gloss = added / task.surface if task.surface > 0 else np.ones_like(added)
    readings = pool.readings + added[..., None]
    readings = readings + np.swapaxes(estimates[:, 1:], 1, 2) @ shapes[:, 1:]
    lengths = {
        name: getattr(pool, name) + np.log(task.prior.thickness) for name in ("logs", "weighed")
    }
    return replace(
        pool, readings=readings, adjusted=pool.adjusted + task.mean_surface, gloss=gloss, **lengths
    )


def nuisance_modes(
    chunk: Chunk,
) -> tuple[
    Float[np.ndarray, "spectra shapes readings"], Float[np.ndarray, "spectra shapes readings"]
]:
    """Modes that move all bands of a reading together: the surface, and the unknowns of
    `Measured.doubt`.

    Ridge regression on their shapes, each with a standard deviation of 1 a priori; errors are
    independent from band to band.

    Returns:
        What each does per standard deviation, and a matrix that estimates how much of each is in a
        residual.
    """
    count, readings = chunk.target.shape
    doubt = chunk.spectra.doubt
    shapes = np.concatenate(
        [
            np.full((count, 1, readings), chunk.task.surface_sd),
            doubt.reshape(*doubt.shape[:2], readings),
        ],
        axis=1,
    )
    precise = shapes / chunk.tolerance.reshape(count, 1, readings) ** 2
    normal = precise @ np.swapaxes(shapes, 1, 2) + np.eye(shapes.shape[1])
    return shapes, np.linalg.solve(normal, precise)
