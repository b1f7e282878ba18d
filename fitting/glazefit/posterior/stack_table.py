"""A stack in which only one coat's k and s are open, tabulated: the sampler asks a spline in place
of the solver, at a tenth of its cost.

Where the other coats' paints, fractions and thicknesses are all known, what a band reads over one
ground depends on k d and s d of the unknown coat alone. A bicubic spline through solved stacks
gives it well below the solver's own tolerance, and beside it how the reading hangs on errors of
the known coats' k and s. Those slopes vary: a clear coat shows every error of the coat below, an
opaque one none. One set of slopes for all of a wide posterior would make one end of it too sure.
"""

import functools
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from glazejax.programs import Program

from ..film.model.optics import Optics
from ..film.model.spline import HIGHEST, locate, nodes_of, patches
from ..film.numerics.least_squares import root_of_log1p
from ..film.reading import Reading
from .layout import Layout
from .problem import Problem

_NODES = 56


class StackTable(NamedTuple):
    """Of films; the spline of `FilmResponse`, a table for each band, and for the same reasons not
    `glazejax.interpolated` (100 times as slow, and off by .013).
    """

    # Readings over each ground, their slopes by each ground, then by each error: log k and log s of
    # each known coat.
    values: Float[Array, "*films bands cells 4 4 numbers"]
    smooth: Float[Array, "*films bands bands"]  # covariance of errors of size 1
    sd: Float[Array, "*films bands grounds"]
    ground_sd: Float[Array, "*films bands grounds"]


def can_be_tabulated(layout: Layout) -> bool:
    """Whether one coat is unknown and everything is known of all others."""
    return layout.unknown_coat is not None and not any((*layout.fractions, *layout.thickness))


def tabulated(
    problem: Problem,
    coats: Float[np.ndarray, "films 2 bands coats"],
    films: Sequence[Reading],
    smooth: Float[np.ndarray, "bands bands"],
    tolerance: float,
) -> Problem:
    """The problem of a stack with its table.

    Args:
        problem: of `glazefit.posterior.stack`, for which `can_be_tabulated`.
        coats: k d and s d of all coats, without errors; those of the unknown coat do not matter.
        films: as measured.
        smooth: covariance of errors of size 1.
        tolerance: of the solver.
    """
    layout = problem.residuals.layout  # pyright: ignore[reportAttributeAccessIssue]
    ground = np.asarray(problem.data.ground)
    bands = ground.shape[1]
    values = [_of_film(layout, *film, tolerance) for film in zip(coats, ground, strict=True)]
    table = StackTable(
        values=jnp.asarray(np.stack(values)),
        smooth=jnp.asarray(np.broadcast_to(smooth, (len(films), bands, bands))),
        sd=jnp.asarray(np.stack([film.sd for film in films])),
        ground_sd=jnp.asarray(np.stack([film.ground_sd for film in films])),
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


@functools.partial(Program, fixed=("optics", "unknown", "tolerance"))
def _solved(
    optics: Optics,
    unknown: int,
    stack: Float[Array, "2 nodes coats"],
    ground: Float[Array, "grounds"],
    tolerance: float,
) -> Float[Array, "numbers nodes"]:
    """Numbers of a `StackTable`."""
    shape = (stack.shape[1], ground.shape[0])
    wide = jnp.broadcast_to(stack[:, :, None], (2, *shape, stack.shape[2]))

    def total(stack: Array, ground: Array) -> tuple[Array, Array]:
        seen = optics.body(stack[0], stack[1], ground, tolerance)
        return jnp.sum(seen), seen

    slope = jax.grad(total, argnums=(0, 1), has_aux=True)
    (by_coats, by_ground), seen = slope(wide, jnp.broadcast_to(ground, shape))
    # By logarithms; those of the unknown coat are no errors.
    by_log = jnp.delete(by_coats * wide, unknown, axis=-1)
    by_log = jnp.moveaxis(by_log, (3, 0, 2), (0, 1, 2)).reshape(-1, shape[0])
    return jnp.concatenate([seen.T, by_ground.T, by_log])


class Seen(NamedTuple):
    """What the coats read, without errors and the surface's part, and its slopes."""

    body: Float[Array, "bands grounds"]
    by_ground: Float[Array, "bands grounds"]
    by_log: Float[Array, "errors bands grounds"] | None  # none if no coat is known


def look_up(table: StackTable, thickness: Float[Array, "2 bands"]) -> Seen:
    """From k d and s d of the unknown coat."""
    # A coat beyond the table is opaque, and what it reads hangs on k/s alone.
    beyond = jnp.max(thickness / jnp.array(HIGHEST)[:, None], axis=0)
    thickness = thickness / jnp.maximum(beyond, 1.0)
    row, over = locate(jnp, thickness[0], HIGHEST[0], _NODES)
    column, across = locate(jnp, thickness[1], HIGHEST[1], _NODES)
    cell = row * (_NODES - 1) + column
    patch = table.values.at[jnp.arange(len(cell)), cell].get(mode="promise_in_bounds")
    weights = over[:, :, None] * across[:, None, :]
    numbers = jnp.sum(patch * weights[..., None], axis=(1, 2))
    bands, grounds = table.sd.shape
    body, by_ground, *by_log = jnp.moveaxis(numbers.reshape(bands, -1, grounds), 1, 0)
    return Seen(body=body, by_ground=by_ground, by_log=jnp.stack(by_log) if by_log else None)


def standard_deviation(
    table: StackTable, seen: Seen, size: Float[Array, ""]
) -> Float[Array, "bands grounds"]:
    """Of each reading by itself: noise, the ground's error, and errors of the known coats of this
    size.
    """
    variance = table.sd**2 + (seen.by_ground * table.ground_sd) ** 2
    if seen.by_log is not None:
        alike = jnp.diagonal(table.smooth)[:, None]
        variance = variance + size**2 * alike * jnp.sum(seen.by_log**2, axis=0)
    return jnp.sqrt(variance)


def misfit(
    table: StackTable, off: Float[Array, "bands grounds"], seen: Seen, size: Float[Array, ""]
) -> Float[Array, "rows"]:
    """Residuals of readings that are off by this, where the known coats have errors of this size,
    and of the determinant of the readings' covariance.
    """
    rows = off.size
    through = seen.by_ground * table.ground_sd / table.sd
    precision = 1.0 / (table.sd * jnp.sqrt(1.0 + through**2))
    white = (off * precision).reshape(-1)
    noise = root_of_log1p(through).reshape(-1)
    if seen.by_log is None:
        return jnp.concatenate([white, noise])
    scaled = seen.by_log * precision
    caused = jnp.einsum("ebg,bc,ech->bgch", scaled, table.smooth, scaled).reshape(rows, rows)
    root = jnp.linalg.cholesky(jnp.eye(rows) + size**2 * caused)
    white = jax.scipy.linalg.solve_triangular(root, white, lower=True)
    # The diagonal is 1 or more; with a constant added its logarithm has a smooth root.
    determinant = jnp.sqrt(1.0 + 2.0 * jnp.log(jnp.diagonal(root)))
    return jnp.concatenate([white, noise, determinant])
