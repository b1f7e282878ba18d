"""Spectra of many bands, gathered at a few: what films read at these, with their smooth errors,
determines their readings at all others.

Everything that is fitted lies in the span of these few bands, f = G f', up to an error that is
stated (`FewBands.missed`) and counts as noise. Then nothing is lost by gathering: the likelihood of
a spectrum y with noise of variance D is that of its least squares in the span, z, whose errors have
the covariance M^-1 = (G^T D^-1 G)^-1, times what no film changes,

    log N(y; G f', D + G S G^T) = log N(z; f', M^-1 + S)
        - (|D^-1/2 (y - G z)|^2 + log det D + log det M + (bands - few) log 2 pi) / 2.

Of the errors of a film's own paints, what varies between the bands is left out; what that costs is
measured by `python -m benchmarks.paint.few_bands`.
"""

import threading
from dataclasses import dataclass, replace
from functools import cached_property
from weakref import WeakKeyDictionary

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int

from ...film.model.errors import ModelError, smooth_kernel
from .chunk import tolerance
from .pool import Pool
from .table import FilmTables, Paints, films_at_random
from .task import AllBands, IdentificationTask, Measured

MISSED = 2e-4
"""Standard deviation by which a reading may be missed between the bands that are kept: below an
instrument's noise.
"""
# So many bands are all taken.
_MANY = 100
# Standard deviations of smooth errors to be met between the bands in addition to the films, by the
# distance over which they stay similar, nm.
_SMOOTH = ((0.003, 100.0), (0.002, 60.0))
# Films over these grounds hold the information.
_GROUNDS = (0.03, 0.5, 0.93)


@dataclass(frozen=True, eq=False)
class FewBands:
    """Some bands of a grid, and how readings at all bands follow from these."""

    index: Int[np.ndarray, "few"]
    spread: Float[np.ndarray, "bands few"]
    missed: Float[np.ndarray, "bands"]  # standard deviation by which films are missed, as predicted
    rough: Float[np.ndarray, "bands"]  # the same of the model's smooth error, for each unit of it

    def weighted_square(
        self, weights: Float[np.ndarray, "spectra grounds bands"]
    ) -> Float[np.ndarray, "spectra grounds few few"]:
        """G^T diag(weights) G."""
        count = len(self.index)
        first, second = np.triu_indices(count)
        # One product of two matrices: numpy takes each spectrum by itself if there are three axes.
        half = weights.reshape(-1, weights.shape[-1]).astype(np.float32) @ self._products
        half = half.reshape(*weights.shape[:2], -1)
        out = np.empty((*weights.shape[:2], count, count))
        out[..., first, second] = half
        out[..., second, first] = half
        return out

    @cached_property
    def _products(self) -> Float[np.ndarray, "bands pairs"]:
        """Of every two columns of G, in single precision: they are many."""
        first, second = np.triu_indices(len(self.index))
        spread = self.spread.astype(np.float32)
        return spread[:, first] * spread[:, second]


def choose_bands(
    films: Float[np.ndarray, "films bands"],
    wavelengths: Float[np.ndarray, "bands"],
    length: float,
) -> FewBands:
    """Bands one after the other, each the one that those before it determine worst, until none is
    missed by more than `MISSED`; the first and the last are among them.

    The best linear prediction, for readings that vary as these films and some smooth errors do: a
    Cholesky decomposition with pivots.

    Args:
        films: what films read.
        wavelengths: (bands,), nm.
        length: distance over which the model's smooth error stays similar, nm.
    """
    # Covariance of readings over films, a common level, and smooth errors.
    count = len(wavelengths)
    covariance = films.T @ films / len(films) + 1.0
    for sd, reach in _SMOOTH:
        covariance += sd**2 * smooth_kernel(wavelengths, reach)
    # Cholesky's columns, the band of the largest remaining variance next; the ends come first.
    remaining = np.diag(covariance).copy()
    factor = np.zeros((count, count))
    index: list[int] = []
    while len(index) < 2 or (remaining.max() > MISSED**2 and len(index) < count):
        band = (0, count - 1)[len(index)] if len(index) < 2 else int(np.argmax(remaining))
        chosen = factor[:, : len(index)]
        column = (covariance[:, band] - chosen @ chosen[band]) / np.sqrt(remaining[band])
        factor[:, len(index)] = column
        remaining = np.maximum(remaining - column**2, 0.0)
        index.append(band)
    # Regression of all bands on these, and what it misses of films and of the smooth error.
    order = np.sort(index)
    spread = np.linalg.solve(covariance[np.ix_(order, order)], covariance[order]).T
    smooth = smooth_kernel(wavelengths, length)
    explained = np.sum(
        spread * (2.0 * smooth[:, order] - spread @ smooth[np.ix_(order, order)]), axis=1
    )
    return FewBands(order, spread, np.sqrt(remaining), np.sqrt(np.maximum(1.0 - explained, 0.0)))


_FEW: WeakKeyDictionary[FilmTables, tuple[FewBands, FilmTables] | None] = WeakKeyDictionary()
_LOCK = threading.Lock()


def few_bands_of(task: IdentificationTask) -> tuple[FewBands, IdentificationTask] | None:
    """The bands at which a task's spectra are gathered, and the task on these; None where all are
    taken: if they are few, or if the search is to be thorough.
    """
    if len(task.wavelengths) <= _MANY or not task.effort.single_precision:
        return None
    with _LOCK:
        if task.tables not in _FEW:
            _FEW[task.tables] = _choose(task)
        choice = _FEW[task.tables]
    if choice is None:
        return None
    few_bands, tables = choice
    at = few_bands.index
    paints = Paints(*(values[:, at] for values in task.paints))
    return few_bands, task._replace(
        paints=paints,
        errors=task.errors[..., at],
        modes=task.modes[..., at, :],
        wavelengths=task.wavelengths[at],
        tables=tables,
    )


def _choose(task: IdentificationTask) -> tuple[FewBands, FilmTables] | None:
    films = films_at_random(
        *task.tables.single, task.prior.spread, np.asarray(_GROUNDS), task.wavelengths.size
    )
    few_bands = choose_bands(films, task.wavelengths, task.discrepancy.length)
    # All are taken where no more than a quarter of them can be left out.
    if len(few_bands.index) > 0.75 * len(few_bands.spread):
        return None
    paints = Paints(
        *(jnp.asarray(np.asarray(values)[:, few_bands.index]) for values in task.paints)
    )
    return few_bands, FilmTables(task.response, paints, task.max_paints, task.prior.spread)


def can_gather(few_bands: FewBands, measured: Measured) -> bool:
    """True if the grounds are stated by these bands too."""
    grounds = measured.grounds
    # A ground that is missed by more between the bands is taken at all of them.
    return bool(np.abs(grounds - grounds[..., few_bands.index] @ few_bands.spread.T).max() <= 0.005)


def gather(few_bands: FewBands, measured: Measured, discrepancy: ModelError) -> Measured:
    """Spectra at few bands: their least squares in what films can read.

    What these bands miss of films and of the model's smooth error counts as noise.
    """
    # Variance of a reading about what few bands predict of it.
    spectra, grounds, bands = measured.readings.shape
    count = len(few_bands.index)
    rough = (discrepancy.amplitude + discrepancy.share * measured.readings) * few_bands.rough
    variance = measured.noise_sd**2 + few_bands.missed**2 + rough**2
    precise = 1.0 / variance

    # Weighted least squares of the readings at all bands.
    normal = few_bands.weighted_square(precise)
    covariance = np.linalg.inv(normal)

    def least_squares(values: np.ndarray, by: np.ndarray, inverse: np.ndarray) -> np.ndarray:
        return (inverse @ ((values * by) @ few_bands.spread)[..., None])[..., 0]

    readings = least_squares(measured.readings, precise, covariance)
    doubt = least_squares(measured.doubt, precise[:, None], covariance[:, None])
    # What is left is the same for every film.
    off = measured.readings - readings @ few_bands.spread.T
    height = -0.5 * (
        np.log(variance).sum(axis=(1, 2))
        + np.linalg.slogdet(normal)[1].sum(axis=1)
        + grounds * (bands - count) * np.log(2.0 * np.pi)
    )
    # What counts as near, gathered in the same way.
    near = few_bands.weighted_square(1.0 / tolerance(measured) ** 2)
    all_bands = AllBands(
        noise=_over_grounds(covariance),
        near=_over_grounds(np.linalg.inv(near)),
        near_precision=_over_grounds(near),
        outside=np.sum(off**2 * precise, axis=(1, 2)),
        height=height,
        in_all=np.full(spectra, float(grounds * bands)),
    )
    return replace(
        measured,
        wavelengths=measured.wavelengths[few_bands.index],
        readings=readings,
        grounds=measured.grounds[..., few_bands.index],
        noise_sd=np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1)),
        doubt=doubt,
        all_bands=all_bands,
    )


def _over_grounds(
    blocks: Float[np.ndarray, "spectra grounds few few"],
) -> Float[np.ndarray, "spectra readings readings"]:
    """One matrix over all grounds, between which there is nothing."""
    spectra, grounds, size, _ = blocks.shape
    matrices = np.zeros((spectra, grounds, size, grounds, size))
    for n in range(grounds):
        matrices[:, n, :, n] = blocks[:, n]
    return matrices.reshape(spectra, grounds * size, -1)


def spread_out(few_bands: FewBands, pool: Pool) -> Pool:
    """A pool's readings at all bands, from those at few."""

    def wide(readings: Float[np.ndarray, "spectra candidates few"]) -> np.ndarray:
        by_ground = readings.reshape(*readings.shape[:2], -1, len(few_bands.index))
        return (by_ground @ few_bands.spread.T).reshape(*readings.shape[:2], -1)

    return replace(pool, readings=wide(pool.readings), adjusted=wide(pool.adjusted))
