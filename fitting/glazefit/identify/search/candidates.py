"""Candidates of spectra: sets from the screen, ranked, the best refined, read as they are seen."""

import numpy as np
from jaxtyping import Int

from glazejax.radiative.common.threads import in_threads

from ...film.numerics.columns import take_rows
from .chunk import Chunk
from .fit import rank
from .pool import Pool
from .refine import refine
from .screen import screen
from .surface import with_surface
from .task import IdentificationTask, Measured

CHUNK = 64
"""Spectra that are fitted at a time."""


def find_candidates(task: IdentificationTask, measured: Measured) -> Pool:
    """Fitted candidates of spectra; `CHUNK` at a time, a few of these side by side."""
    near, tables = screen(task, measured)

    def fit(rows: Int[np.ndarray, "rows"]) -> Pool:
        chunk = Chunk(task, measured.take(rows))
        ranked = rank(chunk, take_rows(near, rows), tables[rows[0]])
        return with_surface(chunk, refine(chunk, ranked))

    chunks = np.split(np.arange(len(measured)), range(CHUNK, len(measured), CHUNK))
    return Pool.join(in_threads(fit, chunks))
