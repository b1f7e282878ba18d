"""Search for the paints of a catalogue in the spectra of an image: every candidate of a spectrum is
made linear about it (`local.py`).
"""

from dataclasses import dataclass, replace
from typing import ClassVar

import jax
import numpy as np
from jaxtyping import Float, Int

from glazejax.progress import Progress
from glazejax.radiative.common.chunks import by_blocks
from glazejax.spectra import Bands

from ...film.colour_metric import reading_metric
from ...film.model.errors import Prior
from ...identify.result import Identification
from ...identify.search.fit import prior_terms
from ...identify.search.pool import NOBODY, Pool
from ...identify.search.refine import (
    coefficient_projection,
    fit_with_errors,
    slopes_at,
    slopes_by_amount,
)
from ...identify.search.searcher import Searcher
from ...identify.search.task import Chunk, IdentificationTask, Measured, OverGrounds
from ...identify.search.unstated_conditions import CONDITIONS, films_under
from ...identify.search.weigh import Odds, evidence_shares
from .features import REPRESENTATIVES, SpectraReadings, usual_number
from .local import Searched

_STEP = 1e-3
_terms = jax.jit(jax.vmap(prior_terms, in_axes=(0, 0, None, None)))
# Bytes that the process takes besides representatives and windows: Python, JAX, its programs, a
# search.
_BASE = 900 * 2**20


@dataclass(frozen=True)
class PaintSearcher:
    """Search for paints in the spectra of an image.

    Attributes:
        searcher: of the paints.
        ground: internal reflectance, (bands,); None where films hide it.
        kind: of its results.
        piece: spectra that are searched together.
        brightness: an equal change of all bands says as much as of any other.
    """

    searcher: Searcher
    ground: Bands | None
    kind: ClassVar[type[Searched]] = Searched
    piece: ClassVar[int] = 128
    brightness: ClassVar[bool] = True

    @property
    def paints(self) -> tuple[str, ...]:
        """Names of the paints."""
        return self.searcher.paints

    @property
    def prior(self) -> Prior:
        """What was expected."""
        return self.searcher.tasks[False].prior

    @property
    def bare(self) -> Bands:
        """Readings of the ground without paint; 1 where films hide it."""
        task = self.searcher.task
        nothing = np.zeros(task.wavelengths.size)
        if self.ground is None:
            return nothing + 1.0
        return np.asarray(task.response.body(nothing, nothing, self.ground)) + task.surface

    def representatives(self, pixels: int, memory: int) -> tuple[int, int]:
        """Representatives of an image at most within a bound of the memory, and what the process
        takes before the first window, bytes.
        """
        bands = self.searcher.task.wavelengths.size
        # Bytes of a representative, with about a dozen candidates.
        bytes_each = 4 * 12 * (2 * bands**2 + 24 * bands)
        # A third of what is left; the windows take the rest.
        room = (memory - _BASE) // 3 // bytes_each
        most = int(np.clip(room, REPRESENTATIVES[0], usual_number(pixels)))
        return most, _BASE + most * bytes_each

    def prepare(self, progress: Progress) -> None:
        """Do nothing: the paints are set up already."""

    def measure(self, readings: SpectraReadings, noise_sd: SpectraReadings) -> Measured:
        """Spectra as the search takes them, with noise that is known from the whole image: one
        spectrum is a poor estimate of it.

        Args:
            readings: of the spectra.
            noise_sd: of their readings.
        """
        measured = self.searcher.measure(np.maximum(readings, 0.0), self.ground)
        return replace(measured, noise_sd=np.asarray(noise_sd, float)[:, None])

    def search(self, readings: SpectraReadings, noise_sd: SpectraReadings) -> Searched:
        """Search spectra in full, and make what is found linear about each; see `measure`."""
        measured = self.measure(readings, noise_sd)
        pieces = [_local_models(self.searcher, *piece) for piece in self.searcher.search(measured)]
        return Searched.joined(len(pieces), lambda number, name: _single(pieces[number][name]))

    def answers(
        self, readings: SpectraReadings, noise_sd: SpectraReadings
    ) -> dict[str, np.ndarray]:
        """Answers of the full search itself, by the names of a map's arrays; see `measure`."""
        searcher = self.searcher
        batches = [
            Identification.of(
                *batch,
                paints=searcher.paints,
                opaque=searcher.task.hides,
                keep=3,
                spread=searcher.spread,
            )
            for batch in searcher.search(self.measure(readings, noise_sd))
        ]
        searched = Identification.join(batches)
        thickness = searched.amounts[:, 0].sum(axis=1)
        _, _, log_thickness_sd = searched.log_sd
        return {
            "members": searched.members[:, 0],
            "explained": searched.explained,
            "paint_probability": searched.paint_probability,
            "thickness": thickness,
            "thickness_sd": thickness * log_thickness_sd[:, 0],
        }


def _local_models(
    searcher: Searcher, measured: Measured, pool: Pool, odds: Odds
) -> dict[str, np.ndarray]:
    """Arrays of `Searched` for spectra over one ground: candidates that matter, linear about each
    spectrum.
    """
    # Candidates of little probability are not carried on; only their sum is, and whose paints.
    share = odds.candidates / odds.candidates.sum(axis=1, keepdims=True)
    rank = np.argsort(np.argsort(-share, axis=1, kind="stable"), axis=1, kind="stable")
    # Candidates of a representative that are kept: those with this share of the best explanations,
    # and so many at most.
    likely = (share > 3e-4) & (rank < 16)
    row, column = np.nonzero(likely)
    present = (pool.members[..., None] == np.arange(len(searcher.paints))).any(axis=2)
    left_out = np.where(likely, 0.0, share)
    remainder = left_out.sum(axis=1)
    rest_evidence = np.where(likely, 0.0, evidence_shares(pool.log_weight)).sum(axis=1)
    of_rest = left_out / np.maximum(remainder, 1e-12)[:, None]
    rest_paints = np.einsum("sc,scp->sp", of_rest, present)
    # A colour difference is a length in this metric, to first order.
    metric = reading_metric(measured.wavelengths, measured.readings[:, 0])[row]
    arrays: dict[str, np.ndarray] = {}
    condition = pool.condition[row, column]
    brighter = replace(measured, readings=measured.readings + _STEP)
    # One linearization for all candidates under a condition.
    for number in np.unique(condition):
        films, slope = films_under(CONDITIONS[number], searcher.tasks, measured)
        _, brighter_slope = films_under(CONDITIONS[number], searcher.tasks, brighter)
        bent = _density_slopes(films.task, slope, brighter_slope)
        rows = np.flatnonzero(condition == number)
        models = _linear(films, slope, pool, row[rows], column[rows])
        models["weight_by"] = bent[row[rows]]
        for name, values in models.items():
            room = np.zeros((len(row), *values.shape[1:]), values.dtype)
            arrays.setdefault(name, room)[rows] = values
    # How far each candidate is off, as it is seen and with errors of its paints, and how that
    # moves.
    at = row, column
    read = measured.readings[row, 0]
    fitted = pool.readings[row, column, 0]
    eye = np.eye(measured.wavelengths.size)
    arrays["left_by"] = metric @ (eye - arrays["left_by"])
    return {
        **arrays,
        "blur": odds.misfits.noise_delta_e,
        "rest": remainder,
        "rest_evidence": rest_evidence,
        "rest_paints": rest_paints,
        "kept": likely.sum(axis=1),
        "members": pool.members[at],
        "condition": condition,
        "log_weight": pool.log_weight[at],
        "amounts": np.where(pool.members[at] == NOBODY, -np.inf, pool.weighed[at]),
        "covariance": pool.covariance[at],
        "seen": _of_length(
            np.einsum("ncb,nb->nc", metric, read - fitted), odds.misfits.delta_e[at]
        ),
        "seen_by": metric @ (eye - arrays["fitted_by"]),
        "left": _of_length(
            np.einsum("ncb,nb->nc", metric, read - pool.adjusted[row, column, 0]),
            odds.misfits.adjusted_delta_e[at],
        ),
        "shape": odds.misfits.residual[at],
        "fitted": fitted,
    }


def _density_slopes(
    task: IdentificationTask, slope: OverGrounds, brighter_slope: OverGrounds
) -> Float[np.ndarray, "spectra bands"]:
    """Slopes of what changes of variables add to a log density; see
    `glazefit.identify.search.unstated_conditions`.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        bent = (np.log(brighter_slope) - np.log(slope))[:, 0] / _STEP
    # Readings darker than the varnish itself have no film below.
    return task.independent_readings * np.where(np.isfinite(bent), bent, 0.0) / bent.shape[-1]


def _single(values: np.ndarray) -> np.ndarray:
    return values.astype(np.float32) if values.dtype.kind == "f" else values


def _of_length(
    vectors: Float[np.ndarray, "n c"], lengths: Float[np.ndarray, "n"]
) -> Float[np.ndarray, "n c"]:
    """Vectors as long as they should be; those of candidates that were not looked at stay as they
    are.
    """
    norms = np.linalg.norm(vectors, axis=-1)
    usable = np.isfinite(lengths) & (norms > 1e-12)
    return vectors * np.divide(lengths, norms, out=np.ones_like(norms), where=usable)[:, None]


def _linear(
    chunk: Chunk,
    slope: OverGrounds,
    pool: Pool,
    row: Int[np.ndarray, "n"],
    column: Int[np.ndarray, "n"],
) -> dict[str, np.ndarray]:
    """Slopes of candidates under one condition by the readings that were measured.

    Args:
        chunk, slope: the films under it, and slopes of their readings (`films_under`).
        pool: candidates of the spectra.
        row, column: of those under this condition.
    """
    task = chunk.task
    sets = pool.members[row, column]
    logs, weighed_logs = (
        np.where(sets == NOBODY, 0.0, amounts[row, column] - np.log(task.prior.thickness))
        for amounts in (pool.logs, pool.weighed)
    )
    weighed_films, groups, errors = fit_with_errors(
        chunk, row, sets, weighed_logs, pool.log_weight[row, column]
    )
    weighed_slopes = slopes_at(chunk, sets, weighed_films.logs, row)
    near_slopes = slopes_at(chunk, sets, logs, row)
    white = errors.basis[groups.of]
    gradient, prior = _prior_of(task, sets, weighed_films.logs)
    _, whitened_slopes, data, gain = _follow(weighed_slopes, white, gradient, prior)
    followed = np.einsum("nmi,nmb->nib", whitened_slopes, gain)
    residual = chunk.target[row] - weighed_films.readings
    # Curvature of the data over that of the prior, for the evidence.
    ratios = np.maximum(np.linalg.eigvals(np.linalg.solve(prior, data)).real, 0.0)
    # The nearest amounts are fitted with errors of their own: how near each reading must be.
    close = chunk.near_errors.basis[row]
    by_near, _, _, near_gain = _follow(near_slopes, close, *_prior_of(task, sets, logs))
    eye = np.eye(residual.shape[1])
    # How their reading moves: the body, and the surface that takes what is left.
    body = np.einsum("nma,nmb->nab", by_near, near_gain)
    missed = eye - body
    surface = (np.swapaxes(chunk.shapes, 1, 2) @ chunk.shape_estimator)[row]
    free = coefficient_projection(chunk, groups.row, groups.sets, groups.slopes)[groups.of]
    by_measured = slope.reshape(len(chunk), 1, -1)[row]
    numbers = (task.discrepancy.freedom, min(task.independent_readings, len(eye)))
    unseen = np.swapaxes(by_measured, 1, 2)
    return {
        "opaque": np.full(len(row), task.hides),
        "off": np.einsum("nib,nb->ni", white, residual),
        "off_by": (white - followed) * by_measured,
        "amounts_by": gain * by_measured,
        "gradient": gradient,
        "hessian": prior,
        "ratios": ratios,
        "numbers": np.broadcast_to(numbers, (len(row), 2)),
        "fitted_by": (body + surface @ missed) * by_measured / unseen,
        "left_by": (body + free @ missed) * by_measured / unseen,
    }


def _follow(
    slopes: Float[np.ndarray, "n errors readings"],
    white: Float[np.ndarray, "n components readings"],
    gradient: Float[np.ndarray, "n size"],
    hessian: Float[np.ndarray, "n size size"],
) -> tuple[np.ndarray, np.ndarray, np.ndarray, Float[np.ndarray, "n size readings"]]:
    """Slopes of films' readings by their log amounts, as they are and whitened; the data's
    curvature; and how the amounts follow the readings (Gauss-Newton).

    Log amounts are held by the prior and by the readings' own curvature. Readings are linear in the
    amount of a paint of which there is little, so that their second derivative by its logarithm is
    their first; at the best fit that and the residual make up for the prior's gradient. Without it
    a trace would move as far as any noise pushes it.

    Args:
        slopes: of the readings by the log of every paint's k, then s.
        white: whitens readings.
        gradient, hessian: of minus the log prior.
    """
    by = slopes_by_amount(slopes)
    whitened = np.einsum("nib,nmb->nmi", white, by)
    data = whitened @ np.swapaxes(whitened, 1, 2)
    held = hessian + np.maximum(-gradient, 0.0)[..., None] * np.eye(by.shape[1])
    return by, whitened, data, np.linalg.solve(data + held, whitened @ white)


def _prior_of(
    task: IdentificationTask, sets: Int[np.ndarray, "n size"], logs: Float[np.ndarray, "n size"]
) -> tuple[Float[np.ndarray, "n size"], Float[np.ndarray, "n size size"]]:
    """Gradient and Hessian of minus the log prior of films."""

    law = task.prior.spread, task.prior.concentration_sought

    def run(n: Int[np.ndarray, "block"]) -> tuple[jax.Array, jax.Array]:
        return _terms(logs[n], sets[n] != NOBODY, *law)

    return by_blocks(len(sets), 256, run)
