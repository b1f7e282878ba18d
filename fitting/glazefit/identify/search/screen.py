"""Screening of the mixtures that may explain a spectrum: sets of paints, and a coarse search that
says where to start each.

A candidate is a set of one to three paints; its unknowns are the amounts a_i = thickness times
fraction, in units of a usual thickness, so that k d = sum a_i k_i. Sets of one and two paints are
all tried on a grid of amounts (`table`). Sets of three grow from the best pairs,
so that the cost stays in proportion to the number of paints.
"""

import math
import threading
from collections.abc import Hashable

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from glazejax.programs import Program
from glazejax.radiative.common.chunks import by_blocks

from ...film.model.errors import model_correlation, whitening
from ...film.model.response import FilmResponse
from .table import (
    Block,
    FilmTable,
    Grounds,
    NearestSets,
    Paints,
    WhiteningMatrix,
    film_readings,
    film_table,
)
from .task import TYPICAL_READING, Chunk, IdentificationTask

# Amounts of a third paint, as a share of the pair's.
_THIRDS = np.array([0.003, 0.02, 0.1, 0.4, 1.5])
# Spectra whose sets of three are scored at a time.
_SCORED = 16
KEPT_TRIPLES = 40
"""Sets of three that are fitted, of as many."""


_TABLES: dict[Hashable, FilmTable] = {}
"""The last tables that were used, the latest last."""
_TABLES_LOCK = threading.Lock()


def table_over(task: IdentificationTask, ground: Grounds) -> FilmTable:
    """Films over a ground, which searches of the same paints by the same instrument share.

    A table over another ground, however near, would make the answer depend on what was asked
    before.
    """
    # Grounds that are the same but for how a mean was rounded have the same table.
    rounded = np.round(ground, 3)
    key = (
        *(np.asarray(values).tobytes() for values in (rounded, task.wavelengths, *task.paints)),
        *(task.optics, task.surface, task.noise, task.discrepancy),
        *(law := (task.max_paints, task.prior.spread)),
    )
    # Not `glazejax.interpolated`: nothing is asked between the films. Each film stands as 20
    # numbers, and a spectrum is compared with all of them by one product of matrices.
    with _TABLES_LOCK:
        table = _TABLES.pop(key, None) or film_table(
            *task.single, *law, rounded, common_whitening(task, len(rounded))
        )
        _TABLES[key] = table
        if len(_TABLES) > 16:
            _TABLES.pop(next(iter(_TABLES)))
        return table


def common_whitening(task: IdentificationTask, grounds: int) -> WhiteningMatrix:
    """Of a reading of middling size over so many grounds, for the searches that only rank."""
    d = task.discrepancy
    sd = task.noise.sd(np.full(grounds * task.wavelengths.size, TYPICAL_READING))
    smooth = d.screening**2 * model_correlation(task.wavelengths, grounds, d.length, d.shared)
    return whitening(np.diag(sd**2) + task.surface_sd**2 + smooth).basis


def grow_triples(
    chunk: Chunk,
    white: WhiteningMatrix,
    pairs: Int[np.ndarray, "spectra pairs 2"],
    logs: Float[np.ndarray, "spectra pairs 2"],
    log_evidence: Float[np.ndarray, "spectra pairs"],
) -> tuple[NearestSets, Bool[np.ndarray, "spectra sets"]]:
    """Sets of three from the most probable pairs, and whether each is the first of its kind.

    Args:
        chunk: the spectra.
        white: `common_whitening` over their grounds.
        pairs: sets of two.
        logs: log amounts of each.
        log_evidence: of each.
    """
    task = chunk.task
    rows = np.arange(len(pairs))[:, None]
    # A third paint joins the twelve most probable pairs.
    best = np.argsort(-log_evidence, axis=1)[:, :12]
    amounts = np.exp(logs)[rows, best]
    sets, tries = grow(pairs[rows, best], amounts, task.paint_count)
    # Each at a few amounts of the third paint.
    arrays = sets, tries, chunk.spectra.grounds, chunk.target @ white.T

    def run(n: Block) -> tuple[Array, Array]:
        return score(task.response, task.paints, *(values[n] for values in arrays), white)

    cost, where = by_blocks(len(sets), _SCORED, run)
    keep = min(KEPT_TRIPLES, math.comb(task.paint_count, 3))
    # The cheapest different sets. Pairs that overlap can give fewer than wanted: then some come
    # twice.
    unique = []
    for spectrum_sets, costs in zip(sets, cost, strict=True):
        order = np.argsort(costs, kind="stable")
        members = np.sort(spectrum_sets[order], axis=-1)
        _, first = np.unique(members, axis=0, return_index=True)
        unique.append(order[np.sort(first)[:keep]])
    chosen = np.stack([np.resize(numbers, keep) for numbers in unique])
    new = np.arange(keep) < np.asarray([len(numbers) for numbers in unique])[:, None]
    amounts = np.take_along_axis(tries, where[..., None, None], axis=2)[:, :, 0]
    return NearestSets(sets[rows, chosen], amounts[rows, chosen]), new


def grow(
    pairs: Int[np.ndarray, "spectra pairs 2"],
    amounts: Float[np.ndarray, "spectra pairs 2"],
    count: int,
) -> tuple[Int[np.ndarray, "spectra triples 3"], Float[np.ndarray, "spectra triples shares 3"]]:
    """Sets of three from pairs, each with every other paint, and amounts to try.

    Returns:
        Sets, not sorted and some of them twice, pair first; and their amounts, a few of the third
        paint's.
    """
    everyone = np.broadcast_to(np.arange(count), (*pairs.shape[:2], count))
    others = (everyone[..., None] != pairs[:, :, None]).all(axis=-1)
    thirds = everyone[others].reshape(*pairs.shape[:2], count - 2)
    sets = np.empty((*thirds.shape, 3), np.int32)
    sets[..., :2] = pairs[:, :, None]
    sets[..., 2] = thirds
    tried = np.empty((*thirds.shape, _THIRDS.size, 3))
    tried[..., :2] = amounts[:, :, None, None]
    tried[..., 2] = amounts.sum(axis=-1)[..., None, None] * _THIRDS
    return sets.reshape(len(pairs), -1, 3), tried.reshape(len(pairs), -1, _THIRDS.size, 3)


@Program
def score(
    response: FilmResponse,
    paints: Paints,
    sets: Array,
    amounts: Array,
    ground: Array,
    target: Array,
    whitening: Array,
) -> tuple[Float[Array, "spectra sets"], Int[Array, "spectra sets"]]:
    """Least cost of sets over the amounts to try, and which of these it is; each spectrum has sets
    of its own.

    Args:
        response: of the instrument.
        paints: of the catalogue.
        sets: (spectra, sets, size).
        amounts: to try, (spectra, sets, tries, size).
        ground: internal reflectance, (spectra, grounds, bands).
        target: spectra without the surface, in units of their errors, (spectra, readings).
        whitening: (readings, readings).
    """

    def one(spectrum: tuple) -> tuple[Array, Array]:
        sets, amounts, ground, target = spectrum
        films = film_readings(response, paints, sets, amounts, ground)
        cost = jnp.sum((target - films @ whitening.T) ** 2, axis=-1)
        return cost.min(axis=-1), jnp.argmin(cost, axis=-1)

    return jax.lax.map(one, (sets, amounts, ground, target))
