"""Two coats in a map: spectra that one coat leaves in doubt are compared with a table of stacks
over the map's one ground, and the nearest of these are fitted.

What lies below a coat counts as one Lambertian ground, as under a varnish: so a stack is two looks
at the table of single films, some thousand times as fast as the solver.
"""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from glazejax.radiative.common.threads import in_threads

from ...film.model.response import FilmResponse
from ...identify.search.chunk import Chunk
from ...identify.search.fit import log_set_prior
from ...identify.search.pool import Pool
from ...identify.search.searcher import Searcher
from ...identify.search.surface import with_surface
from ...identify.search.task import IdentificationTask, Measured
from ...identify.search.two_coats import fit_with_own_errors
from ...identify.search.weigh import Odds, odds_of
from .survey import Features

# Of the table of films of each response.
_OPTICS: dict[int, "TableOptics"] = {}
# Amounts of the upper coat and of the lower, in usual thicknesses, and shares of the lower's first
# paint.
_UPPER = (0.03, 0.07, 0.15, 0.3, 0.6, 1.1, 2.0)
_LOWER = (0.3, 0.8, 1.8)
_SHARES = (0.03, 0.1, 0.25, 0.5, 0.75, 0.92)
# Stacks of each spectrum that are fitted, by the number of their paints. What is not fitted is
# missing in the probability of two coats: chosen on films that are drawn from what is expected, for
# at most twice the time of one coat (`python -m benchmarks.maps.coats_told`).
_FITTED = {2: 24, 3: 40}
# How probable a body of one paint and of two is under another paint.
_BODIES = {2: 0.5, 3: 0.5}
# Spectra that are fitted together: one shape, one program.
_TOGETHER = 8
# Odds of the first candidate below which one coat leaves a spectrum in doubt, chosen as `_FITTED`.
_OPEN = 0.95
# Misfit (Delta E00) above which one coat does.
_POOR = 1.0


@dataclass(frozen=True, eq=False)
class TableOptics:
    """Stands for `film.model.optics.Optics` where stacks are read off the table of films."""

    response: FilmResponse

    def body(
        self,
        absorption: Float[Array, "*batch coats"],
        scattering: Float[Array, "*batch coats"],
        ground: Float[Array, "*batch"],
        tolerance: float,
    ) -> Float[Array, "*batch"]:
        """Reflectance of coats on a ground, top first, without the outer surface's part."""
        del tolerance
        for coat in range(absorption.shape[-1] - 1, 0, -1):
            body = self.response.body(absorption[..., coat], scattering[..., coat], ground)
            ground = self.response.internal(body)
        return self.response.body(absorption[..., 0], scattering[..., 0], ground)


def table_optics(response: FilmResponse) -> Any:
    """The one of a response: programs are compiled for each anew."""
    return _OPTICS.setdefault(id(response), TableOptics(response))


@dataclass(frozen=True)
class Stacks:
    """Stacks of one paint over one or two, over one ground, on a grid of amounts.

    Attributes:
        paints: of each kind of stack, the upper one first, (kinds, size).
        logs: log amounts of the grid, (points, size).
        features: what the stacks read, (kinds, points, directions).
    """

    paints: Int[np.ndarray, "kinds size"]
    logs: Float[np.ndarray, "points size"]
    features: Float[np.ndarray, "kinds points directions"]


@dataclass(frozen=True)
class StackSearch:
    """Search for two coats over one ground.

    Attributes:
        task: of the films, whose optics are `TableOptics`.
        ground: internal reflectance, (bands,).
        features: by which spectra are compared.
    """

    task: IdentificationTask
    ground: Float[np.ndarray, "bands"]
    features: Features

    @classmethod
    def of(
        cls, task: IdentificationTask, ground: Float[np.ndarray, "bands"], features: Features
    ) -> "StackSearch":
        """For the paints of a task."""
        return cls(task._replace(optics=table_optics(task.response)), ground, features)

    def __reduce__(self) -> tuple[Any, ...]:
        # A process that it is sent to makes the table itself.
        return StackSearch, (self.task, self.ground, self.features)

    @cached_property
    def tables(self) -> dict[int, Stacks]:
        """Stacks by the number of their paints."""
        return {2: self._table(2)} | (
            {3: self._table(3)} if min(self.task.max_paints, self.task.paint_count) > 2 else {}
        )

    def _table(self, size: int) -> Stacks:
        count = self.task.paint_count
        bodies = list(itertools.combinations(range(count), size - 1))
        shares = (1.0,) if size == 2 else _SHARES
        lower = np.array([[a * s, a * (1.0 - s)][: size - 1] for a in _LOWER for s in shares])
        k, s = (
            np.asarray(a, np.float32)
            for a in (self.task.paints.absorption, self.task.paints.scattering)
        )
        response = self.task.response
        index = np.array(bodies)
        below_k, below_s = (np.einsum("pm,cmb->cpb", lower, a[index]) for a in (k, s))
        below = np.asarray(_internal(response, below_k, below_s, self.ground))
        upper = np.array(_UPPER)
        paints = []
        features = []
        for top in range(count):
            own = np.array([top not in body for body in bodies])
            read = np.asarray(
                _over(
                    response,
                    upper[:, None] * k[top],
                    upper[:, None] * s[top],
                    below[own],
                )
            )
            flat = self.features(read.reshape(-1, read.shape[-1]) + self.task.mean_surface)
            features.append(flat.reshape(int(own.sum()), -1, flat.shape[-1]))
            paints.append(np.column_stack([np.full(int(own.sum()), top), index[own]]))
        points = [(u, *amounts) for amounts in lower for u in upper]
        return Stacks(
            paints=np.concatenate(paints).astype(np.int32),
            logs=np.log(points),
            features=np.concatenate(features),
        )

    def candidates(self, measured: Measured) -> Pool:
        """The best stacks of spectra, fitted."""
        features = self.features(measured.readings[:, 0])
        first, *others = (
            self.fit(measured, *_nearest_stacks(features, table, _FITTED[size]))
            for size, table in self.tables.items()
        )
        return first.merge(*others)

    def fit(
        self,
        measured: Measured,
        sets: Int[np.ndarray, "spectra stacks size"],
        logs: Float[np.ndarray, "spectra stacks size"],
    ) -> Pool:
        """Stacks of spectra, fitted.

        Args:
            measured: spectra.
            sets: paints of each stack, the upper one first.
            logs: log amounts to start from, in usual thicknesses.
        """
        parts = np.split(np.arange(len(measured)), range(_TOGETHER, len(measured), _TOGETHER))
        return Pool.join(in_threads(lambda n: self._fit(measured.take(n), sets[n], logs[n]), parts))

    def _fit(self, measured: Measured, sets: np.ndarray, logs: np.ndarray) -> Pool:
        task = self.task
        count = len(measured)
        size = sets.shape[-1]
        rows = np.resize(np.arange(count), _TOGETHER)
        chunk = Chunk(task, measured.take(rows))
        sets, logs = sets[rows], logs[rows]
        coats = np.broadcast_to(np.array([0] + [1] * (size - 1), jnp.result_type(int)), sets.shape)
        kinds = task.paint_count * np.prod(
            [(task.paint_count - 1 - n) / (n + 1) for n in range(size - 1)]
        )
        share = np.log(task.prior.stacked * _BODIES[size] / kinds)
        share = share - log_set_prior(task, sets)
        pool = fit_with_own_errors(chunk, sets, coats, logs)
        pool = replace(pool, log_weight=pool.log_weight + share)
        return with_surface(chunk, pool).of(np.arange(count))


@jax.jit
def _internal(response: FilmResponse, k: Array, s: Array, ground: Array) -> Array:
    return response.internal(response.body(k, s, ground))


@jax.jit
def _over(response: FilmResponse, k: Array, s: Array, below: Array) -> Array:
    """(kinds, points, bands) -> (kinds, points * amounts, bands)."""
    read = response.body(k, s, below[:, :, None])
    return read.reshape(len(read), -1, read.shape[-1])


def _nearest_stacks(
    features: Float[np.ndarray, "spectra directions"], table: Stacks, keep: int
) -> tuple[Int[np.ndarray, "spectra kept size"], Float[np.ndarray, "spectra kept size"]]:
    """Kinds of stacks that come nearest to spectra, and amounts to start from."""
    kinds, points, _ = table.features.shape
    keep = min(keep, kinds)
    half = 0.5 * np.sum(table.features**2, axis=-1)
    nearest_of = np.empty((len(features), kinds), np.float32)
    point = np.empty((len(features), kinds), np.int64)
    step = max(1, 2**22 // (points * len(features)))
    for first in range(0, kinds, step):
        block = slice(first, first + step)
        off = half[block] - np.einsum("sd,kpd->skp", features, table.features[block], optimize=True)
        point[:, block] = off.argmin(axis=-1)
        nearest_of[:, block] = off.min(axis=-1)
    best = np.argsort(nearest_of, axis=1, kind="stable")[:, :keep]
    rows = np.arange(len(features))[:, None]
    return table.paints[best], table.logs[point[rows, best]]


def in_doubt(odds: Odds) -> Bool[np.ndarray, "spectra"]:
    """Spectra that one coat fits poorly, or of which it leaves open what they are."""
    first = odds.candidates.max(axis=1) / odds.total
    return (first < _OPEN) | (odds.misfit > _POOR)


def with_stacks(
    search: StackSearch, measured: Measured, pool: Pool, odds: Odds
) -> tuple[Pool, Odds]:
    """The pool with stacks of those spectra that one coat leaves in doubt, and its odds."""
    weight = pool.log_weight + np.log1p(-search.task.prior.stacked)
    pool = replace(pool, log_weight=weight)
    doubtful = np.flatnonzero(in_doubt(odds))
    if not doubtful.size:
        return pool, odds
    found = search.candidates(measured.take(doubtful))
    pool = pool.merge(found.spread(doubtful, len(measured)))
    # Many stacks explain a spectrum equally well, each a little probable: all are looked at.
    return pool, odds_of(measured, pool, search.task.prior, looked_at=pool.members.shape[1])


def search_coats(
    searcher: Searcher, stacks: StackSearch | None, measured: Measured
) -> Iterator[tuple[Measured, Pool, Odds]]:
    """Candidates and their odds, with two coats where these are sought and one is in doubt."""
    for batch, pool, odds in searcher.search(measured):
        if stacks is None:
            yield batch, pool, odds
        else:
            yield (batch, *with_stacks(stacks, batch, pool, odds))
