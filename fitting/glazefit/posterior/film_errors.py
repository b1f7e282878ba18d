"""Where the paints' error is made linear.

A film 30 % off its catalogue has other slopes than the catalogue's film. So readings are made
linear about the film as it is likeliest to be: the coats at the mode times their likeliest error, a
Gaussian process fitted to what the coats leave unexplained. Mode, likeliest error and slopes depend
on each other and are found in turn. The first slopes are those at the film that fits best if
readings were as wrong as paints of a usual error make them.

Where only one coat's k and s are open, posteriors are wide, and slopes are those of each place in
them (`glazefit.posterior.stack_table`).
"""

import functools
from collections.abc import Sequence
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from glazejax.programs import Program

from ..film.model.errors import Prior, smooth_kernel
from ..film.reading import Reading
from .film import FilmData, FilmResiduals, FilmShared, ScaledReadings, optical, surface
from .forward import Slopes, slopes
from .laplace import Modes, climb, find_modes
from .layout import Layout
from .problem import Problem
from .stack_table import can_be_tabulated, tabulated


@functools.partial(Program, fixed=("layout",))
def _at(
    layout: Layout, free: Float[Array, "films dims"], data: FilmData, shared: FilmShared
) -> tuple[Float[Array, "films errors bands"], Float[Array, "films"]]:
    """Log k d and log s d of the coats without error, and what the surface adds to a reading."""
    thickness = jax.vmap(lambda f, d: optical(layout, f, d, shared))(free, data)
    logs = jnp.moveaxis(jnp.log(jnp.maximum(thickness, 1e-9)), -1, 1)
    above = jax.vmap(lambda f: surface(layout, f, shared))(free)
    return logs.reshape(len(logs), -1, logs.shape[-1]), above


def pose_errors(
    problem: Problem, films: Sequence[Reading], prior: Prior, *, seed: int = 0
) -> tuple[Problem, Modes]:
    """The problem of `glazefit.posterior.film.pose_stack` with the paints' error, and its modes."""
    assert isinstance(problem.residuals, FilmResiduals)
    layout = problem.residuals.layout
    smooth = smooth_kernel(films[0].wavelengths, prior.error_length)
    if can_be_tabulated(layout):
        nothing = np.zeros((len(films), problem.dims))
        logs, _ = _at(layout, nothing, problem.data, problem.shared)
        problem = tabulated(problem, layout, np.asarray(logs), films, smooth)
        problem = replace(problem, scaled=ScaledReadings(layout))
        # An opaque coat and a thin one may read alike, and each is a narrow valley.
        return problem, find_modes(problem, starts=24, seed=seed)
    # A reading is off by this, if paints are some per cent off.
    rough = [np.eye(film.sd.size) / np.hypot(film.sd, 0.02).ravel() for film in films]
    found = find_modes(
        replace(problem, data=problem.data._replace(whiten=jnp.asarray(np.stack(rough)))),
        seed=seed,
    )
    logs, _ = (np.asarray(a) for a in _at(layout, found.points[:, 0], problem.data, problem.shared))
    delta = np.zeros_like(logs)
    # Modes are found after each linearisation, the fifth of which changes little.
    for turn in range(5):
        if turn:
            logs, delta = _likeliest(problem, layout, found.points[:, 0], films, smooth)
        problem = expand(problem, layout, films, logs + delta, delta, smooth)
        found = climb(problem, found.points)
    return problem, found


def _likeliest(
    problem: Problem,
    layout: Layout,
    free: Float[np.ndarray, "films dims"],
    films: Sequence[Reading],
    smooth: Float[np.ndarray, "bands bands"],
) -> tuple[Float[np.ndarray, "films errors bands"], Float[np.ndarray, "films errors bands"]]:
    """Log k d and log s d of the coats, and their likeliest errors, by Gauss-Newton steps."""
    data = problem.data
    logs, above = (np.asarray(a) for a in _at(layout, free, data, problem.shared))
    unexplained = np.asarray(data.reading) - above[:, None, None]
    share = np.exp(free[:, -1])[:, None, None] ** 2
    delta = np.asarray(data.shift)
    for _ in range(8):
        there = slopes(layout, problem.shared.response, logs + delta, data.ground)
        jacobian = _jacobian(there)
        carried = jacobian @ delta.reshape(len(films), -1, 1)
        left = (unexplained - there.body).reshape(carried.shape) + carried
        variance = _variance(films, there).reshape(len(films), -1)
        back = share * _prior_times(smooth, jacobian)
        covariance = jacobian @ back + np.eye(variance.shape[1]) * variance[:, None, :]
        step = (back @ np.linalg.solve(covariance, left)).reshape(delta.shape) - delta
        # A step of more than 1 in log k or log s goes beyond where slopes hold.
        delta = delta + step / np.maximum(1.0, np.abs(step).max(axis=(1, 2), keepdims=True))
    return logs, delta


def _jacobian(there: Slopes) -> Float[np.ndarray, "films rows errors"]:
    """From errors of log k and log s of all bands and coats to the readings of all bands and
    grounds.
    """
    by_log = np.asarray(there.by_log)
    films, errors, bands, grounds = by_log.shape
    whole = np.einsum("febg,bc->fbgec", by_log, np.eye(bands))
    return whole.reshape(films, bands * grounds, errors * bands)


def _prior_times(
    smooth: np.ndarray, jacobian: np.ndarray
) -> Float[np.ndarray, "films errors rows"]:
    """Prior covariance of the errors of log k and log s, per unit, times the transposed
    Jacobian.
    """
    # Errors of log k and log s, and of coats, are independent.
    each = jacobian.reshape(*jacobian.shape[:2], -1, len(smooth)) @ smooth
    return np.swapaxes(each.reshape(jacobian.shape), 1, 2)


def _variance(films: Sequence[Reading], there: Slopes) -> Float[np.ndarray, "films bands grounds"]:
    """Of the readings by the instrument's noise and the grounds' own error."""
    through = np.asarray(there.by_ground) * np.stack([film.ground_sd for film in films])
    return np.stack([film.sd for film in films]) ** 2 + through**2


def expand(
    problem: Problem,
    layout: Layout,
    films: Sequence[Reading],
    logs: Float[np.ndarray, "films errors bands"],
    delta: Float[np.ndarray, "films errors bands"],
    smooth: Float[np.ndarray, "bands bands"],
) -> Problem:
    """The problem with its readings linear in errors about `delta`, where the films have these log
    k d and log s d.
    """
    there = slopes(layout, problem.shared.response, logs, problem.data.ground)
    root = 1.0 / np.sqrt(_variance(films, there).reshape(len(films), -1))
    jacobian = _jacobian(there)
    offset = -(jacobian @ delta.reshape(len(films), -1, 1)).reshape(there.body.shape)
    scaled = jacobian * root[..., None]
    spread, axes = np.linalg.eigh(scaled @ _prior_times(smooth, scaled))
    data = problem.data._replace(
        shift=jnp.asarray(delta),
        offset=jnp.asarray(offset),
        whiten=jnp.asarray(np.swapaxes(axes, 1, 2) * root[:, None, :]),
        spread=jnp.asarray(np.sqrt(np.maximum(spread, 0.0))),
    )
    return replace(problem, data=data)
