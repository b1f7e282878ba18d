"""A stack in which only one coat's k and s are open, tabulated: the sampler asks a spline in place
of the solver, at a tenth of its cost.

Where the other coats' paints, fractions and thicknesses are all known, what a band reads over one
ground depends on k d and s d of the unknown coat alone. A bicubic spline through solved stacks gives
it well below the solver's own tolerance, and beside it how the reading hangs on errors of the known
coats' k and s. Those slopes vary: a clear coat shows every error of the coat below, an opaque one
none. One set of slopes for all of a wide posterior would make one end of it too sure.
"""

import functools
from dataclasses import replace
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..film.model.optics import Optics
from ..film.model.spline import HIGHEST, locate, nodes_of, patches
from .layout import Layout
from .problem import Problem

_NODES = 56


class StackTable(NamedTuple):
    """Of films."""

    # The reading over each ground, then its slope by each error: log k and log s of each known coat.
    values: Float[Array, "*films bands cells 4 4 numbers"]
    errors: Float[Array, "*films errors bands"]  # about which the slopes are taken
    smooth: Float[Array, "*films bands bands"]  # covariance of errors of size 1
    precision: Float[Array, "*films bands grounds"]  # one over the readings' standard deviations


def can_be_tabulated(layout: Layout) -> bool:
    """Whether one coat is unknown and everything is known of all others."""
    return layout.unknown_coat is not None and not any((*layout.fractions, *layout.thickness))


def tabulated(
    problem: Problem,
    coats: Float[np.ndarray, "films 2 bands coats"],
    smooth: Float[np.ndarray, "bands bands"],
    variance: Float[np.ndarray, "films bands grounds"],
    tolerance: float,
) -> Problem:
    """The problem of a stack with its table.

    Args:
        problem: of `glazefit.posterior.stack`, its errors settled, for which `can_be_tabulated`.
        coats: k d and s d of all coats with their likeliest errors; those of the unknown coat do not
            matter.
        smooth: covariance of errors of size 1.
        variance: of the readings, without such errors.
        tolerance: of the solver.
    """
    layout = problem.residuals.layout  # pyright: ignore[reportAttributeAccessIssue]
    films, bands, _ = variance.shape
    known = [n for n in range(len(layout.sizes)) if n != layout.unknown_coat]
    errors = np.asarray(problem.data.shift).reshape(films, -1, 2, bands)[:, known]
    ground = np.asarray(problem.data.ground)
    values = [_of_film(layout, *film, tolerance) for film in zip(coats, ground, strict=True)]
    table = StackTable(
        values=jnp.asarray(np.stack(values)),
        errors=jnp.asarray(errors.reshape(films, -1, bands)),
        smooth=jnp.asarray(np.broadcast_to(smooth, (films, bands, bands))),
        precision=jnp.asarray(1.0 / np.sqrt(variance)),
    )
    return replace(problem, data=problem.data._replace(table=table), bands=bands)


def _of_film(
    layout: Layout,
    coats: Float[np.ndarray, "2 bands coats"],
    ground: Float[np.ndarray, "bands grounds"],
    tolerance: float,
) -> Float[np.ndarray, "bands cells 4 4 numbers"]:
    unknown = layout.unknown_coat
    assert unknown is not None
    nodes = np.stack(np.meshgrid(*nodes_of(_NODES), indexing="ij"), axis=-1).reshape(-1, 2)
    bands = []
    for band, below in enumerate(ground):
        stack = np.repeat(coats[:, band, None], len(nodes), axis=1)
        stack[:, :, unknown] = nodes.T
        solved = np.asarray(_solved(layout.optics, unknown, stack, below, tolerance))
        bands.append(patches(solved.reshape(-1, _NODES, _NODES)))
    return np.stack(bands)


@functools.partial(jax.jit, static_argnums=(0, 1, 4))
def _solved(
    optics: Optics,
    unknown: int,
    stack: Float[Array, "2 nodes coats"],
    ground: Float[Array, "grounds"],
    tolerance: float,
) -> Float[Array, "numbers nodes"]:
    """Readings over each ground, then their slopes."""
    wide = jnp.broadcast_to(
        stack[:, :, None], (*stack.shape[:2], ground.shape[0], stack.shape[2])
    )

    def total(stack: Array) -> tuple[Array, Array]:
        seen = optics.body(*stack, ground, tolerance)
        return jnp.sum(seen), seen

    slopes, seen = jax.grad(total, has_aux=True)(wide)
    # By logarithms; those of the unknown coat are no errors.
    by_log = jnp.delete(slopes * wide, unknown, axis=-1)
    by_log = jnp.moveaxis(by_log, (3, 0, 2), (0, 1, 2)).reshape(-1, stack.shape[1])
    return jnp.concatenate([seen.T, by_log])


def body_and_slopes(
    table: StackTable, thickness: Float[Array, "2 bands"]
) -> tuple[Float[Array, "bands grounds"], Float[Array, "errors bands grounds"]]:
    """What the coats read, from k d and s d of the unknown one, and its slopes by the known coats'
    errors.
    """
    row, over = locate(jnp, thickness[0], HIGHEST[0], _NODES)
    column, across = locate(jnp, thickness[1], HIGHEST[1], _NODES)
    cell = row * (_NODES - 1) + column
    patch = table.values.at[jnp.arange(len(cell)), cell].get(mode="promise_in_bounds")
    weights = over[:, :, None] * across[:, None, :]
    numbers = jnp.sum(patch * weights[..., None], axis=(1, 2))
    bands, grounds = table.precision.shape
    slopes = numbers[:, grounds:].reshape(bands, -1, grounds)
    return numbers[:, :grounds], jnp.moveaxis(slopes, 1, 0)


def misfit(
    table: StackTable,
    off: Float[Array, "bands grounds"],
    slopes: Float[Array, "errors bands grounds"],
    size: Float[Array, ""],
) -> Float[Array, "rows"]:
    """Residuals of readings that are off by this from those of the likeliest errors, with errors of
    this size, and of the determinant of their covariance.
    """
    rows = off.size
    # Linear in the errors, about the likeliest.
    off = off + jnp.sum(slopes * table.errors[:, :, None], axis=0)
    scaled = slopes * table.precision
    caused = jnp.einsum("ebg,bc,ech->bgch", scaled, table.smooth, scaled).reshape(rows, rows)
    root = jnp.linalg.cholesky(jnp.eye(rows) + size**2 * caused)
    white = jax.scipy.linalg.solve_triangular(
        root, (off * table.precision).reshape(-1), lower=True
    )
    # The diagonal is 1 or more; with a constant added its logarithm has a smooth root.
    return jnp.concatenate([white, jnp.sqrt(1.0 + 2.0 * jnp.log(jnp.diagonal(root)))])
