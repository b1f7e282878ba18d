"""Levenberg and Marquardt's least squares for very many small problems side by side.

The steps are those of optimistix's `LevenbergMarquardt`, and so are its answers. What differs is
how the program is
built: one loop whose arrays have a batch axis, in place of a loop that `jax.vmap` turns into one.
JAX traces and compiles it several times faster, which is most of what a first recipe waits for.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

# What optimistix's trust region takes, after Gould, Orban, Sartenaer, Toint (2005): a step counts
# from .01 of the gain that it promised, and from .99 on the next may be 3.5 times as long; after a
# step that does not count, a quarter.
_COUNTS = 0.01
_GOOD = 0.99
_LONGER = 3.5
_SHORTER = 0.25


class _State(NamedTuple):
    point: Float[Array, "n m"]
    tried: Float[Array, "n m"]
    residual: Float[Array, "n rows"]  # at the point
    slopes: Float[Array, "n rows m"]
    length: Float[Array, "n"]  # one over the damping
    first: Bool[Array, ""]
    done: Bool[Array, "n"]
    steps: Array


def levenberg_marquardt(
    residuals: Callable[..., Float[Array, "rows"]],
    start: Float[Array, "n m"],
    *given: Any,
    rtol: float,
    atol: float,
    max_steps: int,
) -> tuple[Float[Array, "n m"], Bool[Array, "n"]]:
    """The points of least squares nearest to some starts, and whether each settled.

    Args:
        residuals: of one problem, (rows,), from its unknowns, (m,), and from its own part of what
            is `given`.
        start: (n, m), a problem a row.
        given: trees of arrays (n, ...), a problem a row.
        rtol, atol: settled when a step changes no unknown and no residual by more than atol + rtol
            times itself.
        max_steps: after these a problem keeps the best point it has seen.

    Source: as `optimistix.LevenbergMarquardt`, `ClassicalTrustRegion` and `cauchy_termination`.
    """

    @jax.vmap
    def look(point: Array, *own: Any) -> tuple[Array, Array]:
        def both(free: Array) -> tuple[Array, Array]:
            value = residuals(free, *own)
            return value, value

        slopes, value = jax.jacfwd(both, has_aux=True)(point)
        return value, slopes

    def step(state: _State) -> _State:
        # What the linear model promised of the last move, and what it gained.
        residual, slopes = look(state.tried, *given)
        move = state.tried - state.point
        promised = _half_square(_times(state.slopes, move) + state.residual) - _half_square(
            state.residual
        )
        gained = _half_square(residual) - _half_square(state.residual)
        # A step counts if it gained a share of the promise; the trust region follows.
        counts = (gained <= _COUNTS * promised) | state.first
        good = (gained < _GOOD * promised) & (promised < 0) & ~state.first
        length = state.length * jnp.where(counts, jnp.where(good, _LONGER, 1.0), _SHORTER)
        still = _small(move, state.tried, rtol, atol) & _small(
            residual - state.residual, residual, rtol, atol
        )

        def choose(new: Array, old: Array) -> Array:
            return jnp.where(counts.reshape(-1, *[1] * (new.ndim - 1)), new, old)

        # From the better of both points, the next trial.
        point = choose(state.tried, state.point)
        residual = choose(residual, state.residual)
        slopes = choose(slopes, state.slopes)
        new = _State(
            point=point,
            tried=point - damped_solution(slopes, residual, 1.0 / length),
            residual=residual,
            slopes=slopes,
            length=length,
            first=jnp.zeros((), bool),
            done=counts & still,
            steps=state.steps + 1,
        )

        # What has settled stays as it is while others go on.
        def frozen(old: Array, new: Array) -> Array:
            return (
                jnp.where(state.done.reshape(-1, *[1] * (new.ndim - 1)), old, new)
                if new.ndim
                else new
            )

        return _State(*map(frozen, state, new))._replace(done=state.done | new.done)

    rows = jax.eval_shape(look, start, *given)[0].shape[1]
    nothing = jnp.zeros((*start.shape[:1], rows), start.dtype)
    begun = _State(
        point=start,
        tried=start,
        residual=nothing,
        slopes=jnp.zeros((*nothing.shape, start.shape[1]), start.dtype),
        length=jnp.ones(len(start), start.dtype),
        first=jnp.ones((), bool),
        done=jnp.zeros(len(start), bool),
        steps=jnp.zeros((), int),
    )
    ended = jax.lax.while_loop(
        lambda state: (state.steps < max_steps) & ~jnp.all(state.done), step, begun
    )
    return ended.point, ended.done & jnp.all(jnp.isfinite(ended.point), axis=1)


def damped_solution(
    matrix: Float[Array, "n rows m"], right: Float[Array, "n rows"], damping: Float[Array, "n"]
) -> Float[Array, "n m"]:
    """x of least |A x - b|^2 + damping |x|^2, side by side; in plain operations, for a few unknowns
    each.

    Modified Gram-Schmidt of A, the damping's rows and b together, as stable as Householder's QR.

    Source: A. Bjorck, BIT 7 (1967) 1.
    """
    count = matrix.shape[2]
    below = jnp.sqrt(damping)[:, None, None] * jnp.eye(count, count + 1, dtype=matrix.dtype)
    rest = jnp.concatenate([jnp.concatenate([matrix, right[..., None]], axis=2), below], axis=1)
    rows = []
    for _ in range(count):
        column = rest[..., 0]
        rest = rest[..., 1:]
        norm = jnp.sqrt(jnp.sum(column**2, axis=1))
        unit = column / jnp.where(norm > 0, norm, 1.0)[:, None]
        row = jnp.sum(unit[..., None] * rest, axis=1)
        rest = rest - unit[..., None] * row[:, None, :]
        rows.append((norm, row))
    # From the last unknown up; the last column of a row is what b has of its direction.
    found: list[Array] = []
    for norm, row in reversed(rows):
        known = sum((row[:, i] * value for i, value in enumerate(found)), jnp.zeros_like(norm))
        value = (row[:, -1] - known) / jnp.where(norm > 0, norm, 1.0)
        # A column of nothing says nothing of its unknown.
        found = [value * (norm > 0).astype(value.dtype), *found]
    return jnp.stack(found, axis=1)


def _times(matrix: Float[Array, "n rows m"], vector: Float[Array, "n m"]) -> Float[Array, "n rows"]:
    # Products and sums: an accelerator's matrix units would round.
    return jnp.sum(matrix * vector[:, None, :], axis=2)


def _half_square(residual: Float[Array, "n rows"]) -> Float[Array, "n"]:
    return 0.5 * jnp.sum(residual**2, axis=1)


def _small(change: Array, value: Array, rtol: float, atol: float) -> Bool[Array, "n"]:
    return jnp.all(jnp.abs(change) < atol + rtol * jnp.abs(value), axis=1)
