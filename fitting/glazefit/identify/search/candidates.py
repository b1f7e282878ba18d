"""Candidates of spectra: sets from the screen, ranked, the best refined, read as they are seen."""

import numpy as np
from jaxtyping import Int

from glazejax.radiative.common.threads import in_threads

from .chunk import Chunk
from .fit import FEW_SPECTRA, rank
from .pool import Pool
from .refine import refine
from .screen import screen
from .surface import with_surface
from .task import IdentificationTask, Measured
from .weigh import weigh_traces

CHUNK = 64
"""Spectra that are fitted at a time."""


def find_candidates(task: IdentificationTask, measured: Measured) -> Pool:
    """Fitted candidates of spectra; `CHUNK` at a time, a few of these side by side."""
    screened = screen(task, measured)

    def fit(rows: Int[np.ndarray, "rows"]) -> Pool:
        # Few sizes, so that little is compiled.
        padded = np.resize(rows, padded_size(len(rows)))
        real = np.arange(len(rows))
        filled_up = Chunk(task, measured.take(padded))
        chunk = filled_up.take(real)
        table = screened.tables[rows[0]]
        ranked = rank(filled_up, screened.starts.take(padded), table)
        pool = with_surface(chunk, refine(chunk, ranked.of(real)))
        return weigh_traces(pool, task.extenders)

    chunks = np.split(np.arange(len(measured)), range(CHUNK, len(measured), CHUNK))
    return Pool.join(in_threads(fit, chunks))


def padded_size(count: int) -> int:
    """To how many spectra a batch is filled up before it is fitted: 16, or whole chunks."""
    return FEW_SPECTRA if count <= FEW_SPECTRA else CHUNK * -(-count // CHUNK)
