"""A stack in which only one coat's k and s are open, tabulated: the sampler asks a spline in place
of the solver, at a tenth of its cost.

Where the other coats' paints, fractions and thicknesses are all known, what a band reads over one
ground depends on k d and s d of the unknown coat alone. A bicubic spline through solved stacks
gives it well below the solver's own tolerance, and beside it how the reading hangs on errors of
the known coats' k and s. Those slopes vary: a clear coat shows every error of the coat below, an
opaque one none. One set of slopes for all of a wide posterior would make one end of it too sure.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..film.model.response import FilmResponse
from ..film.model.spline import HIGHEST, locate, nodes_of, patches, within
from ..film.numerics.least_squares import root_of_log1p
from ..film.reading import Reading
from .forward import Slopes, slopes
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
    layout: Layout,
    logs: Float[np.ndarray, "films errors bands"],
    films: Sequence[Reading],
    smooth: Float[np.ndarray, "bands bands"],
) -> Problem:
    """The problem of a stack with its table.

    Args:
        problem: of `glazefit.posterior.film`.
        layout: of it, for which `can_be_tabulated`.
        logs: log k d and log s d of all coats, without errors; those of the unknown coat do not
            matter.
        films: as measured.
        smooth: covariance of errors of size 1.
    """
    ground = np.asarray(problem.data.ground)
    bands = ground.shape[1]
    response = problem.shared.response
    values = [_of_film(layout, response, *film) for film in zip(logs, ground, strict=True)]
    table = StackTable(
        values=jnp.asarray(np.stack(values)),
        smooth=jnp.asarray(np.broadcast_to(smooth, (len(films), bands, bands))),
        sd=jnp.asarray(np.stack([film.sd for film in films])),
        ground_sd=jnp.asarray(np.stack([film.ground_sd for film in films])),
    )
    return replace(problem, data=problem.data._replace(table=table), bands=bands)


def _of_film(
    layout: Layout,
    response: FilmResponse | None,
    logs: Float[np.ndarray, "errors bands"],
    ground: Float[np.ndarray, "bands grounds"],
) -> Float[np.ndarray, "bands cells 4 4 numbers"]:
    assert layout.unknown_coat is not None
    unknown = slice(2 * layout.unknown_coat, 2 * layout.unknown_coat + 2)
    nodes = np.stack(np.meshgrid(*nodes_of(_NODES), indexing="ij")).reshape(2, -1)
    bands = []
    for band, below in enumerate(ground):
        stack = np.repeat(logs[:, band, None], nodes.shape[1], axis=1)
        # A coat that does not absorb or scatter at all is one of the nodes.
        stack[unknown] = np.log(np.maximum(nodes, 1e-300))
        wide = np.broadcast_to(below, (1, nodes.shape[1], below.size))
        there = slopes(layout, response, stack[None], wide)
        # Those of the unknown coat are no errors.
        by_log = np.delete(np.asarray(there.by_log)[0], unknown, axis=0)
        solved = np.concatenate([there.body, there.by_ground, by_log])
        bands.append(patches(np.swapaxes(solved, 1, 2).reshape(-1, _NODES, _NODES)))
    return np.stack(bands)


def look_up(table: StackTable, thickness: Float[Array, "2 bands"]) -> Slopes:
    """From k d and s d of the unknown coat."""
    absorption, scattering, _ = within(jnp, *thickness)
    row, over = locate(jnp, absorption, HIGHEST[0], _NODES)
    column, across = locate(jnp, scattering, HIGHEST[1], _NODES)
    cell = row * (_NODES - 1) + column
    patch = table.values.at[jnp.arange(len(cell)), cell].get(mode="promise_in_bounds")
    weights = over[:, :, None] * across[:, None, :]
    numbers = jnp.sum(patch * weights[..., None], axis=(1, 2))
    bands, grounds = table.sd.shape
    each = jnp.moveaxis(numbers.reshape(bands, -1, grounds), 1, 0)
    return Slopes(body=each[0], by_ground=each[1], by_log=each[2:])


def standard_deviation(
    table: StackTable, seen: Slopes, size: Float[Array, ""]
) -> Float[Array, "bands grounds"]:
    """Of each reading by itself: noise, the ground's error, and errors of the known coats of this
    size.
    """
    variance = table.sd**2 + (seen.by_ground * table.ground_sd) ** 2
    alike = jnp.diagonal(table.smooth)[:, None]
    return jnp.sqrt(variance + size**2 * alike * jnp.sum(seen.by_log**2, axis=0))


def misfit(
    table: StackTable, off: Float[Array, "bands grounds"], seen: Slopes, size: Float[Array, ""]
) -> Float[Array, "rows"]:
    """Residuals of readings that are off by this, where the known coats have errors of this size,
    and of the determinant of the readings' covariance.
    """
    rows = off.size
    through = seen.by_ground * table.ground_sd / table.sd
    precision = 1.0 / (table.sd * jnp.sqrt(1.0 + through**2))
    white = (off * precision).reshape(-1)
    noise = root_of_log1p(through).reshape(-1)
    if not len(seen.by_log):
        return jnp.concatenate([white, noise])
    scaled = seen.by_log * precision
    caused = jnp.einsum("ebg,bc,ech->bgch", scaled, table.smooth, scaled).reshape(rows, rows)
    root = jnp.linalg.cholesky(jnp.eye(rows) + size**2 * caused)
    white = jax.scipy.linalg.solve_triangular(root, white, lower=True)
    # The diagonal is 1 or more; with a constant added its logarithm has a smooth root.
    determinant = jnp.sqrt(1.0 + 2.0 * jnp.log(jnp.diagonal(root)))
    return jnp.concatenate([white, noise, determinant])
