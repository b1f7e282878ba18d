"""Least squares: one door, `levenberg_marquardt`, and loops for what optimistix cannot say.

Small problems, hundreds side by side, go through `optimistix.least_squares` with a solver of our
own, `side_by_side.SideBySide`. Its steps are those of optimistix's `LevenbergMarquardt`, and so are
its answers; but its arrays have a batch axis, in place of a loop that `jax.vmap` turns into one.
JAX traces and compiles that several times faster.
Its linear algebra is plain XLA: two batched LAPACK calls in one compiled program can hang for ever
on the CPU (jaxlib 0.10, 0.11.0).

Three loops remain in addition:

- `damped_newton`, a fixed number of steps with slopes in closed form, under `jax.vmap`: optimistix
  takes twice the time.
- `descend`, one problem whose linear algebra NumPy does, by its structure; optimistix compiles the
  whole loop, and a compiled solver of that structure takes half a minute for every new size.
- `descend_within`, many problems between bounds, whose every look takes a solver's run: those that
  have settled are not looked at again, while a compiled loop goes on with all until the last. The
  last steps of recipes for eight colours solve 40 blocks of stacks in 1.7 s of 4.3 s; such a loop
  would solve 120.
"""

from collections.abc import Callable
from typing import Any, NamedTuple, TypeAlias

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from .columns import take_rows
from .linear_steps import LONGER, SHORTER, PerVariable

Point: TypeAlias = Float[np.ndarray, "n"]
"""A number for each unknown of one problem."""
PerProblem: TypeAlias = Float[np.ndarray, "n"]
"""A number for each of many problems."""
Positions: TypeAlias = Float[np.ndarray, "n m"]
"""Values of the unknowns of each problem, in NumPy."""


def levenberg_marquardt(
    residuals: Callable[..., Float[Array, "rows"]],
    start: PerVariable,
    *problem_data: Any,
    rtol: float,
    atol: float,
    max_steps: int,
) -> tuple[PerVariable, Bool[Array, "n"]]:
    """The points of least squares nearest to some starts, and whether each settled.

    Args:
        residuals: of one problem, (rows,), from its unknowns, (m,), and from its own part of
            `problem_data`.
        start: (n, m), a problem a row.
        problem_data: trees of arrays (n, ...), a problem a row.
        rtol, atol: see `side_by_side.SideBySide`.
        max_steps: after these a problem keeps the best point it has seen.
    """
    # While a program is traced, and not with the module: a kept one does without optimistix.
    import optimistix as optx

    from .side_by_side import SideBySide

    # A start without a number must not stop the others.
    finite = jnp.all(jnp.isfinite(start), axis=1)
    solution = optx.least_squares(
        lambda point, problem: jax.vmap(residuals)(point, *problem),
        SideBySide(rtol=rtol, atol=atol),
        jnp.where(finite[:, None], start, 0.0),
        problem_data,
        max_steps=max_steps,
        throw=False,
    )
    return jnp.where(finite[:, None], solution.value, start), solution.stats["settled"] & finite


def inverse_small(matrix: Float[Array, "n n"]) -> tuple[Float[Array, "n n"], Float[Array, ""]]:
    """Inverse and log determinant of a positive definite matrix of a few rows, by Gauss and
    Jordan's elimination, which needs no pivoting there.
    """
    identity = np.eye(len(matrix), dtype=matrix.dtype)
    beside = jnp.concatenate([matrix, identity], axis=1)
    log_determinant = jnp.zeros((), matrix.dtype)
    for n, unit in enumerate(identity):
        pivot = jnp.maximum(beside[n, n], 1e-12)
        log_determinant += jnp.log(pivot)
        row = beside[n] / pivot
        others = beside - jnp.outer(beside[:, n], row)
        beside = jnp.where(unit[:, None] > 0, row, others)
    return beside[:, len(matrix) :], log_determinant


Seen = tuple[Float[Array, ""], Float[Array, "n"], Float[Array, "n n"], Any]
"""Cost, its gradient, a positive definite matrix near its Hessian, and whatever else a caller wants
back.
"""


def damped_newton(
    look: Callable[[Float[Array, "n"]], Seen],
    start: Float[Array, "n"],
    limits: tuple[float, float],
    *,
    steps: int | Array,
    longest: float,
) -> tuple[Float[Array, "n"], Seen]:
    """A fixed number of Newton steps with Levenberg's damping: the best point, and what is seen
    there.

    For very many candidates side by side, with slopes that their model knows in closed form.
    Optimistix, which finds them by differentiation and steps until the last candidate of a batch
    has settled, takes twice the time for identification (6.9 s of CPU for 3.2 s, 100 spectra among
    pairs of 24 paints).

    Args:
        look: at a point.
        start: first point.
        limits: every unknown stays between these.
        steps: how many.
        longest: step of one unknown.
    """

    def step(_: int | Array, state: tuple) -> tuple:
        point, values, damping = state
        _, gradient, hessian, _ = values
        damped = hessian + damping * (
            jnp.diag(jnp.diagonal(hessian)) + 1e-6 * jnp.eye(point.shape[0], dtype=point.dtype)
        )
        move = jnp.clip(-inverse_small(damped)[0] @ gradient, -longest, longest)
        tried = jnp.clip(point + move, *limits)
        new = look(tried)
        better = new[0] < values[0]
        best = jax.tree.map(lambda a, b: jnp.where(better, a, b), (tried, new), (point, values))
        return (*best, jnp.where(better, damping * 0.2, jnp.maximum(damping, 1e-3) * 6.0))

    # The first round looks at the start itself: `look` stands in the program once, which compiles
    # in half the time.
    shapes = jax.eval_shape(look, start)
    nothing = jax.tree.map(jnp.zeros_like, shapes)
    unseen = (
        jnp.full_like(nothing[0], jnp.inf),
        nothing[1],
        jnp.eye(start.shape[0], dtype=start.dtype),
        nothing[3],
    )
    point, values, _ = jax.lax.fori_loop(
        0, steps + 1, step, (start, unseen, jnp.asarray(0.1, start.dtype))
    )
    return point, values


class Surroundings(NamedTuple):
    """A problem near a point."""

    cost: Float[Any, ""]  # half the sum of squares
    gradient: Float[Any, "n"]
    normal: Any  # the normal matrix, in whatever form `solve` takes it


class Descent(NamedTuple):
    """End of `descend`, what was seen there, the number of steps, and whether they settled."""

    point: Point
    seen: Surroundings
    steps: int
    settled: bool


def descend(
    look: Callable[[Point], Surroundings],
    solve: Callable[[Any, float, Float[np.ndarray, "n"]], Float[np.ndarray, "n"]],
    start: Point,
    *,
    first_step: float,
    max_steps: int,
    tolerance: float,
    note: Callable[[int], object],
) -> Descent:
    """Levenberg and Marquardt's least squares of one problem whose linear algebra is NumPy's.

    Args:
        look: what a point sees.
        solve: x of (normal matrix + damping) x = gradient; raises numpy.linalg.LinAlgError where
            the damping does not do.
        start: first point.
        first_step: one over the damping of the first step.
        max_steps: that are tried.
        tolerance: settled when no unknown moves by more, relative or in its own unit.
        note: called before each step with the number of those that are done.
    """
    point = start
    step = first_step
    settled = False
    values = look(point)
    steps = 0
    while steps < max_steps and not settled:
        note(steps)
        steps += 1
        try:
            move = -solve(values.normal, 1.0 / step, values.gradient)
        except np.linalg.LinAlgError:
            step *= SHORTER
            continue
        # The normal equations give m' N m = -slope - square/step.
        slope = values.gradient @ move
        gain = -slope - 0.5 * (-slope - move @ move / step)
        tried = point + move
        trial_values = look(tried)
        reached = float(values.cost) - float(trial_values.cost)
        share = reached / gain if np.isfinite(reached) and gain > 0 else -1.0
        if share > 0:
            # One over the damping above which a small step says that the fit is done; damped more,
            # it may be small for that.
            settled = (
                step >= 1.0
                and bool(np.all(np.abs(move) < tolerance * (1.0 + np.abs(tried))))
                and reached < tolerance * (1.0 + float(trial_values.cost))
            )
            point = tried
            values = trial_values
        elif gain <= tolerance**2 * float(values.cost):
            settled = True
        # Of the damping, by how well a step is predicted: the usual rule of a trust region.
        step *= LONGER if share > 0.75 else SHORTER if share < 0.25 else 1.0
    return Descent(point, values, steps, settled)


class Looks(NamedTuple):
    """Costs of many problems at their points, half the gradient, and half of Gauss and Newton's
    curvature.
    """

    cost: PerProblem  # sum of squares; a problem whose first is no number stays where it is
    slope: Float[np.ndarray, "n m"]
    curvature: Float[np.ndarray, "n m m"]


class Bounds(NamedTuple):
    """Least and largest values of the unknowns, and the longest step of each."""

    low: Float[np.ndarray, "m"]
    high: Float[np.ndarray, "m"]
    longest: float


class BoundedDescent(NamedTuple):
    """End of `descend_within`, with the cost there, whether each problem settled, and the
    number of its steps that counted.
    """

    point: Positions
    cost: PerProblem
    settled: Bool[np.ndarray, "n"]
    steps: Int[np.ndarray, "n"]


def descend_within(
    look: Callable[[Int[np.ndarray, "rows"], Float[np.ndarray, "rows m"]], Looks],
    start: Positions,
    start_values: Looks,
    bounds: Bounds,
    *,
    promise: float,
    max_steps: int,
) -> BoundedDescent:
    """Levenberg and Marquardt's least squares between bounds, of many problems side by side.

    A problem is settled when a full step promises to lower the root of its cost by less than
    `promise`: an unknown without influence keeps no problem from its end.

    Args:
        look: costs of some problems, by number, at points.
        start, start_values: first points, and what `look` gives there.
        bounds: of every problem's unknowns.
        promise: in the unit of a residual.
        max_steps: that are tried.
    """
    point = start.copy()
    values = Looks(*map(np.copy, start_values))
    damping = 1e-3 * _largest(values.curvature)
    steps = np.zeros(len(point), int)
    settled = np.zeros(len(point), bool)
    going = np.flatnonzero(np.isfinite(values.cost))
    for _ in range(max_steps):
        local = take_rows(values, going)
        # So little damping leaves a step as good as full, and its matrix regular.
        least = 1e-9 * _largest(local.curvature)
        promised = bounded_step(point[going], local, bounds, least)[1]
        settled[going] = promised < promise
        unsettled = promised >= promise
        going = going[unsettled]
        if going.size == 0:
            break
        damping[going] = np.maximum(damping[going], least[unsettled])
        trial_point, _ = bounded_step(
            point[going], take_rows(local, unsettled), bounds, damping[going]
        )
        trial = look(going, trial_point)
        # A cost that is no number is no better.
        better = trial.cost < values.cost[going]
        damping[going] *= np.where(better, 0.2, 5.0)
        rows = going[better]
        point[rows] = trial_point[better]
        steps[rows] += 1
        for old, new in zip(values, trial, strict=True):
            old[rows] = new[better]
    return BoundedDescent(point, values.cost, settled, steps)


def _largest(curvature: Float[np.ndarray, "n m m"]) -> PerProblem:
    return np.maximum(curvature.max(axis=(1, 2)), 1e-9)


def bounded_step(
    point: Positions,
    values: Looks,
    bounds: Bounds,
    damping: PerProblem,
) -> tuple[Positions, PerProblem]:
    """End of a damped step within bounds, and by how much it should lower the cost's root."""
    # What is not there has no slope, and stays; so does what is at a bound and drawn beyond it.
    fixed = (
        (values.slope == 0)
        | ((point <= bounds.low) & (values.slope > 0))
        | ((point >= bounds.high) & (values.slope < 0))
    )
    least = np.clip(bounds.low - point, -bounds.longest, 0.0)
    most = np.clip(bounds.high - point, 0.0, bounds.longest)
    step = np.zeros(point.shape)
    for _ in range(point.shape[1]):
        # The rest follows what stops at a bound, or it would end where neither is best.
        pull = (values.curvature @ np.where(fixed, step, 0.0)[..., None])[..., 0]
        slope = np.where(fixed, 0.0, values.slope + pull)
        matrix = np.where(fixed[:, :, None] | fixed[:, None, :], 0.0, values.curvature)
        matrix = matrix + damping[:, None, None] * np.eye(point.shape[1])
        step = np.where(fixed, step, -np.linalg.solve(matrix, slope[..., None])[..., 0])
        clipped = np.clip(step, least, most)
        # One stops at a time: where a valley is narrow, the others must follow it along.
        beyond = np.abs(step - clipped)
        rows = np.flatnonzero(beyond.any(axis=1))
        if rows.size == 0:
            break
        farthest = beyond[rows].argmax(axis=1)
        step[rows, farthest] = clipped[rows, farthest]
        fixed[rows, farthest] = True
    step = np.clip(step, least, most)
    gain = -2.0 * np.sum(values.slope * step, axis=1)
    gain -= np.einsum("ni,nij,nj->n", step, values.curvature, step)
    cost = np.maximum(values.cost - np.maximum(gain, 0.0), 0.0)
    return point + step, np.sqrt(values.cost) - np.sqrt(cost)


def root_of_log1p(root: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """Square root of log(1 + x^2), smooth through x = 0: a log-determinant as a residual."""
    square = root**2
    small = square < 1e-6
    safe = jnp.where(small, 1.0, square)
    return root * jnp.where(small, 1.0 - square / 4.0, jnp.sqrt(jnp.log1p(safe) / safe))
