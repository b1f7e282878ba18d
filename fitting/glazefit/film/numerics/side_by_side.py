"""Levenberg and Marquardt's steps, many small problems side by side: a solver of optimistix."""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import optimistix as optx
from jaxtyping import Array, Bool, Float

from .linear_steps import (
    LONGER,
    SHORTER,
    PerRow,
    PerVariable,
    SlopeMatrices,
    damped_solution,
    normal_solution,
)


class _State(NamedTuple):
    tried: PerVariable
    residual: PerRow  # at the point
    slopes: SlopeMatrices
    length: Float[Array, "n"]  # one over the damping
    first: Bool[Array, "n"]
    done: Bool[Array, "n"]


class SideBySide(optx.AbstractLeastSquaresSolver):
    """Levenberg and Marquardt's steps for a batch of problems, (n, unknowns), each on its own.

    Row i of the residuals, (n, rows), must depend on row i of the unknowns alone. What has settled
    stays as it is while others go on.

    Attributes:
        rtol, atol: settled when a step changes no unknown and no residual by more than atol + rtol
            times itself.

    Source: as `optimistix.LevenbergMarquardt`, `ClassicalTrustRegion` and `cauchy_termination`.
    """

    rtol: float
    atol: float
    norm: Callable = optx.max_norm

    def init(self, fn, y, args, options, f_struct, aux_struct, tags) -> _State:
        """The state before the first step, which looks at the start itself."""
        return _State(
            tried=y,
            residual=jnp.zeros(f_struct.shape, y.dtype),
            slopes=jnp.zeros((*f_struct.shape, y.shape[1]), y.dtype),
            length=jnp.ones(len(y), y.dtype),
            first=jnp.ones(len(y), bool),
            done=jnp.zeros(len(y), bool),
        )

    def step(self, fn, y, args, options, state, tags) -> tuple[Array, _State, Any]:
        """One trial of every problem that has not settled."""
        residual, slopes, aux = _look(fn, state.tried, args)
        # What the linear model promised of the last move, and what it gained.
        move = state.tried - y
        before = _half_square(state.residual)
        promised = _half_square(_times(state.slopes, move) + state.residual) - before
        gained = _half_square(residual) - before
        # What optimistix's trust region takes: a step counts from .01 of the gain that it promised,
        # and from .99 on the next may be longer.
        counts = (gained <= 0.01 * promised) | state.first
        counts &= jnp.all(jnp.isfinite(state.tried), axis=1)
        good = (gained < 0.99 * promised) & (promised < 0) & ~state.first
        length = state.length * jnp.where(counts, jnp.where(good, LONGER, 1.0), SHORTER)
        still = self._small(move, state.tried) & self._small(residual - state.residual, residual)

        # From the better of both points, the next trial.
        point = _where(counts, state.tried, y)
        residual = _where(counts, residual, state.residual)
        slopes = _where(counts, slopes, state.slopes)
        # The first is unrolled: for few unknowns.
        damped = damped_solution if y.shape[1] <= 7 else normal_solution
        new = _State(
            tried=point - damped(slopes, residual, 1.0 / length),
            residual=residual,
            slopes=slopes,
            length=length,
            first=state.first,
            done=counts & still,
        )
        frozen = _State(
            *(_where(state.done, old, now) for old, now in zip(state, new, strict=True))
        )
        return (
            _where(state.done, y, point),
            frozen._replace(first=jnp.zeros_like(state.first), done=state.done | new.done),
            aux,
        )

    def terminate(self, fn, y, args, options, state, tags) -> tuple[Array, optx.RESULTS]:
        """True if all have settled."""
        return jnp.all(state.done), optx.RESULTS.successful

    def postprocess(
        self, fn, y, aux, args, options, state, tags, result
    ) -> tuple[Array, Any, dict[str, Any]]:
        """Flags of those that have settled, as a statistic."""
        return y, aux, {"settled": state.done}

    def _small(self, change: Array, value: Array) -> Bool[Array, "n"]:
        return jnp.all(jnp.abs(change) < self.atol + self.rtol * jnp.abs(value), axis=1)


def _look(fn: Callable, point: PerVariable, args: Any) -> tuple[Array, Array, Any]:
    """Residuals, their slopes, (n, rows, m), and what else the function gives."""

    def along(direction: PerVariable) -> tuple[Array, Array, Any]:
        return jax.jvp(lambda free: fn(free, args), (point,), (direction,), has_aux=True)

    # Along one unknown of all problems at a time: each knows its own alone.
    directions = jnp.broadcast_to(
        jnp.eye(point.shape[1], dtype=point.dtype)[:, None], (point.shape[1], *point.shape)
    )
    return jax.vmap(along, out_axes=(None, -1, None))(directions)


def _where(chosen: Bool[Array, "n"], value: Array, alternative: Array) -> Array:
    return jnp.where(chosen.reshape(-1, *[1] * (value.ndim - 1)), value, alternative)


def _times(matrix: SlopeMatrices, vector: PerVariable) -> PerRow:
    # Products and sums: an accelerator's matrix units would round.
    return jnp.sum(matrix * vector[:, None, :], axis=2)


def _half_square(residual: PerRow) -> Float[Array, "n"]:
    return 0.5 * jnp.sum(residual**2, axis=1)
