"""Candidates of spectra: sets from the screen, ranked, the best refined, read as they are seen."""

import numpy as np
from jaxtyping import Float

from glazejax.radiative.common.chunks import pieces_of
from glazejax.radiative.common.threads import in_threads

from .fit import rank
from .pool import Pool
from .refine import refine
from .screen import alike_grounds, table_over
from .surface import with_surface
from .task import Chunk, IdentificationTask, Measured, RowNumbers

CHUNK = 64
"""Spectra that are fitted at a time."""


def find_candidates(task: IdentificationTask, measured: Measured) -> Pool:
    """Fitted candidates of spectra, of those over one ground together; `CHUNK` at a time, a few of
    these side by side.
    """

    def fit(part: tuple[RowNumbers, Float[np.ndarray, "grounds bands"]]) -> Pool:
        rows, ground = part
        chunk = Chunk(task, measured.take(rows))
        return with_surface(chunk, refine(chunk, rank(chunk, table_over(task, ground))))

    parts = [
        (chunk, ground)
        for rows, ground in alike_grounds(measured.grounds)
        for chunk in pieces_of(rows, CHUNK)
    ]
    pool = Pool.join(in_threads(fit, parts))
    # Back in the order of the spectra.
    return pool.take(np.argsort(np.concatenate([rows for rows, _ in parts])))
