"""Where the model's error is made linear.

A film 30 % off its catalogue has other slopes than the catalogue's film. So readings are made
linear about the film as it is likeliest to be: the mixture at the mode times its likeliest error, a
Gaussian process fitted to what the mixture leaves unexplained. Mode, likeliest error and slopes
depend on each other and are found in turn. The first slopes are those of k d and s d as the
readings alone tell them, band by band, with half the gloss that the darkest band allows: too much
would leave that band no light of its own and no error, and settle the gloss too soon.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple, Protocol

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from glazejax.programs import Program

from ..film.films import Instrument
from ..film.model.errors import Prior, smooth_kernel
from ..film.model.response import FilmResponse
from ..film.reading import Reading
from .bands import join_bands, pose_bands
from .film import mixture, surface
from .laplace import Modes, climb, find_modes
from .problem import Problem

_ROUNDS = 4
# Gauss-Newton steps towards the likeliest error, and the longest of them in log k or log s.
_STEPS = 8
_LONGEST = 1.0


class Slopes(NamedTuple):
    """The body's reflectance of every band, and its slopes by log k d and log s d, of every coat if
    there are more.
    """

    body: Float[np.ndarray, "films bands grounds"]
    by_log: Float[np.ndarray, "films errors bands grounds"]
    by_ground: Float[np.ndarray, "films bands grounds"]


class Optical(Protocol):
    """How the readings of a problem's films hang on optical thickness."""

    def slopes(
        self,
        logs: Float[np.ndarray, "films errors bands"],
        ground: Float[np.ndarray, "films bands grounds"],
    ) -> Slopes:
        """At these log k d and log s d."""
        ...

    def at(
        self, problem: Problem, free: Float[np.ndarray, "films dims"]
    ) -> tuple[Float[np.ndarray, "films errors bands"], Float[np.ndarray, "films"]]:
        """Log k d and log s d of paints without error, and what the surface adds to a reading."""
        ...


class Tabulated(NamedTuple):
    """Films of one coat: an `Optical`."""

    table: FilmResponse

    def slopes(self, logs: np.ndarray, ground: np.ndarray) -> Slopes:
        """See `Optical`."""
        body, by_k, by_s, by_ground = (
            np.asarray(a) for a in _slopes(logs[:, 0], logs[:, 1], ground, self.table)
        )
        return Slopes(body, np.stack([by_k, by_s], axis=1), by_ground)

    def at(self, problem: Problem, free: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """See `Optical`."""
        k, s, surface = (np.asarray(a) for a in _at(free, problem.data, problem.shared))
        return np.log(np.maximum(np.stack([k, s], axis=1), 1e-9)), surface


@Program
def _slopes(
    log_k: Float[Array, "films bands"],
    log_s: Float[Array, "films bands"],
    ground: Float[Array, "films bands grounds"],
    table: FilmResponse,
) -> tuple[Array, Array, Array, Array]:
    def total(log_k: Array, log_s: Array, ground: Array) -> tuple[Array, Array]:
        body = table.body(jnp.exp(log_k), jnp.exp(log_s), ground)
        return jnp.sum(body), body

    wide = (jnp.broadcast_to(a[..., None], ground.shape) for a in (log_k, log_s))
    slopes, body = jax.grad(total, argnums=(0, 1, 2), has_aux=True)(*wide, ground)
    return body, *slopes


@Program
def _at(free: Float[Array, "films dims"], data, shared) -> tuple[Array, Array, Array]:
    """k d and s d of the mixture and what the surface adds."""
    k, s = jax.vmap(mixture)(free, data)
    return k, s, jax.vmap(surface, in_axes=(0, 0, None))(free, data, shared)


def pose_errors(
    problem: Problem,
    films: Sequence[Reading],
    instrument: Instrument,
    prior: Prior,
    *,
    seed: int = 0,
) -> tuple[Problem, Modes]:
    """The problem of `glazefit.posterior.film.pose_films` with the model's error, and its modes."""
    smooth = smooth_kernel(films[0].wavelengths, prior.error_length)
    how = Tabulated(problem.shared.response)
    first = _likeliest_logs(films, instrument)
    problem = expand(problem, films, how, first, np.zeros_like(first), smooth)
    return settle(problem, films, how, find_modes(problem, seed=seed), smooth)


def settle(
    problem: Problem,
    films: Sequence[Reading],
    how: Optical,
    found: Modes,
    smooth: Float[np.ndarray, "bands bands"],
) -> tuple[Problem, Modes]:
    """The problem made linear in the errors about the likeliest ones, and its modes, in some rounds
    from first ones.
    """
    for _ in range(_ROUNDS):
        logs, delta = _likeliest(problem, found.points[:, 0], films, how, smooth)
        problem = expand(problem, films, how, logs + delta, delta, smooth)
        found = climb(problem, found.points)
    return problem, found


def _likeliest_logs(
    films: Sequence[Reading], instrument: Instrument
) -> Float[np.ndarray, "films 2 bands"]:
    """Log k d and log s d that each band's readings are likeliest to come from."""
    seen = instrument.seen_surface
    gloss = [
        0.5 * min(1.0, float(film.reflectance.min()) / seen) if seen else 1.0 for film in films
    ]
    bands = join_bands(
        [pose_bands(film, g, instrument) for film, g in zip(films, gloss, strict=True)]
    )
    free = find_modes(bands).points[:, 0].reshape(len(films), -1, 2)
    return np.stack([free[..., 0] + free[..., 1], free[..., 1]], axis=1)


def _likeliest(
    problem: Problem,
    free: Float[np.ndarray, "films dims"],
    films: Sequence[Reading],
    how: Optical,
    smooth: Float[np.ndarray, "bands bands"],
) -> tuple[Float[np.ndarray, "films errors bands"], Float[np.ndarray, "films errors bands"]]:
    """Log k d and log s d of the mixtures, and their likeliest errors, by Gauss-Newton steps."""
    data = problem.data
    logs, surface = how.at(problem, free)
    unexplained = np.asarray(data.reading) - surface[:, None, None]
    share = np.exp(free[:, -1])[:, None, None] ** 2
    delta = np.asarray(data.shift)
    for _ in range(_STEPS):
        slopes = how.slopes(logs + delta, np.asarray(data.ground))
        jacobian = _jacobian(slopes)
        carried = jacobian @ delta.reshape(len(films), -1, 1)
        left = (unexplained - slopes.body).reshape(carried.shape) + carried
        variance = _variance(films, slopes).reshape(len(films), -1)
        back = share * _prior_times(smooth, jacobian)
        covariance = jacobian @ back + np.eye(variance.shape[1]) * variance[:, None, :]
        step = (back @ np.linalg.solve(covariance, left)).reshape(delta.shape) - delta
        delta = delta + step / np.maximum(
            1.0, np.abs(step).max(axis=(1, 2), keepdims=True) / _LONGEST
        )
    return logs, delta


def _jacobian(slopes: Slopes) -> Float[np.ndarray, "films rows errors"]:
    """From errors of log k and log s of all bands, and of all coats, to the readings of all bands
    and grounds.
    """
    films, errors, bands, grounds = slopes.by_log.shape
    whole = np.einsum("febg,bc->fbgec", slopes.by_log, np.eye(bands))
    return whole.reshape(films, bands * grounds, errors * bands)


def _prior_times(
    smooth: np.ndarray, jacobian: np.ndarray
) -> Float[np.ndarray, "films errors rows"]:
    """Prior covariance of the errors of log k and log s, per unit, times the transposed
    Jacobian.
    """
    bands = len(smooth)
    each = range(0, jacobian.shape[-1], bands)
    return np.concatenate(
        [smooth @ np.swapaxes(jacobian[..., i : i + bands], 1, 2) for i in each], axis=1
    )


def _variance(films: Sequence[Reading], slopes: Slopes) -> Float[np.ndarray, "films bands grounds"]:
    """Of the readings by the instrument's noise and the grounds' own error."""
    through = slopes.by_ground * np.stack([film.ground_sd for film in films])
    return np.stack([film.sd for film in films]) ** 2 + through**2


def expand(
    problem: Problem,
    films: Sequence[Reading],
    how: Optical,
    logs: Float[np.ndarray, "films errors bands"],
    delta: Float[np.ndarray, "films errors bands"],
    smooth: Float[np.ndarray, "bands bands"],
) -> Problem:
    """The problem with its readings linear in errors about `delta`, where the films have these log
    k d and log s d.
    """
    slopes = how.slopes(logs, np.asarray(problem.data.ground))
    root = 1.0 / np.sqrt(_variance(films, slopes).reshape(len(films), -1))
    jacobian = _jacobian(slopes)
    offset = -(jacobian @ delta.reshape(len(films), -1, 1)).reshape(slopes.body.shape)
    scaled = jacobian * root[..., None]
    spread, axes = np.linalg.eigh(scaled @ _prior_times(smooth, scaled))
    data = problem.data._replace(
        shift=jnp.asarray(delta),
        offset=jnp.asarray(offset),
        whiten=jnp.asarray(np.swapaxes(axes, 1, 2) * root[:, None, :]),
        spread=jnp.asarray(np.sqrt(np.maximum(spread, 0.0))),
    )
    return replace(problem, data=data)
